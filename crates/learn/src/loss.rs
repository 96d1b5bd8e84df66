//! The losses, their derivatives, and the gradient of the complete loss over a block of rows.
//!
//! Each term is the loss of one sample; an update averages over the samples of a minibatch.
//!
//! ```text
//! loss = -surrogate + c_v value_loss - c_e entropy
//! ```
//!
//! c_v -> `value_coefficient`, c_e -> `entropy_coefficient`.
//!
//! Source: Schulman et al. 2017, eq. 9, with the sign of a loss.

use crate::communicator::{Message, Received};
use crate::gaussian::DiagonalGaussian;
use crate::network::Activations;
use crate::policy::ActorCritic;
use crate::real::Real;
use crate::settings::{Objective, PpoSettings};

/// How much more likely the action is under the new policy than under the one that sampled it.
///
/// ```text
/// r(theta) = pi_theta(a|s) / pi_old(a|s) = exp(ln pi_theta(a|s) - ln pi_old(a|s))
/// ```
///
/// Its derivative by `log_prob` is the ratio itself.
///
/// Source: the paper, eq. 2 (the quotient); Schulman et al. 2017, section 3.
pub fn ratio<T: Real>(log_prob: T, old_log_prob: T) -> T {
    (log_prob - old_log_prob).exp()
}

/// The unclipped objective of one sample.
///
/// ```text
/// L = r A
/// ```
///
/// Source: the paper, eq. 2.
pub fn surrogate_unclipped<T: Real>(ratio: T, advantage: T) -> T {
    ratio * advantage
}

/// The clipped objective of one sample.
///
/// ```text
/// L_CLIP = min(r A, clip(r, 1 - epsilon, 1 + epsilon) A)
/// ```
///
/// epsilon -> `clip_epsilon`.
///
/// Source: the paper, eq. 3.
pub fn surrogate_clipped<T: Real>(ratio: T, advantage: T, clip_epsilon: T) -> T {
    (ratio * advantage).min(clipped(ratio, clip_epsilon) * advantage)
}

/// `clip(r, 1 - epsilon, 1 + epsilon)`.
fn clipped<T: Real>(ratio: T, clip_epsilon: T) -> T {
    ratio.max(T::ONE - clip_epsilon).min(T::ONE + clip_epsilon)
}

/// Derivative of the policy loss, minus the objective, by the ratio.
///
/// ```text
/// -A,  or 0 where the clipped objective is the constant (1 +- epsilon) A
/// ```
///
/// Source: derivative of the paper's eq. 2 and 3.
pub fn d_loss_d_ratio<T: Real>(ratio: T, advantage: T, clip_epsilon: T, objective: Objective) -> T {
    let held = objective == Objective::Clipped && clipped(ratio, clip_epsilon) * advantage < ratio * advantage;
    if held { T::ZERO } else { -advantage }
}

/// The critic's loss of one sample.
///
/// ```text
/// L_V = 1/2 (V - R)^2
/// ```
///
/// V -> `value`, R -> `target`, the return.
///
/// Source: Schulman et al. 2017, section 5, with a factor 1/2 that makes the derivative the error itself.
pub fn value_loss<T: Real>(value: T, target: T) -> T {
    T::from_f64(0.5) * (value - target) * (value - target)
}

/// Derivative of [`value_loss`] by the value.
///
/// ```text
/// V - R
/// ```
///
/// Source: derivative of Schulman et al. 2017, section 5.
pub fn d_loss_d_value<T: Real>(value: T, target: T) -> T {
    value - target
}

/// One sample's estimate of the KL divergence of the new policy from the one that sampled it; never negative.
///
/// ```text
/// k3 = (r - 1) - ln r
/// ```
///
/// Source: Schulman 2020, "Approximating KL Divergence" (k3).
pub fn approx_kl<T: Real>(ratio: T, log_ratio: T) -> T {
    (ratio - T::ONE) - log_ratio
}

/// Samples as the losses need them, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a, T> {
    /// Normalised observations, `(B x O)`.
    pub observations: &'a [T],
    /// Sampled actions, not clamped, `(B x A)`.
    pub actions: &'a [T],
    /// Log-probabilities of the actions when they were sampled, `(B)`.
    pub old_log_probs: &'a [T],
    /// Advantages, normalised if the settings say so, `(B)`.
    pub advantages: &'a [T],
    /// Targets of the critic, `(B)`.
    pub returns: &'a [T],
}

