//! Builds and runs: calls to cargo that need MuJoCo or a setting that plain cargo lacks.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use crate::Failure;

/// Builds `canter` in release mode and turns this process into it, so that signals and the exit code are its own.
/// Comes back only with a failure.
pub fn build_and_become_canter(root: &Path, arguments: &[OsString]) -> Failure {
    let binary = match build_canter(root) {
        Ok(binary) => binary,
        Err(failure) => return failure,
    };
    let mut canter = Command::new(&binary);
    // What the program prints to be typed next has to work when it is typed.
    canter.env("CANTER_COMMAND", "cargo canter");
    canter.args(arguments);
    become_program(canter, &binary)
}

/// Builds `canter` and says where it is. Quiet when nothing has to be compiled; otherwise cargo's lines are shown as they
/// come.
pub fn build_canter(root: &Path) -> Result<PathBuf, Failure> {
    let mut cargo = cargo(root, "build");
    cargo.args(["--release", "--package", "canter"]).stderr(Stdio::piped());
    if std::io::stderr().is_terminal() {
        cargo.args(["--color", "always"]);
    }
    let mut child = cargo.spawn().map_err(cannot_start_cargo)?;
    if let Some(stderr) = child.stderr.take() {
        let mut silent = true;
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            // An up-to-date build prints this one line.
            if !(silent && line.contains("Finished")) {
                silent = false;
                eprintln!("{line}");
            }
        }
    }
    passed(child.wait().map_err(cannot_start_cargo)?)?;
    Ok(target_dir(root).join("release").join(format!("canter{}", env::consts::EXE_SUFFIX)))
}

#[cfg(unix)]
fn become_program(mut program: Command, path: &Path) -> Failure {
    use std::os::unix::process::CommandExt;
    let error = program.exec();
    Failure::Task(format!("{} was built but does not start: {error}", path.display()))
}

#[cfg(not(unix))]
fn become_program(mut program: Command, path: &Path) -> Failure {
    match program.status() {
        Ok(status) => Failure::Called(exit_code(status)),
        Err(error) => Failure::Task(format!("{} was built but does not start: {error}", path.display())),
    }
}

/// Unit, integration and documentation tests of every crate, on the release build that everything else uses too.
pub fn test(root: &Path) -> Result<(), Failure> {
    let status = cargo(root, "test").args(["--release", "--workspace"]).status().map_err(cannot_start_cargo)?;
    passed(status)
}

/// Tests of films, which need OpenGL and ffmpeg: plain `cargo test` leaves them out. Of the whole workspace, here and below:
/// a package alone has other features, and would be built anew.
pub fn test_films(root: &Path) -> Result<(), Failure> {
    let films = ["--release", "--workspace", "--test", "film", "--", "--ignored"];
    passed(cargo(root, "test").args(films).status().map_err(cannot_start_cargo)?)
}

/// Tests of figures as PNG files, which have a renderer of their own to build: plain `cargo test` leaves them out.
pub fn test_png(root: &Path) -> Result<(), Failure> {
    let figures = ["--release", "--package", "canter-report", "--features", "png", "--test", "png"];
    passed(cargo(root, "test").args(figures).status().map_err(cannot_start_cargo)?)
}

/// Tests of exports with other people's programs: plain `cargo test` leaves them out.
pub fn test_exports(root: &Path, python: &Path) -> Result<(), Failure> {
    let tests = ["--test", "agreement", "--test", "onnx"];
    let exports = [&["--release", "--workspace"], &tests[..], &["--", "--ignored", "--nocapture"]].concat();
    passed(cargo(root, "test").args(exports).env("CANTER_PYTHON", python).status().map_err(cannot_start_cargo)?)
}

/// Tests of ranks, which need MPI to be built and started: plain `cargo test` leaves them out.
pub fn test_ranks(root: &Path) -> Result<(), Failure> {
    let features = ["--release", "--package", "canter", "--package", "canter-train", "--features", "canter/mpi"];
    let lints = [&features[..], &["--all-targets", "--", "-D", "warnings"]].concat();
    passed(cargo(root, "clippy").args(lints).status().map_err(cannot_start_cargo)?)?;
    let world = ["--release", "--package", "canter-train", "--features", "mpi", "--lib", "world::"];
    passed(cargo(root, "test").args(world).status().map_err(cannot_start_cargo)?)?;
    // One job at a time: each has as many processes as the machine has cores.
    let ranks = ["--release", "--package", "canter", "--features", "mpi", "--test", "mpi", "--", "--test-threads=1"];
    passed(cargo(root, "test").args(ranks).status().map_err(cannot_start_cargo)?)
}

