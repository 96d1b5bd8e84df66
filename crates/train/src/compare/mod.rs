//! The comparison: the ladder from the default gait to the learned one, each rung at the same budget, over several seeds.
//!
//! The way of the data: [`protocol`] says what is compared and by which rules; each [`job`] learns, searches or just
//! measures one rung for one seed, in its own folder; [`measured`] is what it leaves; [`results`] sums the runs up;
//! [`claims`] holds them against the paper's words. The jobs run side by side, each on one thread.

pub mod claims;
pub mod job;
pub mod measured;
pub mod progress;
pub mod protocol;
pub mod results;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::{Value, json};

use crate::checkpoint::CheckpointError;
use crate::config::ConfigError;
use crate::executor::{Workers, side_by_side};
use crate::run::TrainError;
use crate::run_directory::{RunError, create_numbered, io_error, lock_folder};
use canter_sim::settings::write_commented;
use job::{Context, jobs, read_json, write_json};
use measured::Measured;
use progress::{CompareProgress, Meter};
use protocol::{CompareSettings, RungKind};
use results::Comparison;

/// Why a comparison broke off.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
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
    /// The folder belongs to another comparison.
    #[error("{}: this folder holds a comparison with other settings ({difference}); choose another with --out", .path.display())]
    OtherSettings {
        /// The folder.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
    /// There is something else in the folder.
    #[error("{}: this folder is not empty and holds no comparison; choose another with --out", .0.display())]
    NotEmpty(PathBuf),
    /// A run in the folder has another configuration than the comparison gives it.
    #[error("{}: this run has another configuration than this comparison gives it; choose another folder with --out", .0.display())]
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

/// A comparison's folder, held by this process.
#[derive(Debug)]
pub struct CompareFolder {
    path: PathBuf,
    settings: CompareSettings,
    _lock: File,
}

impl CompareFolder {
    /// Makes the folder of a new comparison, or opens one that has begun with the same settings.
    ///
    /// Without `path` the folder is `runs/compare-<n>` in the working directory, with the first free n.
    ///
    /// # Errors
    /// A folder of something else, or of a comparison with other settings, presets, or another version of the robot.
    pub fn open(path: Option<&Path>, settings: &CompareSettings) -> Result<Self, CompareError> {
        let card = settings_card(settings)?;
        let path = match path {
            Some(path) => path.to_owned(),
            None => create_numbered(Path::new("runs"), "compare")?,
        };
        fs::create_dir_all(&path).map_err(|source| io_error(&path, source))?;
        let settings_path = path.join("settings.json");
        let there: Option<Value> = read_json(&settings_path)?;
        if there.is_none() {
            let entries = path.read_dir().map_err(|source| io_error(&path, source))?;
            // A lock alone was left by a process that was killed before it wrote the settings.
            let is_ours = |name: &std::ffi::OsStr| name == "lock" || name == "settings.json.tmp";
            if entries.flatten().any(|entry| !is_ours(&entry.file_name())) {
                return Err(CompareError::NotEmpty(path));
            }
        }
        let lock = lock_folder(&path)?;
        match there {
            None => write_json(&settings_path, &card)?,
            Some(there) if there == card => {}
            Some(there) => {
                return Err(CompareError::OtherSettings { path, difference: difference(&there, &card) });
            }
        }
        Ok(Self { path, settings: settings.clone(), _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// What must be the same for a comparison to go on: settings, version, robot, and the resolved configurations.
fn settings_card(settings: &CompareSettings) -> Result<Value, CompareError> {
    let (mut configurations, mut fingerprint) = (BTreeMap::new(), 0);
    let first_seed = settings.seeds.first().copied().unwrap_or(0);
    for rung in &settings.rungs {
        let resolved = rung.resolved(settings, first_seed)?;
        fingerprint = resolved.task.robot.fingerprint;
        if rung.kind() != RungKind::Gait {
            configurations.insert(rung.name(), write_commented(&resolved.config));
        }
    }
    Ok(json!({
        "version": results::FORMAT_VERSION,
        "canter": env!("CARGO_PKG_VERSION"),
        "robot_fingerprint": format!("{fingerprint:016x}"),
        "settings": settings,
        "configurations": configurations,
    }))
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

/// What a job ends with; none inside if it was asked to stop.
type JobResult = Result<Option<Measured>, CompareError>;

/// Runs a comparison to its end and writes `compare.json`; none if it was asked to stop before.
///
/// What the folder holds already is not done again. `observe` is called from every thread.
///
/// # Errors
/// The first job that fails; the others stop and can go on later.
pub fn compare(
    folder: &CompareFolder,
    num_threads: usize,
    stop: &AtomicBool,
    observe: &(dyn Fn(CompareProgress) + Sync),
) -> Result<Option<Comparison>, CompareError> {
    let settings = &folder.settings;
    let jobs = jobs(settings);
    let mut planned_steps = 0;
    for job in &jobs {
        let resolved = job.rung.resolved(settings, job.seed.unwrap_or(0))?;
        planned_steps += job.planned_steps(settings, &resolved.task);
    }
    let meter = Meter::new(jobs.len(), planned_steps, observe);
    let context = Context { settings, folder: &folder.path, stop, meter: &meter };
    let slots: Vec<OnceLock<JobResult>> = jobs.iter().map(|_| OnceLock::new()).collect();
    let has_failed = AtomicBool::new(false);
    let work = |number: usize, workers: &Workers| {
        if has_failed.load(Ordering::Relaxed) {
            return;
        }
        let result = jobs[number].run(&context, workers);
        if result.is_err() {
            // The others save what they have.
            has_failed.store(true, Ordering::Relaxed);
            stop.store(true, Ordering::Relaxed);
        }
        slots[number].set(result).expect("each job is done once");
    };
    side_by_side(num_threads, jobs.len(), &work).map_err(CompareError::Threads)?;
    let results = slots.into_iter().map(OnceLock::into_inner);
    let mut all = Vec::new();
    for (job, result) in jobs.iter().zip(results) {
        match result {
            Some(Ok(measured)) => all.push(measured.map(|measured| (job.rung, measured))),
            Some(Err(source)) => return Err(CompareError::Job { job: job.name(), source: Box::new(source) }),
            None => all.push(None),
        }
    }
    let Some(all) = all.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
    let comparison = Comparison::new(settings, all)?;
    write_json(&folder.path.join("compare.json"), &comparison)?;
    Ok(Some(comparison))
}
