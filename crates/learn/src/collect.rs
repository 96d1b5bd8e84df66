//! Collection: one environment is stepped to the end of its column, waiting for no other.

use crate::environment::Environment;
use crate::gaussian::DiagonalGaussian;
use crate::normaliser::{Normaliser, RunningMoments};
use crate::rollout::RolloutColumn;
use canter_gait::network::Network;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A forward pass of the actor: network, input `(O)`, workspace `(2 H)`, output `(A)`.
///
/// The caller picks the compiled version that suits the processor.
pub type Forward = for<'a> fn(&Network<'a>, &[f32], &mut [f32], &mut [f32]);

/// [`Network::forward`] compiled for the target's baseline.
pub const PORTABLE_FORWARD: Forward = |network, input, workspace, output| network.forward(input, workspace, output);

/// The policy that collects; it does not change within an iteration.
#[derive(Clone, Copy, Debug)]
pub struct PolicyView<'a> {
    /// Normalised observation to mean of the action.
    pub actor: Network<'a>,
    /// Natural logarithms of the standard deviations, `(A)`.
    pub log_std: &'a [f32],
    /// Statistics of the iterations before.
    pub normaliser: &'a Normaliser,
    /// How the actor is computed.
    pub forward: Forward,
}

/// One finished episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EpisodeRecord {
    /// Sum of the rewards.
    pub episode_return: f64,
    /// Number of environment steps.
    pub episode_length: u64,
    /// Whether it ended by an accident; otherwise by a limit.
    pub terminated: bool,
}

/// The episode that an environment is in: what has to be kept between iterations, and in a checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct OngoingEpisode {
    /// The current observation, not normalised, `(O)`.
    pub observation: Vec<f32>,
    /// Sum of the rewards so far.
    pub episode_return: f64,
    /// Number of environment steps so far.
    pub episode_length: u64,
}

/// One environment's side of the collection.
#[derive(Clone, Debug)]
pub struct CollectorState {
    /// The episode that the environment is in.
    pub ongoing: OngoingEpisode,
    /// Statistics of this iteration's observations.
    pub moments: RunningMoments,
    /// Episodes that ended in this iteration, in order.
    pub finished_episodes: Vec<EpisodeRecord>,
    gaussian: DiagonalGaussian<f32>,
    workspace: Vec<f32>,
    mean: Vec<f32>,
    clamped_action: Vec<f32>,
}

impl CollectorState {
    /// Resets the environment and begins its first episode.
    pub fn start<E: Environment + ?Sized>(environment: &mut E) -> Self {
        let mut observation = vec![0.0; environment.num_observations()];
        environment.reset(&mut observation);
        Self::resume(OngoingEpisode { observation, episode_return: 0.0, episode_length: 0 })
    }

    /// Goes on with an episode whose environment was restored.
    pub fn resume(ongoing: OngoingEpisode) -> Self {
        Self {
            moments: RunningMoments::new(ongoing.observation.len()),
            ongoing,
            finished_episodes: Vec::new(),
            gaussian: DiagonalGaussian::default(),
            workspace: Vec::new(),
            mean: Vec::new(),
            clamped_action: Vec::new(),
        }
    }

    /// Forgets the last iteration and makes room for this one.
    fn begin_iteration(&mut self, policy: &PolicyView<'_>, num_steps: usize) {
        self.moments.clear();
        self.finished_episodes.clear();
        self.finished_episodes.reserve(num_steps);
        self.gaussian.set_log_std(policy.log_std);
        self.workspace.resize(policy.actor.workspace_len(), 0.0);
        self.mean.resize(policy.log_std.len(), 0.0);
        self.clamped_action.resize(policy.log_std.len(), 0.0);
    }
}

