//! The range that a number may have.

use std::fmt::Display;
use std::ops::{Bound, RangeBounds};

/// The values from `min` to `max`, either of which may be open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits<N> {
    min: Bound<N>,
    max: Bound<N>,
}

/// Every number above `min`, which Rust has no range syntax for: `pub mass_kg: f64 in above(0.0)`.
pub fn above<N>(min: N) -> (Bound<N>, Bound<N>) {
    (Bound::Excluded(min), Bound::Unbounded)
}

impl<N> Limits<N> {
    /// No limits at all.
    pub fn none() -> Self {
        Self { min: Bound::Unbounded, max: Bound::Unbounded }
    }
}

impl<N: Copy + PartialOrd + Display> Limits<N> {
    /// The numbers of `range`.
    pub fn within(self, range: impl RangeBounds<N>) -> Self {
        Self { min: range.start_bound().cloned(), max: range.end_bound().cloned() }
    }

    /// The same limits, closed at `min` and `max` where they were open.
    pub(super) fn closed(self, min: N, max: N) -> Self {
        let or = |bound, closed| match bound {
            Bound::Unbounded => Bound::Included(closed),
            bound => bound,
        };
        Self { min: or(self.min, min), max: or(self.max, max) }
    }

    /// Whether `value` is inside.
    pub fn contains(&self, value: N) -> bool {
        (self.min, self.max).contains(&value)
    }

    /// The limits in words, e.g. `from 0 to 1`; empty when there are none.
    pub fn text(&self) -> String {
        let min = match self.min {
            Bound::Included(min) => format!("at least {min}"),
            Bound::Excluded(min) => format!("above {min}"),
            Bound::Unbounded => String::new(),
        };
        let max = match self.max {
            Bound::Included(max) => format!("at most {max}"),
            Bound::Excluded(max) => format!("below {max}"),
            Bound::Unbounded => String::new(),
        };
        match (self.min, self.max) {
            (Bound::Included(min), Bound::Included(max)) => format!("from {min} to {max}"),
            (Bound::Unbounded, _) => max,
            (_, Bound::Unbounded) => min,
            _ => format!("{min} and {max}"),
        }
    }
}
