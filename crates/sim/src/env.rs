//! The environment: one robot, one task, one simulation.

mod episode;
pub mod snapshot;
mod state;

use std::collections::VecDeque;
use std::sync::Arc;

use canter_gait::{LegGeometry, LegPosition, PhaseClock, Sensors};

use crate::accident::{Accident, StuckTimer};
use crate::frame::{self, Matrix3};
use crate::ground::{Ground, Relief};
use crate::mujoco::Simulation;
use crate::reward::{Motion, RewardTerms, accident_penalty, mechanical_work_j};
use crate::robot::Robot;
use crate::task::{Task, TaskSettings};
use crate::variation::{Draw, Variant};
use crate::world::World;

use self::episode::Episode;

/// Keys of episodes are below this: every one is a whole number that an `f64` holds.
const KEYS: f64 = (1_u64 << 53) as f64;

/// What one env step brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOutcome {
    /// The reward, the accident's penalty included.
    pub reward: f64,
    /// The reward's terms without that penalty.
    pub terms: RewardTerms,
    /// Work of the motors [J].
    pub work_j: f64,
    /// The accident that ended the episode.
    pub terminated: Option<Accident>,
    /// Whether the time limit or the goal ended the episode.
    pub truncated: bool,
}

/// One robot in its world. Nothing is shared with other environments but the task, which never changes.
#[derive(Debug)]
pub struct Env {
    task: Arc<Task>,
    simulation: Simulation,
    /// What is special about this episode.
    episode: Episode,
    clock: PhaseClock,
    /// `(A)` the action of the step before, clamped.
    previous_action: Vec<f32>,
    /// Commands on their way to the motors, oldest first; each `(M)` [rad].
    commands: VecDeque<Vec<f32>>,
    stuck: StuckTimer,
    env_steps: u32,
    return_so_far: f64,
    /// The motors as they are.
    actual: MotorReadings,
    /// The ground of this episode; none: the plane z = 0.
    relief: Option<Relief>,
    /// The sensors' readings: what is, and their noise.
    sensed: Sensed,
    buffers: Buffers,
}

/// Angles and velocities of the motors, `(M)` each [rad, rad/s].
#[derive(Clone, Debug)]
struct MotorReadings {
    angles: Vec<f32>,
    velocities: Vec<f32>,
}

/// The sensors' readings, kept because [`Sensors`] only borrows.
#[derive(Debug)]
struct Sensed {
    motors: MotorReadings,
    orientation: [f32; 3],
    angular_velocity_in_body: [f32; 3],
}

/// Working memory of a step, for each motor of the robot.
#[derive(Debug)]
struct Buffers {
    torques: Vec<f64>,
    velocities: Vec<f64>,
}

impl Env {
    /// An environment that still has to be [reset](Self::reset).
    pub fn new(task: Arc<Task>) -> Self {
        let mut model = task.model().clone();
        model.set_timestep_s(task.settings.physics_dt_s);
        let own = World::of(&task.settings);
        model.set_gravity(frame::gravity_in_ground(model.gravity(), [own.slope_rad, own.cross_slope_rad]));
        let mut simulation = Simulation::new(&model);
        let tilted = World { slope_rad: own.slope_rad, cross_slope_rad: own.cross_slope_rad, ..World::PLAIN };
        own.apply(&tilted, &task.robot, &mut simulation);
        Self::with_simulation(task, simulation)
    }

    /// An environment on a simulation that the caller has prepared: what-if studies of the model's numbers.
    ///
    /// The task's time step, slopes, friction and masses are the caller's to set.
    pub fn with_simulation(task: Arc<Task>, simulation: Simulation) -> Self {
        let num_motors = 2 * task.robot.legs.len();
        let delay = task.longest_delay().div_ceil(task.num_substeps);
        let motors = MotorReadings { angles: vec![0.0; num_motors], velocities: vec![0.0; num_motors] };
        Self {
            simulation,
            episode: Episode::new(&task, Draw::default()),
            clock: PhaseClock::default(),
            previous_action: vec![0.0; task.num_actions()],
            commands: (0..=delay).map(|_| vec![0.0; num_motors]).collect(),
            stuck: StuckTimer::default(),
            env_steps: 0,
            return_so_far: 0.0,
            actual: motors.clone(),
            relief: None,
            sensed: Sensed { motors, orientation: [0.0; 3], angular_velocity_in_body: [0.0; 3] },
            buffers: Buffers {
                torques: vec![0.0; task.robot.motor_joints().count()],
                velocities: vec![0.0; task.robot.motor_joints().count()],
            },
            task,
        }
    }

