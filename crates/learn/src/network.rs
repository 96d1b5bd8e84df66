//! The networks over many rows at once, and their gradients.
//!
//! The robot runs [`canter_gait::network::Network`] on one observation; here the same parameters, in the same layout,
//! are applied to a block of rows. A test holds the two to each other.

use crate::matrix::{Matrix, Previous, multiply};
use crate::real::Real;
use crate::simd;
use canter_gait::network::{LayerSpan, NetworkShape};

/// What follows a network's last layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputActivation {
    /// tanh: the actor, whose mean lies in [-1, 1].
    Tanh,
    /// Nothing: the critic.
    Linear,
}

/// A network of three fully connected layers that is applied to many rows at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchedNetwork {
    /// Sizes and parameter layout, the robot's.
    pub shape: NetworkShape,
    /// What follows the last layer.
    pub output_activation: OutputActivation,
}

/// What a forward pass leaves for the backward pass, and the backward pass's own workspace.
#[derive(Clone, Debug)]
pub struct Activations<T> {
    /// Both hidden layers' outputs, `(B x H)` each.
    hidden: [Vec<T>; 2],
    /// The network's output, `(B x A)`.
    output: Vec<T>,
    /// Gradients of the loss by them, same shapes.
    d_loss_d_hidden: [Vec<T>; 2],
    d_loss_d_output: Vec<T>,
    num_outputs: usize,
}

impl<T: Real> Activations<T> {
    /// Room for `max_rows` rows of this network.
    pub fn new(shape: NetworkShape, max_rows: usize) -> Self {
        let hidden = || vec![T::ZERO; max_rows * shape.hidden];
        let output = || vec![T::ZERO; max_rows * shape.output];
        Self {
            hidden: [hidden(), hidden()],
            output: output(),
            d_loss_d_hidden: [hidden(), hidden()],
            d_loss_d_output: output(),
            num_outputs: shape.output,
        }
    }

    /// The last forward pass's output.
    ///
    /// # Shapes
    /// - returns `(B x A)`, the first `num_rows` of the rows there is room for
    pub fn output(&self, num_rows: usize) -> &[T] {
        &self.output[..num_rows * self.num_outputs]
    }

    /// The last forward pass's output beside the place where [`BatchedNetwork::backward`] expects the loss's gradient.
    ///
    /// # Shapes
    /// - returns `(B x A)` and `(B x A)`
    pub fn output_and_gradient(&mut self, num_rows: usize) -> (&[T], &mut [T]) {
        let len = num_rows * self.num_outputs;
        (&self.output[..len], &mut self.d_loss_d_output[..len])
    }
}

impl BatchedNetwork {
    /// Applies the network to every row of `input` and keeps the result in `activations`.
    ///
    /// ```text
    /// h1 = tanh(X W1 + b1),  h2 = tanh(h1 W2 + b2),  output = tanh(h2 W3 + b3)  (or without the last tanh)
    /// ```
    ///
    /// # Shapes
    /// - `parameters`: flat, [`NetworkShape::num_parameters`]
    /// - `input`: `(B x O)`
    ///
    /// # Panics
    /// If a length does not fit the shape, or `activations` has less room than B rows.
    ///
    /// Source: the paper, section IV.A.
    pub fn forward<T: Real>(&self, parameters: &[T], input: &[T], activations: &mut Activations<T>) {
        let num_rows = self.num_rows(input);
        let [layer_1, layer_2, layer_3] = self.shape.layers();
        let [hidden_1, hidden_2] = activations.hidden.each_mut().map(|h| &mut h[..num_rows * self.shape.hidden]);
        let output = &mut activations.output[..num_rows * self.shape.output];
        affine(layer_1, parameters, input, hidden_1);
        T::tanh_in_place(hidden_1);
        affine(layer_2, parameters, hidden_1, hidden_2);
        T::tanh_in_place(hidden_2);
        affine(layer_3, parameters, hidden_2, output);
        if self.output_activation == OutputActivation::Tanh {
            T::tanh_in_place(output);
        }
    }

