//! One job: a rung and a seed, from its configuration to its measured numbers, on one thread, in a folder of its own.

use std::fs;
use std::path::Path;
use std::sync::atomic::Ordering;

use canter_sim::Task;
use serde_json::{Value, json};

use super::measured::{Measured, Subject, planned_steps};
use super::protocol::{CompareSettings, Quantity, Rung, RungKind, UPHILL_DEG};
use crate::config::{EvaluationSettings, Resolved};
use crate::evaluate::Mover;
use crate::executor::Workers;
use crate::jobs::{JobsError, Watch, learn, read_json, write_json, wrong};
use crate::run_directory::{io_error, read_metrics, write_trajectory};
use crate::search::tuned::{Candidate, Objective, Search, SearchState};
use crate::trajectory::record;

/// Generations of a search between two saves.
const SAVE_GENERATIONS: u32 = 10;

/// A rung and a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// What is learned, searched or measured.
    pub rung: Rung,
    /// Its seed; none for a bare gait.
    pub seed: Option<u64>,
    /// Its place among the runs of the rung, and how many these are.
    pub place: (usize, usize),
}

/// What all jobs share.
pub(super) struct Context<'a> {
    pub settings: &'a CompareSettings,
    pub folder: &'a Path,
    pub watch: Watch<'a>,
}

/// Every job of a comparison, the longest first, so that none is left over at the end.
pub fn jobs(settings: &CompareSettings) -> Vec<Job> {
    let length = |rung: Rung| match rung.kind() {
        RungKind::Tuned => 2,
        RungKind::Learned => 1,
        RungKind::Gait => 0,
    };
    let mut rungs = settings.rungs.clone();
    // A stable sort: within a kind the best rung comes first.
    rungs.sort_by_key(|rung| std::cmp::Reverse((length(*rung), *rung)));
    let jobs_of = |rung: Rung| -> Vec<Job> {
        if rung.kind() == RungKind::Gait {
            return vec![Job { rung, seed: None, place: (0, 1) }];
        }
        let num_runs = settings.seeds.len();
        let job = |(place, &seed)| Job { rung, seed: Some(seed), place: (place, num_runs) };
        settings.seeds.iter().enumerate().map(job).collect()
    };
    rungs.into_iter().flat_map(jobs_of).collect()
}

/// Folder in a job's folder that holds its recorded episode.
pub(super) const TRAJECTORIES: &str = "trajectories";

/// Name of a rung's episode that was recorded uphill.
pub(super) fn uphill_name(rung: Rung) -> String {
    format!("{}-uphill", rung.name())
}

/// Name of the folder of a rung's job.
pub(super) fn job_name(rung: Rung, seed: Option<u64>) -> String {
    match seed {
        Some(seed) => format!("{}-{seed}", rung.name()),
        None => rung.name().to_owned(),
    }
}

impl Job {
    /// Name of its folder.
    pub fn name(&self) -> String {
        job_name(self.rung, self.seed)
    }

    /// Env steps that it will take if nothing falls.
    pub(super) fn planned_steps(&self, settings: &CompareSettings, task: &Task) -> u64 {
        let of_learning = match self.rung.kind() {
            RungKind::Gait => 0,
            RungKind::Tuned => Objective::ALL.len() as u64 * settings.budget_env_steps,
            RungKind::Learned => settings.budget_env_steps,
        };
        let evaluation = settings.evaluation();
        let num_episodes = settings.sweep_episodes_of_a_run(self.place.1);
        let num_points = settings.sweeps.iter().map(|sweep| sweep.values.len()).sum::<usize>() as u64;
        let of_a_point = planned_steps(&EvaluationSettings { num_episodes, ..evaluation.clone() }, task);
        let of_sweeps = if self.rung.is_swept() { num_points * of_a_point } else { 0 };
        of_learning + planned_steps(&evaluation, task) + of_sweeps
    }

    /// Does what is left to do; none if it was asked to stop before the end.
    pub(super) fn run(&self, context: &Context<'_>, workers: &Workers) -> Result<Option<Measured>, JobsError> {
        let folder = context.folder.join(self.name());
        let resolved = self.rung.resolved(context.settings, self.seed.unwrap_or(0))?;
        let planned = self.planned_steps(context.settings, &resolved.task);
        let measured_path = folder.join("measured.json");
        if let Some(measured) = read_json::<Measured>(&measured_path)? {
            measured.check(self.rung, context.settings).map_err(wrong(&measured_path))?;
            context.watch.meter.skip(planned);
            context.watch.meter.finish_job();
            return Ok(Some(measured));
        }
        if context.watch.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let task = resolved.task.clone();
        let measured = match self.rung.kind() {
            RungKind::Gait => {
                fs::create_dir_all(&folder).map_err(|source| io_error(&folder, source))?;
                self.measure(&task, Mover::Prior, (0, Vec::new()), context, workers)?
            }
            RungKind::Tuned => {
                let Some((candidate, env_steps)) = self.tune(&resolved, &folder, context, workers)? else {
                    return Ok(None);
                };
                self.measure(&task, Mover::Constant(&candidate.action), (env_steps, Vec::new()), context, workers)?
            }
            RungKind::Learned => {
                let Some(policy) = learn(resolved, &folder, context.watch, workers)? else { return Ok(None) };
                let result = (policy.card.provenance.env_steps, return_curve(&folder)?);
                self.measure(&task, Mover::Policy(&policy.policy()), result, context, workers)?
            }
        };
        if let Some(measured) = &measured {
            write_json(&measured_path, measured)?;
            context.watch.meter.finish_job();
        }
        Ok(measured)
    }

