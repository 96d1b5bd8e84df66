//! Which instructions the policy's forward pass uses: the robot's code cannot ask the processor, the simulator can.

use canter_gait::Network;

/// A forward pass of the policy network, see [`Network::forward`].
pub type Forward = for<'a> fn(&Network<'a>, &[f32], &mut [f32], &mut [f32]);

/// The fastest forward pass that this processor can run; every choice gives the same bytes.
pub fn fastest_forward() -> Forward {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx2") {
        return |network, input, workspace, output| {
            // SAFETY: the processor has AVX2, as was just asked.
            unsafe { forward_avx2(network, input, workspace, output) };
        };
    }
    portable_forward
}

/// The forward pass as the robot runs it.
pub fn portable_forward(network: &Network<'_>, input: &[f32], workspace: &mut [f32], output: &mut [f32]) {
    network.forward(input, workspace, output);
}

/// The same code, compiled for AVX2. Multiplications and additions stay separate, so the bytes are the same.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn forward_avx2(network: &Network<'_>, input: &[f32], workspace: &mut [f32], output: &mut [f32]) {
    network.forward(input, workspace, output);
}

#[cfg(test)]
mod tests {
    use super::*;
    use canter_gait::NetworkShape;

    #[test]
    fn every_choice_gives_the_same_bytes() {
        let shape = NetworkShape { input: 43, hidden: 64, output: 17 };
        let parameters: Vec<f32> = (0..shape.num_parameters()).map(|i| ((i * 31) % 97) as f32 / 300.0 - 0.15).collect();
        let network = Network::new(shape, &parameters).unwrap();
        let input: Vec<f32> = (0..43).map(|i| (i as f32 * 0.7).sin()).collect();
        let mut workspace = vec![0.0; network.workspace_len()];
        let (mut fast, mut portable) = (vec![0.0; 17], vec![0.0; 17]);
        fastest_forward()(&network, &input, &mut workspace, &mut fast);
        portable_forward(&network, &input, &mut workspace, &mut portable);
        assert_eq!(
            fast.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
            portable.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        );
    }
}
