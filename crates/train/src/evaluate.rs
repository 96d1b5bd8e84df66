//! Measuring gaits: the same starts for every gait, no exploration, no learning.

use std::collections::BTreeMap;
use std::sync::Arc;

use canter_gait::{Policy, Sensors};
use canter_learn::random::{Purpose, stream};
use canter_sim::frame::smallest_angle;
use canter_sim::{Accident, Env, StepOutcome, Task};
use rayon::prelude::*;
use serde::Serialize;

use crate::config::EvaluationSettings;
use crate::environment::uniform;
use crate::executor::Workers;
use crate::footfall::Footfall;
use crate::protocol::ProtocolCard;
use crate::statistics::{bootstrap_interval, mean, population_std};

/// What moves the robot.
#[derive(Clone, Copy, Debug)]
pub enum Mover<'a> {
    /// The task's prior alone.
    Prior,
    /// A policy on top of it, without exploration.
    Policy(&'a Policy<'a>),
    /// The same action at every step, `(A)`: another open-loop gait.
    Constant(&'a [f32]),
    /// Actuator targets from outside: whatever was exported.
    Driver(&'a dyn Driver),
}

/// Writes the targets, `(M)` [rad], of one step after another.
pub type Drive<'a> = dyn FnMut(&Sensors<'_>, &mut [f32]) + 'a;

/// A controller with a clock of its own.
pub trait Driver: std::fmt::Debug + Sync {
    /// Begins an episode.
    fn start(&self) -> Box<Drive<'_>>;
}

/// What looks at every step of an episode.
pub trait Watcher: Default + Send {
    /// Sees the environment after a step.
    fn watch(&mut self, env: &Env);
}

/// Under which conditions gaits are measured, beside the task.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// Number and length of the episodes.
    pub settings: EvaluationSettings,
    /// Which random starts they have.
    pub starts: Starts,
    /// A push in every episode.
    pub push: Option<Push>,
}

/// A row of random starts; every gait that is measured under it begins in the same states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Starts {
    /// Whom they belong to: an evaluation's are never seen in training or tuning.
    pub purpose: Purpose,
    /// Which row of this purpose and seed.
    pub row: u64,
    /// Number of the first start.
    pub first: u64,
}

/// A push from the side, at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// When, from the start of the episode [s].
    pub at_s: f64,
    /// Change of the body's velocity, positive to the left [m/s].
    pub velocity_m_per_s: f64,
}

impl From<&EvaluationSettings> for Conditions {
    fn from(settings: &EvaluationSettings) -> Self {
        let starts = Starts { purpose: Purpose::Evaluation, row: 0, first: 0 };
        Self { settings: settings.clone(), starts, push: None }
    }
}

/// One episode of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// Env steps that it took.
    pub env_steps: u32,
    /// See [`forward_speed`] [m/s].
    pub speed_m_per_s: f64,
    /// Length of the horizontal displacement over the same time: what a robot walks that is not held to its heading [m/s].
    pub displacement_speed_m_per_s: f64,
    /// Sideways displacement after the settling time, without its sign [m].
    pub drift_m: f64,
    /// Change of the heading over the whole episode, without its sign [deg].
    pub heading_deg: f64,
    /// Standard deviation of the body's height above the ground below it, after the settling time [m].
    pub height_std_m: f64,
    /// See [`speed_per_step_std`] [m].
    pub speed_per_step_std_m: f64,
    /// Mean mechanical power after the settling time [W].
    pub power_w: f64,
    /// Env steps after the settling time at whose end anything but the feet touched the ground.
    pub body_contact_steps: u32,
    /// Footfalls after the settling time; none if it ended before, or of a robot that has not four legs.
    pub footfall: Option<Footfall>,
    /// Sum of the rewards.
    pub episode_return: f64,
    /// The accident that ended it.
    pub accident: Option<Accident>,
}

