//! The unit of all costs: one `mj_step` of the walking Doggo with the model's own time step, on level ground.
//!
//! Costs in this unit hardly depend on the machine, and none of them looks better because a preset takes longer physics
//! steps, which are fewer.

use canter_learn::random::{Purpose, stream};
use canter_sim::Env;
use canter_train::config::ConfigError;
use canter_train::environment::uniform;

use crate::bare::{BareSimulation, Event, Recording};
use crate::level::resolve_on_level_ground;

/// Env steps of the recording: several strides, and few enough to be repeated often.
const NUM_ENV_STEPS: u32 = 200;

/// Env steps before the recording, until the robot walks.
const SETTLING_ENV_STEPS: u32 = 100;

/// The recorded walk of the preset's prior, and the physics to repeat it.
pub struct Reference {
    bare: BareSimulation,
    recording: Recording,
    physics_dt_s: f64,
}

impl Reference {
    /// Records the walk with the time step of the model's own file.
    ///
    /// # Errors
    /// Whatever is wrong with the preset.
    pub fn new() -> Result<Self, ConfigError> {
        let own_dt_s = resolve_on_level_ground(&[])?.task.robot.model.raw().opt().timestep;
        Self::with_physics_dt(own_dt_s)
    }

    /// Records the walk with another time step [s].
    ///
    /// # Errors
    /// Whatever is wrong with the preset, or a time step that does not divide the control step.
    pub fn with_physics_dt(physics_dt_s: f64) -> Result<Self, ConfigError> {
        let task = resolve_on_level_ground(&[("task.physics_dt_s", physics_dt_s.to_string())])?.task;
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        let mut rng = stream(0, Purpose::Evaluation, 0, 0);
        env.reset(&mut || uniform(&mut rng), &mut observation);
        for _ in 0..SETTLING_ENV_STEPS {
            env.step_prior(&mut observation);
        }
        let mut events = vec![Event::Start(env.state())];
        for _ in 0..NUM_ENV_STEPS {
            let outcome = env.step_prior(&mut observation);
            assert_eq!(outcome.terminated, None, "the prior walks");
            events.push(Event::Step(env.state()));
        }
        Ok(Self { bare: BareSimulation::new(&task), recording: Recording { events }, physics_dt_s })
    }

    /// Time step [s].
    pub fn physics_dt_s(&self) -> f64 {
        self.physics_dt_s
    }

    /// Physics steps of one [`time`](Self::time).
    pub fn num_physics_steps(&self) -> u32 {
        NUM_ENV_STEPS * self.bare.num_substeps()
    }

    /// Repeats the walk once; returns the time of one physics step [s].
    pub fn time(&mut self) -> f64 {
        self.bare.replay(&self.recording) / f64::from(self.num_physics_steps())
    }
}
