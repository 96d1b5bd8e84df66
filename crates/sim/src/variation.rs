//! What differs between the environments of a training, so that the policy learns to cope with it.
//!
//! The variations are spread evenly over the environments instead of being drawn for each episode: where a robot falls
//! at once its episodes are short, and drawn episodes would hardly ever train what is hard.

use crate::settings;
use crate::settings::Problems;

settings! {
    /// What differs between the environments of a training.
    pub struct VariationSettings {
        /// Share of the environments that differ, the others have the task's own values; absent: all differ.
        pub share: Option<f64> in 0.0..=1.0,
        /// Least and greatest slope of the ground, positive uphill [deg], spread evenly; absent: the task's `slope_deg`.
        pub slope_deg: Option<Vec<f64>> in -45.0..=45.0,
    }
}

/// What differs between the environments of a training, checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variation {
    share: f64,
    slope_rad: Option<[f64; 2]>,
    own_slope_rad: f64,
}

impl Variation {
    /// The variation of a task whose own slope is `own_slope_deg` [deg]; what is wrong is reported at `task.variation`.
    pub(crate) fn new(settings: &VariationSettings, own_slope_deg: f64, problems: &mut Problems) -> Self {
        let VariationSettings { share, slope_deg } = settings;
        let slope_deg = slope_deg.as_deref().and_then(|slope| interval("task.variation.slope_deg", slope, problems));
        Self {
            share: share.unwrap_or(1.0),
            slope_rad: slope_deg.map(|slope| slope.map(f64::to_radians)),
            own_slope_rad: own_slope_deg.to_radians(),
        }
    }

    /// Whether anything varies.
    pub fn is_any(&self) -> bool {
        self.slope_rad.is_some() && self.share > 0.0
    }

    /// Whether an environment may have this slope [rad].
    pub fn has_slope(&self, slope_rad: f64) -> bool {
        let varied = self.slope_rad.is_some_and(|[low, high]| (low..=high).contains(&slope_rad));
        slope_rad == self.own_slope_rad || varied
    }

    /// The slope at `place` in [0, 1) of all variations [rad]; none if slopes do not vary.
    ///
    /// ```text
    /// slope = low + (high - low) place / share   where place < share, else the task's own
    /// ```
    ///
    /// Source: our definition.
    pub fn slope_rad(&self, place: f64) -> Option<f64> {
        let [low, high] = self.slope_rad?;
        Some(if place < self.share { low + (high - low) * place / self.share } else { self.own_slope_rad })
    }
}

/// Two numbers of which the first is the lesser one.
pub(crate) fn interval(path: &str, values: &[f64], problems: &mut Problems) -> Option<[f64; 2]> {
    let [low, high] = *values else {
        problems.at(path, "expected a least and a greatest value");
        return None;
    };
    if low >= high {
        problems.at(path, format!("{low} is not less than {high}"));
        return None;
    }
    Some([low, high])
}
