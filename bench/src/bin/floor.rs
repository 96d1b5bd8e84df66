//! The floor: `mj_step` alone, in a loop, on one thread to all; prints JSON.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin floor
//! ```

use std::thread;
use std::time::Instant;

use canter_bench::level::resolve_on_level_ground;
use canter_bench::quartiles;
use canter_bench::reference::Reference;
use clap::Parser;
use serde_json::json;

/// Times the bare physics of the walking Doggo.
#[derive(Debug, Parser)]
struct Args {
    /// How often the recorded walk is repeated by each thread
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let task = resolve_on_level_ground(&[])?.task;
    let preset_dt_s = task.settings.physics_dt_s;
    let mut reference = Reference::new()?;
    let mut preset = Reference::with_physics_dt(preset_dt_s)?;
    reference.time();
    preset.time();
    // In turns, so that a disturbance meets both.
    let (mut reference_ns, mut preset_ns) = (Vec::new(), Vec::new());
    for _ in 0..args.repeats {
        reference_ns.push(1e9 * reference.time());
        preset_ns.push(1e9 * preset.time());
    }
    let num_cores = thread::available_parallelism()?.get();
    let threads = (1..=num_cores)
        .map(|num_threads| {
            Ok(json!({ "threads": num_threads, "mj_steps_per_s": throughput(num_threads, args.repeats)? }))
        })
        .collect::<Result<Vec<_>, Box<dyn std::error::Error>>>()?;
    let report = json!({
        "reference_physics_dt_s": reference.physics_dt_s(),
        "reference_mj_step_ns": quartiles(reference_ns),
        "preset_physics_dt_s": preset_dt_s,
        "num_substeps": task.num_substeps,
        "preset_mj_step_ns": quartiles(preset_ns),
        "reference_by_threads": threads,
    });
    println!("{report:#}");
    Ok(())
}

/// Reference `mj_step`s per second of all threads together, each with a simulation of its own [1/s].
fn throughput(num_threads: usize, repeats: u32) -> Result<f64, Box<dyn std::error::Error>> {
    let mut references = (0..num_threads).map(|_| Reference::new()).collect::<Result<Vec<_>, _>>()?;
    let num_steps: u32 = references.iter().map(|reference| repeats * reference.num_physics_steps()).sum();
    let start = Instant::now();
    thread::scope(|scope| {
        for reference in &mut references {
            scope.spawn(move || {
                for _ in 0..repeats {
                    reference.time();
                }
            });
        }
    });
    Ok(f64::from(num_steps) / start.elapsed().as_secs_f64())
}
