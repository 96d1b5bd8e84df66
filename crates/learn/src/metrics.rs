//! What an update reports.

use crate::advantage::mean_and_variance;
use crate::loss::LossSums;

/// What an update did. Losses, `approx_kl` and `clip_fraction` are means over all its gradient steps, each measured
/// before its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateMetrics {
    /// Minus the surrogate objective.
    pub policy_loss: f64,
    /// [`value_loss`](crate::loss::value_loss), before its coefficient.
    pub value_loss: f64,
    /// The policy's entropy `[nats]`.
    pub entropy: f64,
    /// [`approx_kl`](crate::loss::approx_kl) of the policy from the one that collected `[nats]`.
    pub approx_kl: f64,
    /// Share of the samples whose ratio lies outside 1 +- `clip_epsilon`.
    pub clip_fraction: f64,
    /// [`explained_variance`] of the returns by the values before the update; none if the returns are all equal.
    pub explained_variance: Option<f64>,
    /// Euclidean norm of the gradient before its limit, mean over the gradient steps.
    pub gradient_norm: f64,
    /// Learning rate after the update.
    pub learning_rate: f64,
}

/// Share of the returns' variance that the values explain; none if the returns are all equal.
///
/// ```text
/// 1 - Var(R - V) / Var(R)
/// ```
///
/// Source: the coefficient of determination without its bias term, as PPO implementations log it.
pub fn explained_variance(values: &[f32], returns: &[f32]) -> Option<f64> {
    let (_, variance) = mean_and_variance(returns.iter().map(|&r| f64::from(r)));
    let errors = returns.iter().zip(values).map(|(&r, &v)| f64::from(r) - f64::from(v));
    let (_, error_variance) = mean_and_variance(errors);
    (variance > 0.0).then(|| 1.0 - error_variance / variance)
}

/// Sums over the gradient steps of an update.
#[derive(Debug, Default)]
pub(crate) struct MetricTotals {
    pub(crate) num_gradient_steps: usize,
    losses: LossSums,
    gradient_norm: f64,
}

impl MetricTotals {
    pub(crate) fn add(&mut self, sums: &LossSums, gradient_norm: f64) {
        self.num_gradient_steps += 1;
        self.losses.add(sums);
        self.gradient_norm += gradient_norm;
    }

    pub(crate) fn metrics(&self, explained_variance: Option<f64>, learning_rate: f64) -> UpdateMetrics {
        let num_samples = self.losses.num_samples as f64;
        UpdateMetrics {
            policy_loss: self.losses.policy_loss / num_samples,
            value_loss: self.losses.value_loss / num_samples,
            entropy: self.losses.entropy / num_samples,
            approx_kl: self.losses.approx_kl / num_samples,
            clip_fraction: self.losses.num_clipped as f64 / num_samples,
            explained_variance,
            gradient_norm: self.gradient_norm / self.num_gradient_steps as f64,
            learning_rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn explained_variance_agrees_with_numbers_computed_by_hand() {
        // Var(R) = 2/3; errors 0, 0, 1 have variance 2/9
        assert!((explained_variance(&[1.0, 2.0, 2.0], &[1.0, 2.0, 3.0]).unwrap() - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(explained_variance(&[1.0, 2.0], &[5.0, 5.0]), None);
    }
}
