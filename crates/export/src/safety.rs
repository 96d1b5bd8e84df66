//! Whether the exported thing may move a robot: what it did in the simulator, held against limits.

use canter_sim::robot::SteppingSettings;
use canter_train::evaluate::GaitReport;
use serde::Serialize;

use crate::certificate::Walked;
use crate::exported::Exported;
use crate::replay::{Wear, coordinate_name, motor_name};

/// What is still allowed; shares are of all control steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Thresholds {
    /// Share of the steps in which one coordinate of a leg may be commanded to its limit. More means that the limits make
    /// the gait, not the policy.
    pub time_at_leg_limit: f64,
    /// Share of the steps in which one motor may be at its greatest torque.
    pub time_at_torque_limit: f64,
    /// Root mean square of a motor's torque, as a share of its greatest: heat grows with the square.
    pub rms_torque: f64,
    /// How far the speed may be from the policy's, as a share of it.
    pub speed_difference: f64,
    /// How many more of the episodes than the policy's may end in a fall.
    pub more_falls: f64,
}

impl Thresholds {
    /// A quarter of the time at a leg's limit, a tenth at the current limit, and half of the greatest torque as lasting
    /// load (a quarter of its heat), which small brushless motors bear with some wind. Speed and falls as the policy's:
    /// ramping in costs a part of the first second, which does not count.
    pub const DEFAULT: Self = Self {
        time_at_leg_limit: 0.25,
        time_at_torque_limit: 0.1,
        rms_torque: 0.5,
        speed_difference: 0.1,
        more_falls: 0.05,
    };
}

/// What a firmware accepts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FirmwareRules {
    /// Least and greatest leg length [m].
    pub leg_length_m: [f64; 2],
    /// Greatest stride frequency [Hz].
    pub max_frequency_hz: f64,
    /// Greatest gains: [A/rad], [A s/rad].
    pub max_gains: [f64; 2],
}

/// How far rounding may take a command beyond a rule [m].
const LENGTH_TOLERANCE_M: f64 = 1e-4;

impl FirmwareRules {
    /// The rules of this robot's firmware, if we know them. Source for Doggo: its firmware's own validity check.
    pub fn of(robot: &str) -> Option<Self> {
        const DOGGO: FirmwareRules =
            FirmwareRules { leg_length_m: [0.08, 0.25], max_frequency_hz: 10.0, max_gains: [320.0, 10.0] };
        (robot == "doggo").then_some(DOGGO)
    }

    /// Whether the firmware takes this gait: its legs neither too long nor too short where it looks, which is in the middle
    /// and at the ends of a step.
    pub fn allow(&self, gait: &SteppingSettings) -> bool {
        let [least_m, most_m] = self.leg_length_m;
        let height_m = gait.stance_height_m;
        height_m + gait.down_amplitude_m <= most_m
            && height_m.hypot(0.5 * gait.step_length_m) <= most_m
            && height_m - gait.up_amplitude_m >= least_m
            && gait.flight_fraction > 0.0
            && gait.flight_fraction <= 1.0
            && (0.0..=self.max_frequency_hz).contains(&gait.stride_frequency_hz)
    }

    /// Whether the firmware takes these gains, a stiffness [A/rad] and a damping [A s/rad] for swing and for extension.
    pub fn allow_gains(&self, gains: [f64; 4]) -> bool {
        let [most_stiffness, most_damping] = self.max_gains;
        gains
            .chunks_exact(2)
            .all(|pair| (0.0..=most_stiffness).contains(&pair[0]) && (0.0..=most_damping).contains(&pair[1]))
    }
}

/// One limit and what was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The limit's name.
    pub limit: &'static str,
    /// What was measured, in words.
    pub measured: String,
    /// What is allowed, in words.
    pub allowed: String,
    /// Whether it is kept.
    pub passed: bool,
}

/// What was measured of policy and export.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// The policy, as it was trained.
    pub policy: Walked,
    /// What is exported.
    pub exported: &'a GaitReport,
    /// What the robot had to bear under the export.
    pub wear: &'a Wear,
    /// The greatest stride frequency that the export can command [Hz].
    pub max_frequency_hz: f64,
    /// Whether it runs in open loop: then its speed need not be the policy's.
    pub is_open_loop: bool,
}

