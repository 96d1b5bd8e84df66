//! One episode of a gait, step by step: what figures and replays are made from.
//!
//! Nothing of this is computed in a training or an evaluation: a recording walks its episode anew, from the same start,
//! and so gets the same steps.

use std::sync::Arc;

use canter_gait::Policy;
use canter_sim::{Accident, Env, LEARNED, LegSnapshot, Snapshot, StepOutcome, Task};
use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::config::EvaluationSettings;
use crate::evaluate::{Mover, evaluation_task, run_episode};
use crate::executor::Workers;

/// Which episode of an evaluation is recorded, and filmed: the first one.
pub(crate) const RECORDED_EPISODE: u64 = 0;

/// Grows when the content of the file changes.
const VERSION: u32 = 1;

/// An episode, step by step: the content of `trajectories/<name>.json`; `docs/run-directory.md` describes it.
///
/// # Shapes
/// T env steps, L legs, M motors. Positions are in the ground's frame: forward, left, up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trajectory {
    /// Version of this form.
    pub version: u32,
    /// Name of the gait, and of the file.
    pub name: String,
    /// What a figure calls it.
    pub label: String,
    /// Name of the robot.
    pub robot: String,
    /// `(L)` names of the legs.
    pub legs: Vec<String>,
    /// Time of an env step [s].
    pub control_dt_s: f64,
    /// The evaluation's speed counts from here on [s].
    pub settle_s: f64,
    /// Slope of the ground, positive uphill [deg].
    pub slope_deg: f64,
    /// The evaluation's seed.
    pub seed: u64,
    /// Number of the episode.
    pub episode: u64,
    /// The accident that ended it.
    pub terminated: Option<&'static str>,
    /// Leg length in the standing pose [m].
    pub leg_length_m: f64,
    /// Torque at the motors' current limit [N m].
    pub max_torque_nm: f64,
    /// Least and greatest commanded swing angle [rad].
    pub swing_limits_rad: Vec<f64>,
    /// Least and greatest commanded extension [rad].
    pub extension_limits_rad: Vec<f64>,
    /// What happened.
    #[serde(flatten)]
    pub steps: Steps,
}

/// A number that is written with four digits after the point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounded(pub f64);

impl Serialize for Rounded {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        /// An episode of 10 s stays below 1 MB, and a tenth of a millimetre is less than a figure shows.
        const DIGITS: f64 = 1e4;
        // Adding 0 turns -0 into 0.
        serializer.serialize_f64((self.0 * DIGITS).round() / DIGITS + 0.0)
    }
}

/// A position [m].
pub type Position = [Rounded; 3];

/// The columns of a [`Trajectory`], one row after each env step.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Steps {
    /// `(T)` time since the start [s].
    pub time_s: Vec<Rounded>,
    /// `(T)` phase of the gait [cycles].
    pub phase: Vec<Rounded>,
    /// `(T x 3)` the body.
    pub position_m: Vec<Position>,
    /// `(T x 3)` roll, pitch, yaw of the body against the ground [rad].
    pub orientation_rad: Vec<[Rounded; 3]>,
    /// `(T x L x 3)` the hips.
    pub hip_m: Vec<Vec<Position>>,
    /// `(T x L x 2 x 3)` the knees.
    pub knee_m: Vec<Vec<[Position; 2]>>,
    /// `(T x L x 3)` the feet's centres.
    pub foot_m: Vec<Vec<Position>>,
    /// `(T x L)` height of the ground below the feet; absent where the ground is a plane [m].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub foot_ground_m: Vec<Vec<Rounded>>,
    /// `(T x L)` 1 where the foot touches the ground, else 0.
    pub contact: Vec<Vec<u8>>,
    /// `(T)` contacts of the ground with anything but feet.
    pub body_contact: Vec<usize>,
    /// `(T x L)` the swing angle that the motors were asked for in the step [rad].
    pub commanded_swing_rad: Vec<Vec<Rounded>>,
    /// `(T x L)` the extension that the motors were asked for in the step [rad].
    pub commanded_extension_rad: Vec<Vec<Rounded>>,
    /// `(T x L)` the swing angle [rad].
    pub swing_rad: Vec<Vec<Rounded>>,
    /// `(T x L)` the extension [rad].
    pub extension_rad: Vec<Vec<Rounded>>,
    /// `(T x M)` the motors' torques in the last physics step [N m].
    pub torque_nm: Vec<Vec<Rounded>>,
    /// `(T x M)` the motor joints' velocities [rad/s].
    pub motor_velocity_rad_per_s: Vec<Vec<Rounded>>,
    /// `(T)` work of the motors in the step [J].
    pub work_j: Vec<Rounded>,
    /// `(T)` reward of the step, an accident's penalty included.
    pub reward: Vec<Rounded>,
}

