//! What leaves the simulator.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::WorkerThreads;

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
    #[command(flatten)]
    pub workers: WorkerThreads,
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
#[command(after_help = "\
Examples:
  canter run runs/doggo-1-1                        over standard input and output
  canter run runs/doggo-1-1 --port /dev/ttyACM0    over a serial port

With its first readings the robot rises from where it is to its standing pose. It walks on `walk`, and comes to
a stand on `stop`, `quit` or Ctrl-C. Without fresh readings, also once the input has ended, it holds its pose.
docs/line-protocol.md describes every line.")]
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
