//! `canter eval`.

use std::collections::BTreeMap;
use std::process::ExitCode;

use canter_sim::settings::Document;
use canter_sim::{NamedGait, Robot};
use canter_train::config::{Resolved, resolve};
use canter_train::evaluate::{GaitReport, Mover, evaluate, judge};
use canter_train::policy_file::PolicyFile;
use canter_train::protocol::ProtocolCard;
use serde_json::json;

use crate::args::EvalArgs;
use crate::commands::{bare_gait, learned, workers};
use crate::error::CliError;
use crate::output::say;
use crate::verdict::{describe, gait_table};

/// `canter eval`.
pub fn eval(args: &EvalArgs) -> Result<ExitCode, CliError> {
    if let (Some(robot), None) = (&args.robot, &args.prior) {
        return every_gait(robot, args);
    }
    let (resolved, policy) = subject(args)?;
    let workers = workers(args.workers.threads)?;
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

/// Measures every gait of a robot.
fn every_gait(robot: &str, args: &EvalArgs) -> Result<ExitCode, CliError> {
    let first = Robot::load(robot)?.gaits.first().map(|gait| gait.name.clone());
    let (resolved, _) = subject(&EvalArgs { prior: first, ..args.clone() })?;
    let workers = workers(args.workers.threads)?;
    let settings = &resolved.config.evaluation;
    let gaits = &resolved.task.robot.gaits;
    let measure = |gait: &NamedGait| {
        let task = resolved.task.with_gait(&gait.name).expect("a gait of the robot");
        evaluate(&task, Mover::Prior, settings, &workers)
    };
    let measured: Vec<(&NamedGait, GaitReport)> = gaits.iter().map(|gait| (gait, measure(gait))).collect();
    let protocol = ProtocolCard::new(&resolved.task, settings);
    if args.json {
        let gaits: BTreeMap<&str, &GaitReport> =
            measured.iter().map(|(gait, report)| (gait.name.as_str(), report)).collect();
        say(&format!("{:#}", json!({ "protocol": protocol, "gaits": gaits })));
    } else {
        let name = |gait: &NamedGait| {
            let roles = [(gait.is_default, "default"), (gait.is_stable, "stable")];
            let roles: Vec<&str> = roles.into_iter().filter_map(|(has, role)| has.then_some(role)).collect();
            if roles.is_empty() { gait.name.clone() } else { format!("{} ({})", gait.name, roles.join(", ")) }
        };
        let rows: Vec<(String, &GaitReport)> = measured.iter().map(|(gait, report)| (name(gait), report)).collect();
        say(&gait_table(&rows, &protocol));
    }
    Ok(ExitCode::SUCCESS)
}

/// What is to be measured, and how: a run's policy, or a bare gait.
fn subject(args: &EvalArgs) -> Result<(Resolved, Option<PolicyFile>), CliError> {
    if let Some(run) = &args.run {
        let (resolved, policy) = learned(run, |document| with_overrides(document, args))?;
        return Ok((resolved, Some(policy)));
    }
    let (robot, prior) = (args.robot.as_deref().unwrap_or_default(), args.prior.as_deref().unwrap_or_default());
    let document = bare_gait(robot, prior)?;
    Ok((resolve(&with_overrides(document, args))?, None))
}

/// The document with what was typed in its place, so that it is checked like the file.
fn with_overrides(mut document: Document, args: &EvalArgs) -> Document {
    let overrides = [
        ("task.slope_deg", args.slope.map(|slope| format!("{slope:?}"))),
        ("task.friction", args.friction.map(|friction| format!("{friction:?}"))),
        ("evaluation.num_episodes", args.episodes.map(|episodes| episodes.to_string())),
        ("evaluation.seed", args.seed.map(|seed| seed.to_string())),
    ];
    for (key, value) in overrides {
        if let Some(value) = value {
            document.set(key, &value);
        }
    }
    document
}
