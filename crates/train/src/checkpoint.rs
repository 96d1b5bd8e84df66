//! A checkpoint: everything that the rest of a training depends on.

use canter_learn::collect::{CollectorState, OngoingEpisode};
use canter_learn::communicator::{Message, Received, exchange};
use serde::{Deserialize, Serialize};

use crate::environment::TrainingEnvironment;
use crate::tensors::{TensorError, TensorFile};
use crate::trainer::{MAX_DIVERGENCES, Progress, Trainer};

/// Version of the format; readers refuse others.
const FORMAT_VERSION: u32 = 3;

/// No training comes to as many steps; sums of them do not overflow.
const LARGEST_COUNT: u64 = 1 << 53;

/// What is not an array.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Card {
    checkpoint_version: u32,
    iterations: u64,
    env_steps: u64,
    episodes: u64,
    divergences: u64,
    gradient_steps: u64,
    learning_rate: f64,
    observations: u64,
    /// The robot's files; another version of them would not go on with the same bytes.
    robot_fingerprint: String,
}

/// A checkpoint in memory.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    card: Card,
    file: TensorFile,
}

/// Why a checkpoint, or the dump of a blow-up, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// It cannot be read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The container or an array is wrong.
    #[error(transparent)]
    Tensors(#[from] TensorError),
    /// The metadata is wrong.
    #[error("its metadata cannot be read: {0}")]
    Metadata(#[from] serde_json::Error),
    /// It belongs to another configuration, robot or version.
    #[error("{0}")]
    Mismatch(String),
}

impl Checkpoint {
    /// The training as it is now, between two iterations; on several ranks all of them have to ask for it.
    pub fn of(trainer: &Trainer) -> Self {
        let card = Card {
            checkpoint_version: FORMAT_VERSION,
            iterations: trainer.progress.iterations,
            env_steps: trainer.progress.env_steps,
            episodes: trainer.progress.episodes,
            divergences: trainer.progress.divergences,
            gradient_steps: trainer.adam.num_gradient_steps,
            learning_rate: trainer.adam.learning_rate,
            observations: trainer.moments.count,
            robot_fingerprint: format!("{:016x}", trainer.resolved().task.robot.fingerprint),
        };
        let metadata = serde_json::to_value(&card).expect("a card has string keys only").to_string();
        let mut file = TensorFile::new(metadata);
        let num_parameters = trainer.parameters.len();
        file.push("parameters", &[num_parameters], &trainer.parameters);
        file.push("adam.first_moment", &[num_parameters], &trainer.adam.first_moment);
        file.push("adam.second_moment", &[num_parameters], &trainer.adam.second_moment);
        let num_observations = trainer.moments.mean.len();
        file.push("moments.mean", &[num_observations], &trainer.moments.mean);
        file.push("moments.sum_squared_deviations", &[num_observations], &trainer.moments.sum_squared_deviations);
        let (states, ongoing) = environments(trainer);
        let num_environments = ongoing.len() / 2;
        file.push("environments.state", &[num_environments, states.len() / num_environments], &states);
        file.push("environments.episode", &[num_environments, 2], &ongoing);
        Self { card, file }
    }

    /// Iterations of the training so far.
    pub fn iterations(&self) -> u64 {
        self.card.iterations
    }

    /// The file's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.file.to_bytes()
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// Bytes that are no checkpoint of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let file = TensorFile::from_bytes(bytes)?;
        file.check_finite()?;
        let card: Card = serde_json::from_str(file.metadata())?;
        if card.checkpoint_version != FORMAT_VERSION {
            let message =
                format!("it has version {}, this canter reads version {FORMAT_VERSION}", card.checkpoint_version);
            return Err(CheckpointError::Mismatch(message));
        }
        let Card { iterations, env_steps, episodes, gradient_steps, observations, .. } = card;
        if [iterations, env_steps, episodes, gradient_steps, observations].iter().any(|&count| count > LARGEST_COUNT) {
            return Err(CheckpointError::Mismatch("it counts more than any training comes to".to_owned()));
        }
        if card.divergences > MAX_DIVERGENCES || !(0.0..=1.0).contains(&card.learning_rate) {
            let message = "its divergences or its learning rate are beyond what a training has".to_owned();
            return Err(CheckpointError::Mismatch(message));
        }
        Ok(Self { card, file })
    }

    /// Puts a new training into this state: it goes on with the same bytes as the one that was saved.
    ///
    /// # Errors
    /// A checkpoint of another configuration or robot; the training must then not be used.
    pub fn restore(&self, trainer: &mut Trainer) -> Result<(), CheckpointError> {
        let fingerprint = format!("{:016x}", trainer.resolved().task.robot.fingerprint);
        if self.card.robot_fingerprint != fingerprint {
            let message = "the robot's files have changed since: put them back, or start a new training".to_owned();
            return Err(CheckpointError::Mismatch(message));
        }
        let num_parameters = trainer.parameters.len();
        trainer.parameters = self.file.get("parameters", &[num_parameters])?;
        trainer.adam.first_moment = self.file.get("adam.first_moment", &[num_parameters])?;
        trainer.adam.second_moment = self.file.get("adam.second_moment", &[num_parameters])?;
        trainer.adam.num_gradient_steps = self.card.gradient_steps;
        trainer.adam.learning_rate = self.card.learning_rate;
        let num_observations = trainer.moments.mean.len();
        trainer.moments.count = self.card.observations;
        trainer.moments.mean = self.file.get("moments.mean", &[num_observations])?;
        trainer.moments.sum_squared_deviations =
            self.file.get("moments.sum_squared_deviations", &[num_observations])?;
        let num_environments = trainer.resolved().config.training.num_environments;
        let own = trainer.own_environments();
        let state_len = trainer.environments[0].state().len();
        let states: Vec<f64> = self.file.get("environments.state", &[num_environments, state_len])?;
        let episodes: Vec<f64> = self.file.get("environments.episode", &[num_environments, 2])?;
        let parts = states.chunks_exact(state_len).zip(episodes.chunks_exact(2)).skip(own.start);
        let targets = trainer.environments.iter_mut().zip(&mut trainer.collectors);
        for ((environment, collector), (state, episode)) in targets.zip(parts) {
            // The number of the next episode, and the env steps of the present one.
            if !is_count(state[0]) || !is_count(episode[1]) {
                let message = "it counts episodes or env steps that no environment comes to".to_owned();
                return Err(CheckpointError::Mismatch(message));
            }
            let mut observation = vec![0.0; num_observations];
            environment.set_state(state, &mut observation).map_err(CheckpointError::Mismatch)?;
            let [episode_return, episode_length] = [episode[0], episode[1]];
            let ongoing = OngoingEpisode { observation, episode_return, episode_length: episode_length as u64 };
            *collector = CollectorState::resume(ongoing);
        }
        trainer.progress = Progress {
            iterations: self.card.iterations,
            env_steps: self.card.env_steps,
            episodes: self.card.episodes,
            divergences: self.card.divergences,
        };
        Ok(())
    }
}

