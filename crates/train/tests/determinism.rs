//! Same seed, same bytes: whatever the number of threads, and however often the training stops.

mod common;

use std::fs;

use canter_train::checkpoint::Checkpoint;
use canter_train::policy_file::PolicyFile;
use canter_train::run::Ending;
use canter_train::trainer::{IterationReport, Trainer};
use common::TemporaryFolder;

/// Minibatches of four shards, so that gradients too come from several threads.
const SHARDED: [(&str, &str); 4] = [
    ("training.horizon", "128"),
    ("ppo.minibatch_size", "512"),
    ("training.num_environments", "5"),
    ("task.variation.share", "0.5"),
];

/// Everything that may vary.
const EVERYTHING: [(&str, &str); 18] = [
    ("task.variation.share", "0.9"),
    ("task.variation.slope_deg", "[-5.0, 20.0]"),
    ("task.variation.cross_slope_deg", "[-5.0, 5.0]"),
    ("task.variation.roughness", "[0.0, 0.1]"),
    ("task.variation.friction", "[0.5, 1.2]"),
    ("task.variation.mass_factor", "[0.8, 1.2]"),
    ("task.variation.com_shift", "0.1"),
    ("task.variation.strength_factor", "[0.8, 1.2]"),
    ("task.variation.gain_factor", "[0.8, 1.2]"),
    ("task.variation.delay_s", "[0.0, 0.03]"),
    ("task.variation.angle_noise_rad", "0.01"),
    ("task.variation.velocity_noise_rad_per_s", "0.3"),
    ("task.variation.orientation_noise_rad", "0.01"),
    ("task.variation.angular_velocity_noise_rad_per_s", "0.1"),
    ("task.variation.push_interval_s", "0.3"),
    ("task.variation.push_velocity", "0.2"),
    ("task.variation.curriculum", "true"),
    ("task.ground.patch_friction", "[0.7, 1.1]"),
];

#[test]
fn with_everything_varied_threads_and_stops_leave_the_same_bytes() {
    let folder = TemporaryFolder::new();
    let (one, four, stopped) = (folder.join("one"), folder.join("four"), folder.join("stopped"));
    assert_eq!(common::run_in(&one, &EVERYTHING, 1, None), Ending::Finished);
    assert_eq!(common::run_in(&four, &EVERYTHING, 4, None), Ending::Finished);
    assert_eq!(common::run_in(&stopped, &EVERYTHING, 2, Some(2)), Ending::Stopped);
    assert_eq!(common::resume_in(&stopped, 3, None), Ending::Finished);
    let policy = |run: &std::path::Path| fs::read(run.join("policy.safetensors")).unwrap();
    for other in [&four, &stopped] {
        assert!(policy(other) == policy(&one), "{}", other.display());
        assert_eq!(common::metrics_without_times(other), common::metrics_without_times(&one));
    }
    let metrics = common::metrics_without_times(&one);
    let difficulty = |line: &serde_json::Value| line["difficulty"].as_f64().unwrap();
    assert!(difficulty(&metrics[4]) > difficulty(&metrics[0]), "no episode of half a second falls: {metrics:?}");
}

#[test]
fn one_two_and_three_threads_give_the_same_bytes_and_another_seed_gives_others() {
    let bytes = |num_threads: usize, seed: &str| {
        let workers = common::workers(num_threads);
        let mut trainer = Trainer::new(common::tiny(&[&SHARDED[..], &[("seed", seed)]].concat()));
        for _ in 0..3 {
            trainer.iterate(&workers).unwrap();
        }
        (PolicyFile::of(&trainer).to_bytes(), Checkpoint::of(&trainer).to_bytes())
    };
    let reference = bytes(1, "1");
    for num_threads in [2, 3] {
        let (policy, checkpoint) = bytes(num_threads, "1");
        assert!(policy == reference.0, "the policy of {num_threads} threads");
        assert!(checkpoint == reference.1, "the checkpoint of {num_threads} threads");
    }
    let of_another_seed = PolicyFile::from_bytes(&bytes(1, "2").0).unwrap();
    let policy = PolicyFile::from_bytes(&reference.0).unwrap();
    assert_ne!(actions(&of_another_seed), actions(&policy));
}

/// The actions for one observation.
fn actions(policy: &PolicyFile) -> Vec<f32> {
    let policy = policy.policy();
    let shape = policy.network.shape();
    let mut action = vec![0.0; shape.output];
    policy.act(&mut vec![0.1; shape.input], &mut vec![0.0; policy.network.workspace_len()], &mut action);
    action
}

