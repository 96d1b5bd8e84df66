//! Training, and what is trained many times over.

use std::path::PathBuf;

use canter_train::compare::protocol::Rung;
use canter_train::config::DEFAULT_PRESET;
use canter_train::sweep::plan::Axis;
use clap::Args;

use super::{WorkerThreads, key_value};
use crate::output::LogFormat;

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter train                                     Doggo's trot, our best settings
  canter train paper --seed 3                      the paper's method
  canter train doggo --authority 0.5               keep half of the hand-made gait
  canter train --set policy.modulation=residual    add to every actuator target instead
  canter train my-run.toml --out runs/first        a configuration of your own
  canter train --set robot=my-doggo/robot.toml     a robot of your own

Ctrl-C ends the training after the current iteration and saves it; `canter resume` goes on.")]
pub struct TrainArgs {
    /// Name of a preset, or path of a configuration file (see `canter config`)
    #[arg(default_value = DEFAULT_PRESET)]
    pub preset: String,
    /// Seed of every random stream; the same seed gives the same bytes, whatever the number of threads
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub workers: WorkerThreads,
    /// Env steps of training; short for `--set training.max_env_steps=N`
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub steps: Option<u64>,
    /// How much of the gait the policy may change, 0 to 1; short for `--set policy.authority=X`
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub authority: Option<f64>,
    /// The run directory; `runs/PRESET-SEED-n` if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Override one value of the preset; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
    /// Form of what is printed: sentences, or one JSON object a line
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

#[derive(Debug, Args)]
pub struct ResumeArgs {
    /// The run directory
    pub run: PathBuf,
    #[command(flatten)]
    pub workers: WorkerThreads,
    /// Form of what is printed: sentences, or one JSON object a line
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

#[derive(Debug, Args)]
#[command(after_help = "\
A training writes such a file when MuJoCo meets numbers it cannot go on with, or when a robot moves
faster or farther than any could. The episode ends there and counts as an accident called `unstable`.
Usual reasons: gains too high or inertias too small for task.physics_dt_s, bodies that overlap.")]
pub struct ReplayArgs {
    /// The file, RUN/dumps/NAME.safetensors
    pub dump: PathBuf,
    /// Env steps to show, the last ones
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub last: usize,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter compare --quick                           does everything work? a few minutes
  canter compare                                   the whole ladder, some 40 minutes on 2 cores
  canter compare --seeds 3 --budget 500000         another protocol
  canter compare --rungs tuned,doggo --out runs/x  only these beside the default gaits

The rungs: sine and stepping (the default gaits, always there), tuned (the best constant
parameters), direct and direct-best (learned without a prior), paper and doggo (learned with it).
The rules are in docs/protocol.md.

Ctrl-C saves and stops; the same command with the folder as --out goes on.")]
pub struct CompareArgs {
    /// A short comparison: 2 seeds, 60,000 env steps, fewer episodes; its numbers say little
    #[arg(long)]
    pub quick: bool,
    /// Env steps of each learned gait and each search, for each seed; 1,000,000 if not given
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u64).range(1..=100_000_000_000))]
    pub budget: Option<u64>,
    /// Number of seeds: 1 to N; 5 if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: Option<u64>,
    /// Only these rungs, beside the default gaits
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = rung)]
    pub rungs: Option<Vec<Rung>>,
    /// The comparison's folder; `runs/compare-n` if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Jobs side by side, each on one thread; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Form of what is printed: sentences, or one JSON object a line
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter sweep --over policy.authority=0,0.25,0.5,0.75,1 --seeds 3      the authority dial
  canter sweep --over preset=minitaur,q8bot,hexapod --steps 300000      one training of each robot
  canter sweep --over reward.energy=0.01,0.03,0.1 --over ppo.gamma=0.97,0.98
                                                                        every combination
  canter sweep --random 20 --over ppo.learning_rate=1e-4..1e-2/log --over ppo.num_epochs=4,8

Each training is a run directory of its own: `canter report`, `eval` and `film` take it.

Ctrl-C saves and stops; the same command with the folder as --out goes on.")]
pub struct SweepArgs {
    /// A preset, or the path of a configuration file
    #[arg(default_value = DEFAULT_PRESET)]
    pub preset: String,
    /// A key of the configuration and its values: KEY=A,B,C, or KEY=LOW..HIGH for random points (KEY=LOW..HIGH/log: evenly
    /// in the logarithm); `preset` as the key stands for the preset. May be given several times
    #[arg(long, value_name = "KEY=VALUES", required = true)]
    pub over: Vec<Axis>,
    /// That many random points instead of every combination
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub random: Option<u64>,
    /// Number of training seeds of each point: 1 to N
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// The first training seed
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u64).range(0..=9_007_199_254_740_992))]
    pub first_seed: u64,
    /// Env steps of each training; the preset's if not given
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u64).range(1..=100_000_000_000))]
    pub steps: Option<u64>,
    /// Set one value of every training; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
    /// The sweep's folder; `runs/sweep-n` if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Trainings side by side, each on one thread; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Form of what is printed: sentences, or one JSON object a line
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    pub log_format: LogFormat,
}

#[derive(Debug, Args)]
pub struct ConfigArgs {
    /// Name of a preset, or path of a configuration file; without it the presets are listed
    pub preset: Option<String>,
    /// Override one value of the preset; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
}

/// The rung of this name.
fn rung(name: &str) -> Result<Rung, String> {
    Rung::from_name(name).ok_or_else(|| format!("there are {}", Rung::ALL.map(Rung::name).join(", ")))
}
