//! The gait's clock.

/// Where the gait stands in its cycle, in cycles, always in [0, 1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseClock {
    phase: f32,
}

impl PhaseClock {
    /// A clock at `phase` cycles, wrapped into [0, 1).
    pub fn at(phase: f32) -> Self {
        Self { phase: wrap_cycles(phase) }
    }

    /// The phase now, in cycles, in [0, 1).
    pub fn phase(&self) -> f32 {
        self.phase
    }

    /// Moves on by `stride_frequency_hz` [Hz] times `dt_s` [s].
    ///
    /// ```text
    /// phase <- (phase + f dt) mod 1
    /// ```
    ///
    /// Source: eq. 4 of the paper, whose t is 2 pi times this phase.
    pub fn advance(&mut self, stride_frequency_hz: f32, dt_s: f32) {
        self.phase = wrap_cycles(self.phase + stride_frequency_hz * dt_s);
    }
}

/// `cycles` wrapped into [0, 1); 0 where it is not finite.
pub fn wrap_cycles(cycles: f32) -> f32 {
    let wrapped = cycles - libm::floorf(cycles);
    // A tiny negative number wraps to exactly 1 in f32.
    if (0.0..1.0).contains(&wrapped) { wrapped } else { 0.0 }
}

/// A footfall pattern: its name and each leg's phase offset [cycles].
pub type FootfallPattern = (&'static str, &'static [f32]);

/// Phase offsets of the gaits by name and number of legs [cycles], legs in the order left front to back, then right back
/// to front.
///
/// A leg's phase is the clock's plus its offset; one that is ahead moves first. Source: Stanford Doggo's firmware for
/// trot, bound, walk and pronk; pace is bound's left-right counterpart; gallop (transverse) after Hildebrand 1977; waves
/// and ripples, from the back to the front with the sides half a cycle apart, after Wilson 1966.
pub const FOOTFALLS: [FootfallPattern; 11] = [
    ("trot", &[0.0, 0.5, 0.0, 0.5]),
    ("walk", &[0.0, 0.25, 0.75, 0.5]),
    ("pace", &[0.0, 0.0, 0.5, 0.5]),
    ("bound", &[0.0, 0.5, 0.5, 0.0]),
    ("pronk", &[0.0, 0.0, 0.0, 0.0]),
    ("gallop", &[0.5, 0.0, 0.9, 0.4]),
    ("tripod", &[0.0, 0.5, 0.0, 0.5, 0.0, 0.5]),
    ("ripple", &[1.0 / 3.0, 2.0 / 3.0, 0.0, 0.5, 1.0 / 6.0, 5.0 / 6.0]),
    ("wave", &[4.0 / 6.0, 5.0 / 6.0, 0.0, 0.5, 2.0 / 6.0, 1.0 / 6.0]),
    ("alternating", &[0.0, 0.5, 0.0, 0.5, 0.0, 0.5, 0.0, 0.5]),
    ("wave", &[0.625, 0.75, 0.875, 0.0, 0.5, 0.375, 0.25, 0.125]),
];

/// The phase offsets of a named gait for so many legs [cycles]; `None` if there is no such gait for them.
pub fn phase_offsets(name: &str, num_legs: usize) -> Option<&'static [f32]> {
    let found = FOOTFALLS.iter().find(|(own, offsets)| *own == name && offsets.len() == num_legs);
    found.map(|(_, offsets)| *offsets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_at_two_hertz_needs_fifty_steps_of_ten_milliseconds() {
        let mut clock = PhaseClock::at(0.25);
        for _ in 0..25 {
            clock.advance(2.0, 0.01);
        }
        assert!((clock.phase() - 0.75).abs() < 1e-5);
        for _ in 0..25 {
            clock.advance(2.0, 0.01);
        }
        assert!((clock.phase() - 0.25).abs() < 1e-5);
    }

    #[test]
    fn wrapping_always_lands_in_the_unit_interval() {
        assert_eq!(wrap_cycles(1.25), 0.25);
        assert_eq!(wrap_cycles(-0.25), 0.75);
        assert_eq!(wrap_cycles(-3.0), 0.0);
        for cycles in [-1e-9, 1e9, -1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.999_999_97] {
            assert!((0.0..1.0).contains(&wrap_cycles(cycles)), "{cycles}");
        }
    }

    #[test]
    fn every_leg_moves_once_a_cycle_and_waves_run_to_the_front() {
        for (name, offsets) in FOOTFALLS {
            assert!(offsets.iter().all(|offset| (0.0..1.0).contains(offset)), "{name}");
            assert_eq!(phase_offsets(name, offsets.len()), Some(offsets));
        }
        assert_eq!(phase_offsets("tripod", 4), None);
        // Lift-off, where the leg's phase is 0: back, middle, front, a sixth of a cycle apart.
        let wave = phase_offsets("wave", 6).unwrap();
        for (leg, lift_off) in
            [(2, 0.0), (1, 1.0 / 6.0), (0, 2.0 / 6.0), (3, 3.0 / 6.0), (4, 4.0 / 6.0), (5, 5.0 / 6.0)]
        {
            assert!(wrap_cycles(lift_off + wave[leg] + 1e-6) < 1e-5, "{leg}");
        }
    }
}
