//! The comparison: the ladder from the default gait to the learned one, each rung at the same budget, over several seeds.
//!
//! The way of the data: [`protocol`] says what is compared and by which rules; each [`job`] learns, searches or just
//! measures one rung for one seed, in its own folder; [`measured`] is what it leaves; [`results`] sums the runs up;
//! [`claims`] holds them against the paper's words. The jobs run side by side, each on one thread.

pub mod claims;
pub mod job;
pub mod measured;
pub mod protocol;
pub mod results;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use crate::executor::Workers;
use crate::jobs::progress::{JobsProgress, Meter};
use crate::jobs::{JobResult, JobsError, JobsFolder, Watch, run_all, write_json};
use canter_sim::settings::write_commented;
use job::{Context, Job, jobs};
use measured::Measured;
use protocol::{CompareSettings, RungKind};
use results::Comparison;

/// A comparison's folder, held by this process.
#[derive(Debug)]
pub struct CompareFolder {
    folder: JobsFolder,
    settings: CompareSettings,
}

impl CompareFolder {
    /// Makes the folder of a new comparison, or opens one that has begun with the same settings.
    ///
    /// Without `path` the folder is `runs/compare-<n>` in the working directory, with the first free n.
    ///
    /// # Errors
    /// A folder of something else, or of a comparison with other settings, presets, or another version of the robot.
    pub fn open(path: Option<&Path>, settings: &CompareSettings) -> Result<Self, JobsError> {
        let folder = JobsFolder::open(path, "compare", &settings_card(settings)?)?;
        Ok(Self { folder, settings: settings.clone() })
    }

    /// On a rank other than 0: the folder that rank 0 has opened with the same settings.
    ///
    /// # Errors
    /// This rank does not see it, or would compare something else.
    pub fn join(path: &Path, settings: &CompareSettings) -> Result<Self, JobsError> {
        let folder = JobsFolder::join(path, &settings_card(settings)?)?;
        Ok(Self { folder, settings: settings.clone() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// What must be the same for a comparison to go on: settings, version, robot, and the resolved configurations.
fn settings_card(settings: &CompareSettings) -> Result<Value, JobsError> {
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
    observe: &(dyn Fn(JobsProgress) + Sync),
) -> Result<Option<Comparison>, JobsError> {
    let jobs = jobs(&folder.settings);
    let Some(measured) = do_jobs(folder, &jobs, num_threads, stop, observe)? else { return Ok(None) };
    let all = jobs.iter().map(|job| job.rung).zip(measured).collect();
    let comparison = Comparison::new(&folder.settings, all)?;
    write_json(&folder.path().join("compare.json"), &comparison)?;
    Ok(Some(comparison))
}

/// Does one rank's share of a comparison's jobs; whether it was asked to stop before their end. Once every rank has done
/// its own, [`compare`] finds all of them done.
///
/// # Errors
/// As [`compare`].
pub fn do_share(
    folder: &CompareFolder,
    (rank, num_ranks): (usize, usize),
    num_threads: usize,
    stop: &AtomicBool,
    observe: &(dyn Fn(JobsProgress) + Sync),
) -> Result<bool, JobsError> {
    // The longest come first: dealt out like cards they come to about the same everywhere.
    let own: Vec<Job> = jobs(&folder.settings).into_iter().skip(rank).step_by(num_ranks).collect();
    Ok(do_jobs(folder, &own, num_threads, stop, observe)?.is_none())
}

/// Does these jobs and returns what each has measured; none if it was asked to stop before.
fn do_jobs(
    folder: &CompareFolder,
    jobs: &[Job],
    num_threads: usize,
    stop: &AtomicBool,
    observe: &(dyn Fn(JobsProgress) + Sync),
) -> JobResult<Vec<Measured>> {
    let settings = &folder.settings;
    let mut planned_steps = 0;
    for job in jobs {
        let resolved = job.rung.resolved(settings, job.seed.unwrap_or(0))?;
        planned_steps += job.planned_steps(settings, &resolved.task);
    }
    let meter = Meter::new(jobs.len(), planned_steps, observe);
    let context = Context { settings, folder: folder.path(), watch: Watch { stop, meter: &meter } };
    let run = |number: usize, workers: &Workers| jobs[number].run(&context, workers);
    run_all((num_threads, jobs.len()), stop, &run, |number| jobs[number].name())
}
