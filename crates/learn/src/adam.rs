//! The optimiser.

use crate::simd::vectorised;

/// Decay of the first moment. Source: Kingma and Ba 2015, algorithm 1; larger forgets more slowly.
const BETA_1: f64 = 0.9;

/// Decay of the second moment. Source: Kingma and Ba 2015, algorithm 1; larger forgets more slowly.
const BETA_2: f64 = 0.999;

/// Keeps a parameter without gradient from dividing by zero. Source: Kingma and Ba 2015, algorithm 1.
const EPSILON: f64 = 1e-8;

/// Adam's state: with the parameters, all that a checkpoint of the learner needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Step size; it lives here because a target KL changes it from update to update.
    pub learning_rate: f64,
    /// Gradient steps taken.
    pub num_gradient_steps: u64,
    /// Decaying mean of the gradients, one per parameter.
    pub first_moment: Vec<f32>,
    /// Decaying mean of the squared gradients, one per parameter.
    pub second_moment: Vec<f32>,
}

impl Adam {
    /// No steps taken.
    pub fn new(num_parameters: usize, learning_rate: f64) -> Self {
        Self {
            learning_rate,
            num_gradient_steps: 0,
            first_moment: vec![0.0; num_parameters],
            second_moment: vec![0.0; num_parameters],
        }
    }

    /// One gradient step.
    ///
    /// ```text
    /// m = beta1 m + (1 - beta1) g,   v = beta2 v + (1 - beta2) g^2,
    /// parameter -= lr (m / (1 - beta1^t)) / (sqrt(v / (1 - beta2^t)) + epsilon)
    /// ```
    ///
    /// lr -> `learning_rate`, t -> `num_gradient_steps` after this step.
    ///
    /// # Panics
    /// If the lengths differ.
    ///
    /// Source: Kingma and Ba 2015, algorithm 1.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32]) {
        assert_eq!(parameters.len(), self.first_moment.len(), "parameters of Adam's state");
        assert_eq!(gradient.len(), self.first_moment.len(), "gradient of Adam's state");
        self.num_gradient_steps += 1;
        // Both powers are 0 in double precision long before the exponent saturates.
        let t = i32::try_from(self.num_gradient_steps).unwrap_or(i32::MAX);
        let factors = Factors {
            step: (self.learning_rate / (1.0 - BETA_1.powi(t))) as f32,
            inverse_second_correction: (1.0 / (1.0 - BETA_2.powi(t))) as f32,
        };
        apply(parameters, gradient, &mut self.first_moment, &mut self.second_moment, factors);
    }
}

/// What is the same for all parameters of one step.
#[derive(Clone, Copy)]
struct Factors {
    /// lr / (1 - beta1^t)
    step: f32,
    /// 1 / (1 - beta2^t)
    inverse_second_correction: f32,
}

vectorised! {
    fn apply(
        parameters: &mut [f32],
        gradient: &[f32],
        first_moment: &mut [f32],
        second_moment: &mut [f32],
        factors: Factors,
    ) {
        let moments = first_moment.iter_mut().zip(second_moment);
        for ((parameter, &g), (m, v)) in parameters.iter_mut().zip(gradient).zip(moments) {
            *m = BETA_1 as f32 * *m + (1.0 - BETA_1) as f32 * g;
            *v = BETA_2 as f32 * *v + (1.0 - BETA_2) as f32 * g * g;
            *parameter -= factors.step * *m / ((*v * factors.inverse_second_correction).sqrt() + EPSILON as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_agree_with_numbers_computed_by_hand() {
        let mut adam = Adam::new(2, 0.1);
        let mut parameters = [1.0, -1.0];
        adam.step(&mut parameters, &[2.0, -0.5]);
        // The first step is lr * sign(g): m / (1 - beta1) = g, v / (1 - beta2) = g^2.
        assert!((parameters[0] - 0.9).abs() < 1e-6 && (parameters[1] + 0.9).abs() < 1e-6, "{parameters:?}");
        adam.step(&mut parameters, &[1.0, -0.5]);
        // m = 0.9 * 0.2 + 0.1 = 0.28, / 0.19 = 1.47368421; v = 0.999 * 0.004 + 0.001 = 0.004996, / 0.001999 =
        // 2.49924962
        // 0.9 - 0.1 * 1.47368421 / 1.58090152 = 0.80678203
        assert!((parameters[0] - 0.806_782).abs() < 1e-6 && (parameters[1] + 0.8).abs() < 1e-6, "{parameters:?}");
        assert_eq!(adam.num_gradient_steps, 2);
    }

    #[test]
    fn a_parameter_without_gradient_stays() {
        let mut adam = Adam::new(1, 0.1);
        let mut parameters = [0.25];
        adam.step(&mut parameters, &[0.0]);
        assert_eq!(parameters, [0.25]);
    }
}
