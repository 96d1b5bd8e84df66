//! Real ranks that mpirun starts: the same bytes as one process, whatever happens to them. `crates/train/tests/ranks.rs` has
//! what needs no MPI.
#![cfg(target_os = "linux")]

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use canter_learn::communicator::Communicator;
use canter_train::world::World;
use common::{Finished, TemporaryFolder, names, train_args_with_steps};
use serde_json::Value;

/// Minibatches of four shards and of one, episodes that end, a checkpoint every second iteration.
const SHARDED: [&str; 10] = [
    "--set",
    "training.horizon=128",
    "--set",
    "ppo.minibatch_size=512",
    "--set",
    "task.episode_s=0.5",
    "--set",
    "training.checkpoint_env_steps=1024",
    "--set",
    "task.variation.curriculum=true",
];

/// 60 iterations: enough to be killed in the middle.
const LONG: &str = "30720";

/// More env steps than anybody waits for.
const ENDLESS: &str = "100000000";

/// canter on this many ranks, which may use all cores.
fn mpirun(folder: &Path, num_ranks: usize, args: &[&str]) -> Command {
    start(folder, num_ranks, env!("CARGO_BIN_EXE_canter"), args)
}

/// A program on this many ranks.
fn start(folder: &Path, num_ranks: usize, program: &str, args: &[&str]) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["-n", &num_ranks.to_string(), program]).args(args).current_dir(folder);
    // As `canter_in`, and with what mpirun needs: its own programs, and Open MPI's leave for root and for few cores.
    command.env_clear().env("PATH", std::env::var_os("PATH").unwrap()).env("COLUMNS", "100");
    for (name, value) in [
        ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
        ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
        ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
        ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    ] {
        command.env(name, value);
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn finished(mut command: Command) -> Finished {
    Finished::of(&command.output().expect("Debian's openmpi-bin has mpirun"))
}

/// Everything that a run leaves and that equal runs have in common.
fn outcome(run: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = vec!["config.toml".to_owned(), "policy.safetensors".to_owned(), "eval.json".to_owned()];
    for folder in ["checkpoints", "trajectories"] {
        files.extend(names(&run.join(folder)).into_iter().map(|name| format!("{folder}/{name}")));
    }
    let mut outcome: BTreeMap<_, _> =
        files.into_iter().map(|name| (name.clone(), fs::read(run.join(&name)).unwrap())).collect();
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let without_times = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        for key in ["collect_s", "update_s"] {
            assert!(line.as_object_mut().unwrap().remove(key).is_some());
        }
        format!("{line}\n")
    };
    outcome.insert("metrics.jsonl".to_owned(), metrics.lines().map(without_times).collect::<String>().into_bytes());
    outcome
}

#[track_caller]
fn assert_same(run: &Path, expected: &BTreeMap<String, Vec<u8>>) {
    let actual = outcome(run);
    assert!(actual.keys().eq(expected.keys()), "{:?}", actual.keys());
    for (name, bytes) in actual {
        assert!(bytes == expected[&name], "{name} of {}", run.display());
    }
}

fn sharded<'a>(steps: &'a str, out: &'a str, threads: &'a str) -> Vec<&'a str> {
    let mut args = train_args_with_steps(steps, &[&SHARDED[..], &["--out", out]].concat());
    let place = args.iter().position(|arg| *arg == "--threads").unwrap();
    args[place + 1] = threads;
    args
}

/// Waits until the run has a checkpoint of at least this iteration.
fn wait_for_checkpoint(run: &Path, iteration: u64, child: &mut Child) {
    let is_there = || {
        let checkpoints = run.join("checkpoints").read_dir().into_iter().flatten().flatten();
        let number = |name: &str| name.strip_suffix(".safetensors")?.parse::<u64>().ok();
        checkpoints.filter_map(|entry| number(entry.file_name().to_str()?)).any(|number| number >= iteration)
    };
    while !is_there() {
        if child.try_wait().unwrap().is_some() {
            panic!("mpirun has ended before");
        }
        sleep(Duration::from_millis(20));
    }
}

/// The processes of canter below this one.
fn ranks_of(mpirun: &Child) -> Vec<u32> {
    let children = |parent: u32| -> Vec<u32> {
        let tasks = fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
        let lists = tasks.filter_map(|task| fs::read_to_string(task.path().join("children")).ok());
        lists.flat_map(|list| list.split_whitespace().map(|id| id.parse().unwrap()).collect::<Vec<u32>>()).collect()
    };
    let (mut ranks, mut next) = (Vec::new(), vec![mpirun.id()]);
    while let Some(process) = next.pop() {
        let name = fs::read_to_string(format!("/proc/{process}/comm")).unwrap_or_default();
        if name.trim() == "canter" { ranks.push(process) } else { next.extend(children(process)) }
    }
    ranks
}

