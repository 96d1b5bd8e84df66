//! One training of a job, and the JSON files that jobs leave.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{JobsError, Watch};
use crate::config::Resolved;
use crate::executor::Workers;
use crate::policy_file::PolicyFile;
use crate::run::{Ending, pick_up, train};
use crate::run_directory::{self, RunDirectory, RunError, io_error, policy_path, read_config, read_policy};
use crate::tensors::read_file;
use crate::trainer::Trainer;

/// Trains, from wherever the folder's run has come to; none if it was asked to stop.
pub(crate) fn learn(
    resolved: Resolved,
    folder: &Path,
    watch: Watch<'_>,
    workers: &Workers,
) -> Result<Option<PolicyFile>, JobsError> {
    let rollout = (resolved.config.training.num_environments * resolved.config.training.horizon) as u64;
    let is_begun = folder.join("config.toml").is_file();
    if is_begun && read_config(folder)?.config != resolved.config {
        return Err(JobsError::OtherConfiguration(folder.to_owned()));
    }
    let budget = resolved.config.training.max_env_steps;
    if policy_path(folder).is_file() {
        watch.meter.skip(budget);
        let policy = read_policy(folder)?;
        let checked = policy.check(&resolved.task);
        checked.map_err(|source| RunError::Policy { path: policy_path(folder), source })?;
        return Ok(Some(policy));
    }
    let directory = if is_begun {
        RunDirectory::open(folder)?
    } else {
        // A process that was killed here before it wrote the configuration has left nothing of worth.
        if folder.exists() {
            fs::remove_dir_all(folder).map_err(|source| io_error(folder, source))?;
        }
        RunDirectory::create(Some(folder), "", &resolved.config)?
    };
    let mut trainer = Trainer::new(resolved);
    pick_up(&mut trainer, &directory)?;
    watch.meter.skip(trainer.progress().env_steps);
    let ending = train(&mut trainer, &directory, workers, watch.stop, &mut |_| watch.meter.add(rollout))?;
    if ending == Ending::Stopped {
        return Ok(None);
    }
    watch.meter.add(budget.saturating_sub(trainer.progress().env_steps));
    Ok(Some(PolicyFile::of(&trainer)))
}

/// The value in a JSON file; none if there is no file.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, JobsError> {
    let bytes = match read_file(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(io_error(path, source).into()),
    };
    let broken = |source| JobsError::Broken { path: PathBuf::from(path), source };
    serde_json::from_slice(&bytes).map(Some).map_err(broken)
}

/// The error that a JSON file holds what cannot be.
pub(crate) fn wrong(path: &Path) -> impl FnOnce(String) -> JobsError {
    move |what| JobsError::Wrong { path: path.to_owned(), what }
}

/// Writes a JSON file whole, its keys sorted.
pub(crate) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), JobsError> {
    let value = serde_json::to_value(value).expect("its keys are strings");
    Ok(run_directory::write_json(path, &value)?)
}