/// States and running episodes of every rank's environments, one environment after the other.
fn environments(trainer: &Trainer) -> (Vec<f64>, Vec<f64>) {
    let states: Vec<f64> = trainer.environments.iter().flat_map(TrainingEnvironment::state).collect();
    let ongoing = trainer.collectors.iter().map(|collector| &collector.ongoing);
    let ongoing: Vec<f64> =
        ongoing.flat_map(|episode| [episode.episode_return, episode.episode_length as f64]).collect();
    if trainer.communicator.num_ranks() == 1 {
        return (states, ongoing);
    }
    let mut message = Message::default();
    for numbers in [&states, &ongoing] {
        message.push_u64(numbers.len() as u64);
        message.push_f64s(numbers);
    }
    let (mut all_states, mut all_ongoing) = (Vec::new(), Vec::new());
    for message in exchange(&*trainer.communicator, message.bytes()) {
        let mut received = Received::new(&message);
        for all in [&mut all_states, &mut all_ongoing] {
            let mut numbers = vec![0.0; received.u64() as usize];
            received.f64s(&mut numbers);
            all.append(&mut numbers);
        }
    }
    (all_states, all_ongoing)
}

/// Whether a number of a file can be a count.
fn is_count(number: f64) -> bool {
    number.fract() == 0.0 && (0.0..=LARGEST_COUNT as f64).contains(&number)
}