    /// The task.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    /// The simulation, read-only.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Starts an episode from standing: feet on the ground, a random phase of the gait, and noise on heading, tilt
    /// and leg angles.
    ///
    /// `uniform` gives random numbers in [0, 1).
    ///
    /// # Shapes
    /// - `observation`: `(O)`, raw
    pub fn reset(&mut self, uniform: &mut dyn FnMut() -> f64, observation: &mut [f32]) {
        let task = self.task.clone();
        let robot = &task.robot;
        let noise_rad = task.settings.start_noise_rad;
        let noise = |uniform: &mut dyn FnMut() -> f64| noise_rad * (2.0 * uniform() - 1.0);
        self.clock = PhaseClock::at(uniform() as f32);
        self.previous_action.fill(0.0);
        self.stuck = StuckTimer::default();
        self.env_steps = 0;
        self.return_so_far = 0.0;
        let [roll, pitch, yaw] = [noise(uniform), noise(uniform), noise(uniform)];
        let starts: Vec<LegPosition> = robot
            .legs
            .iter()
            .map(|leg| {
                let position = LegPosition { swing: noise(uniform) as f32, extension: noise(uniform) as f32 };
                leg.limits.clamp(position)
            })
            .collect();
        // Drawn last, so that an episode's start does not depend on what it is like.
        let variant = self.episode.draw.variant;
        let key = if task.needs_key(variant) { (uniform() * KEYS) as u64 } else { 0 };
        self.begin(Draw { variant, key });

        self.simulation.reset();
        let (root, _) = robot.root;
        // Distances count from the start, wherever the model's file has put the robot.
        self.simulation.qpos_mut()[root..root + 2].fill(0.0);
        for (i, (leg, position)) in robot.legs.iter().zip(starts).enumerate() {
            let [first, second] = leg.targets(position);
            for command in &mut self.commands {
                command[2 * i] = first;
                command[2 * i + 1] = second;
            }
            place_leg(&mut self.simulation, robot, i, position);
        }
        let quaternion = frame::quaternion(&frame::from_euler(roll, pitch, yaw));
        self.simulation.qpos_mut()[root + 3..root + 7].copy_from_slice(&quaternion);
        self.simulation.update_positions();
        let mut lowest_foot_m = f64::INFINITY;
        for address in &robot.leg_addresses {
            let foot = self.simulation.geom_positions_in_world()[address.foot];
            let radius_m = robot.model.geom_radius_m(address.foot);
            let above_ground_m = self.relief.as_ref().map(|relief| relief.clearance_m(foot, radius_m));
            lowest_foot_m = lowest_foot_m.min(above_ground_m.unwrap_or(foot[2] - radius_m));
        }
        self.simulation.qpos_mut()[root + 2] -= lowest_foot_m;
        self.observe(false, observation);
    }

    /// Chooses what differs in the coming episodes. Without this call, as in searches and evaluations, nothing differs from
    /// the task's own values.
    pub fn vary(&mut self, variant: Variant) {
        self.episode.draw.variant = self.task.variation.is_any().then_some(variant);
    }

    /// Makes the physics what it is in the episode of this draw. The simulation's state is lost.
    fn begin(&mut self, draw: Draw) {
        let episode = Episode::new(&self.task, draw);
        let ground = self.task.ground.as_ref().filter(|ground| ground.is_uneven());
        if ground.is_some() {
            // What MuJoCo derives from the masses depends on the floor's kind: it is the same one for every episode.
            self.simulation.set_floor_even(self.task.model(), self.task.robot.floor, false);
        }
        episode.world.apply(&self.episode.world, &self.task.robot, &mut self.simulation);
        self.episode = episode;
        if self.task.ground.as_ref().is_some_and(|ground| ground.patches().is_some()) {
            let Robot { leg_addresses, model, floor, .. } = &*self.task.robot;
            for address in leg_addresses {
                self.simulation.leave_friction_to(model, address.foot, *floor);
            }
        }
        if let Some(ground) = ground {
            self.relief = ground.relief(draw.key, episode.world.roughness);
            self.simulation.set_floor_even(self.task.model(), self.task.robot.floor, self.relief.is_none());
        }
        if let Some(relief) = &self.relief {
            relief.write(self.simulation.height_field_mut());
        }
        self.follow_with_ground();
    }