impl Steps {
    fn push(&mut self, env: &mut Env, outcome: &StepOutcome) {
        let snapshot = env.snapshot();
        let legs = &snapshot.legs;
        self.time_s.push(Rounded(f64::from(env.env_steps()) * env.task().settings.control_dt_s));
        self.phase.push(Rounded(f64::from(env.phase())));
        self.position_m.push(snapshot.position.map(Rounded));
        self.orientation_rad.push(snapshot.orientation_rad.map(Rounded));
        self.hip_m.push(of_legs(legs, |leg| leg.hip.map(Rounded)));
        self.knee_m.push(of_legs(legs, |leg| leg.knees.map(|knee| knee.map(Rounded))));
        self.foot_m.push(of_legs(legs, |leg| leg.foot.map(Rounded)));
        if env.is_on_uneven_ground() {
            self.foot_ground_m.push(of_legs(legs, |leg| Rounded(env.ground_height_m([leg.foot[0], leg.foot[1]]))));
        }
        self.contact.push(of_legs(legs, |leg| u8::from(leg.has_contact)));
        self.commanded_swing_rad.push(of_legs(legs, |leg| Rounded(leg.commanded.swing.into())));
        self.commanded_extension_rad.push(of_legs(legs, |leg| Rounded(leg.commanded.extension.into())));
        self.swing_rad.push(of_legs(legs, |leg| Rounded(leg.actual.swing.into())));
        self.extension_rad.push(of_legs(legs, |leg| Rounded(leg.actual.extension.into())));
        let Snapshot { num_body_contacts, torques_nm, motor_velocities_rad_per_s, .. } = snapshot;
        self.body_contact.push(num_body_contacts);
        self.torque_nm.push(torques_nm.into_iter().map(Rounded).collect());
        self.motor_velocity_rad_per_s.push(motor_velocities_rad_per_s.into_iter().map(Rounded).collect());
        self.work_j.push(Rounded(outcome.work_j));
        self.reward.push(Rounded(outcome.reward));
    }
}

fn of_legs<T>(legs: &[LegSnapshot], value: impl Fn(&LegSnapshot) -> T) -> Vec<T> {
    legs.iter().map(value).collect()
}

/// Records the first episode of a gait's evaluation.
///
/// `name` becomes the file's, `label` is for figures. A step that ended in an unstable state is left out: its numbers
/// mean nothing.
pub fn record(task: &Task, mover: Mover<'_>, settings: &EvaluationSettings, name: &str, label: &str) -> Trajectory {
    let task: Arc<Task> = evaluation_task(task, settings);
    let mut env = Env::new(task.clone());
    let mut steps = Steps::default();
    let episode = run_episode(&mut env, mover, &settings.into(), RECORDED_EPISODE, |env, outcome| {
        if outcome.terminated != Some(Accident::Unstable) {
            steps.push(env, outcome);
        }
    });
    let robot = &task.robot.settings;
    Trajectory {
        version: VERSION,
        name: name.to_owned(),
        label: label.to_owned(),
        robot: robot.name.clone(),
        legs: robot.legs.iter().map(|leg| leg.name().to_owned()).collect(),
        control_dt_s: task.settings.control_dt_s,
        settle_s: settings.settle_s,
        slope_deg: task.settings.slope_deg,
        seed: settings.seed,
        episode: RECORDED_EPISODE,
        terminated: episode.accident.map(Accident::name),
        leg_length_m: robot.stance_height_m,
        max_torque_nm: robot.motor.max_torque_nm,
        swing_limits_rad: robot.limits.swing_rad.clone(),
        extension_limits_rad: robot.limits.extension_rad.clone(),
        steps,
    }
}

/// Records what a verdict compares: the policy's gait, its prior and the robot's default gaits, each from the same start.
///
/// The policy's trajectory is called `learned`, the others have the gaits' names; no gait comes twice.
pub fn record_all(
    task: &Task,
    prior_name: &str,
    policy: Option<&Policy<'_>>,
    settings: &EvaluationSettings,
    workers: &Workers,
) -> Vec<Trajectory> {
    let gaits = task.robot.gaits.iter().filter(|gait| gait.is_default || gait.name == prior_name);
    let of_gaits = gaits.map(|gait| {
        let role = match (gait.name == prior_name, gait.is_default) {
            (true, true) => "prior, default",
            (true, false) => "prior",
            (false, _) => "default",
        };
        let task = task.with_gait(&gait.name).expect("a gait of the robot");
        (task, Mover::Prior, gait.name.clone(), format!("{} ({role})", gait.name))
    });
    let learned =
        policy.map(|policy| (task.clone(), Mover::Policy(policy), LEARNED.to_owned(), "learned gait".to_owned()));
    let movers: Vec<_> = learned.into_iter().chain(of_gaits).collect();
    workers.install(|| {
        movers
            .par_iter()
            .with_max_len(1)
            .map(|(task, mover, name, label)| record(task, *mover, settings, name, label))
            .collect()
    })
}