/// Tests of full and read-only disks, which have to be mounted: plain `cargo test` leaves them out.
pub fn test_disks(root: &Path) -> Result<(), Failure> {
    let disks = ["--release", "--workspace", "--test", "reliability", "disk::", "--", "--ignored"];
    passed(cargo(root, "test").args(disks).status().map_err(cannot_start_cargo)?)
}

/// The tests of `docs/reliability.md` at full length, one after the other: a leak is seen only where nothing else runs.
pub fn test_reliability(root: &Path) -> Result<(), Failure> {
    const FULL: [(&str, &str); 4] = [
        ("CANTER_KILLED_RUNS", "200"),
        ("CANTER_SOAK_S", "1800"),
        ("CANTER_FUZZ_INPUTS", "1000000"),
        ("CANTER_MUTATED_MODELS", "10000"),
    ];
    // Package, kind of target, its name; the command line's parser is a part of the program.
    const TESTS: [[&str; 3]; 5] = [
        ["canter", "--test", "reliability"],
        ["canter", "--test", "mutated_models"],
        ["canter", "--bin", "canter"],
        ["canter-train", "--test", "fuzz"],
        ["canter-report", "--test", "fuzz"],
    ];
    for [package, kind, name] in TESTS {
        let mut cargo = cargo(root, "test");
        cargo.args(["--release", "--package", package, kind, name, "--"]);
        cargo.args(["--include-ignored", "--nocapture", "--test-threads=1"]).envs(FULL);
        passed(cargo.status().map_err(cannot_start_cargo)?)?;
    }
    Ok(())
}

/// Builds `no-std-proof`, which cannot be built when `gait` brings in `std` or `alloc`.
pub fn no_std(root: &Path) -> Result<(), Failure> {
    let package = root.join("xtask").join("no-std-proof");
    // The same dependency versions as the workspace's; cargo drops the entries that the proof does not need.
    let lock = package.join("Cargo.lock");
    match fs::copy(root.join("Cargo.lock"), &lock) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(Failure::Task(format!("cannot write {}: {error}", lock.display())));
        }
        _ => {}
    }
    let status = cargo(&package, "build")
        .arg("--quiet")
        .arg("--target-dir")
        .arg(target_dir(root).join("no-std-proof"))
        .status()
        .map_err(cannot_start_cargo)?;
    if !status.success() {
        return Err(Failure::Task(
            "gait does not build without the standard library (the compiler's message is above).\n\
             `panic_impl` found twice: something below gait uses std. `global memory allocator`: something uses alloc.\n\
             Look at gait's dependencies and their default features: `cargo tree --package canter-gait --edges features`."
                .to_owned(),
        ));
    }
    println!("no-std: gait builds with neither std nor alloc");
    Ok(())
}

/// `cargo COMMAND` on the manifest in `folder`, in the current directory (a relative `CARGO_TARGET_DIR` counts from it).
pub fn cargo(folder: &Path, command: &str) -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.arg(command).arg("--manifest-path").arg(folder.join("Cargo.toml"));
    cargo
}

/// Where cargo puts what it builds.
pub fn target_dir(root: &Path) -> PathBuf {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => env::current_dir().unwrap_or_default().join(folder),
        None => root.join("target"),
    }
}

pub fn passed(status: ExitStatus) -> Result<(), Failure> {
    if status.success() { Ok(()) } else { Err(Failure::Called(exit_code(status))) }
}

/// The status' own code; 1 for a program that a signal ended.
fn exit_code(status: ExitStatus) -> u8 {
    status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}

// By value, for `map_err`.
#[expect(clippy::needless_pass_by_value)]
pub fn cannot_start_cargo(error: std::io::Error) -> Failure {
    Failure::Task(format!("cannot run cargo: {error}"))
}
