//! The tests that need more than cargo: programs that canter's files are made for, fetched when they are missing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Failure;
use crate::builds;
use crate::files::{failed, make, remove};

/// The version that reads the event file; its own dependencies are the newest that pip finds.
const TENSORBOARD: &str = "2.20.0";

const READ_EVENTS: &str = include_str!("read_events.py");

/// A training of 8 iterations that takes a second, with a checkpoint every second iteration.
const TINY_TRAINING: [&str; 10] = [
    "task.episode_s=0.5",
    "network.actor_hidden=16",
    "network.critic_hidden=16",
    "training.num_environments=4",
    "training.horizon=32",
    "training.max_env_steps=1024",
    "training.checkpoint_env_steps=256",
    "ppo.minibatch_size=64",
    "evaluation.num_episodes=2",
    "evaluation.episode_s=2.0",
];

/// Trains, breaks the run off, resumes it, and has TensorBoard's own package read its event file.
///
/// # Errors
/// Says what TensorBoard sees and should not, or what could not be fetched.
pub fn tensorboard(root: &Path) -> Result<(), Failure> {
    let folder = builds::target_dir(root).join("full");
    make(&folder)?;
    let python = python_with(&folder, &TENSORBOARD_PACKAGES)?;
    let canter = builds::build_canter(root)?;

    let run = folder.join("tensorboard-run");
    remove(&run)?;
    let mut train = Command::new(&canter);
    train.arg("train").arg("--out").arg(&run);
    for setting in TINY_TRAINING {
        train.args(["--set", setting]);
    }
    finish(train, "the training for TensorBoard failed")?;
    // As if it had been killed in iteration 7 or 8: their steps must not be there twice after the resume.
    let newest = run.join("checkpoints").join("00000008.safetensors");
    fs::remove_file(&newest).map_err(|error| failed("remove", &newest, &error))?;
    let mut resume = Command::new(&canter);
    resume.arg("resume").arg(&run);
    finish(resume, "the resume for TensorBoard failed")?;

    let mut read = Command::new(python);
    read.args(["-c", READ_EVENTS]).arg(&run);
    let said = finish(read, "TensorBoard does not see in the event file what metrics.jsonl holds")?;
    println!("tensorboard {TENSORBOARD}: {}", said.trim());
    Ok(())
}

/// Every export against the trained policy, with other people's compilers, ONNX's runtime, MuJoCo for Python and QEMU.
///
/// # Errors
/// An export that differs, or what could not be fetched.
pub fn exports(root: &Path) -> Result<(), Failure> {
    let folder = builds::target_dir(root).join("full");
    make(&folder)?;
    let python = python_with(&folder, &EXPORT_PACKAGES)?;
    builds::test_exports(root, &python)
}

/// Packages of an environment of ours.
pub struct Packages {
    /// The environment's folder.
    pub folder: &'static str,
    /// What is fetched, for a person.
    pub what: &'static str,
    /// As pip takes them.
    pub requirements: &'static [&'static str],
    /// What can be imported once they are there.
    pub import: &'static str,
}

const TENSORBOARD_PACKAGES: Packages = Packages {
    folder: "tensorboard-2.20.0",
    what: "TensorBoard (180 MB on the disk, once)",
    requirements: &["tensorboard==2.20.0"],
    import: "tensorboard.backend.event_processing.event_accumulator",
};

/// MuJoCo in the version that canter runs on; ONNX's are the newest that pip finds.
const EXPORT_PACKAGES: Packages = Packages {
    folder: "onnx-mujoco-3.17.0",
    what: "ONNX, its runtime and MuJoCo for Python (300 MB on the disk, once)",
    requirements: &["onnx", "onnxruntime", "mujoco==3.17.0"],
    import: "mujoco, onnx, onnxruntime",
};

/// The Python of an environment of ours that has these packages; made and filled on first use.
pub fn python_with(folder: &Path, packages: &Packages) -> Result<PathBuf, Failure> {
    let environment = folder.join(packages.folder);
    let python = environment.join("bin").join("python");
    let can_import = |python: &Path| {
        let mut import = Command::new(python);
        import.args(["-c", &format!("import {}", packages.import)]);
        import.output().is_ok_and(|output| output.status.success())
    };
    if can_import(&python) {
        return Ok(python);
    }
    eprintln!("Fetching {} with pip ...", packages.what);
    let mut venv = Command::new("python3");
    venv.args(["-m", "venv", "--clear"]).arg(&environment);
    finish(venv, "cannot make a Python environment (Debian, Ubuntu: `apt install python3-venv`)")?;
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", "--only-binary=:all:"]);
    pip.args(packages.requirements);
    finish(pip, "pip could not install them; check the network (and pip's proxy or mirror setting)")?;
    Ok(python)
}

/// Runs a program to its end and returns its output; a failure says `problem` and what the program said.
pub fn finish(mut program: Command, problem: &str) -> Result<String, Failure> {
    let output = program.output().map_err(|error| {
        Failure::Task(format!("{problem}\ncannot run {}: {error}", program.get_program().to_string_lossy()))
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(Failure::Task(format!("{problem}\n{}", said.trim_end())))
}
