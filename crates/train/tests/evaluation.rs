//! Measuring gaits: fair, repeatable, and the same whatever the number of threads.

mod common;

use std::sync::Arc;

use canter_gait::Policy;
use canter_learn::random::{Purpose, stream};
use canter_sim::{Env, Task};
use canter_train::config::{EvaluationSettings, Resolved};
use canter_train::evaluate::{GaitReport, Mover, evaluate, judge};
use canter_train::policy_file::PolicyFile;
use rand_chacha::rand_core::Rng;

fn report(resolved: &Resolved, mover: Mover<'_>) -> GaitReport {
    evaluate(&resolved.task, mover, &resolved.config.evaluation, &common::workers(2))
}

#[test]
fn one_and_two_threads_report_the_same() {
    let trainer = common::trained(&[], 2);
    let file = PolicyFile::of(&trainer);
    let Resolved { config, task } = trainer.resolved();
    let verdict = |num_threads| {
        let workers = common::workers(num_threads);
        judge(task, &config.policy.prior, Some(&file.policy()), &config.evaluation, &workers)
    };
    let one = verdict(1);
    assert_eq!(one, verdict(2));
    let policy = one.policy.as_ref().unwrap();
    assert_eq!(policy.speeds_m_per_s.len(), 3);
    assert_ne!(policy.speeds_m_per_s, one.prior.speeds_m_per_s);
    // Different starts, and none of them twice.
    assert!(policy.speeds_m_per_s[0] != policy.speeds_m_per_s[1]);
}

#[test]
fn authority_zero_has_exactly_the_speeds_of_the_prior() {
    for modulation in ["amplitude", "leg-amplitude", "modulate"] {
        let changes = [("policy.modulation", modulation), ("policy.authority", "0.0"), ("policy.prior", "stepping")];
        let trainer = common::trained(&changes, 1);
        let file = PolicyFile::of(&trainer);
        let with_policy = report(trainer.resolved(), Mover::Policy(&file.policy()));
        let prior = report(trainer.resolved(), Mover::Prior);
        assert_eq!(with_policy.speeds_m_per_s, prior.speeds_m_per_s, "{modulation}");
        assert_eq!(with_policy.power_w, prior.power_w, "{modulation}");
        let action = vec![0.7; trainer.resolved().task.num_actions()];
        assert_eq!(report(trainer.resolved(), Mover::Constant(&action)).speeds_m_per_s, prior.speeds_m_per_s);
        let full = common::tiny(&[changes[0], changes[2]]);
        let free = report(&full, Mover::Constant(&action));
        assert_ne!(free.speeds_m_per_s, prior.speeds_m_per_s, "{modulation}");
    }
}

/// Walks an episode of an evaluation again with nothing but the simulator's own environment: way forward from the
/// settling time until the accident, and the step of the accident.
fn walk_again(task: &Arc<Task>, settings: &EvaluationSettings, number: u64, action: &[f32]) -> (f64, Option<u32>) {
    let mut judged = Task::clone(task).with_physics_dt_s(settings.physics_dt_s).unwrap();
    judged.settings.height_margin = 0.0;
    let mut env = Env::new(Arc::new(judged));
    let mut observation = vec![0.0; task.num_observations()];
    let mut rng = stream(settings.seed, Purpose::Evaluation, 0, number);
    env.reset(&mut || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64, &mut observation);
    let steps = |time_s: f64| (time_s / task.settings.control_dt_s).round() as u32;
    let mut settled_m = None;
    for step in 0..steps(settings.episode_s) {
        if step == steps(settings.settle_s) {
            settled_m = Some(env.position_in_ground()[0]);
        }
        if env.step(action, &mut observation).terminated.is_some() {
            let end_m = env.position_in_ground()[0];
            return (end_m - settled_m.unwrap_or(end_m), Some(step));
        }
    }
    (env.position_in_ground()[0] - settled_m.unwrap(), None)
}

#[test]
fn episodes_that_fall_keep_the_full_time() {
    // Motors at +1 and -1 rad draw the legs in until the belly is low, unevenly so that it slides.
    let lie_down = [1.0, -0.7, 1.0, -1.0, 1.0, -1.0, 1.0, -0.7];
    let resolved = common::tiny(&[("policy.modulation", "direct"), ("evaluation.settle_s", "0.0")]);
    let settings = &resolved.config.evaluation;
    let fallen = report(&resolved, Mover::Constant(&lie_down));
    assert_eq!(
        (fallen.falls, fallen.falls_by_cause.get("too-low").or(fallen.falls_by_cause.get("too_low"))),
        (3, Some(&3))
    );
    for (number, speed) in fallen.speeds_m_per_s.iter().enumerate() {
        let (way_m, fell_at) = walk_again(&resolved.task, settings, number as u64, &lie_down);
        assert!(fell_at.unwrap() < 100, "it falls in the first of two seconds: {fell_at:?}");
        assert!(way_m.abs() > 1e-4);
        assert_eq!(*speed, way_m / 2.0, "episode {number}");
    }
    // A fall before the settling time has no speed.
    let resolved = common::tiny(&[("policy.modulation", "direct"), ("evaluation.settle_s", "1.0")]);
    let fallen = report(&resolved, Mover::Constant(&lie_down));
    assert_eq!((fallen.falls, fallen.speeds_m_per_s), (3, vec![0.0; 3]));
}

