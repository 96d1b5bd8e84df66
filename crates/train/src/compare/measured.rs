//! What one job has measured: a gait of one seed, on level ground and in every sweep.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use canter_gait::Modulation;
use canter_sim::{Env, Task};
use serde::{Deserialize, Serialize};

use super::protocol::{CompareSettings, Quantity, Rung};
use crate::config::EvaluationSettings;
use crate::evaluate::{Conditions, GaitReport, Mover, evaluate, run_episodes};
use crate::executor::Workers;
use crate::footfall::Footfall;
use crate::json::{LARGEST, largest_number};

/// One run of a rung: `docs/metrics.md` defines every number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Seed of training or search; none for a bare gait.
    pub seed: Option<u64>,
    /// Env steps of training or search.
    pub env_steps: u64,
    /// Mean forward speed [m/s].
    pub speed_m_per_s: f64,
    /// Mean forward speed of the gait that it learned on, bare [m/s]; none without learning or without a prior.
    pub prior_speed_m_per_s: Option<f64>,
    /// Mean length of the horizontal displacement by time [m/s].
    pub displacement_speed_m_per_s: f64,
    /// Episodes that ended in an accident.
    pub falls: u64,
    /// Episodes.
    pub num_episodes: usize,
    /// Falls by cause.
    pub falls_by_cause: BTreeMap<String, u64>,
    /// Mean return.
    pub episode_return: f64,
    /// Mean sideways displacement, without its sign [m].
    pub drift_m: f64,
    /// Mean change of the heading, without its sign [deg].
    pub heading_deg: f64,
    /// Mean standard deviation of the body's height [m].
    pub height_std_m: f64,
    /// Mean mechanical power [W].
    pub power_w: f64,
    /// Mean power over weight times mean speed.
    pub cost_of_transport: Option<f64>,
    /// Mean standard deviation of the way of one env step [m].
    pub speed_per_step_std_m: f64,
    /// Mean number of env steps in which anything but the feet touched the ground.
    pub body_contact_steps: f64,
    /// Mean footfalls.
    pub footfall: Option<Footfall>,
    /// Forward speed of each episode [m/s].
    pub speeds_m_per_s: Vec<f64>,
    /// Env steps and mean return of the episodes that ended in each iteration of the training.
    pub return_curve: Vec<(u64, f64)>,
}

/// One value of a sweep, for one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepPoint {
    /// Forward speed of each episode [m/s].
    pub speeds_m_per_s: Vec<f64>,
    /// Episodes that ended in an accident.
    pub falls: u64,
}

/// All that a job leaves for the comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// On the task's own ground.
    pub run: RunReport,
    /// For each sweep one point for each of its values; empty for a rung that is not swept.
    pub sweeps: BTreeMap<Quantity, Vec<SweepPoint>>,
}

impl Measured {
    /// Checks that a comparison of these settings can use it.
    ///
    /// # Errors
    /// What cannot be: numbers beyond all measure, episodes that are missing or too many.
    pub fn check(&self, rung: Rung, settings: &CompareSettings) -> Result<(), String> {
        let value = serde_json::to_value(self).map_err(|error| error.to_string())?;
        if largest_number(&value) > LARGEST {
            return Err("it holds a number that is beyond all measure".to_owned());
        }
        let check = |what: &str, speeds: &[f64], num_episodes: usize, falls: u64| {
            if speeds.is_empty() || speeds.len() != num_episodes || falls > num_episodes as u64 {
                let num_speeds = speeds.len();
                return Err(format!("{what} has {num_speeds} speeds and {falls} falls of {num_episodes} episodes"));
            }
            Ok(())
        };
        let RunReport { speeds_m_per_s, num_episodes, falls, falls_by_cause, return_curve, .. } = &self.run;
        check("`run`", speeds_m_per_s, *num_episodes, *falls)?;
        if falls_by_cause.values().any(|count| count > falls) {
            return Err("`run` has a cause of more falls than there are".to_owned());
        }
        if return_curve.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
            return Err("`run` has a return_curve whose env steps do not grow".to_owned());
        }
        for sweep in settings.sweeps.iter().filter(|_| rung.is_swept()) {
            let name = sweep.quantity.name();
            let points = self.sweeps.get(&sweep.quantity).map_or(&[][..], |points| points);
            if points.len() != sweep.values.len() {
                return Err(format!(
                    "the sweep `{name}` has {} points for {} values",
                    points.len(),
                    sweep.values.len()
                ));
            }
            for point in points {
                check(&format!("the sweep `{name}`"), &point.speeds_m_per_s, point.speeds_m_per_s.len(), point.falls)?;
            }
        }
        Ok(())
    }
}

