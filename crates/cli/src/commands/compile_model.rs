//! `canter compile-model`, which nobody types: the process in which [`crate::guard`] tries a model.

use std::process::ExitCode;

use canter_sim::mujoco::take_messages;
use canter_sim::robot::try_model;

use crate::args::CompileModelArgs;
use crate::error::CliError;
use crate::guard::limit_this_process;

/// `canter compile-model`.
pub fn compile_model(args: &CompileModelArgs) -> Result<ExitCode, CliError> {
    limit_this_process().map_err(CliError::Limits)?;
    let result = try_model(&args.model);
    // Warnings come again when the caller compiles the model, and standard error is for one message.
    take_messages();
    result.map_err(CliError::Model)?;
    Ok(ExitCode::SUCCESS)
}