    /// Puts the piece of ground that is there under the robot, and gives the feet the friction of where they are.
    fn follow_with_ground(&mut self) {
        let [x, y, _] = self.position_in_ground();
        let robot = &self.task.robot;
        if let Some(relief) = &self.relief {
            self.simulation.move_floor(robot.floor, relief.nearest_tile([x, y]));
        }
        if let Some(patches) = self.task.ground.as_ref().and_then(Ground::patches) {
            self.simulation.update_positions();
            for address in &robot.leg_addresses {
                let [x, y, _] = self.simulation.geom_positions_in_world()[address.foot];
                let of_foot = || robot.model.contact_friction([address.foot, robot.floor]);
                let own = self.episode.world.friction.unwrap_or_else(of_foot);
                let factor = patches.factor_at([x, y], self.episode.draw.key);
                self.simulation.set_friction_of(address.foot, factor * own);
            }
        }
    }

    /// Whether this episode's ground is more than a plane.
    pub fn is_on_uneven_ground(&self) -> bool {
        self.relief.is_some()
    }

    /// Where the middle of this episode's piece of ground lies: forward, left [m].
    pub(crate) fn ground_middle(&self) -> [f64; 2] {
        let [x, y, _] = self.position_in_ground();
        self.relief.as_ref().map_or([0.0; 2], |relief| relief.nearest_tile([x, y]))
    }

    /// Height of the ground at a point: forward, left [m].
    pub fn ground_height_m(&self, point: [f64; 2]) -> f64 {
        self.relief.as_ref().map_or(0.0, |relief| relief.height_m(point))
    }

    /// Height of the body above the ground below it [m].
    pub fn height_above_ground_m(&self) -> f64 {
        let [x, y, z] = self.position_in_ground();
        z - self.ground_height_m([x, y])
    }

    /// One control step with the policy's action.
    ///
    /// A step from or to a state that makes no sense ends in [`Accident::Unstable`], without work and without reward, and
    /// leaves an observation of zeros.
    ///
    /// # Shapes
    /// - `action`: `(A)`, clamped to [-1, 1] here
    /// - `observation`: `(O)`, raw
    pub fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome {
        let mut squared_action_change = 0.0;
        for (previous, new) in self.previous_action.iter_mut().zip(action) {
            // As the controller has it: what is no number is the prior.
            let new = if new.is_nan() { 0.0 } else { new.clamp(-1.0, 1.0) };
            squared_action_change += f64::from((new - *previous) * (new - *previous));
            *previous = new;
        }
        let mut command = self.commands.pop_front().unwrap_or_default();
        let control_dt_s = self.task.settings.control_dt_s as f32;
        self.task.controller().act(&self.previous_action, &mut self.clock, control_dt_s, &mut command);
        self.commands.push_back(command);
        self.advance(squared_action_change, observation)
    }

    /// One control step of the prior alone.
    ///
    /// # Shapes
    /// - `observation`: `(O)`, raw
    pub fn step_prior(&mut self, observation: &mut [f32]) -> StepOutcome {
        let mut command = self.commands.pop_front().unwrap_or_default();
        let control_dt_s = self.task.settings.control_dt_s as f32;
        self.task.controller().act_prior(&mut self.clock, control_dt_s, &mut command);
        self.commands.push_back(command);
        self.advance(0.0, observation)
    }

