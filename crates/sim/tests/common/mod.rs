//! What the tests of this crate share: a task on Doggo and reproducible random numbers.
#![allow(dead_code, reason = "each test binary uses its part")]

use std::sync::Arc;

use canter_sim::settings::Document;
use canter_sim::task::{BlockChoice, ModulationChoice, RangeSettings};
use canter_sim::variation::VariationSettings;
use canter_sim::{PolicySettings, RewardSettings, Robot, Task, TaskSettings};

/// SplitMix64, Steele et al. 2014: numbers in [0, 1) from a seed.
pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

pub fn task_settings() -> TaskSettings {
    TaskSettings {
        control_dt_s: 0.01,
        physics_dt_s: 0.002,
        episode_s: 10.0,
        goal_distance_m: None,
        slope_deg: 0.0,
        cross_slope_deg: None,
        friction: None,
        mass_factor: None,
        strength_factor: None,
        delay_s: None,
        ground: None,
        accident_return_weight: 0.5,
        accident_cost: 0.0,
        height_margin: 0.0,
        start_noise_rad: 0.05,
        variation: VariationSettings::nothing(),
    }
}

pub fn reward_settings() -> RewardSettings {
    RewardSettings { forward: 1.0, drift: 0.1, bounce: 0.1, energy: 0.05, turn: 0.0, action_rate: 0.0 }
}

pub fn policy_settings(prior: &str, modulation: ModulationChoice) -> PolicySettings {
    PolicySettings {
        prior: prior.to_owned(),
        modulation,
        authority: if modulation == ModulationChoice::Direct { 1.0 } else { 0.5 },
        observation: BlockChoice::ALL.to_vec(),
        symmetric: false,
        ranges: RangeSettings {
            frequency_factor: vec![0.5, 2.0],
            swing_amplitude_rad: vec![0.0, 1.0],
            extension_amplitude_rad: Some(vec![0.0, 1.0]),
            swing_offset_rad: vec![-0.3, 0.3],
            extension_offset_rad: Some(vec![-0.5, 0.5]),
            residual_rad: None,
        },
    }
}

pub fn doggo(settings: &TaskSettings, policy: &PolicySettings) -> Arc<Task> {
    task(Robot::load("doggo").unwrap(), settings, policy)
}

pub fn task(robot: Robot, settings: &TaskSettings, policy: &PolicySettings) -> Arc<Task> {
    let problems = Document::parse("test", b"").unwrap().problems();
    Arc::new(Task::new(Arc::new(robot), settings, &reward_settings(), policy, problems).unwrap())
}
