//! The run directory: which files there are, and that each is written whole or not at all.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use canter_sim::Task;
use canter_sim::file;
use canter_sim::settings::{Document, write_commented};

use crate::blow_up::BlowUp;
use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::config::{ConfigError, Resolved, RunConfig, resolve};
use crate::policy_file::{PolicyError, PolicyFile};
use crate::tensorboard::EventFile;
use crate::tensors::{MAX_FILE_BYTES, read_file};
use crate::trajectory::Trajectory;

/// Endings of files that a writer has not finished.
const TEMPORARY_ENDING: &str = "tmp";

/// The file that a writer holds locked.
const LOCK_NAME: &str = "lock";

/// More of `metrics.jsonl` or the event file is not read: a million iterations have as much [bytes].
pub(crate) const MAX_LOG_BYTES: u64 = 1 << 30;

/// Checkpoints that are kept; older ones are removed.
const KEPT_CHECKPOINTS: usize = 3;

/// Dumps of blow-ups that are kept: the first ones tell as much as all.
const MAX_DUMPS: usize = 20;

/// Room for everything but checkpoints that a training is not begun without [bytes]: a policy, trajectories and a report.
const ROOM_FOR_RESULTS: u64 = 8 << 20;

/// Why a run directory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Reading or writing failed.
    #[error("{}: {source}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The disk is full.
    #[error("{}: no room left on the disk; make some and go on with `canter resume RUN`, nothing that was saved is lost", .0.display())]
    Full(PathBuf),
    /// The disk would be full before the training ends.
    #[error(
        "{}: {} MB are free here, a training needs {} MB for its checkpoints and results: make room or choose another \
         folder with --out",
        .path.display(), .free >> 20, (.needed >> 20) + 1
    )]
    NoRoom {
        /// The run's folder.
        path: PathBuf,
        /// What is free [bytes].
        free: u64,
        /// What is needed [bytes].
        needed: u64,
    },
    /// No checkpoint of the training could be read again.
    #[error(
        "{}: a checkpoint of this training has {} MiB, more than the {} that are read: fewer environments, or a model that \
         keeps less state",
        .path.display(), .bytes >> 20, MAX_FILE_BYTES >> 20
    )]
    TooLarge {
        /// The folder of the checkpoints.
        path: PathBuf,
        /// Size of a checkpoint [bytes].
        bytes: u64,
    },
    /// Something else is there already.
    #[error("{}: this folder is not empty; choose another with --out, or go on with `canter resume {}`", .0.display(), .0.display())]
    NotEmpty(PathBuf),
    /// Not a run directory.
    #[error("{}: no run directory: it has no {missing}", .path.display())]
    NotARun {
        /// What was given.
        path: PathBuf,
        /// The file that is missing.
        missing: &'static str,
    },
    /// Nothing to run yet.
    #[error("{}: no policy yet, the training has not ended; `canter resume {}` goes on with it", .0.display(), .0.display())]
    NoPolicy(PathBuf),
    /// Another process is at work.
    #[error("{}: another canter is writing into this run", .0.display())]
    Locked(PathBuf),
    /// The configuration is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The policy cannot be used.
    #[error("{}: this policy cannot be used: {source}", .path.display())]
    Policy {
        /// The file.
        path: PathBuf,
        /// Why.
        source: PolicyError,
    },
    /// The dump of a blow-up cannot be used.
    #[error("{}: this dump cannot be used: {source}", .path.display())]
    Dump {
        /// The file.
        path: PathBuf,
        /// Why.
        source: CheckpointError,
    },
    /// No checkpoint can be used.
    #[error("{}: no checkpoint to go on from: {reason}", .path.display())]
    NoCheckpoint {
        /// The folder of the checkpoints.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// A run's folder, see `docs/run-directory.md`.
#[derive(Debug)]
pub struct RunDirectory {
    path: PathBuf,
    /// Held while this process writes into the folder.
    _lock: File,
}

impl RunDirectory {
    /// Makes the folder of a new run and writes its resolved configuration.
    ///
    /// A folder in which a process was killed before it had written that is as good as empty. Without `path` the folder is `runs/<preset>-<seed>-<n>` in the working directory, with the first free n.
    ///
    /// # Errors
    /// A folder that is not empty, or cannot be written.
    pub fn create(path: Option<&Path>, preset: &str, config: &RunConfig) -> Result<Self, RunError> {
        let path = match path {
            Some(path) => {
                fs::create_dir_all(path).map_err(|source| io_error(path, source))?;
                check_empty(path)?;
                path.to_owned()
            }
            None => create_numbered(Path::new("runs"), &format!("{preset}-{}", config.seed))?,
        };
        let directory = Self::lock(&path)?;
        // Another process may have been here since.
        check_empty(&path)?;
        write_whole(&directory.config_path(), write_commented(config).as_bytes())?;
        Ok(directory)
    }

    /// Opens a run that is to go on.
    ///
    /// # Errors
    /// No run directory there, or another process writes into it.
    pub fn open(path: &Path) -> Result<Self, RunError> {
        if !config_path(path).is_file() {
            return Err(RunError::NotARun { path: path.to_owned(), missing: "config.toml" });
        }
        let directory = Self::lock(path)?;
        for folder in [path.to_owned(), directory.checkpoint_folder(), directory.dump_folder(), trajectory_folder(path)]
        {
            for entry in folder.read_dir().into_iter().flatten().flatten() {
                if is_temporary(&entry.path()) {
                    // Left by a process that was killed while it wrote.
                    let _ = fs::remove_file(entry.path());
                }
            }
        }
        Ok(directory)
    }

    fn lock(path: &Path) -> Result<Self, RunError> {
        Ok(Self { path: path.to_owned(), _lock: lock_folder(path)? })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn config_path(&self) -> PathBuf {
        config_path(&self.path)
    }

    fn checkpoint_folder(&self) -> PathBuf {
        self.path.join("checkpoints")
    }

    fn dump_folder(&self) -> PathBuf {
        self.path.join("dumps")
    }

    fn metrics_path(&self) -> PathBuf {
        self.path.join("metrics.jsonl")
    }

    /// Writes a JSON file, e.g. `eval.json`.
    ///
    /// # Errors
    /// The system's.
    pub fn write_json(&self, name: &str, value: &serde_json::Value) -> Result<(), RunError> {
        write_json(&self.path.join(name), value)
    }

    /// Writes `policy.safetensors`.
    ///
    /// # Errors
    /// The system's.
    pub fn write_policy(&self, policy: &PolicyFile) -> Result<(), RunError> {
        write_whole(&policy_path(&self.path), &policy.to_bytes())
    }

    /// Checks that there is room for a training whose checkpoints are like this one.
    ///
    /// # Errors
    /// There is not, or the system does not tell.
    pub fn check_room(&self, checkpoint: &Checkpoint) -> Result<(), RunError> {
        // One more than are kept: an old one is removed after a new one is whole.
        let checkpoint_bytes = checkpoint.to_bytes().len() as u64;
        if checkpoint_bytes > MAX_FILE_BYTES {
            return Err(RunError::TooLarge { path: self.checkpoint_folder(), bytes: checkpoint_bytes });
        }
        let needed = (KEPT_CHECKPOINTS as u64 + 1) * checkpoint_bytes + ROOM_FOR_RESULTS;
        let system = rustix::fs::statvfs(&self.path).map_err(|error| io_error(&self.path, error.into()))?;
        let free = system.f_bavail * system.f_frsize;
        if free < needed { Err(RunError::NoRoom { path: self.path.clone(), free, needed }) } else { Ok(()) }
    }

    /// Writes what led to a blow-up and returns where; nothing if there are enough of them.
    ///
    /// # Errors
    /// The system's.
    pub fn write_blow_up(&self, blow_up: &BlowUp) -> Result<Option<PathBuf>, RunError> {
        let folder = self.dump_folder();
        fs::create_dir_all(&folder).map_err(|source| io_error(&folder, source))?;
        if folder.read_dir().map_err(|source| io_error(&folder, source))?.count() >= MAX_DUMPS {
            return Ok(None);
        }
        let path = folder.join(format!("{:08}-{}.safetensors", blow_up.iteration, blow_up.environment));
        write_whole(&path, &blow_up.to_bytes())?;
        Ok(Some(path))
    }

    /// Writes a checkpoint and removes the oldest ones.
    ///
    /// # Errors
    /// The system's.
    pub fn write_checkpoint(&self, checkpoint: &Checkpoint) -> Result<(), RunError> {
        let folder = self.checkpoint_folder();
        fs::create_dir_all(&folder).map_err(|source| io_error(&folder, source))?;
        let path = folder.join(format!("{:08}.safetensors", checkpoint.iterations()));
        write_whole(&path, &checkpoint.to_bytes())?;
        let checkpoints = self.checkpoints()?;
        for old in checkpoints.iter().rev().skip(KEPT_CHECKPOINTS) {
            fs::remove_file(old).map_err(|source| io_error(old, source))?;
        }
        Ok(())
    }

    /// Paths of the checkpoints, oldest first.
    fn checkpoints(&self) -> Result<Vec<PathBuf>, RunError> {
        let folder = self.checkpoint_folder();
        let entries = folder.read_dir().map_err(|source| io_error(&folder, source))?;
        let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "safetensors"));
        paths.sort();
        Ok(paths)
    }

    /// Whether anything was saved yet: a process may have been killed before its first checkpoint.
    pub fn has_progress(&self) -> bool {
        self.metrics_path().exists() || self.checkpoints().is_ok_and(|checkpoints| !checkpoints.is_empty())
    }

    /// The newest checkpoint that can be read, and the newer ones that cannot, with the reason.
    ///
    /// # Errors
    /// None can be read.
    pub fn newest_checkpoint(&self) -> Result<(Checkpoint, Vec<String>), RunError> {
        let mut skipped = Vec::new();
        let paths = self.checkpoints().unwrap_or_default();
        for path in paths.iter().rev() {
            let checkpoint =
                read_file(path).map_err(CheckpointError::from).and_then(|bytes| Checkpoint::from_bytes(&bytes));
            match checkpoint {
                Ok(checkpoint) => return Ok((checkpoint, skipped)),
                Err(error) => skipped.push(format!("{}: {error}", path.display())),
            }
        }
        let reason = if skipped.is_empty() { "there is none".to_owned() } else { skipped.join("; ") };
        Err(RunError::NoCheckpoint { path: self.checkpoint_folder(), reason })
    }

    /// Appends one line to `metrics.jsonl`.
    ///
    /// # Errors
    /// The system's.
    pub fn append_metrics(&self, metrics: &serde_json::Value) -> Result<(), RunError> {
        let path = self.metrics_path();
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let written = file.and_then(|mut file| file.write_all(format!("{metrics}\n").as_bytes()));
        written.map_err(|source| io_error(&path, source))
    }

    /// Opens the event file for TensorBoard, made to hold what `metrics.jsonl` does.
    ///
    /// # Errors
    /// The system's.
    pub fn open_events(&self) -> Result<EventFile, RunError> {
        let path = self.metrics_path();
        let metrics = read_metrics(&path)?.unwrap_or_default();
        EventFile::open(&self.path, &metrics)
    }

    /// Drops the lines of `metrics.jsonl` that come after an iteration: a resumed run writes them again.
    ///
    /// # Errors
    /// The system's.
    pub fn truncate_metrics(&self, iterations: u64) -> Result<(), RunError> {
        let path = self.metrics_path();
        let Some(text) = read_metrics(&path)? else { return Ok(()) };
        let is_kept = |line: &&str| {
            let metrics = serde_json::from_str::<serde_json::Value>(line).ok();
            metrics.is_some_and(|metrics| metrics["iteration"].as_u64().is_some_and(|number| number <= iterations))
        };
        let kept: String = text.lines().filter(is_kept).map(|line| format!("{line}\n")).collect();
        write_whole(&path, kept.as_bytes())
    }
}

