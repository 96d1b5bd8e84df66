//! The settings that the tests share, and a file that holds them all.

use super::{Document, Problems, above};
use crate::{choices, settings, tagged};

mod overrides;
mod reading;
mod robustness;
mod writing;

choices! {
    /// Which legs move together.
    pub enum Footfall {
        /// Diagonal pairs.
        Trot = "trot",
        /// Front and rear pairs.
        Bound = "bound",
    }
}

settings! {
    /// A sine.
    pub struct SineSettings {
        /// Amplitude of the swing [rad].
        pub swing_amplitude_rad: f64 in 0.0..1.5,
        /// Offset per leg [cycles].
        pub phase_offsets: Vec<f64> in 0.0..1.0,
    }
}

settings! {
    /// A table of actuator targets.
    pub struct TableSettings {
        /// The CSV file.
        pub file: String,
    }
}

tagged! {
    /// The gait without the policy.
    pub enum PriorSettings {
        /// Equation 4.
        Sine(SineSettings) = "sine",
        /// Any hand-made gait.
        Table(TableSettings) = "table",
    }
}

settings! {
    /// One leg.
    pub struct LegSettings {
        /// Name of the foot's geom.
        pub foot: String,
        /// Lengths from hip to foot [m].
        pub link_lengths_m: Vec<f32> in above(0.0),
        pub mount: Option<MountSettings>,
    }
}

settings! {
    /// Where a leg is fixed.
    pub struct MountSettings {
        /// Position on the body.
        pub position_m: f64,
    }
}

settings! {
    /// All sorts of settings.
    pub struct AllSettings {
        /// Discount factor per env step. Close to 1 for long horizons, that is when the reward of an
        /// action comes many steps later.
        ///
        /// See the paper.
        pub gamma: f64 in 0.0..=1.0,
        /// The gait.
        pub prior: PriorSettings,
        /// Passes over one rollout.
        pub num_epochs: u32 in 1..=100,
        /// Clip range of eq. 3.
        pub clip_epsilon: Option<f64> in 0.0..=1.0,
        /// Seed of every stream.
        pub seed: u64,
        /// Offset.
        pub offset: i64 in ..10,
        /// Environments.
        pub num_envs: usize in 1..,
        /// Learning rate.
        pub learning_rate: f32 in above(0.0),
        /// Adapt?
        pub is_adaptive: bool,
        pub label: String,
        /// Which legs move together.
        pub footfall: Footfall,
        /// Layers.
        pub widths: Vec<u32> in 1..=1024,
        /// Matrix.
        pub matrix: Vec<Vec<f64>>,
        /// The legs, front left first.
        pub legs: Vec<LegSettings>,
        /// Names.
        pub names: Option<Vec<String>>,
    }
}

const VALID: &str = r#"gamma = 0.99
num_epochs = 5
seed = 18446744073709551615
offset = -3
num_envs = 0x10
learning_rate = 1
is_adaptive = true
label = "a \"b\" \u007F ü"
footfall = "trot"
widths = [64, 128]
matrix = [[1.0, 2], []]

[prior]
kind = "sine"
swing_amplitude_rad = 0.4
phase_offsets = [0, 0.5]

[[legs]]
foot = "FL"
link_lengths_m = [0.09, 0.16]

[[legs]]
foot = "FR"
link_lengths_m = [0.09, 0.16]
mount.position_m = 1e-7
"#;

/// The settings of `text`, in a file `doggo.toml`.
fn read(text: &str) -> Result<AllSettings, Problems> {
    Document::parse("doggo.toml", text.as_bytes())?.read()
}

/// The report on [`VALID`] after each `(old, new)` replacement.
fn report(replacements: &[(&str, &str)]) -> String {
    let mut text = VALID.to_owned();
    for (old, new) in replacements {
        assert!(text.contains(old), "{old}");
        text = text.replacen(old, new, 1);
    }
    read(&text).unwrap_err().to_string()
}
