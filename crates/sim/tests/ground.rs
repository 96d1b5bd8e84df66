//! Contracts of every robot on every kind of ground.

mod common;

use std::sync::Arc;

use canter_sim::ground::GroundSettings;
use canter_sim::mujoco::ObjectKind;
use canter_sim::robot::built_in_robots;
use canter_sim::task::ModulationChoice;
use canter_sim::variation::Variant;
use canter_sim::{Accident, Env, Robot, Task, TaskSettings};

/// A kind of ground: its name, and what it changes of a task on flat ground.
type Kind = (&'static str, fn(&mut TaskSettings));

const KINDS: [Kind; 7] = [
    ("uphill", |settings| settings.slope_deg = 10.0),
    ("downhill", |settings| settings.slope_deg = -10.0),
    ("across", |settings| settings.cross_slope_deg = Some(10.0)),
    ("rough", |settings| settings.ground = Some(GroundSettings { roughness: Some(0.2), ..GroundSettings::smooth() })),
    ("curbs", |settings| settings.ground = Some(GroundSettings { curb_height: Some(0.1), ..GroundSettings::smooth() })),
    ("patches", |settings| {
        settings.ground = Some(GroundSettings { patch_friction: Some(vec![0.6, 1.0]), ..GroundSettings::smooth() });
    }),
    ("everything", |settings| {
        settings.slope_deg = 5.0;
        settings.cross_slope_deg = Some(-5.0);
        settings.ground = Some(GroundSettings {
            roughness: Some(0.1),
            correlation_length: Some(2.0),
            curb_height: Some(0.1),
            curb_length: Some(4.0),
            patch_friction: Some(vec![0.7, 1.2]),
            patch_length: Some(1.0),
        });
    }),
];

fn task(robot: &Robot, change: fn(&mut TaskSettings)) -> Arc<Task> {
    let mut settings = common::task_settings();
    change(&mut settings);
    let policy = common::policy_settings(&robot.gaits[0].name, ModulationChoice::Direct);
    common::task(robot.clone(), &settings, &policy)
}

/// The feet's contacts after standing for a second; panics on an accident.
fn stands(task: &Arc<Task>, seed: u64) -> (Env, Vec<bool>) {
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut common::uniform(seed), &mut observation);
    let start = env.snapshot();
    assert!(start.num_body_contacts == 0, "it starts with more than its feet on the ground");
    for _ in 0..100 {
        let outcome = env.step(&vec![0.0; task.num_actions()], &mut observation);
        assert_eq!(outcome.terminated, None, "{}", task.robot.settings.name);
    }
    let mut feet = vec![false; task.robot.legs.len()];
    env.ground_contacts(&mut feet);
    (env, feet)
}

#[test]
fn every_robot_stands_on_every_kind_of_ground() {
    for name in built_in_robots() {
        let robot = Robot::load(name).unwrap();
        for (kind, change) in KINDS {
            let task = task(&robot, change);
            for seed in 0..3 {
                let (env, feet) = stands(&task, seed);
                // On three feet at least, wherever the bumps are.
                let touching = feet.iter().filter(|&&touches| touches).count();
                assert!(touching >= 3, "{name} {kind} {seed}: {feet:?}");
                let height = env.height_above_ground_m() / robot.settings.stance_height_m;
                assert!((0.7..1.4).contains(&height), "{name} {kind} {seed}: {height} stance heights");
            }
        }
    }
}

#[test]
fn every_kind_of_ground_is_the_same_again_and_another_for_another_key() {
    let robot = Robot::load("doggo").unwrap();
    for (kind, change) in KINDS {
        let task = task(&robot, change);
        let walk = |seed: u64| {
            let mut env = Env::new(task.clone());
            let mut observation = vec![0.0; task.num_observations()];
            env.reset(&mut common::uniform(seed), &mut observation);
            (0..100).for_each(|_| _ = env.step_prior(&mut observation));
            env.state()
        };
        assert_eq!(walk(1), walk(1), "{kind}");
        assert_ne!(walk(1), walk(2), "{kind}");
    }
}

