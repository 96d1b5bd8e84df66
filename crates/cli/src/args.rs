//! What may be typed. Doc comments here are the program's help.

use std::path::PathBuf;

use canter_train::compare::protocol::Rung;
use canter_train::config::DEFAULT_PRESET;
use canter_train::sweep::plan::Axis;
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::output::LogFormat;

/// Learns a faster version of a legged robot's own gait, in simulation.
///
/// A first run: `canter train` trains Stanford Doggo's trot for a minute and says how much faster it became.
#[derive(Debug, Parser)]
#[command(name = "canter", version, arg_required_else_help = true, after_help = EXIT_CODES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 failed, with a message; 2 wrong usage; 130 stopped by Ctrl-C or SIGTERM.\n\
The first signal saves before it stops, a second one falls back to the last checkpoint.";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Train a policy and judge it against the hand-made gait
    Train(TrainArgs),
    /// Go on with a training that was stopped
    Resume(ResumeArgs),
    /// Step through what led to physics that made no sense
    Replay(ReplayArgs),
    /// Measure a trained policy, or a bare gait
    Eval(EvalArgs),
    /// Measure what trained policies keep of their speed on other grounds and with other motors, masses and delays
    Robustness(RobustnessArgs),
    /// Compare learned, tuned and default gaits at equal budgets over several seeds
    Compare(CompareArgs),
    /// Train with other values of the configuration, over several seeds
    Sweep(SweepArgs),
    /// Draw runs, a comparison or a sweep: one HTML page, figures, tables
    Report(ReportArgs),
    /// Take a learned gait onto the robot: C, ONNX, Rust, a table, gait parameters
    Export(ExportArgs),
    /// Run a learned gait on a robot: readings in, targets out, line by line
    Run(RunArgs),
    /// Film the prior and the learned gait side by side
    Film(FilmArgs),
    /// Watch the learned gait in MuJoCo's viewer
    View(ViewArgs),
    /// List the robots, or explain one
    Robots(RobotsArgs),
    /// Bring a robot of your own: draft its robot.toml, look for faults
    Robot(RobotArgs),
    /// Write a gait as a table, or find the gait that is closest to one
    Gait(GaitArgs),
    /// Print a preset with the meaning of every value
    Config(ConfigArgs),
    /// Compile a model, within limits of time and memory
    #[command(hide = true)]
    CompileModel(CompileModelArgs),
}

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
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
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
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
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

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  canter eval runs/doggo-1-1                       the policy, its prior and the default gaits
  canter eval runs/doggo-1-1 --slope 10 --json     ten degrees uphill, for a program
  canter eval --robot doggo --prior stepping       a bare gait
  canter eval --robot hexapod                      every gait that a robot has

