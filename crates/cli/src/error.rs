//! The one place where errors meet.

use std::path::PathBuf;

use canter_report::ReportError;
use canter_serve::ServeError;
use canter_sim::RobotError;
#[cfg(feature = "view")]
use canter_sim::mujoco::viewer::ViewError;
use canter_sim::robot::draft::DraftError;
use canter_sim::settings::Problems;
use canter_train::checkpoint::CheckpointError;
use canter_train::config::ConfigError;
use canter_train::film::FilmError;
use canter_train::gait_fit::FitError;
use canter_train::jobs::JobsError;
use canter_train::policy_file::PolicyError;
use canter_train::ranks::RanksError;
use canter_train::run::TrainError;
use canter_train::run_directory::RunError;
use canter_train::sweep::SweepError;
#[cfg(feature = "mpi")]
use canter_train::world::WorldError;

/// Exit code of a failure with a message.
pub const FAILURE: u8 = 1;

/// Exit code of a training that was stopped by a signal, as shells have it for SIGINT.
pub const STOPPED: u8 = 130;

/// Whatever ends a command early.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Problems(#[from] Problems),
    #[error(transparent)]
    Robot(#[from] RobotError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Jobs(#[from] JobsError),
    #[error(transparent)]
    Sweep(#[from] SweepError),
    #[error("this checkpoint cannot be used: {0}")]
    Checkpoint(#[from] CheckpointError),
    #[error("this policy cannot be used: {0}")]
    Policy(#[from] PolicyError),
    #[error("cannot report: {0}")]
    Report(#[from] ReportError),
    #[error(transparent)]
    Serve(#[from] ServeError),
    #[error(transparent)]
    Film(#[from] FilmError),
    #[cfg(feature = "view")]
    #[error("cannot open a window: {0}")]
    View(#[from] ViewError),
    #[cfg(not(feature = "view"))]
    #[error(
        "this canter was built without its viewer. Build it with `cargo build --release --package canter --features view` \
         and then run `target/release/canter view {0}`; or write a film with `{1} film {0}`"
    )]
    NoViewer(String, String),
    #[error(
        "nothing was exported, the replay broke {} of {run}:\n{}\nThese limits protect the robot; --allow-unsafe writes the \
         files all the same{}",
        if .broken.len() == 1 { "a limit".to_owned() } else { format!("{} limits", .broken.len()) },
        .broken.join("\n"),
        .earlier.as_ref().map_or(String::new(), |folder| format!(
            "; what lies in {} is an earlier export", folder.display()
        ))
    )]
    Unsafe { broken: Vec<String>, run: String, earlier: Option<PathBuf> },
    #[error("{0} is no list of measured exports: move it away, and this export will begin a new one")]
    BrokenMeasurements(String),
    #[error("{0} never walked through a whole cycle, so there is no gait to write down")]
    NoCycle(String),
    #[error("{}: the robot cannot be reached: {source}", .path.display())]
    Port { path: PathBuf, source: std::io::Error },
    #[error(
        "{}: {why} before the robot stood: it is left in the pose of its last targets, and its own watchdog has to do the rest",
        .path.display()
    )]
    LeftMoving { why: &'static str, path: PathBuf },
    #[error("no gait of few parameters is near the learned one: {0}")]
    NoFit(FitError),
    #[error("{second} is the training of {first} again, seed {seed}, and would count twice; leave one of them out")]
    SameRun { first: String, second: String, seed: u64 },
    #[error("several runs need a folder for their report; give one with --out DIR")]
    ReportNeedsOut,
    #[error(
        "{0} holds a comparison or a sweep, which is reported alone and into its own folder; leave out other folders and --out"
    )]
    ReportAlone(String),
    #[error("{path}: this table cannot be used: {message}")]
    Table { path: String, message: String },
    #[error("{path}: no gait can be fitted to this table: {source}")]
    Fit { path: String, source: FitError },
    #[error("{robot} has no gait called `{name}`: there are {known}")]
    NoGait { robot: String, name: String, known: String },
    #[error("{path}: cannot be written: {source}")]
    Write { path: String, source: std::io::Error },
    #[error("{0}")]
    Model(String),
    #[error(transparent)]
    Draft(#[from] DraftError),
    #[error("{0}: {1}")]
    File(String, std::io::Error),
    #[error("{0} is there already; choose another folder with --out, or remove it")]
    Exists(String),
    #[error("{0}")]
    Drafted(String),
    #[error("cannot limit time and memory: {0}")]
    Limits(std::io::Error),
    #[error(
        "mpirun has started {num_ranks} copies of this canter, which was built without MPI and would train {num_ranks} times \
         the same. Build it with `cargo build --release --package canter --features mpi` and start `mpirun -n {num_ranks} \
         target/release/canter ...` again; or leave mpirun out: one canter uses all cores of a machine"
    )]
    NoMpi { num_ranks: usize },
    #[error("mpirun has started {0} copies, but only `train`, `resume` and `compare` work together; leave mpirun out")]
    OneProcess(usize),
    #[cfg(feature = "mpi")]
    #[error(transparent)]
    World(#[from] WorldError),
    #[error(transparent)]
    Ranks(#[from] RanksError),
    #[error("cannot start the worker threads: {0}")]
    Threads(std::io::Error),
    #[error("cannot listen for Ctrl-C: {0}")]
    Signals(#[from] ctrlc::Error),
}
