//! Learning that diverges is undone, tried again with smaller steps, and in the end given up with a reason.

mod common;

use std::fs;
use std::sync::atomic::AtomicBool;

use canter_learn::ppo::LikelyCause;
use canter_train::run::{TrainError, pick_up, train};
use canter_train::run_directory::RunDirectory;
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
fn divergence_is_undone_five_times_and_then_given_up_with_the_likely_cause() {
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
    // What was saved on the way can be read, and has finite numbers only.
    assert_eq!(pick_up(&mut trainer, &directory).unwrap(), Vec::<String>::new());
}