    /// One control step with actuator targets from outside: a controller of the caller's own, with its own clock.
    ///
    /// # Shapes
    /// - `targets`: `(M)` [rad]; one that is no number keeps its predecessor
    /// - `observation`: `(O)`, raw, of this environment's clock, which stands still
    pub fn step_targets(&mut self, targets: &[f32], observation: &mut [f32]) -> StepOutcome {
        let mut command = self.commands.pop_front().unwrap_or_default();
        let before = self.commands.back().unwrap_or(&command).clone();
        for ((own, target), before) in command.iter_mut().zip(targets).zip(before) {
            *own = if target.is_nan() { before } else { *target };
        }
        self.commands.push_back(command);
        self.advance(0.0, observation)
    }

    /// Torques of the motors in the last physics step [N m], those of held ones at the end.
    pub fn motor_torques(&self) -> &[f64] {
        &self.buffers.torques
    }

    /// Speeds of the motors before the last physics step [rad/s], those of held ones at the end.
    pub fn motor_speeds(&self) -> &[f64] {
        &self.buffers.velocities
    }

    /// Simulates one control step under the command whose time has come.
    fn advance(&mut self, squared_action_change: f64, observation: &mut [f32]) -> StepOutcome {
        if let Some(velocity) = self.episode.push(&self.task, self.env_steps) {
            self.push(velocity);
        }
        let (before, heading_before, began_sane) = (self.position_in_ground(), self.heading_rad(), self.makes_sense());
        self.follow_with_ground();
        let mut work_j = self.simulate();
        self.env_steps = self.env_steps.saturating_add(1);

        let after = self.position_in_ground();
        let motion = Motion {
            displacement_in_ground: std::array::from_fn(|axis| after[axis] - before[axis]),
            work_j,
            turn_rad: frame::smallest_angle(self.heading_rad() - heading_before),
            squared_action_change,
        };
        let mut terms = RewardTerms::new(&self.task.reward, &self.task.scale, &motion);
        let unstable = !began_sane
            || !self.makes_sense()
            || !frame::is_possible_way(motion.displacement_in_ground, self.task.settings.control_dt_s)
            || !terms.total().is_finite();
        self.observe(unstable, observation);
        let accident = if unstable { Some(Accident::Unstable) } else { self.accident() };
        if unstable {
            (work_j, terms) = (0.0, RewardTerms::default());
        }
        let mut reward = terms.total();
        self.return_so_far += reward;
        if accident.is_some() {
            let TaskSettings { accident_return_weight, accident_cost, .. } = self.task.settings;
            reward += accident_penalty(accident_return_weight, accident_cost, self.return_so_far);
        }
        let at_goal = self.task.settings.goal_distance_m.is_some_and(|goal| after[0] >= goal);
        let truncated = accident.is_none() && (at_goal || self.env_steps >= self.task.max_env_steps);
        StepOutcome { reward, terms, work_j, terminated: accident, truncated }
    }

    /// The physics steps of one control step; returns the motors' work [J].
    fn simulate(&mut self) -> f64 {
        let robot = &self.task.robot;
        let Episode { motor, delay_steps, .. } = self.episode;
        let mut acting = None;
        for held in &robot.held {
            self.simulation.ctrl_mut()[held.actuator] = held.target;
        }
        let mut work_j = 0.0;
        for physics_step in 0..self.task.num_substeps {
            let age = episode::command_age(delay_steps, physics_step, self.task.num_substeps);
            if acting != Some(age) {
                acting = Some(age);
                let command = &self.commands[self.commands.len() - 1 - age];
                for (pair, address) in command.chunks_exact(2).zip(&robot.leg_addresses) {
                    for (value, actuator) in pair.iter().zip(address.actuators) {
                        self.simulation.ctrl_mut()[actuator] = f64::from(*value);
                    }
                }
            }
            for ((joint, dof), stored) in robot.motor_joints().zip(&mut self.buffers.velocities) {
                let velocity = self.simulation.qvel()[dof];
                *stored = velocity;
                self.simulation.set_torque_range(joint, motor.torque_range_nm(velocity));
            }
            self.simulation.step();
            for ((_, dof), torque) in robot.motor_joints().zip(&mut self.buffers.torques) {
                *torque = self.simulation.actuator_torques()[dof];
            }
            work_j +=
                mechanical_work_j(&self.buffers.torques, &self.buffers.velocities, self.task.settings.physics_dt_s);
        }
        work_j
    }

