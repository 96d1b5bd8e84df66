//! Opens reports and the dashboard in a browser. Needs Debian's chromium and Python.

use std::path::Path;
use std::process::Command;

use crate::Failure;
use crate::builds::{build_canter, cannot_start_cargo, cargo, passed, target_dir};

/// Makes sample reports and has `tests/browser/test_page.py` open them, and `test_dashboard.py` the page of `canter serve`,
/// which has to be built; screenshots stay in the target folder.
pub fn test(root: &Path) -> Result<(), Failure> {
    let example = "sample_reports";
    let status = cargo(root, "build")
        .args(["--release", "--package", "canter-report", "--example", example])
        .status()
        .map_err(cannot_start_cargo)?;
    passed(status)?;
    let folder = target_dir(root).join("browser-test");
    let screenshots = folder.join("screenshots");
    run(Command::new(target_dir(root).join("release/examples").join(example)).arg(&folder))?;
    let tests = root.join("tests/browser");
    run(Command::new("python3").arg(tests.join("test_page.py")).arg(&folder).arg(&screenshots))?;
    let canter = build_canter(root)?;
    let dashboard = folder.join("dashboard");
    run(Command::new("python3").arg(tests.join("test_dashboard.py")).arg(canter).arg(dashboard).arg(&screenshots))?;
    println!("browser: reports and dashboard pass; screenshots are in {}", screenshots.display());
    Ok(())
}

fn run(command: &mut Command) -> Result<(), Failure> {
    let status = command
        .status()
        .map_err(|error| Failure::Task(format!("cannot run {}: {error}", command.get_program().display())))?;
    passed(status)
}
