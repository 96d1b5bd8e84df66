//! From nothing to the first env step: opens the preset, resets an environment and steps it once. Whoever starts the
//! program times it.

use canter_bench::level::PRESET;
use canter_sim::Env;
use canter_train::config::{open_preset, resolve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let task = resolve(&open_preset(PRESET)?)?.task;
    let mut observation = vec![0.0; task.num_observations()];
    let mut env = Env::new(task);
    // The middle of every range: no noise.
    env.reset(&mut || 0.5, &mut observation);
    println!("reward {}", env.step_prior(&mut observation).reward);
    Ok(())
}
