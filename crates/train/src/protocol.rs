//! What decides the numbers of an evaluation.

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};

use canter_sim::ground::GroundSettings;
use canter_sim::{Task, TaskSettings};
use serde::Serialize;

use crate::config::EvaluationSettings;

/// What decides the numbers of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProtocolCard {
    /// Name of the robot.
    pub robot: String,
    /// Episodes of each gait.
    pub num_episodes: usize,
    /// Length of an episode [s].
    pub episode_s: f64,
    /// The speed counts from here on [s].
    pub settle_s: f64,
    /// Time of one physics step [s].
    pub physics_dt_s: f64,
    /// Seed of the starts.
    pub seed: u64,
    /// Slope of the ground, positive uphill [deg].
    pub slope_deg: f64,
    /// Sliding friction; none: the model's own.
    pub friction: Option<f64>,
    /// What else of the world is not as it is by itself: the task's own values, by their keys.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub changed: BTreeMap<&'static str, Changed>,
}

impl ProtocolCard {
    /// What decides the numbers of an evaluation of a task.
    pub fn new(task: &Task, settings: &EvaluationSettings) -> Self {
        Self {
            robot: task.robot.settings.name.clone(),
            num_episodes: settings.num_episodes,
            episode_s: settings.episode_s,
            settle_s: settings.settle_s,
            physics_dt_s: settings.physics_dt_s,
            seed: settings.seed,
            slope_deg: task.settings.slope_deg,
            friction: task.settings.friction,
            changed: changed_world(&task.settings),
        }
    }
}

/// A value of a task: a number, or a least and a greatest one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Changed {
    /// A number.
    Number(f64),
    /// A range.
    Range([f64; 2]),
}

impl Display for Changed {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Range([low, high]) => write!(f, "{low} to {high}"),
        }
    }
}

/// The task's values, by their keys, that make its world another than level ground and the robot as it is; slope along
/// the way and friction have places of their own.
fn changed_world(settings: &TaskSettings) -> BTreeMap<&'static str, Changed> {
    let on_ground = settings.ground.clone().unwrap_or_else(GroundSettings::smooth);
    let GroundSettings { roughness, correlation_length, curb_height, curb_length, patch_friction, patch_length } =
        on_ground;
    let numbers = [
        ("cross_slope_deg", settings.cross_slope_deg),
        ("mass_factor", settings.mass_factor),
        ("strength_factor", settings.strength_factor),
        ("delay_s", settings.delay_s),
        ("ground.roughness", roughness),
        ("ground.correlation_length", correlation_length),
        ("ground.curb_height", curb_height),
        ("ground.curb_length", curb_length),
        ("ground.patch_length", patch_length),
    ];
    let numbers = numbers.into_iter().filter_map(|(key, value)| Some((key, Changed::Number(value?))));
    let patch_friction = patch_friction.and_then(|range| <[f64; 2]>::try_from(range).ok());
    numbers.chain(patch_friction.map(|range| ("ground.patch_friction", Changed::Range(range)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{open_preset, resolve};

    #[test]
    fn everything_that_changes_the_world_is_named() {
        let changed = |changes: &[(&str, &str)]| {
            let mut document = open_preset("doggo").unwrap();
            for (key, value) in changes {
                document.set(key, value);
            }
            let resolved = resolve(&document).unwrap();
            serde_json::to_value(ProtocolCard::new(&resolved.task, &resolved.config.evaluation)).unwrap()
        };
        assert_eq!(changed(&[]).get("changed"), None);
        let values = [
            ("cross_slope_deg", "4.0"),
            ("mass_factor", "1.1"),
            ("strength_factor", "0.9"),
            ("delay_s", "0.02"),
            ("ground.roughness", "0.1"),
            ("ground.correlation_length", "2.0"),
            ("ground.curb_height", "0.05"),
            ("ground.curb_length", "4.0"),
            ("ground.patch_friction", "[0.6, 1.0]"),
            ("ground.patch_length", "1.0"),
        ];
        let keys = values.map(|(key, value)| (format!("task.{key}"), value));
        let card = changed(&keys.each_ref().map(|(key, value)| (key.as_str(), *value)));
        let written = card["changed"].as_object().unwrap();
        assert_eq!(written.len(), values.len());
        for (key, value) in values {
            assert_eq!(written[key], serde_json::from_str::<serde_json::Value>(value).unwrap(), "{key}");
        }
    }
}
