//! `canter export`.

use std::path::Path;
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

/// `canter export`.
pub fn export(args: &ExportArgs) -> Result<ExitCode, CliError> {
    let (resolved, policy) = learned(&args.run, |document| document)?;
    let workers = workers(args.workers.threads)?;
    let settings = &resolved.config.evaluation;
    let exported = Exported::new(&resolved.task, &policy)?;
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
    let release = |format, open_loop: Option<&OpenLoop>, files: Files, suffix: &str| {
        let candidate = Candidate { exported, format, open_loop, judged };
        let certificate = certify(&candidate, settings, &Thresholds::DEFAULT, &workers);
        record(&args.run, &certificate)?;
        permit(args, &certificate)?;
        write(&folder, files, &certificate, suffix)
    };
    match (args.format, &average) {
        (ExportFormat::C, _) => release(name, None, of_c(&exported), "")?,
        (ExportFormat::Onnx, _) => {
            let models = [("policy.onnx", onnx::export(&exported)), ("start.onnx", onnx::export_start(&exported))];
            let files = models.into_iter().chain([("run_policy.py", onnx::RUNNER.into())]);
            release(name, None, files.map(|(path, content)| (path.to_owned(), content)).collect(), "")?;
        }
        (ExportFormat::Rust, _) => {
            let files = rust::export(&exported).into_iter().map(|(path, content)| (path, content.into_bytes()));
            release(name, None, files.collect(), "")?;
        }
        (ExportFormat::Table, Some(average)) => {
            let csv = |of_spread| average.to_csv(&exported, of_spread).into_bytes();
            let gait = table::toml(average).into_bytes();
            let files = [("gait.csv", csv(false)), ("spread.csv", csv(true)), ("gait.toml", gait)];
            let files = files.map(|(path, content)| (path.to_owned(), content));
            release(name, Some(average), files.into(), "")?;
        }
        (ExportFormat::Gait, Some(average)) => {
            let nearest = fitted::fit(&exported, average, None).map_err(CliError::NoFit)?;
            let stepping = fitted::fit(&exported, average, Some(Shape::Stepping)).ok();
            let of_firmware = stepping.and_then(|gait| Some((fitted::firmware_commands(&exported, &gait)?, gait)));
            let file = ("gait.toml".to_owned(), fitted::toml(&nearest).into_bytes());
            release(name, Some(&nearest.open_loop), vec![file], "")?;
            if let Some((commands, gait)) = of_firmware {
                let file = ("firmware.txt".to_owned(), commands.into_bytes());
                release("firmware", Some(&gait.open_loop), vec![file], "firmware-")?;
            }
        }
        (ExportFormat::Table | ExportFormat::Gait, None) => unreachable!("it was averaged above"),
    }
    say(&format!("Written:  {}", folder.display()));
    if average.is_some() {
        // With the open loop's speed beside the policy's.
        report_finished(&args.run);
    }
    Ok(ExitCode::SUCCESS)
}

/// Lets only what is safe pass, or what its owner wants all the same.
fn permit(args: &ExportArgs, certificate: &Certificate) -> Result<(), CliError> {
    if certificate.passed {
        return Ok(());
    }
    let broken = describe(certificate);
    if !args.allow_unsafe {
        return Err(CliError::Unsafe(broken, args.run.display().to_string()));
    }
    complain(&format!("this export is not safe, and is written because of --allow-unsafe:\n{}", broken.join("\n")));
    Ok(())
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

fn format_name(format: ExportFormat) -> &'static str {
    match format {
        ExportFormat::C => "c",
        ExportFormat::Onnx => "onnx",
        ExportFormat::Rust => "rust",
        ExportFormat::Table => "table",
        ExportFormat::Gait => "gait",
    }
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

/// Adds what was measured to the run's `export.json`, which the report shows beside the policy.
fn record(run: &Path, certificate: &Certificate) -> Result<(), CliError> {
    let path = run.join("export.json");
    let known = std::fs::read_to_string(&path).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    let mut known = known.filter(Value::is_object).unwrap_or_else(|| json!({}));
    known[certificate.format] = json!({
        "passed": certificate.passed,
        "is_open_loop": certificate.is_open_loop,
        "policy": certificate.policy,
        "exported": certificate.exported,
    });
    Ok(write_file(&path, format!("{known:#}\n").as_bytes())?)
}
