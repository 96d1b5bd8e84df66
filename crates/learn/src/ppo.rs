//! The update: several passes over one rollout, minibatch by minibatch.

use crate::adam::Adam;
use crate::advantage::normalise;
use crate::communicator::{Communicator, Message, Received, own_part, part};
use crate::executor::{Executor, Serial, for_each_mut};
use crate::loss::LossSums;
use crate::metrics::{MetricTotals, UpdateMetrics, explained_variance};
use crate::policy::ActorCritic;
use crate::random::{Purpose, shuffle, stream};
use crate::rollout::Rollout;
use crate::settings::PpoSettings;
use crate::shard::{MAX_ROWS, Shard};
use crate::simd;
use std::ops::Range;

/// Smallest learning rate that a target KL may lead to. Source: rsl_rl.
pub const MIN_LEARNING_RATE: f64 = 1e-5;

/// Largest learning rate that a target KL may lead to. Source: rsl_rl.
pub const MAX_LEARNING_RATE: f64 = 1e-2;

/// Factor by which a target KL changes the learning rate. Source: rsl_rl; larger follows faster and swings more.
const LEARNING_RATE_FACTOR: f64 = 1.5;

/// The divergence may be this many times too large or too small before the learning rate changes. Source: rsl_rl.
const KL_TOLERANCE: f64 = 2.0;

/// A minibatch of at most this many shards is not worth waking other threads for: a second thread gains nothing at 64
/// samples and a third at 512 (measured on 2 cores).
const MAX_SERIAL_SHARDS: usize = 2;

/// What an update is done with; none of it changes.
#[derive(Clone, Copy)]
pub struct UpdateContext<'a> {
    /// Sizes of what is learned.
    pub model: &'a ActorCritic,
    /// Settings of PPO.
    pub settings: &'a PpoSettings,
    /// Where shards of a minibatch run; the result is the same for each.
    pub executor: &'a dyn Executor,
    /// The ranks that share the shards of a minibatch, each with the same rollout; the result is the same for any number.
    pub communicator: &'a dyn Communicator,
    /// The run's seed.
    pub seed: u64,
    /// Number of the iteration: with the seed it selects the shuffles.
    pub iteration: u64,
}

/// A loss or gradient was not finite. Parameters and optimiser are as they were before the update.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "learning diverged in iteration {iteration}, epoch {epoch}, minibatch {minibatch}: the {quantity} is not a finite \
     number. Likely cause: {likely_cause}"
)]
pub struct Divergence {
    /// The iteration.
    pub iteration: u64,
    /// Pass over the rollout, from 0.
    pub epoch: usize,
    /// Minibatch of the pass, from 0.
    pub minibatch: usize,
    /// What was not finite.
    pub quantity: DivergedQuantity,
    /// What the rollout says of the reason.
    pub likely_cause: LikelyCause,
}

/// What a [`Divergence`] was noticed by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DivergedQuantity {
    /// The complete loss.
    Loss,
    /// The gradient's norm.
    Gradient,
    /// A parameter after the step.
    Parameter,
}

impl std::fmt::Display for DivergedQuantity {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Loss => "loss",
            Self::Gradient => "gradient",
            Self::Parameter => "parameter vector",
        })
    }
}

/// Why learning has probably diverged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LikelyCause {
    /// A reward, a return or an observation is not finite, or far from 1.
    HugeNumbers,
    /// The rollout is in order: the steps were too large.
    LearningRate,
}

impl LikelyCause {
    /// Numbers that learning is made for are around 1; those of a rollout beyond this are a likely cause [-].
    const HUGE: f32 = 1e6;

    fn of(rollout: &Rollout) -> Self {
        let is_small = |value: &f32| value.abs() < Self::HUGE;
        let [observations, rewards, returns] = [&rollout.observations, &rollout.rewards, &rollout.returns];
        let is_in_order = [observations, rewards, returns].into_iter().flatten().all(is_small);
        if is_in_order { Self::LearningRate } else { Self::HugeNumbers }
    }
}

impl std::fmt::Display for LikelyCause {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::HugeNumbers => {
                "rewards or observations are huge; lower the weights in `[reward]`, and look for accidents called \
                 `unstable`"
            }
            Self::LearningRate => "too large a step; lower `ppo.learning_rate` or `ppo.max_gradient_norm`",
        })
    }
}

