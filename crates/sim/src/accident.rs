//! What ends an episode badly.

/// Why an episode was terminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Accident {
    /// The body leaned too far.
    Rollover,
    /// The body came too close to the ground.
    TooLow,
    /// A leg could not follow its commands for too long.
    LegStuck,
    /// The physics gave a state that makes no sense.
    Unstable,
}

impl Accident {
    /// Every accident, in the order in which tables list them.
    pub const ALL: [Self; 4] = [Self::Rollover, Self::TooLow, Self::LegStuck, Self::Unstable];

    /// The accident's name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rollover => "rollover",
            Self::TooLow => "too_low",
            Self::LegStuck => "leg_stuck",
            Self::Unstable => "unstable",
        }
    }
}

/// How long a leg has been unable to follow its commands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StuckTimer {
    seconds: f64,
}

impl StuckTimer {
    /// A timer that shows `seconds` [s].
    pub fn at(seconds: f64) -> Self {
        Self { seconds }
    }

    /// The time without a break [s].
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Counts `dt_s` [s] while the error [rad] is above the limit [rad], starts anew otherwise; returns the time [s].
    pub fn update(&mut self, error_rad: f64, limit_rad: f64, dt_s: f64) -> f64 {
        self.seconds = if error_rad > limit_rad { self.seconds + dt_s } else { 0.0 };
        self.seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_unbroken_error_counts() {
        let mut timer = StuckTimer::default();
        for _ in 0..3 {
            timer.update(1.0, 0.5, 0.01);
        }
        assert!((timer.seconds() - 0.03).abs() < 1e-12);
        assert_eq!(timer.update(0.4, 0.5, 0.01), 0.0);
        assert_eq!(timer.update(0.6, 0.5, 0.01), 0.01);
    }
}
