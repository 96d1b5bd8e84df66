//! Fetches the physics engine: MuJoCo's library is taken from its Python package, checked, and put into `.mujoco/`.

use std::env;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

use crate::Failure;

/// The version that the `mujoco-rs` of the workspace's `Cargo.toml` is made for; `.cargo/config.toml` names it too.
pub const VERSION: &str = "3.17.0";

/// The hash of the wheel below. A changed file is refused.
const SHA256: &str = "d66928d86a2d1b601bbaa4dc11db50214d17d5301bb8afd84721313b67ff0874";

/// Which of the package's wheels: any one for x86-64 Linux holds the same library.
const WHEEL_CHOICE: [&str; 8] = [
    "--no-deps",
    "--only-binary=:all:",
    "--python-version",
    "3.11",
    "--implementation",
    "cp",
    "--platform",
    "manylinux_2_28_x86_64",
];

/// The environment variable with the path of a wheel that was downloaded by hand.
const WHEEL_VARIABLE: &str = "CANTER_MUJOCO_WHEEL";

const TEMPORARY_PREFIX: &str = "fetching-";

const UNPACK: &str = include_str!("unpack_wheel.py");

/// The folder that this version lies in.
pub fn folder(root: &Path) -> PathBuf {
    root.join(".mujoco").join(VERSION)
}

/// Fetches MuJoCo and says so, unless it is there already.
///
/// # Errors
/// Leaves nothing half-made behind, and says what to do.
pub fn ensure(root: &Path) -> Result<(), Failure> {
    if is_there(root) {
        return Ok(());
    }
    fetch(root)
        .map_err(|problem| Failure::Task(format!("MuJoCo {VERSION} is needed and could not be set up.\n{problem}")))
}

fn library(root: &Path) -> PathBuf {
    folder(root).join("lib").join("libmujoco.so")
}

/// Whether the library is in its place; it is put there whole.
pub fn is_there(root: &Path) -> bool {
    library(root).is_file()
}

fn fetch(root: &Path) -> Result<(), String> {
    if let Some(problem) = other_machine(env::consts::ARCH, env::consts::OS, &library(root)) {
        return Err(problem);
    }
    let home = root.join(".mujoco");
    fs::create_dir_all(&home).map_err(|error| format!("Cannot make {}: {error}", home.display()))?;

    // One set-up at a time. The lock ends with the process, however that ends.
    let lock = File::open(&home).map_err(|error| format!("Cannot open {}: {error}", home.display()))?;
    let locked = lock.lock().is_ok();
    if is_there(root) {
        return Ok(());
    }
    if folder(root).exists() {
        return Err(format!(
            "{} is there, but has no lib/libmujoco.so. Remove that folder and try again.",
            folder(root).display()
        ));
    }
    // Some network file systems have no locks: there, leave alone what may be another set-up's.
    if locked {
        remove_left_overs(&home);
    }

    let temporary = home.join(format!("{TEMPORARY_PREFIX}{}", std::process::id()));
    let result = fetch_into(root, &temporary);
    let removed = fs::remove_dir_all(&temporary);
    result?;
    removed.map_err(|error| format!("Cannot remove {}: {error}", temporary.display()))
}

/// What to do on a machine that the wheel is not for.
fn other_machine(machine: &str, system: &str, library: &Path) -> Option<String> {
    if (machine, system) == ("x86_64", "linux") {
        return None;
    }
    Some(format!(
        "Set-up knows the library for x86-64 Linux only; this is {machine} {system}.\n\
         Take MuJoCo {VERSION} for this machine from https://github.com/google-deepmind/mujoco/releases and put its\n\
         library at {} (and under its full name beside it).",
        library.display()
    ))
}