/// The configuration of a run, whose values may still be overridden.
///
/// # Errors
/// No run there, or a configuration that is not TOML.
pub fn open_config(run: &Path) -> Result<Document, RunError> {
    let path = config_path(run);
    if !path.is_file() {
        return Err(RunError::NotARun { path: run.to_owned(), missing: "config.toml" });
    }
    Ok(Document::load(&path).map_err(ConfigError::from)?)
}

/// The configuration of a run, resolved again.
///
/// # Errors
/// No run there, or a configuration that no longer fits its robot.
pub fn read_config(run: &Path) -> Result<Resolved, RunError> {
    Ok(resolve(&open_config(run)?)?)
}

/// The policy of a run.
///
/// # Errors
/// No policy there yet, or one that cannot be used.
pub fn read_policy(run: &Path) -> Result<PolicyFile, RunError> {
    let path = policy_path(run);
    if !path.is_file() {
        return Err(RunError::NoPolicy(run.to_owned()));
    }
    let bytes = read_file(&path).map_err(|source| io_error(&path, source))?;
    PolicyFile::from_bytes(&bytes).map_err(|source| RunError::Policy { path, source })
}

/// The policy of a run, which has to be one for this task.
///
/// # Errors
/// No policy there yet, one that cannot be used, or one for another task.
pub fn read_policy_for(run: &Path, task: &Task) -> Result<PolicyFile, RunError> {
    let policy = read_policy(run)?;
    policy.check(task).map_err(|source| RunError::Policy { path: policy_path(run), source })?;
    Ok(policy)
}

