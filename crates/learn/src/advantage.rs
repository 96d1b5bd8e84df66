//! Values and advantages of a collected rollout.

use crate::executor::{Executor, for_each_mut};
use crate::network::Activations;
use crate::policy::ActorCritic;
use crate::real::Real;
use crate::rollout::RolloutColumn;

/// Rows that go through the critic at once: the hidden layers of a block stay in the second-level cache.
const BLOCK_ROWS: usize = 128;

/// Added to the standard deviation that advantages are divided by: equal advantages become 0. Source: cleanrl.
const ADVANTAGE_STD_FLOOR: f64 = 1e-8;

/// How much better a step turned out than the value said.
///
/// ```text
/// A = r + gamma V(s') - V(s)
/// ```
///
/// V(s') -> `next_value`: 0 after an accident; after a time limit the value of the episode's last observation.
///
/// Source: the paper, section II.A (its print omits a bracket); Schulman et al. 2016, section 3 (delta).
pub fn one_step_advantage<T: Real>(reward: T, gamma: T, value: T, next_value: T) -> T {
    reward + gamma * next_value - value
}

/// Generalised advantage estimate of every step of one environment.
///
/// ```text
/// A_t = delta_t + gamma lambda (1 - end_t) A_{t+1},   delta_t = r_t + gamma V(s_{t+1}) - V(s_t)
/// ```
///
/// lambda -> `gae_lambda`; end_t -> `episode_ended`: accident or limit, either cuts the trace.
/// With lambda 0 it is [`one_step_advantage`], with lambda 1 the discounted return minus the value.
///
/// # Shapes
/// - `steps`: `(T)` each
/// - `advantages`: `(T)`
///
/// Source: Schulman et al. 2016, eq. 16, in its recursive form; cut at the ends of episodes and of the rollout.
pub fn generalised_advantage<T: Real>(steps: &Steps<'_, T>, gamma: T, gae_lambda: T, advantages: &mut [T]) {
    let mut following = T::ZERO;
    for t in (0..advantages.len()).rev() {
        if steps.episode_ended(t) {
            following = T::ZERO;
        }
        let delta = one_step_advantage(steps.rewards[t], gamma, steps.values[t], steps.next_values[t]);
        following = delta + gamma * gae_lambda * following;
        advantages[t] = following;
    }
}

/// What the advantages of one environment are computed from.
#[derive(Clone, Copy, Debug)]
pub struct Steps<'a, T> {
    /// Rewards, `(T)`.
    pub rewards: &'a [T],
    /// Values of the observations, `(T)`.
    pub values: &'a [T],
    /// Values of what follows: 0 after an accident, `(T)`.
    pub next_values: &'a [T],
    /// Accidents, `(T)`.
    pub terminated: &'a [bool],
    /// Limits, `(T)`.
    pub truncated: &'a [bool],
}

impl<T> Steps<'_, T> {
    /// Whether step t was its episode's last.
    fn episode_ended(&self, t: usize) -> bool {
        self.terminated[t] || self.truncated[t]
    }
}

