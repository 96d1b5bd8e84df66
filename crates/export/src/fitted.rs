//! The learned gait as a few parameters: the nearest sine or stepping gait, and the commands of Doggo's firmware.

use std::fmt::Write;

use canter_gait::prior::TABLE_POINTS;
use canter_sim::robot::{Footfall, GaitSettings};
use canter_sim::settings::write_plain;
use canter_train::gait_fit::{self, Fit, FitError, GaitBlock, Shape};

use crate::exported::Exported;
use crate::safety::FirmwareRules;
use crate::table::OpenLoop;

/// The gains of Doggo's firmware in (theta, gamma) space, stiffness [A/rad] and damping [A s/rad] of each: those that the
/// model has. Source: `docs/doggo-model.md`.
const DOGGO_GAINS: [f64; 4] = [80.0, 0.5, 50.0, 0.5];

/// A gait of few parameters that is near the learned one.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The gait, and how far it is from the learned one's average.
    pub fit: Fit,
    /// Its targets.
    pub open_loop: OpenLoop,
}

/// The gait of either shape, or of one, that is nearest to the learned one's average.
///
/// # Errors
/// If there is none that the robot can walk.
pub fn fit(exported: &Exported<'_>, average: &OpenLoop, shape: Option<Shape>) -> Result<Fitted, FitError> {
    let robot = &exported.task().robot;
    // Four decimals, as the other numbers of a fit.
    let frequency_hz = (f64::from(average.stride_frequency_hz) * 1e4).round() / 1e4;
    let fit = match shape {
        Some(shape) => gait_fit::fit(robot, &average.rows, frequency_hz, shape),
        None => gait_fit::closest(robot, &average.rows, frequency_hz),
    }?;
    let rows = gait_fit::targets(robot, &fit.gait, TABLE_POINTS);
    let spread = rows.iter().map(|row| vec![0.0; row.len()]).collect();
    Ok(Fitted { open_loop: OpenLoop { stride_frequency_hz: fit.gait.stride_frequency_hz, rows, spread }, fit })
}

/// The gait as it stands in a robot.toml.
pub fn toml(fitted: &Fitted) -> String {
    let text = write_plain(&GaitBlock { gaits: vec![fitted.fit.settings.clone()] });
    let rms_rad = fitted.fit.rms_rad;
    format!("# {rms_rad:.4} rad (root mean square) from the learned gait's average.\n{}\n", text.trim())
}

/// The firmware's serial commands for a stepping gait, one a line; none for another robot, shape or footfall, or one that the
/// firmware would refuse.
///
/// `S` stops: what is set then is for the next gait, which the letter of a footfall begins. That also sets gains, so ours come
/// after it: so the firmware's interpreter of commands and its transitions between states have it.
pub fn firmware_commands(exported: &Exported<'_>, fitted: &Fitted) -> Option<String> {
    let rules = FirmwareRules::of(&exported.file().card.robot.name)?;
    let GaitSettings::Stepping(gait) = &fitted.fit.settings else { return None };
    let footfall = match gait.footfall {
        Footfall::Trot => 'T',
        Footfall::Walk => 'W',
        Footfall::Bound => 'B',
        Footfall::Pronk => 'P',
        _ => return None,
    };
    if !rules.allow(gait) || !rules.allow_gains(DOGGO_GAINS) {
        return None;
    }
    let mut text = "S\n".to_owned();
    let values = [
        ('f', gait.stride_frequency_hz),
        ('l', gait.step_length_m),
        ('h', gait.stance_height_m),
        ('u', gait.up_amplitude_m),
        ('d', gait.down_amplitude_m),
        ('p', gait.flight_fraction),
        // Both sides step equally far.
        ('s', 0.0),
    ];
    for (letter, value) in values {
        let _ = writeln!(text, "{letter} {value}");
    }
    let gains: Vec<String> = DOGGO_GAINS.iter().map(f64::to_string).collect();
    let _ = writeln!(text, "{footfall}\ng {}", gains.join(" "));
    Some(text)
}