fn signal(process: u32, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap().success());
}

#[test]
fn any_number_of_ranks_and_threads_leaves_the_bytes_of_one_process() {
    let folder = TemporaryFolder::new();
    folder.canter(&sharded("5120", "alone", "2")).succeeded();
    let expected = outcome(&folder.join("alone"));
    for (num_ranks, threads) in [(1, "2"), (2, "1"), (2, "2"), (3, "1"), (3, "2")] {
        let out = format!("run-{num_ranks}-{threads}");
        let stdout = finished(mpirun(folder.path(), num_ranks, &sharded("5120", &out, threads))).succeeded();
        if num_ranks > 1 {
            let who = format!(", {num_ranks} ranks x {threads} threads, into {out}");
            assert_eq!(stdout.matches(&who).count(), 1, "rank 0 alone speaks:\n{stdout}");
        }
        assert_same(&folder.join(&out), &expected);
        let card: Value = serde_json::from_slice(&fs::read(folder.join(&out).join("run.json")).unwrap()).unwrap();
        assert_eq!((card["ranks"].as_u64(), card["env_steps"].as_u64()), (Some(num_ranks as u64), Some(5120)));
        assert_eq!(card["received_bytes"].as_u64().is_some_and(|bytes| bytes > 100_000), num_ranks > 1, "{card}");
    }
}

#[test]
fn a_killed_rank_ends_the_job_and_any_number_of_ranks_goes_on() {
    let folder = TemporaryFolder::new();
    folder.canter(&sharded(LONG, "alone", "2")).succeeded();
    let expected = outcome(&folder.join("alone"));
    for (victim, num_ranks) in [(0, 1), (1, 3)] {
        let out = format!("killed-{victim}");
        let mut job = mpirun(folder.path(), 2, &sharded(LONG, &out, "1")).spawn().unwrap();
        let run = folder.join(&out);
        wait_for_checkpoint(&run, 4, &mut job);
        let ranks = ranks_of(&job);
        assert_eq!(ranks.len(), 2);
        let is_victim = |process: &&u32| {
            let environment = fs::read(format!("/proc/{process}/environ")).unwrap();
            // Open MPI's name for it, and MPICH's.
            let entries = [format!("OMPI_COMM_WORLD_RANK={victim}"), format!("PMI_RANK={victim}")];
            environment.split(|&byte| byte == 0).any(|other| entries.iter().any(|entry| entry.as_bytes() == other))
        };
        signal(*ranks.iter().find(is_victim).unwrap(), "KILL");
        let finished = Finished::of(&wait_at_most(job, Duration::from_secs(10)));
        assert_ne!(finished.code, Some(0), "{finished:?}");
        let said = finished.stdout + &finished.stderr;
        assert!(said.contains("signal 9 (Killed)") || said.contains("EXIT CODE: 9"), "{said}");
        assert!(!run.join("policy.safetensors").exists(), "it was killed in the middle");

        let args = ["resume", &out, "--threads", "1"];
        let stdout = crate::finished(mpirun(folder.path(), num_ranks, &args)).succeeded();
        let done: u64 = stdout.split(' ').nth(3).unwrap().parse().unwrap();
        assert!(stdout.starts_with("Going on after ") && done >= 4 * 512, "{stdout}");
        assert_same(&run, &expected);
    }
}

/// Waits for the end of a job, but no longer than this.
#[track_caller]
fn wait_at_most(mut job: Child, limit: Duration) -> std::process::Output {
    let begin = Instant::now();
    while job.try_wait().unwrap().is_none() {
        if begin.elapsed() > limit {
            job.kill().unwrap();
            panic!("the job goes on after {limit:?}");
        }
        sleep(Duration::from_millis(20));
    }
    job.wait_with_output().unwrap()
}

/// Iteration of the newest checkpoint.
fn newest(run: &Path) -> u64 {
    let names = names(&run.join("checkpoints"));
    names.iter().filter_map(|name| name.strip_suffix(".safetensors")?.parse().ok()).max().unwrap()
}