/// Writes the critic's `values` and `next_values` of these environments, side by side.
///
/// The value after a time limit is that of the episode's last observation; after an accident it is 0.
///
/// # Panics
/// If the parameters or the columns do not fit the model.
pub fn compute_values(
    columns: &mut [RolloutColumn<'_>],
    model: &ActorCritic,
    parameters: &[f32],
    executor: &dyn Executor,
) {
    let critic_parameters = model.split(parameters).critic;
    for_each_mut(executor, columns, |_, column| compute_column_values(column, model, critic_parameters));
}

fn compute_column_values(column: &mut RolloutColumn<'_>, model: &ActorCritic, critic_parameters: &[f32]) {
    let critic = model.batched_critic();
    let num_observations = critic.shape.input;
    let num_steps = column.rewards.len();
    assert_eq!(
        column.observations.len(),
        num_steps * num_observations,
        "observations of the rollout and of the critic"
    );
    let mut activations = Activations::new(critic.shape, BLOCK_ROWS.min(num_steps));
    let block_len = BLOCK_ROWS.min(num_steps) * num_observations;
    for (rows, values) in column.observations.chunks(block_len).zip(column.values.chunks_mut(BLOCK_ROWS)) {
        critic.forward(critic_parameters, rows, &mut activations);
        values.copy_from_slice(activations.output(values.len()));
    }

    let mut bootstrap_rows = column.bootstrap_observations.chunks_exact(num_observations);
    let mut bootstrap_value = || {
        let row = bootstrap_rows.next().expect("collection keeps a row for every limit and one for the end");
        critic.forward(critic_parameters, row, &mut activations);
        activations.output(1)[0]
    };
    for t in 0..num_steps {
        column.next_values[t] = if column.terminated[t] {
            0.0
        } else if column.truncated[t] {
            bootstrap_value()
        } else {
            match column.values.get(t + 1) {
                Some(&value) => value,
                None => bootstrap_value(),
            }
        };
    }
}

/// Writes `advantages` and `returns` of these environments; their values must be there.
///
/// ```text
/// returns = advantages + values
/// ```
///
/// Source: Schulman et al. 2016, eq. 16; the critic's target is the lambda-return, as in Schulman et al. 2017.
pub fn estimate_advantages(columns: &mut [RolloutColumn<'_>], gamma: f64, gae_lambda: f64) {
    for column in columns {
        let steps = Steps {
            rewards: &*column.rewards,
            values: &*column.values,
            next_values: &*column.next_values,
            terminated: &*column.terminated,
            truncated: &*column.truncated,
        };
        generalised_advantage(&steps, gamma as f32, gae_lambda as f32, column.advantages);
        for ((total, &advantage), &value) in column.returns.iter_mut().zip(&*column.advantages).zip(&*column.values) {
            *total = advantage + value;
        }
    }
}

/// Shifts and scales the advantages to mean 0 and standard deviation 1.
///
/// ```text
/// A = (A - mean(A)) / (std(A) + 1e-8)
/// ```
///
/// Source: rsl_rl; over the whole rollout, as there, not per minibatch.
pub(crate) fn normalise(advantages: &mut [f32]) {
    let (mean, variance) = mean_and_variance(advantages.iter().map(|&a| f64::from(a)));
    let inverse_std = 1.0 / (variance.sqrt() + ADVANTAGE_STD_FLOOR);
    for advantage in advantages {
        *advantage = ((f64::from(*advantage) - mean) * inverse_std) as f32;
    }
}

/// Mean and population variance.
pub(crate) fn mean_and_variance(numbers: impl ExactSizeIterator<Item = f64> + Clone) -> (f64, f64) {
    let count = numbers.len() as f64;
    let mean = numbers.clone().sum::<f64>() / count;
    (mean, numbers.map(|x| (x - mean) * (x - mean)).sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_step_advantage_agrees_with_a_number_computed_by_hand() {
        // 1 + 0.9 * 4 - 3
        assert!((one_step_advantage(1.0, 0.9, 3.0, 4.0) - 1.6_f64).abs() < 1e-12);
    }

    #[test]
    fn generalised_advantage_agrees_with_numbers_computed_by_hand() {
        let steps = Steps {
            rewards: &[1.0, 2.0, 3.0],
            values: &[0.5, 1.0, 1.5],
            next_values: &[1.0, 0.0, 2.0],
            terminated: &[false, true, false],
            truncated: &[false; 3],
        };
        let mut advantages = [0.0; 3];
        generalised_advantage(&steps, 0.5, 0.5, &mut advantages);
        // delta = 1 + 0.5 - 0.5 = 1, 2 - 1 = 1, 3 + 1 - 1.5 = 2.5; A = 1 + 0.25 * 1, 1 (cut), 2.5
        assert_eq!(advantages, [1.25, 1.0, 2.5]);
    }

    #[test]
    fn advantages_are_normalised_and_equal_ones_become_zero() {
        let mut advantages = [1.0, 3.0];
        normalise(&mut advantages);
        assert!((advantages[0] + 1.0).abs() < 1e-6 && (advantages[1] - 1.0).abs() < 1e-6);
        let mut equal = [7.0; 3];
        normalise(&mut equal);
        assert_eq!(equal, [0.0; 3]);
    }
}
