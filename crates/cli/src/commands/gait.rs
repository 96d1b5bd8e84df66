//! `canter gait fit` and `canter gait table`.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use canter_sim::robot::table::Recording;
use canter_sim::settings::write_plain;
use canter_sim::{NamedGait, Robot};
use canter_train::config::resolve;
use canter_train::evaluate::{GaitReport, Mover, evaluate};
use canter_train::gait_fit::{self, Fit, GaitBlock, Shape};

use crate::args::{FitShape, GaitArgs, GaitCommand, GaitFitArgs, GaitTableArgs};
use crate::commands::{bare_gait, workers};
use crate::error::CliError;
use crate::output::say;

/// `canter gait`.
pub fn gait(args: &GaitArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        GaitCommand::Fit(args) => fit(args),
        GaitCommand::Table(args) => table(args),
    }
}

/// `canter gait table`.
fn table(args: &GaitTableArgs) -> Result<ExitCode, CliError> {
    let robot = Robot::load(&args.robot)?;
    let gait = robot.gait(&args.prior).ok_or_else(|| CliError::NoGait {
        robot: robot.settings.name.clone(),
        name: args.prior.clone(),
        known: robot.gaits.iter().map(|gait| gait.name.as_str()).collect::<Vec<_>>().join(", "),
    })?;
    let mut lines = vec![robot.actuators().collect::<Vec<_>>().join(",")];
    for row in gait_fit::targets(&robot, gait, usize::from(args.rows)) {
        lines.push(row.iter().map(|target| format!("{target:.6}")).collect::<Vec<_>>().join(","));
    }
    let text = lines.join("\n");
    match &args.out {
        None => say(&text),
        Some(path) => {
            let failed = |source| CliError::Write { path: path.display().to_string(), source };
            std::fs::write(path, text + "\n").map_err(failed)?;
            let (rows, frequency_hz) = (args.rows, gait.stride_frequency_hz);
            say(&format!("Wrote {rows} rows of one cycle at {frequency_hz} Hz into {}", path.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// `canter gait fit`: comments, then the gait as it stands in a robot.toml.
fn fit(args: &GaitFitArgs) -> Result<ExitCode, CliError> {
    let robot = Robot::load(&args.robot)?;
    let path = args.table.display().to_string();
    let refused = |message| CliError::Table { path: path.clone(), message };
    let folder = args.table.parent().unwrap_or(Path::new(""));
    let name = args.table.file_name().map(|name| name.to_string_lossy().into_owned());
    let recording = Recording::load(folder, &name.unwrap_or_default()).map_err(refused)?;
    let targets = recording.targets(&robot).map_err(refused)?;
    let fitted = match args.shape {
        Some(FitShape::Sine) => gait_fit::fit(&robot, &targets, args.frequency, Shape::Sine),
        Some(FitShape::Stepping) => gait_fit::fit(&robot, &targets, args.frequency, Shape::Stepping),
        None => gait_fit::closest(&robot, &targets, args.frequency),
    };
    let fitted = fitted.map_err(|source| CliError::Fit { path: path.clone(), source })?;
    say(&describe(&robot, &fitted, &path, targets.len()));
    if !args.no_eval {
        let table = recording.gait(&robot, "table", args.frequency as f32).map_err(refused)?;
        let [table, gait] = measure(args, &robot, [table, fitted.gait.clone()])?;
        say(&format!("# The table: {}\n# This gait: {}", speed(&table), speed(&gait)));
    }
    say(&format!("\n{}", write_plain(&GaitBlock { gaits: vec![fitted.settings] }).trim()));
    Ok(ExitCode::SUCCESS)
}

/// How far the gait is from the table, as comments.
fn describe(robot: &Robot, fitted: &Fit, path: &str, num_rows: usize) -> String {
    let of_legs: Vec<String> = robot
        .settings
        .legs
        .iter()
        .zip(&fitted.leg_rms_rad)
        .map(|(leg, rms_rad)| format!("{} {rms_rad:.4}", leg.name()))
        .collect();
    format!(
        "# The gait that is closest to {path}, {num_rows} rows, on {}.\n\
         # Root mean square error of swing and extension: {:.4} rad ({}).\n\
         # The table's first row is {:.3} of the way through this gait's cycle.",
        robot.settings.name,
        fitted.rms_rad,
        of_legs.join(", "),
        fitted.shift_cycles
    )
}

/// Both gaits by the default preset's protocol.
fn measure(args: &GaitFitArgs, robot: &Robot, gaits: [NamedGait; 2]) -> Result<[GaitReport; 2], CliError> {
    // Any of the robot's gaits will do: others take its place.
    let document = bare_gait(&args.robot, robot.gaits.first().map_or("", |gait| &gait.name))?;
    let resolved = resolve(&document)?;
    let workers = workers(args.workers.threads)?;
    let mut task = resolved.task;
    let names = gaits.each_ref().map(|gait| gait.name.clone());
    Arc::make_mut(&mut Arc::make_mut(&mut task).robot).gaits = gaits.into();
    Ok(names.map(|name| {
        let task = task.with_gait(&name).expect("the robot has this gait now");
        evaluate(&task, Mover::Prior, &resolved.config.evaluation, &workers)
    }))
}

/// What a measurement says.
fn speed(report: &GaitReport) -> String {
    let (falls, episodes) = (report.falls, report.speeds_m_per_s.len());
    format!("{:.3} m/s, {falls} falls in {episodes} episodes", report.speed_m_per_s)
}
