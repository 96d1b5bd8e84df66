//! Opens reports in a browser. Needs Debian's chromium and Python.

use std::path::Path;
use std::process::Command;

use crate::Failure;
use crate::builds::{cannot_start_cargo, cargo, passed, target_dir};

/// Makes sample reports and has `tests/browser/test_page.py` open them; screenshots stay in the target folder.
pub fn test(root: &Path) -> Result<(), Failure> {
    let example = "sample_reports";
    let status = cargo(root, "build")
        .args(["--release", "--package", "canter-report", "--example", example])
        .status()
        .map_err(cannot_start_cargo)?;
    passed(status)?;
    let folder = target_dir(root).join("browser-test");
    run(Command::new(target_dir(root).join("release/examples").join(example)).arg(&folder))?;
    run(Command::new("python3")
        .arg(root.join("tests/browser/test_page.py"))
        .arg(&folder)
        .arg(folder.join("screenshots")))?;
    println!("browser: the reports pass; screenshots are in {}", folder.join("screenshots").display());
    Ok(())
}

fn run(command: &mut Command) -> Result<(), Failure> {
    let status = command
        .status()
        .map_err(|error| Failure::Task(format!("cannot run {}: {error}", command.get_program().display())))?;
    passed(status)
}
