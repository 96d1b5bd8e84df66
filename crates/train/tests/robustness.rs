//! What a policy keeps in other worlds is held against the robot as it is on level ground, whatever it was trained on.

mod common;

use canter_train::policy_file::PolicyFile;
use canter_train::robustness::{CONDITIONS, measure};

#[test]
fn a_run_that_was_trained_in_another_world_is_measured_in_the_same_ones() {
    let trainer = common::trained(&[], 1);
    let file = PolicyFile::of(&trainer);
    let workers = common::workers(2);
    let short = [("evaluation.num_episodes", "2"), ("evaluation.settle_s", "0.0"), ("evaluation.episode_s", "2.0")];
    let elsewhere = [
        ("task.slope_deg", "10.0"),
        ("task.cross_slope_deg", "-4.0"),
        ("task.friction", "0.3"),
        ("task.mass_factor", "1.3"),
        ("task.strength_factor", "0.8"),
        ("task.delay_s", "0.03"),
        ("task.ground.roughness", "0.2"),
        ("task.ground.curb_height", "0.05"),
        ("task.ground.patch_friction", "[0.3, 0.9]"),
        ("task.variation.roughness", "[0.0, 0.3]"),
        ("task.variation.delay_s", "[0.0, 0.05]"),
        ("task.variation.angle_noise_rad", "0.1"),
        ("task.variation.push_interval_s", "0.5"),
        ("task.variation.push_velocity", "0.5"),
    ];
    let measured = |changes: &[(&str, &str)]| measure(&common::tiny(changes), &file.policy(), &workers).unwrap();
    let plain = measured(&short);
    assert_eq!(plain.len(), CONDITIONS.len());
    assert_eq!(measured(&[&short[..], &elsewhere].concat()), plain);
    // A condition that changed nothing would have the same speeds to the last bit. Doggo's own delay is 10 ms, and its
    // friction 0.8.
    for (condition, measured) in CONDITIONS.iter().zip(&plain).skip(1) {
        let is_own = ["friction 0.8", "delay 10 ms"].contains(&condition.name);
        assert_eq!(measured.speed_m_per_s == plain[0].speed_m_per_s, is_own, "{}", condition.name);
    }
}