/// Sums over samples, for the metrics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossSums {
    /// Number of samples.
    pub num_samples: usize,
    /// Minus the objective.
    pub policy_loss: f64,
    /// [`value_loss`].
    pub value_loss: f64,
    /// The policy's entropy, counted once per sample `[nats]`.
    pub entropy: f64,
    /// [`approx_kl`].
    pub approx_kl: f64,
    /// Samples whose ratio lies outside 1 +- epsilon.
    pub num_clipped: usize,
}

impl LossSums {
    /// Adds other samples' sums.
    pub fn add(&mut self, other: &Self) {
        self.num_samples += other.num_samples;
        self.policy_loss += other.policy_loss;
        self.value_loss += other.value_loss;
        self.entropy += other.entropy;
        self.approx_kl += other.approx_kl;
        self.num_clipped += other.num_clipped;
    }

    /// Bytes of what `write` appends.
    pub(crate) const NUM_BYTES: usize = 6 * 8;

    /// Appends the sums, for other ranks.
    pub(crate) fn write(&self, message: &mut Message) {
        message.push_u64(self.num_samples as u64);
        message.push_f64s(&[self.policy_loss, self.value_loss, self.entropy, self.approx_kl]);
        message.push_u64(self.num_clipped as u64);
    }

    /// The sums that another rank wrote.
    pub(crate) fn read(received: &mut Received<'_>) -> Self {
        let num_samples = received.u64() as usize;
        let mut sums = [0.0; 4];
        received.f64s(&mut sums);
        let [policy_loss, value_loss, entropy, approx_kl] = sums;
        let num_clipped = received.u64() as usize;
        Self { num_samples, policy_loss, value_loss, entropy, approx_kl, num_clipped }
    }

    /// The complete loss, still a sum.
    pub fn total(&self, settings: &PpoSettings) -> f64 {
        self.policy_loss + settings.value_coefficient * self.value_loss - settings.entropy_coefficient * self.entropy
    }
}

/// Everything that [`loss_and_gradient`] writes: the gradient, and what it needs on the way.
#[derive(Clone, Debug)]
pub struct LossWorkspace<T> {
    /// Gradient of the loss, summed over the samples, by the flat parameters.
    pub d_loss_d_parameters: Vec<T>,
    actor: Activations<T>,
    critic: Activations<T>,
    gaussian: DiagonalGaussian<T>,
}

impl<T: Real> LossWorkspace<T> {
    /// Room for up to `max_rows` samples at once.
    pub fn new(model: &ActorCritic, max_rows: usize) -> Self {
        Self {
            d_loss_d_parameters: vec![T::ZERO; model.num_parameters()],
            actor: Activations::new(model.actor, max_rows),
            critic: Activations::new(model.critic, max_rows),
            gaussian: DiagonalGaussian::new(&vec![T::ZERO; model.num_actions()]),
        }
    }
}

/// The complete loss of these samples and its gradient, both as sums; the gradient is left in the workspace.
///
/// # Shapes
/// - `parameters`: flat, [`ActorCritic::num_parameters`]
///
/// # Panics
/// If the parameters do not fit the model, or the workspace has less room than B rows.
pub fn loss_and_gradient<T: Real>(
    model: &ActorCritic,
    parameters: &[T],
    samples: &Samples<'_, T>,
    settings: &PpoSettings,
    workspace: &mut LossWorkspace<T>,
) -> LossSums {
    let parts = model.split(parameters);
    workspace.d_loss_d_parameters.fill(T::ZERO);
    let gradient = model.split_gradient(&mut workspace.d_loss_d_parameters);
    let num_samples = samples.returns.len();
    let mut sums = LossSums { num_samples, ..LossSums::default() };

    let actor = model.batched_actor();
    let gaussian = &mut workspace.gaussian;
    gaussian.set_log_std(parts.log_std);
    actor.forward(parts.actor, samples.observations, &mut workspace.actor);
    let (means, d_loss_d_means) = workspace.actor.output_and_gradient(num_samples);
    policy_terms(samples, means, (settings, gaussian), (d_loss_d_means, gradient.log_std), &mut sums);
    actor.backward(parts.actor, samples.observations, &mut workspace.actor, gradient.actor);

    let critic = model.batched_critic();
    critic.forward(parts.critic, samples.observations, &mut workspace.critic);
    let (values, d_loss_d_values) = workspace.critic.output_and_gradient(num_samples);
    let value_coefficient = T::from_f64(settings.value_coefficient);
    for ((&value, &target), d_loss) in values.iter().zip(samples.returns).zip(d_loss_d_values) {
        sums.value_loss += value_loss(value, target).to_f64();
        *d_loss = value_coefficient * d_loss_d_value(value, target);
    }
    critic.backward(parts.critic, samples.observations, &mut workspace.critic, gradient.critic);
    sums
}

