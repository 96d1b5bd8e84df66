//! Learning that diverges is undone, tried again with smaller steps, and in the end given up with a reason.

mod common;

use std::fs;
use std::sync::atomic::AtomicBool;

use canter_learn::ppo::LikelyCause;
use canter_train::run::{Ending, TrainError, pick_up, train};
use canter_train::run_directory::{RunDirectory, read_config};
use canter_train::trainer::Trainer;
use common::{TemporaryFolder, tiny, workers};
use serde_json::Value;

/// Steps that no network survives.
const HUGE_STEPS: [(&str, &str); 5] = [
    ("ppo.learning_rate", "1.0"),
    ("ppo.final_learning_rate", "1.0"),
    ("ppo.max_gradient_norm", "1e30"),
    ("ppo.num_epochs", "20"),
    ("ppo.minibatch_size", "16"),
];

#[test]
fn a_training_is_given_up_with_the_likely_cause_and_goes_on_with_smaller_steps() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    let resolved = tiny(&[&HUGE_STEPS[..], &[("training.max_env_steps", "128000")]].concat());
    let directory = RunDirectory::create(Some(&run), "tiny", &resolved.config).unwrap();
    let mut trainer = Trainer::new(resolved);
    let mut undone = Vec::new();
    let stop = AtomicBool::new(false);
    let error = train(&mut trainer, &directory, &workers(2), &stop, &mut |observed| {
        undone.extend(observed.report.update.as_ref().err().copied());
    })
    .unwrap_err();
    let TrainError::Diverged(divergence) = error else { panic!("{error}") };
    assert_eq!(divergence.likely_cause, LikelyCause::LearningRate);
    assert_eq!(undone.len(), 5, "{undone:?}");
    assert!(trainer.actor_parameters().iter().all(|parameter| parameter.is_finite()));
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let lines: Vec<Value> = metrics.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.last().unwrap()["divergences"].as_u64(), Some(5));
    assert_eq!(lines.iter().filter(|line| line["policy_loss"].is_null()).count(), 5);
    drop(directory);

    let config = fs::read_to_string(run.join("config.toml")).unwrap();
    let lowered = config.replace("learning_rate = 1.0", "learning_rate = 1e-4").replace("= 128000", "= 1024");
    fs::write(run.join("config.toml"), lowered).unwrap();
    fs::remove_file(run.join("metrics.jsonl")).unwrap();
    let directory = RunDirectory::open(&run).unwrap();
    let mut trainer = Trainer::new(read_config(&run).unwrap());
    assert_eq!(pick_up(&mut trainer, &directory).unwrap(), Vec::<String>::new());
    let ending = train(&mut trainer, &directory, &workers(2), &stop, &mut |observed| {
        observed.report.update.as_ref().unwrap();
    });
    assert_eq!(ending.unwrap(), Ending::Finished);
}