/// What one gait did over all episodes; `docs/metrics.md` defines every number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GaitReport {
    /// Mean forward speed [m/s].
    pub speed_m_per_s: f64,
    /// Its 95 % bootstrap interval over the episodes [m/s].
    pub speed_ci: [f64; 2],
    /// Mean length of the horizontal displacement by time [m/s].
    pub displacement_speed_m_per_s: f64,
    /// Episodes that ended in an accident.
    pub falls: u64,
    /// The same by cause.
    pub falls_by_cause: BTreeMap<&'static str, u64>,
    /// Mean sideways displacement, without its sign [m].
    pub drift_m: f64,
    /// Mean change of the heading, without its sign [deg].
    pub heading_deg: f64,
    /// Mean standard deviation of the body's height above the ground below it [m].
    pub height_std_m: f64,
    /// Mean standard deviation of the way of one env step [m].
    pub speed_per_step_std_m: f64,
    /// Mean number of env steps in which anything but the feet touched the ground.
    pub body_contact_steps: f64,
    /// Mean footfalls; none if every episode ended before the settling time, or of a robot that has not four legs.
    pub footfall: Option<Footfall>,
    /// Mean mechanical power [W].
    pub power_w: f64,
    /// Mean power over weight times mean speed; none for a gait that does not move forward.
    pub cost_of_transport: Option<f64>,
    /// Mean return.
    pub episode_return: f64,
    /// Forward speed of each episode [m/s].
    pub speeds_m_per_s: Vec<f64>,
}

/// Forward speed of an episode [m/s].
///
/// ```text
/// v = (x(t_end) - x(t_settle)) / (T - t_settle)
/// ```
///
/// `settled_m` -> x(t_settle), `end_m` -> x(t_end), `counted_s` -> T - t_settle. A robot that falls at t_end < T keeps
/// the full time T; one that falls before t_settle has speed 0.
///
/// Source: eq. 7 of the paper (the distance of one step), summed over the steps and divided by their time.
pub fn forward_speed(settled_m: f64, end_m: f64, counted_s: f64) -> f64 {
    (end_m - settled_m) / counted_s
}

/// How unsteady the speed is: standard deviation over the env steps of the way of one step [m].
///
/// ```text
/// s = sqrt(mean over t of (V_t - mean V)^2),  V_t = x_t - x_(t-1)
/// ```
///
/// `ways_m` -> V.
///
/// Source: eq. 7 of the paper defines V; fig. 6 shows its spread, which the paper puts no number to.
pub fn speed_per_step_std(ways_m: &[f64]) -> f64 {
    population_std(ways_m)
}

/// Energy per weight and way.
///
/// ```text
/// CoT = P / (m g v)
/// ```
///
/// Source: Gabrielli and von Karman 1950, as usual in the field; P is mechanical power here. None unless v > 0.
pub fn cost_of_transport(power_w: f64, weight_n: f64, speed_m_per_s: f64) -> Option<f64> {
    (speed_m_per_s > 0.0).then(|| power_w / (weight_n * speed_m_per_s))
}

/// Measures one gait; the same settings give every gait the same starts.
pub fn evaluate(task: &Task, mover: Mover<'_>, settings: &EvaluationSettings, workers: &Workers) -> GaitReport {
    let episodes = run_episodes(task, Env::new, mover, settings, workers);
    GaitReport::new(&episodes, task.weight_n())
}

/// The episodes of one gait, in environments that `new_env` makes: [`Env::new`], or a what-if study's.
///
/// `new_env` gets the task without its goal and with the evaluation's time limit and physics step.
pub fn run_episodes(
    task: &Task,
    new_env: impl Fn(Arc<Task>) -> Env + Sync,
    mover: Mover<'_>,
    conditions: impl Into<Conditions>,
    workers: &Workers,
) -> Vec<Episode> {
    let conditions = &conditions.into();
    let settings = &conditions.settings;
    let task = evaluation_task(task, settings);
    workers.install(|| {
        (0..settings.num_episodes)
            .into_par_iter()
            .with_max_len(1)
            .map(|number| run_episode(&mut new_env(task.clone()), mover, conditions, number as u64, |_, _| {}))
            .collect()
    })
}

/// The episodes of one gait, each with what a watcher made of it.
pub fn watch_episodes<W: Watcher>(
    task: &Task,
    mover: Mover<'_>,
    settings: &EvaluationSettings,
    workers: &Workers,
) -> Vec<(Episode, W)> {
    let conditions = &Conditions::from(settings);
    let task = evaluation_task(task, settings);
    let watched = |number: usize| {
        let mut watcher = W::default();
        let mut env = Env::new(task.clone());
        let episode = run_episode(&mut env, mover, conditions, number as u64, |env, _| watcher.watch(env));
        (episode, watcher)
    };
    workers.install(|| (0..settings.num_episodes).into_par_iter().with_max_len(1).map(watched).collect())
}

