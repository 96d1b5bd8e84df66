//! `sweep.json`: what a sweep found.

use serde::Serialize;
use serde_json::Value;

use super::plan::{PRESET, Plan, Point};
use crate::statistics::{bootstrap_interval, interquartile_mean};

/// Version of `sweep.json`.
pub const FORMAT_VERSION: u32 = 1;

/// `sweep.json`: `docs/metrics.md` defines every number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sweep {
    /// See [`FORMAT_VERSION`].
    pub version: u32,
    /// Version of canter.
    pub canter: String,
    /// What was trained where no key says otherwise.
    pub preset: String,
    /// Values that every training had, as `KEY=VALUE`.
    pub overrides: Vec<String>,
    /// What was varied.
    pub keys: Vec<String>,
    /// Seeds of the trainings of every point.
    pub seeds: Vec<u64>,
    /// The points in their order.
    pub points: Vec<PointReport>,
}

/// One point over its seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointReport {
    /// The value of each key, as TOML.
    pub values: Vec<String>,
    /// The robot.
    pub robot: String,
    /// The default gait and its speed [m/s].
    pub default_gait: String,
    /// Its speed [m/s].
    pub default_speed_m_per_s: f64,
    /// Its falls in as many episodes as a run has.
    pub default_falls: u64,
    /// The trainings.
    pub runs: Vec<Measured>,
    /// Interquartile mean of the runs' speeds [m/s].
    pub speed_iqm: f64,
    /// Its 95 % interval over the runs.
    pub speed_ci: [f64; 2],
    /// Interquartile mean of the runs' speeds over the default gait's; none unless that moves forward.
    pub ratio_iqm: Option<f64>,
    /// Its 95 % interval over the runs.
    pub ratio_ci: Option<[f64; 2]>,
    /// Episodes of the runs that ended in an accident, and episodes in all.
    pub falls: [u64; 2],
}

/// One training.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Its seed.
    pub seed: u64,
    /// Its speed [m/s].
    pub speed_m_per_s: f64,
    /// Its speed over the default gait's; none unless that moves forward.
    pub speed_ratio: Option<f64>,
    /// Its speed over that of its own prior.
    pub prior_speed_ratio: Option<f64>,
    /// Episodes that ended in an accident.
    pub falls: u64,
    /// Episodes in all.
    pub num_episodes: u64,
    /// What is the same for every seed of a point.
    #[serde(skip)]
    default: DefaultGait,
}

#[derive(Clone, Debug, PartialEq)]
struct DefaultGait {
    robot: String,
    gait: String,
    speed_m_per_s: f64,
    falls: u64,
}

impl Measured {
    /// From `eval.json`; none if it says nothing of a learned gait.
    pub(super) fn of(verdict: &Value, seed: u64) -> Option<Self> {
        let gait = verdict["default_gait"].as_str()?;
        Some(Self {
            seed,
            speed_m_per_s: verdict["policy"]["speed_m_per_s"].as_f64()?,
            speed_ratio: verdict["speed_ratio"].as_f64(),
            prior_speed_ratio: verdict["prior_speed_ratio"].as_f64(),
            falls: verdict["policy"]["falls"].as_u64()?,
            num_episodes: verdict["protocol"]["num_episodes"].as_u64()?,
            default: DefaultGait {
                robot: verdict["protocol"]["robot"].as_str()?.to_owned(),
                speed_m_per_s: verdict["default_speed_m_per_s"].as_f64()?,
                falls: verdict["default_gaits"][gait]["falls"].as_u64()?,
                gait: gait.to_owned(),
            },
        })
    }
}

impl Sweep {
    /// Sums up the runs, `(points x seeds)`.
    pub(super) fn new(plan: &Plan, points: &[Point], runs: &[Measured]) -> Self {
        let num_seeds = plan.seeds.len();
        Self {
            version: FORMAT_VERSION,
            canter: env!("CARGO_PKG_VERSION").to_owned(),
            preset: if plan.axes.iter().any(|axis| axis.key == PRESET) { String::new() } else { plan.preset.clone() },
            overrides: plan.overrides.iter().map(|(key, value)| format!("{key}={value}")).collect(),
            keys: plan.axes.iter().map(|axis| axis.key.clone()).collect(),
            seeds: plan.seeds.clone(),
            points: points.iter().zip(runs.chunks(num_seeds)).map(|(point, runs)| report(point, runs)).collect(),
        }
    }
}

fn report(point: &Point, runs: &[Measured]) -> PointReport {
    let default = runs[0].default.clone();
    let summary = |values: &[f64]| {
        (interquartile_mean(values), bootstrap_interval(&[values], |groups| interquartile_mean(&groups[0])))
    };
    let speeds: Vec<f64> = runs.iter().map(|run| run.speed_m_per_s).collect();
    let (speed_iqm, speed_ci) = summary(&speeds);
    let ratios: Option<Vec<f64>> = runs.iter().map(|run| run.speed_ratio).collect();
    let ratio = ratios.map(|ratios| summary(&ratios));
    PointReport {
        values: point.iter().map(|(_, value)| value.clone()).collect(),
        robot: default.robot,
        default_gait: default.gait,
        default_speed_m_per_s: default.speed_m_per_s,
        default_falls: default.falls,
        runs: runs.to_vec(),
        speed_iqm,
        speed_ci,
        ratio_iqm: ratio.map(|(iqm, _)| iqm),
        ratio_ci: ratio.map(|(_, ci)| ci),
        falls: [runs.iter().map(|run| run.falls).sum(), runs.iter().map(|run| run.num_episodes).sum()],
    }
}
