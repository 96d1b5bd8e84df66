//! What is kept of a physics blow-up: the env steps before it, so that they can be stepped through again.

use std::sync::Arc;

use canter_sim::{Accident, Env, Task};
use serde::{Deserialize, Serialize};

use crate::checkpoint::CheckpointError;
use crate::tensors::TensorFile;

/// Version of the format; readers refuse others.
const FORMAT_VERSION: u32 = 2;

/// Env steps after which a recording begins anew: the last one and a half windows, on average, are known.
const WINDOW_STEPS: usize = 50;

/// A state, and the actions that an environment took from there.
#[derive(Clone, Debug, Default)]
struct Window {
    state: Vec<f64>,
    /// `(T x A)` as the robot got them.
    actions: Vec<f32>,
}

/// Keeps what an environment did last, within one episode.
#[derive(Clone, Debug, Default)]
pub(crate) struct Recorder {
    older: Window,
    newer: Window,
}

impl Recorder {
    /// An episode begins, or goes on from a restored state.
    pub fn begin(&mut self, env: &Env) {
        self.older = Window::default();
        self.newer.state = env.state();
        self.newer.actions.clear();
    }

    /// The environment is about to take this action, `(A)`.
    pub fn record(&mut self, env: &Env, action: &[f32]) {
        if self.newer.actions.len() >= WINDOW_STEPS * action.len() {
            std::mem::swap(&mut self.older, &mut self.newer);
            self.newer.state = env.state();
            self.newer.actions.clear();
        }
        self.newer.actions.extend_from_slice(action);
    }

    /// The recording as far back as it goes.
    pub fn blow_up(&self, env: &Env, environment: u64) -> BlowUp {
        let is_first = self.older.state.is_empty();
        let state = if is_first { self.newer.state.clone() } else { self.older.state.clone() };
        let actions = [&self.older.actions[..], &self.newer.actions].concat();
        BlowUp { environment, iteration: 0, robot_fingerprint: fingerprint(env.task()), state, actions }
    }
}

/// An episode's end in physics that made no sense.
#[derive(Clone, Debug, PartialEq)]
pub struct BlowUp {
    /// Number of the environment.
    pub environment: u64,
    /// The iteration in which it happened; the trainer knows it.
    pub iteration: u64,
    /// The robot's files.
    robot_fingerprint: String,
    /// The environment's state before the first of the actions.
    state: Vec<f64>,
    /// `(T x A)` as the robot got them; the last one ended the episode.
    actions: Vec<f32>,
}

/// What is not an array.
#[derive(Debug, Serialize, Deserialize)]
struct Card {
    dump_version: u32,
    environment: u64,
    iteration: u64,
    robot_fingerprint: String,
}

/// A robot at the end of an env step that was stepped through again.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplayedStep {
    /// Time since the first step of the dump [s].
    pub time_s: f64,
    /// Height of the body above the ground [m].
    pub height_m: f64,
    /// Forward velocity of the body [m/s].
    pub velocity_m_per_s: f64,
    /// Angle between the body's up axis and the ground's [deg].
    pub tilt_deg: f64,
    /// The joint that moves fastest.
    pub fastest_joint: String,
    /// Its velocity [rad/s, for a free joint also m/s].
    pub fastest_velocity: f64,
    /// Largest torque of a motor in the last physics step [N m].
    pub largest_torque_nm: f64,
    /// The accident that ended the episode here.
    pub accident: Option<&'static str>,
}

impl BlowUp {
    /// Env steps in the dump, T.
    pub fn num_steps(&self, task: &Task) -> usize {
        self.actions.len() / task.num_actions()
    }

    /// The file's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let card = Card {
            dump_version: FORMAT_VERSION,
            environment: self.environment,
            iteration: self.iteration,
            robot_fingerprint: self.robot_fingerprint.clone(),
        };
        let metadata = serde_json::to_value(&card).expect("a card has string keys only").to_string();
        let mut file = TensorFile::new(metadata);
        file.push("state", &[self.state.len()], &self.state);
        file.push("actions", &[self.actions.len()], &self.actions);
        file.to_bytes()
    }

    /// Reads a dump.
    ///
    /// # Errors
    /// Bytes that are no dump of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let file = TensorFile::from_bytes(bytes)?;
        let card: Card = serde_json::from_str(file.metadata())?;
        if card.dump_version != FORMAT_VERSION {
            let message = format!("it has version {}, this canter reads version {FORMAT_VERSION}", card.dump_version);
            return Err(CheckpointError::Mismatch(message));
        }
        let whole = |name: &str| file.shape(name).map(<[usize]>::to_vec).unwrap_or_default();
        Ok(Self {
            environment: card.environment,
            iteration: card.iteration,
            robot_fingerprint: card.robot_fingerprint,
            state: file.get("state", &whole("state"))?,
            actions: file.get("actions", &whole("actions"))?,
        })
    }

    /// Takes the same steps again, with the run's own task.
    ///
    /// # Errors
    /// A dump of another configuration or robot.
    pub fn replay(&self, task: &Arc<Task>) -> Result<Vec<ReplayedStep>, CheckpointError> {
        if self.robot_fingerprint != fingerprint(task) {
            let message = "the robot's files have changed since: put them back".to_owned();
            return Err(CheckpointError::Mismatch(message));
        }
        let num_steps = self.num_steps(task);
        if num_steps > 2 * WINDOW_STEPS || num_steps * task.num_actions() != self.actions.len() {
            let message = "its actions are not those of this run's configuration".to_owned();
            return Err(CheckpointError::Mismatch(message));
        }
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        env.set_state(&self.state, &mut observation).map_err(CheckpointError::Mismatch)?;
        let start_s = env.simulation().time_s();
        let steps = self.actions.chunks_exact(task.num_actions());
        Ok(steps
            .map(|action| {
                let accident = env.step(action, &mut observation).terminated;
                replayed(&env, start_s, accident)
            })
            .collect())
    }
}

fn fingerprint(task: &Task) -> String {
    format!("{:016x}", task.robot.fingerprint)
}

/// The robot as it is now.
fn replayed(env: &Env, start_s: f64, accident: Option<Accident>) -> ReplayedStep {
    let simulation = env.simulation();
    let velocities = simulation.qvel().iter().enumerate();
    // NaN is the largest of all here.
    let (dof, velocity) = velocities.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((0, &0.0));
    let torques = simulation.actuator_torques().iter();
    ReplayedStep {
        time_s: simulation.time_s() - start_s,
        height_m: env.position_in_ground()[2],
        velocity_m_per_s: env.velocity_in_ground()[0],
        tilt_deg: env.tilt_rad().to_degrees(),
        fastest_joint: env.task().robot.model.joint_of_velocity(dof),
        fastest_velocity: *velocity,
        largest_torque_nm: torques.fold(0.0, |largest, torque| largest.max(torque.abs())),
        accident: accident.map(Accident::name),
    }
}