Every gait starts from the same random states. Speed is the forward displacement after the first second.")]
pub struct EvalArgs {
    /// The run directory of a trained policy
    #[arg(required_unless_present = "robot", conflicts_with_all = ["robot", "prior"])]
    pub run: Option<PathBuf>,
    /// Robot of a bare gait: a name (see `canter robots`) or the path of a robot.toml
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
    /// Name of a bare gait of that robot; all of them if not given
    #[arg(long, value_name = "NAME", requires = "robot")]
    pub prior: Option<String>,
    /// Slope of the ground in degrees, positive uphill
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
    /// Sliding friction between feet and ground
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub friction: Option<f64>,
    /// Episodes of each gait
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub episodes: Option<usize>,
    /// Seed of the random starts
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter robustness runs/doggo-robust-1-1          one policy under every condition
  canter robustness runs/doggo-* --json            several seeds, for a program

Each policy walks under one condition after another, from the same random states: friction, mass, delay, all three
at once, weak motors, slopes, rough ground, curbs, a push. Runs that differ by their seed only share a table. What a
policy keeps counts against its own speed on level ground. Numbers and conditions: docs/ground.md.")]
pub struct RobustnessArgs {
    /// Run directories of trained policies
    #[arg(required = true, value_name = "RUN")]
    pub runs: Vec<PathBuf>,
    /// Episodes under each condition
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub episodes: Option<usize>,
    /// Seed of the random starts
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print JSON instead of tables
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
#[command(after_help = "\
Examples:
  canter report runs/doggo-1-1                     into the run directory itself
  canter report runs/doggo-* --out several-seeds   several trainings on one page
  canter report docs/results                       a folder with compare.json or sweep.json

It leaves report.html, which needs no other file and no network, figures/*.svg and tables/*.csv. Figures as PNG files
need a build with the feature `png`: cargo build --release --package canter --features png.")]
pub struct ReportArgs {
    /// Run directories that are finished, or one folder with `compare.json` or `sweep.json`
    #[arg(required = true, value_name = "RUN")]
    pub folders: Vec<PathBuf>,
    /// Folder for the report; the run directory itself if one run is given without it
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter film runs/doggo-1-1                       5 s as RUN/film.gif
  canter film runs/doggo-1-1 --slope 5             five degrees uphill
  canter film runs/doggo-1-1 --out doggo.mp4 --fps 50 --size 1920x720

Both gaits walk the evaluation's first episode, from the same start and at the same clock. Speed
and way count from the start.

Drawing needs neither screen nor graphics card, but OpenGL: EGL or OSMesa; MUJOCO_GL=egl or osmesa
takes that one. A .gif file needs nothing else, an .mp4 file the program ffmpeg.")]
pub struct FilmArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// The film, .gif or .mp4; `RUN/film.gif` if not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Length of the film in seconds, 0.1 to 60
    #[arg(long, value_name = "S", default_value = "5", value_parser = film_seconds, allow_negative_numbers = true)]
    pub seconds: f64,
    /// Slope of the ground in degrees, positive uphill; the run's own if not given
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
    /// Width and height in pixels, two even numbers: 320x120 to 3840x2160
    #[arg(long, value_name = "WxH", default_value = "960x360", value_parser = film_size)]
    pub size: [u32; 2],
    /// Pictures each second
    #[arg(long, value_name = "N", default_value = "25", value_parser = clap::value_parser!(u32).range(1..=50))]
    pub fps: u32,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The viewer is in builds with the feature `view`:
  cargo build --release --package canter --features view

It shows the evaluation's first episode at the clock of a real robot, over and over, until its
window is closed. A slope looks level: the simulator tilts gravity, not the ground. The keys [ and ]
change to the cameras of the robot's model, which may follow it; Control + Q closes the window.")]
pub struct ViewArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// Slope of the ground in degrees, positive uphill; the run's own if not given
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Formats:
  c      one header and one source in C99, without a heap, and an Arduino sketch
  onnx   one graph from sensors to actuator targets
  rust   a crate without std, with all that it needs but libm
  table  actuator targets over one cycle as CSV: the gait in open loop
  gait   the nearest sine or stepping gait; for Doggo also its firmware's commands

Before anything is written the exported thing walks in the simulator. If it breaks a limit (leg
space, speed, torque, heat, the firmware's rules) or walks otherwise than the policy, nothing is
written. The certificate of this replay lies beside the files: certificate.json, certificate.txt.")]
pub struct ExportArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// What to write
    #[arg(long, value_name = "F")]
    pub format: ExportFormat,
    /// Folder for the files; `RUN/export/FORMAT` if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the files even if a limit is broken, with a warning
    #[arg(long)]
    pub allow_unsafe: bool,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter run runs/doggo-1-1                        over standard input and output
  canter run runs/doggo-1-1 --port /dev/ttyACM0    over a serial port

The robot stands until it hears `walk`, and comes to a stand on `stop`, `quit`, Ctrl-C or when the other
side ends. Without fresh readings it holds its pose. docs/line-protocol.md describes every line.")]
pub struct RunArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// Serial port or pseudo-terminal; standard input and output if not given
    #[arg(long, value_name = "PATH")]
    pub port: Option<PathBuf>,
    /// Bits per second of a serial port
    #[arg(long, value_name = "N", default_value_t = 1_000_000, requires = "port")]
    pub baud: u32,
}

/// What a policy can be exported as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    // Doc comments here would repeat the text above.
    C,
    Onnx,
    Rust,
    Table,
    Gait,
}

#[derive(Debug, Args)]
pub struct RobotsArgs {
    /// Name of a robot, or path of a robot.toml: prints it with the meaning of every value
    pub robot: Option<String>,
}

#[derive(Debug, Args)]
pub struct GaitArgs {
    #[command(subcommand)]
    pub command: GaitCommand,
}

#[derive(Debug, Subcommand)]
pub enum GaitCommand {
    /// Find the sine or stepping gait that is closest to a table of actuator targets
    Fit(GaitFitArgs),
    /// Write a gait's actuator targets over one cycle
    Table(GaitTableArgs),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter gait fit --table trot.csv --robot doggo --frequency 2
  canter gait fit --table trot.csv --robot doggo --frequency 2 --shape sine --no-eval

The table's first line names the robot's actuators, in any order; each other line has their targets
in rad at one moment, at equal times over exactly one cycle. Closest is by least squares in leg space,
all legs of one shape, each with its own phase. What it prints can stand in a robot.toml.")]
pub struct GaitFitArgs {
    /// The table, a CSV file
    #[arg(long, value_name = "FILE")]
    pub table: PathBuf,
    /// The robot: a name (see `canter robots`) or the path of a robot.toml
    #[arg(long, value_name = "NAME")]
    pub robot: String,
    /// Cycles per second [Hz]: 1 over the time that the table takes
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub frequency: f64,
    /// Fit this shape; the closer one if not given
    #[arg(long, value_enum)]
    pub shape: Option<FitShape>,
    /// Do not measure how fast table and gait walk
    #[arg(long)]
    pub no_eval: bool,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// What `canter gait fit` fits.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum FitShape {
    /// Sines for swing and extension
    Sine,
    /// The foot trajectory of Doggo's firmware
    Stepping,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter gait table --robot doggo --prior stepping                    to the terminal
  canter gait table --robot doggo --prior stepping --out trot.csv     into a file")]
pub struct GaitTableArgs {
    /// The robot: a name (see `canter robots`) or the path of a robot.toml
    #[arg(long, value_name = "NAME")]
    pub robot: String,
    /// Name of a gait of that robot
    #[arg(long, value_name = "NAME")]
    pub prior: String,
    /// Rows at equal times over the cycle, 4 to 10000
    #[arg(long, value_name = "N", default_value = "64", value_parser = clap::value_parser!(u16).range(4..=10_000))]
    pub rows: u16,
    /// The file; the terminal if not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct RobotArgs {
    #[command(subcommand)]
    pub command: RobotCommand,
}

#[derive(Debug, Subcommand)]
pub enum RobotCommand {
    /// Draft the robot.toml of a MuJoCo model
    New(RobotNewArgs),
    /// Look for what is wrong with a robot, let it stand and walk
    Check(RobotCheckArgs),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter robot new --from go1/go1.xml              go1/robot.toml, beside the model
  canter robot new --from go1/go1.xml --out my-go1 a copy of the model's files, and robot.toml with them
  canter robot new --from arm-less.urdf --out rex  an MJCF made of a URDF, and its robot.toml

It finds the floating body, the legs, their motors and feet, and gives the robot Doggo's trot in its own
size. What the model does not say stands at the top of the file, for you to decide. A model without
ground gets a scene that includes it; the model itself is not changed.")]
pub struct RobotNewArgs {
    /// The model: MJCF or URDF
    #[arg(long, value_name = "FILE")]
    pub from: PathBuf,
    /// Folder for robot.toml and a copy of the model's files; the model's own folder if not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The robot's name; that of the model's file if not given
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter robot check go1/robot.toml                faults, how it stands, how its gaits walk
  canter robot check go1/go1.xml                   a model without robot.toml: masses and limits only
  canter robot check go1/robot.toml --film go1.gif

Exit code 1 if there are errors; warnings alone are no failure. docs/robots.md lists the faults.")]
pub struct RobotCheckArgs {
    /// Name of a robot, path of a robot.toml, or a model's file
    pub robot: String,
    /// Film the first default gait: FILE.gif or FILE.mp4
    #[arg(long, value_name = "FILE")]
    pub film: Option<PathBuf>,
    /// Episodes that each default gait walks
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(2..=1000))]
    pub episodes: u16,
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print JSON instead of sentences
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct ConfigArgs {
    /// Name of a preset, or path of a configuration file; without it the presets are listed
    pub preset: Option<String>,
    /// Override one value of the preset; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
}

#[derive(Debug, Args)]
pub struct CompileModelArgs {
    /// The model's file
    pub model: PathBuf,
}

/// The rung of this name.
fn rung(name: &str) -> Result<Rung, String> {
    Rung::from_name(name).ok_or_else(|| format!("there are {}", Rung::ALL.map(Rung::name).join(", ")))
}

/// The length of a film [s].
fn film_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=60.0).contains(seconds));
    seconds.ok_or_else(|| "expected a number from 0.1 to 60".to_owned())
}

/// Width and height of a film in pixels.
fn film_size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    let is_possible = |[width, height]: &[u32; 2]| {
        (320..=3840).contains(width) && (120..=2160).contains(height) && width % 2 == 0 && height % 2 == 0
    };
    numbers.filter(is_possible).ok_or_else(|| {
        "expected two even numbers with an x between them, from 320x120 to 3840x2160, for example 960x360".to_owned()
    })
}

/// `KEY=VALUE` in its two parts.
fn key_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE, for example ppo.gamma=0.98")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// A command line is damaged like a file; `fuzz.rs` says what it must survive.
    #[cfg(unix)]
    #[test]
    fn no_command_line_can_hurt() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        const WORDS: [&str; 26] = [
            "\n",
            "\n\n",
            "\n--\n",
            "-",
            "=",
            "\n--set\n",
            "\n--seed=",
            "\n--threads\n",
            "\n--out\n",
            "\n--steps\n",
            "\n--help",
            "\n-V",
            "\n--json",
            "\n--size\n",
            "\n--seconds\n",
            "\n--fps\n",
            "\n--rungs=",
            "\n--budget\n",
            "\n--slope\n-",
            "x",
            ",",
            "tuned,doggo",
            "train\n",
            "eval\n",
            "film\n",
            "\u{1f415}",
        ];
        let valid = [
            "train\npaper\n--seed\n3\n--set\npolicy.authority=0.5\n--threads\n2\n--steps\n1000\n--out\nruns/x",
            "eval\nruns/doggo-1-1\n--slope\n10\n--friction=0.8\n--episodes\n5\n--json",
            "compare\n--seeds\n3\n--budget\n500000\n--rungs\ntuned,doggo\n--quick",
            "film\nruns/doggo-1-1\n--seconds\n2.5\n--size\n1920x720\n--fps\n50",
            "config\ndoggo\n--set\nppo.gamma=0.9\n--set\ntask.friction=0.8",
            "robot\nnew\n--from\nmodel.xml\n--out\nrex\n--name=rex",
            "robot\ncheck\nrex/robot.toml\n--episodes\n4\n--film\nrex.gif\n--json",
        ];
        crate::fuzz::fuzz_bytes("command line", &valid.map(|line| line.as_bytes().to_vec()), &WORDS, |bytes, _| {
            let words = bytes.split(|&byte| byte == b'\n').map(OsStr::from_bytes);
            let cli = Cli::try_parse_from([OsStr::new("canter")].into_iter().chain(words));
            match cli.map_err(|error| format!("{:?}", error.kind()))?.command {
                Command::Film(args) => {
                    assert!((0.1..=60.0).contains(&args.seconds) && (1..=50).contains(&args.fps));
                    assert!(args.size.iter().all(|&pixels| (120..=3840).contains(&pixels)));
                }
                Command::Train(args) => assert!(args.threads.is_none_or(|threads| (1..=1024).contains(&threads))),
                _ => {}
            }
            Ok(())
        });
    }

    #[test]
    fn a_film_has_a_size_that_video_can_have() {
        assert_eq!(film_size("960x360"), Ok([960, 360]));
        for wrong in ["960", "960x", "x360", "961x360", "960x361", "318x120", "3842x2160", "960x-360", "960 x 360"] {
            assert!(film_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_film_has_a_length() {
        assert_eq!(film_seconds("2.5"), Ok(2.5));
        for wrong in ["0", "-1", "61", "NaN", "inf", "long"] {
            assert!(film_seconds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn overrides_split_at_the_first_equals_sign() {
        assert_eq!(key_value("a.b = x=y").unwrap(), ("a.b".to_owned(), "x=y".to_owned()));
        assert!(key_value("gamma").is_err());
    }
}
