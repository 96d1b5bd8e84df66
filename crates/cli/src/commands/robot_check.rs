//! `canter robot check`.

use std::path::Path;
use std::process::ExitCode;

use canter_sim::robot::checkup::{Checkup, Finding, Origin, Severity, Standing, checkup};
use canter_sim::robot::{GaitSettings, NamedGait};
use canter_train::config::resolve;
use canter_train::evaluate::{GaitReport, Mover, evaluate};
use canter_train::film::take::{Clock, shoot};
use canter_train::film::{self, FilmSettings, Format};
use serde_json::{Value, json};

use crate::args::RobotCheckArgs;
use crate::commands::{bare_gait, workers};
use crate::error::{CliError, FAILURE};
use crate::output::say;

/// A gait that covers less than this share of what its feet would carry it does not walk.
const LEAST_SHARE: f64 = 0.1;

/// How one gait walked.
struct Walk {
    name: String,
    report: GaitReport,
}

/// `canter robot check`.
pub fn robot_check(args: &RobotCheckArgs) -> Result<ExitCode, CliError> {
    if let Some(path) = &args.film {
        Format::of(path)?;
    }
    let mut found = checkup(&args.robot);
    let mut walks = Vec::new();
    let gaits: Vec<(usize, NamedGait)> =
        found.robot.iter().flat_map(|robot| robot.gaits.iter().cloned().enumerate()).collect();
    // What cannot stand need not walk.
    let stands = !found.findings.iter().any(|finding| finding.severity == Severity::Error);
    for (number, gait) in gaits.into_iter().filter(|(_, gait)| gait.is_default && stands) {
        walks.push(walk(args, (number, &gait.name), &mut found)?);
    }
    let num = |severity| found.findings.iter().filter(|finding| finding.severity == severity).count();
    let (num_errors, num_warnings) = (num(Severity::Error), num(Severity::Warning));
    if args.json {
        say(&format!("{:#}", to_json(&found, &walks)));
    } else {
        describe(&found, &walks, args.episodes);
        say(&match (num_errors, num_warnings) {
            (0, 0) => "Nothing is wrong.".to_owned(),
            _ => format!("{}, {}.", counted(num_errors, "error"), counted(num_warnings, "warning")),
        });
    }
    if let (Some(path), Some(walk)) = (&args.film, walks.first()) {
        film_gait(&args.robot, &walk.name, path)?;
        if !args.json {
            say(&format!("Film:     {}", path.display()));
        }
    }
    Ok(if num_errors == 0 { ExitCode::SUCCESS } else { ExitCode::from(FAILURE) })
}

