//! `canter export`.

use std::path::Path;
use std::process::ExitCode;

use canter_export::{Candidate, Certificate, Exported, Thresholds, Walked, c, certify, onnx, rust, table};
use canter_train::run_directory::{read_eval, write_file};
use serde_json::{Value, json};

use crate::args::{ExportArgs, ExportFormat};
use crate::commands::{learned, workers};
use crate::error::CliError;
use crate::output::{complain, say};

/// What an export writes: path within its folder, content.
type Files = Vec<(String, Vec<u8>)>;

/// `canter export`.
pub fn export(args: &ExportArgs) -> Result<ExitCode, CliError> {
    let (resolved, policy) = learned(&args.run, |document| document)?;
    let workers = workers(args.threads)?;
    let settings = &resolved.config.evaluation;
    let exported = Exported::new(&resolved.task, &policy)?;
    let name = format_name(args.format);
    let open_loop = match args.format {
        ExportFormat::Table => {
            let average = table::average(&exported, settings, &workers);
            Some(average.ok_or_else(|| CliError::NoCycle(args.run.display().to_string()))?)
        }
        _ => None,
    };
    let judged = read_eval(&args.run)?.and_then(|eval| Walked::from_eval(&eval, settings));
    let candidate = Candidate { exported, format: name, open_loop: open_loop.as_ref(), judged };
    let certificate = certify(&candidate, settings, &Thresholds::DEFAULT, &workers);
    if !certificate.passed {
        let broken = describe(&certificate);
        if !args.allow_unsafe {
            return Err(CliError::Unsafe(broken, args.run.display().to_string()));
        }
        complain(&format!("this export is not safe, and is written because of --allow-unsafe:\n{}", broken.join("\n")));
    }
    let folder = args.out.clone().unwrap_or_else(|| args.run.join("export").join(name));
    let mut files = match args.format {
        ExportFormat::C => of_c(&exported),
        ExportFormat::Onnx => vec![("policy.onnx".to_owned(), onnx::export(&exported))],
        ExportFormat::Rust => {
            rust::export(&exported).into_iter().map(|(path, content)| (path, content.into_bytes())).collect()
        }
        ExportFormat::Table | ExportFormat::Gait => {
            let open_loop = open_loop.as_ref().expect("made above");
            let csv = |of_spread| open_loop.to_csv(&exported, of_spread).into_bytes();
            vec![("gait.csv".to_owned(), csv(false)), ("spread.csv".to_owned(), csv(true))]
        }
    };
    let json = serde_json::to_value(&certificate).expect("a certificate has string keys only");
    files.push(("certificate.json".to_owned(), format!("{json:#}\n").into_bytes()));
    files.push(("certificate.txt".to_owned(), certificate.text().into_bytes()));
    for (path, content) in &files {
        write_file(&folder.join(path), content)?;
    }
    record(&args.run, &certificate)?;
    say(&certificate.text());
    say(&format!("Written:  {}", folder.display()));
    Ok(ExitCode::SUCCESS)
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
        "policy": certificate.policy,
        "exported": certificate.exported,
    });
    Ok(write_file(&path, format!("{known:#}\n").as_bytes())?)
}
