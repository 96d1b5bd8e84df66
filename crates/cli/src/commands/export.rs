//! `canter export`.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use canter_export::table::OpenLoop;
use canter_export::{Candidate, Certificate, Exported, Thresholds, Walked, c, certify, fitted, onnx, rust, table};
use canter_train::gait_fit::Shape;
use canter_train::run_directory::{read_eval, write_file};
use serde_json::{Value, json};

use crate::args::{ExportArgs, ExportFormat};
use crate::commands::report::report_finished;
use crate::commands::{learned, workers};
use crate::error::CliError;
use crate::output::{complain, say};

/// What an export writes: path within its folder, content.
type Files = Vec<(String, Vec<u8>)>;

/// Files of a format that the nearest stepping gait adds to, where the robot has a firmware that we know.
const FIRMWARE: [&str; 3] = ["firmware.txt", "firmware-certificate.json", "firmware-certificate.txt"];

/// `canter export`.
pub fn export(args: &ExportArgs) -> Result<ExitCode, CliError> {
    let (resolved, policy) = learned(&args.run, |document| document)?;
    let workers = workers(args.workers.threads)?;
    let settings = &resolved.config.evaluation;
    let exported = Exported::new(&resolved.task, &policy)?;
    let mut measured = read_measured(&args.run)?;
    let name = format_name(args.format);
    let average = match args.format {
        ExportFormat::Table | ExportFormat::Gait => {
            let average = table::average(&exported, settings, &workers);
            Some(average.ok_or_else(|| CliError::NoCycle(args.run.display().to_string()))?)
        }
        ExportFormat::C | ExportFormat::Onnx | ExportFormat::Rust => None,
    };
    let judged = read_eval(&args.run)?.and_then(|eval| Walked::from_eval(&eval, settings));
    let folder = args.out.clone().unwrap_or_else(|| args.run.join("export").join(name));
    let mut replay = |format, open_loop: Option<&OpenLoop>| {
        let candidate = Candidate { exported, format, open_loop, judged };
        let certificate = certify(&candidate, settings, &Thresholds::DEFAULT, &workers);
        measured[format] = entry(&certificate);
        write_file(&measured_path(&args.run), format!("{measured:#}\n").as_bytes())?;
        Ok::<_, CliError>(certificate)
    };
    let nearest;
    let (files, open_loop): (Files, _) = match (args.format, &average) {
        (ExportFormat::C, _) => (of_c(&exported), None),
        (ExportFormat::Onnx, _) => (of_onnx(&exported), None),
        (ExportFormat::Rust, _) => {
            let files = rust::export(&exported).into_iter().map(|(path, content)| (path, content.into_bytes()));
            (files.collect(), None)
        }
        (ExportFormat::Table, Some(average)) => (of_table(&exported, average), Some(average)),
        (ExportFormat::Gait, Some(average)) => {
            nearest = fitted::fit(&exported, average, None).map_err(CliError::NoFit)?;
            (vec![("gait.toml".to_owned(), fitted::toml(&nearest).into_bytes())], Some(&nearest.open_loop))
        }
        (ExportFormat::Table | ExportFormat::Gait, None) => unreachable!("it was averaged above"),
    };
    let certificate = permitted(args, &folder, replay(name, open_loop)?)?;
    if args.format == ExportFormat::Gait {
        // Those of an earlier export must not lie beside this one's gait.
        for file in FIRMWARE {
            remove_file(&folder.join(file))?;
        }
    }
    write(&folder, files, &certificate, "")?;
    if let (ExportFormat::Gait, Some(average)) = (args.format, &average) {
        let stepping = fitted::fit(&exported, average, Some(Shape::Stepping)).ok();
        let of_firmware = stepping.and_then(|gait| Some((fitted::firmware_commands(&exported, &gait)?, gait)));
        if let Some((commands, gait)) = of_firmware {
            let certificate = replay("firmware", Some(&gait.open_loop))?;
            if certificate.passed || args.allow_unsafe {
                let files = vec![("firmware.txt".to_owned(), commands.into_bytes())];
                write(&folder, files, &permitted(args, &folder, certificate)?, "firmware-")?;
            } else {
                let broken = describe(&certificate).join("\n");
                complain(&format!(
                    "firmware.txt is left out, for as commands of the firmware the gait breaks:\n{broken}"
                ));
            }
        }
    }
    say(&format!("Written:  {}", folder.display()));
    if average.is_some() {
        // With the open loop's speed beside the policy's.
        report_finished(&args.run);
    }
    Ok(ExitCode::SUCCESS)
}