#[test]
fn a_signal_to_mpirun_saves_and_says_how_to_go_on() {
    let folder = TemporaryFolder::new();
    let mut command = mpirun(folder.path(), 2, &sharded(ENDLESS, "run", "1"));
    // So long it lets the ranks save, and waits in any case.
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "5");
    let mut job = command.spawn().unwrap();
    wait_for_checkpoint(&folder.join("run"), 2, &mut job);
    signal(job.id(), "INT");
    let stopped = Finished::of(&wait_at_most(job, Duration::from_secs(60)));
    assert!(stopped.stdout.contains("env steps, saved. Go on with:  canter resume run"), "{stopped:?}");
    let iterations = fs::read_to_string(folder.join("run/metrics.jsonl")).unwrap().lines().count() as u64;
    assert_eq!(newest(&folder.join("run")), iterations);
}

#[test]
fn what_is_wrong_is_said_once() {
    let folder = TemporaryFolder::new();
    for (num_ranks, args, code, message) in [
        (2, vec!["train", "--set", "ppo.gama=0.9"], 1, "ppo.gama = 0.9 is not a known key"),
        (2, vec!["train", "--nonsense"], 2, "unexpected argument '--nonsense'"),
        (2, vec!["robots"], 1, "only `train`, `resume` and `compare` work together; leave mpirun out"),
        (2, vec!["resume", "nowhere"], 1, "nowhere: no run directory"),
        (5, sharded("5120", "run", "1"), 1, "5 ranks were started for 4 environments, and each needs one"),
    ] {
        let finished = finished(mpirun(folder.path(), num_ranks, &args));
        assert_eq!((finished.code, finished.stdout.as_str()), (Some(code), ""), "{args:?}: {finished:?}");
        assert_eq!(finished.stderr.matches("error: ").count(), 1, "{args:?}: {}", finished.stderr);
        assert!(finished.stderr.contains(message), "{args:?}: {}", finished.stderr);
    }
    assert_eq!(names(folder.path()), [""; 0]);
}

#[test]
fn a_rank_that_cannot_write_ends_the_job_with_its_message() {
    let folder = TemporaryFolder::new();
    let mut job = mpirun(folder.path(), 2, &sharded(ENDLESS, "run", "1")).spawn().unwrap();
    wait_for_checkpoint(&folder.join("run"), 2, &mut job);
    fs::remove_dir_all(folder.join("run")).unwrap();
    let finished = Finished::of(&wait_at_most(job, Duration::from_secs(10)));
    assert_ne!(finished.code, Some(0));
    assert!(finished.stderr.contains("error: run/"), "{}", finished.stderr);
}

/// What the ranks of the next test do.
#[test]
#[ignore = "mpirun starts it"]
fn rank_1_panics() {
    let world = Arc::new(World::enter().unwrap());
    world.abort_on_panic(|| eprintln!("told"));
    if world.rank() == 1 {
        // As in training, where workers are threads of their own.
        let _ = std::thread::spawn(|| panic!("a bug")).join();
    }
    if world.num_ranks() > 1 {
        world.all_gather(&[1], &[1, 1], &mut [0; 2]);
    }
    world.leave();
}

#[test]
fn a_rank_that_panics_ends_the_job_with_its_message() {
    let folder = TemporaryFolder::new();
    let tests = std::env::current_exe().unwrap();
    let args = ["--ignored", "--nocapture", "rank_1_panics"];
    let mut command = start(folder.path(), 2, tests.to_str().unwrap(), &args);
    let finished = Finished::of(&wait_at_most(command.spawn().unwrap(), Duration::from_secs(10)));
    assert_eq!(finished.code, Some(101), "{finished:?}");
    assert!(finished.stderr.contains("a bug") && finished.stderr.contains("told"), "{}", finished.stderr);
}

#[test]
fn a_comparison_is_spread_over_ranks_and_ends_with_the_bytes_of_one_process() {
    let folder = TemporaryFolder::new();
    let compare = |out: &'static str| {
        ["compare", "--quick", "--budget", "4096", "--rungs", "paper", "--out", out, "--threads", "1"]
    };
    folder.canter(&compare("alone")).succeeded();
    finished(mpirun(folder.path(), 3, &compare("spread"))).succeeded();
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(read("spread/compare.json") == read("alone/compare.json"));
    for job in ["paper-1", "paper-2"] {
        let [spread, alone] = ["spread", "alone"].map(|out| read(&format!("{out}/{job}/policy.safetensors")));
        assert!(spread == alone, "{job}");
    }
}
