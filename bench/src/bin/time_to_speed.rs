//! How long a training needs until the learned gait is so many times as fast as the default gait; prints JSON.
//!
//! The clock starts before the preset is read and stops after the second evaluation in a row that reaches the speed;
//! evaluations count. The default speed is that of the fastest default gait from the same starts, measured before the
//! clock starts.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin time_to_speed -- --seed 1 --threads 2
//! ```

use std::time::Instant;

use canter_bench::level::{PRESET, conditions, default_speed, resolve_on_level_ground, speed};
use canter_bench::memory::peak_resident_mb;
use canter_train::config::{open_preset, resolve};
use canter_train::evaluate::Mover;
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::trainer::Trainer;
use clap::Parser;
use serde_json::json;

/// Times a training until its gait is fast enough.
#[derive(Debug, Parser)]
struct Args {
    /// Seed of the training
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Threads; as many as there are cores if not given
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// The speed to reach, as a multiple of the default speed
    #[arg(long, value_name = "X", default_value_t = 1.5)]
    times: f64,
    /// Env steps between two evaluations
    #[arg(long, value_name = "N", default_value_t = 40_000, value_parser = clap::value_parser!(u64).range(1..))]
    evaluate_every: u64,
    /// Env steps after which the training is given up
    #[arg(long, value_name = "N", default_value_t = 3_000_000)]
    max_env_steps: u64,
}

/// Evaluations in a row that must reach the speed: one alone may be luck.
const NUM_IN_A_ROW: usize = 2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let workers = Workers::new(args.threads)?;
    let level = resolve_on_level_ground(&[])?;
    let default_speed = default_speed(&level, &workers);
    let target = args.times * default_speed;

    let start = Instant::now();
    let mut document = open_preset(PRESET)?;
    document.set("seed", &args.seed.to_string());
    let mut trainer = Trainer::new(resolve(&document)?);
    let conditions = conditions(&level);
    let (mut evaluations, mut num_reached, mut reached_s) = (Vec::new(), 0, None);
    let mut next_evaluation = args.evaluate_every;
    while reached_s.is_none() && trainer.progress().env_steps < args.max_env_steps {
        trainer.iterate(&workers)?;
        let env_steps = trainer.progress().env_steps;
        if env_steps < next_evaluation {
            continue;
        }
        next_evaluation += args.evaluate_every;
        let policy = PolicyFile::of(&trainer);
        let speed = speed(&level.task, Mover::Policy(&policy.policy()), &conditions, &workers);
        let seconds = start.elapsed().as_secs_f64();
        evaluations.push(json!({ "seconds": seconds, "env_steps": env_steps, "speed_m_per_s": speed }));
        num_reached = if speed >= target { num_reached + 1 } else { 0 };
        reached_s = (num_reached == NUM_IN_A_ROW).then_some(seconds);
    }
    let report = json!({
        "seed": args.seed,
        "threads": workers.num_threads(),
        "default_speed_m_per_s": default_speed,
        "target_m_per_s": target,
        "seconds": reached_s,
        "env_steps": trainer.progress().env_steps,
        "peak_resident_mb": peak_resident_mb(),
        "evaluations": evaluations,
    });
    println!("{report:#}");
    Ok(())
}