/// Lets only what is safe pass, or what its owner wants all the same.
fn permitted(args: &ExportArgs, folder: &Path, certificate: Certificate) -> Result<Certificate, CliError> {
    if certificate.passed {
        return Ok(certificate);
    }
    let broken = describe(&certificate);
    if !args.allow_unsafe {
        let earlier = folder.join("certificate.json").exists().then(|| folder.to_owned());
        return Err(CliError::Unsafe { broken, run: args.run.display().to_string(), earlier });
    }
    complain(&format!("this export is not safe, and is written because of --allow-unsafe:\n{}", broken.join("\n")));
    Ok(certificate)
}

/// Writes the files and their certificate, and shows that.
fn write(folder: &Path, mut files: Files, certificate: &Certificate, prefix: &str) -> Result<(), CliError> {
    let json = serde_json::to_value(certificate).expect("a certificate has string keys only");
    files.push((format!("{prefix}certificate.json"), format!("{json:#}\n").into_bytes()));
    files.push((format!("{prefix}certificate.txt"), certificate.text().into_bytes()));
    for (path, content) in &files {
        write_file(&folder.join(path), content)?;
    }
    say(&certificate.text());
    Ok(())
}

fn remove_file(path: &Path) -> Result<(), CliError> {
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(CliError::File(path.display().to_string(), source))
        }
        _ => Ok(()),
    }
}

fn format_name(format: ExportFormat) -> &'static str {
    match format {
        ExportFormat::C => "c",
        ExportFormat::Onnx => "onnx",
        ExportFormat::Rust => "rust",
        ExportFormat::Table => "table",
        ExportFormat::Gait => "gait",
    }
}

fn of_onnx(exported: &Exported<'_>) -> Files {
    let models = [("policy.onnx", onnx::export(exported)), ("start.onnx", onnx::export_start(exported))];
    let files = models.into_iter().chain([("run_policy.py", onnx::RUNNER.into())]);
    files.map(|(path, content)| (path.to_owned(), content)).collect()
}

fn of_table(exported: &Exported<'_>, average: &OpenLoop) -> Files {
    let csv = |of_spread| average.to_csv(exported, of_spread).into_bytes();
    let gait = table::toml(average).into_bytes();
    [("gait.csv", csv(false)), ("spread.csv", csv(true)), ("gait.toml", gait)]
        .map(|(path, content)| (path.to_owned(), content))
        .into()
}

fn of_c(exported: &Exported<'_>) -> Files {
    let files = c::export(exported);
    [(c::HEADER_NAME, files.header), (c::SOURCE_NAME, files.source), (c::SKETCH_NAME, c::SKETCH.to_owned())]
        .map(|(path, content)| (path.to_owned(), content.into_bytes()))
        .into()
}

/// The limits that were broken, a line each.
fn describe(certificate: &Certificate) -> Vec<String> {
    let line = |check: &canter_export::safety::Check| {
        format!("  {}: {}; allowed: {}", check.limit, check.measured, check.allowed)
    };
    certificate.broken().map(line).collect()
}

/// The run's `export.json`: what was measured of its exports, which the report shows beside the policy.
fn measured_path(run: &Path) -> PathBuf {
    run.join("export.json")
}

/// What was measured of earlier exports.
fn read_measured(run: &Path) -> Result<Value, CliError> {
    let path = measured_path(run);
    let text = match std::fs::read_to_string(&path) {
        Err(source) if source.kind() == io::ErrorKind::NotFound => return Ok(json!({})),
        text => text.map_err(|source| CliError::File(path.display().to_string(), source))?,
    };
    let measured = serde_json::from_str(&text).ok().filter(Value::is_object);
    measured.ok_or_else(|| CliError::BrokenMeasurements(path.display().to_string()))
}

fn entry(certificate: &Certificate) -> Value {
    json!({
        "passed": certificate.passed,
        "is_open_loop": certificate.is_open_loop,
        "policy": certificate.policy,
        "exported": certificate.exported,
    })
}
