//! Memory over a long training; prints JSON. A program that leaks a byte per env step shows it after 10 million.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin endurance
//! ```

use canter_bench::level::PRESET;
use canter_bench::memory::resident_mb;
use canter_train::config::{open_preset, resolve};
use canter_train::executor::Workers;
use canter_train::trainer::Trainer;
use clap::Parser;
use serde_json::json;

/// Watches the memory of a long training.
#[derive(Debug, Parser)]
struct Args {
    /// Env steps of the training
    #[arg(long, value_name = "N", default_value_t = 10_000_000)]
    env_steps: u64,
    /// Threads; as many as there are cores if not given
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

/// Readings of the memory over the whole training.
const NUM_READINGS: u64 = 100;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let workers = Workers::new(args.threads)?;
    let mut trainer = Trainer::new(resolve(&open_preset(PRESET)?)?);
    let mut readings = Vec::new();
    for reading in 1..=NUM_READINGS {
        while trainer.progress().env_steps < args.env_steps * reading / NUM_READINGS {
            trainer.iterate(&workers)?;
        }
        readings.push((trainer.progress().env_steps, resident_mb().ok_or("/proc/self/status has no VmRSS")?));
    }
    // The first tenth fills buffers that grow to the longest list of episodes of an iteration.
    let (_, settled_mb) = readings[readings.len() / 10];
    let (env_steps, end_mb) = readings[readings.len() - 1];
    let report = json!({
        "env_steps": env_steps,
        "growth_mb": end_mb - settled_mb,
        "readings": readings,
    });
    println!("{report:#}");
    Ok(())
}
