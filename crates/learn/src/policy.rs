//! Actor, spread and critic in one flat parameter vector, and its first values.

use crate::network::{BatchedNetwork, OutputActivation};
use crate::random::{Purpose, stream};
use canter_gait::network::{LayerSpan, NetworkShape};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::Range;

/// Gain of the hidden layers' first weights: tanh then neither saturates nor fades from layer to layer. Source:
/// cleanrl.
const HIDDEN_GAIN: f64 = std::f64::consts::SQRT_2;

/// Gain of the actor's last layer: the first policy hardly departs from action 0, the gait as it is.
/// Source: Andrychowicz et al. 2021, section 3.2 (smaller last policy layer).
const ACTOR_OUTPUT_GAIN: f64 = 0.01;

/// Gain of the critic's last layer. Source: cleanrl.
const CRITIC_OUTPUT_GAIN: f64 = 1.0;

/// The sizes of everything that is learned.
///
/// The parameters lie in one flat vector: `[actor's parameters | log_std (A) | critic's parameters]`, each network as
/// [`NetworkShape`] says. The actor's output has a tanh, the critic's single output has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActorCritic {
    /// Observation to mean of the action.
    pub actor: NetworkShape,
    /// Observation to value; its output is 1.
    pub critic: NetworkShape,
}

/// The three parts of a flat parameter vector.
#[derive(Clone, Copy, Debug)]
pub struct ParameterParts<'a, T> {
    /// The actor network's parameters.
    pub actor: &'a [T],
    /// Natural logarithms of the standard deviations, `(A)`.
    pub log_std: &'a [T],
    /// The critic network's parameters.
    pub critic: &'a [T],
}

/// The three parts of a flat vector of gradients by the parameters.
#[derive(Debug)]
pub struct GradientParts<'a, T> {
    /// Gradient by the actor network's parameters.
    pub actor: &'a mut [T],
    /// Gradient by the logarithms of the standard deviations, `(A)`.
    pub log_std: &'a mut [T],
    /// Gradient by the critic network's parameters.
    pub critic: &'a mut [T],
}

impl ActorCritic {
    /// Actor and critic for O observations and A actions, each with its own hidden width.
    pub fn new(num_observations: usize, num_actions: usize, actor_hidden: usize, critic_hidden: usize) -> Self {
        Self {
            actor: NetworkShape { input: num_observations, hidden: actor_hidden, output: num_actions },
            critic: NetworkShape { input: num_observations, hidden: critic_hidden, output: 1 },
        }
    }

    /// Length of an observation, O.
    pub fn num_observations(&self) -> usize {
        self.actor.input
    }

    /// Length of an action, A.
    pub fn num_actions(&self) -> usize {
        self.actor.output
    }

    /// Length of the flat parameter vector.
    pub fn num_parameters(&self) -> usize {
        self.critic_range().end
    }

    /// Where the actor's parameters lie.
    pub fn actor_range(&self) -> Range<usize> {
        0..self.actor.num_parameters()
    }

    /// Where the logarithms of the standard deviations lie.
    pub fn log_std_range(&self) -> Range<usize> {
        let start = self.actor.num_parameters();
        start..start + self.actor.output
    }

    /// Where the critic's parameters lie.
    pub fn critic_range(&self) -> Range<usize> {
        let start = self.log_std_range().end;
        start..start + self.critic.num_parameters()
    }

    /// The actor over many rows.
    pub fn batched_actor(&self) -> BatchedNetwork {
        BatchedNetwork { shape: self.actor, output_activation: OutputActivation::Tanh }
    }

    /// The critic over many rows.
    pub fn batched_critic(&self) -> BatchedNetwork {
        BatchedNetwork { shape: self.critic, output_activation: OutputActivation::Linear }
    }

    /// The parts of a flat parameter vector.
    ///
    /// # Panics
    /// If the length is not [`num_parameters`](Self::num_parameters).
    pub fn split<'a, T>(&self, parameters: &'a [T]) -> ParameterParts<'a, T> {
        assert_eq!(parameters.len(), self.num_parameters(), "length of the parameter vector");
        ParameterParts {
            actor: &parameters[self.actor_range()],
            log_std: &parameters[self.log_std_range()],
            critic: &parameters[self.critic_range()],
        }
    }

    /// The parts of a flat vector of gradients.
    ///
    /// # Panics
    /// If the length is not [`num_parameters`](Self::num_parameters).
    pub fn split_gradient<'a, T>(&self, gradient: &'a mut [T]) -> GradientParts<'a, T> {
        assert_eq!(gradient.len(), self.num_parameters(), "length of the gradient");
        let (actor, rest) = gradient.split_at_mut(self.actor.num_parameters());
        let (log_std, critic) = rest.split_at_mut(self.actor.output);
        GradientParts { actor, log_std, critic }
    }

    /// First parameters: orthogonal weights, biases 0, every log_std `initial_log_std`.
    pub fn initial_parameters(&self, seed: u64, initial_log_std: f64) -> Vec<f32> {
        let mut parameters = vec![0.0; self.num_parameters()];
        let parts = self.split_gradient(&mut parameters);
        parts.log_std.fill(initial_log_std as f32);
        for (index, (shape, network, output_gain)) in
            [(self.actor, parts.actor, ACTOR_OUTPUT_GAIN), (self.critic, parts.critic, CRITIC_OUTPUT_GAIN)]
                .into_iter()
                .enumerate()
        {
            let mut rng = stream(seed, Purpose::NetworkInit, index as u64, 0);
            for (layer, gain) in shape.layers().into_iter().zip([HIDDEN_GAIN, HIDDEN_GAIN, output_gain]) {
                fill_orthogonal(layer, gain, &mut rng, network);
            }
        }
        parameters
    }
}

