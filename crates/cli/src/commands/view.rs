//! `canter view`.

use std::process::ExitCode;

use crate::args::ViewArgs;
use crate::error::CliError;

/// `canter view`.
#[cfg(not(feature = "view"))]
pub fn view(args: &ViewArgs) -> Result<ExitCode, CliError> {
    Err(CliError::NoViewer(args.run.display().to_string(), crate::output::program()))
}
