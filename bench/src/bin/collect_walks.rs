//! Collects with a new policy of the `doggo` preset, and writes down what it did, for `package/cost.py` to repeat.
//!
//! Prints JSON: wall and processor time of the rounds after the first, which warms up. The file holds f32 in the
//! machine's order: of each round the actions, `(N x T x A)`, then the rewards, `(N x T)`.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin collect_walks -- --out walks.bin
//! ```

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::time::Instant;

use canter_bench::level::document;
use canter_train::config::resolve;
use canter_train::executor::Workers;
use canter_train::trainer::Trainer;
use clap::Parser;
use serde_json::json;

/// Times rounds of collecting and records them.
#[derive(Debug, Parser)]
struct Args {
    /// Threads; as many as there are cores if not given
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Environments; the preset's if not given
    #[arg(long, value_name = "N")]
    environments: Option<usize>,
    /// Rounds of the preset's horizon, without the first
    #[arg(long, value_name = "N", default_value_t = 8)]
    rounds: usize,
    /// Where actions and rewards go
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let workers = Workers::new(args.threads)?;
    let mut overrides = Vec::new();
    if let Some(environments) = args.environments {
        overrides.push(("training.num_environments", environments.to_string()));
    }
    let mut trainer = Trainer::new(resolve(&document(&overrides)?)?);
    let mut file = BufWriter::new(File::create(&args.out)?);
    let (mut wall_s, mut processor_s) = (Vec::new(), Vec::new());
    for round in 0..=args.rounds {
        let (start, start_s) = (Instant::now(), processor_time_s()?);
        trainer.collect(&workers);
        if round > 0 {
            wall_s.push(start.elapsed().as_secs_f64());
            processor_s.push(processor_time_s()? - start_s);
        }
        let rollout = trainer.rollout();
        for number in rollout.actions.iter().chain(&rollout.rewards) {
            file.write_all(&number.to_ne_bytes())?;
        }
    }
    file.flush()?;
    let training = &trainer.resolved().config.training;
    let report = json!({
        "environments": training.num_environments,
        "horizon": training.horizon,
        "threads": workers.num_threads(),
        "wall_s": wall_s,
        "processor_s": processor_s,
    });
    println!("{report:#}");
    Ok(())
}

/// Time that this process's threads, the living ones, have spent on a processor [s].
fn processor_time_s() -> std::io::Result<f64> {
    let mut nanoseconds = 0.0;
    for thread in std::fs::read_dir("/proc/self/task")? {
        let line = std::fs::read_to_string(thread?.path().join("schedstat"))?;
        nanoseconds += line.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0);
    }
    Ok(nanoseconds / 1e9)
}