/// The policy's terms, row by row: writes the gradient by the means, adds the one by log_std and the sums.
fn policy_terms<T: Real>(
    samples: &Samples<'_, T>,
    means: &[T],
    (settings, gaussian): (&PpoSettings, &DiagonalGaussian<T>),
    (d_loss_d_means, d_loss_d_log_std): (&mut [T], &mut [T]),
    sums: &mut LossSums,
) {
    let num_actions = d_loss_d_log_std.len();
    let clip_epsilon = T::from_f64(settings.clip_epsilon);
    let rows = samples.actions.chunks_exact(num_actions).zip(means.chunks_exact(num_actions));
    for (i, (sample, d_loss_d_mean)) in rows.zip(d_loss_d_means.chunks_exact_mut(num_actions)).enumerate() {
        let log_prob = gaussian.log_prob(sample.0, sample.1);
        let (old_log_prob, advantage) = (samples.old_log_probs[i], samples.advantages[i]);
        let ratio = ratio(log_prob, old_log_prob);
        let surrogate = match settings.objective {
            Objective::Clipped => surrogate_clipped(ratio, advantage, clip_epsilon),
            Objective::Unclipped => surrogate_unclipped(ratio, advantage),
        };
        let d_loss_d_log_prob = d_loss_d_ratio(ratio, advantage, clip_epsilon, settings.objective) * ratio;
        gaussian.d_loss_d_mean_and_log_std(sample, d_loss_d_log_prob, d_loss_d_mean, d_loss_d_log_std);
        sums.policy_loss += (-surrogate).to_f64();
        sums.approx_kl += approx_kl(ratio, log_prob - old_log_prob).to_f64();
        sums.num_clipped += usize::from(clipped(ratio, clip_epsilon) != ratio);
    }
    // The entropy does not depend on the sample: every row adds the same.
    let num_samples = sums.num_samples as f64;
    sums.entropy += num_samples * gaussian.entropy().to_f64();
    for d_loss in d_loss_d_log_std {
        *d_loss += T::from_f64(-settings.entropy_coefficient * num_samples);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratio_and_kl_agree_with_numbers_computed_by_hand() {
        // exp(-1 - -1.5) = 1.64872127; k3 = 0.64872127 - 0.5
        let r = ratio(-1.0_f64, -1.5);
        assert!((r - 1.648_721_27).abs() < 1e-8);
        assert!((approx_kl(r, 0.5) - 0.148_721_27).abs() < 1e-8);
        assert_eq!(approx_kl(1.0, 0.0), 0.0);
    }

    #[test]
    fn surrogates_agree_with_numbers_computed_by_hand() {
        assert_eq!(surrogate_unclipped(1.5, -2.0), -3.0);
        // (ratio, advantage, objective, derivative of minus the objective) with epsilon 1/4
        let cases = [
            (1.5, 2.0, 2.5, 0.0),     // gain beyond the clip: held at 1.25 * 2
            (1.5, -2.0, -3.0, 2.0),   // worse than before: counts in full
            (0.5, 2.0, 1.0, -2.0),    // worse than before: counts in full
            (0.5, -2.0, -1.5, 0.0),   // gain beyond the clip: held at 0.75 * -2
            (1.125, 2.0, 2.25, -2.0), // inside
            (1.0, -2.0, -2.0, 2.0),   // the first minibatch
        ];
        for (ratio, advantage, objective, derivative) in cases {
            assert_eq!(surrogate_clipped(ratio, advantage, 0.25), objective, "{ratio} {advantage}");
            assert_eq!(d_loss_d_ratio(ratio, advantage, 0.25, Objective::Clipped), derivative, "{ratio} {advantage}");
            assert_eq!(d_loss_d_ratio(ratio, advantage, 0.25, Objective::Unclipped), -advantage);
        }
    }

    #[test]
    fn value_loss_agrees_with_a_number_computed_by_hand() {
        assert_eq!(value_loss(3.0, 1.0), 2.0);
        assert_eq!(d_loss_d_value(3.0, 1.0), 2.0);
    }
}
