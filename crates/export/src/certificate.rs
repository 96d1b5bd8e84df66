//! The certificate that lies beside an exported file: how it did in the simulator, and against which limits.

use std::fmt::Write;

use canter_train::config::EvaluationSettings;
use canter_train::evaluate::GaitReport;
use canter_train::executor::Workers;
use serde::{Deserialize, Serialize};

use crate::exported::Exported;
use crate::replay::{Subject, replay};
use crate::safety::{Check, Measured, Thresholds, check, max_frequency_hz};
use crate::table::OpenLoop;

/// Version of the certificate's JSON form.
pub const FORMAT_VERSION: u32 = 1;

/// What a replay showed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// See [`FORMAT_VERSION`].
    pub format_version: u32,
    /// What was exported.
    pub format: &'static str,
    /// Whether it runs without sensors.
    pub is_open_loop: bool,
    /// The robot.
    pub robot: String,
    /// Hexadecimal, as in the policy's file.
    pub robot_fingerprint: String,
    /// The gait that the policy was learned from.
    pub gait: String,
    /// Whether every limit was kept.
    pub passed: bool,
    /// The limits.
    pub checks: Vec<Check>,
    /// What the limits were taken from.
    pub thresholds: Thresholds,
    /// The policy as it was trained: from the run's own evaluation, else measured anew.
    pub policy: Walked,
    /// The exported thing, from the same starts.
    pub exported: GaitReport,
    /// What the robot had to bear, the worst of all motors.
    pub wear: WearCard,
    /// How it was measured.
    pub protocol: Protocol,
}

/// How a policy walked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Walked {
    /// Mean forward speed [m/s].
    pub speed_m_per_s: f64,
    /// Episodes that ended in a fall.
    pub falls: u64,
    /// Episodes.
    pub num_episodes: usize,
}

impl Walked {
    /// What a run's `eval.json` says of its policy; none unless it was measured as this evaluation measures.
    pub fn from_eval(eval: &serde_json::Value, settings: &EvaluationSettings) -> Option<Self> {
        let (protocol, policy) = (&eval["protocol"], &eval["policy"]);
        let is_same = protocol["num_episodes"].as_u64() == Some(settings.num_episodes as u64)
            && protocol["seed"].as_u64() == Some(settings.seed)
            && protocol["episode_s"].as_f64() == Some(settings.episode_s)
            && protocol["settle_s"].as_f64() == Some(settings.settle_s)
            && protocol["physics_dt_s"].as_f64() == Some(settings.physics_dt_s);
        let walked = || {
            Some(Self {
                speed_m_per_s: policy["speed_m_per_s"].as_f64()?,
                falls: policy["falls"].as_u64()?,
                num_episodes: settings.num_episodes,
            })
        };
        if is_same { walked() } else { None }
    }
}

/// What the robot had to bear under the export.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WearCard {
    /// Greatest root mean square of torque of a motor [N m].
    pub rms_torque_nm: f64,
    /// Greatest share of the steps that a motor was at its torque limit.
    pub time_at_torque_limit: f64,
    /// Greatest speed of a motor [rad/s].
    pub motor_speed_rad_per_s: f64,
    /// Greatest speed that the commands ask of a motor [rad/s].
    pub command_speed_rad_per_s: f64,
    /// Least and greatest commanded leg length [m].
    pub leg_length_m: [f64; 2],
}

/// The replay's episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Protocol {
    /// How many.
    pub num_episodes: usize,
    /// How long [s].
    pub episode_s: f64,
    /// The speed counts from here on [s].
    pub settle_s: f64,
    /// Seed of the starts.
    pub seed: u64,
    /// Slope of the ground, positive uphill [deg].
    pub slope_deg: f64,
}

/// What is exported, and how the policy did before.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// The policy and its task.
    pub exported: Exported<'a>,
    /// The format's name.
    pub format: &'static str,
    /// The open loop, where the format is one.
    pub open_loop: Option<&'a OpenLoop>,
    /// The policy as it was judged after its training; none: it is measured now.
    pub judged: Option<Walked>,
}

/// Replays a candidate and holds it against the limits.
pub fn certify(
    candidate: &Candidate<'_>,
    settings: &EvaluationSettings,
    thresholds: &Thresholds,
    workers: &Workers,
) -> Certificate {
    let exported = &candidate.exported;
    let weight_n = exported.task().weight_n();
    let policy = candidate.judged.unwrap_or_else(|| {
        let report = GaitReport::new(&replay(exported, Subject::Policy, settings, workers).0, weight_n);
        Walked { speed_m_per_s: report.speed_m_per_s, falls: report.falls, num_episodes: settings.num_episodes }
    });
    let subject = candidate.open_loop.map_or(Subject::Runtime, Subject::OpenLoop);
    let (episodes, wear) = replay(exported, subject, settings, workers);
    let own = GaitReport::new(&episodes, weight_n);
    let measured = Measured {
        policy,
        exported: &own,
        wear: &wear,
        max_frequency_hz: candidate
            .open_loop
            .map_or_else(|| max_frequency_hz(exported), |open_loop| f64::from(open_loop.stride_frequency_hz)),
        is_open_loop: candidate.open_loop.is_some(),
    };
    let checks = check(exported, &measured, thresholds);
    let card = &exported.file().card;
    Certificate {
        format_version: FORMAT_VERSION,
        format: candidate.format,
        is_open_loop: candidate.open_loop.is_some(),
        robot: card.robot.name.clone(),
        robot_fingerprint: card.robot.fingerprint.clone(),
        gait: card.gait.name.clone(),
        passed: checks.iter().all(|check| check.passed),
        checks,
        thresholds: *thresholds,
        wear: WearCard {
            rms_torque_nm: wear.rms_torque_nm().1,
            time_at_torque_limit: wear.time_at_torque_limit().1,
            motor_speed_rad_per_s: wear.motor_speed,
            command_speed_rad_per_s: wear.command_speed,
            leg_length_m: wear.lengths_m(),
        },
        policy,
        exported: own,
        protocol: Protocol {
            num_episodes: settings.num_episodes,
            episode_s: settings.episode_s,
            settle_s: settings.settle_s,
            seed: settings.seed,
            slope_deg: exported.task().settings.slope_deg,
        },
    }
}

impl Certificate {
    /// The limits that were not kept.
    pub fn broken(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.passed)
    }

    /// The certificate for a person.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let verdict = if self.passed { "every limit was kept" } else { "NOT SAFE: limits were broken" };
        let _ =
            writeln!(text, "Replay of a {} export for {} (gait {}): {verdict}\n", self.format, self.robot, self.gait);
        for check in &self.checks {
            let mark = if check.passed { "ok    " } else { "BROKEN" };
            let _ = writeln!(text, "{mark}  {}: {}; allowed: {}", check.limit, check.measured, check.allowed);
        }
        let Protocol { num_episodes, episode_s, settle_s, seed, slope_deg } = self.protocol;
        let _ = writeln!(
            text,
            "\nSimulated: {num_episodes} episodes of {episode_s} s on {slope_deg} degrees, seed {seed}, speed from {settle_s} s on; \
             policy {:.3} m/s, this export {:.3} m/s.\nA simulation is no robot: let it hang in the air for its first steps.",
            self.policy.speed_m_per_s, self.exported.speed_m_per_s
        );
        text
    }
}
