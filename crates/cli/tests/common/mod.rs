//! What the tests of this crate share: the real program, run in a folder of its own with an empty environment.
#![allow(dead_code, reason = "each test binary uses its part")]

#[path = "../../../train/tests/common/folder.rs"]
mod folder;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

#[allow(unused_imports, reason = "each test binary uses its part")]
pub use folder::TemporaryFolder;

impl TemporaryFolder {
    /// Runs canter here and gives up on it after `limit_s`: `None`.
    pub fn canter_within(&self, args: &[&str], limit_s: u64) -> Option<Finished> {
        let child = canter_in(self.path(), args).spawn().unwrap();
        let id = child.id();
        let (sender, receiver) = mpsc::channel();
        thread::spawn(move || sender.send(child.wait_with_output()));
        match receiver.recv_timeout(Duration::from_secs(limit_s)) {
            Ok(output) => Some(Finished::of(&output.unwrap())),
            Err(_) => {
                Command::new("kill").args(["-KILL", &id.to_string()]).status().unwrap();
                None
            }
        }
    }

    /// Runs canter here.
    pub fn canter(&self, args: &[&str]) -> Finished {
        Finished::of(&canter_in(self.path(), args).output().unwrap())
    }
}

/// The program as built for these tests, as `env -i` would start it, but for a width of help that does not depend on
/// where the tests run.
pub fn canter_in(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_canter"));
    command.args(args).current_dir(folder).env_clear().env("COLUMNS", "100");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What a program that has ended left on its way.
#[derive(Debug)]
pub struct Finished {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Finished {
    pub fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
    }

    /// The standard output of a program that succeeded without a word of complaint.
    #[track_caller]
    pub fn succeeded(self) -> String {
        assert_eq!((self.code, self.stderr.as_str()), (Some(0), ""), "{}", self.stdout);
        self.stdout
    }

    /// The standard error of a program that failed with `code` and without a word of success.
    #[track_caller]
    pub fn failed_with(self, code: i32) -> String {
        assert_eq!((self.code, self.stdout.as_str()), (Some(code), ""), "{}", self.stderr);
        self.stderr
    }
}

/// Settings that make a training end within a fraction of a second.
pub const TINY: [&str; 20] = [
    "--set",
    "network.actor_hidden=16",
    "--set",
    "network.critic_hidden=16",
    "--set",
    "training.num_environments=4",
    "--set",
    "training.horizon=32",
    "--set",
    "ppo.minibatch_size=64",
    "--set",
    "evaluation.num_episodes=2",
    "--set",
    "evaluation.episode_s=2.0",
    "--steps",
    "512",
    "--threads",
    "2",
    "--seed",
    "3",
];

/// `canter train` with [`TINY`] settings and these.
pub fn train_args<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["train"], &TINY[..], more].concat()
}

/// The same with another number of env steps.
pub fn train_args_with_steps<'a>(steps: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut args = train_args(more);
    let place = args.iter().position(|arg| *arg == "--steps").unwrap();
    args[place + 1] = steps;
    args
}

/// Calls `check` for each case, two at a time, and reports all that it complains about.
#[track_caller]
pub fn for_each<T: Sync>(cases: &[T], check: impl Fn(&T) -> Result<(), String> + Sync) {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut complaints = Vec::new();
        while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
            complaints.extend(check(case).err());
        }
        complaints
    };
    let complaints = thread::scope(|scope| {
        let other = scope.spawn(work);
        [work(), other.join().unwrap()].concat()
    });
    assert!(complaints.is_empty(), "{} of {}:\n{}", complaints.len(), cases.len(), complaints.join("\n"));
}

/// Names of the files in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A file of the repository.
pub fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}
