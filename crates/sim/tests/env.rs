//! The contract of an environment.

mod common;

use canter_sim::task::ModulationChoice;
use canter_sim::{Accident, Env};

const MODULATIONS: [ModulationChoice; 4] =
    [ModulationChoice::Amplitude, ModulationChoice::LegAmplitude, ModulationChoice::Modulate, ModulationChoice::Direct];

fn env(modulation: ModulationChoice, change: impl Fn(&mut canter_sim::TaskSettings)) -> (Env, Vec<f32>) {
    let mut settings = common::task_settings();
    change(&mut settings);
    let task = common::doggo(&settings, &common::policy_settings("sine", modulation));
    let observation = vec![f32::NAN; task.num_observations()];
    (Env::new(task), observation)
}

#[test]
fn every_modulation_gives_finite_changing_observations_and_the_same_numbers_twice() {
    for modulation in MODULATIONS {
        let run = || {
            let (mut env, mut observation) = env(modulation, |_| {});
            let mut uniform = common::uniform(7);
            env.reset(&mut uniform, &mut observation);
            assert!(observation.iter().all(|value| value.is_finite()), "{modulation:?}");
            let mut trace = vec![observation.clone()];
            for _ in 0..100 {
                let action: Vec<f32> = (0..env.task().num_actions()).map(|_| (uniform() * 0.6 - 0.3) as f32).collect();
                let outcome = env.step(&action, &mut observation);
                assert!(outcome.reward.is_finite());
                trace.push(observation.clone());
                if outcome.terminated.is_some() {
                    break;
                }
            }
            trace
        };
        let trace = run();
        for component in 0..trace[0].len() {
            let first = trace[0][component];
            assert!(
                trace.iter().any(|row| row[component] != first),
                "{modulation:?}: component {component} is constant"
            );
        }
        assert_eq!(trace, run(), "{modulation:?}");
    }
}

#[test]
fn authority_zero_moves_the_robot_like_the_bare_gait() {
    let mut policy = common::policy_settings("sine", ModulationChoice::Modulate);
    policy.authority = 0.0;
    let task = common::doggo(&common::task_settings(), &policy);
    let (mut with_policy, mut alone) = (Env::new(task.clone()), Env::new(task.clone()));
    let mut observation = vec![0.0; task.num_observations()];
    with_policy.reset(&mut common::uniform(3), &mut observation);
    alone.reset(&mut common::uniform(3), &mut observation);
    let mut uniform = common::uniform(4);
    for _ in 0..200 {
        let action: Vec<f32> = (0..task.num_actions()).map(|_| (2.0 * uniform() - 1.0) as f32).collect();
        with_policy.step(&action, &mut observation);
        alone.step_prior(&mut observation);
        assert_eq!(with_policy.position_in_ground(), alone.position_in_ground());
    }
}

#[test]
fn time_and_goal_truncate() {
    let (mut env_, mut observation) = env(ModulationChoice::Amplitude, |settings| settings.episode_s = 0.5);
    env_.reset(&mut common::uniform(1), &mut observation);
    for step in 1..=50 {
        let outcome = env_.step_prior(&mut observation);
        assert_eq!(outcome.truncated, step == 50);
        assert_eq!(outcome.terminated, None);
    }
    let (mut env_, mut observation) = env(ModulationChoice::Amplitude, |settings| settings.goal_distance_m = Some(0.3));
    env_.reset(&mut common::uniform(1), &mut observation);
    let steps = (0..1000).take_while(|_| !env_.step_prior(&mut observation).truncated).count();
    assert!(steps < 300 && env_.position_in_ground()[0] >= 0.3, "{steps}");
}

#[test]
fn lying_down_is_an_accident_that_costs_the_return() {
    let (mut env, mut observation) = env(ModulationChoice::Direct, |_| {});
    env.reset(&mut common::uniform(1), &mut observation);
    // Motors at +1 and -1 rad: the legs are drawn in until the belly is low.
    let action = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
    let mut return_so_far = 0.0;
    for _ in 0..300 {
        let outcome = env.step(&action, &mut observation);
        if let Some(accident) = outcome.terminated {
            assert_eq!(accident, Accident::TooLow);
            let expected = (0.5_f64 - 1.0) * (return_so_far + outcome.terms.total());
            assert!((outcome.reward - outcome.terms.total() - expected.min(0.0)).abs() < 1e-12);
            return;
        }
        return_so_far += outcome.reward;
    }
    panic!("the robot still stands");
}

