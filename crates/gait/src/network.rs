//! The policy network: three fully connected layers with tanh, one flat parameter buffer.
//!
//! The learner trains the same buffer in the same layout, so nothing is converted on the way to the robot.

use crate::tanh::tanh;

/// Outputs of a layer that are accumulated together: eight 8-lane registers hide the latency of the adds.
const WIDE: usize = 64;
/// The narrower block that serves what [`WIDE`] leaves over.
const NARROW: usize = 16;

/// Sizes of a network of three fully connected layers, `input -> hidden -> hidden -> output`.
///
/// The parameters lie in one flat buffer: for each layer its weights, `(inputs x outputs)` with the
/// outputs of one input next to each other, then its biases, `(outputs)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkShape {
    /// Number of inputs, O.
    pub input: usize,
    /// Width of both hidden layers, H.
    pub hidden: usize,
    /// Number of outputs, A.
    pub output: usize,
}

/// One layer's place in the flat parameter buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerSpan {
    /// Number of inputs of the layer.
    pub inputs: usize,
    /// Number of outputs of the layer.
    pub outputs: usize,
    /// Where its `(inputs x outputs)` weights begin.
    pub weights: usize,
    /// Where its `(outputs)` biases begin.
    pub biases: usize,
}

impl NetworkShape {
    /// The three layers' places in the flat buffer, in the order in which they are applied.
    pub const fn layers(&self) -> [LayerSpan; 3] {
        let first =
            LayerSpan { inputs: self.input, outputs: self.hidden, weights: 0, biases: self.input * self.hidden };
        let second_start = first.biases + first.outputs;
        let second = LayerSpan {
            inputs: self.hidden,
            outputs: self.hidden,
            weights: second_start,
            biases: second_start + self.hidden * self.hidden,
        };
        let third_start = second.biases + second.outputs;
        let third = LayerSpan {
            inputs: self.hidden,
            outputs: self.output,
            weights: third_start,
            biases: third_start + self.hidden * self.output,
        };
        [first, second, third]
    }

    /// Length of the flat parameter buffer.
    pub const fn num_parameters(&self) -> usize {
        let last = self.layers()[2];
        last.biases + last.outputs
    }
}

/// A network with borrowed parameters.
#[derive(Clone, Copy, Debug)]
pub struct Network<'a> {
    shape: NetworkShape,
    parameters: &'a [f32],
}

impl<'a> Network<'a> {
    /// Views `parameters` as a network of this shape; `None` unless the buffer's length is the shape's.
    pub fn new(shape: NetworkShape, parameters: &'a [f32]) -> Option<Self> {
        (parameters.len() == shape.num_parameters()).then_some(Self { shape, parameters })
    }

    /// The network's sizes.
    pub fn shape(&self) -> NetworkShape {
        self.shape
    }

    /// The flat buffer that it borrows, see [`NetworkShape`].
    pub fn parameters(&self) -> &'a [f32] {
        self.parameters
    }

    /// Length of the workspace that [`forward`](Self::forward) needs, `2 H`.
    pub fn workspace_len(&self) -> usize {
        2 * self.shape.hidden
    }

    /// Writes the action's mean, each component in [-1, 1].
    ///
    /// ```text
    /// h1 = tanh(W1' x + b1),  h2 = tanh(W2' h1 + b2),  mean = tanh(W3' h2 + b3)
    /// ```
    ///
    /// Slices of other lengths than these give outputs without meaning; nothing panics.
    ///
    /// # Shapes
    /// - `input`: `(O)`, normalised observation
    /// - `workspace`: `(2 H)`
    /// - `output`: `(A)`
    ///
    /// Source: the paper, section IV.A (three fully connected layers, tanh, tanh on the output).
    #[inline(always)]
    pub fn forward(&self, input: &[f32], workspace: &mut [f32], output: &mut [f32]) {
        let Some((first, rest)) = workspace.split_at_mut_checked(self.shape.hidden) else { return };
        let Some((second, _)) = rest.split_at_mut_checked(self.shape.hidden) else { return };
        let [layer_1, layer_2, layer_3] = self.shape.layers();
        self.apply(layer_1, input, first);
        self.apply(layer_2, first, second);
        self.apply(layer_3, second, output);
    }

    /// One layer with its tanh.
    #[inline(always)]
    fn apply(&self, layer: LayerSpan, input: &[f32], output: &mut [f32]) {
        let weights = self.parameters.get(layer.weights..layer.biases).unwrap_or(&[]);
        let biases = self.parameters.get(layer.biases..layer.biases + layer.outputs).unwrap_or(&[]);
        let mut done = 0;
        while done + WIDE <= layer.outputs {
            affine_block::<WIDE>(weights, biases, layer.outputs, done, input, output);
            done += WIDE;
        }
        while done + NARROW <= layer.outputs {
            affine_block::<NARROW>(weights, biases, layer.outputs, done, input, output);
            done += NARROW;
        }
        while done < layer.outputs {
            affine_block::<1>(weights, biases, layer.outputs, done, input, output);
            done += 1;
        }
        for value in output.iter_mut().take(layer.outputs) {
            *value = tanh(*value);
        }
    }
}

