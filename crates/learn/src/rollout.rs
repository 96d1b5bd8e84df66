//! What one iteration collects: N environments, T steps each.

use crate::communicator::{Message, Received};

/// The samples of one iteration, environment by environment: sample n * T + t is step t of environment n.
///
/// An environment's part of every array is contiguous, so each can be filled by its own thread.
#[derive(Clone, Debug)]
pub struct Rollout {
    num_environments: usize,
    num_steps: usize,
    num_observations: usize,
    num_actions: usize,
    /// Normalised observations, `(N x T x O)`; from collection.
    pub observations: Vec<f32>,
    /// Sampled actions, not clamped, `(N x T x A)`; from collection.
    pub actions: Vec<f32>,
    /// Log-probabilities of the actions when they were sampled, `(N x T)`; from collection.
    pub log_probs: Vec<f32>,
    /// Rewards, `(N x T)`; from collection.
    pub rewards: Vec<f32>,
    /// Whether the step ended its episode by an accident, `(N x T)`; from collection.
    pub terminated: Vec<bool>,
    /// Whether the step ended its episode by a limit, `(N x T)`; from collection.
    pub truncated: Vec<bool>,
    /// Per environment the normalised observations that no step starts from: the last one of every truncated episode
    /// in the order of steps, then the one after step T; `(N)` lists of rows of O. From collection.
    pub bootstrap_observations: Vec<Vec<f32>>,
    /// The critic's values of the observations, `(N x T)`; from [`compute_values`](crate::advantage::compute_values).
    pub values: Vec<f32>,
    /// The value of what follows each step: 0 after an accident, `(N x T)`; as `values`.
    pub next_values: Vec<f32>,
    /// Advantages, `(N x T)`; from [`estimate_advantages`](crate::advantage::estimate_advantages).
    pub advantages: Vec<f32>,
    /// Targets of the critic, `(N x T)`; as `advantages`.
    pub returns: Vec<f32>,
}

/// One environment's part of a [`Rollout`]; the fields are the rollout's, without their first dimension.
#[derive(Debug)]
pub struct RolloutColumn<'a> {
    /// Normalised observations, `(T x O)`.
    pub observations: &'a mut [f32],
    /// Sampled actions, not clamped, `(T x A)`.
    pub actions: &'a mut [f32],
    /// Log-probabilities of the actions, `(T)`.
    pub log_probs: &'a mut [f32],
    /// Rewards, `(T)`.
    pub rewards: &'a mut [f32],
    /// Whether the step ended its episode by an accident, `(T)`.
    pub terminated: &'a mut [bool],
    /// Whether the step ended its episode by a limit, `(T)`.
    pub truncated: &'a mut [bool],
    /// Last observations of truncated episodes, then the one after step T; rows of O.
    pub bootstrap_observations: &'a mut Vec<f32>,
    /// Values of the observations, `(T)`.
    pub values: &'a mut [f32],
    /// Values of what follows each step, `(T)`.
    pub next_values: &'a mut [f32],
    /// Advantages, `(T)`.
    pub advantages: &'a mut [f32],
    /// Targets of the critic, `(T)`.
    pub returns: &'a mut [f32],
}

impl RolloutColumn<'_> {
    /// Appends what an update reads of this column, for other ranks: not where episodes end, nor `next_values`.
    pub fn write(&self, message: &mut Message) {
        let Self { observations, actions, log_probs, rewards, values, advantages, returns, .. } = self;
        for numbers in [observations, actions, log_probs, rewards, values, advantages, returns] {
            message.push_f32s(numbers);
        }
    }

    /// Fills the column with what another rank wrote.
    pub fn read(&mut self, received: &mut Received<'_>) {
        let Self { observations, actions, log_probs, rewards, values, advantages, returns, .. } = self;
        for numbers in [observations, actions, log_probs, rewards, values, advantages, returns] {
            received.f32s(numbers);
        }
    }
}

impl Rollout {
    /// Room for N environments, T steps, O observations and A actions. Nothing is allocated after this.
    ///
    /// # Panics
    /// If one of the four is 0.
    pub fn new(num_environments: usize, num_steps: usize, num_observations: usize, num_actions: usize) -> Self {
        let sizes = [num_environments, num_steps, num_observations, num_actions];
        assert!(!sizes.contains(&0), "a rollout of sizes {sizes:?} holds nothing");
        let samples = num_environments * num_steps;
        let bootstrap = || Vec::with_capacity((num_steps + 1) * num_observations);
        Self {
            num_environments,
            num_steps,
            num_observations,
            num_actions,
            observations: vec![0.0; samples * num_observations],
            actions: vec![0.0; samples * num_actions],
            log_probs: vec![0.0; samples],
            rewards: vec![0.0; samples],
            terminated: vec![false; samples],
            truncated: vec![false; samples],
            bootstrap_observations: (0..num_environments).map(|_| bootstrap()).collect(),
            values: vec![0.0; samples],
            next_values: vec![0.0; samples],
            advantages: vec![0.0; samples],
            returns: vec![0.0; samples],
        }
    }

    /// Number of environments, N.
    pub fn num_environments(&self) -> usize {
        self.num_environments
    }

    /// Number of steps of each environment, T.
    pub fn num_steps(&self) -> usize {
        self.num_steps
    }

    /// Number of samples, N T.
    pub fn num_samples(&self) -> usize {
        self.num_environments * self.num_steps
    }

    /// Length of an observation, O.
    pub fn num_observations(&self) -> usize {
        self.num_observations
    }

    /// Length of an action, A.
    pub fn num_actions(&self) -> usize {
        self.num_actions
    }

    /// The environments' parts, in order; each may go to another thread.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = RolloutColumn<'_>> {
        let steps = self.num_steps;
        let mut observations = self.observations.chunks_exact_mut(steps * self.num_observations);
        let mut actions = self.actions.chunks_exact_mut(steps * self.num_actions);
        let [mut log_probs, mut rewards, mut values, mut next_values, mut advantages, mut returns] = [
            &mut self.log_probs,
            &mut self.rewards,
            &mut self.values,
            &mut self.next_values,
            &mut self.advantages,
            &mut self.returns,
        ]
        .map(|array| array.chunks_exact_mut(steps));
        let [mut terminated, mut truncated] =
            [&mut self.terminated, &mut self.truncated].map(|array| array.chunks_exact_mut(steps));
        self.bootstrap_observations.iter_mut().map_while(move |bootstrap_observations| {
            Some(RolloutColumn {
                observations: observations.next()?,
                actions: actions.next()?,
                log_probs: log_probs.next()?,
                rewards: rewards.next()?,
                terminated: terminated.next()?,
                truncated: truncated.next()?,
                bootstrap_observations,
                values: values.next()?,
                next_values: next_values.next()?,
                advantages: advantages.next()?,
                returns: returns.next()?,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_the_environments_contiguous_parts() {
        let mut rollout = Rollout::new(3, 4, 2, 1);
        for (n, column) in rollout.columns_mut().enumerate() {
            column.observations.fill(n as f32);
            column.returns.fill(n as f32);
            assert_eq!((column.observations.len(), column.actions.len(), column.truncated.len()), (8, 4, 4));
        }
        assert_eq!(rollout.observations, [[0.0; 8], [1.0; 8], [2.0; 8]].concat());
        assert_eq!(rollout.returns, [[0.0; 4], [1.0; 4], [2.0; 4]].concat());
        assert_eq!(rollout.columns_mut().count(), 3);
        assert_eq!(rollout.num_samples(), 12);
    }
}
