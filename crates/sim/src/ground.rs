//! What lies on the ground.

use crate::settings;

settings! {
    /// What lies on the ground, anew in each episode.
    pub struct GroundSettings {
        /// Height of the highest bump above the deepest dent, in stance heights; absent: smooth.
        pub roughness: Option<f64> in 0.0..=1.0,
    }
}
