//! `canter completions` and `canter man`.

use std::process::ExitCode;

use clap::CommandFactory;

use crate::args::{Cli, CompletionsArgs, ManArgs};
use crate::error::CliError;
use crate::output::say;

/// `canter completions`.
pub fn completions(args: &CompletionsArgs) -> Result<ExitCode, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "canter", &mut script);
    say(String::from_utf8_lossy(&script).trim_end());
    Ok(ExitCode::SUCCESS)
}

/// `canter man`.
pub fn man(args: &ManArgs) -> Result<ExitCode, CliError> {
    let failed = |error| CliError::File(args.folder.display().to_string(), error);
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    clap_mangen::generate_to(Cli::command(), &args.folder).map_err(failed)?;
    say(&format!("Written:  {}", args.folder.display()));
    Ok(ExitCode::SUCCESS)
}
