//! `canter compile-model`, which nobody types: the process in which [`guard`] tries a model.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use canter_sim::mujoco::take_messages;
use canter_sim::robot::guard::{self, limit_this_process};
use canter_sim::robot::try_model;

use crate::args::CompileModelArgs;
use crate::error::CliError;

/// Tries a model with another process of this program.
pub fn model_guard(model: &Path) -> Result<(), String> {
    let cannot = |error| format!("the process that tries it cannot be started: {error}");
    guard::try_in_a_process(&this_program().map_err(cannot)?, model)
}

/// This program's file, even after another has taken its place.
fn this_program() -> std::io::Result<PathBuf> {
    if cfg!(target_os = "linux") { Ok(PathBuf::from("/proc/self/exe")) } else { std::env::current_exe() }
}

/// `canter compile-model`.
pub fn compile_model(args: &CompileModelArgs) -> Result<ExitCode, CliError> {
    limit_this_process().map_err(CliError::Limits)?;
    let result = try_model(&args.model);
    // Warnings come again when the caller compiles the model, and standard error is for one message.
    take_messages();
    result.map_err(CliError::Model)?;
    Ok(ExitCode::SUCCESS)
}
