//! Gait priors: what a leg does over one cycle without any policy.
//!
//! Every prior is split into a shape and four parameters, so that a policy can change the same parameters of any gait:
//! `leg position = offset + amplitude * wave(phase)`, with a wave that moves between -1 and 1 in each coordinate.

use crate::kinematics::{FootPosition, LegGeometry, LegPosition};
use crate::phase::wrap_cycles;

/// The shape of a leg's motion over one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is no heap to put a table on")]
pub enum Waveform {
    /// Two sines, the paper's eq. 4.
    Sine(SineWave),
    /// The foot trajectory of Doggo's firmware.
    Stepping(Stepping),
    /// Positions at equal distances over the cycle: whatever a robot's owner has recorded.
    Table(Table),
}

impl Waveform {
    /// The wave at a leg's `phase` [cycles, in [0, 1)], each coordinate in [-1, 1].
    #[inline]
    pub fn at(&self, phase: f32) -> LegPosition {
        match self {
            Self::Sine(sine) => sine.at(phase),
            Self::Stepping(stepping) => stepping.at(phase),
            Self::Table(table) => table.at(phase),
        }
    }
}

/// Sines for swing and extension, the second ahead by `extension_phase`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SineWave {
    /// How far extension is ahead of swing [cycles]. 1/2 is eq. 4's literal pi; 3/4 makes the leg shortest in the
    /// middle of its forward swing, which is what a foot needs.
    pub extension_phase: f32,
}

impl SineWave {
    /// The two sines at a leg's `phase` [cycles].
    ///
    /// ```text
    /// swing = sin(t),  extension = sin(t + 2 pi extension_phase),  t = 2 pi phase
    /// ```
    ///
    /// The paper calls them theta and gamma and says that theta lifts the leg; Doggo's firmware has it the other way
    /// round and is followed here. With `extension` positive when the leg gets longer, the literal pi walks forward.
    ///
    /// Source: eq. 4 of the paper.
    #[inline]
    pub fn at(&self, phase: f32) -> LegPosition {
        let t = core::f32::consts::TAU * phase;
        LegPosition {
            swing: libm::sinf(t),
            extension: libm::sinf(core::f32::consts::TAU * wrap_cycles(phase + self.extension_phase)),
        }
    }
}

/// What Doggo's firmware lets its user set of a trot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteppingParameters {
    /// Depth of the foot below the hip between flight and stance [m].
    pub stance_height_m: f32,
    /// How far the foot pushes below that in the middle of stance [m].
    pub down_amplitude_m: f32,
    /// How far the foot lifts above that in the middle of flight [m].
    pub up_amplitude_m: f32,
    /// Share of the cycle that the foot is in the air, in (0, 1).
    pub flight_fraction: f32,
    /// Way of the foot between touchdown and lift-off [m].
    pub step_length_m: f32,
}

impl SteppingParameters {
    /// Where the foot is at a leg's `phase` [cycles]; the cycle begins with lift-off.
    ///
    /// ```text
    /// flight (phase < p):  u = phase / p,              x = l (u - 1/2),  y = h - up sin(pi u)
    /// stance:              u = (phase - p) / (1 - p),  x = l (1/2 - u),  y = h + down sin(pi u)
    /// ```
    ///
    /// Source: Stanford Doggo's firmware, the sinusoidal gait.
    pub fn foot(&self, phase: f32) -> FootPosition {
        let in_flight = phase < self.flight_fraction;
        let (u, direction, depth) = if in_flight {
            (phase / self.flight_fraction, 1.0, -self.up_amplitude_m)
        } else {
            ((phase - self.flight_fraction) / (1.0 - self.flight_fraction), -1.0, self.down_amplitude_m)
        };
        FootPosition {
            forward_m: direction * self.step_length_m * (u - 0.5),
            down_m: self.stance_height_m + depth * libm::sinf(core::f32::consts::PI * u),
        }
    }
}

/// The stepping trajectory of one leg, with its span in leg space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepping {
    parameters: SteppingParameters,
    geometry: LegGeometry,
    span: Span,
}

impl Stepping {
    /// Points of the cycle at which the trajectory is checked and its range is taken.
    const SAMPLES: usize = 512;