    /// Whether the physics' state could be a robot's.
    fn makes_sense(&self) -> bool {
        !self.simulation.is_unstable() && frame::is_sane(self.simulation.qpos(), self.simulation.qvel())
    }

    /// Reads the sensors and writes the observation; zeros if the state makes no sense.
    fn observe(&mut self, is_nonsense: bool, observation: &mut [f32]) {
        if is_nonsense {
            return observation.fill(0.0);
        }
        let robot = &self.task.robot;
        let (qpos, qvel) = (self.simulation.qpos(), self.simulation.qvel());
        let standing = robot.model.standing_position();
        let motors = robot.leg_addresses.iter().flat_map(|leg| leg.motors.into_iter().zip(leg.conventions));
        for (i, ((position, velocity), convention)) in motors.enumerate() {
            let sign = f64::from(convention.sign);
            self.actual.angles[i] = (sign * (qpos[position] - standing[position])) as f32;
            self.actual.velocities[i] = (sign * qvel[velocity]) as f32;
        }
        self.sensed.motors.angles.copy_from_slice(&self.actual.angles);
        self.sensed.motors.velocities.copy_from_slice(&self.actual.velocities);
        let (_, root_velocity) = robot.root;
        // MuJoCo gives a free joint's angular velocity in the body's own frame.
        self.sensed.angular_velocity_in_body = std::array::from_fn(|axis| qvel[root_velocity + 3 + axis] as f32);
        let World { slope_rad, cross_slope_rad, .. } = self.episode.world;
        let gravity_from_ground = frame::gravity_from_ground([slope_rad, cross_slope_rad]);
        let gravity_from_body = frame::multiply(&gravity_from_ground, &self.ground_from_body());
        self.sensed.orientation = frame::to_euler(&gravity_from_body).map(|angle| angle as f32);
        if let Some(noise) = self.episode.noise {
            self.sensed.add_noise(&noise, self.episode.draw.key, self.env_steps);
        }
        self.task.controller().observe(&self.sensors(), &self.clock, &self.previous_action, observation);
    }