/// What a run's `eval.json` says, as far as it can be read; none if the run was never judged.
///
/// # Errors
/// The system's.
pub fn read_eval(run: &Path) -> Result<Option<serde_json::Value>, RunError> {
    let path = run.join("eval.json");
    match read_file(&path) {
        Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok()),
        Err(source) if source.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(io_error(&path, source)),
    }
}

/// Writes a file whole or not at all, into a folder that is made if it is missing.
///
/// # Errors
/// The system's.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| io_error(folder, source))?;
    }
    write_whole(path, bytes)
}

/// Where a run's policy lies.
pub fn policy_path(run: &Path) -> PathBuf {
    run.join("policy.safetensors")
}

/// Writes `<name>.json` of a recorded episode into a folder, which is made if it is missing.
///
/// # Errors
/// The system's.
pub fn write_trajectory(folder: &Path, trajectory: &Trajectory) -> Result<(), RunError> {
    fs::create_dir_all(folder).map_err(|source| io_error(folder, source))?;
    let json = serde_json::to_string(trajectory).expect("a trajectory has string keys only");
    write_whole(&folder.join(format!("{}.json", trajectory.name)), format!("{json}\n").as_bytes())
}

/// Writes a JSON file whole, its keys sorted.
pub(crate) fn write_json(path: &Path, value: &serde_json::Value) -> Result<(), RunError> {
    write_whole(path, format!("{value:#}\n").as_bytes())
}

