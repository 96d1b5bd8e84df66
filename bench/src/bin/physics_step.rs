//! What the physics step changes: the default gaits and trained policies, judged with finer and coarser ones.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin physics_step -- runs/doggo-*
//! cargo run --release -p canter-bench --bin physics_step -- --seeds 20 --json
//! ```

use std::error::Error;
use std::path::PathBuf;

use canter_bench::level::PRESET;
use canter_sim::Task;
use canter_train::config::{EvaluationSettings, open_preset, resolve};
use canter_train::evaluate::{Mover, evaluate};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::{read_config, read_policy};
use canter_train::trainer::Trainer;
use clap::Parser;
use serde_json::{Value, json};

/// Physics steps [s], the finest first: the others are held against it.
const STEPS_S: [f64; 5] = [0.0005, 0.001, 0.002, 0.0025, 0.005];

/// The first seed of the trainings: no other program trains with it.
const FIRST_SEED: u64 = 201;

/// Compares speeds and falls over physics steps.
#[derive(Debug, Parser)]
struct Args {
    /// Run directories of trained policies
    runs: Vec<PathBuf>,
    /// Policies to train with the preset, each with a seed of its own
    #[arg(long, value_name = "N", default_value_t = 0)]
    seeds: u64,
    /// Env steps of each of these trainings
    #[arg(long, value_name = "N", default_value_t = 300_000)]
    env_steps: u64,
    /// Slope of the ground, positive uphill [deg]
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    slope: f64,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A gait at every physics step.
struct Row {
    name: String,
    speeds_m_per_s: Vec<f64>,
    falls: Vec<u64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let workers = Workers::new(None)?;
    let mut rows = Vec::new();
    let mut judge = |name: &str, mut task: Task, mover: Mover<'_>, settings: &EvaluationSettings| {
        task.settings.slope_deg = args.slope;
        let at =
            |physics_dt_s| evaluate(&task, mover, &EvaluationSettings { physics_dt_s, ..settings.clone() }, &workers);
        let reports: Vec<_> = STEPS_S.into_iter().map(at).collect();
        rows.push(Row {
            name: name.to_owned(),
            speeds_m_per_s: reports.iter().map(|report| report.speed_m_per_s).collect(),
            falls: reports.iter().map(|report| report.falls).collect(),
        });
    };

    let resolved = resolve(&open_preset(PRESET)?)?;
    for gait in resolved.task.robot.default_gaits() {
        let task = resolved.task.with_gait(&gait.name).ok_or("a gait of the robot")?;
        judge(&gait.name, task, Mover::Prior, &resolved.config.evaluation);
    }
    for run in &args.runs {
        let resolved = read_config(run)?;
        let policy = read_policy(run)?;
        policy.check(&resolved.task)?;
        let name = run.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        judge(&name, Task::clone(&resolved.task), Mover::Policy(&policy.policy()), &resolved.config.evaluation);
    }
    for seed in FIRST_SEED..FIRST_SEED + args.seeds {
        let mut document = open_preset(PRESET)?;
        document.set("seed", &seed.to_string());
        document.set("training.max_env_steps", &args.env_steps.to_string());
        let resolved = resolve(&document)?;
        let mut trainer = Trainer::new(resolved.clone());
        while !trainer.is_finished() {
            trainer.iterate(&workers)?;
        }
        let policy = PolicyFile::of(&trainer);
        let mover = Mover::Policy(&policy.policy());
        judge(&format!("{PRESET} {seed}"), Task::clone(&resolved.task), mover, &resolved.config.evaluation);
    }
    if args.json {
        println!("{:#}", json(&args, &rows));
    } else {
        print_table(&rows);
    }
    Ok(())
}

/// How far the speed with a physics step is from that with the finest [share].
fn change(row: &Row, step: usize) -> f64 {
    row.speeds_m_per_s[step] / row.speeds_m_per_s[0] - 1.0
}

fn json(args: &Args, rows: &[Row]) -> Value {
    let rows = rows.iter().map(|row| {
        json!({
            "gait": row.name,
            "speeds_m_per_s": row.speeds_m_per_s,
            "falls": row.falls,
            "change_at_0_002": change(row, 2),
            "change_at_0_005": change(row, 4),
        })
    });
    json!({ "steps_s": STEPS_S, "env_steps": args.env_steps, "rows": rows.collect::<Vec<_>>() })
}

/// Speed at every step, falls in brackets, and how far 0.002 and 0.005 s are from the finest.
fn print_table(rows: &[Row]) {
    let heads: Vec<String> = STEPS_S.iter().map(|step| format!(" {step} s |")).collect();
    println!("| gait |{} 0.002 s to finest | 0.005 s to finest |", heads.concat());
    println!("| --- |{}", " --- |".repeat(STEPS_S.len() + 2));
    for row in rows {
        let speeds = row.speeds_m_per_s.iter().zip(&row.falls);
        let cells: Vec<String> = speeds.map(|(speed, falls)| format!(" {speed:.3} ({falls}) |")).collect();
        let [judged, trained] = [2, 4].map(|step| 100.0 * change(row, step));
        println!("| {} |{} {judged:+.1} % | {trained:+.1} % |", row.name, cells.concat());
    }
}