/// Holds everything that was measured against its limit.
pub fn check(exported: &Exported<'_>, measured: &Measured<'_>, thresholds: &Thresholds) -> Vec<Check> {
    let motor = exported.task().robot.motor();
    let Measured { policy, wear, .. } = measured;
    let mut checks = Vec::new();
    let mut push = |limit, (measured, allowed): (String, String), passed| {
        checks.push(Check { limit, measured, allowed, passed });
    };
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);

    let (place, beyond_rad) = wear.farthest_beyond(exported);
    let name = coordinate_name(exported, place);
    let words = (format!("{beyond_rad:.4} rad beyond ({name})"), "0 rad beyond".to_owned());
    push("leg-space limits", words, beyond_rad < 1e-3);

    let (place, share) = wear.most_limited();
    let words = (
        format!("{} of the steps ({})", percent(share), coordinate_name(exported, place)),
        format!("at most {}", percent(thresholds.time_at_leg_limit)),
    );
    push("time at a leg-space limit", words, share <= thresholds.time_at_leg_limit);

    let no_load = motor.no_load_speed_rad_per_s;
    let allowed = || format!("at most {no_load:.1} rad/s, the motor's speed without load");
    push("joint speed", (format!("{:.1} rad/s", wear.motor_speed), allowed()), wear.motor_speed <= no_load);
    let words = (format!("{:.1} rad/s", wear.command_speed), allowed());
    push("speed of the commands", words, wear.command_speed <= no_load);

    let (place, share) = wear.time_at_torque_limit();
    let words = (
        format!("{:.1} % of the steps ({})", 100.0 * share, motor_name(exported, place)),
        format!("at most {}", percent(thresholds.time_at_torque_limit)),
    );
    push("time at the torque limit", words, share <= thresholds.time_at_torque_limit);

    let (place, rms_nm) = wear.rms_torque_nm();
    let allowed_nm = thresholds.rms_torque * motor.max_torque_nm;
    let words = (
        format!("{rms_nm:.2} N m ({})", motor_name(exported, place)),
        format!("at most {allowed_nm:.2} N m, {} of the greatest", percent(thresholds.rms_torque)),
    );
    push("RMS torque (heat)", words, rms_nm <= allowed_nm);

    if let Some(rules) = FirmwareRules::of(&exported.file().card.robot.name) {
        let [low, high] = wear.lengths_m();
        let [least, greatest] = rules.leg_length_m;
        let words = (format!("{low:.3} to {high:.3} m"), format!("{least} to {greatest} m"));
        let is_valid = low >= least - LENGTH_TOLERANCE_M && high <= greatest + LENGTH_TOLERANCE_M;
        push("firmware: leg length", words, is_valid);
        let words =
            (format!("up to {:.2} Hz", measured.max_frequency_hz), format!("at most {} Hz", rules.max_frequency_hz));
        push("firmware: frequency", words, measured.max_frequency_hz <= rules.max_frequency_hz);
    }

    let (own, other) = (measured.exported.speed_m_per_s, policy.speed_m_per_s);
    let words = (format!("{own:.3} m/s"), {
        let share = percent(thresholds.speed_difference);
        if measured.is_open_loop {
            "above 0 m/s (open loop)".to_owned()
        } else {
            format!("{other:.3} m/s within {share}")
        }
    });
    let is_near = (own - other).abs() <= thresholds.speed_difference * other.abs();
    push("speed", words, if measured.is_open_loop { own > 0.0 } else { is_near });

    let share = |falls: u64, episodes: usize| falls as f64 / episodes.max(1) as f64;
    let own = share(measured.exported.falls, measured.exported.speeds_m_per_s.len());
    let other = share(policy.falls, policy.num_episodes);
    let words = (
        format!("{} of the episodes", percent(own)),
        format!(
            "at most {}, the policy's and {} more",
            percent(other + thresholds.more_falls),
            percent(thresholds.more_falls)
        ),
    );
    push("falls", words, own <= other + thresholds.more_falls + 1e-9);
    checks
}

/// The greatest stride frequency that a policy can command [Hz].
pub fn max_frequency_hz(exported: &Exported<'_>) -> f64 {
    let controller = exported.controller();
    let (law, gait) = (controller.law(), controller.gait());
    let saturated = vec![1.0; controller.num_actions()];
    let reversed = vec![-1.0; controller.num_actions()];
    let of = |action: &[f32]| f64::from(law.stride_frequency_hz(&gait, action));
    of(&saturated).max(of(&reversed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use canter_sim::robot::Footfall;

    #[test]
    fn the_firmware_takes_its_own_trot_and_nothing_beyond_its_rules() {
        let rules = FirmwareRules::of("doggo").unwrap();
        let trot = || SteppingSettings {
            name: "trot".to_owned(),
            default: true,
            stable: true,
            footfall: Footfall::Trot,
            stride_frequency_hz: 2.0,
            stance_height_m: 0.17,
            down_amplitude_m: 0.04,
            up_amplitude_m: 0.06,
            flight_fraction: 0.35,
            step_length_m: 0.15,
            phase_offsets_cycles: None,
        };
        assert!(rules.allow(&trot()));
        for broken in [
            SteppingSettings { down_amplitude_m: 0.081, ..trot() },
            // hypot(0.17, 0.19) = 0.255
            SteppingSettings { step_length_m: 0.38, ..trot() },
            SteppingSettings { up_amplitude_m: 0.091, ..trot() },
            SteppingSettings { flight_fraction: 0.0, ..trot() },
            SteppingSettings { stride_frequency_hz: 10.1, ..trot() },
        ] {
            assert!(!rules.allow(&broken), "{broken:?}");
        }
        assert!(rules.allow_gains([80.0, 0.5, 50.0, 0.5]));
        assert!(!rules.allow_gains([80.0, 0.5, 50.0, 10.5]) && !rules.allow_gains([321.0, 0.5, 50.0, 0.5]));
        assert!(FirmwareRules::of("minitaur").is_none());
    }
}
