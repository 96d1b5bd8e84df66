//! What an environment brought in one iteration besides its samples.

use canter_learn::collect::{CollectorState, EpisodeRecord};
use canter_learn::communicator::{Message, Received};
use canter_learn::normaliser::RunningMoments;

use crate::blow_up::BlowUp;
use crate::environment::{TrainingEnvironment, Travel};

/// What an environment brought in one iteration besides its samples; every rank knows it of all environments.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// Statistics of its observations.
    pub moments: RunningMoments,
    /// Episodes that ended.
    pub finished_episodes: Vec<EpisodeRecord>,
    /// What it did.
    pub travel: Travel,
    /// How hard its next episode is; none without a curriculum.
    pub level: Option<f64>,
    /// Its first episode that ended in physics that made no sense.
    pub blow_up: Option<BlowUp>,
}

impl Outcome {
    /// Takes it from an environment of this process.
    pub fn take(environment: &mut TrainingEnvironment, collector: &CollectorState) -> Self {
        Self {
            moments: collector.moments.clone(),
            finished_episodes: collector.finished_episodes.clone(),
            travel: std::mem::take(&mut environment.travel),
            level: environment.level(),
            blow_up: environment.blow_up.take(),
        }
    }

    /// Appends it, for other ranks.
    pub fn write(&self, message: &mut Message) {
        message.push_u64(self.moments.count);
        message.push_u64(self.moments.mean.len() as u64);
        message.push_f64s(&self.moments.mean);
        message.push_f64s(&self.moments.sum_squared_deviations);
        message.push_u64(self.finished_episodes.len() as u64);
        for episode in &self.finished_episodes {
            message.push_f64s(&[episode.episode_return]);
            message.push_u64(episode.episode_length);
            message.push_u64(u64::from(episode.terminated));
        }
        message.push_f64s(&[self.travel.forward_m, self.travel.work_j]);
        self.travel.accidents.iter().for_each(|&count| message.push_u64(count));
        message.push_u64(u64::from(self.level.is_some()));
        message.push_f64s(&[self.level.unwrap_or_default()]);
        message.push_bytes(&self.blow_up.as_ref().map(BlowUp::to_bytes).unwrap_or_default());
    }

    /// What another rank wrote.
    pub fn read(received: &mut Received<'_>) -> Self {
        let count = received.u64();
        let mut moments = RunningMoments::new(received.u64() as usize);
        moments.count = count;
        received.f64s(&mut moments.mean);
        received.f64s(&mut moments.sum_squared_deviations);
        let num_episodes = received.u64();
        let finished_episodes = (0..num_episodes)
            .map(|_| EpisodeRecord {
                episode_return: f64(received),
                episode_length: received.u64(),
                terminated: received.u64() == 1,
            })
            .collect();
        let travel = Travel {
            forward_m: f64(received),
            work_j: f64(received),
            accidents: std::array::from_fn(|_| received.u64()),
        };
        let has_level = received.u64() == 1;
        let level = Some(f64(received)).filter(|_| has_level);
        let blow_up = Some(received.bytes()).filter(|bytes| !bytes.is_empty());
        let blow_up = blow_up.map(|bytes| BlowUp::from_bytes(bytes).expect("another rank has just made it"));
        Self { moments, finished_episodes, travel, level, blow_up }
    }
}

/// Reads a number.
fn f64(received: &mut Received<'_>) -> f64 {
    let mut number = [0.0];
    received.f64s(&mut number);
    number[0]
}
