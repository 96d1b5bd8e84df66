//! `canter film`.

use std::process::ExitCode;
use std::sync::atomic::Ordering;

use canter_train::evaluate::Mover;
use canter_train::film::take::{Clock, shoot};
use canter_train::film::{self, FilmSettings, Format};

use crate::args::FilmArgs;
use crate::commands::{learned, with_slope};
use crate::error::{CliError, STOPPED};
use crate::interrupt::Interrupt;
use crate::output::say;
use crate::progress::FilmLine;

/// `canter film`.
pub fn film(args: &FilmArgs) -> Result<ExitCode, CliError> {
    let path = args.out.clone().unwrap_or_else(|| args.run.join("film.gif"));
    Format::of(&path)?;
    let (resolved, policy) = learned(&args.run, |document| with_slope(document, args.slope))?;
    let settings = FilmSettings { clock: Clock { length_s: args.seconds, frames_per_s: args.fps }, size: args.size };
    let interrupt = Interrupt::listen("\nstopping; no film is written")?;

    let (task, config) = (&resolved.task, &resolved.config);
    let policy = policy.policy();
    let prior = format!("{} (prior)", config.policy.prior);
    let takes = [(Mover::Prior, prior.as_str()), (Mover::Policy(&policy), "learned gait")]
        .map(|(mover, label)| shoot(task, mover, &config.evaluation, settings.clock, label));
    let [prior, learned] = takes;
    let line = FilmLine::new(settings.clock.num_frames());
    let is_finished = film::film(&path, &task.robot, &[prior?, learned?], &settings, &mut |frames| {
        line.show(frames);
        !interrupt.stop.load(Ordering::Relaxed)
    });
    line.finish();
    if !is_finished? {
        return Ok(ExitCode::from(STOPPED));
    }
    say(&format!("Film:     {}", path.display()));
    Ok(ExitCode::SUCCESS)
}
