//! The policy's distribution: a Gaussian with independent components.

use crate::real::Real;
use std::f64::consts::{E, TAU};

/// The spread of a Gaussian with independent components; it does not depend on the observation.
#[derive(Clone, Debug, Default)]
pub struct DiagonalGaussian<T> {
    log_std: Vec<T>,
    std: Vec<T>,
    inverse_std: Vec<T>,
    /// `-sum_j log_std_j - A/2 ln(2 pi)`, the part of [`log_prob`](Self::log_prob) that no sample changes.
    log_normaliser: T,
}

impl<T: Real> DiagonalGaussian<T> {
    /// A Gaussian of these natural logarithms of the standard deviations.
    ///
    /// # Shapes
    /// - `log_std`: `(A)`
    pub fn new(log_std: &[T]) -> Self {
        let mut gaussian = Self::default();
        gaussian.set_log_std(log_std);
        gaussian
    }

    /// Replaces the standard deviations without allocating, if their number stays the same.
    ///
    /// # Shapes
    /// - `log_std`: `(A)`
    pub fn set_log_std(&mut self, log_std: &[T]) {
        self.log_std.clear();
        self.log_std.extend_from_slice(log_std);
        self.std.clear();
        self.std.extend(log_std.iter().map(|&value| value.exp()));
        self.inverse_std.clear();
        self.inverse_std.extend(log_std.iter().map(|&value| (-value).exp()));
        self.log_normaliser = T::from_f64(-0.5 * log_std.len() as f64 * TAU.ln());
        for &value in log_std {
            self.log_normaliser += -value;
        }
    }

    /// Standard deviations.
    ///
    /// # Shapes
    /// - returns `(A)`
    pub fn std(&self) -> &[T] {
        &self.std
    }

    /// Natural logarithm of the probability density of `action`.
    ///
    /// ```text
    /// ln p(a) = sum_j [ -1/2 ((a_j - mean_j) / std_j)^2 - ln std_j - 1/2 ln(2 pi) ]
    /// ```
    ///
    /// # Shapes
    /// - `action`: `(A)`, the sample as it was drawn, before any clamp
    /// - `mean`: `(A)`
    ///
    /// Source: Bishop 2006, eq. 2.43, with a diagonal covariance.
    #[inline]
    pub fn log_prob(&self, action: &[T], mean: &[T]) -> T {
        let mut half_squares = T::ZERO;
        for ((&a, &m), &inverse_std) in action.iter().zip(mean).zip(&self.inverse_std) {
            let deviation = (a - m) * inverse_std;
            half_squares += T::from_f64(0.5) * deviation * deviation;
        }
        self.log_normaliser - half_squares
    }

    /// Adds `d_loss_d_log_prob` times the derivatives of [`log_prob`](Self::log_prob) by the mean and by the log_std.
    ///
    /// ```text
    /// d ln p / d mean_j = (a_j - mean_j) / std_j^2,   d ln p / d log_std_j = ((a_j - mean_j) / std_j)^2 - 1
    /// ```
    ///
    /// # Shapes
    /// - `sample`: the action `(A)` and the mean `(A)`
    /// - `d_loss_d_mean`: `(A)`, overwritten
    /// - `d_loss_d_log_std`: `(A)`, added to
    ///
    /// Source: derived from the density above.
    #[inline]
    pub fn d_loss_d_mean_and_log_std(
        &self,
        (action, mean): (&[T], &[T]),
        d_loss_d_log_prob: T,
        d_loss_d_mean: &mut [T],
        d_loss_d_log_std: &mut [T],
    ) {
        for (j, (&a, &m)) in action.iter().zip(mean).enumerate() {
            let deviation = (a - m) * self.inverse_std[j];
            d_loss_d_mean[j] = d_loss_d_log_prob * deviation * self.inverse_std[j];
            d_loss_d_log_std[j] += d_loss_d_log_prob * (deviation * deviation - T::ONE);
        }
    }

    /// Entropy in nats; its derivative by each log_std is 1.
    ///
    /// ```text
    /// H = sum_j [ log_std_j + 1/2 ln(2 pi e) ]
    /// ```
    ///
    /// Source: Cover and Thomas 2006, theorem 8.4.1, with a diagonal covariance.
    pub fn entropy(&self) -> T {
        let mut entropy = T::from_f64(0.5 * self.log_std.len() as f64 * (TAU * E).ln());
        for &log_std in &self.log_std {
            entropy += log_std;
        }
        entropy
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_prob_and_entropy_agree_with_numbers_computed_by_hand() {
        let gaussian = DiagonalGaussian::new(&[0.0, 2.0_f64.ln()]);
        assert!((gaussian.std()[1] - 2.0).abs() < 1e-15);
        // -1/2 (1)^2 - 1/2 (1.5)^2 - ln 2 - ln(2 pi) = -0.5 - 1.125 - 0.69314718 - 1.83787707
        assert!((gaussian.log_prob(&[1.0, 2.0], &[0.0, -1.0]) + 4.156_024_25).abs() < 1e-8);
        // ln 2 + ln(2 pi e) = 0.69314718 + 2.83787707
        assert!((gaussian.entropy() - 3.531_024_25).abs() < 1e-8);
    }

    #[test]
    fn derivatives_agree_with_numbers_computed_by_hand() {
        let gaussian = DiagonalGaussian::new(&[2.0_f64.ln()]);
        let (mut d_mean, mut d_log_std) = ([9.0], [1.0]);
        gaussian.d_loss_d_mean_and_log_std((&[2.0], &[-1.0]), 2.0, &mut d_mean, &mut d_log_std);
        // 2 * 3/4 = 1.5;  1 + 2 * (1.5^2 - 1) = 3.5
        assert!((d_mean[0] - 1.5).abs() < 1e-12 && (d_log_std[0] - 3.5).abs() < 1e-12, "{d_mean:?} {d_log_std:?}");
    }
}
