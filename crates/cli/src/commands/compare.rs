//! `canter compare`.

use std::process::ExitCode;

use canter_train::compare::protocol::{CompareSettings, Rung, RungKind};
use canter_train::compare::{self, CompareFolder};

use crate::args::CompareArgs;
use crate::commands::report::report_finished;
use crate::commands::workers;
use crate::comparison::describe;
use crate::error::{CliError, STOPPED};
use crate::interrupt::{Interrupt, STOPPING_TRAINING};
use crate::output::{event, program, say, set_log_format};
use crate::progress::JobsLine;

/// Budget and seeds of the full comparison.
const FULL: (u64, u64) = (1_000_000, 5);

/// Budget and seeds of the quick one.
const QUICK: (u64, u64) = (60_000, 2);

/// `canter compare`.
pub fn compare(args: &CompareArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let settings = settings(args);
    let folder = CompareFolder::open(args.out.as_deref(), &settings)?;
    let num_threads = workers(args.threads)?.num_threads();
    let shown = folder.path().display();
    say(&format!(
        "Comparing {} with {} env steps for each of {} seeds, {num_threads} jobs side by side, into {shown}",
        settings.rungs.iter().map(|rung| rung.name()).collect::<Vec<_>>().join(", "),
        settings.budget_env_steps,
        settings.seeds.len()
    ));
    let interrupt = Interrupt::listen(STOPPING_TRAINING)?;
    let line = JobsLine::new();
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