/// Everything that [`update`] needs besides its arguments; allocated once.
#[derive(Clone, Debug)]
pub struct PpoWorkspace {
    shards: Vec<Shard>,
    /// Gradient of the mean loss of a minibatch.
    gradient: Vec<f32>,
    /// The samples' order in this epoch, `(N T)`.
    order: Vec<u32>,
    /// Advantages as the losses see them, `(N T)`.
    advantages: Vec<f32>,
    /// What the update began with, to go back to after a divergence: a copy costs less than one gradient step.
    initial_parameters: Vec<f32>,
    initial_adam: Adam,
    /// Gradients of this rank's shards, and those of all ranks'.
    message: Message,
    received: Vec<u8>,
}

impl PpoWorkspace {
    /// Workspace for updates from rollouts of `num_samples`, N T.
    ///
    /// # Panics
    /// If `num_samples` is 0 or above 2^32, or the settings' `minibatch_size` is 0.
    pub fn new(model: &ActorCritic, settings: &PpoSettings, num_samples: usize) -> Self {
        let num_samples_u32 = u32::try_from(num_samples).expect("a rollout has at most 2^32 samples");
        let num_minibatches = num_minibatches(num_samples, settings.minibatch_size);
        let num_shards = num_samples.div_ceil(num_minibatches).div_ceil(MAX_ROWS);
        Self {
            shards: (0..num_shards).map(|_| Shard::new(model)).collect(),
            gradient: vec![0.0; model.num_parameters()],
            order: (0..num_samples_u32).collect(),
            advantages: vec![0.0; num_samples],
            initial_parameters: vec![0.0; model.num_parameters()],
            initial_adam: Adam::new(model.num_parameters(), settings.learning_rate),
            message: Message::default(),
            received: Vec::new(),
        }
    }
}

/// Improves the parameters by one rollout, whose advantages and returns must be there.
///
/// Every pass visits every sample once, in an order of its own. A gradient is a sum over shards of fixed size, added in
/// their order, so the bytes depend neither on the executor and its threads nor on the number of ranks.
///
/// # Errors
/// [`Divergence`] if a loss or gradient is not finite; `parameters` and `adam` are then what they were.
///
/// # Panics
/// If parameters, rollout, settings or workspace do not belong to the model and to each other.
///
/// ```text
/// for each epoch, for each minibatch B:  parameters <- Adam(parameters, gradient of the mean loss over B)
/// ```
///
/// Source: Schulman et al. 2017, algorithm 1; the paper, section II.A.
pub fn update(
    parameters: &mut [f32],
    adam: &mut Adam,
    rollout: &Rollout,
    context: &UpdateContext<'_>,
    workspace: &mut PpoWorkspace,
) -> Result<UpdateMetrics, Divergence> {
    assert_eq!(workspace.order.len(), rollout.num_samples(), "samples of the workspace and of the rollout");
    assert_eq!(context.model.num_observations(), rollout.num_observations(), "observations of model and rollout");
    assert_eq!(context.model.num_actions(), rollout.num_actions(), "actions of model and rollout");
    workspace.initial_parameters.copy_from_slice(parameters);
    workspace.initial_adam.clone_from(adam);
    let result = run_epochs(parameters, adam, rollout, context, workspace);
    if result.is_err() {
        parameters.copy_from_slice(&workspace.initial_parameters);
        adam.clone_from(&workspace.initial_adam);
    }
    result
}

