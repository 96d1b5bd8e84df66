//! What an iteration of training costs in time and memory at one size; prints JSON.
//!
//! A size that is not given is the preset's. Each size needs a process of its own, because memory that was used once
//! hardly ever goes back to the system.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin iteration -- --environments 64 --threads 2
//! ```

use std::time::Instant;

use canter_bench::level::document;
use canter_bench::memory::{peak_resident_mb, resident_mb};
use canter_bench::quartiles;
use canter_train::config::resolve;
use canter_train::executor::Workers;
use canter_train::trainer::Trainer;
use clap::Parser;
use serde_json::json;

/// Times iterations of training at one size.
#[derive(Debug, Parser)]
struct Args {
    /// Environments that collect side by side
    #[arg(long, value_name = "N")]
    environments: Option<usize>,
    /// Env steps of each environment in one iteration
    #[arg(long, value_name = "N")]
    horizon: Option<usize>,
    /// Width of the hidden layers of actor and critic
    #[arg(long, value_name = "N")]
    width: Option<usize>,
    /// Threads; as many as there are cores if not given
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Env steps to time, rounded up to whole iterations; one more iteration goes before them
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    env_steps: usize,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let preset = resolve(&document(&[])?)?.config;
    let num_environments = args.environments.unwrap_or(preset.training.num_environments);
    let horizon = args.horizon.unwrap_or(preset.training.horizon);
    let num_samples = num_environments * horizon;
    let mut overrides = vec![
        ("training.num_environments", num_environments.to_string()),
        ("training.horizon", horizon.to_string()),
        ("ppo.minibatch_size", preset.ppo.minibatch_size.min(num_samples).to_string()),
    ];
    if let Some(width) = args.width {
        overrides.extend(["network.actor_hidden", "network.critic_hidden"].map(|key| (key, width.to_string())));
    }
    let resolved = resolve(&document(&overrides)?)?;
    let workers = Workers::new(args.threads)?;
    let before_mb = resident_mb();
    let mut trainer = Trainer::new(resolved);
    trainer.iterate(&workers)?;

    let num_iterations = args.env_steps.div_ceil(num_samples).max(1);
    let (mut collect_s, mut update_s) = (Vec::new(), Vec::new());
    let start = Instant::now();
    for _ in 0..num_iterations {
        let report = trainer.iterate(&workers)?;
        collect_s.push(report.collect_s);
        update_s.push(report.update_s);
    }
    let total_s = start.elapsed().as_secs_f64();
    let (collect_total_s, update_total_s) = (collect_s.iter().sum::<f64>(), update_s.iter().sum::<f64>());
    let model = trainer.model();
    let report = json!({
        "environments": num_environments,
        "horizon": horizon,
        "width": model.actor.hidden,
        "parameters": model.num_parameters(),
        "threads": workers.num_threads(),
        "iterations": num_iterations,
        "env_steps_per_s": (num_iterations * num_samples) as f64 / total_s,
        "collect_s": quartiles(collect_s),
        "update_s": quartiles(update_s),
        "update_share": update_total_s / (collect_total_s + update_total_s),
        "resident_before_mb": before_mb,
        "resident_mb": resident_mb(),
        "peak_resident_mb": peak_resident_mb(),
    });
    println!("{report:#}");
    Ok(())
}