/// What led to a blow-up, and the run that it belongs to.
///
/// # Errors
/// No dump of a run there, or one that cannot be used.
pub fn read_blow_up(path: &Path) -> Result<(BlowUp, Resolved), RunError> {
    let bytes = read_file(path).map_err(|source| io_error(path, source))?;
    let blow_up = BlowUp::from_bytes(&bytes).map_err(|source| RunError::Dump { path: path.to_owned(), source })?;
    // RUN/dumps/NAME
    let full = path.canonicalize().map_err(|source| io_error(path, source))?;
    let run = full.ancestors().nth(2).unwrap_or(Path::new("."));
    Ok((blow_up, read_config(run)?))
}

/// Refuses a folder with anything in it but what a process that was killed at its start has left.
fn check_empty(path: &Path) -> Result<(), RunError> {
    let entries = path.read_dir().map_err(|source| io_error(path, source))?;
    let is_left_over = |path: &Path| path.file_name().is_some_and(|name| name == LOCK_NAME) || is_temporary(path);
    if entries.flatten().all(|entry| is_left_over(&entry.path())) {
        Ok(())
    } else {
        Err(RunError::NotEmpty(path.to_owned()))
    }
}

fn is_temporary(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == TEMPORARY_ENDING)
}

/// The content of a `metrics.jsonl`, if there is one, without the lines that are no text.
pub(crate) fn read_metrics(path: &Path) -> Result<Option<String>, RunError> {
    match file::read(path, MAX_LOG_BYTES) {
        Ok(bytes) => {
            let lines = bytes.split_inclusive(|&byte| byte == b'\n');
            Ok(Some(lines.filter_map(|line| std::str::from_utf8(line).ok()).collect()))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(io_error(path, source)),
    }
}

pub(crate) fn trajectory_folder(run: &Path) -> PathBuf {
    run.join("trajectories")
}

fn config_path(run: &Path) -> PathBuf {
    run.join("config.toml")
}

/// Holds a folder for this process, until the file is dropped.
///
/// Who looks whether a run is written (`canter serve`) holds its lock for a moment: one refusal is none.
pub(crate) fn lock_folder(path: &Path) -> Result<File, RunError> {
    const TRIES: u32 = 5;
    const PAUSE: Duration = Duration::from_millis(20);
    let lock_path = path.join(LOCK_NAME);
    let options = OpenOptions::new().create(true).append(true).open(&lock_path);
    let lock = options.map_err(|source| io_error(&lock_path, source))?;
    for number in 1..=TRIES {
        match lock.try_lock() {
            Ok(()) => return Ok(lock),
            Err(TryLockError::Error(source)) => return Err(io_error(&lock_path, source)),
            Err(TryLockError::WouldBlock) if number < TRIES => thread::sleep(PAUSE),
            Err(TryLockError::WouldBlock) => {}
        }
    }
    Err(RunError::Locked(path.to_owned()))
}

/// Makes `folder/<stem>-<n>` with the first free n.
pub(crate) fn create_numbered(folder: &Path, stem: &str) -> Result<PathBuf, RunError> {
    fs::create_dir_all(folder).map_err(|source| io_error(folder, source))?;
    let mut n = 1;
    loop {
        let path = folder.join(format!("{stem}-{n}"));
        match fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
            Err(source) => return Err(io_error(&path, source)),
        }
    }
}