/// A gait that is ready to be measured.
pub(super) struct Subject<'a> {
    pub task: &'a Task,
    pub mover: Mover<'a>,
    pub seed: Option<u64>,
    pub env_steps: u64,
    pub return_curve: Vec<(u64, f64)>,
    /// Whether it is swept, and if so which share of a sweep's episodes is this run's: its place among how many runs.
    pub share: Option<(usize, usize)>,
}

impl Subject<'_> {
    /// Measures the gait; `observe` gets the env steps of each part that is done. None if it was asked to stop.
    pub fn measure(
        self,
        settings: &CompareSettings,
        workers: &Workers,
        stop: &AtomicBool,
        observe: &dyn Fn(u64),
    ) -> Option<Measured> {
        let evaluation = settings.evaluation();
        let report = evaluate(self.task, self.mover, &evaluation, workers);
        observe(planned_steps(&evaluation, self.task));
        let has_prior =
            matches!(self.mover, Mover::Policy(_)) && self.task.controller().law().modulation != Modulation::Direct;
        let prior_speed = has_prior.then(|| evaluate(self.task, Mover::Prior, &evaluation, workers).speed_m_per_s);
        let mut sweeps = BTreeMap::new();
        if let Some((place, num_runs)) = self.share {
            let num_episodes = settings.sweep_episodes_of_a_run(num_runs);
            let mut conditions = Conditions::from(&EvaluationSettings { num_episodes, ..evaluation });
            conditions.starts.first = (place * num_episodes) as u64;
            for sweep in &settings.sweeps {
                let mut points = Vec::new();
                for &value in &sweep.values {
                    if stop.load(Ordering::Relaxed) {
                        return None;
                    }
                    let (task, push) = sweep.quantity.applied(self.task, value);
                    conditions.push = push;
                    let episodes = run_episodes(&task, Env::new, self.mover, conditions.clone(), workers);
                    points.push(SweepPoint {
                        speeds_m_per_s: episodes.iter().map(|episode| episode.speed_m_per_s).collect(),
                        falls: episodes.iter().filter(|episode| episode.accident.is_some()).count() as u64,
                    });
                    observe(planned_steps(&conditions.settings, self.task));
                }
                sweeps.insert(sweep.quantity, points);
            }
        }
        Some(Measured { run: self.report(report, prior_speed), sweeps })
    }

    fn report(self, report: GaitReport, prior_speed_m_per_s: Option<f64>) -> RunReport {
        RunReport {
            seed: self.seed,
            env_steps: self.env_steps,
            speed_m_per_s: report.speed_m_per_s,
            prior_speed_m_per_s,
            displacement_speed_m_per_s: report.displacement_speed_m_per_s,
            falls: report.falls,
            num_episodes: report.speeds_m_per_s.len(),
            falls_by_cause: report.falls_by_cause.iter().map(|(cause, count)| ((*cause).to_owned(), *count)).collect(),
            episode_return: report.episode_return,
            drift_m: report.drift_m,
            heading_deg: report.heading_deg,
            height_std_m: report.height_std_m,
            power_w: report.power_w,
            cost_of_transport: report.cost_of_transport,
            speed_per_step_std_m: report.speed_per_step_std_m,
            body_contact_steps: report.body_contact_steps,
            footfall: report.footfall,
            speeds_m_per_s: report.speeds_m_per_s,
            return_curve: self.return_curve,
        }
    }
}

/// Env steps of a measurement if nothing falls.
pub(super) fn planned_steps(settings: &EvaluationSettings, task: &Task) -> u64 {
    settings.num_episodes as u64 * (settings.episode_s / task.settings.control_dt_s).round() as u64
}
