//! A policy together with the robot and the task that it was trained for: what every format is written from.

use canter_gait::observation::{ObservationBlock, Sensors};
use canter_gait::{Controller, Memory, PhaseClock, Policy, Runtime, RuntimeSettings, Workspace};
use canter_sim::Task;
use canter_train::policy_file::{PolicyError, PolicyFile};

/// A policy that fits its task.
#[derive(Clone, Copy, Debug)]
pub struct Exported<'a> {
    task: &'a Task,
    file: &'a PolicyFile,
}

/// What the sensors say, with memory of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// `(M)` [rad]
    pub motor_angles: Vec<f32>,
    /// `(M)` [rad/s]
    pub motor_velocities: Vec<f32>,
    /// Roll, pitch, yaw [rad].
    pub orientation: [f32; 3],
    /// In the body's frame [rad/s].
    pub angular_velocity_in_body: [f32; 3],
}

impl Readings {
    /// All of them 0.
    pub fn zero(num_motors: usize) -> Self {
        Self {
            motor_angles: vec![0.0; num_motors],
            motor_velocities: vec![0.0; num_motors],
            orientation: [0.0; 3],
            angular_velocity_in_body: [0.0; 3],
        }
    }

    /// The same readings, kept.
    pub fn of(sensors: &Sensors<'_>) -> Self {
        Self {
            motor_angles: sensors.motor_angles.to_vec(),
            motor_velocities: sensors.motor_velocities.to_vec(),
            orientation: sensors.orientation,
            angular_velocity_in_body: sensors.angular_velocity_in_body,
        }
    }

    /// The readings as the controller takes them.
    pub fn sensors(&self) -> Sensors<'_> {
        Sensors {
            motor_angles: &self.motor_angles,
            motor_velocities: &self.motor_velocities,
            orientation: self.orientation,
            angular_velocity_in_body: self.angular_velocity_in_body,
        }
    }

    /// All numbers one after the other, `(2 M + 6)`: as the C export's `canter_sensors` has them, without the age.
    pub fn flat(&self) -> Vec<f32> {
        let parts = [&self.motor_angles[..], &self.motor_velocities, &self.orientation, &self.angular_velocity_in_body];
        parts.concat()
    }
}

/// One control step: what goes in and what the trained policy makes of it.
#[derive(Clone, Debug, PartialEq)]
pub struct TestVector {
    /// The sensors' readings.
    pub readings: Readings,
    /// The gait's phase before [cycles].
    pub phase: f32,
    /// The action of the step before, `(A)`.
    pub previous_action: Vec<f32>,
    /// The action, `(A)`.
    pub action: Vec<f32>,
    /// The actuator targets, `(M)` [rad].
    pub targets: Vec<f32>,
    /// The gait's phase after [cycles].
    pub next_phase: f32,
}

/// Test vectors that an export carries.
const NUM_TEST_VECTORS: usize = 8;

impl<'a> Exported<'a> {
    /// Puts a policy together with its task.
    ///
    /// # Errors
    /// If the policy was trained for another one.
    pub fn new(task: &'a Task, file: &'a PolicyFile) -> Result<Self, PolicyError> {
        file.check(task)?;
        Ok(Self { task, file })
    }

