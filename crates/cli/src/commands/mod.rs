//! One module a command.

pub mod compare;
pub mod compile_model;
pub mod config;
pub mod eval;
pub mod export;
pub mod film;
pub mod gait;
pub mod replay;
pub mod report;
pub mod robot_check;
pub mod robot_new;
pub mod robots;
pub mod robustness;
pub mod run;
pub mod serve;
pub mod shell;
pub mod sweep;
pub mod train;
pub mod view;

use std::path::Path;

use canter_sim::settings::Document;
use canter_train::config::{Resolved, bare_gait, resolve};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::{open_config, read_policy_for};

use crate::error::CliError;

/// The worker threads.
fn workers(num_threads: Option<u16>) -> Result<Workers, CliError> {
    Workers::new(num_threads.map(usize::from)).map_err(CliError::Threads)
}

/// A run's policy and what it is for, with values that were typed put into the configuration.
fn learned(run: &Path, with_overrides: impl FnOnce(Document) -> Document) -> Result<(Resolved, PolicyFile), CliError> {
    let resolved = resolve(&with_overrides(open_config(run)?))?;
    let policy = read_policy_for(run, &resolved.task)?;
    Ok((resolved, policy))
}

/// The configuration with another slope, so that it is checked like the file's.
fn with_slope(mut document: Document, slope_deg: Option<f64>) -> Document {
    if let Some(slope_deg) = slope_deg {
        document.set("task.slope_deg", &format!("{slope_deg:?}"));
    }
    document
}
