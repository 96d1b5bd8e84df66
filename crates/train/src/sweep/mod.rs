//! A sweep: the same training with other values of its configuration, each over several seeds.
//!
//! The way of the data: [`plan`] names the points; each point and seed is a training in a run directory of its own, judged
//! like any other; [`results`] sums them up.

pub mod plan;
pub mod results;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use canter_sim::settings::write_commented;
use serde_json::{Value, json};

use crate::executor::Workers;
use crate::jobs::progress::{JobsProgress, Meter};
use crate::jobs::{JobResult, JobsError, JobsFolder, Watch, learn, read_json, run_all, write_json};
use crate::run::judge_trained;
use plan::{Plan, PlanError, Point};
use results::{Measured, Sweep};

/// A sweep's folder, held by this process.
#[derive(Debug)]
pub struct SweepFolder {
    folder: JobsFolder,
    plan: Plan,
    points: Vec<Point>,
    /// Env steps of all trainings.
    num_env_steps: u64,
}

/// Why there is no sweep.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// It cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A job broke off, or the folder cannot be used.
    #[error(transparent)]
    Jobs(#[from] JobsError),
}

impl SweepFolder {
    /// Makes the folder of a new sweep, or opens one that has begun with the same plan.
    ///
    /// Without `path` the folder is `runs/sweep-<n>` in the working directory, with the first free n. Every
    /// configuration is resolved first, so that nothing is trained before all are right.
    ///
    /// # Errors
    /// A plan or a configuration that is wrong, a folder of something else or of another sweep.
    pub fn open(path: Option<&Path>, plan: Plan) -> Result<Self, SweepError> {
        let points = plan.points()?;
        let first_seed = plan.seeds.first().copied().unwrap_or(0);
        let (mut cards, mut num_env_steps) = (Vec::new(), 0);
        for point in &points {
            let resolved = plan.resolved(point, first_seed).map_err(JobsError::Config)?;
            num_env_steps += resolved.config.training.max_env_steps * plan.seeds.len() as u64;
            cards.push(json!({
                "configuration": write_commented(&resolved.config),
                "robot_fingerprint": format!("{:016x}", resolved.task.robot.fingerprint),
            }));
        }
        let card = json!({
            "version": results::FORMAT_VERSION,
            "canter": env!("CARGO_PKG_VERSION"),
            "settings": plan,
            "points": cards,
        });
        let folder = JobsFolder::open(path, "sweep", &card)?;
        Ok(Self { folder, plan, points, num_env_steps })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Points of the sweep.
    pub fn num_points(&self) -> usize {
        self.points.len()
    }

    /// What is varied, and how often.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }
}

/// Runs a sweep to its end and writes `sweep.json`; none if it was asked to stop before.
///
/// What the folder holds already is not done again. `observe` is called from every thread.
///
/// # Errors
/// That of the first job that fails; the others stop and can go on later.
pub fn sweep(
    folder: &SweepFolder,
    num_threads: usize,
    stop: &AtomicBool,
    observe: &(dyn Fn(JobsProgress) + Sync),
) -> Result<Option<Sweep>, SweepError> {
    let SweepFolder { plan, points, .. } = folder;
    let jobs: Vec<(usize, u64)> =
        (0..points.len()).flat_map(|point| plan.seeds.iter().map(move |&seed| (point, seed))).collect();
    let meter = Meter::new(jobs.len(), folder.num_env_steps, observe);
    let watch = Watch { stop, meter: &meter };
    let name = |(point, seed): (usize, u64)| format!("{}-{seed}", point + 1);
    let run = |number: usize, workers: &Workers| {
        let (point, seed) = jobs[number];
        let name = name((point, seed));
        train_point((plan, &points[point], seed), &folder.path().join(name), watch, workers)
    };
    let all = run_all((num_threads, jobs.len()), stop, &run, |number| name(jobs[number]))?;
    let Some(all) = all else { return Ok(None) };
    let sweep = Sweep::new(plan, points, &all);
    write_json(&folder.path().join("sweep.json"), &sweep)?;
    Ok(Some(sweep))
}

/// Trains and judges one point with one seed; none if it was asked to stop.
fn train_point(
    (plan, point, seed): (&Plan, &Point, u64),
    folder: &Path,
    watch: Watch<'_>,
    workers: &Workers,
) -> JobResult<Measured> {
    let resolved = plan.resolved(point, seed)?;
    let verdict_path = folder.join("eval.json");
    if let Some(verdict) = read_json::<Value>(&verdict_path)? {
        let measured = Measured::of(&verdict, seed).ok_or_else(|| JobsError::Wrong {
            path: verdict_path,
            what: "this is no verdict on a learned gait".to_owned(),
        })?;
        watch.meter.skip(resolved.config.training.max_env_steps);
        watch.meter.finish_job();
        return Ok(Some(measured));
    }
    if watch.stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let Some(policy) = learn(resolved.clone(), folder, watch, workers)? else { return Ok(None) };
    let (_, verdict) = judge_trained(folder, &resolved, &policy, workers)?;
    watch.meter.finish_job();
    Ok(Measured::of(&verdict, seed))
}
