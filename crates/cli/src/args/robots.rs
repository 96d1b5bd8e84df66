//! Robots, their models and their gaits.

use std::path::PathBuf;

use canter_sim::robot::draft::robot_name;
use clap::{Args, Subcommand};

use super::WorkerThreads;

#[derive(Debug, Args)]
pub struct RobotsArgs {
    /// Name of a robot, or path of a robot.toml: prints it with the meaning of every value
    pub robot: Option<String>,
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
    #[arg(long, value_name = "NAME", value_parser = plain_name)]
    pub name: Option<String>,
    #[command(flatten)]
    pub workers: WorkerThreads,
}

/// A name that a robot may have.
fn plain_name(name: &str) -> Result<String, String> {
    if robot_name(name) == name { Ok(name.to_owned()) } else { Err("use letters, digits, `-` and `_` only".to_owned()) }
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
    #[command(flatten)]
    pub workers: WorkerThreads,
    /// Print JSON instead of sentences
    #[arg(long)]
    pub json: bool,
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
    #[command(flatten)]
    pub workers: WorkerThreads,
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
pub struct CompileModelArgs {
    /// The model's file
    pub model: PathBuf,
}