    /// Records an episode and measures the gait; none if it was asked to stop.
    fn measure(
        &self,
        task: &Task,
        mover: Mover<'_>,
        (env_steps, return_curve): (u64, Vec<(u64, f64)>),
        context: &Context<'_>,
        workers: &Workers,
    ) -> Result<Option<Measured>, JobsError> {
        let evaluation = context.settings.evaluation();
        let folder = context.folder.join(self.name()).join(TRAJECTORIES);
        write_trajectory(&folder, &record(task, mover, &evaluation, self.rung.name(), self.rung.label()))?;
        if self.rung.is_swept() {
            let (task, _) = Quantity::Slope.applied(task, UPHILL_DEG);
            write_trajectory(&folder, &record(&task, mover, &evaluation, &uphill_name(self.rung), self.rung.label()))?;
        }
        let share = self.rung.is_swept().then_some(self.place);
        let subject = Subject { task, mover, seed: self.seed, env_steps, return_curve, share };
        Ok(subject
            .measure(context.settings, workers, context.watch.stop, &|env_steps| context.watch.meter.add(env_steps)))
    }

    /// Searches for both objectives; the better result and the env steps of both, or none if it was asked to stop.
    fn tune(
        &self,
        resolved: &Resolved,
        folder: &Path,
        context: &Context<'_>,
        workers: &Workers,
    ) -> Result<Option<(Candidate, u64)>, JobsError> {
        fs::create_dir_all(folder).map_err(|source| io_error(folder, source))?;
        let settings = context.settings.search();
        let search = Search { task: &resolved.task, settings: &settings, seed: resolved.config.seed };
        let mut states: Vec<SearchState> = Vec::new();
        for objective in Objective::ALL {
            let path = folder.join(format!("search-{}.json", objective.name()));
            let mut state = read_json(&path)?.unwrap_or_else(|| search.start(objective));
            search.check(&state, objective).map_err(wrong(&path))?;
            context.watch.meter.skip(state.env_steps);
            if state.chosen.is_none() {
                let (mut counted, mut saved) = (state.env_steps, Ok(()));
                search.run(&mut state, workers, context.watch.stop, &mut |state| {
                    context.watch.meter.add(state.env_steps - counted);
                    counted = state.env_steps;
                    if state.cma_es.generation % SAVE_GENERATIONS == 0 && saved.is_ok() {
                        saved = write_json(&path, state);
                    }
                });
                saved.and_then(|()| write_json(&path, &state))?;
            }
            if state.chosen.is_none() {
                return Ok(None);
            }
            // What a search leaves of its budget counts as done.
            context.watch.meter.add(context.settings.budget_env_steps.saturating_sub(state.env_steps));
            states.push(state);
        }
        let better = |a: &&SearchState, b: &&SearchState| {
            let score = |state: &SearchState| state.chosen.as_ref().expect("both have chosen").score;
            score(a).compare(&score(b), Objective::Speed)
        };
        let best = states.iter().min_by(better).expect("there are two objectives");
        let env_steps = states.iter().map(|state| state.env_steps).sum();
        write_json(&folder.join("tuned.json"), &tuned_card(resolved, &states, best))?;
        let chosen = best.chosen.clone().expect("both have chosen");
        Ok(Some((chosen, env_steps)))
    }
}

/// `tuned.json`: what was found, in the gait's own numbers too.
fn tuned_card(resolved: &Resolved, states: &[SearchState], best: &SearchState) -> Value {
    let chosen = best.chosen.as_ref().expect("the search has ended");
    let controller = resolved.task.controller();
    let (gait, law) = (controller.gait(), controller.law());
    let legs: Vec<Value> = gait
        .legs
        .iter()
        .enumerate()
        .map(|(index, leg)| {
            let parameters = law.leg_parameters(leg, index, &chosen.action);
            json!({
                "swing_amplitude_rad": parameters.swing_amplitude,
                "extension_amplitude_rad": parameters.extension_amplitude,
                "swing_offset_rad": parameters.swing_offset,
                "extension_offset_rad": parameters.extension_offset,
            })
        })
        .collect();
    let searches: Vec<Value> = states
        .iter()
        .map(|state| {
            json!({
                "objective": state.objective.name(),
                "env_steps": state.env_steps,
                "generations": state.cma_es.generation,
                "chosen": state.chosen,
            })
        })
        .collect();
    json!({
        "version": 1,
        "robot": resolved.task.robot.settings.name,
        "gait": resolved.config.policy.prior,
        "seed": resolved.config.seed,
        "searches": searches,
        "objective": best.objective.name(),
        "action": chosen.action,
        "stride_frequency_hz": law.stride_frequency_hz(&gait, &chosen.action),
        "legs": legs,
    })
}

/// Env steps and mean return of every iteration in which an episode ended, from `metrics.jsonl`.
fn return_curve(folder: &Path) -> Result<Vec<(u64, f64)>, JobsError> {
    let path = folder.join("metrics.jsonl");
    let text = read_metrics(&path)?.ok_or_else(|| io_error(&path, std::io::ErrorKind::NotFound.into()))?;
    let point = |line: &str| {
        let metrics: Value = serde_json::from_str(line).ok()?;
        Some((metrics["env_steps"].as_u64()?, metrics["episode_return"].as_f64()?))
    };
    Ok(text.lines().filter_map(point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_are_every_rung_and_seed_once_the_longest_first() {
        let names: Vec<_> = jobs(&CompareSettings::quick(60_000, 2)).iter().map(Job::name).collect();
        let expected = [
            "tuned-1",
            "tuned-2",
            "doggo-1",
            "doggo-2",
            "paper-1",
            "paper-2",
            "direct-best-1",
            "direct-best-2",
            "direct-1",
            "direct-2",
            "stepping",
            "sine",
        ];
        assert_eq!(names, expected);
    }
}
