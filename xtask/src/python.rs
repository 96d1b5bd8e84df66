//! The Python package: its wheel, which holds the program and MuJoCo's library too, and its tests in a clean environment.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::files::{copy, make, remove};
use crate::full::{finish, python_with};
use crate::portable::{self, BUILD_PACKAGES, Places};
use crate::{Failure, builds};

/// What the tests need beside the package.
const TEST_REQUIREMENTS: [&str; 2] = ["pytest", "mypy"];

/// Builds the wheel and says where it is.
///
/// # Errors
/// What could not be built or fetched.
pub fn wheel(root: &Path) -> Result<PathBuf, Failure> {
    // What other builds have made is used again.
    let environment = [("CARGO_TARGET_DIR", builds::target_dir(root).into_os_string())];
    wheel_of(root, &builds::build_canter(root)?, &environment)
}

/// Builds the wheel around a program, with these variables for cargo, and says where it is.
///
/// # Errors
/// What could not be built or fetched.
pub fn wheel_of(root: &Path, canter: &Path, environment: &[(&str, OsString)]) -> Result<PathBuf, Failure> {
    let folder = folder(root)?;
    let python = python_with(&folder, &BUILD_PACKAGES)?;
    put_beside_the_package(root, canter, &python)?;

    let wheels = folder.join("wheels");
    remove(&wheels)?;
    let mut maturin = Command::new(&python);
    maturin.args(["-m", "maturin", "build", "--release", "--locked", "--interpreter"]).arg(&python);
    maturin.arg("--out").arg(&wheels);
    // From there, cargo finds where MuJoCo lies.
    maturin.current_dir(root.join("python")).envs(environment.iter().cloned());
    finish(maturin, "the wheel could not be built")?;
    let wheel = fs::read_dir(&wheels).ok().and_then(|mut entries| entries.next()).and_then(Result::ok);
    Ok(wheel.ok_or_else(|| Failure::Task(format!("maturin left no wheel in {}", wheels.display())))?.path())
}

/// Installs the wheel into a new environment and runs the package's tests there; those with Stable-Baselines3 only if asked
/// for, because it brings PyTorch's gigabytes.
///
/// # Errors
/// A test that failed, or what could not be built or fetched.
pub fn test(root: &Path, with_sb3: bool) -> Result<(), Failure> {
    let mut wheel = wheel(root)?.into_os_string();
    if with_sb3 {
        wheel.push("[sb3]");
    }
    let folder = folder(root)?;
    let environment = folder.join("test");
    let mut venv = Command::new("python3");
    venv.args(["-m", "venv", "--clear"]).arg(&environment);
    finish(venv, "cannot make a Python environment (Debian, Ubuntu: `apt install python3-venv`)")?;
    let python = environment.join("bin").join("python");
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", "--only-binary=:all:"]);
    pip.arg(&wheel).args(TEST_REQUIREMENTS);
    finish(pip, "pip could not install the wheel or what its tests need; check the network")?;

    let package = root.join("python");
    let (settings, tests) = (package.join("pyproject.toml"), package.join("tests"));
    let checks: [&[&OsStr]; 3] = [
        &["pytest".as_ref(), "-q".as_ref(), "-c".as_ref(), settings.as_ref(), tests.as_ref()],
        &["mypy".as_ref(), "--config-file".as_ref(), settings.as_ref(), "--package".as_ref(), "canter".as_ref()],
        &["mypy.stubtest".as_ref(), "canter._native".as_ref()],
    ];
    for check in checks {
        // Not from the package's folder: what is tested is what was installed.
        let mut command = Command::new(&python);
        command.arg("-m").args(check).current_dir(&folder).env("CANTER_REPOSITORY", root);
        builds::passed(command.status().map_err(|error| Failure::Task(format!("cannot run Python: {error}")))?)?;
    }
    Ok(())
}

/// Copies the program and MuJoCo's library to where the wheel takes them from.
fn put_beside_the_package(root: &Path, canter: &Path, python: &Path) -> Result<(), Failure> {
    let package = root.join("python").join("canter");
    let (programs, library) = (package.join("bin"), package.join("mujoco"));
    for folder in [&programs, &library] {
        remove(folder)?;
    }
    for licence in ["LICENSE", "LICENSE-MIT", "LICENSE-APACHE"] {
        copy(&root.join(licence), &programs.join(licence))?;
    }
    portable::put(
        root,
        canter,
        python,
        &Places {
            program: &programs.join("canter"),
            library: &library,
            licenses: &library.join("licenses"),
            crates: &programs.join("crates.txt"),
            packages: &["canter", "canter-python"],
            run_path: "$ORIGIN/../mujoco",
        },
    )
}

/// Where everything of this module lies.
pub fn folder(root: &Path) -> Result<PathBuf, Failure> {
    let folder = builds::target_dir(root).join("python");
    make(&folder)?;
    Ok(folder)
}
