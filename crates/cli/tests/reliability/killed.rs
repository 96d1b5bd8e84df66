//! Runs that are killed at random moments and resumed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::{TemporaryFolder, canter_in, names, train_args_with_steps};
use crate::{amount, random_below};

/// A training of 20 iterations that saves after each: most of its time it writes files.
const STEPS: &str = "2560";
const SAVES_OFTEN: [&str; 2] = ["--set", "training.checkpoint_env_steps=128"];

#[test]
fn killed_and_resumed_runs_end_with_the_bytes_of_an_undisturbed_one() {
    let folder = TemporaryFolder::new();
    let begin = Instant::now();
    folder.canter(&train_args_with_steps(STEPS, &[&SAVES_OFTEN[..], &["--out", "undisturbed"]].concat())).succeeded();
    let length = begin.elapsed();
    let expected = outcome(&folder.join("undisturbed"));
    assert!(expected.len() > 6, "{:?}", expected.keys());

    let (num_runs, mut num_kills, mut num_inside_a_write) = (amount("CANTER_KILLED_RUNS", 10), 0, 0);
    for number in 0..num_runs {
        let run = format!("run-{number}");
        for _ in 0..=random_below(3) {
            let mut child = start(&folder, &run);
            wait_for_a_moment(&folder.join(&run), length, &mut child);
            child.kill().unwrap();
            child.wait().unwrap();
            num_kills += 1;
            num_inside_a_write += u64::from(is_inside_a_write(&folder.join(&run)));
        }
        let finished = start(&folder, &run).wait_with_output().unwrap();
        assert!(finished.status.success(), "{run}: {}", String::from_utf8_lossy(&finished.stderr));
        let actual = outcome(&folder.join(&run));
        assert_eq!(actual.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{run}");
        for (name, bytes) in &expected {
            assert!(actual[name] == *bytes, "{run}: {name}");
        }
        fs::remove_dir_all(folder.join(&run)).unwrap();
    }
    println!("{num_runs} runs, {num_kills} kills, {num_inside_a_write} of them inside a write: all the same bytes");
    // One in seven is: few kills may all miss.
    assert!(num_inside_a_write > 0 || num_runs < 50, "no kill of {num_kills} was inside a write");
}

/// Trains, or goes on with what is there.
fn start(folder: &TemporaryFolder, run: &str) -> Child {
    let args = if folder.join(run).join("config.toml").exists() {
        vec!["resume", run, "--threads", "2"]
    } else {
        train_args_with_steps(STEPS, &[&SAVES_OFTEN[..], &["--out", run]].concat())
    };
    canter_in(folder.path(), &args).stdout(Stdio::null()).spawn().unwrap()
}

/// Waits for a random moment of the run, every other time for one at which a file is half written.
fn wait_for_a_moment(run: &Path, length: Duration, child: &mut Child) {
    sleep(length.mul_f64(random_below(1000) as f64 / 1000.0));
    if random_below(2) == 0 {
        while child.try_wait().unwrap().is_none() && !is_inside_a_write(run) {
            std::hint::spin_loop();
        }
    }
}

/// Whether a checkpoint's temporary file is there.
fn is_inside_a_write(run: &Path) -> bool {
    let checkpoints = run.join("checkpoints").read_dir();
    checkpoints.into_iter().flatten().flatten().any(|entry| entry.path().extension().is_some_and(|end| end == "tmp"))
}

/// Every file that equal runs have in common, by its name; of `metrics.jsonl` all but the wall times.
pub fn outcome(run: &Path) -> BTreeMap<String, Vec<u8>> {
    let newest = names(&run.join("checkpoints")).pop().unwrap();
    let mut paths = ["config.toml", "policy.safetensors", "eval.json", "tables/gaits.csv"].map(str::to_owned).to_vec();
    paths.push(format!("checkpoints/{newest}"));
    paths.extend(names(&run.join("trajectories")).into_iter().map(|name| format!("trajectories/{name}")));
    let mut files: BTreeMap<_, _> =
        paths.into_iter().map(|path| (path.clone(), fs::read(run.join(path)).unwrap())).collect();
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let without_times = |line: &str| {
        let mut metrics: serde_json::Value = serde_json::from_str(line).unwrap();
        metrics.as_object_mut().unwrap().retain(|key, _| !["collect_s", "update_s"].contains(&key.as_str()));
        format!("{metrics}\n")
    };
    files.insert("metrics.jsonl".to_owned(), metrics.lines().map(without_times).collect::<String>().into_bytes());
    files
}
