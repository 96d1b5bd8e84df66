//! What the physics step changes: the default gaits and trained policies, judged with finer and coarser ones.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin physics_step -- runs/doggo-*
//! ```

use std::error::Error;
use std::path::PathBuf;

use canter_sim::Task;
use canter_train::config::{DEFAULT_PRESET, EvaluationSettings, open_preset, resolve};
use canter_train::evaluate::{GaitReport, Mover, evaluate};
use canter_train::executor::Workers;
use canter_train::run_directory::{read_config, read_policy};
use clap::Parser;

/// Physics steps [s], the finest first: the others are held against it.
const STEPS_S: [f64; 5] = [0.0005, 0.001, 0.002, 0.0025, 0.005];

/// Compares speeds and falls over physics steps.
#[derive(Debug, Parser)]
struct Args {
    /// Run directories of trained policies
    runs: Vec<PathBuf>,
    /// Slope of the ground, positive uphill [deg]
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    slope: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let workers = Workers::new(None)?;
    print!("| gait |");
    STEPS_S.iter().for_each(|step| print!(" {step} s |"));
    println!(" 0.002 s to finest | 0.005 s to finest |\n| --- |{}", " --- |".repeat(STEPS_S.len() + 2));
    let resolved = resolve(&open_preset(DEFAULT_PRESET)?)?;
    for gait in resolved.task.robot.default_gaits() {
        let task = resolved.task.with_gait(&gait.name).ok_or("a gait of the robot")?;
        print_row(&gait.name, &on_slope(task, args.slope), Mover::Prior, &resolved.config.evaluation, &workers);
    }
    for run in &args.runs {
        let resolved = read_config(run)?;
        let policy = read_policy(run)?;
        policy.check(&resolved.task)?;
        let name = run.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let task = on_slope(Task::clone(&resolved.task), args.slope);
        print_row(&name, &task, Mover::Policy(&policy.policy()), &resolved.config.evaluation, &workers);
    }
    Ok(())
}

fn on_slope(mut task: Task, slope_deg: f64) -> Task {
    task.settings.slope_deg = slope_deg;
    task
}

/// Speed at every step, falls in brackets, and how far 0.002 and 0.005 s are from the finest.
fn print_row(name: &str, task: &Task, mover: Mover<'_>, settings: &EvaluationSettings, workers: &Workers) {
    let at = |physics_dt_s| evaluate(task, mover, &EvaluationSettings { physics_dt_s, ..settings.clone() }, workers);
    let reports: Vec<GaitReport> = STEPS_S.into_iter().map(at).collect();
    print!("| {name} |");
    for report in &reports {
        print!(" {:.3} ({}) |", report.speed_m_per_s, report.falls);
    }
    let finest = reports[0].speed_m_per_s;
    let change = |place: usize| 100.0 * (reports[place].speed_m_per_s / finest - 1.0);
    println!(" {:+.1} % | {:+.1} % |", change(2), change(4));
}
