//! The comparison's numbers: each rung over its seeds, each sweep, and what they say of the claims.

use std::collections::BTreeMap;

use serde::Serialize;

use super::claims::{Claim, claims};
use super::job::{TRAJECTORIES, job_name, uphill_name};
use super::measured::{Measured, RunReport};
use super::protocol::{CompareSettings, EvaluationCard, Quantity, Rung, RungKind};
use crate::jobs::JobsError;
use crate::statistics::{
    bootstrap_interval, interquartile_mean, mean, nested_bootstrap_interval, probability_of_improvement,
};

/// Version of `compare.json`.
pub const FORMAT_VERSION: u32 = 1;

/// `compare.json`: `docs/metrics.md` defines every number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// See [`FORMAT_VERSION`].
    pub version: u32,
    /// The robot's name.
    pub robot: String,
    /// Version of canter.
    pub canter: String,
    /// Whether it is the short form, whose numbers say little.
    pub quick: bool,
    /// How it was measured.
    pub protocol: Protocol,
    /// The faster of the bare gaits: the default gait.
    pub default_rung: Rung,
    /// Every kind of gait.
    pub rungs: BTreeMap<Rung, RungReport>,
    /// Speed and falls under other conditions.
    pub sweeps: BTreeMap<Quantity, SweepReport>,
    /// The paper's claims and ours.
    pub claims: Vec<Claim>,
    /// Recorded episodes, by rung.
    pub trajectories: BTreeMap<Rung, String>,
    /// The same on [`UPHILL_DEG`](super::protocol::UPHILL_DEG), by rung.
    pub uphill_trajectories: BTreeMap<Rung, String>,
}

/// What decides the numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Protocol {
    /// Env steps of each learned gait and each search.
    pub budget_env_steps: u64,
    /// Seeds of training and search.
    pub seeds: Vec<u64>,
    /// Episodes of a measurement.
    pub evaluation: EvaluationCard,
    /// Which seeds select the search's starts: those of the runs themselves.
    pub search_seed: &'static str,
    /// The protocol in plain words.
    pub text: String,
}

/// One rung over its runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RungReport {
    /// Its name for readers.
    pub label: &'static str,
    /// How it comes about.
    pub kind: RungKind,
    /// What it is.
    pub description: &'static str,
    /// Its runs.
    pub seeds: Vec<RunReport>,
    /// Interquartile mean of the runs' speeds [m/s].
    pub speed_iqm: f64,
    /// Its 95 % interval.
    pub speed_ci: [f64; 2],
    /// Interquartile mean of the runs' returns in the evaluation.
    pub return_iqm: f64,
    /// Its 95 % interval.
    pub return_ci: [f64; 2],
    /// Speed over the default gait's; none unless that moves forward.
    pub ratio_to_default: Option<Ratio>,
    /// See [`probability_of_improvement`], run against run.
    pub probability_faster_than_default: f64,
    /// The same against the tuned gait; none without one, or for itself.
    pub probability_faster_than_tuned: Option<f64>,
}

/// A ratio with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    /// Ratio of the interquartile means.
    pub iqm: f64,
    /// Its 95 % interval: both sides are resampled.
    pub ci: [f64; 2],
}

/// One sweep over all rungs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepReport {
    /// Unit of the values.
    pub unit: &'static str,
    /// What was varied.
    pub values: Vec<f64>,
    /// Every rung that was swept.
    pub rungs: BTreeMap<Rung, SweepRow>,
}

/// One rung in one sweep, value by value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepRow {
    /// Interquartile mean over the runs of their mean speeds [m/s].
    pub speed_m_per_s: Vec<f64>,
    /// Their 95 % intervals; runs and episodes are resampled.
    pub speed_ci: Vec<[f64; 2]>,
    /// Share of the episodes that ended in an accident.
    pub falls_per_episode: Vec<f64>,
}

/// What is resampled for an interval, and what is estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// One number a run; or one an episode, if there is one run only.
    values: Vec<f64>,
    is_over_runs: bool,
}

impl Sample {
    /// The speeds of a rung: over its runs, or over the episodes of its only run.
    pub fn speeds(runs: &[RunReport]) -> Self {
        match runs {
            [only] => Self { values: only.speeds_m_per_s.clone(), is_over_runs: false },
            _ => Self::of(runs, |run| run.speed_m_per_s),
        }
    }

    /// One number of each run.
    pub fn of(runs: &[RunReport], value: impl FnMut(&RunReport) -> f64) -> Self {
        Self { values: runs.iter().map(value).collect(), is_over_runs: true }
    }

    /// Interquartile mean over runs, mean over episodes.
    fn centre(&self, values: &[f64]) -> f64 {
        if self.is_over_runs { interquartile_mean(values) } else { mean(values) }
    }

    /// The estimate.
    pub fn estimate(&self) -> f64 {
        self.centre(&self.values)
    }

    /// Its 95 % interval.
    pub fn interval(&self) -> [f64; 2] {
        bootstrap_interval(&[&self.values], |groups| self.centre(&groups[0]))
    }

    /// A function of two estimates and its 95 % interval; each sample is resampled on its own.
    pub fn against(&self, other: &Self, function: impl Fn(f64, f64) -> f64) -> (f64, [f64; 2]) {
        let interval = bootstrap_interval(&[&self.values, &other.values], |groups| {
            function(self.centre(&groups[0]), other.centre(&groups[1]))
        });
        (function(self.estimate(), other.estimate()), interval)
    }
}

