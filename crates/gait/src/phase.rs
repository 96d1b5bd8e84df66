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

/// Phase offsets of the four-legged gaits, in cycles, in the order front left, back left, back right, front right.
///
/// A leg's phase is the clock's plus its offset. Source: Stanford Doggo's firmware for trot, bound, walk and pronk;
/// pace is its left-right counterpart of bound.
pub const QUADRUPED_GAITS: [(&str, [f32; 4]); 5] = [
    ("trot", [0.0, 0.5, 0.0, 0.5]),
    ("walk", [0.0, 0.25, 0.75, 0.5]),
    ("pace", [0.0, 0.0, 0.5, 0.5]),
    ("bound", [0.0, 0.5, 0.5, 0.0]),
    ("pronk", [0.0, 0.0, 0.0, 0.0]),
];

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
}
