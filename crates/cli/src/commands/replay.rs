//! `canter replay`.

use std::process::ExitCode;

use canter_train::run_directory::{RunError, read_blow_up};
use serde_json::json;

use crate::args::ReplayArgs;
use crate::error::CliError;
use crate::output::say;

/// `canter replay`.
pub fn replay(args: &ReplayArgs) -> Result<ExitCode, CliError> {
    let (blow_up, resolved) = read_blow_up(&args.dump)?;
    let replayed = blow_up.replay(&resolved.task);
    let steps = replayed.map_err(|source| RunError::Dump { path: args.dump.clone(), source })?;
    let shown = &steps[steps.len().saturating_sub(args.last)..];
    if args.json {
        let json = json!({ "iteration": blow_up.iteration, "environment": blow_up.environment, "steps": shown });
        say(&format!("{json:#}"));
        return Ok(ExitCode::SUCCESS);
    }
    say(&format!(
        "Environment {} in iteration {}: the last {} of {} env steps, physics steps of {} s.\n",
        blow_up.environment,
        blow_up.iteration,
        shown.len(),
        steps.len(),
        resolved.task.settings.physics_dt_s
    ));
    say("  time s  height m  forward m/s  tilt deg  torque N m  fastest joint");
    for step in shown {
        say(&format!(
            "{:>8.3}{:>10.3}{:>13.2}{:>10.1}{:>12.2}  {} {:.3e}{}",
            step.time_s,
            step.height_m,
            step.velocity_m_per_s,
            step.tilt_deg,
            step.largest_torque_nm,
            step.fastest_joint,
            step.fastest_velocity,
            step.accident.map_or_else(String::new, |accident| format!("  {accident}"))
        ));
    }
    say(
        "\nVelocities of joints are in rad/s, of a body that floats also in m/s. MuJoCo sets a state anew that it cannot go on with.",
    );
    Ok(ExitCode::SUCCESS)
}