#[test]
fn a_run_that_was_stopped_and_resumed_ends_like_one_that_was_not() {
    for modulation in ["amplitude", "modulate", "direct"] {
        let folder = TemporaryFolder::new();
        let changes = [("policy.modulation", modulation), ("task.variation.share", "0.5")];
        let undisturbed = folder.join("undisturbed");
        assert_eq!(common::run_in(&undisturbed, &changes, 2, None), Ending::Finished);
        let stopped = folder.join("stopped");
        // Episodes of 50 env steps, iterations of 32: both stops are in the middle of episodes.
        assert_eq!(common::run_in(&stopped, &changes, 2, Some(1)), Ending::Stopped);
        assert!(!stopped.join("policy.safetensors").exists(), "{modulation}");
        assert_eq!(common::metrics_without_times(&stopped).len(), 1);
        assert_eq!(common::resume_in(&stopped, 1, Some(3)), Ending::Stopped);
        assert_eq!(common::resume_in(&stopped, 2, None), Ending::Finished);
        let policy = |run: &std::path::Path| fs::read(run.join("policy.safetensors")).unwrap();
        assert!(policy(&stopped) == policy(&undisturbed), "{modulation}");
        let metrics = common::metrics_without_times(&stopped);
        assert_eq!(metrics, common::metrics_without_times(&undisturbed), "{modulation}");
        let iterations: Vec<_> = metrics.iter().map(|line| line["iteration"].as_u64().unwrap()).collect();
        assert_eq!(iterations, [1, 2, 3, 4, 5], "{modulation}");
        assert!(metrics[4]["episodes"].as_u64().unwrap() >= 12, "{modulation}: {}", metrics[4]);
    }
}

#[test]
fn lines_written_after_the_last_checkpoint_are_written_again_once() {
    let folder = TemporaryFolder::new();
    let (undisturbed, killed) = (folder.join("undisturbed"), folder.join("killed"));
    common::run_in(&undisturbed, &[], 2, None);
    common::run_in(&killed, &[], 2, Some(3));
    // As a process leaves it that is killed in its fifth iteration, in the middle of a line.
    let metrics = killed.join("metrics.jsonl");
    let all = fs::read_to_string(undisturbed.join("metrics.jsonl")).unwrap();
    let fifth = all.match_indices('\n').nth(3).unwrap().0;
    fs::write(&metrics, &all[..fifth + 20]).unwrap();
    assert_eq!(common::resume_in(&killed, 2, None), Ending::Finished);
    assert_eq!(common::metrics_without_times(&killed), common::metrics_without_times(&undisturbed));
}

#[test]
fn a_checkpoint_restores_everything_that_the_next_iteration_depends_on() {
    // 3e-4 / 1.5, which the KL-adaptive rate reaches: a reader of decimal numbers that is not exact makes 2e-4 of it.
    let mut resolved = common::tiny(&[("ppo.learning_rate", "0.00019999999999999998")]);
    resolved.config.ppo.target_kl = None;
    let workers = common::workers(2);
    let mut original = Trainer::new(resolved.clone());
    for _ in 0..3 {
        original.iterate(&workers).unwrap();
    }
    let bytes = Checkpoint::of(&original).to_bytes();
    let mut restored = Trainer::new(resolved);
    let checkpoint = Checkpoint::from_bytes(&bytes).unwrap();
    assert_eq!(checkpoint.iterations(), 3);
    checkpoint.restore(&mut restored).unwrap();
    assert_eq!(restored.progress(), original.progress());
    assert!(Checkpoint::of(&restored).to_bytes() == bytes, "saved again");
    for _ in 0..2 {
        let without_times = |report: IterationReport| IterationReport { collect_s: 0.0, update_s: 0.0, ..report };
        let expected = without_times(original.iterate(&workers).unwrap());
        assert_eq!(without_times(restored.iterate(&workers).unwrap()), expected);
    }
    assert!(PolicyFile::of(&restored).to_bytes() == PolicyFile::of(&original).to_bytes());
}

#[test]
fn a_checkpoint_of_another_configuration_is_refused() {
    let checkpoint = Checkpoint::of(&common::trained(&[], 1));
    let refusal = |changes: &[(&str, &str)]| {
        checkpoint.restore(&mut Trainer::new(common::tiny(changes))).unwrap_err().to_string()
    };
    let message = refusal(&[("network.critic_hidden", "32")]);
    assert!(message.starts_with("the array `parameters` is F32["), "{message}");
    let message = refusal(&[("training.num_environments", "5")]);
    assert!(message.starts_with("the array `environments.state` is F64[4, "), "{message}");
    assert!(message.contains("expected F64[5, "), "{message}");
}
