//! Many trainings and measurements side by side, each on one thread in a folder of its own: what [`compare`](crate::compare)
//! and [`sweep`](crate::sweep) have in common. What is stopped or killed goes on where it was.

mod learn;
pub mod progress;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;

use crate::checkpoint::CheckpointError;
use crate::config::ConfigError;
use crate::executor::{Workers, side_by_side};
use crate::run::TrainError;
use crate::run_directory::{RunError, create_numbered, io_error, lock_folder};
pub(crate) use learn::{learn, read_json, write_json, wrong};
use progress::Meter;

/// Why jobs broke off.
#[derive(Debug, thiserror::Error)]
pub enum JobsError {
    /// A file or folder cannot be used.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A configuration does not resolve.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A training broke off.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A checkpoint cannot be used.
    #[error("this checkpoint cannot be used: {0}")]
    Checkpoint(#[from] CheckpointError),
    /// One of our JSON files cannot be read.
    #[error("{}: cannot be read: {source}; remove it, and its job begins again", .path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// One of our JSON files holds what cannot be.
    #[error("{}: {what}; remove it, and its job begins again", .path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What cannot be.
        what: String,
    },
    /// The folder belongs to other jobs.
    #[error("{}: this folder holds results of other settings ({difference}); choose another with --out", .path.display())]
    OtherSettings {
        /// The folder.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
    /// There is something else in the folder.
    #[error("{}: this folder is not empty and holds no settings.json to go on from; choose another with --out", .0.display())]
    NotEmpty(PathBuf),
    /// A rank does not see what rank 0 has written.
    #[error("{}: this folder has to be on a disk that all ranks share", .0.display())]
    NotShared(PathBuf),
    /// A run in the folder has another configuration than its job gives it.
    #[error("{}: this run has another configuration than it has here; choose another folder with --out", .0.display())]
    OtherConfiguration(PathBuf),
    /// A job has failed.
    #[error("{job}: {source}")]
    Job {
        /// Its name.
        job: String,
        /// Why.
        source: Box<Self>,
    },
    /// The threads cannot be started.
    #[error("cannot start the worker threads: {0}")]
    Threads(std::io::Error),
}

/// A folder of jobs, held by this process.
#[derive(Debug)]
pub(crate) struct JobsFolder {
    path: PathBuf,
    /// None on a rank that works for the one that holds the folder.
    _lock: Option<File>,
}

impl JobsFolder {
    /// Makes the folder, or opens one whose jobs have begun with the same `card`: all that must be the same for them to
    /// go on. Without `path` it is `runs/<stem>-<n>` in the working directory, with the first free n.
    pub fn open(path: Option<&Path>, stem: &str, card: &Value) -> Result<Self, JobsError> {
        let path = match path {
            Some(path) => path.to_owned(),
            None => create_numbered(Path::new("runs"), stem)?,
        };
        fs::create_dir_all(&path).map_err(|source| io_error(&path, source))?;
        let settings_path = path.join("settings.json");
        let there: Option<Value> = read_json(&settings_path)?;
        if there.is_none() {
            let entries = path.read_dir().map_err(|source| io_error(&path, source))?;
            // A lock alone was left by a process that was killed before it wrote the settings.
            let is_ours = |name: &std::ffi::OsStr| name == "lock" || name == "settings.json.tmp";
            if entries.flatten().any(|entry| !is_ours(&entry.file_name())) {
                return Err(JobsError::NotEmpty(path));
            }
        }
        let lock = lock_folder(&path)?;
        match there {
            None => write_json(&settings_path, card)?,
            Some(there) if there == *card => {}
            Some(there) => {
                return Err(JobsError::OtherSettings { path, difference: difference(&there, card) });
            }
        }
        Ok(Self { path, _lock: Some(lock) })
    }

    /// A folder of jobs with this `card` that rank 0 holds.
    pub fn join(path: &Path, card: &Value) -> Result<Self, JobsError> {
        let path = path.to_owned();
        let there: Value = read_json(&path.join("settings.json"))?.ok_or_else(|| JobsError::NotShared(path.clone()))?;
        if there == *card {
            return Ok(Self { path, _lock: None });
        }
        Err(JobsError::OtherSettings { difference: difference(&there, card), path })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// The first difference of two cards, for a message.
fn difference(there: &Value, here: &Value) -> String {
    const LONGEST: usize = 60;
    let entries = |value: &Value| -> BTreeMap<String, Value> {
        let top = value.as_object().into_iter().flatten().filter(|(key, _)| *key != "settings");
        let settings = value["settings"].as_object().into_iter().flatten();
        top.chain(settings).map(|(key, value)| (key.clone(), value.clone())).collect()
    };
    let (there, here) = (entries(there), entries(here));
    let null = Value::Null;
    let keys = there.keys().chain(here.keys());
    let values = keys.map(|key| (key, there.get(key).unwrap_or(&null), here.get(key).unwrap_or(&null)));
    let mut different = values.filter(|(_, there, here)| there != here);
    different.next().map_or_else(String::new, |(key, there, here)| {
        let (there, here) = (there.to_string(), here.to_string());
        if there.len().max(here.len()) > LONGEST {
            format!("`{key}` differs")
        } else {
            format!("`{key}` is {there} there, {here} here")
        }
    })
}

/// How a job is told to stop and tells how far it has come.
#[derive(Clone, Copy)]
pub(crate) struct Watch<'a> {
    pub stop: &'a AtomicBool,
    pub meter: &'a Meter<'a>,
}

/// What a job ends with; none inside if it was asked to stop.
pub(crate) type JobResult<R> = Result<Option<R>, JobsError>;

/// Does jobs `0..count` side by side; none if they were asked to stop before all were done.
///
/// # Errors
/// That of the first job that fails, with what `name` calls it; the others stop and can go on later.
pub(crate) fn run_all<R: Send + Sync>(
    (num_threads, count): (usize, usize),
    stop: &AtomicBool,
    run: &(dyn Fn(usize, &Workers) -> JobResult<R> + Sync),
    name: impl Fn(usize) -> String,
) -> JobResult<Vec<R>> {
    let slots: Vec<OnceLock<JobResult<R>>> = (0..count).map(|_| OnceLock::new()).collect();
    let has_failed = AtomicBool::new(false);
    let work = |number: usize, workers: &Workers| {
        if has_failed.load(Ordering::Relaxed) {
            return;
        }
        let result = run(number, workers);
        if result.is_err() {
            // The others save what they have.
            has_failed.store(true, Ordering::Relaxed);
            stop.store(true, Ordering::Relaxed);
        }
        assert!(slots[number].set(result).is_ok(), "each job is done once");
    };
    side_by_side(num_threads, count, &work).map_err(JobsError::Threads)?;
    let mut all = Vec::new();
    for (number, result) in slots.into_iter().map(OnceLock::into_inner).enumerate() {
        match result {
            Some(Ok(result)) => all.push(result),
            Some(Err(source)) => return Err(JobsError::Job { job: name(number), source: Box::new(source) }),
            None => all.push(None),
        }
    }
    Ok(all.into_iter().collect())
}
