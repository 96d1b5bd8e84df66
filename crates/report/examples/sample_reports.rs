//! Writes a sample run and a sample comparison with their reports into a folder: `sample_reports FOLDER`.
//!
//! The numbers are made up. The browser test opens the pages.

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: sample_reports FOLDER")?);
    let (first, second, comparison) = (folder.join("run"), folder.join("second-run"), folder.join("compare"));
    common::write_run(&first, 1, true);
    common::write_run(&second, 2, false);
    common::write_comparison(&comparison, &common::comparison());
    canter_report::report_run(std::slice::from_ref(&first), &first)?;
    canter_report::report_run(&[first, second], &folder.join("runs"))?;
    canter_report::report_compare(&comparison)?;
    Ok(())
}