/// The task without its goal and its height margin, and with the evaluation's time limit and physics step.
///
/// # Panics
/// If the physics step does not divide the control step.
pub fn evaluation_task(task: &Task, settings: &EvaluationSettings) -> Arc<Task> {
    let task = task.clone().with_physics_dt_s(settings.physics_dt_s);
    let mut task = task.expect("checked when the configuration was read");
    task.settings.goal_distance_m = None;
    task.settings.height_margin = 0.0;
    task.max_env_steps = (settings.episode_s / task.settings.control_dt_s).round() as u32;
    Arc::new(task)
}

/// Episode number `number` from its own random start. `observe` sees the environment after each step.
pub(crate) fn run_episode(
    env: &mut Env,
    mover: Mover<'_>,
    conditions: &Conditions,
    number: u64,
    mut observe: impl FnMut(&mut Env, &StepOutcome),
) -> Episode {
    let task = env.task().clone();
    let Conditions { settings, starts, push } = conditions;
    let mut rng = stream(settings.seed, starts.purpose, starts.row, starts.first + number);
    let mut observation = vec![0.0; task.num_observations()];
    let mut action = vec![0.0; task.num_actions()];
    let mut hidden = match mover {
        Mover::Policy(policy) => vec![0.0; policy.network.workspace_len()],
        Mover::Prior | Mover::Constant(_) | Mover::Driver(_) => Vec::new(),
    };
    let mut drive = match mover {
        Mover::Driver(driver) => Some((driver.start(), env.last_command().to_vec())),
        Mover::Prior | Mover::Constant(_) | Mover::Policy(_) => None,
    };
    env.reset(&mut || uniform(&mut rng), &mut observation);
    let start_heading = env.heading_rad();
    let (mut end, mut end_heading) = (env.position_in_ground(), start_heading);
    let settle_steps = task.settings.env_steps_until(settings.settle_s);
    let push = push.map(|push| (task.settings.env_steps_until(push.at_s), push.velocity_m_per_s));
    let mut settled = None;
    let (mut heights, mut ways_m, mut contacts) = (Vec::new(), Vec::new(), Vec::new());
    let mut feet = vec![false; task.robot.legs.len()];
    let (mut work_j, mut episode_return, mut body_contact_steps) = (0.0, 0.0, 0);
    let accident = loop {
        if env.env_steps() == settle_steps {
            settled = Some(end);
        }
        if let Some((_, velocity)) = push.filter(|(step, _)| *step == env.env_steps()) {
            env.push([0.0, velocity, 0.0]);
        }
        let before_m = env.position_in_ground()[0];
        let outcome: StepOutcome = match mover {
            Mover::Prior => env.step_prior(&mut observation),
            Mover::Constant(action) => env.step(action, &mut observation),
            Mover::Driver(_) => {
                let (drive, targets) = drive.as_mut().expect("it was started");
                drive(&env.sensors(), targets);
                env.step_targets(targets, &mut observation)
            }
            Mover::Policy(policy) => {
                policy.act(&mut observation, &mut hidden, &mut action);
                env.step(&action, &mut observation)
            }
        };
        observe(env, &outcome);
        episode_return += outcome.reward;
        // After an unstable step no position means anything: the episode ends where it was before.
        if outcome.terminated != Some(Accident::Unstable) {
            (end, end_heading) = (env.position_in_ground(), env.heading_rad());
            if settled.is_some() {
                body_contact_steps += u32::from(env.ground_contacts(&mut feet) > 0);
                contacts.extend(<[bool; 4]>::try_from(&feet[..]).ok());
                work_j += outcome.work_j;
                heights.push(env.height_above_ground_m());
                ways_m.push(end[0] - before_m);
            }
        }
        if outcome.terminated.is_some() || outcome.truncated {
            break outcome.terminated;
        }
    };
    // A fall before the settling time leaves no way that counts.
    let settled = settled.unwrap_or(end);
    let counted_s = f64::from(task.max_env_steps - settle_steps) * task.settings.control_dt_s;
    let walked_s = (heights.len() as f64 * task.settings.control_dt_s).max(task.settings.control_dt_s);
    Episode {
        env_steps: env.env_steps(),
        speed_m_per_s: forward_speed(settled[0], end[0], counted_s),
        displacement_speed_m_per_s: (end[0] - settled[0]).hypot(end[1] - settled[1]) / counted_s,
        drift_m: (end[1] - settled[1]).abs(),
        heading_deg: smallest_angle(end_heading - start_heading).abs().to_degrees(),
        height_std_m: population_std(&heights),
        speed_per_step_std_m: speed_per_step_std(&ways_m),
        power_w: work_j / walked_s,
        body_contact_steps,
        footfall: Footfall::of(&contacts, task.settings.control_dt_s),
        episode_return,
        accident,
    }
}

