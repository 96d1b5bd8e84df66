//! The observation normaliser, frozen on the robot.

/// Normalised observations are clamped to this magnitude [standard deviations]; wider, one outlier can saturate the network.
pub const OBSERVATION_LIMIT: f32 = 10.0;

/// Mean and inverse standard deviation of each component of the observation.
#[derive(Clone, Copy, Debug)]
pub struct Normaliser<'a> {
    /// `(O)`, in the observation's units.
    pub mean: &'a [f32],
    /// `(O)`, one over the observation's units.
    pub inverse_std: &'a [f32],
}

impl Normaliser<'_> {
    /// Normalises `observation` in place.
    ///
    /// ```text
    /// z = clamp((o - mean) / std, -10, 10)
    /// ```
    ///
    /// # Shapes
    /// - `observation`: `(O)`
    ///
    /// Source: the paper, section II.B ("we regularize the Doggo robot data"), read as running standardisation.
    #[inline(always)]
    pub fn apply(&self, observation: &mut [f32]) {
        for ((value, mean), inverse_std) in observation.iter_mut().zip(self.mean).zip(self.inverse_std) {
            *value = ((*value - mean) * inverse_std).clamp(-OBSERVATION_LIMIT, OBSERVATION_LIMIT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standardises_and_clamps() {
        let normaliser = Normaliser { mean: &[1.0, -2.0, 0.0], inverse_std: &[2.0, 0.5, 1.0] };
        let mut observation = [1.5, 2.0, -1e9];
        normaliser.apply(&mut observation);
        assert_eq!(observation, [1.0, 2.0, -10.0]);
    }
}