fn run_epochs(
    parameters: &mut [f32],
    adam: &mut Adam,
    rollout: &Rollout,
    context: &UpdateContext<'_>,
    workspace: &mut PpoWorkspace,
) -> Result<UpdateMetrics, Divergence> {
    let settings = context.settings;
    let num_samples = rollout.num_samples();
    let num_minibatches = num_minibatches(num_samples, settings.minibatch_size);
    workspace.advantages.copy_from_slice(&rollout.advantages);
    if settings.normalise_advantages {
        normalise(&mut workspace.advantages);
    }
    for (place, sample) in workspace.order.iter_mut().zip(0..) {
        *place = sample;
    }

    let mut totals = MetricTotals::default();
    for epoch in 0..settings.num_epochs {
        shuffle(&mut workspace.order, &mut stream(context.seed, Purpose::Shuffle, epoch as u64, context.iteration));
        for minibatch in 0..num_minibatches {
            let diverged = |quantity| Divergence {
                iteration: context.iteration,
                epoch,
                minibatch,
                quantity,
                likely_cause: LikelyCause::of(rollout),
            };
            let sums = minibatch_gradient(
                parameters,
                rollout,
                context,
                workspace,
                part(num_samples, num_minibatches, minibatch),
            );
            if !sums.total(settings).is_finite() {
                return Err(diverged(DivergedQuantity::Loss));
            }
            let gradient_norm = limit_norm(&mut workspace.gradient, settings.max_gradient_norm);
            if !gradient_norm.is_finite() {
                return Err(diverged(DivergedQuantity::Gradient));
            }
            if let Some(target_kl) = settings.target_kl
                && totals.num_gradient_steps > 0
            {
                // The first step's policy is the one that collected: its divergence of 0 says nothing.
                let approx_kl = sums.approx_kl / sums.num_samples as f64;
                adam.learning_rate = adapted_learning_rate(adam.learning_rate, approx_kl, target_kl);
            }
            adam.step(parameters, &workspace.gradient);
            if !parameters.iter().all(|parameter| parameter.is_finite()) {
                return Err(diverged(DivergedQuantity::Parameter));
            }
            totals.add(&sums, gradient_norm);
        }
    }
    let explained_variance = explained_variance(&rollout.values, &rollout.returns);
    Ok(totals.metrics(explained_variance, adam.learning_rate))
}

/// Leaves the gradient of the minibatch's mean loss in the workspace and returns the sums of its losses.
///
/// `places` -> where in the epoch's order the minibatch lies.
fn minibatch_gradient(
    parameters: &[f32],
    rollout: &Rollout,
    context: &UpdateContext<'_>,
    workspace: &mut PpoWorkspace,
    places: Range<usize>,
) -> LossSums {
    let indices = &workspace.order[places];
    let advantages = &workspace.advantages;
    let num_shards = indices.len().div_ceil(MAX_ROWS);
    let shards = &mut workspace.shards[..num_shards];
    let num_ranks = context.communicator.num_ranks();
    // One shard alone is computed by every rank: that takes no longer than to wait for the one that does.
    let is_shared = num_ranks > 1 && num_shards > 1;
    let own = if is_shared { own_part(context.communicator, num_shards) } else { 0..num_shards };
    let executor = if own.len() <= MAX_SERIAL_SHARDS { &Serial } else { context.executor };
    for_each_mut(executor, &mut shards[own.clone()], |i, shard| {
        shard.gather(rollout, advantages, &indices[part(indices.len(), num_shards, own.start + i)]);
        shard.compute_gradient(context.model, parameters, context.settings);
    });
    if is_shared {
        share_gradients(shards, own, context.communicator, (&mut workspace.message, &mut workspace.received));
    }

    let mut sums = LossSums::default();
    workspace.gradient.fill(0.0);
    for shard in shards {
        sums.add(shard.sums());
        simd::add(&mut workspace.gradient, shard.gradient());
    }
    simd::scale(&mut workspace.gradient, 1.0 / indices.len() as f32);
    sums
}

/// Gives every rank the gradients of all shards, of which this one has computed its `own`.
fn share_gradients(
    shards: &mut [Shard],
    own: Range<usize>,
    communicator: &dyn Communicator,
    (message, received): (&mut Message, &mut Vec<u8>),
) {
    let (num_ranks, shard_bytes) = (communicator.num_ranks(), shards[0].num_bytes());
    message.clear();
    shards[own.clone()].iter().for_each(|shard| shard.write(message));
    let lengths: Vec<usize> =
        (0..num_ranks).map(|rank| part(shards.len(), num_ranks, rank).len() * shard_bytes).collect();
    received.resize(shards.len() * shard_bytes, 0);
    communicator.all_gather(message.bytes(), &lengths, received);
    for (i, (shard, bytes)) in shards.iter_mut().zip(received.chunks_exact(shard_bytes)).enumerate() {
        if !own.contains(&i) {
            shard.read(&mut Received::new(bytes));
        }
    }
}

