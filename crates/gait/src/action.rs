//! The action law: how much of the gait a policy's output may change, and how.

use crate::prior::{Gait, LegGait, LegParameters};

/// What a policy may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modulation {
    /// Swing and extension amplitude of all legs together: the paper's two outputs.
    Amplitude,
    /// Swing and extension amplitude of each leg.
    LegAmplitude,
    /// The stride frequency, and amplitudes and offsets of each leg.
    Modulate,
    /// The actuator targets of the prior, each by a bounded addition.
    Residual,
    /// The motor angles themselves, without a prior: the paper's control experiment.
    Direct,
}

impl Modulation {
    /// Every modulation, in the order in which documents list them.
    pub const ALL: [Self; 5] = [Self::Amplitude, Self::LegAmplitude, Self::Modulate, Self::Residual, Self::Direct];

    /// The modulation's name in configurations and policy files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Amplitude => "amplitude",
            Self::LegAmplitude => "leg-amplitude",
            Self::Modulate => "modulate",
            Self::Residual => "residual",
            Self::Direct => "direct",
        }
    }

    /// The modulation of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|modulation| modulation.name() == name)
    }

    /// Number of outputs of the policy, A.
    pub const fn num_actions(self, num_legs: usize) -> usize {
        match self {
            Self::Amplitude => 2,
            Self::LegAmplitude | Self::Residual | Self::Direct => 2 * num_legs,
            Self::Modulate => 1 + PARAMETERS_PER_LEG * num_legs,
        }
    }
}

/// Outputs that [`Modulation::Modulate`] has for each leg: two amplitudes, two offsets.
const PARAMETERS_PER_LEG: usize = 4;

/// Least and greatest value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value.
    pub low: f32,
    /// Greatest value.
    pub high: f32,
}

impl Range {
    /// Takes an action in [-1, 1] onto the range so that 0 is `default`: an untrained policy is the prior.
    ///
    /// ```text
    /// map(n) = default + n (high - default)  for n >= 0
    ///        = default + n (default - low)   for n < 0
    /// ```
    ///
    /// Source: ours; the paper's map is the identity, see [`ActionLaw::amplitude`].
    #[inline]
    pub fn map(&self, default: f32, action: f32) -> f32 {
        let reach = if action < 0.0 { default - self.low } else { self.high - default };
        default + action * reach
    }
}

/// The box of gait parameters that [`Modulation::Modulate`] may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterRanges {
    /// Stride frequency as a multiple of the prior's.
    pub frequency_factor: Range,
    /// Swing amplitude [rad].
    pub swing_amplitude: Range,
    /// Extension amplitude [rad].
    pub extension_amplitude: Range,
    /// Change of the swing offset against the prior's [rad].
    pub swing_offset: Range,
    /// Change of the extension offset against the prior's [rad].
    pub extension_offset: Range,
}

/// The greatest amplitude that eq. 5 allows [rad].
pub const MAX_AMPLITUDE_RAD: f32 = 1.0;

/// Blends what the prior would do with what the policy asks for.
///
/// ```text
/// parameter = (1 - a) default + a mapped
/// ```
///
/// Authority a = 0 returns the prior's bytes, 1 leaves the policy free.
///
/// Source: eq. 4 of the paper, whose a is 1/2.
#[inline]
pub fn blend(authority: f32, default: f32, mapped: f32) -> f32 {
    (1.0 - authority) * default + authority * mapped
}

/// From the policy's action to gait parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionLaw {
    /// What the policy may change.
    pub modulation: Modulation,
    /// How much it may change it: 0 is the prior untouched, 1/2 the paper, 1 free.
    pub authority: f32,
    /// The box of parameters of [`Modulation::Modulate`].
    pub ranges: ParameterRanges,
    /// How far [`Modulation::Residual`] may move an actuator target at full authority [rad].
    pub residual_bound_rad: f32,
}

impl ActionLaw {
    /// An amplitude [rad] from one output of the policy, which is read in radians.
    ///
    /// ```text
    /// amplitude = min(a N + (1 - a) amplitude_0, 1)
    /// ```
    ///
    /// Eq. 5 clips above 1 only, and so does this.
    ///
    /// Source: eq. 4 and 5 of the paper with a = 1/2.
    #[inline]
    pub fn amplitude(&self, default: f32, action: f32) -> f32 {
        blend(self.authority, default, action).min(MAX_AMPLITUDE_RAD)
    }