/// Steps one environment until its column is full, resetting it at the end of every episode.
///
/// ```text
/// a = mean(normalise(o)) + std * noise,   the environment gets clamp(a, -1, 1),   the column keeps a and ln p(a)
/// ```
///
/// `state.moments` and `state.finished_episodes` are of this call only. `rng` is the environment's exploration
/// stream of this iteration. Nothing is allocated per step.
///
/// # Panics
/// If the sizes of environment, policy, column and state differ.
///
/// Source: the paper, section II.A (experience of the current policy); clamping the robot's action while keeping the
/// log-probability of the unclamped sample is ours.
pub fn collect_column<E: Environment + ?Sized>(
    environment: &mut E,
    policy: &PolicyView<'_>,
    column: &mut RolloutColumn<'_>,
    state: &mut CollectorState,
    rng: &mut ChaCha8Rng,
) {
    let shape = policy.actor.shape();
    assert_eq!(environment.num_observations(), shape.input, "observations of the environment and of the policy");
    assert_eq!(environment.num_actions(), shape.output, "actions of the environment and of the policy");
    assert_eq!(policy.log_std.len(), shape.output, "actions of the policy's mean and of its spread");
    let num_steps = column.rewards.len();
    assert_eq!(column.observations.len(), num_steps * shape.input, "observations of the rollout");
    assert_eq!(column.actions.len(), num_steps * shape.output, "actions of the rollout");

    state.begin_iteration(policy, num_steps);
    column.bootstrap_observations.clear();
    let rows = column.observations.chunks_exact_mut(shape.input).zip(column.actions.chunks_exact_mut(shape.output));
    for (t, (observation, action)) in rows.enumerate() {
        state.moments.observe(&state.ongoing.observation);
        policy.normaliser.apply(&state.ongoing.observation, observation);
        (policy.forward)(&policy.actor, observation, &mut state.workspace, &mut state.mean);
        sample(&state.mean, state.gaussian.std(), rng, action);
        column.log_probs[t] = state.gaussian.log_prob(action, &state.mean);
        for (clamped, &component) in state.clamped_action.iter_mut().zip(&*action) {
            *clamped = component.clamp(-1.0, 1.0);
        }

        let outcome = environment.step(&state.clamped_action, &mut state.ongoing.observation);
        column.rewards[t] = outcome.reward;
        column.terminated[t] = outcome.terminated;
        // A step that is both is an accident: there is nothing to bootstrap from.
        column.truncated[t] = outcome.truncated && !outcome.terminated;
        state.ongoing.episode_return += f64::from(outcome.reward);
        state.ongoing.episode_length += 1;
        if column.truncated[t] {
            push_normalised(policy.normaliser, &state.ongoing.observation, column.bootstrap_observations);
        }
        if outcome.terminated || outcome.truncated {
            state.finished_episodes.push(EpisodeRecord {
                episode_return: state.ongoing.episode_return,
                episode_length: state.ongoing.episode_length,
                terminated: outcome.terminated,
            });
            state.ongoing.episode_return = 0.0;
            state.ongoing.episode_length = 0;
            environment.reset(&mut state.ongoing.observation);
        }
    }
    push_normalised(policy.normaliser, &state.ongoing.observation, column.bootstrap_observations);
}

/// Draws an action.
///
/// ```text
/// a_j = mean_j + std_j * noise_j,   noise_j from a standard normal distribution
/// ```
///
/// # Shapes
/// - `mean`, `std`, `action`: `(A)`
///
/// Source: Bishop 2006, section 2.3 (the Gaussian with a diagonal covariance).
fn sample(mean: &[f32], std: &[f32], rng: &mut ChaCha8Rng, action: &mut [f32]) {
    for ((component, &mean), &std) in action.iter_mut().zip(mean).zip(std) {
        let noise: f32 = StandardNormal.sample(rng);
        *component = mean + std * noise;
    }
}

/// Appends the normalised observation as one more row.
fn push_normalised(normaliser: &Normaliser, observation: &[f32], rows: &mut Vec<f32>) {
    let start = rows.len();
    rows.extend_from_slice(observation);
    normaliser.view().apply(&mut rows[start..]);
}
