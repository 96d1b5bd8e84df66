//! The preset's task on level ground: the same work for canter and for its peers.

use canter_sim::settings::Document;
use canter_sim::{Env, Task};
use canter_train::config::{ConfigError, EvaluationSettings, Resolved, open_preset, resolve};
use canter_train::evaluate::{Conditions, Mover, Starts, run_episodes};
use canter_train::executor::Workers;
use canter_train::statistics::mean;

/// The preset whose costs are measured.
pub const PRESET: &str = "doggo";

/// Row of the evaluation's starts at which the time to a speed is measured: `canter eval` uses row 0.
const STARTS_ROW: u64 = 1;

/// The preset with other values at some keys.
///
/// # Errors
/// Whatever is wrong with the preset's file.
pub fn document(overrides: &[(&str, String)]) -> Result<Document, ConfigError> {
    let mut document = open_preset(PRESET)?;
    for (key, value) in overrides {
        document.set(key, value);
    }
    Ok(document)
}

/// The preset's configuration and task without slopes, whatever its training varies.
///
/// # Errors
/// Whatever is wrong with the configuration.
pub fn resolve_on_level_ground(overrides: &[(&str, String)]) -> Result<Resolved, ConfigError> {
    let mut document = document(overrides)?;
    document.set("task.slope_deg", "0.0");
    document.set("task.variation", "{}");
    resolve(&document)
}

/// The preset's evaluation, from starts of its own and with the training's physics step: the peers have no other.
pub fn conditions(resolved: &Resolved) -> Conditions {
    let physics_dt_s = resolved.task.settings.physics_dt_s;
    let conditions = Conditions::from(&EvaluationSettings { physics_dt_s, ..resolved.config.evaluation.clone() });
    Conditions { starts: Starts { row: STARTS_ROW, ..conditions.starts }, ..conditions }
}

/// The speed of the fastest default gait [m/s].
pub fn default_speed(resolved: &Resolved, workers: &Workers) -> f64 {
    let (task, conditions) = (&resolved.task, conditions(resolved));
    let gaits = task.robot.default_gaits().filter_map(|gait| task.with_gait(&gait.name));
    gaits.map(|task| speed(&task, Mover::Prior, &conditions, workers)).fold(f64::NEG_INFINITY, f64::max)
}

/// Mean forward speed over an evaluation's episodes [m/s].
pub fn speed(task: &Task, mover: Mover<'_>, conditions: &Conditions, workers: &Workers) -> f64 {
    let episodes = run_episodes(task, Env::new, mover, conditions.clone(), workers);
    mean(&episodes.iter().map(|episode| episode.speed_m_per_s).collect::<Vec<_>>())
}