impl GaitReport {
    /// Summary of the episodes of a robot of this weight [N].
    pub fn new(episodes: &[Episode], weight_n: f64) -> Self {
        let column = |value: fn(&Episode) -> f64| episodes.iter().map(value).collect::<Vec<f64>>();
        let speeds = column(|episode| episode.speed_m_per_s);
        let speed = mean(&speeds);
        let power_w = mean(&column(|episode| episode.power_w));
        let mut falls_by_cause = BTreeMap::new();
        for accident in episodes.iter().filter_map(|episode| episode.accident) {
            *falls_by_cause.entry(accident.name()).or_default() += 1;
        }
        Self {
            speed_m_per_s: speed,
            speed_ci: bootstrap_interval(&[&speeds], |groups| mean(&groups[0])),
            displacement_speed_m_per_s: mean(&column(|episode| episode.displacement_speed_m_per_s)),
            falls: falls_by_cause.values().sum(),
            falls_by_cause,
            drift_m: mean(&column(|episode| episode.drift_m)),
            heading_deg: mean(&column(|episode| episode.heading_deg)),
            height_std_m: mean(&column(|episode| episode.height_std_m)),
            speed_per_step_std_m: mean(&column(|episode| episode.speed_per_step_std_m)),
            body_contact_steps: mean(&column(|episode| f64::from(episode.body_contact_steps))),
            footfall: Footfall::mean(&episodes.iter().filter_map(|episode| episode.footfall).collect::<Vec<_>>()),
            power_w,
            cost_of_transport: cost_of_transport(power_w, weight_n, speed),
            episode_return: mean(&column(|episode| episode.episode_return)),
            speeds_m_per_s: speeds,
        }
    }
}

/// How many times as fast a gait is as another, with a 95 % bootstrap interval over both gaits' episodes.
///
/// ```text
/// ratio = mean speed / mean speed of the other
/// ```
///
/// None unless the other gait moves forward with its whole interval.
///
/// Source: our definition; the interval is [`bootstrap_interval`]'s.
pub fn speed_ratio(gait: &GaitReport, other: &GaitReport) -> Option<(f64, [f64; 2])> {
    let ratio = |a: &[f64], b: &[f64]| mean(a) / mean(b);
    let (own, others) = (&gait.speeds_m_per_s, &other.speeds_m_per_s);
    let interval = || bootstrap_interval(&[own, others], |groups| ratio(&groups[0], &groups[1]));
    (other.speed_ci[0] > 0.0).then(|| (ratio(own, others), interval()))
}

/// The verdict on a policy: its gait, its own prior, and the gaits whose speed counts as a default speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// How it was measured.
    pub protocol: ProtocolCard,
    /// The learned gait; none for a bare gait.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<GaitReport>,
    /// The gait that the policy modulates, alone.
    pub prior: GaitReport,
    /// Name of that gait.
    pub prior_name: String,
    /// Every default gait of the robot.
    pub default_gaits: BTreeMap<String, GaitReport>,
    /// The fastest of them: its speed is the default speed.
    pub default_gait: String,
    /// Its speed [m/s].
    pub default_speed_m_per_s: f64,
    /// Learned speed over default speed; for a bare gait its own speed over default speed. None if the default does not move forward.
    pub speed_ratio: Option<f64>,
    /// Its 95 % interval.
    pub speed_ratio_ci: Option<[f64; 2]>,
    /// The same by displacement instead of forward speed: what is left when the default gait is not charged for turning.
    pub displacement_speed_ratio: Option<f64>,
    /// Learned speed over that of its own prior.
    pub prior_speed_ratio: Option<f64>,
    /// Its 95 % interval.
    pub prior_speed_ratio_ci: Option<[f64; 2]>,
}