#[test]
fn the_speed_counts_from_the_settling_time_on() {
    let resolved = common::tiny(&[("evaluation.settle_s", "0.5")]);
    let action = vec![0.2; resolved.task.num_actions()];
    let walked = report(&resolved, Mover::Constant(&action));
    assert_eq!(walked.falls, 0);
    for (number, speed) in walked.speeds_m_per_s.iter().enumerate() {
        let (way_m, fell_at) = walk_again(&resolved.task, &resolved.config.evaluation, number as u64, &action);
        assert_eq!((fell_at, *speed), (None, way_m / 1.5), "episode {number}");
    }
}

#[test]
fn slope_and_friction_reach_the_physics() {
    let speeds = |changes: &[(&str, &str)]| report(&common::tiny(changes), Mover::Prior);
    let level = speeds(&[]);
    let uphill = speeds(&[("task.slope_deg", "8.0")]);
    let downhill = speeds(&[("task.slope_deg", "-8.0")]);
    assert!(uphill.speed_m_per_s < level.speed_m_per_s - 0.05, "{uphill:?}");
    assert!(downhill.speed_m_per_s > level.speed_m_per_s + 0.05, "{downhill:?}");
    let ice = speeds(&[("task.friction", "0.02")]);
    assert!(ice.speed_m_per_s < 0.5 * level.speed_m_per_s, "{ice:?}");
    assert_eq!(level, speeds(&[]));
}

#[test]
fn the_bounce_is_of_the_height_above_the_ground_below() {
    let std = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / values.len() as f64).sqrt()
    };
    for (ground, is_even) in [(None, true), (Some(("task.ground.roughness", "0.1")), false)] {
        let resolved = common::tiny(&[&[("evaluation.settle_s", "0.0")], ground.as_slice()].concat());
        let settings = &resolved.config.evaluation;
        let walked = report(&resolved, Mover::Prior);
        let (mut above_ground, mut above_plane) = (Vec::new(), Vec::new());
        for number in 0..settings.num_episodes as u64 {
            let task = Task::clone(&resolved.task).with_physics_dt_s(settings.physics_dt_s).unwrap();
            let mut env = Env::new(Arc::new(task));
            let mut observation = vec![0.0; resolved.task.num_observations()];
            let mut rng = stream(settings.seed, Purpose::Evaluation, 0, number);
            env.reset(&mut || (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64, &mut observation);
            let (mut above_ground_m, mut above_plane_m) = (Vec::new(), Vec::new());
            for _ in 0..(settings.episode_s / resolved.task.settings.control_dt_s).round() as u32 {
                assert_eq!(env.step_prior(&mut observation).terminated, None);
                let [x, y, z] = env.position_in_ground();
                above_ground_m.push(z - env.ground_height_m([x, y]));
                above_plane_m.push(z);
            }
            above_ground.push(std(&above_ground_m));
            above_plane.push(std(&above_plane_m));
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        assert!((walked.height_std_m - mean(&above_ground)).abs() < 1e-12, "{ground:?}");
        assert_eq!((mean(&above_ground) - mean(&above_plane)).abs() < 1e-12, is_even, "{ground:?}");
    }
}

#[test]
fn neither_the_goal_nor_the_training_time_limit_ends_an_evaluation() {
    let free = report(&common::tiny(&[]), Mover::Prior);
    let limited = report(&common::tiny(&[("task.goal_distance_m", "0.1"), ("task.episode_s", "0.2")]), Mover::Prior);
    assert_eq!(limited, free);
}

#[test]
fn starts_depend_on_the_evaluation_seed_and_not_on_the_run() {
    let speeds = |changes: &[(&str, &str)]| report(&common::tiny(changes), Mover::Prior).speeds_m_per_s;
    assert_eq!(speeds(&[]), speeds(&[("seed", "2")]));
    assert_ne!(speeds(&[]), speeds(&[("evaluation.seed", "1")]));
    // More episodes are the same ones and some more.
    assert_eq!(speeds(&[("evaluation.num_episodes", "5")])[..3], speeds(&[])[..]);
}

#[test]
fn the_default_speed_is_that_of_the_fastest_default_gait() {
    let trainer = common::trained(&[("policy.prior", "sine-literal")], 1);
    let file = PolicyFile::of(&trainer);
    let Resolved { config, task } = trainer.resolved();
    let policy: Policy<'_> = file.policy();
    let workers = common::workers(2);
    let verdict = judge(task, "sine-literal", Some(&policy), &config.evaluation, &workers);
    let gaits: Vec<_> = verdict.default_gaits.keys().map(String::as_str).collect();
    assert_eq!(gaits, ["sine", "stepping"]);
    let fastest = verdict.default_gaits.values().map(|report| report.speed_m_per_s).fold(f64::MIN, f64::max);
    assert_eq!(verdict.default_speed_m_per_s, fastest);
    assert_eq!(verdict.default_gaits[&verdict.default_gait].speed_m_per_s, fastest);
    let learned = verdict.policy.as_ref().unwrap();
    let [low, high] = verdict.speed_ratio_ci.unwrap();
    let ratio = verdict.speed_ratio.unwrap();
    assert!((ratio - learned.speed_m_per_s / fastest).abs() < 1e-12);
    assert!(low <= ratio && ratio <= high, "{low} {ratio} {high}");
    let of_prior = verdict.prior_speed_ratio.unwrap();
    assert!((of_prior - learned.speed_m_per_s / verdict.prior.speed_m_per_s).abs() < 1e-12);
    // Each gait alone is what the verdict holds.
    for (name, report) in &verdict.default_gaits {
        let alone = evaluate(&task.with_gait(name).unwrap(), Mover::Prior, &config.evaluation, &workers);
        assert_eq!(*report, alone, "{name}");
    }
    let bare = judge(task, "sine-literal", None, &config.evaluation, &workers);
    assert_eq!((bare.policy, bare.prior_speed_ratio, bare.prior), (None, None, verdict.prior));
}