    /// Adds the gradient of the loss by the parameters to `d_loss_d_parameters`.
    ///
    /// `activations` must come from [`forward`](Self::forward) with the same parameters and input, and hold the
    /// gradient by the output; that gradient is overwritten.
    ///
    /// ```text
    /// d_loss_d_z = d_loss_d_y (1 - y^2),   d_loss_d_W += x' d_loss_d_z,   d_loss_d_b += sum over rows of d_loss_d_z,
    /// d_loss_d_x = d_loss_d_z W'           for a layer y = tanh(z), z = x W + b
    /// ```
    ///
    /// # Shapes
    /// - `parameters`, `d_loss_d_parameters`: flat, [`NetworkShape::num_parameters`]
    /// - `input`: `(B x O)`
    ///
    /// # Panics
    /// As [`forward`](Self::forward).
    ///
    /// Source: Rumelhart, Hinton and Williams 1986 (back-propagation).
    pub fn backward<T: Real>(
        &self,
        parameters: &[T],
        input: &[T],
        activations: &mut Activations<T>,
        d_loss_d_parameters: &mut [T],
    ) {
        let num_rows = self.num_rows(input);
        let [layer_1, layer_2, layer_3] = self.shape.layers();
        let [hidden_1, hidden_2] = activations.hidden.each_ref().map(|h| &h[..num_rows * self.shape.hidden]);
        let [d_hidden_1, d_hidden_2] =
            activations.d_loss_d_hidden.each_mut().map(|h| &mut h[..num_rows * self.shape.hidden]);
        let d_output = &mut activations.d_loss_d_output[..num_rows * self.shape.output];
        if self.output_activation == OutputActivation::Tanh {
            simd::multiply_by_tanh_derivative(d_output, &activations.output[..num_rows * self.shape.output]);
        }
        d_loss_d_layer(layer_3, hidden_2, d_output, d_loss_d_parameters);
        d_loss_d_input(layer_3, parameters, d_output, d_hidden_2);
        simd::multiply_by_tanh_derivative(d_hidden_2, hidden_2);
        d_loss_d_layer(layer_2, hidden_1, d_hidden_2, d_loss_d_parameters);
        d_loss_d_input(layer_2, parameters, d_hidden_2, d_hidden_1);
        simd::multiply_by_tanh_derivative(d_hidden_1, hidden_1);
        d_loss_d_layer(layer_1, input, d_hidden_1, d_loss_d_parameters);
    }

    fn num_rows<T>(&self, input: &[T]) -> usize {
        assert_eq!(input.len() % self.shape.input, 0, "the input is not whole rows of {}", self.shape.input);
        input.len() / self.shape.input
    }
}

/// `output = input W + b`.
fn affine<T: Real>(layer: LayerSpan, parameters: &[T], input: &[T], output: &mut [T]) {
    let biases = &parameters[layer.biases..layer.biases + layer.outputs];
    for row in output.chunks_exact_mut(layer.outputs) {
        row.copy_from_slice(biases);
    }
    let input = Matrix::new(input, output.len() / layer.outputs, layer.inputs);
    multiply(output, Previous::Add, input, weights(layer, parameters));
}

/// `d_loss_d_W += x' d_loss_d_z` and `d_loss_d_b += sum over rows of d_loss_d_z`.
fn d_loss_d_layer<T: Real>(layer: LayerSpan, x: &[T], d_loss_d_z: &[T], d_loss_d_parameters: &mut [T]) {
    let num_rows = d_loss_d_z.len() / layer.outputs;
    let (d_loss_d_weights, rest) = d_loss_d_parameters[layer.weights..].split_at_mut(layer.inputs * layer.outputs);
    let x_transposed = Matrix::new(x, num_rows, layer.inputs).transposed();
    multiply(d_loss_d_weights, Previous::Add, x_transposed, Matrix::new(d_loss_d_z, num_rows, layer.outputs));
    simd::add_rows(&mut rest[..layer.outputs], d_loss_d_z);
}

