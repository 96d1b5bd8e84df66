//! `canter report`.

use std::path::Path;
use std::process::ExitCode;

use canter_report::{ReportError, Written, is_comparison, is_sweep, report_compare, report_run, report_sweep};

use crate::args::ReportArgs;
use crate::error::CliError;
use crate::output::{complain, say};

/// `canter report`.
pub fn report(args: &ReportArgs) -> Result<ExitCode, CliError> {
    let written = match (args.folders.as_slice(), &args.out) {
        ([folder], None) if is_comparison(folder) || is_sweep(folder) => report_alone(folder)?,
        (folders, out) => {
            if let Some(comparison) = folders.iter().find(|folder| is_comparison(folder) || is_sweep(folder)) {
                return Err(CliError::ReportAlone(comparison.display().to_string()));
            }
            match (folders, out) {
                (folders, Some(out)) => report_run(folders, out)?,
                ([folder], None) => report_alone(folder)?,
                _ => return Err(CliError::ReportNeedsOut),
            }
        }
    };
    describe(&written);
    Ok(ExitCode::SUCCESS)
}

/// On a folder that stands alone on its page.
fn report_alone(folder: &Path) -> Result<Written, ReportError> {
    if is_comparison(folder) {
        report_compare(folder)
    } else if is_sweep(folder) {
        report_sweep(folder)
    } else {
        report_run(&[folder.to_path_buf()], folder)
    }
}

/// The report that ends a training, a comparison or a sweep, which is not lost with it: what goes wrong is only said.
pub fn report_finished(folder: &Path) {
    match report_alone(folder) {
        Ok(written) => say(&format!("Report:   {}", written.page.display())),
        Err(error) => complain(&format!("there is no report: {error}")),
    }
}

fn describe(written: &Written) {
    for reason in &written.left_out {
        say(&format!("Left out: {reason}"));
    }
    let folder = written.page.parent().unwrap_or(Path::new("")).display();
    let formats = if canter_report::WRITES_PNG { "SVG and PNG" } else { "SVG" };
    say(&format!("Figures:  {} as {formats}, in {folder}/figures", written.num_figures));
    say(&format!("Tables:   {} as CSV, in {folder}/tables", written.num_tables));
    say(&format!("Report:   {}", written.page.display()));
}