impl Comparison {
    /// Sums the runs up.
    ///
    /// # Errors
    /// A robot that cannot be loaded.
    pub fn new(settings: &CompareSettings, measured: Vec<(Rung, Measured)>) -> Result<Self, JobsError> {
        let mut of_rung: BTreeMap<Rung, Vec<Measured>> = BTreeMap::new();
        for (rung, measured) in measured {
            of_rung.entry(rung).or_default().push(measured);
        }
        let robot = Rung::Sine.resolved(settings, 0)?.task.robot.settings.name.clone();
        let runs: BTreeMap<Rung, Vec<RunReport>> = of_rung
            .iter()
            .map(|(rung, all)| (*rung, all.iter().map(|measured| measured.run.clone()).collect()))
            .collect();
        let speed = |rung: &Rung| Sample::speeds(&runs[rung]).estimate();
        let default_rung = [Rung::Sine, Rung::Stepping]
            .into_iter()
            .filter(|rung| runs.contains_key(rung))
            .max_by(|a, b| speed(a).total_cmp(&speed(b)))
            .expect("a comparison always has the bare gaits");
        let rungs = runs.iter().map(|(rung, own)| (*rung, rung_report(*rung, own, &runs, default_rung))).collect();
        let sweeps = settings.sweeps.iter().map(|sweep| {
            let swept = of_rung.iter().filter(|(rung, _)| rung.is_swept());
            let rows = swept.map(|(rung, all)| (*rung, sweep_row(sweep.quantity, sweep.values.len(), all))).collect();
            (sweep.quantity, SweepReport { unit: sweep.quantity.unit(), values: sweep.values.clone(), rungs: rows })
        });
        let mut comparison = Self {
            version: FORMAT_VERSION,
            robot,
            canter: env!("CARGO_PKG_VERSION").to_owned(),
            quick: settings.quick,
            protocol: Protocol {
                budget_env_steps: settings.budget_env_steps,
                seeds: settings.seeds.clone(),
                evaluation: settings.evaluation,
                search_seed: "the run's own seed, in streams that no training and no evaluation uses",
                text: settings.text(),
            },
            default_rung,
            rungs,
            sweeps: sweeps.collect(),
            claims: Vec::new(),
            trajectories: recorded_trajectories(&runs, |rung| Some(rung.name().to_owned())),
            uphill_trajectories: recorded_trajectories(&runs, |rung| rung.is_swept().then(|| uphill_name(rung))),
        };
        comparison.claims = claims(&comparison);
        Ok(comparison)
    }
}

/// The recorded episode that stands for each rung, as a path from the comparison's folder: its median run's of this
/// name.
fn recorded_trajectories(
    runs: &BTreeMap<Rung, Vec<RunReport>>,
    name: impl Fn(Rung) -> Option<String>,
) -> BTreeMap<Rung, String> {
    let path = |(rung, own): (&Rung, &Vec<RunReport>)| {
        let folder = job_name(*rung, median_run(own)?.seed);
        Some((*rung, format!("{folder}/{TRAJECTORIES}/{}.json", name(*rung)?)))
    };
    runs.iter().filter_map(path).collect()
}

/// The run that stands for a rung in pictures: its speed is the median, the slower one of the middle two.
pub fn median_run(runs: &[RunReport]) -> Option<&RunReport> {
    let mut sorted: Vec<&RunReport> = runs.iter().collect();
    sorted.sort_by(|a, b| a.speed_m_per_s.total_cmp(&b.speed_m_per_s));
    sorted.get(sorted.len().saturating_sub(1) / 2).copied()
}

fn rung_report(rung: Rung, own: &[RunReport], runs: &BTreeMap<Rung, Vec<RunReport>>, default_rung: Rung) -> RungReport {
    let speeds = Sample::speeds(own);
    let returns = Sample::of(own, |run| run.episode_return);
    let default = &runs[&default_rung];
    let default_speeds = Sample::speeds(default);
    let ratio = || {
        let (iqm, ci) = speeds.against(&default_speeds, |own, default| own / default);
        Ratio { iqm, ci }
    };
    let faster_than = |others: &[RunReport]| {
        let speeds = |runs: &[RunReport]| runs.iter().map(|run| run.speed_m_per_s).collect::<Vec<_>>();
        probability_of_improvement(&speeds(own), &speeds(others))
    };
    let tuned = runs.get(&Rung::Tuned).filter(|_| rung != Rung::Tuned);
    RungReport {
        label: rung.label(),
        kind: rung.kind(),
        description: rung.description(),
        seeds: own.to_vec(),
        speed_iqm: speeds.estimate(),
        speed_ci: speeds.interval(),
        return_iqm: returns.estimate(),
        return_ci: returns.interval(),
        ratio_to_default: (default_speeds.estimate() > 0.0).then(ratio),
        probability_faster_than_default: faster_than(default),
        probability_faster_than_tuned: tuned.map(|tuned| faster_than(tuned)),
    }
}

fn sweep_row(quantity: Quantity, num_values: usize, all: &[Measured]) -> SweepRow {
    let mut row = SweepRow { speed_m_per_s: Vec::new(), speed_ci: Vec::new(), falls_per_episode: Vec::new() };
    let centre =
        |runs: &[Vec<f64>]| interquartile_mean(&runs.iter().map(|episodes| mean(episodes)).collect::<Vec<_>>());
    for value in 0..num_values {
        let points = all.iter().map(|measured| &measured.sweeps[&quantity][value]);
        let runs: Vec<Vec<f64>> = points.clone().map(|point| point.speeds_m_per_s.clone()).collect();
        let falls: u64 = points.map(|point| point.falls).sum();
        row.speed_m_per_s.push(centre(&runs));
        row.speed_ci.push(nested_bootstrap_interval(&[&runs], |groups| centre(&groups[0])));
        row.falls_per_episode.push(falls as f64 / runs.iter().map(Vec::len).sum::<usize>() as f64);
    }
    row
}