    /// What the sensors say now.
    pub fn sensors(&self) -> Sensors<'_> {
        Sensors {
            motor_angles: &self.sensed.motors.angles,
            motor_velocities: &self.sensed.motors.velocities,
            orientation: self.sensed.orientation,
            angular_velocity_in_body: self.sensed.angular_velocity_in_body,
        }
    }

    /// The command that was given last, `(M)` [rad]; it takes effect after the command delay.
    pub fn last_command(&self) -> &[f32] {
        self.commands.back().map_or(&[], Vec::as_slice)
    }

    /// Which accident has happened, if any; keeps the time that legs have been stuck.
    fn accident(&mut self) -> Option<Accident> {
        let task = &self.task;
        let limits = &task.robot.settings.limits;
        let error_rad = self.command_error_rad();
        let stuck_s = self.stuck.update(error_rad, limits.stuck_error_rad, task.settings.control_dt_s);
        let up = self.ground_from_body()[2][2];
        if up < limits.max_tilt_deg.to_radians().cos() {
            Some(Accident::Rollover)
        } else if self.height_above_ground_m() < task.min_height_m() {
            Some(Accident::TooLow)
        } else if stuck_s >= limits.stuck_time_s {
            Some(Accident::LegStuck)
        } else {
            None
        }
    }

    /// Largest difference between commanded and actual leg position over all legs [rad].
    fn command_error_rad(&self) -> f64 {
        let errors = self.leg_positions().map(|(commanded, actual)| {
            f64::from((commanded.swing - actual.swing).abs().max((commanded.extension - actual.extension).abs()))
        });
        errors.fold(0.0, f64::max)
    }

    /// Each leg's commanded and actual position; the command is the one that the motors had in the last step.
    fn leg_positions(&self) -> impl Iterator<Item = (LegPosition, LegPosition)> {
        let num_substeps = self.task.num_substeps;
        let age = episode::command_age(self.episode.delay_steps, num_substeps - 1, num_substeps);
        let commands = &self.commands[self.commands.len() - 1 - age];
        let angles = self.actual.angles.chunks_exact(2);
        self.task.robot.legs.iter().zip(commands.chunks_exact(2)).zip(angles).map(|((leg, command), angles)| {
            (leg.position_at([command[0], command[1]]), leg.geometry.leg_position([angles[0], angles[1]]))
        })
    }

    /// Position of the body in the ground's frame: forward, left, up [m].
    pub fn position_in_ground(&self) -> [f64; 3] {
        let (root, _) = self.task.robot.root;
        std::array::from_fn(|axis| self.simulation.qpos()[root + axis])
    }

    /// Velocity of the body in the ground's frame: forward, left, up [m/s].
    pub fn velocity_in_ground(&self) -> [f64; 3] {
        let (_, root) = self.task.robot.root;
        // MuJoCo gives a free joint's velocity in the world.
        std::array::from_fn(|axis| self.simulation.qvel()[root + axis])
    }

    /// Angle between the body's up axis and the ground's [rad].
    pub fn tilt_rad(&self) -> f64 {
        self.ground_from_body()[2][2].clamp(-1.0, 1.0).acos()
    }

    /// Rotation from the body's frame to the ground's. Gravity is tilted instead of the ground, so MuJoCo's world is the ground's frame.
    fn ground_from_body(&self) -> Matrix3 {
        let (root, _) = self.task.robot.root;
        frame::from_quaternion(std::array::from_fn(|i| self.simulation.qpos()[root + 3 + i]))
    }

    /// Roll, pitch and yaw of the body against the ground [rad].
    pub fn orientation_in_ground(&self) -> [f64; 3] {
        frame::to_euler(&self.ground_from_body())
    }

    /// Heading against the ground's forward axis, positive to the left [rad].
    pub fn heading_rad(&self) -> f64 {
        self.orientation_in_ground()[2]
    }

    /// Says which feet touch the ground, and counts the contacts of anything else with it, as of the last physics step
    /// or [`snapshot`](Self::snapshot).
    ///
    /// # Shapes
    /// - `feet`: `(L)`
    pub fn ground_contacts(&self, feet: &mut [bool]) -> usize {
        let robot = &self.task.robot;
        let mut others = 0;
        feet.fill(false);
        for [first, second] in self.simulation.contacts() {
            let geom = match (first == robot.floor, second == robot.floor) {
                (true, false) => second,
                (false, true) => first,
                _ => continue,
            };
            match robot.leg_addresses.iter().zip(&mut *feet).find(|(address, _)| address.foot == geom) {
                Some((_, touches)) => *touches = true,
                None => others += 1,
            }
        }
        others
    }

    /// Pushes the robot: adds `velocity`, forward, left, up in the ground's frame, to that of the whole body at once [m/s].
    pub fn push(&mut self, velocity: [f64; 3]) {
        let (_, root) = self.task.robot.root;
        // MuJoCo gives a free joint's velocity in the world, and every other joint's against its parent.
        for (own, change) in self.simulation.qvel_mut()[root..root + 3].iter_mut().zip(velocity) {
            *own += change;
        }
    }

    /// The gait's phase [cycles].
    pub fn phase(&self) -> f32 {
        self.clock.phase()
    }

    /// Env steps since the start of the episode.
    pub fn env_steps(&self) -> u32 {
        self.env_steps
    }
}

/// Puts a leg's joints where its position in leg space has them, the loop closed.
pub(crate) fn place_leg(simulation: &mut Simulation, robot: &Robot, index: usize, position: LegPosition) {
    let (leg, address) = (&robot.legs[index], &robot.leg_addresses[index]);
    let standing = robot.model.standing_position();
    for ((angle, (place, _)), convention) in
        leg.geometry.motor_angles(position).into_iter().zip(address.motors).zip(address.conventions)
    {
        simulation.qpos_mut()[place] = standing[place] + f64::from(convention.sign * angle);
    }
    if let (LegGeometry::FiveBar(five_bar), Some(knees)) = (leg.geometry, &address.knees) {
        let angles = five_bar.knee_angles(position).into_iter();
        for ((angle, place), convention) in angles.zip(knees.places).zip(knees.conventions) {
            simulation.qpos_mut()[place] = standing[place] + f64::from(convention.sign) * angle;
        }
    }
}