#[test]
fn a_state_on_uneven_ground_goes_on_with_the_same_bytes() {
    let robot = Robot::load("doggo").unwrap();
    let task = task(&robot, KINDS[6].1);
    let mut original = Env::new(task.clone());
    let mut restored = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    let mut restored_observation = observation.clone();
    original.reset(&mut common::uniform(4), &mut observation);
    for _ in 0..60 {
        original.step_prior(&mut observation);
    }
    restored.reset(&mut common::uniform(5), &mut restored_observation);
    restored.set_state(&original.state(), &mut restored_observation).unwrap();
    assert_eq!(observation, restored_observation);
    for _ in 0..60 {
        assert_eq!(original.step_prior(&mut observation), restored.step_prior(&mut restored_observation));
    }
    assert_eq!(original.state(), restored.state());
}

#[test]
fn feet_lie_on_the_ground_that_is_computed_wherever_the_robot_is() {
    let robot = Robot::load("doggo").unwrap();
    let task = task(&robot, |settings| {
        settings.ground = Some(GroundSettings { roughness: Some(0.3), ..GroundSettings::smooth() });
    });
    let (mut env, _) = stands(&task, 8);
    let mut observation = vec![0.0; task.num_observations()];
    let period_m = 24.0 * 0.17;
    let height_m = env.ground_height_m([0.1, 0.2]);
    assert!((env.ground_height_m([0.1 + period_m, 0.2 - 2.0 * period_m]) - height_m).abs() < 1e-6);
    let mut state = env.state();
    let physics = state.len() - env.simulation().state().len();
    // MuJoCo's state begins with the time; then forward, left, up.
    for way in [0.0, 1.0, 7.0, -30.0] {
        state[physics + 1] += way * period_m;
        env.set_state(&state, &mut observation).unwrap();
        env.step(&[0.0; 8], &mut observation);
        let legs = env.snapshot().legs;
        assert!(legs.iter().filter(|leg| leg.has_contact).count() >= 3, "{way}: {legs:?}");
        for leg in legs.iter().filter(|leg| leg.has_contact) {
            // A sphere of 15 mm touches a slope beside its lowest point: it is less than its radius above it, and not in it.
            let above = leg.foot[2] - env.ground_height_m([leg.foot[0], leg.foot[1]]);
            assert!((0.012..0.025).contains(&above), "{way}: {above}");
        }
    }
}

#[test]
fn too_low_is_measured_from_the_ground_below() {
    // Standing on a curb of its own height the robot is twice as high, and lies when it lies on the curb.
    let robot = Robot::load("doggo").unwrap();
    let lie_down = |curb: f64| {
        let mut settings = common::task_settings();
        settings.start_noise_rad = 0.0;
        settings.ground =
            Some(GroundSettings { curb_height: Some(curb), curb_length: Some(12.0), ..GroundSettings::smooth() });
        let policy = common::policy_settings("sine", ModulationChoice::Direct);
        let task = common::task(robot.clone(), &settings, &policy);
        // The curb begins at the start's line; a metre on it is one height everywhere.
        (0..20).find_map(|seed| {
            let mut env = Env::new(task.clone());
            let mut observation = vec![0.0; task.num_observations()];
            env.reset(&mut common::uniform(seed), &mut observation);
            let mut state = env.state();
            let physics = state.len() - env.simulation().state().len();
            (state[physics + 1], state[physics + 3]) = (1.0, 0.185 + env.ground_height_m([1.0, 0.0]));
            env.set_state(&state, &mut observation).unwrap();
            let is_up = env.ground_height_m([1.0, 0.0]) > 0.01;
            let action = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
            let fell = (0..300).find_map(|_| env.step(&action, &mut observation).terminated);
            is_up.then_some((fell, env.position_in_ground()[2]))
        })
    };
    let (fell, height_m) = lie_down(1.0).unwrap();
    assert_eq!(fell, Some(Accident::TooLow));
    assert!((height_m - 0.27).abs() < 0.03, "{height_m}");
}

