//! The one hyperbolic tangent of the project: the simulator, the learner and the robot all call it.

/// tanh(x), to within 4e-7 of the exact value, for every finite x.
///
/// A rational function of x, odd by construction, without a branch, so that a loop over it
/// vectorises. Every target computes it with the same operations in the same order.
///
/// ```text
/// tanh(x) = x P(x^2) / Q(x^2),   x clamped to [-9, 9], result clamped to [-1, 1]
/// ```
///
/// Source: minimax fit of ours, `tests/golden/tanh.py`.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    let x = x.clamp(-SATURATION, SATURATION);
    let s = x * x;
    let [p0, p1, p2, p3, p4] = NUMERATOR;
    let [q1, q2, q3, q4] = DENOMINATOR;
    let numerator = (((p4 * s + p3) * s + p2) * s + p1) * s + p0;
    let denominator = (((q4 * s + q3) * s + q2) * s + q1) * s + 1.0;
    (x * numerator / denominator).clamp(-1.0, 1.0)
}

/// Beyond this argument tanh differs from 1 by less than half a unit in the last place of `f32`.
pub const SATURATION: f32 = 9.0;

/// Coefficients of P, constant first. Source: `tests/golden/tanh.py`.
pub const NUMERATOR: [f32; 5] = [0.999_999_9, 0.133_731_83, 3.486_562_7e-3, 2.047_148e-5, 1.318_368_8e-8];

/// Coefficients of Q after its leading 1. Source: `tests/golden/tanh.py`.
pub const DENOMINATOR: [f32; 4] = [0.467_064_8, 2.584_190_9e-2, 3.271_352_3e-4, 7.702_453e-7];

#[cfg(test)]
mod tests {
    use super::tanh;

    #[test]
    fn stays_within_its_error_bound() {
        for i in -120_000..=120_000 {
            let x = i as f32 * 1e-4;
            let error = f64::from(tanh(x)) - libm::tanh(f64::from(x));
            assert!(error.abs() < 4e-7, "tanh({x}) is off by {error}");
        }
    }

    #[test]
    fn is_odd_bounded_and_saturates() {
        for x in [0.0, 1e-20, 0.3, 2.0, 8.9, 9.1, 1e30, f32::INFINITY] {
            assert_eq!(tanh(-x), -tanh(x));
            assert!(tanh(x).abs() <= 1.0);
        }
        assert_eq!(tanh(0.0), 0.0);
        assert!(tanh(20.0) > 1.0 - 1e-6);
    }
}