/// Writes a layer's weights: `gain` times a random matrix whose rows or columns, whichever are fewer, are orthonormal.
///
/// ```text
/// W = gain Q,  Q' Q = I  (or Q Q' = I)
/// ```
///
/// Source: Saxe, McClelland and Ganguli 2014; here by Gram-Schmidt on Gaussian vectors, each twice for rounding.
fn fill_orthogonal(layer: LayerSpan, gain: f64, rng: &mut ChaCha8Rng, parameters: &mut [f32]) {
    let (count, length) = (layer.inputs.min(layer.outputs), layer.inputs.max(layer.outputs));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    for _ in 0..count {
        let mut vector: Vec<f64> = (0..length).map(|_| StandardNormal.sample(rng)).collect();
        for other in basis.iter().chain(&basis) {
            let projection = dot(&vector, other);
            vector.iter_mut().zip(other).for_each(|(v, o)| *v -= projection * o);
        }
        let norm = dot(&vector, &vector).sqrt();
        vector.iter_mut().for_each(|v| *v /= norm);
        basis.push(vector);
    }
    for i in 0..layer.inputs {
        for o in 0..layer.outputs {
            let value = if layer.outputs <= layer.inputs { basis[o][i] } else { basis[i][o] };
            parameters[layer.weights + i * layer.outputs + o] = (gain * value) as f32;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_follow_each_other_and_cover_everything() {
        let model = ActorCritic::new(3, 2, 4, 5);
        // actor 3*4+4 + 4*4+4 + 4*2+2 = 46, critic 3*5+5 + 5*5+5 + 5+1 = 56
        assert_eq!((model.actor_range(), model.log_std_range(), model.critic_range()), (0..46, 46..48, 48..104));
        let parameters: Vec<usize> = (0..104).collect();
        let parts = model.split(&parameters);
        assert_eq!((parts.actor.len(), parts.log_std, parts.critic[0]), (46, &[46, 47][..], 48));
    }

    #[test]
    fn first_weights_are_orthogonal_with_their_gain() {
        let model = ActorCritic::new(5, 2, 16, 8);
        let parameters = model.initial_parameters(3, -0.5);
        let parts = model.split(&parameters);
        assert_eq!(parts.log_std, [-0.5, -0.5]);
        let gains = [(model.actor, parts.actor, ACTOR_OUTPUT_GAIN), (model.critic, parts.critic, CRITIC_OUTPUT_GAIN)];
        for (shape, network, output_gain) in gains {
            for (layer, gain) in shape.layers().into_iter().zip([HIDDEN_GAIN, HIDDEN_GAIN, output_gain]) {
                let weight = |i: usize, o: usize| f64::from(network[layer.weights + i * layer.outputs + o]) / gain;
                let by_output = layer.outputs <= layer.inputs;
                let (count, length) = (layer.inputs.min(layer.outputs), layer.inputs.max(layer.outputs));
                for a in 0..count {
                    for b in 0..count {
                        let product: f64 = (0..length)
                            .map(|k| if by_output { weight(k, a) * weight(k, b) } else { weight(a, k) * weight(b, k) })
                            .sum();
                        let expected = if a == b { 1.0 } else { 0.0 };
                        assert!((product - expected).abs() < 1e-6, "{layer:?}: {a}, {b}: {product}");
                    }
                }
                assert!(network[layer.biases..layer.biases + layer.outputs].iter().all(|&bias| bias == 0.0));
            }
        }
    }

    #[test]
    fn another_seed_gives_other_weights_and_the_same_seed_the_same() {
        let model = ActorCritic::new(3, 2, 4, 4);
        assert_eq!(model.initial_parameters(1, 0.0), model.initial_parameters(1, 0.0));
        assert_ne!(model.initial_parameters(1, 0.0), model.initial_parameters(2, 0.0));
    }
}
