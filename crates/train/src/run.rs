//! The training loop.

use std::sync::atomic::{AtomicBool, Ordering};

use canter_learn::ppo::Divergence;
use canter_sim::Accident;
use serde_json::{Value, json};

use crate::checkpoint::Checkpoint;
use crate::executor::Workers;
use crate::policy_file::PolicyFile;
use crate::run_directory::{RunDirectory, RunError};
use crate::trainer::{IterationReport, Trainer};

/// How a training came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All env steps or episodes are done.
    Finished,
    /// It was asked to stop; it can go on from here.
    Stopped,
}

/// Why a training broke off.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A file could not be written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The numbers went out of bounds.
    #[error(transparent)]
    Diverged(#[from] Divergence),
}

/// Trains until the end, or until `stop`; saves at intervals and at either end. `observe` sees every iteration.
///
/// # Errors
/// A file that cannot be written, or a diverged update; what was saved before stays good.
pub fn train(
    trainer: &mut Trainer,
    directory: &RunDirectory,
    workers: &Workers,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(&IterationReport),
) -> Result<Ending, TrainError> {
    if trainer.progress().iterations == 0 {
        // So that a run which is killed early can go on.
        directory.write_checkpoint(&Checkpoint::of(trainer))?;
    }
    let interval = trainer.resolved().config.training.checkpoint_env_steps;
    let mut events = directory.open_events()?;
    let mut next_checkpoint = trainer.progress().env_steps + interval;
    while !trainer.is_finished() {
        let report = trainer.iterate(workers)?;
        let metrics = metrics(&report);
        directory.append_metrics(&metrics)?;
        events.append(&metrics)?;
        observe(&report);
        let is_stopped = stop.load(Ordering::Relaxed) && !trainer.is_finished();
        if is_stopped || report.progress.env_steps >= next_checkpoint {
            directory.write_checkpoint(&Checkpoint::of(trainer))?;
            next_checkpoint = report.progress.env_steps + interval;
        }
        if is_stopped {
            return Ok(Ending::Stopped);
        }
    }
    directory.write_checkpoint(&Checkpoint::of(trainer))?;
    directory.write_policy(&PolicyFile::of(trainer))?;
    Ok(Ending::Finished)
}

/// The line of `metrics.jsonl` for an iteration; `docs/metrics.md` defines its numbers.
fn metrics(report: &IterationReport) -> Value {
    let num_episodes = report.episodes.len();
    // A mean over no episodes is null, not zero.
    let mean = |total: f64| (num_episodes > 0).then(|| total / num_episodes as f64);
    let accidents: serde_json::Map<String, Value> = Accident::ALL
        .iter()
        .zip(report.accidents)
        .map(|(accident, count)| (accident.name().to_owned(), json!(count)))
        .collect();
    json!({
        "iteration": report.progress.iterations,
        "env_steps": report.progress.env_steps,
        "episodes": report.progress.episodes,
        "episode_return": mean(report.episodes.iter().map(|episode| episode.episode_return).sum()),
        "episode_length": mean(report.episodes.iter().map(|episode| episode.episode_length as f64).sum()),
        "accidents": accidents,
        "speed_m_per_s": report.speed_m_per_s,
        "power_w": report.power_w,
        "mean_std": report.mean_std,
        "policy_loss": report.update.policy_loss,
        "value_loss": report.update.value_loss,
        "entropy": report.update.entropy,
        "approx_kl": report.update.approx_kl,
        "clip_fraction": report.update.clip_fraction,
        "explained_variance": report.update.explained_variance,
        "gradient_norm": report.update.gradient_norm,
        "learning_rate": report.update.learning_rate,
        "collect_s": report.collect_s,
        "update_s": report.update_s,
    })
}