#[test]
fn patches_are_multiples_of_the_friction_that_counts_whoever_has_priority() {
    // Doggo's feet have a friction of 0.8; the floor of this test has 0.6, and another say in the contact.
    for (floor_priority, friction) in [(0, 0.8), (1, 0.8), (2, 0.6)] {
        let mut robot = Robot::load("doggo").unwrap();
        let geom = |name: &str| robot.model.id(ObjectKind::Geom, name).unwrap();
        let floor = geom(&robot.settings.floor);
        let feet = ["front_left_foot", "back_right_foot"].map(geom);
        let model = robot.model.raw_mut();
        assert_eq!(model.geom_priority()[feet[0]], 1);
        model.geom_priority_mut()[floor] = floor_priority;
        model.geom_friction_mut()[floor][0] = 0.6;
        let walked_m = |change| {
            let task = task(&robot, change);
            let mut env = Env::new(task.clone());
            let mut observation = vec![0.0; task.num_observations()];
            env.reset(&mut common::uniform(1), &mut observation);
            (0..300).for_each(|_| _ = env.step_prior(&mut observation));
            let model = env.simulation().model();
            let frictions: Vec<f64> = feet.iter().map(|&foot| model.geom_friction()[foot][0]).collect();
            (env.position_in_ground()[0], frictions)
        };
        let (plain_m, _) = walked_m(|_| {});
        let (nearly_m, frictions) = walked_m(|settings| {
            settings.ground =
                Some(GroundSettings { patch_friction: Some(vec![0.999, 1.001]), ..GroundSettings::smooth() });
        });
        assert!(plain_m > 0.5, "{plain_m}");
        assert!((nearly_m / plain_m - 1.0).abs() < 0.1, "priority {floor_priority}: {nearly_m} instead of {plain_m} m");
        assert!(frictions.iter().all(|own| (own / friction - 1.0).abs() < 0.002), "{floor_priority}: {frictions:?}");
        let (slippery_m, _) = walked_m(|settings| {
            settings.ground =
                Some(GroundSettings { patch_friction: Some(vec![0.01, 0.02]), ..GroundSettings::smooth() });
        });
        assert!(slippery_m < 0.5 * plain_m, "priority {floor_priority}: {slippery_m} on ice, {plain_m} m elsewhere");
    }
}

#[test]
fn patches_give_the_feet_their_friction() {
    let robot = Robot::load("doggo").unwrap();
    let task = task(&robot, |settings| {
        settings.friction = Some(0.5);
        settings.ground = Some(GroundSettings { patch_friction: Some(vec![1.0, 1.4]), ..GroundSettings::smooth() });
    });
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut common::uniform(1), &mut observation);
    let mut seen = Vec::new();
    for _ in 0..300 {
        env.step_prior(&mut observation);
        let model = env.simulation().model();
        for foot in ["front_left_foot", "back_right_foot"] {
            let geom = robot.model.id(ObjectKind::Geom, foot).unwrap();
            seen.push(model.geom_friction()[geom][0]);
        }
    }
    assert!(seen.iter().all(|friction| (0.5..=0.7).contains(friction)), "{seen:?}");
    assert!(seen.iter().any(|friction| *friction != seen[0]));
}

#[test]
fn an_even_episode_of_a_task_with_rough_ones_is_flat_ground_to_the_byte() {
    let robot = Robot::load("doggo").unwrap();
    let walk = |roughness: Option<Vec<f64>>| {
        let mut settings = common::task_settings();
        settings.variation.roughness = roughness;
        settings.variation.share = Some(0.5);
        let policy = common::policy_settings("sine", ModulationChoice::Direct);
        let task = common::task(robot.clone(), &settings, &policy);
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        let mut walked = Vec::new();
        // A rough episode first, so that it leaves no trace.
        for place in [0.1, 0.9] {
            env.vary(Variant { place, level: 1.0 });
            env.reset(&mut common::uniform(3), &mut observation);
            (0..200).for_each(|_| _ = env.step_prior(&mut observation));
            walked.push(env.simulation().qpos().to_vec());
        }
        walked
    };
    let (flat, mixed) = (walk(None), walk(Some(vec![0.1, 0.2])));
    assert_ne!(flat[0], mixed[0]);
    assert_eq!(flat[1], mixed[1]);
}
