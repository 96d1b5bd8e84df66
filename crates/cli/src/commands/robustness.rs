//! `canter robustness`.

use std::path::Path;
use std::process::ExitCode;

use canter_sim::settings::Document;
use canter_train::config::RunConfig;
use canter_train::policy_file::PolicyFile;
use canter_train::robustness::{Measured, Row, measure, rows};
use serde_json::json;

use crate::args::RobustnessArgs;
use crate::commands::{learned, workers};
use crate::error::CliError;
use crate::output::say;

/// Runs of one configuration.
struct Group {
    name: String,
    /// Of the first of them, without its seed.
    config: RunConfig,
    seeds: Vec<u64>,
    runs: Vec<Vec<Measured>>,
}

/// `canter robustness`.
pub fn robustness(args: &RobustnessArgs) -> Result<ExitCode, CliError> {
    let workers = workers(args.workers.threads)?;
    let mut groups: Vec<Group> = Vec::new();
    for run in &args.runs {
        let (resolved, policy): (_, PolicyFile) = learned(run, |document| with_overrides(document, args))?;
        let measured = measure(&resolved, &policy.policy(), &workers)?;
        let seed = resolved.config.seed;
        let config = RunConfig { seed: 0, ..resolved.config };
        let known = groups.iter().position(|group| group.config == config);
        let index = known.unwrap_or_else(|| {
            groups.push(Group { name: name(run, seed), config, seeds: Vec::new(), runs: Vec::new() });
            groups.len() - 1
        });
        groups[index].seeds.push(seed);
        groups[index].runs.push(measured);
    }
    let tables: Vec<Vec<Row>> = groups.iter().map(|group| rows(&group.runs)).collect();
    if args.json {
        let groups = groups.iter().zip(&tables);
        let groups: Vec<_> = groups
            .map(|(group, rows)| {
                json!({
                    "name": group.name,
                    "robot": group.config.robot,
                    "training_seeds": group.seeds,
                    "env_steps": group.config.training.max_env_steps,
                    "num_episodes": group.config.evaluation.num_episodes,
                    "evaluation_seed": group.config.evaluation.seed,
                    "conditions": rows,
                })
            })
            .collect();
        say(&format!("{:#}", json!(groups)));
    } else {
        for (group, rows) in groups.iter().zip(&tables) {
            say(&table(group, rows));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What the runs are called: the folder's name up to the seed.
fn name(run: &Path, seed: u64) -> String {
    let name = run.file_name().map_or_else(|| run.display().to_string(), |name| name.to_string_lossy().into_owned());
    let end = name.rfind(&format!("-{seed}")).unwrap_or(name.len());
    name[..end].to_owned()
}

fn table(group: &Group, rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.condition.len()).max().unwrap_or(0);
    let seeds: Vec<_> = group.seeds.iter().map(u64::to_string).collect();
    let label = if seeds.len() == 1 { "seed" } else { "seeds" };
    let mut lines = vec![
        format!("{}, {label} {}", group.name, seeds.join(", ")),
        format!("{:width$}  speed  of its own   least  falls of", ""),
        format!("{:width$}    m/s           %       %", ""),
    ];
    let percent = |share: Option<f64>| share.map_or("-".to_owned(), |share| format!("{:.0}", 100.0 * share));
    for row in rows {
        lines.push(format!(
            "{:width$}{:>7.2}{:>12}{:>8}{:>7} {}",
            row.condition,
            row.speed_m_per_s,
            percent(row.share),
            percent(row.least_share),
            row.falls,
            row.num_episodes
        ));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// The document with what was typed in its place, so that it is checked like the file.
fn with_overrides(mut document: Document, args: &RobustnessArgs) -> Document {
    if let Some(episodes) = args.episodes {
        document.set("evaluation.num_episodes", &episodes.to_string());
    }
    if let Some(seed) = args.seed {
        document.set("evaluation.seed", &seed.to_string());
    }
    document
}
