//! `canter config`.

use std::process::ExitCode;

use canter_sim::settings::write_commented;
use canter_train::config::{DEFAULT_PRESET, open_preset, preset_names, resolve};

use crate::args::ConfigArgs;
use crate::error::CliError;
use crate::output::say;

/// `canter config`.
pub fn config(args: &ConfigArgs) -> Result<ExitCode, CliError> {
    let Some(preset) = &args.preset else {
        for name in preset_names() {
            say(&if name == DEFAULT_PRESET { format!("{name} (default)") } else { name });
        }
        return Ok(ExitCode::SUCCESS);
    };
    let mut document = open_preset(preset)?;
    for (key, value) in &args.overrides {
        document.set(key, value);
    }
    say(write_commented(&resolve(&document)?.config).trim_end());
    Ok(ExitCode::SUCCESS)
}
