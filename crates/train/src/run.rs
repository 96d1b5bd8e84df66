//! The training loop.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use canter_learn::metrics::UpdateMetrics;
use canter_learn::ppo::Divergence;
use canter_sim::Accident;
use serde_json::{Value, json};

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::config::Resolved;
use crate::evaluate::{Verdict, judge};
use crate::executor::Workers;
use crate::policy_file::PolicyFile;
use crate::ranks::{RanksError, agree};
use crate::run_directory::{RunDirectory, RunError, trajectory_folder, write_json, write_trajectory};
use crate::tensorboard::EventFile;
use crate::trainer::{IterationReport, Trainer};
use crate::trajectory::record_all;

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
    /// Its checkpoint cannot be used.
    #[error("this checkpoint cannot be used: {0}")]
    Checkpoint(#[from] CheckpointError),
    /// The numbers went out of bounds too often.
    #[error("{0}. It was undone and tried again with smaller steps before; what was saved until then is good")]
    Diverged(#[from] Divergence),
    /// The ranks no longer train the same.
    #[error(transparent)]
    Ranks(#[from] RanksError),
}

impl TrainError {
    /// Whether every rank has come to this error; else the others go on, and wait for this one in vain.
    pub fn is_on_every_rank(&self) -> bool {
        matches!(self, Self::Diverged(_) | Self::Ranks(_))
    }
}

/// What an iteration of a training brought, and where its blow-ups were dumped.
#[derive(Debug)]
pub struct Observed<'a> {
    /// The iteration.
    pub report: &'a IterationReport,
    /// Files that `canter replay` reads.
    pub dumps: Vec<PathBuf>,
}

/// Puts a new training where the newest good checkpoint of its run has it; at its start, if nothing was saved yet.
///
/// Returns which damaged checkpoints were skipped, and why.
///
/// # Errors
/// All checkpoints are damaged, or are of another configuration or robot.
pub fn pick_up(trainer: &mut Trainer, directory: &RunDirectory) -> Result<Vec<String>, TrainError> {
    Ok(pick_up_checkpoint(trainer, directory)?.1)
}

/// Does what [`pick_up`] does and returns the checkpoint too, for the other ranks.
///
/// # Errors
/// As [`pick_up`].
pub fn pick_up_checkpoint(
    trainer: &mut Trainer,
    directory: &RunDirectory,
) -> Result<(Option<Checkpoint>, Vec<String>), TrainError> {
    if !directory.has_progress() {
        return Ok((None, Vec::new()));
    }
    let (checkpoint, skipped) = directory.newest_checkpoint()?;
    checkpoint.restore(trainer)?;
    directory.truncate_metrics(checkpoint.iterations())?;
    Ok((Some(checkpoint), skipped))
}

/// What rank 0 writes while it trains.
struct Record<'a> {
    directory: &'a RunDirectory,
    events: EventFile,
    observe: &'a mut dyn FnMut(Observed<'_>),
}

impl Record<'_> {
    /// Writes down an iteration.
    fn append(&mut self, report: &IterationReport) -> Result<(), RunError> {
        let metrics = metrics(report);
        self.directory.append_metrics(&metrics)?;
        self.events.append(&metrics)?;
        let dumps = report.blow_ups.iter().map(|blow_up| self.directory.write_blow_up(blow_up));
        let dumps = dumps.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        (self.observe)(Observed { report, dumps });
        Ok(())
    }
}

