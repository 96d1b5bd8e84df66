//! What an environment shows after an accident is nonsense, and nothing of it reaches the learner.

mod common;

use canter_learn::{ActorCritic, Environment, PpoSettings, StepOutcome};
use common::{Threads, Training};

/// Walks along a line and has an accident every seventh step. What it shows then is no number.
struct Exploding {
    num_steps: u32,
    /// Whether the time limit comes with the accident.
    is_at_limit: bool,
}

impl Environment for Exploding {
    fn num_observations(&self) -> usize {
        2
    }

    fn num_actions(&self) -> usize {
        1
    }

    fn reset(&mut self, observation: &mut [f32]) {
        self.num_steps = 0;
        observation.copy_from_slice(&[0.0, 1.0]);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome {
        self.num_steps += 1;
        let terminated = self.num_steps == 7;
        if terminated {
            observation.copy_from_slice(&[f32::NAN, 1e30]);
        } else {
            observation.copy_from_slice(&[self.num_steps as f32, action[0]]);
        }
        StepOutcome { reward: 1.0, terminated, truncated: terminated && self.is_at_limit }
    }
}

#[test]
fn nothing_of_a_last_observation_reaches_statistics_values_or_updates() {
    for is_at_limit in [false, true] {
        // 21 steps end with an accident, 23 in the middle of an episode.
        for num_steps in [21, 23] {
            let settings = PpoSettings { minibatch_size: 32, ..PpoSettings::default() };
            let environments = (0..4).map(|_| Exploding { num_steps: 0, is_at_limit }).collect();
            let mut training = Training::new(ActorCritic::new(2, 1, 8, 8), settings, 1, environments, num_steps);
            for _ in 0..3 {
                training.run_iteration(&Threads(2));
                let rollout = &training.rollout;
                assert_eq!(rollout.terminated.iter().filter(|&&terminated| terminated).count(), 12);
                assert!(rollout.truncated.iter().all(|&truncated| !truncated));
                // One row for each environment: the observation after the last step, of a new episode if that ended one.
                let rows: Vec<&[f32]> = rollout.bootstrap_observations.iter().map(|rows| &rows[..]).collect();
                assert!(rows.iter().all(|row| row.len() == 2 && row.iter().all(|value| value.is_finite())), "{rows:?}");
                let arrays = [&rollout.observations, &rollout.values, &rollout.next_values, &rollout.returns];
                assert!(arrays.into_iter().flatten().all(|value| value.is_finite()));
            }
            let moments = &training.moments;
            assert_eq!(moments.count, 3 * 4 * num_steps as u64);
            // The steps of an episode are counted from 0 to 6.
            assert!((0.0..=6.0).contains(&moments.mean[0]) && moments.mean[1].abs() <= 1.0, "{moments:?}");
            assert!(moments.sum_squared_deviations.iter().all(|sum| sum.is_finite()));
        }
    }
}
