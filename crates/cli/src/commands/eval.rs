//! `canter eval`.

use std::process::ExitCode;
use std::sync::Arc;

use canter_sim::Task;
use canter_train::config::{DEFAULT_PRESET, Resolved, open_preset, resolve};
use canter_train::evaluate::judge;
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::{RunError, policy_path, read_config, read_policy};

use crate::args::EvalArgs;
use crate::commands::workers;
use crate::error::CliError;
use crate::output::say;
use crate::verdict::describe;

/// `canter eval`.
pub fn eval(args: &EvalArgs) -> Result<ExitCode, CliError> {
    let (mut resolved, policy) = subject(args)?;
    let mut task = Task::clone(&resolved.task);
    if let Some(slope) = args.slope {
        task.settings.slope_deg = slope;
    }
    if args.friction.is_some() {
        task.settings.friction = args.friction;
    }
    resolved.task = Arc::new(task);
    let settings = &mut resolved.config.evaluation;
    settings.num_episodes = args.episodes.unwrap_or(settings.num_episodes);
    settings.seed = args.seed.unwrap_or(settings.seed);
    let workers = workers(args.threads)?;
    let policy = policy.as_ref().map(PolicyFile::policy);
    let prior = &resolved.config.policy.prior;
    let verdict = judge(&resolved.task, prior, policy.as_ref(), &resolved.config.evaluation, &workers);
    if args.json {
        let json = serde_json::to_value(&verdict).expect("a verdict has string keys only");
        say(&format!("{json:#}"));
    } else {
        say(&describe(&verdict));
    }
    Ok(ExitCode::SUCCESS)
}

/// What is to be measured: a run's policy, or a bare gait.
fn subject(args: &EvalArgs) -> Result<(Resolved, Option<PolicyFile>), CliError> {
    if let Some(run) = &args.run {
        let resolved = read_config(run)?;
        let policy = read_policy(run)?;
        policy.check(&resolved.task).map_err(|source| RunError::Policy { path: policy_path(run), source })?;
        return Ok((resolved, Some(policy)));
    }
    // The default preset lends its protocol; the bare gait has no use for the rest.
    let mut document = open_preset(DEFAULT_PRESET)?;
    for (key, value) in [("robot", &args.robot), ("policy.prior", &args.prior)] {
        if let Some(value) = value {
            document.set(key, &format!("{value:?}"));
        }
    }
    Ok((resolve(&document)?, None))
}
