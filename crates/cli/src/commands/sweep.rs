//! `canter sweep`.

use std::process::ExitCode;

use canter_train::sweep::plan::Plan;
use canter_train::sweep::results::{PointReport, Sweep};
use canter_train::sweep::{self, SweepFolder};

use crate::args::SweepArgs;
use crate::commands::report::report_finished;
use crate::commands::workers;
use crate::error::{CliError, STOPPED};
use crate::interrupt::{Interrupt, STOPPING_TRAINING};
use crate::output::{event, program, say, set_log_format};
use crate::progress::JobsLine;

/// `canter sweep`.
pub fn sweep(args: &SweepArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let steps = args.steps.map(|steps| ("training.max_env_steps".to_owned(), steps.to_string()));
    let plan = Plan {
        preset: args.preset.clone(),
        overrides: args.overrides.iter().cloned().chain(steps).collect(),
        axes: args.over.clone(),
        num_random: args.random,
        seeds: (args.first_seed..args.first_seed + args.seeds).collect(),
    };
    let folder = SweepFolder::open(args.out.as_deref(), plan)?;
    let num_threads = workers(args.threads)?.num_threads();
    let shown = folder.path().display();
    say(&format!(
        "Sweeping over {}: {} points with {} seeds each, {num_threads} trainings side by side, into {shown}",
        folder.plan().axes.iter().map(|axis| axis.key.as_str()).collect::<Vec<_>>().join(", "),
        folder.num_points(),
        args.seeds
    ));
    let interrupt = Interrupt::listen(STOPPING_TRAINING)?;
    let line = JobsLine::new();
    let outcome = sweep::sweep(&folder, num_threads, &interrupt.stop, &|progress| line.show(progress));
    line.finish();
    let outcome = outcome?;
    interrupt.everything_is_saved();
    let Some(sweep) = outcome else {
        say(&format!("Stopped, saved. Go on with the same command and --out {shown}"));
        return Ok(ExitCode::from(STOPPED));
    };
    event("sweep", || serde_json::to_value(&sweep).expect("a sweep has string keys only"));
    say(&format!("\n{}\n", describe(&sweep)));
    say(&format!("Numbers:  {shown}/sweep.json; each training in a folder of its own, for `{} report`", program()));
    report_finished(folder.path());
    Ok(ExitCode::SUCCESS)
}

/// The points as a table.
fn describe(sweep: &Sweep) -> String {
    let value_width = |i: usize| {
        let values = sweep.points.iter().map(|point| point.values[i].chars().count());
        values.chain([sweep.keys[i].chars().count()]).max().unwrap_or(0) + 2
    };
    let widths: Vec<usize> = (0..sweep.keys.len()).map(value_width).collect();
    let row = |values: &[String], [speed, ratio, default, falls]: [&str; 4]| {
        let values: String = values.iter().zip(&widths).map(|(value, width)| format!("{value:<width$}")).collect();
        format!("{values}{speed:>22}{ratio:>22}{default:>18}{falls:>10}")
    };
    let head = row(&sweep.keys, ["speed m/s [95 %]", "times default [95 %]", "default m/s", "falls"]);
    let interval = |value: f64, [low, high]: [f64; 2]| {
        if sweep.seeds.len() > 1 { format!("{value:.2} [{low:.2}, {high:.2}]") } else { format!("{value:.2}") }
    };
    let of_point = |point: &PointReport| {
        let ratio = point.ratio_iqm.zip(point.ratio_ci).map(|(iqm, ci)| interval(iqm, ci));
        row(
            &point.values,
            [
                &interval(point.speed_iqm, point.speed_ci),
                ratio.as_deref().unwrap_or("-"),
                &format!("{} {:.2}", point.default_gait, point.default_speed_m_per_s),
                &format!("{}/{}", point.falls[0], point.falls[1]),
            ],
        )
    };
    let lines: Vec<String> = [head].into_iter().chain(sweep.points.iter().map(of_point)).collect();
    let seeds = match sweep.seeds.as_slice() {
        [seed] => {
            format!("One training each, seed {seed}: another seed gives another speed; --seeds N shows how much.")
        }
        seeds => format!("Interquartile means over {} training seeds, with 95 % intervals.", seeds.len()),
    };
    format!("{}\n\n{seeds}", lines.join("\n"))
}
