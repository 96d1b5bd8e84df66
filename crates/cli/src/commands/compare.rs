//! `canter compare`.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use canter_train::compare::protocol::{CompareSettings, Rung, RungKind};
use canter_train::compare::{self, CompareFolder};
use canter_train::ranks;

use crate::args::CompareArgs;
use crate::commands::report::report_finished;
use crate::commands::workers;
use crate::comparison::describe;
use crate::error::{CliError, STOPPED};
use crate::interrupt::{Interrupt, STOPPING_TRAINING};
use crate::output::{event, program, say, set_log_format};
use crate::progress::JobsLine;
use crate::ranks::Ranks;

/// Budget and seeds of the full comparison.
const FULL: (u64, u64) = (1_000_000, 5);

/// Budget and seeds of the quick one.
const QUICK: (u64, u64) = (60_000, 2);

/// `canter compare`.
pub fn compare(args: &CompareArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let ranks = Ranks::enter()?;
    let settings = settings(args);
    let num_threads = workers(ranks.threads(args.threads))?.num_threads();
    if ranks.is_follower() {
        return follow(&ranks, &settings, num_threads);
    }
    let folder = CompareFolder::open(args.out.as_deref(), &settings).map_err(CliError::from);
    let folder = lead(&ranks, folder)?;
    let shown = folder.path().display();
    say(&format!(
        "Comparing {} with {} env steps for each of {} seeds, {} jobs side by side, into {shown}",
        settings.rungs.iter().map(|rung| rung.name()).collect::<Vec<_>>().join(", "),
        settings.budget_env_steps,
        settings.seeds.len(),
        num_threads * ranks.communicator.num_ranks()
    ));
    let interrupt = Interrupt::listen(ranks.stopping(STOPPING_TRAINING))?;
    let line = JobsLine::new();
    if ranks.communicator.num_ranks() > 1 {
        let share = (0, ranks.communicator.num_ranks());
        let is_stopped =
            compare::do_share(&folder, share, num_threads, &interrupt.stop, &|progress| line.show(progress))?;
        if ranks::any(&*ranks.communicator, is_stopped) {
            interrupt.stop.store(true, Ordering::Relaxed);
        }
        ranks.leave();
    }
    let outcome = compare::compare(&folder, num_threads, &interrupt.stop, &|progress| line.show(progress));
    line.finish();
    let outcome = outcome?;
    interrupt.everything_is_saved();
    let Some(comparison) = outcome else {
        say(&format!("Stopped, saved. Go on with:  {} compare{} --out {shown}", program(), options(args)));
        return Ok(ExitCode::from(STOPPED));
    };
    event("comparison", || serde_json::to_value(&comparison).expect("a comparison has string keys only"));
    say(&format!("\n{}\n", describe(&comparison)));
    say(&format!("Numbers:  {shown}/compare.json; the rules: docs/protocol.md"));
    report_finished(folder.path());
    Ok(ExitCode::SUCCESS)
}

/// Tells the other ranks which folder rank 0 has opened, or that there is none.
fn lead(ranks: &Ranks, folder: Result<CompareFolder, CliError>) -> Result<CompareFolder, CliError> {
    if ranks.communicator.num_ranks() == 1 {
        return folder;
    }
    let path = folder.and_then(|folder| match folder.path().canonicalize() {
        Ok(path) => Ok((path.display().to_string(), folder)),
        Err(error) => Err(CliError::File(folder.path().display().to_string(), error)),
    });
    ranks::tell(&*ranks.communicator, path.as_ref().map_or(&[], |(path, _)| path.as_bytes()));
    let ready = if path.is_ok() { ranks::all_are_ready(&*ranks.communicator, "") } else { Ok(()) };
    if path.is_err() || ready.is_err() {
        // Every rank knows that there is nothing to do.
        ranks.leave();
    }
    let (_, folder) = path?;
    ready?;
    Ok(folder)
}

/// Does this rank's share of the jobs and says nothing.
fn follow(ranks: &Ranks, settings: &CompareSettings, num_threads: usize) -> Result<ExitCode, CliError> {
    let communicator = &*ranks.communicator;
    let path = String::from_utf8_lossy(&ranks::hear(communicator)).into_owned();
    if !path.is_empty() {
        let folder = CompareFolder::join(Path::new(&path), settings);
        let problem = folder.as_ref().err().map(ToString::to_string).unwrap_or_default();
        let is_ready = ranks::all_are_ready(communicator, &problem).is_ok();
        if let Some(folder) = folder.ok().filter(|_| is_ready) {
            let interrupt = Interrupt::listen(ranks.stopping(STOPPING_TRAINING))?;
            let share = (communicator.rank(), communicator.num_ranks());
            let is_stopped = compare::do_share(&folder, share, num_threads, &interrupt.stop, &|_| {})?;
            ranks::any(communicator, is_stopped);
        }
    }
    ranks.leave();
    Ok(ExitCode::SUCCESS)
}

/// What was typed, resolved.
fn settings(args: &CompareArgs) -> CompareSettings {
    let (budget, seeds) = if args.quick { QUICK } else { FULL };
    let (budget, seeds) = (args.budget.unwrap_or(budget), args.seeds.unwrap_or(seeds));
    let mut settings =
        if args.quick { CompareSettings::quick(budget, seeds) } else { CompareSettings::full(budget, seeds) };
    if let Some(rungs) = &args.rungs {
        settings.rungs.retain(|rung: &Rung| rung.kind() == RungKind::Gait || rungs.contains(rung));
    }
    settings
}

/// The options that select this comparison, to be typed again.
fn options(args: &CompareArgs) -> String {
    let mut options = String::new();
    if args.quick {
        options += " --quick";
    }
    if let Some(budget) = args.budget {
        options += &format!(" --budget {budget}");
    }
    if let Some(seeds) = args.seeds {
        options += &format!(" --seeds {seeds}");
    }
    if let Some(rungs) = &args.rungs {
        options += &format!(" --rungs {}", rungs.iter().map(|rung| rung.name()).collect::<Vec<_>>().join(","));
    }
    options
}
