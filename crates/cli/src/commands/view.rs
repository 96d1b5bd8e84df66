//! `canter view`.

use std::process::ExitCode;

use crate::args::ViewArgs;
use crate::error::CliError;

/// `canter view`.
#[cfg(feature = "view")]
pub fn view(args: &ViewArgs) -> Result<ExitCode, CliError> {
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    use canter_sim::mujoco::viewer::Viewer;
    use canter_train::evaluate::Mover;
    use canter_train::film::take::{Clock, shoot};

    use crate::commands::{learned, with_slope};
    use crate::output::say;

    /// What a screen shows each second, mostly.
    const FRAMES_PER_S: u32 = 60;

    let (resolved, policy) = learned(&args.run, |document| with_slope(document, args.slope))?;
    let (task, evaluation) = (&resolved.task, &resolved.config.evaluation);
    let clock = Clock { length_s: evaluation.episode_s, frames_per_s: FRAMES_PER_S };
    let take = shoot(task, Mover::Policy(&policy.policy()), evaluation, clock, "learned gait")?;
    let mut viewer = Viewer::open(&task.robot, &format!("canter: {}", args.run.display()))?;
    say("In the window, [ and ] change to the model's cameras, which may follow the robot; Control + Q closes it.");
    let begin = Instant::now();
    let mut number: u32 = 0;
    while viewer.show(&take.shots[number as usize % take.shots.len()].pose)? {
        let next = begin + Duration::from_secs(1) * (number + 1) / FRAMES_PER_S;
        sleep(next.saturating_duration_since(Instant::now()));
        // A slow machine leaves pictures out.
        number = (begin.elapsed().as_secs_f64() * f64::from(FRAMES_PER_S)) as u32;
    }
    Ok(ExitCode::SUCCESS)
}

/// `canter view`, in a build that cannot.
#[cfg(not(feature = "view"))]
pub fn view(args: &ViewArgs) -> Result<ExitCode, CliError> {
    Err(CliError::NoViewer(args.run.display().to_string(), crate::output::program()))
}