/// Trains until the end, or until `stop`; saves at intervals and at either end. `observe` sees every iteration.
///
/// On several ranks this is rank 0's part, and the others [`follow`].
///
/// # Errors
/// No room for what it will write, a file that cannot be written, or too many diverged updates; what was saved before
/// stays good.
pub fn train(
    trainer: &mut Trainer,
    directory: &RunDirectory,
    workers: &Workers,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(Observed<'_>),
) -> Result<Ending, TrainError> {
    let checkpoint = Checkpoint::of(trainer);
    directory.check_room(&checkpoint)?;
    if trainer.progress().iterations == 0 {
        // So that a run which is killed early can go on.
        directory.write_checkpoint(&checkpoint)?;
    }
    let record = Record { directory, events: directory.open_events()?, observe };
    let ending = iterate_to_the_end(trainer, workers, stop, Some(record))?;
    if ending == Ending::Finished {
        directory.write_policy(&PolicyFile::of(trainer))?;
    }
    Ok(ending)
}

/// Trains with rank 0, which [`train`]s and writes; nothing is written here.
///
/// # Errors
/// Those that every rank comes to.
pub fn follow(trainer: &mut Trainer, workers: &Workers, stop: &AtomicBool) -> Result<Ending, TrainError> {
    // Rank 0 looks whether there is room for it.
    Checkpoint::of(trainer);
    iterate_to_the_end(trainer, workers, stop, None)
}

/// The loop, the same on every rank; only rank 0 has a record to write.
fn iterate_to_the_end(
    trainer: &mut Trainer,
    workers: &Workers,
    stop: &AtomicBool,
    mut record: Option<Record<'_>>,
) -> Result<Ending, TrainError> {
    let save = |trainer: &Trainer, record: &Option<Record<'_>>| {
        let checkpoint = Checkpoint::of(trainer);
        record.as_ref().map_or(Ok(()), |record| record.directory.write_checkpoint(&checkpoint))
    };
    let interval = trainer.resolved().config.training.checkpoint_env_steps;
    let mut next_checkpoint = trainer.progress().env_steps + interval;
    while !trainer.is_finished() {
        let report = trainer.iterate(workers)?;
        if let Some(record) = &mut record {
            record.append(&report)?;
        }
        let is_stopped = agree(trainer, stop.load(Ordering::Relaxed))? && !trainer.is_finished();
        if is_stopped || report.progress.env_steps >= next_checkpoint {
            save(trainer, &record)?;
            next_checkpoint = report.progress.env_steps + interval;
        }
        if is_stopped {
            return Ok(Ending::Stopped);
        }
    }
    save(trainer, &record)?;
    Ok(Ending::Finished)
}

/// Judges a policy that has been trained in `folder` and records its episodes; leaves `trajectories/` and then `eval.json`,
/// with which the run is complete. Returns the verdict and what stands in the file.
///
/// # Errors
/// A file that cannot be written.
pub fn judge_trained(
    folder: &Path,
    resolved: &Resolved,
    policy: &PolicyFile,
    workers: &Workers,
) -> Result<(Verdict, Value), RunError> {
    let (task, evaluation, prior) = (&resolved.task, &resolved.config.evaluation, &resolved.config.policy.prior);
    let policy = policy.policy();
    let verdict = judge(task, prior, Some(&policy), evaluation, workers);
    for trajectory in record_all(task, prior, Some(&policy), evaluation, workers) {
        write_trajectory(&trajectory_folder(folder), &trajectory)?;
    }
    let json = serde_json::to_value(&verdict).expect("a verdict has string keys only");
    write_json(&folder.join("eval.json"), &json)?;
    Ok((verdict, json))
}

/// The line of `metrics.jsonl` for an iteration; `docs/metrics.md` defines its numbers.
pub fn metrics(report: &IterationReport) -> Value {
    let num_episodes = report.episodes.len();
    // A mean over no episodes is null, not zero.
    let mean = |total: f64| (num_episodes > 0).then(|| total / num_episodes as f64);
    let accidents: serde_json::Map<String, Value> = Accident::ALL
        .iter()
        .zip(report.accidents)
        .map(|(accident, count)| (accident.name().to_owned(), json!(count)))
        .collect();
    // An update that diverged was undone: it has no numbers.
    let update = |number: fn(&UpdateMetrics) -> f64| report.update.as_ref().ok().map(number);
    json!({
        "iteration": report.progress.iterations,
        "env_steps": report.progress.env_steps,
        "episodes": report.progress.episodes,
        "episode_return": mean(report.episodes.iter().map(|episode| episode.episode_return).sum()),
        "episode_length": mean(report.episodes.iter().map(|episode| episode.episode_length as f64).sum()),
        "accidents": accidents,
        "speed_m_per_s": report.speed_m_per_s,
        "power_w": report.power_w,
        "difficulty": report.difficulty,
        "mean_std": report.mean_std,
        "policy_loss": update(|update| update.policy_loss),
        "value_loss": update(|update| update.value_loss),
        "entropy": update(|update| update.entropy),
        "approx_kl": update(|update| update.approx_kl),
        "clip_fraction": update(|update| update.clip_fraction),
        "explained_variance": report.update.as_ref().ok().and_then(|update| update.explained_variance),
        "gradient_norm": update(|update| update.gradient_norm),
        "divergences": report.progress.divergences,
        "learning_rate": update(|update| update.learning_rate),
        "collect_s": report.collect_s,
        "update_s": report.update_s,
    })
}
