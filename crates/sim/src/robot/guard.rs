//! Tries a user's model in a process of its own, with limits, before this process compiles it.
//!
//! MuJoCo has no limits: a model can take minutes and gigabytes, or crash it. The hidden command `compile-model` of the
//! program `canter` limits itself ([`limit_this_process`]) and compiles; [`try_in_a_process`] starts it and puts into words
//! how it ended.

use std::io::Read;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

#[cfg(unix)]
use rustix::process::Signal;

/// Exit code with which the process refuses a model, and what its complaint begins with.
const REFUSED: (i32, &str) = (1, "error: ");

/// Processor time in which a model has to be compiled [s]; a large one takes one second.
const CPU_LIMIT_S: u64 = 20;

/// Time after which the process is ended whatever it does [s].
const WALL_LIMIT_S: u64 = 30;

/// Address space of the process [GiB], the program itself included.
const MEMORY_LIMIT_GIB: u64 = 4;

/// Most bytes of complaint that are read; MuJoCo's message has at most 1000.
const MAX_COMPLAINT_BYTES: u64 = 1 << 16;

/// What MuJoCo, C++ and Rust say when they get no memory.
const OUT_OF_MEMORY: [&str; 4] = ["bad_alloc", "ould not allocate", "ailed to allocate", "memory allocation"];

/// The signals that end a process which has gone wrong by itself.
#[cfg(unix)]
const CRASHES: [Signal; 5] = [Signal::ILL, Signal::ABORT, Signal::BUS, Signal::FPE, Signal::SEGV];

/// Whether MuJoCo can compile the model, found out by the program `canter` at the path `program`.
///
/// # Errors
/// What went wrong, in words that a [`ModelGuard`](super::ModelGuard) gives.
pub fn try_in_a_process(program: &Path, model: &Path) -> Result<(), String> {
    let cannot = |error: std::io::Error| format!("the process that tries it cannot be started: {error}");
    let mut child = Command::new(program)
        .args(["compile-model", "--"])
        .arg(model)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(cannot)?;
    let stderr = child.stderr.take();
    let (sender, receiver) = mpsc::channel();
    // Its end closes the pipe, which ends the thread.
    thread::spawn(move || {
        let mut complaint = Vec::new();
        let read = stderr.map(|stderr| stderr.take(MAX_COMPLAINT_BYTES).read_to_end(&mut complaint));
        // Nobody waits any more after the time limit.
        let _ = sender.send(read.map(|_| String::from_utf8_lossy(&complaint).into_owned()).unwrap_or_default());
    });
    let complaint = receiver.recv_timeout(Duration::from_secs(WALL_LIMIT_S));
    if complaint.is_err() {
        // It may have ended just now.
        let _ = child.kill();
    }
    let status = child.wait().map_err(cannot)?;
    complaint.map_err(|_| too_long(WALL_LIMIT_S, "time")).and_then(|complaint| verdict(status, &complaint))
}

fn too_long(limit_s: u64, what: &str) -> String {
    format!("compiling it takes more than {limit_s} s of {what}; make its meshes smaller or its parts fewer")
}

/// How the process ended, in words.
fn verdict(status: ExitStatus, complaint: &str) -> Result<(), String> {
    if status.success() {
        return Ok(());
    }
    if OUT_OF_MEMORY.iter().any(|words| complaint.contains(words)) {
        return Err(format!(
            "compiling it takes more than {MEMORY_LIMIT_GIB} GiB of memory; make its meshes and textures smaller or its \
             parts fewer"
        ));
    }
    let (code, beginning) = REFUSED;
    if status.code() == Some(code) {
        return Err(complaint.trim().trim_start_matches(beginning).to_owned());
    }
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        if signal == Signal::XCPU.as_raw() {
            return Err(too_long(CPU_LIMIT_S, "processor time"));
        }
        if CRASHES.iter().any(|crash| crash.as_raw() == signal) {
            return Err(format!("it crashes MuJoCo (signal {signal}); take out parts to find the one that does"));
        }
    }
    Err(format!("the process that tries it ended with {status}"))
}

/// Limits what this process may use from now on.
///
/// # Errors
/// The system refuses.
#[cfg(unix)]
pub fn limit_this_process() -> std::io::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    // Up to the hard limit there is a signal with a name; at it, the process is killed.
    for (resource, soft, hard) in [
        (Resource::As, MEMORY_LIMIT_GIB << 30, MEMORY_LIMIT_GIB << 30),
        (Resource::Cpu, CPU_LIMIT_S, CPU_LIMIT_S + 1),
        (Resource::Core, 0, 0),
    ] {
        // Nobody may raise a limit that is lower already.
        let present = getrlimit(resource).maximum.unwrap_or(u64::MAX);
        let limit = Rlimit { current: Some(soft.min(present)), maximum: Some(hard.min(present)) };
        setrlimit(resource, limit)?;
    }
    Ok(())
}

/// Limits nothing: this system has no such limits, or we do not know them.
#[cfg(not(unix))]
pub fn limit_this_process() -> std::io::Result<()> {
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn every_end_has_its_words() {
        // As `wait` gives them: a code in the second byte, a signal in the first.
        let ended = |raw: i32, complaint: &str| verdict(ExitStatus::from_raw(raw), complaint);
        assert_eq!(ended(0, "a warning"), Ok(()));
        assert_eq!(ended(1 << 8, "error: XML Error: x\nElement 'a'\n"), Err("XML Error: x\nElement 'a'".to_owned()));
        for complaint in ["error: MuJoCo: Could not allocate memory", "terminate called after: std::bad_alloc"] {
            assert!(ended(1 << 8, complaint).unwrap_err().contains("more than 4 GiB of memory"));
            assert!(ended(6, complaint).unwrap_err().contains("more than 4 GiB of memory"));
        }
        assert!(ended(24, "").unwrap_err().contains("more than 20 s of processor time"));
        assert!(ended(11, "").unwrap_err().contains("crashes MuJoCo (signal 11)"));
        assert!(ended(2, "").unwrap_err().contains("ended with signal: 2"));
        assert!(ended(7 << 8, "").unwrap_err().contains("ended with exit status: 7"));
    }
}