    /// The trajectory for a leg; `None` if the leg cannot reach some point of it or it does not move in both coordinates.
    pub fn new(parameters: SteppingParameters, geometry: LegGeometry) -> Option<Self> {
        let mut low = LegPosition { swing: f32::INFINITY, extension: f32::INFINITY };
        let mut high = LegPosition { swing: f32::NEG_INFINITY, extension: f32::NEG_INFINITY };
        let samples = (0..Self::SAMPLES).map(|i| i as f32 / Self::SAMPLES as f32);
        // Touchdown is the trajectory's corner: without it the swing range would lean to one side.
        for phase in samples.chain(core::iter::once(parameters.flight_fraction)) {
            let leg = geometry.inverse(parameters.foot(phase))?;
            low = LegPosition { swing: low.swing.min(leg.swing), extension: low.extension.min(leg.extension) };
            high = LegPosition { swing: high.swing.max(leg.swing), extension: high.extension.max(leg.extension) };
        }
        let span = Span::between(low, high);
        let moves = span.half_range.swing > 0.0 && span.half_range.extension > 0.0;
        moves.then_some(Self { parameters, geometry, span })
    }

    /// What the trajectory was made from.
    pub fn parameters(&self) -> SteppingParameters {
        self.parameters
    }

    /// The parameters with which [`LegGait::position`] gives the firmware's trajectory.
    pub fn defaults(&self) -> LegParameters {
        self.span.parameters()
    }

    /// The trajectory in leg space, moved and scaled into [-1, 1].
    fn at(&self, phase: f32) -> LegPosition {
        // `new` has checked the whole cycle; between its samples rounding may put the foot just out of reach.
        let leg = self.geometry.inverse(self.parameters.foot(phase)).unwrap_or(self.span.centre);
        let Span { centre, half_range } = self.span;
        LegPosition {
            swing: (leg.swing - centre.swing) / half_range.swing,
            extension: (leg.extension - centre.extension) / half_range.extension,
        }
    }
}

/// The part of leg space that a motion fills.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    centre: LegPosition,
    half_range: LegPosition,
}

impl Span {
    /// The span between two corners.
    fn between(low: LegPosition, high: LegPosition) -> Self {
        let centre =
            LegPosition { swing: 0.5 * (low.swing + high.swing), extension: 0.5 * (low.extension + high.extension) };
        let half_range =
            LegPosition { swing: 0.5 * (high.swing - low.swing), extension: 0.5 * (high.extension - low.extension) };
        Self { centre, half_range }
    }

    /// The parameters with which [`LegGait::position`] makes the motion of its wave in [-1, 1].
    fn parameters(&self) -> LegParameters {
        LegParameters {
            swing_amplitude: self.half_range.swing,
            extension_amplitude: self.half_range.extension,
            swing_offset: self.centre.swing,
            extension_offset: self.centre.extension,
        }
    }
}

/// Points of a [`Table`]: a cycle of 0.64 s at 100 Hz.
pub const TABLE_POINTS: usize = 64;

/// A leg's positions at equal distances over one cycle, straight lines between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// Moved and scaled into [-1, 1].
    wave: [LegPosition; TABLE_POINTS],
    span: Span,
}

impl Table {
    /// A table of these positions, the first at phase 0; `None` if one is not finite.
    pub fn new(positions: &[LegPosition; TABLE_POINTS]) -> Option<Self> {
        let mut low = LegPosition { swing: f32::INFINITY, extension: f32::INFINITY };
        let mut high = LegPosition { swing: f32::NEG_INFINITY, extension: f32::NEG_INFINITY };
        for leg in positions {
            if !(leg.swing.is_finite() && leg.extension.is_finite()) {
                return None;
            }
            low = LegPosition { swing: low.swing.min(leg.swing), extension: low.extension.min(leg.extension) };
            high = LegPosition { swing: high.swing.max(leg.swing), extension: high.extension.max(leg.extension) };
        }
        let span = Span::between(low, high);
        // A coordinate that does not move has no wave.
        let scaled = |value: f32, half: f32| if half > 0.0 { value / half } else { 0.0 };
        let wave = positions.map(|leg| LegPosition {
            swing: scaled(leg.swing - span.centre.swing, span.half_range.swing),
            extension: scaled(leg.extension - span.centre.extension, span.half_range.extension),
        });
        Some(Self { wave, span })
    }

