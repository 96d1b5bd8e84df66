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

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[test]
fn a_snapshot_of_the_standing_robot_has_the_numbers_of_the_model() {
    let (mut env, mut observation) = env(ModulationChoice::Amplitude, |settings| settings.start_noise_rad = 0.0);
    env.reset(&mut common::uniform(1), &mut observation);
    let standing = env.snapshot();
    assert!(distance(standing.position, [0.0, 0.0, 0.185]) < 1e-6, "{standing:?}");
    assert!(standing.orientation_rad.iter().all(|angle| angle.abs() < 1e-12), "{standing:?}");
    assert_eq!((standing.num_body_contacts, standing.legs.len()), (0, 4));
    // Front left, back left, back right, front right; the forward knee first.
    for (leg, [x, y]) in standing.legs.iter().zip([[0.18, 0.11], [-0.18, 0.11], [-0.18, -0.11], [0.18, -0.11]]) {
        assert!(distance(leg.hip, [x, y, 0.185]) < 1e-6, "{leg:?}");
        assert!(distance(leg.foot, [x, y, 0.015]) < 1e-6, "{leg:?}");
        for (knee, sign) in leg.knees.into_iter().zip([1.0, -1.0]) {
            assert!(distance(knee, [x + sign * 0.084_256_799, y, 0.153_364_706]) < 1e-6, "{leg:?}");
        }
        assert!(leg.actual.swing.abs() < 1e-6 && leg.actual.extension.abs() < 1e-6, "{leg:?}");
    }
}

#[test]
fn a_snapshot_belongs_to_the_moment_and_leaves_no_trace() {
    let (mut watched, mut observation) = env(ModulationChoice::Modulate, |_| {});
    let (mut alone, _) = env(ModulationChoice::Modulate, |_| {});
    watched.reset(&mut common::uniform(5), &mut observation);
    alone.reset(&mut common::uniform(5), &mut observation);
    let body_from_hip = distance([0.18, 0.11, 0.0], [0.0; 3]);
    let mut touched = [0; 4];
    for _ in 0..200 {
        let work_j = watched.step_prior(&mut observation).work_j;
        let snapshot = watched.snapshot();
        assert_eq!(work_j, alone.step_prior(&mut observation).work_j);
        assert_eq!(watched.state(), alone.state());
        assert_eq!(snapshot, watched.snapshot());
        assert_eq!(snapshot.position, watched.position_in_ground());
        for (leg, touched) in snapshot.legs.iter().zip(&mut touched) {
            // Positions that lag one physics step behind would be off by millimetres at walking speed.
            assert!((distance(leg.hip, snapshot.position) - body_from_hip).abs() < 1e-6, "{leg:?}");
            // A foot that touches is as low as its radius, 15 mm; one that does not is higher.
            assert_eq!(leg.has_contact, leg.foot[2] <= 0.015, "{leg:?}");
            *touched += u32::from(leg.has_contact);
        }
    }
    assert!(touched.iter().all(|steps| (40..180).contains(steps)), "{touched:?}");
}

#[test]
fn a_body_on_the_ground_is_counted() {
    // So steep that a walking robot tumbles. Nothing stops the environment at its accident.
    let (mut env, mut observation) = env(ModulationChoice::Amplitude, |settings| settings.slope_deg = -40.0);
    env.reset(&mut common::uniform(2), &mut observation);
    let mut contacts = Vec::new();
    for _ in 0..300 {
        env.step_prior(&mut observation);
        contacts.push(env.snapshot().num_body_contacts);
    }
    assert!(contacts[..10].iter().all(|&count| count == 0), "{contacts:?}");
    assert!(contacts.iter().any(|&count| count > 0), "{contacts:?}");
}