/// `output[j] = biases[j] + sum_i input[i] weights[i][j]` for the `LANES` outputs from `start`, each sum in the order of i.
#[inline(always)]
fn affine_block<const LANES: usize>(
    weights: &[f32],
    biases: &[f32],
    row_len: usize,
    start: usize,
    input: &[f32],
    output: &mut [f32],
) {
    let Some(bias) = biases.get(start..).and_then(|rest| rest.first_chunk::<LANES>()) else { return };
    let Some(target) = output.get_mut(start..).and_then(|rest| rest.first_chunk_mut::<LANES>()) else { return };
    let mut sum = *bias;
    for (&x, row) in input.iter().zip(weights.chunks_exact(row_len)) {
        let Some(row) = row.get(start..).and_then(|rest| rest.first_chunk::<LANES>()) else { return };
        for (total, &weight) in sum.iter_mut().zip(row) {
            *total += x * weight;
        }
    }
    *target = sum;
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec;
    use std::vec::Vec;

    #[test]
    fn matches_a_network_computed_by_hand() {
        // 1 -> 1 -> 1 -> 1: w1 = 2, b1 = -1, w2 = 3, b2 = 0.5, w3 = -1, b3 = 0.25, x = 0.75
        let parameters = [2.0, -1.0, 3.0, 0.5, -1.0, 0.25];
        let network = Network::new(NetworkShape { input: 1, hidden: 1, output: 1 }, &parameters).unwrap();
        let mut output = [0.0];
        network.forward(&[0.75], &mut [0.0; 2], &mut output);
        // tanh(0.5) = 0.46211716, tanh(1.88635147) = 0.95505363, tanh(-0.70505363) = -0.60756572
        assert!((output[0] + 0.607_565_7).abs() < 1e-6, "{}", output[0]);
    }

    #[test]
    fn agrees_with_the_textbook_loops_for_every_block_width() {
        for (input, hidden, output) in [(8, 64, 2), (42, 64, 17), (5, 40, 9), (3, 128, 1), (7, 17, 81)] {
            let shape = NetworkShape { input, hidden, output };
            let parameters: Vec<f32> =
                (0..shape.num_parameters()).map(|i| ((i * 7919) % 1000) as f32 / 2500.0 - 0.2).collect();
            let x: Vec<f32> = (0..input).map(|i| (i as f32 - 2.0) * 0.3).collect();
            let mut expected: Vec<f64> = x.iter().map(|&v| f64::from(v)).collect();
            for layer in shape.layers() {
                expected = (0..layer.outputs)
                    .map(|j| {
                        let sum: f64 = expected
                            .iter()
                            .enumerate()
                            .map(|(i, v)| v * f64::from(parameters[layer.weights + i * layer.outputs + j]))
                            .sum();
                        libm::tanh(sum + f64::from(parameters[layer.biases + j]))
                    })
                    .collect();
            }
            let network = Network::new(shape, &parameters).unwrap();
            let mut actual = vec![0.0; output];
            network.forward(&x, &mut vec![0.0; network.workspace_len()], &mut actual);
            for (a, e) in actual.iter().zip(&expected) {
                assert!((f64::from(*a) - e).abs() < 3e-6, "{shape:?}: {a} is not {e}");
            }
        }
    }

    #[test]
    fn refuses_a_buffer_of_another_length_and_survives_short_slices() {
        let shape = NetworkShape { input: 2, hidden: 3, output: 1 };
        assert_eq!(shape.num_parameters(), 2 * 3 + 3 + 3 * 3 + 3 + 3 + 1);
        let parameters = vec![0.1; shape.num_parameters()];
        assert!(Network::new(shape, &parameters[1..]).is_none());
        let network = Network::new(shape, &parameters).unwrap();
        network.forward(&[], &mut [], &mut []);
        network.forward(&[1.0], &mut [0.0; 5], &mut [0.0; 4]);
    }
}