/// `d_loss_d_x = d_loss_d_z W'`.
fn d_loss_d_input<T: Real>(layer: LayerSpan, parameters: &[T], d_loss_d_z: &[T], d_loss_d_x: &mut [T]) {
    let d_loss_d_z = Matrix::new(d_loss_d_z, d_loss_d_z.len() / layer.outputs, layer.outputs);
    multiply(d_loss_d_x, Previous::Replace, d_loss_d_z, weights(layer, parameters).transposed());
}

/// The layer's weights, `(inputs x outputs)`.
fn weights<T>(layer: LayerSpan, parameters: &[T]) -> Matrix<'_, T> {
    Matrix::new(&parameters[layer.weights..layer.biases], layer.inputs, layer.outputs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canter_gait::network::Network;

    #[test]
    fn agrees_with_a_network_and_gradient_computed_by_hand() {
        // 1 -> 1 -> 1 -> 1: w1 = 2, b1 = -1, w2 = 3, b2 = 0.5, w3 = -1, b3 = 0.25, x = 0.75
        // h1 = tanh(0.5) = 0.46211716, h2 = tanh(1.88635147) = 0.95505363, linear output = -0.70505363
        let shape = NetworkShape { input: 1, hidden: 1, output: 1 };
        let network = BatchedNetwork { shape, output_activation: OutputActivation::Linear };
        let parameters = [2.0, -1.0, 3.0, 0.5, -1.0, 0.25];
        let mut activations = Activations::new(shape, 1);
        network.forward(&parameters, &[0.75], &mut activations);
        assert!((activations.output(1)[0] + 0.705_053_63_f64).abs() < 1e-7);
        activations.output_and_gradient(1).1[0] = 2.0;
        let mut gradient = [0.0; 6];
        network.backward(&parameters, &[0.75], &mut activations, &mut gradient);
        // d_b3 = 2, d_w3 = 2 h2, d_b2 = -2 (1 - h2^2), d_w2 = d_b2 h1, d_b1 = 3 d_b2 (1 - h1^2), d_w1 = d_b1 x
        let expected = [-0.310_982_29, -0.414_643_06, -0.081_214_84, -0.175_745_12, 1.910_107_26, 2.0];
        for (actual, expected) in gradient.iter().zip(expected) {
            assert!((actual - expected).abs() < 1e-6_f64, "{gradient:?}");
        }
    }

    #[test]
    fn agrees_with_the_robots_forward_on_every_row() {
        for (input, hidden, output, num_rows) in [(8, 64, 2, 96), (48, 128, 12, 33), (5, 17, 1, 1)] {
            let shape = NetworkShape { input, hidden, output };
            let parameters: Vec<f32> =
                (0..shape.num_parameters()).map(|i| ((i * 7919) % 1000) as f32 / 2500.0 - 0.2).collect();
            let rows: Vec<f32> = (0..num_rows * input).map(|i| ((i * 31) % 200) as f32 / 50.0 - 2.0).collect();
            let batched = BatchedNetwork { shape, output_activation: OutputActivation::Tanh };
            let mut activations = Activations::new(shape, num_rows);
            batched.forward(&parameters, &rows, &mut activations);
            let network = Network::new(shape, &parameters).unwrap();
            let (mut single, mut workspace) = (vec![0.0; output], vec![0.0; network.workspace_len()]);
            for (row, actual) in rows.chunks(input).zip(activations.output(num_rows).chunks(output)) {
                network.forward(row, &mut workspace, &mut single);
                for (a, e) in actual.iter().zip(&single) {
                    assert!((a - e).abs() < 2e-6, "{shape:?}: {a} is not {e}");
                }
            }
        }
    }
}