    /// The robot and what is asked of it.
    pub fn task(&self) -> &'a Task {
        self.task
    }

    /// The policy's file.
    pub fn file(&self) -> &'a PolicyFile {
        self.file
    }

    /// The code that runs on the robot, without the policy.
    pub fn controller(&self) -> Controller<'a> {
        self.task.controller()
    }

    /// The policy.
    pub fn policy(&self) -> Policy<'a> {
        self.file.policy()
    }

    /// Time between two commands [s].
    pub fn control_dt_s(&self) -> f32 {
        self.task.settings.control_dt_s as f32
    }

    /// Times of what is around the gait.
    pub fn runtime_settings(&self) -> RuntimeSettings {
        RuntimeSettings::new(self.control_dt_s())
    }

    /// Names of the actuators, `(M)`, in the order of the targets.
    pub fn actuators(&self) -> Vec<&'a str> {
        self.task.robot.actuators().collect()
    }

    /// What a file that was made from it is called in its first line.
    pub fn title(&self) -> String {
        let card = &self.file.card;
        format!("A gait for {}, learned from its gait {}.", card.robot.name, card.gait.name)
    }

    /// One control step of the trained policy.
    pub fn step(&self, readings: Readings, phase: f32, previous_action: &[f32]) -> TestVector {
        let controller = self.controller();
        let mut buffers = Buffers::new(self);
        buffers.action.copy_from_slice(previous_action);
        let (mut clock, mut targets) = (PhaseClock::at(phase), vec![0.0; controller.num_motors()]);
        let mut memory = buffers.memory();
        let workspace = &mut memory.workspace;
        controller.step(&self.policy(), &readings.sensors(), &mut clock, self.control_dt_s(), workspace, &mut targets);
        TestVector {
            readings,
            phase,
            previous_action: previous_action.to_vec(),
            action: buffers.action,
            targets,
            next_phase: clock.phase(),
        }
    }

    /// Steps at readings within two standard deviations of the mean, in both halves of the cycle.
    pub fn test_vectors(&self) -> Vec<TestVector> {
        let controller = self.controller();
        let normaliser = self.policy().normaliser;
        let (num_motors, num_actions) = (controller.num_motors(), controller.num_actions());
        let vector = |k: usize| {
            let spread = |i: usize| ((7 * i + 3 * k) % 9) as f32 * 0.5 - 2.0;
            let mut readings = Readings::zero(num_motors);
            let mut start = 0;
            for block in controller.blocks() {
                let len = block.len(num_motors, num_actions);
                let sensed: &mut [f32] = match block {
                    ObservationBlock::MotorAngles => &mut readings.motor_angles,
                    ObservationBlock::MotorVelocities => &mut readings.motor_velocities,
                    ObservationBlock::Orientation => &mut readings.orientation,
                    ObservationBlock::AngularVelocity => &mut readings.angular_velocity_in_body,
                    ObservationBlock::Phase | ObservationBlock::PreviousAction => &mut [],
                };
                for (i, value) in (start..).zip(sensed) {
                    *value = normaliser.mean[i] + spread(i) / normaliser.inverse_std[i];
                }
                start += len;
            }
            let previous_action: Vec<f32> = (0..num_actions).map(|i| 0.5 * spread(i)).collect();
            // Away from 0 and 1/2, where the mirror and the clock jump.
            let phase = (k as f32 + 0.3) / NUM_TEST_VECTORS as f32;
            self.step(readings, phase, &previous_action)
        };
        (0..NUM_TEST_VECTORS).map(vector).collect()
    }
}

/// What a [`Runtime`] writes to.
#[derive(Clone, Debug)]
pub struct Buffers {
    observation: Vec<f32>,
    hidden: Vec<f32>,
    action: Vec<f32>,
    last: Vec<f32>,
}

impl Buffers {
    /// Buffers of the sizes that this policy needs.
    pub fn new(exported: &Exported<'_>) -> Self {
        let controller = exported.controller();
        Self {
            observation: vec![0.0; controller.num_observations()],
            hidden: vec![0.0; exported.policy().network.workspace_len()],
            action: vec![0.0; controller.num_actions()],
            last: vec![0.0; controller.num_motors()],
        }
    }

    /// The memory that they are.
    pub fn memory(&mut self) -> Memory<'_> {
        let workspace =
            Workspace { observation: &mut self.observation, hidden: &mut self.hidden, action: &mut self.action };
        Memory { workspace, last: &mut self.last }
    }
}

/// A runtime and the buffers that it writes to.
#[derive(Clone, Debug)]
pub struct Running<'a> {
    runtime: Runtime<'a>,
    buffers: Buffers,
    targets: Vec<f32>,
    control_dt_s: f32,
}

impl<'a> Running<'a> {
    /// A robot that waits for its first reading.
    pub fn new(exported: &Exported<'a>) -> Self {
        let (controller, policy) = (exported.controller(), exported.policy());
        let runtime = Runtime::new(controller, policy, exported.runtime_settings());
        let (buffers, targets) = (Buffers::new(exported), vec![0.0; controller.num_motors()]);
        Self { runtime, buffers, targets, control_dt_s: exported.control_dt_s() }
    }

    /// Tells the robot to walk, or to come to a stand.
    pub fn walk(&mut self, is_to_walk: bool) {
        self.runtime.walk(is_to_walk);
    }

    /// One control step; the targets are [`targets`](Self::targets).
    pub fn step(&mut self, sensors: Sensors<'_>, age_s: f32) -> canter_gait::Mode {
        self.step_for(sensors, age_s, self.control_dt_s)
    }

    /// A step of another length [s].
    pub fn step_for(&mut self, sensors: Sensors<'_>, age_s: f32, dt_s: f32) -> canter_gait::Mode {
        let reading = canter_gait::Reading { sensors, age_s };
        self.runtime.step(&reading, dt_s, &mut self.buffers.memory(), &mut self.targets)
    }

    /// The actuator targets, `(M)` [rad]; none, all 0, while it waits.
    pub fn targets(&self) -> &[f32] {
        &self.targets
    }
}
