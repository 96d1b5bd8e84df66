//! `canter robustness`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use canter_sim::settings::Document;
use canter_train::config::{Resolved, RunConfig, preset_of};
use canter_train::policy_file::PolicyFile;
use canter_train::robustness::{Row, measure, rows};
use serde_json::json;

use crate::args::RobustnessArgs;
use crate::commands::{learned, workers};
use crate::error::CliError;
use crate::output::say;

/// Runs of one configuration, each of its own seed.
struct Group {
    name: String,
    /// Of the first of them, without its seed.
    config: RunConfig,
    runs: Vec<Run>,
}

/// A run that is to be measured.
struct Run {
    folder: PathBuf,
    resolved: Resolved,
    policy: PolicyFile,
}

/// `canter robustness`.
pub fn robustness(args: &RobustnessArgs) -> Result<ExitCode, CliError> {
    let workers = workers(args.workers.threads)?;
    let groups = groups(args)?;
    let mut tables: Vec<Vec<Row>> = Vec::new();
    for group in &groups {
        let measured = group.runs.iter().map(|run| measure(&run.resolved, &run.policy.policy(), &workers));
        tables.push(rows(&measured.collect::<Result<Vec<_>, _>>()?));
    }
    if args.json {
        let groups = groups.iter().zip(&tables);
        let groups: Vec<_> = groups
            .map(|(group, rows)| {
                json!({
                    "name": group.name,
                    "robot": group.config.robot,
                    "training_seeds": group.seeds().collect::<Vec<_>>(),
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

/// The runs, those that differ by their seed alone together.
fn groups(args: &RobustnessArgs) -> Result<Vec<Group>, CliError> {
    let mut groups: Vec<Group> = Vec::new();
    for folder in &args.runs {
        let (resolved, policy) = learned(folder, |document| with_overrides(document, args))?;
        let seed = resolved.config.seed;
        let config = RunConfig { seed: 0, ..resolved.config.clone() };
        let known = groups.iter().position(|group| group.config == config);
        let index = known.unwrap_or_else(|| {
            let name = preset_of(&config).unwrap_or_else(|| folder_name(folder, seed));
            groups.push(Group { name, config, runs: Vec::new() });
            groups.len() - 1
        });
        let runs = &mut groups[index].runs;
        if let Some(same) = runs.iter().find(|run| run.resolved.config.seed == seed) {
            let [first, second] = [&same.folder, folder].map(|folder| folder.display().to_string());
            return Err(CliError::SameRun { first, second, seed });
        }
        runs.push(Run { folder: folder.clone(), resolved, policy });
    }
    Ok(groups)
}

impl Group {
    fn seeds(&self) -> impl Iterator<Item = u64> {
        self.runs.iter().map(|run| run.resolved.config.seed)
    }
}

/// What runs are called that are no preset's: their folder's name without seed and number.
fn folder_name(run: &Path, seed: u64) -> String {
    let name = run.file_name().map_or_else(|| run.display().to_string(), |name| name.to_string_lossy().into_owned());
    let ending = format!("-{seed}");
    let unnumbered = name.trim_end_matches(|digit: char| digit.is_ascii_digit()).strip_suffix('-');
    let stem = unnumbered.and_then(|name| name.strip_suffix(&ending)).or_else(|| name.strip_suffix(&ending));
    stem.unwrap_or(&name).to_owned()
}

fn table(group: &Group, rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.condition.len()).max().unwrap_or(0);
    let seeds: Vec<_> = group.seeds().map(|seed| seed.to_string()).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_called_by_what_comes_before_seed_and_number() {
        let name = |run: &str, seed| folder_name(Path::new(run), seed);
        assert_eq!(name("runs/doggo-1-1", 1), "doggo");
        assert_eq!(name("runs/my-own-7-12", 7), "my-own");
        assert_eq!(name("runs/robust/2-3", 3), "2");
        assert_eq!(name("runs/first/", 1), "first");
        assert_eq!(name("runs/go1-1", 1), "go1");
        assert_eq!(name("runs/go1", 1), "go1");
    }
}
