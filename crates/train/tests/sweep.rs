//! A whole sweep, made tiny: every point is trained with every seed, and stops change nothing.

mod common;

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use canter_train::jobs::JobsError;
use canter_train::run_directory::read_policy;
use canter_train::sweep::plan::Plan;
use canter_train::sweep::{SweepError, SweepFolder, sweep};
use common::{TemporaryFolder, looking_on};
use serde_json::Value;

fn tiny() -> Plan {
    let overrides = [
        ("task.episode_s", "0.3"),
        ("network.actor_hidden", "16"),
        ("network.critic_hidden", "16"),
        ("ppo.num_epochs", "1"),
        ("ppo.minibatch_size", "64"),
        ("training.num_environments", "2"),
        ("training.horizon", "40"),
        ("training.max_env_steps", "240"),
        ("training.checkpoint_env_steps", "80"),
        ("evaluation.num_episodes", "2"),
        ("evaluation.episode_s", "2.5"),
    ];
    Plan {
        preset: "doggo".to_owned(),
        overrides: overrides.map(|(key, value)| (key.to_owned(), value.to_owned())).to_vec(),
        axes: vec!["preset=doggo,q8bot".parse().unwrap(), "policy.authority=0.0,1.0".parse().unwrap()],
        num_random: None,
        seeds: vec![3, 4],
    }
}

/// Whether it came to its end; `stop_after` counts what the jobs report.
fn run_in(path: &Path, plan: Plan, num_threads: usize, stop_after: Option<u64>) -> bool {
    let folder = SweepFolder::open(Some(path), plan).unwrap();
    let stop = AtomicBool::new(false);
    sweep(&folder, num_threads, &stop, &looking_on(&stop, stop_after)).unwrap().is_some()
}

#[test]
fn a_sweep_ends_and_goes_on_after_stops_to_the_same_bytes() {
    let folder = TemporaryFolder::new();
    let (undisturbed, stopped) = (folder.join("undisturbed"), folder.join("stopped"));
    assert!(run_in(&undisturbed, tiny(), 2, None));
    let mut starts = 1;
    while !run_in(&stopped, tiny(), 1 + starts % 2, Some(2 + 3 * starts as u64)) {
        assert!(!stopped.join("sweep.json").exists());
        starts += 1;
        assert!(starts < 100, "every start comes further");
    }
    assert!(starts > 2, "{starts}");
    let bytes = |run: &Path| fs::read_to_string(run.join("sweep.json")).unwrap();
    assert_eq!(bytes(&stopped), bytes(&undisturbed));

    let sweep: Value = serde_json::from_str(&bytes(&undisturbed)).unwrap();
    let points = sweep["points"].as_array().unwrap();
    let values: Vec<_> = points.iter().map(|point| point["values"].clone()).collect();
    let expected = [["doggo", "0.0"], ["doggo", "1.0"], ["q8bot", "0.0"], ["q8bot", "1.0"]];
    assert_eq!(values, expected.map(|values| Value::from(values.to_vec())));
    for (number, point) in points.iter().enumerate() {
        assert_eq!(point["robot"], if number < 2 { "doggo" } else { "q8bot" });
        for run in point["runs"].as_array().unwrap() {
            let seed = run["seed"].as_u64().unwrap();
            let policy = read_policy(&undisturbed.join(format!("{}-{seed}", number + 1))).unwrap();
            assert_eq!(policy.card.provenance.env_steps, 240);
            // Without authority a learned gait is its prior, and so as fast.
            let ratio = run["prior_speed_ratio"].as_f64();
            assert!(number % 2 == 1 || ratio.is_none_or(|ratio| ratio == 1.0), "{ratio:?}");
        }
    }
    let seeds: Vec<_> = points[1]["runs"].as_array().unwrap().iter().map(|run| run["seed"].clone()).collect();
    assert_eq!(seeds, [3, 4]);
}

#[test]
fn other_plans_and_wrong_values_are_refused_before_anything_is_trained() {
    let folder = TemporaryFolder::new();
    let path = folder.join("sweep");
    drop(SweepFolder::open(Some(&path), tiny()).unwrap());
    let refusal = |plan: Plan| SweepFolder::open(Some(&path), plan).unwrap_err().to_string();
    let message = refusal(Plan { seeds: vec![3], ..tiny() });
    assert!(message.contains("`seeds` is [3,4] there, [3] here"), "{message}");
    let message = refusal(Plan { axes: vec!["policy.authority=0.5,1.5".parse().unwrap()], ..tiny() });
    assert!(message.contains("policy.authority") && message.contains("1.5"), "{message}");
    let message = refusal(Plan { axes: vec!["preset=dog".parse().unwrap()], ..tiny() });
    assert!(message.contains("no preset is called `dog`"), "{message}");
    fs::create_dir(folder.join("other")).unwrap();
    fs::write(folder.join("other/notes.txt"), "mine").unwrap();
    let error = SweepFolder::open(Some(&folder.join("other")), tiny()).unwrap_err();
    assert!(matches!(error, SweepError::Jobs(JobsError::NotEmpty(_))), "{error}");
}
