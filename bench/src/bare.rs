//! The physics alone: what happened to an environment, repeated by calls of `mj_step` with nothing between them but the
//! copy of the commands once per env step.

use std::time::Instant;

use canter_sim::Task;
use canter_sim::mujoco::Simulation;

/// What happened to an environment, each with the environment's state after it.
pub enum Event {
    /// The recording or an episode starts.
    Start(Vec<f64>),
    /// One env step.
    Step(Vec<f64>),
}

/// Everything that happened to an environment in a while.
pub struct Recording {
    /// In order; the first is a start.
    pub events: Vec<Event>,
}

/// A simulation without an environment around it.
pub struct BareSimulation {
    simulation: Simulation,
    num_substeps: u32,
    state_len: usize,
}

impl BareSimulation {
    /// The physics of a task on level ground.
    ///
    /// The motors' limits stay as the model has them: their speeds never reach the part of the curve where the limit
    /// falls. If they did, the states at the end would differ.
    ///
    /// # Panics
    /// If the task's ground slopes, or its friction is not the model's own.
    pub fn new(task: &Task) -> Self {
        let settings = &task.settings;
        let is_level = settings.slope_deg == 0.0 && !task.variation.is_any();
        assert!(is_level && settings.friction.is_none(), "level ground, the model's own friction");
        let mut model = task.robot.model.clone();
        model.set_timestep_s(settings.physics_dt_s);
        let simulation = Simulation::new(&model);
        Self { state_len: simulation.state().len(), simulation, num_substeps: task.num_substeps }
    }

    /// Physics steps of an env step.
    pub fn num_substeps(&self) -> u32 {
        self.num_substeps
    }

    /// MuJoCo's state as it is now.
    pub fn state(&self) -> Vec<f64> {
        self.simulation.state()
    }

    /// MuJoCo's part of an environment's state: the end of it.
    pub fn physics<'a>(&self, state: &'a [f64]) -> &'a [f64] {
        &state[state.len() - self.state_len..]
    }

    fn restore(&mut self, state: &[f64]) {
        let physics = &state[state.len() - self.state_len..];
        self.simulation.set_state(physics).expect("a state of the same model");
    }

    /// Repeats the recorded physics steps and returns the time they took [s]. The clock stands still while starts of
    /// episodes are restored.
    pub fn replay(&mut self, recording: &Recording) -> f64 {
        // A state after an env step holds the commands of that step.
        let mut commands = Vec::new();
        for event in &recording.events {
            if let Event::Step(state) = event {
                self.restore(state);
                commands.push(self.simulation.ctrl_mut().to_vec());
            }
        }
        let mut commands = commands.iter();
        let mut total_s = 0.0;
        for episode in recording.events.chunk_by(|_, next| matches!(next, Event::Step(_))) {
            if let [Event::Start(state), ..] = episode {
                self.restore(state);
            }
            let steps = commands.by_ref().take(episode.len() - 1);
            let start = Instant::now();
            for command in steps {
                self.simulation.ctrl_mut().copy_from_slice(command);
                for _ in 0..self.num_substeps {
                    self.simulation.step();
                }
            }
            total_s += start.elapsed().as_secs_f64();
        }
        total_s
    }
}