/// Writes a file whole or not at all.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let mut file = UnfinishedFile::create(path)?;
    file.file.write_all(bytes).map_err(|source| io_error(path, source))?;
    file.finish()
}

/// A file that is written beside its place under a temporary name, and removed unless it is finished.
#[derive(Debug)]
pub(crate) struct UnfinishedFile {
    /// Where what is written goes.
    pub file: File,
    path: PathBuf,
    temporary: PathBuf,
}

impl UnfinishedFile {
    /// A new file that is to stand at `path`.
    pub fn create(path: &Path) -> Result<Self, RunError> {
        let mut temporary = path.as_os_str().to_owned();
        temporary.push(".");
        temporary.push(TEMPORARY_ENDING);
        let temporary = PathBuf::from(temporary);
        let file = File::create(&temporary).map_err(|source| io_error(path, source))?;
        Ok(Self { file, path: path.to_owned(), temporary })
    }

    /// Where the file stands until it is finished.
    pub fn temporary_path(&self) -> &Path {
        &self.temporary
    }

    /// Where the file is to stand.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Flushes the file to the disk and puts it into its place.
    pub fn finish(self) -> Result<(), RunError> {
        let finish = || {
            self.file.sync_all()?;
            fs::rename(&self.temporary, &self.path)?;
            // The rename itself is on the disk once the folder is. A path without a folder is in the working directory.
            let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
            File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
        };
        finish().map_err(|source| io_error(&self.path, source))
    }
}

impl Drop for UnfinishedFile {
    fn drop(&mut self) {
        // Nothing is left under this name once the file is in its place.
        let _ = fs::remove_file(&self.temporary);
    }
}

pub(crate) fn io_error(path: &Path, source: io::Error) -> RunError {
    let path = path.to_owned();
    if source.kind() == io::ErrorKind::StorageFull { RunError::Full(path) } else { RunError::Io { path, source } }
}
