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