fn counted(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// Walks a gait for a few episodes and adds what is wrong with it.
fn walk(args: &RobotCheckArgs, (number, name): (usize, &str), found: &mut Checkup) -> Result<Walk, CliError> {
    let mut document = bare_gait(&args.robot, name)?;
    document.set("evaluation.num_episodes", &args.episodes.to_string());
    let resolved = resolve(&document)?;
    let report = evaluate(&resolved.task, Mover::Prior, &resolved.config.evaluation, &workers(args.workers.threads)?);
    let key = |key: &str| format!("gaits[{number}].{key}");
    let settings = &resolved.task.robot.settings.gaits[number];
    // The way of a foot on the ground in the time that it is there.
    let nominal = match settings {
        GaitSettings::Stepping(gait) => gait.step_length_m * gait.stride_frequency_hz / (1.0 - gait.flight_fraction),
        GaitSettings::Sine(gait) => {
            4.0 * gait.swing_amplitude_rad.sin()
                * resolved.task.robot.settings.stance_height_m
                * gait.stride_frequency_hz
        }
        GaitSettings::Table(gait) => 0.1 * resolved.task.robot.settings.stance_height_m * gait.stride_frequency_hz,
    };
    let finding = |fault, severity, origin: Origin, message: String, remedy: &str| Finding {
        severity,
        fault,
        origin,
        message,
        remedy: remedy.to_owned(),
    };
    let speed = report.speed_m_per_s;
    if report.falls > 0 {
        let causes: Vec<_> = report.falls_by_cause.iter().map(|(cause, falls)| format!("{falls} {cause}")).collect();
        let message = format!(
            "`{name}` ends in an accident in {} of {} episodes ({})",
            report.falls,
            args.episodes,
            causes.join(", ")
        );
        let remedy = "shorten its steps, change its frequency, or raise the gains to the real robot's";
        let origin = found.origin_of(&key("name"));
        found.add(finding("gait-falls", Severity::Error, origin, message, remedy));
    } else if speed < 0.0 {
        let message = format!("`{name}` walks backward, at {speed:.3} m/s");
        let remedy = "x has to be forward in the model; a longer stance than flight (flight_fraction) helps too";
        let origin = found.origin_of(&key("name"));
        found.add(finding("gait-walks-backward", Severity::Error, origin, message, remedy));
    } else if speed < LEAST_SHARE * nominal {
        let message = format!("`{name}` hardly moves: {speed:.3} m/s, where its feet would carry it {nominal:.2} m/s");
        let remedy = "look whether its feet slip or its motors lag: friction, gains, torque limit";
        let origin = found.origin_of(&key("name"));
        found.add(finding("gait-does-not-walk", Severity::Error, origin, message, remedy));
    }
    Ok(Walk { name: name.to_owned(), report })
}

/// Films a bare gait.
fn film_gait(robot: &str, name: &str, path: &Path) -> Result<(), CliError> {
    let resolved = resolve(&bare_gait(robot, name)?)?;
    let settings = FilmSettings { clock: Clock { length_s: 5.0, frames_per_s: 25 }, size: [960, 360] };
    let take = shoot(&resolved.task, Mover::Prior, &resolved.config.evaluation, settings.clock, name)?;
    film::film(path, &resolved.task.robot, &[take], &settings, &mut |_| true)?;
    Ok(())
}

fn place(origin: &Origin) -> String {
    match origin.line {
        Some(line) => format!("{}:{line}", origin.file),
        None => origin.file.clone(),
    }
}

fn describe(found: &Checkup, walks: &[Walk], episodes: u16) {
    for finding in &found.findings {
        say(&format!(
            "{}: {}[{}]: {}",
            place(&finding.origin),
            finding.severity.name(),
            finding.fault,
            finding.message
        ));
        if !finding.remedy.is_empty() {
            say(&format!("    {}", finding.remedy));
        }
    }
    if !found.findings.is_empty() {
        say("");
    }
    if let (Some(robot), Some(standing)) = (&found.robot, &found.standing) {
        say(&format!("{}, {:.3} kg", robot.settings.description, robot.model.total_mass_kg()));
        let Standing { sink_m, lean_deg, creep_m, swing_rad, torque_nm } = standing;
        say(&format!(
            "Standing: sinks {sink_m:.4} m, leans {lean_deg:.1} deg, creeps {creep_m:.4} m; motors swing {swing_rad:.4} rad \
             and give up to {torque_nm:.2} N m"
        ));
    }
    for Walk { name, report } in walks {
        say(&format!(
            "Walking:  {name} {:.3} m/s, {} in {episodes} episodes, drift {:.2} m, turn {:.0} deg",
            report.speed_m_per_s,
            counted(report.falls as usize, "fall"),
            report.drift_m,
            report.heading_deg
        ));
    }
}

fn to_json(found: &Checkup, walks: &[Walk]) -> Value {
    let findings: Vec<Value> = found
        .findings
        .iter()
        .map(|finding| {
            json!({
                "severity": finding.severity.name(),
                "fault": finding.fault,
                "file": finding.origin.file,
                "line": finding.origin.line,
                "message": finding.message,
                "remedy": finding.remedy,
            })
        })
        .collect();
    let standing = found.standing.map(|Standing { sink_m, lean_deg, creep_m, swing_rad, torque_nm }| {
        json!({ "sink_m": sink_m, "lean_deg": lean_deg, "creep_m": creep_m, "swing_rad": swing_rad, "torque_nm": torque_nm })
    });
    let gaits: serde_json::Map<String, Value> = walks
        .iter()
        .map(|walk| (walk.name.clone(), serde_json::to_value(&walk.report).expect("a report has string keys only")))
        .collect();
    json!({ "findings": findings, "standing": standing, "gaits": gaits })
}