#[test]
fn a_slope_pulls_back_and_shows_in_the_pitch() {
    let speed = |slope_deg: f64| {
        let (mut env, mut observation) = env(ModulationChoice::Amplitude, |settings| settings.slope_deg = slope_deg);
        env.reset(&mut common::uniform(5), &mut observation);
        for _ in 0..300 {
            env.step_prior(&mut observation);
        }
        env.position_in_ground()[0] / 3.0
    };
    assert!(speed(8.0) < speed(0.0) - 0.05);
    let (mut env, mut observation) = env(ModulationChoice::Amplitude, |settings| {
        settings.slope_deg = 10.0;
        settings.start_noise_rad = 0.0;
    });
    env.reset(&mut common::uniform(5), &mut observation);
    // Blocks in order: 8 angles, 8 velocities, then roll, pitch, yaw.
    assert!((observation[17] + 10_f32.to_radians()).abs() < 1e-5);
}

#[test]
fn a_restored_environment_goes_on_with_the_same_bytes() {
    let (mut original, mut observation) = env(ModulationChoice::Modulate, |_| {});
    original.reset(&mut common::uniform(9), &mut observation);
    let mut uniform = common::uniform(10);
    let mut action = || (0..17).map(|_| (uniform() * 0.6 - 0.3) as f32).collect::<Vec<_>>();
    for _ in 0..77 {
        original.step(&action(), &mut observation);
    }
    let state = original.state();
    let (mut restored, mut restored_observation) = env(ModulationChoice::Modulate, |_| {});
    restored.set_state(&state, &mut restored_observation).unwrap();
    assert_eq!(observation, restored_observation);
    for _ in 0..200 {
        let action = action();
        let a = original.step(&action, &mut observation);
        let b = restored.step(&action, &mut restored_observation);
        assert_eq!(a, b);
        assert_eq!(observation, restored_observation);
    }
    assert!(restored.set_state(&state[1..], &mut restored_observation).is_err());
}

#[test]
fn a_standing_robot_touches_the_ground_with_its_feet_alone_and_a_fallen_one_with_more() {
    // Motor angles of 0 are the standing pose.
    let (mut env, mut observation) = env(ModulationChoice::Direct, |settings| settings.start_noise_rad = 0.0);
    env.reset(&mut common::uniform(1), &mut observation);
    let mut feet = [false; 4];
    for _ in 0..50 {
        env.step(&[0.0; 8], &mut observation);
    }
    assert_eq!((env.ground_contacts(&mut feet), feet), (0, [true; 4]));
    // Thrown over, it comes down on its side.
    env.push([0.0, 4.0, 0.0]);
    let mut others = 0;
    for _ in 0..200 {
        env.step(&[0.0; 8], &mut observation);
        others = others.max(env.ground_contacts(&mut feet));
    }
    assert!(others > 0);
}

#[test]
fn a_push_changes_the_velocity_at_once_and_moves_the_robot_to_that_side() {
    let end = |push: f64| {
        let (mut env, mut observation) = env(ModulationChoice::Direct, |settings| settings.start_noise_rad = 0.0);
        env.reset(&mut common::uniform(1), &mut observation);
        env.step(&[0.0; 8], &mut observation);
        let before = env.simulation().qvel()[..3].to_vec();
        env.push([0.0, push, 0.0]);
        let after = &env.simulation().qvel()[..3];
        assert_eq!([after[0] - before[0], after[2] - before[2]], [0.0; 2]);
        assert!((after[1] - before[1] - push).abs() < 1e-15);
        for _ in 0..10 {
            env.step(&[0.0; 8], &mut observation);
        }
        env.position_in_ground()[1]
    };
    let rest = end(0.0);
    assert!(end(0.5) > rest + 0.005 && end(-0.5) < rest - 0.005);
}

#[test]
fn scaled_masses_weigh_what_they_should() {
    let robot = canter_sim::Robot::load("doggo").unwrap();
    let (kg, inertia) = (robot.model.total_mass_kg(), robot.model.raw().body_inertia()[1]);
    let mut heavier = robot.model.clone();
    heavier.scale_masses(1.3);
    assert!((heavier.total_mass_kg() - 1.3 * kg).abs() < 1e-12);
    assert!((heavier.raw().body_inertia()[1][0] - 1.3 * inertia[0]).abs() < 1e-12);
    // What MuJoCo derives from the masses has followed: the inverse weight of the body.
    let inverse_weight = |model: &canter_sim::mujoco::Model| model.raw().body_invweight0()[1][0];
    assert!(inverse_weight(&heavier) < 0.9 * inverse_weight(&robot.model));
    // A factor of 1 changes nothing.
    let mut same = robot.model.clone();
    same.scale_masses(1.0);
    assert_eq!(inverse_weight(&same), inverse_weight(&robot.model));
}