    /// Stride frequency [Hz] under `action`, `(A)`.
    #[inline]
    pub fn stride_frequency_hz(&self, gait: &Gait<'_>, action: &[f32]) -> f32 {
        let default = gait.stride_frequency_hz;
        match self.modulation {
            Modulation::Modulate => {
                let factor = self.ranges.frequency_factor.map(1.0, component(action, 0));
                blend(self.authority, default, factor * default)
            }
            Modulation::Amplitude | Modulation::LegAmplitude | Modulation::Residual | Modulation::Direct => default,
        }
    }

    /// Actuator targets [rad] of leg number `index` under `action`, `(A)`, where the prior alone would have `targets`. They
    /// may lie beyond the leg's limits.
    ///
    /// ```text
    /// target = prior + a bound N
    /// ```
    ///
    /// The sum is in the actuators' own coordinates: joint angles where each motor has an actuator, swing and extension
    /// where tendons couple the motors. The action's components are the robot's actuators, leg by leg. [`Controller::act`]
    /// then holds the leg to its limits of swing and extension; where it does, a joint may move further than the bound.
    ///
    /// [`Controller::act`]: crate::Controller::act
    ///
    /// Source: our definition; Johannink et al. 2019 learn additions to a controller's commands.
    #[inline]
    pub fn residual(&self, targets: [f32; 2], index: usize, action: &[f32]) -> [f32; 2] {
        let reach_rad = self.authority * self.residual_bound_rad;
        let [first, second] = targets;
        [first + reach_rad * component(action, 2 * index), second + reach_rad * component(action, 2 * index + 1)]
    }

    /// Parameters of leg number `index` under `action`, `(A)`.
    ///
    /// The action's components: `amplitude` swing, extension; `leg-amplitude` the same for each leg in turn;
    /// `modulate` frequency, then for each leg swing amplitude, extension amplitude, swing offset, extension offset.
    #[inline]
    pub fn leg_parameters(&self, leg: &LegGait, index: usize, action: &[f32]) -> LegParameters {
        let default = leg.defaults;
        let amplitudes_from = |start: usize| LegParameters {
            swing_amplitude: self.amplitude(default.swing_amplitude, component(action, start)),
            extension_amplitude: self.amplitude(default.extension_amplitude, component(action, start + 1)),
            ..default
        };
        match self.modulation {
            Modulation::Amplitude => amplitudes_from(0),
            Modulation::LegAmplitude => amplitudes_from(2 * index),
            Modulation::Modulate => {
                let start = 1 + PARAMETERS_PER_LEG * index;
                let ranged = |range: Range, default: f32, i: usize| {
                    blend(self.authority, default, range.map(default, component(action, start + i)))
                };
                let shifted = |range: Range, default: f32, i: usize| {
                    blend(self.authority, default, default + range.map(0.0, component(action, start + i)))
                };
                LegParameters {
                    swing_amplitude: ranged(self.ranges.swing_amplitude, default.swing_amplitude, 0),
                    extension_amplitude: ranged(self.ranges.extension_amplitude, default.extension_amplitude, 1),
                    swing_offset: shifted(self.ranges.swing_offset, default.swing_offset, 2),
                    extension_offset: shifted(self.ranges.extension_offset, default.extension_offset, 3),
                }
            }
            Modulation::Residual | Modulation::Direct => default,
        }
    }
}

