//! `canter robots`.

use std::process::ExitCode;

use canter_sim::settings::write_commented;
use canter_sim::{Robot, built_in_robots};

use crate::args::RobotsArgs;
use crate::error::CliError;
use crate::output::say;

/// `canter robots`.
pub fn robots(args: &RobotsArgs) -> Result<ExitCode, CliError> {
    if let Some(name) = &args.robot {
        let robot = Robot::load(name)?;
        say(&format!("# The compiled model weighs {:.3} kg.\n", robot.model.total_mass_kg()));
        say(write_commented(&robot.settings).trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    for name in built_in_robots() {
        let robot = Robot::load(name)?;
        let gaits: Vec<_> = robot
            .gaits
            .iter()
            .map(|gait| if gait.is_default { format!("{} (default)", gait.name) } else { gait.name.clone() })
            .collect();
        say(&format!("{name:<12}{}\n{:<12}gaits: {}", robot.settings.description, "", gaits.join(", ")));
    }
    Ok(ExitCode::SUCCESS)
}