    /// The points, each coordinate in [-1, 1].
    pub fn wave(&self) -> &[LegPosition; TABLE_POINTS] {
        &self.wave
    }

    /// The parameters with which [`LegGait::position`] gives the positions back.
    pub fn defaults(&self) -> LegParameters {
        self.span.parameters()
    }

    /// The wave at a leg's `phase` [cycles, in [0, 1)].
    ///
    /// ```text
    /// wave = (1 - u) wave_i + u wave_(i+1),  i + u = n phase
    /// ```
    ///
    /// Source: linear interpolation.
    fn at(&self, phase: f32) -> LegPosition {
        let place = phase * TABLE_POINTS as f32;
        let index = place as usize % TABLE_POINTS;
        let u = place - libm::floorf(place);
        let (from, to) = (self.wave[index], self.wave[(index + 1) % TABLE_POINTS]);
        LegPosition {
            swing: from.swing + u * (to.swing - from.swing),
            extension: from.extension + u * (to.extension - from.extension),
        }
    }
}

/// The four numbers of a leg's gait that a policy may change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegParameters {
    /// Amplitude of the swing angle [rad]; the paper's theta_0.
    pub swing_amplitude: f32,
    /// Amplitude of the extension [rad]; the paper's gamma_0.
    pub extension_amplitude: f32,
    /// Swing angle about which the leg moves [rad].
    pub swing_offset: f32,
    /// Extension about which the leg moves [rad].
    pub extension_offset: f32,
}

/// One leg's part of a gait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegGait {
    /// Shape of the motion.
    pub waveform: Waveform,
    /// What the leg adds to the clock's phase [cycles].
    pub phase_offset: f32,
    /// Its parameters without a policy.
    pub defaults: LegParameters,
}

impl LegGait {
    /// Where the leg is commanded to be when the clock shows `phase` [cycles].
    ///
    /// ```text
    /// swing = swing_offset + swing_amplitude * wave_swing(phase + phase_offset), likewise extension
    /// ```
    ///
    /// Source: eq. 4 of the paper, generalised by an offset.
    #[inline]
    pub fn position(&self, phase: f32, parameters: &LegParameters) -> LegPosition {
        let wave = self.waveform.at(wrap_cycles(phase + self.phase_offset));
        LegPosition {
            swing: parameters.swing_offset + parameters.swing_amplitude * wave.swing,
            extension: parameters.extension_offset + parameters.extension_amplitude * wave.extension,
        }
    }
}