/// Component `i` of the action, within [-1, 1]; 0 where there is none or it is not a number.
#[inline]
pub(crate) fn component(action: &[f32], i: usize) -> f32 {
    action.get(i).filter(|value| !value.is_nan()).map_or(0.0, |value| value.clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prior::{SineWave, Waveform};

    const RANGES: ParameterRanges = ParameterRanges {
        frequency_factor: Range { low: 0.5, high: 2.0 },
        swing_amplitude: Range { low: 0.0, high: 1.0 },
        extension_amplitude: Range { low: 0.1, high: 0.8 },
        swing_offset: Range { low: -0.3, high: 0.3 },
        extension_offset: Range { low: -0.2, high: 0.4 },
    };

    const LEG: LegGait = LegGait {
        waveform: Waveform::Sine(SineWave { extension_phase: 0.5 }),
        phase_offset: 0.0,
        defaults: LegParameters {
            swing_amplitude: 0.415,
            extension_amplitude: 0.535,
            swing_offset: 0.05,
            extension_offset: 0.0,
        },
    };

    fn law(modulation: Modulation, authority: f32) -> ActionLaw {
        ActionLaw { modulation, authority, ranges: RANGES, residual_bound_rad: 0.2 }
    }

    #[test]
    fn eq_4_mixes_half_and_half() {
        let law = law(Modulation::Amplitude, 0.5);
        // 0.5 * 0.8 + 0.5 * 0.415 = 0.6075; 0.5 * -0.2 + 0.5 * 0.535 = 0.1675
        let parameters = law.leg_parameters(&LEG, 3, &[0.8, -0.2]);
        assert!((parameters.swing_amplitude - 0.6075).abs() < 1e-6);
        assert!((parameters.extension_amplitude - 0.1675).abs() < 1e-6);
        assert_eq!(parameters.swing_offset, 0.05);
    }

    #[test]
    fn eq_5_clips_above_one_and_not_below() {
        let law = law(Modulation::Amplitude, 0.5);
        assert_eq!(law.amplitude(1.4, 0.9), 1.0);
        assert!((law.amplitude(0.415, -1.0) + 0.2925).abs() < 1e-6);
    }

    #[test]
    fn authority_zero_returns_the_priors_bytes() {
        for modulation in Modulation::ALL {
            let law = law(modulation, 0.0);
            let action = [0.7; 17];
            assert_eq!(law.leg_parameters(&LEG, 2, &action), LEG.defaults);
            let gait = Gait { stride_frequency_hz: 2.3, legs: &[] };
            assert_eq!(law.stride_frequency_hz(&gait, &action).to_bits(), 2.3f32.to_bits());
            assert_eq!(law.residual([0.3, -0.7], 2, &action).map(f32::to_bits), [0.3f32, -0.7].map(f32::to_bits));
        }
    }

    #[test]
    fn modulate_reaches_both_ends_of_every_range_and_the_default_in_the_middle() {
        let law = law(Modulation::Modulate, 1.0);
        let gait = Gait { stride_frequency_hz: 2.0, legs: &[] };
        let parameters = |n: f32| law.leg_parameters(&LEG, 1, &[n; 9]);
        assert_eq!(parameters(0.0), LEG.defaults);
        let low = parameters(-1.0);
        assert!(low.swing_amplitude.abs() < 1e-6 && (low.extension_amplitude - 0.1).abs() < 1e-6);
        assert!((low.swing_offset + 0.25).abs() < 1e-6 && (low.extension_offset + 0.2).abs() < 1e-6);
        let high = parameters(1.0);
        assert!((high.swing_amplitude - 1.0).abs() < 1e-6 && (high.extension_amplitude - 0.8).abs() < 1e-6);
        assert!((high.swing_offset - 0.35).abs() < 1e-6 && (high.extension_offset - 0.4).abs() < 1e-6);
        assert_eq!(law.stride_frequency_hz(&gait, &[-1.0]), 1.0);
        assert_eq!(law.stride_frequency_hz(&gait, &[0.0]), 2.0);
        assert_eq!(law.stride_frequency_hz(&gait, &[1.0]), 4.0);
    }

    #[test]
    fn legs_read_their_own_components() {
        let law = law(Modulation::LegAmplitude, 1.0);
        let action = [0.1, 0.2, 0.3, 0.4];
        assert_eq!(law.leg_parameters(&LEG, 1, &action).swing_amplitude, 0.3);
        assert_eq!(law.leg_parameters(&LEG, 1, &action).extension_amplitude, 0.4);
    }

    #[test]
    fn actions_outside_the_unit_box_are_clamped() {
        let law = law(Modulation::LegAmplitude, 1.0);
        assert_eq!(law.leg_parameters(&LEG, 0, &[7.0, -7.0]).swing_amplitude, 1.0);
        assert_eq!(law.leg_parameters(&LEG, 0, &[7.0, -7.0]).extension_amplitude, -1.0);
    }

    #[test]
    fn a_residual_moves_a_target_by_its_share_of_the_bound() {
        let law = law(Modulation::Residual, 0.5);
        // 0.3 + 0.5 * 0.2 * 0.5 = 0.35; -0.7 + 0.5 * 0.2 * -1 = -0.8, the action being clamped.
        let [first, second] = law.residual([0.3, -0.7], 1, &[0.9, 0.9, 0.5, -3.0]);
        assert!((first - 0.35).abs() < 1e-6 && (second + 0.8).abs() < 1e-6);
        // Amplitudes and frequency stay the prior's.
        assert_eq!(law.leg_parameters(&LEG, 1, &[1.0; 4]), LEG.defaults);
    }

    #[test]
    fn names_round_trip() {
        for modulation in Modulation::ALL {
            assert_eq!(Modulation::from_name(modulation.name()), Some(modulation));
        }
        assert_eq!(Modulation::Modulate.num_actions(4), 17);
        assert_eq!(Modulation::Residual.num_actions(4), 8);
        assert_eq!(Modulation::Direct.num_actions(4), 8);
    }
}