/// Scales the gradient down to a norm of at most `max_norm` and returns the norm it had.
///
/// ```text
/// g = g min(1, max_norm / |g|)
/// ```
///
/// Source: Pascanu, Mikolov and Bengio 2013, algorithm 1.
pub fn limit_norm(gradient: &mut [f32], max_norm: f64) -> f64 {
    let norm = simd::norm(gradient);
    if norm > max_norm {
        simd::scale(gradient, (max_norm / norm) as f32);
    }
    norm
}

/// The learning rate that a target for the divergence leads to.
///
/// ```text
/// lr / 1.5 if KL > 2 target,   1.5 lr if KL < target / 2,   else lr;   kept in [1e-5, 1e-2]
/// ```
///
/// KL -> `approx_kl`.
///
/// Source: rsl_rl, adaptive schedule; there KL is exact, here it is [`approx_kl`](crate::loss::approx_kl), and
/// the first gradient step of an update, whose divergence is 0, does not count.
pub fn adapted_learning_rate(learning_rate: f64, approx_kl: f64, target_kl: f64) -> f64 {
    if approx_kl > KL_TOLERANCE * target_kl {
        (learning_rate / LEARNING_RATE_FACTOR).max(MIN_LEARNING_RATE)
    } else if approx_kl < target_kl / KL_TOLERANCE {
        (learning_rate * LEARNING_RATE_FACTOR).min(MAX_LEARNING_RATE)
    } else {
        learning_rate
    }
}

/// The learning rate of a training that has taken a share of its env steps.
///
/// ```text
/// lr_0 + (lr_1 - lr_0) min(share, 1)
/// ```
///
/// `first` -> lr_0, `last` -> lr_1. Large steps learn fast while everything is to be learned, small ones at the end leave
/// a policy that the last rollouts have not thrown about.
///
/// Source: Schulman et al. 2017, table 5, where it falls to 0.
pub fn annealed_learning_rate(first: f64, last: f64, share: f64) -> f64 {
    first + (last - first) * share.min(1.0)
}

/// Into how many equal minibatches a rollout is cut: the size nearest to the one asked for.
fn num_minibatches(num_samples: usize, minibatch_size: usize) -> usize {
    assert!(num_samples > 0 && minibatch_size > 0, "a minibatch needs samples");
    ((num_samples + minibatch_size / 2) / minibatch_size).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_limited_to_the_norm_and_shorter_ones_kept() {
        let mut gradient = [3.0, -4.0];
        assert_eq!(limit_norm(&mut gradient, 10.0), 5.0);
        assert_eq!(gradient, [3.0, -4.0]);
        assert_eq!(limit_norm(&mut gradient, 2.5), 5.0);
        assert_eq!(gradient, [1.5, -2.0]);
    }

    #[test]
    fn the_learning_rate_follows_the_divergence_within_bounds() {
        assert_eq!(adapted_learning_rate(3e-4, 0.021, 0.01), 3e-4 / 1.5);
        assert_eq!(adapted_learning_rate(3e-4, 0.004, 0.01), 3e-4 * 1.5);
        assert_eq!(adapted_learning_rate(3e-4, 0.015, 0.01), 3e-4);
        assert_eq!(adapted_learning_rate(1.1e-5, 1.0, 0.01), MIN_LEARNING_RATE);
        assert_eq!(adapted_learning_rate(9e-3, 0.0, 0.01), MAX_LEARNING_RATE);
    }

    #[test]
    fn the_annealed_learning_rate_falls_evenly_and_stays_at_the_end() {
        let at = |share: f64| annealed_learning_rate(8e-4, 2e-4, share);
        for (share, expected) in [(0.0, 8e-4), (0.25, 6.5e-4), (1.0, 2e-4), (1.5, 2e-4)] {
            assert!((at(share) - expected).abs() < 1e-18, "{share}: {}", at(share));
        }
    }

    #[test]
    fn parts_cover_everything_once_and_differ_by_at_most_one() {
        for (len, size) in [(100, 64), (96, 64), (640, 64), (10, 64), (1000, 300), (7, 1)] {
            let count = num_minibatches(len, size);
            let parts: Vec<Range<usize>> = (0..count).map(|i| part(len, count, i)).collect();
            assert!(parts.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!((parts[0].start, parts[count - 1].end), (0, len));
            let sizes = parts.iter().map(Range::len);
            assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
        }
        assert_eq!(num_minibatches(1000, 300), 3);
        assert_eq!(num_minibatches(100, 64), 2);
    }
}
