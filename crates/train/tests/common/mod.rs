//! What the tests of this crate share: tiny runs, and folders that vanish.
#![allow(dead_code, reason = "each test binary uses its part")]

mod folder;

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use canter_train::config::{Resolved, open_preset, resolve};
use canter_train::executor::Workers;
use canter_train::jobs::progress::JobsProgress;
use canter_train::run::{self, Ending};
use canter_train::run_directory::RunDirectory;
use canter_train::trainer::Trainer;

#[allow(unused_imports, reason = "each test binary uses its part")]
pub use folder::TemporaryFolder;

/// The default preset made tiny: 4 environments on level ground, 32 steps, short episodes, small networks. `changes` come
/// last.
pub fn tiny(changes: &[(&str, &str)]) -> Resolved {
    const TINY: [(&str, &str); 14] = [
        ("task.height_margin", "0.0"),
        ("task.episode_s", "0.5"),
        ("task.variation.share", "0.0"),
        ("network.actor_hidden", "16"),
        ("network.critic_hidden", "16"),
        ("ppo.num_epochs", "2"),
        ("ppo.minibatch_size", "64"),
        ("training.num_environments", "4"),
        ("training.horizon", "32"),
        ("training.max_env_steps", "640"),
        ("training.checkpoint_env_steps", "256"),
        ("evaluation.num_episodes", "3"),
        ("evaluation.episode_s", "2.0"),
        ("evaluation.settle_s", "0.5"),
    ];
    let mut document = open_preset("doggo").unwrap();
    for (key, value) in TINY.iter().chain(changes) {
        document.set(key, value);
    }
    resolve(&document).unwrap()
}

pub fn workers(num_threads: usize) -> Workers {
    Workers::new(Some(num_threads)).unwrap()
}

/// A training after `iterations` iterations.
pub fn trained(changes: &[(&str, &str)], iterations: usize) -> Trainer {
    let workers = workers(2);
    let mut trainer = Trainer::new(tiny(changes));
    for _ in 0..iterations {
        trainer.iterate(&workers).unwrap();
    }
    trainer
}

/// A new run in `path`, trained until its end or for `stop_after` iterations.
pub fn run_in(path: &Path, changes: &[(&str, &str)], num_threads: usize, stop_after: Option<u64>) -> Ending {
    let resolved = tiny(changes);
    let directory = RunDirectory::create(Some(path), "tiny", &resolved.config).unwrap();
    go_on(Trainer::new(resolved), &directory, num_threads, stop_after)
}

/// What `canter resume` does with the run in `path`.
pub fn resume_in(path: &Path, num_threads: usize, stop_after: Option<u64>) -> Ending {
    let directory = RunDirectory::open(path).unwrap();
    let mut trainer = Trainer::new(canter_train::run_directory::read_config(path).unwrap());
    assert_eq!(run::pick_up(&mut trainer, &directory).unwrap(), Vec::<String>::new());
    go_on(trainer, &directory, num_threads, stop_after)
}

fn go_on(mut trainer: Trainer, directory: &RunDirectory, num_threads: usize, stop_after: Option<u64>) -> Ending {
    let stop = AtomicBool::new(false);
    let mut observe = |observed: run::Observed<'_>| {
        if stop_after == Some(observed.report.progress.iterations) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    run::train(&mut trainer, directory, &workers(num_threads), &stop, &mut observe).unwrap()
}

/// Names of the files in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The lines of `metrics.jsonl` without the wall times, which no two runs share.
pub fn metrics_without_times(run: &Path) -> Vec<serde_json::Value> {
    let text = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    assert!(text.ends_with('\n'));
    let without_times = |line: &str| {
        let mut metrics: serde_json::Value = serde_json::from_str(line).unwrap();
        for key in ["collect_s", "update_s"] {
            assert!(metrics.as_object_mut().unwrap().remove(key).is_some(), "{line}");
        }
        metrics
    };
    text.lines().map(without_times).collect()
}

/// SplitMix64, Steele et al. 2014: whole numbers below `bound` from a seed.
pub fn draws(seed: u64) -> impl FnMut(usize) -> usize {
    let mut state = seed;
    move |bound| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

/// Looks on at jobs, whose counts must stay within what was planned, and stops them at report number `stop_after`.
pub fn looking_on(stop: &AtomicBool, stop_after: Option<u64>) -> impl Fn(JobsProgress) + Sync {
    let reports = AtomicU64::new(0);
    move |progress| {
        assert!(progress.env_steps <= progress.num_env_steps && progress.jobs <= progress.num_jobs);
        if stop_after == Some(reports.fetch_add(1, Ordering::Relaxed)) {
            stop.store(true, Ordering::Relaxed);
        }
    }
}