fn remove_left_overs(home: &Path) {
    for entry in fs::read_dir(home).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX) {
            // What cannot be removed does no harm.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Makes everything in `temporary`, then moves it into place in one step.
fn fetch_into(root: &Path, temporary: &Path) -> Result<(), String> {
    let start = Instant::now();
    fs::create_dir(temporary).map_err(|error| format!("Cannot make {}: {error}", temporary.display()))?;
    let wheel = match env::var_os(WHEEL_VARIABLE).filter(|path| !path.is_empty()) {
        Some(wheel) => env::current_dir().unwrap_or_default().join(wheel),
        None => {
            eprintln!("Fetching MuJoCo {VERSION} (26 MB, once) with pip ...");
            download(temporary)?
        }
    };
    let unpacked = temporary.join(VERSION);
    unpack(&wheel, &unpacked)?;

    match fs::rename(&unpacked, folder(root)) {
        // Another set-up on a file system without locks was faster.
        Err(_) if is_there(root) => Ok(()),
        Err(error) => Err(format!("Cannot move {} into place: {error}", unpacked.display())),
        Ok(()) => {
            let seconds = start.elapsed().as_secs_f64();
            eprintln!("MuJoCo {VERSION} is ready in {} ({seconds:.1} s)", folder(root).display());
            Ok(())
        }
    }
}

/// Downloads the wheel into `temporary`.
fn download(temporary: &Path) -> Result<PathBuf, String> {
    let requirements = temporary.join("requirements.txt");
    fs::write(&requirements, format!("mujoco=={VERSION} --hash=sha256:{SHA256}\n"))
        .map_err(|error| format!("Cannot write {}: {error}", requirements.display()))?;
    let wheels = temporary.join("wheel");
    let mut pip = python(temporary);
    pip.args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input"])
        .args(["--retries", "2", "--timeout", "20", "--require-hashes"])
        .args(WHEEL_CHOICE)
        .arg("--requirement")
        .arg(&requirements)
        .arg("--dest")
        .arg(&wheels);
    let output = output_of(pip)?;
    if !output.status.success() {
        return Err(explain_pip(&String::from_utf8_lossy(&output.stderr)));
    }
    fs::read_dir(&wheels)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .find(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .ok_or_else(|| format!("pip downloaded no wheel.\n{}", by_hand()))
}

/// What pip's messages mean, and what to do.
fn explain_pip(messages: &str) -> String {
    let cause = if messages.contains("No module named pip") {
        "python3 has no pip. Install it (Debian, Ubuntu: `apt install python3-pip`) and try again."
    } else if messages.contains("DO NOT MATCH THE HASHES") {
        "The package that pip downloaded is not the one this version of canter was made with (its hash differs).\n\
         Nothing of it was used. If pip takes packages from a mirror, ask its keeper, or try without it."
    } else if messages.contains("connection") || messages.contains("resolve") || messages.contains("timed out") {
        "pip could not reach the package index. Check the network (and pip's proxy or mirror setting) and try again."
    } else {
        "pip could not download the package."
    };
    let last = messages.trim().lines().rev().take(8).collect::<Vec<_>>();
    let said: String = last.iter().rev().map(|line| format!("  {}\n", line.trim_end())).collect();
    format!("{cause}\n{}\n\npip said:\n{}", by_hand(), said.trim_end())
}

fn by_hand() -> String {
    format!(
        "On a computer with network, this downloads the file:\n  \
         python3 -m pip download mujoco=={VERSION} {}\n\
         Then, here: {WHEEL_VARIABLE}=<path of the .whl file> cargo xtask setup",
        WHEEL_CHOICE.join(" ")
    )
}

/// Checks the wheel's hash and puts its library and licences into `folder`.
fn unpack(wheel: &Path, folder: &Path) -> Result<(), String> {
    if !wheel.is_file() {
        return Err(format!("{WHEEL_VARIABLE} names {}, which is not a file.\n{}", wheel.display(), by_hand()));
    }
    let mut program = python(folder.parent().unwrap_or(folder));
    program
        .args(["-c", UNPACK])
        .arg(wheel)
        .arg(SHA256)
        .arg(folder)
        .args([format!("mujoco/libmujoco.so.{VERSION}"), VERSION.to_owned()]);
    let output = output_of(program)?;
    match output.status.code() {
        Some(0) => Ok(()),
        Some(3) => Err(format!(
            "{} is not the file that this version of canter was made with; nothing of it was used.\n\
             expected sha256 {SHA256}\n   found sha256 {}\n{}",
            wheel.display(),
            String::from_utf8_lossy(&output.stdout).trim(),
            by_hand()
        )),
        _ => {
            // Of a traceback, the last line says what happened.
            let said = String::from_utf8_lossy(&output.stderr);
            Err(format!("Cannot unpack {}: {}", wheel.display(), said.trim().lines().last().unwrap_or_default()))
        }
    }
}

/// `python3` in a folder of ours: no module beside the caller can get in its way.
pub fn python(folder: &Path) -> Command {
    let mut python = Command::new("python3");
    python.current_dir(folder);
    python
}

/// What a program printed, and how it ended.
///
/// # Errors
/// It cannot be started.
pub fn output_of(mut python: Command) -> Result<Output, String> {
    python.output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            "python3 was not found; set-up needs it once, to fetch MuJoCo from its Python package.\n\
             Install it with pip (Debian, Ubuntu: `apt install python3-pip`) and try again."
                .to_owned()
        }
        _ => format!("Cannot run python3: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_one_that_cargo_links_and_the_program_looks_for() {
        let folder = format!(".mujoco/{VERSION}/lib\"");
        assert!(include_str!("../../.cargo/config.toml").contains(&folder));
        assert!(include_str!("../../crates/cli/build.rs").contains(&folder));
    }

    #[test]
    fn pip_messages_are_explained() {
        assert!(explain_pip("/usr/bin/python3: No module named pip").starts_with("python3 has no pip."));
        assert!(explain_pip("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES").contains("its hash differs"));
        let unreachable = explain_pip("WARNING: Retrying after connection broken by ...");
        assert!(unreachable.starts_with("pip could not reach the package index."), "{unreachable}");
        let unknown = explain_pip("line 1\nline 2\n");
        assert!(unknown.ends_with("pip said:\n  line 1\n  line 2"), "{unknown}");
        assert!(unknown.contains("CANTER_MUJOCO_WHEEL=<path"), "{unknown}");
    }

    #[test]
    fn another_machine_is_told_where_to_put_its_library() {
        assert_eq!(other_machine("x86_64", "linux", Path::new("x")), None);
        let problem = other_machine("aarch64", "macos", Path::new("repo/lib/libmujoco.so")).unwrap();
        assert!(problem.contains("this is aarch64 macos"), "{problem}");
        assert!(problem.contains("repo/lib/libmujoco.so"), "{problem}");
    }

    #[test]
    fn left_overs_are_removed_and_the_rest_is_kept() {
        let home = env::temp_dir().join(format!("canter-xtask-left-overs-{}", std::process::id()));
        fs::create_dir_all(home.join("fetching-1").join("wheel")).unwrap();
        fs::create_dir_all(home.join("3.17.0")).unwrap();
        remove_left_overs(&home);
        let names: Vec<_> = fs::read_dir(&home).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        fs::remove_dir_all(&home).unwrap();
        assert_eq!(names, ["3.17.0"]);
    }
}