/// Measures a policy, its prior and the robot's default gaits from the same starts; without a policy, the prior alone.
pub fn judge(
    task: &Task,
    prior_name: &str,
    policy: Option<&Policy<'_>>,
    settings: &EvaluationSettings,
    workers: &Workers,
) -> Verdict {
    let bare = |name: &str| {
        let task = task.with_gait(name).expect("a gait of the robot");
        evaluate(&task, Mover::Prior, settings, workers)
    };
    let mut default_gaits: BTreeMap<String, GaitReport> =
        task.robot.default_gaits().map(|gait| (gait.name.clone(), bare(&gait.name))).collect();
    let prior = default_gaits.get(prior_name).cloned().unwrap_or_else(|| bare(prior_name));
    if default_gaits.is_empty() {
        // A robot without a declared default is compared with the gait at hand.
        default_gaits.insert(prior_name.to_owned(), prior.clone());
    }
    let fastest =
        |a: &(&String, &GaitReport), b: &(&String, &GaitReport)| a.1.speed_m_per_s.total_cmp(&b.1.speed_m_per_s);
    let (default_gait, default_report) = default_gaits.iter().max_by(fastest).expect("one was just inserted");
    let (default_gait, default_report) = (default_gait.clone(), default_report.clone());
    let policy = policy.map(|policy| evaluate(task, Mover::Policy(policy), settings, workers));
    let judged = policy.as_ref().unwrap_or(&prior);
    let against_default = speed_ratio(judged, &default_report);
    let default_displaced = default_gaits.values().map(|gait| gait.displacement_speed_m_per_s).fold(0.0, f64::max);
    let against_prior = policy.as_ref().and_then(|policy| speed_ratio(policy, &prior));
    Verdict {
        protocol: ProtocolCard::new(task, settings),
        prior_name: prior_name.to_owned(),
        default_speed_m_per_s: default_report.speed_m_per_s,
        default_gait,
        default_gaits,
        speed_ratio: against_default.map(|(ratio, _)| ratio),
        speed_ratio_ci: against_default.map(|(_, interval)| interval),
        displacement_speed_ratio: (default_displaced > 0.0)
            .then(|| judged.displacement_speed_m_per_s / default_displaced),
        prior_speed_ratio: against_prior.map(|(ratio, _)| ratio),
        prior_speed_ratio_ci: against_prior.map(|(_, interval)| interval),
        policy,
        prior,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(speed: f64, accident: Option<Accident>) -> Episode {
        Episode {
            env_steps: 1000,
            speed_m_per_s: speed,
            displacement_speed_m_per_s: speed,
            drift_m: 0.1,
            heading_deg: 3.0,
            height_std_m: 0.01,
            speed_per_step_std_m: 0.002,
            power_w: 20.0,
            body_contact_steps: 3,
            footfall: None,
            episode_return: 5.0,
            accident,
        }
    }

    #[test]
    fn speed_and_cost_of_transport_by_hand() {
        assert_eq!(forward_speed(0.5, 5.0, 9.0), 0.5);
        // 20 W / (4.8 kg * 9.81 m/s^2 * 0.5 m/s) = 0.8495
        assert!((cost_of_transport(20.0, 4.8 * 9.81, 0.5).unwrap() - 0.8495).abs() < 1e-4);
        assert_eq!(cost_of_transport(20.0, 47.0, -0.1), None);
    }

    #[test]
    fn reports_count_falls_by_cause() {
        let episodes = [episode(0.4, None), episode(0.2, Some(Accident::Rollover)), episode(0.6, None)];
        let report = GaitReport::new(&episodes, 47.0);
        assert_eq!(report.falls, 1);
        assert_eq!(report.falls_by_cause, BTreeMap::from([("rollover", 1)]));
        assert!((report.speed_m_per_s - 0.4).abs() < 1e-12);
    }

    #[test]
    fn a_ratio_needs_a_gait_that_moves_forward() {
        let report =
            |speeds: &[f64]| GaitReport::new(&speeds.iter().map(|&s| episode(s, None)).collect::<Vec<_>>(), 47.0);
        let (ratio, [low, high]) = speed_ratio(&report(&[1.0, 1.2, 1.1]), &report(&[0.5, 0.6, 0.55])).unwrap();
        assert!((ratio - 2.0).abs() < 1e-12 && low < 2.0 && 2.0 < high);
        assert_eq!(speed_ratio(&report(&[1.0]), &report(&[-0.1])), None);
    }
}