/// A whole gait: every leg's part and the clock's frequency.
#[derive(Clone, Copy, Debug)]
pub struct Gait<'a> {
    /// Cycles per second without a policy [1/s].
    pub stride_frequency_hz: f32,
    /// `(L)` the legs' parts.
    pub legs: &'a [LegGait],
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::FiveBar;

    fn geometry() -> LegGeometry {
        LegGeometry::FiveBar(FiveBar::new(0.09, 0.162, 0.0, 0.17).unwrap())
    }

    const FIRMWARE_TROT: SteppingParameters = SteppingParameters {
        stance_height_m: 0.17,
        down_amplitude_m: 0.04,
        up_amplitude_m: 0.06,
        flight_fraction: 0.35,
        step_length_m: 0.15,
    };

    #[test]
    fn eq_4_by_hand() {
        let literal = SineWave { extension_phase: 0.5 };
        let wave = literal.at(1.0 / 12.0);
        assert!((wave.swing - 0.5).abs() < 1e-6 && (wave.extension + 0.5).abs() < 1e-6);
        // Quarter cycle: the leg is shortest where it swings forward fastest.
        let quarter = SineWave { extension_phase: 0.75 };
        assert!((quarter.at(0.0).extension + 1.0).abs() < 1e-6);
        assert!(quarter.at(0.01).swing > quarter.at(0.0).swing);
    }

    #[test]
    fn the_firmware_trot_passes_through_its_corners() {
        let trot = FIRMWARE_TROT;
        let lift_off = trot.foot(0.0);
        assert!((lift_off.forward_m + 0.075).abs() < 1e-6 && (lift_off.down_m - 0.17).abs() < 1e-6);
        let apex = trot.foot(0.175);
        assert!(apex.forward_m.abs() < 1e-6 && (apex.down_m - 0.11).abs() < 1e-6);
        let touchdown = trot.foot(0.35);
        assert!((touchdown.forward_m - 0.075).abs() < 1e-6 && (touchdown.down_m - 0.17).abs() < 1e-6);
        let mid_stance = trot.foot(0.675);
        assert!(mid_stance.forward_m.abs() < 1e-6 && (mid_stance.down_m - 0.21).abs() < 1e-6);
    }

    #[test]
    fn stepping_with_its_defaults_is_the_firmware_trajectory() {
        let stepping = Stepping::new(FIRMWARE_TROT, geometry()).unwrap();
        let leg = LegGait { waveform: Waveform::Stepping(stepping), phase_offset: 0.5, defaults: stepping.defaults() };
        // atan2(0.075, 0.17) = 0.4155; gamma at L = 0.11 and 0.21 is 1.8810 and 0.8139.
        assert!((leg.defaults.swing_amplitude - 0.4155).abs() < 1e-4);
        assert!((leg.defaults.extension_amplitude - 0.5 * (1.8810 - 0.8139)).abs() < 1e-4);
        for i in 0..100 {
            let phase = i as f32 / 100.0;
            let foot = geometry().forward(leg.position(phase, &leg.defaults));
            let expected = FIRMWARE_TROT.foot(wrap_cycles(phase + 0.5));
            assert!((foot.forward_m - expected.forward_m).abs() < 1e-5, "{phase}");
            assert!((foot.down_m - expected.down_m).abs() < 1e-5, "{phase}");
        }
    }

    #[test]
    fn waves_stay_within_one() {
        let stepping = Waveform::Stepping(Stepping::new(FIRMWARE_TROT, geometry()).unwrap());
        for waveform in [stepping, Waveform::Sine(SineWave { extension_phase: 0.75 })] {
            for i in 0..1000 {
                let wave = waveform.at(i as f32 / 1000.0);
                assert!(wave.swing.abs() < 1.001 && wave.extension.abs() < 1.001);
            }
        }
    }

    #[test]
    fn a_table_gives_back_what_it_was_made_of() {
        let stepping = Stepping::new(FIRMWARE_TROT, geometry()).unwrap();
        let leg = LegGait { waveform: Waveform::Stepping(stepping), phase_offset: 0.0, defaults: stepping.defaults() };
        let positions: [LegPosition; TABLE_POINTS] =
            core::array::from_fn(|i| leg.position(i as f32 / TABLE_POINTS as f32, &leg.defaults));
        let table = Table::new(&positions).unwrap();
        let recorded = LegGait { waveform: Waveform::Table(table), phase_offset: 0.0, defaults: table.defaults() };
        for (i, expected) in positions.iter().enumerate() {
            let actual = recorded.position(i as f32 / TABLE_POINTS as f32, &recorded.defaults);
            assert!(
                (actual.swing - expected.swing).abs() < 1e-5 && (actual.extension - expected.extension).abs() < 1e-5
            );
        }
        // Between two points it is between their positions; after the last comes the first.
        let between = recorded.position(63.5 / 64.0, &recorded.defaults);
        assert!((between.swing - 0.5 * (positions[63].swing + positions[0].swing)).abs() < 1e-5);
        let still = Table::new(&[LegPosition { swing: 0.1, extension: 0.2 }; TABLE_POINTS]).unwrap();
        assert_eq!(still.at(0.3), LegPosition::default());
        assert_eq!(Table::new(&[LegPosition { swing: f32::NAN, extension: 0.0 }; TABLE_POINTS]), None);
    }

    #[test]
    fn a_step_out_of_reach_is_refused() {
        let too_deep = SteppingParameters { down_amplitude_m: 0.09, ..FIRMWARE_TROT };
        assert_eq!(Stepping::new(too_deep, geometry()), None);
        let still = SteppingParameters { step_length_m: 0.0, ..FIRMWARE_TROT };
        assert_eq!(Stepping::new(still, geometry()), None);
    }
}
