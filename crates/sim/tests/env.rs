//! The contract of an environment.

mod common;

use canter_sim::task::ModulationChoice;
use canter_sim::variation::{Variant, VariationSettings};
use canter_sim::{Accident, Env};

fn env(modulation: ModulationChoice, change: impl Fn(&mut canter_sim::TaskSettings)) -> (Env, Vec<f32>) {
    let mut settings = common::task_settings();
    change(&mut settings);
    let task = common::doggo(&settings, &common::policy_settings("sine", modulation));
    let observation = vec![f32::NAN; task.num_observations()];
    (Env::new(task), observation)
}

#[test]
fn every_modulation_gives_finite_changing_observations_and_the_same_numbers_twice() {
    for modulation in ModulationChoice::ALL.iter().copied() {
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
fn an_accident_leaves_its_share_of_a_positive_return() {
    let mut policy = common::policy_settings("stepping", ModulationChoice::Direct);
    policy.authority = 1.0;
    let mut task = canter_sim::Task::clone(&common::doggo(&common::task_settings(), &policy));
    task.reward = canter_sim::reward::RewardWeights {
        forward: 1.0,
        drift: 0.0,
        bounce: 0.0,
        energy: 0.0,
        turn: 0.0,
        action_rate: 0.0,
    };
    let mut env = Env::new(std::sync::Arc::new(task));
    let mut observation = vec![0.0; env.task().num_observations()];
    env.reset(&mut common::uniform(1), &mut observation);
    let mut sum_of_terms = 0.0;
    let mut sum_of_rewards = 0.0;
    for step in 0..600 {
        // Two seconds of walking, then the legs are drawn in.
        let drawn_in = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
        let outcome = if step < 200 { env.step_prior(&mut observation) } else { env.step(&drawn_in, &mut observation) };
        sum_of_terms += outcome.terms.total();
        sum_of_rewards += outcome.reward;
        if outcome.terminated.is_some() {
            assert_eq!(outcome.terminated, Some(Accident::TooLow));
            assert!(step > 200 && sum_of_terms > 2.0, "{step} {sum_of_terms}");
            assert!((sum_of_rewards - 0.5 * sum_of_terms).abs() < 1e-9, "{sum_of_rewards} {sum_of_terms}");
            return;
        }
    }
    panic!("the robot still stands");
}

#[test]
fn the_robots_own_step_gives_the_simulators_commands() {
    use canter_gait::{Network, NetworkShape, Normaliser, PhaseClock, Policy, Workspace};
    let mut policy_settings = common::policy_settings("sine", ModulationChoice::Modulate);
    policy_settings.authority = 1.0;
    let task = common::doggo(&common::task_settings(), &policy_settings);
    let (num_observations, num_actions) = (task.num_observations(), task.num_actions());
    let shape = NetworkShape { input: num_observations, hidden: 16, output: num_actions };
    let mut uniform = common::uniform(12);
    let parameters: Vec<f32> = (0..shape.num_parameters()).map(|_| (0.4 * uniform() - 0.2) as f32).collect();
    let (mean, inverse_std) = (vec![0.1; num_observations], vec![0.3; num_observations]);
    let policy = Policy {
        normaliser: Normaliser { mean: &mean, inverse_std: &inverse_std },
        network: Network::new(shape, &parameters).unwrap(),
        mirror: None,
    };
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; num_observations];
    env.reset(&mut common::uniform(2), &mut observation);

    let mut clock = PhaseClock::at(env.phase());
    let (mut own_observation, mut hidden) = (vec![0.0; num_observations], vec![0.0; 32]);
    let (mut own_action, mut targets) = (vec![0.0; num_actions], vec![0.0; 8]);
    let (mut sim_hidden, mut sim_action) = (vec![0.0; 32], vec![0.0; num_actions]);
    for _ in 0..500 {
        let mut workspace =
            Workspace { observation: &mut own_observation, hidden: &mut hidden, action: &mut own_action };
        task.controller().step(&policy, &env.sensors(), &mut clock, 0.01, &mut workspace, &mut targets);
        policy.act(&mut observation, &mut sim_hidden, &mut sim_action);
        let outcome = env.step(&sim_action, &mut observation);
        assert_eq!(targets, env.last_command());
        if outcome.terminated.is_some() {
            env.reset(&mut common::uniform(3), &mut observation);
            clock = PhaseClock::at(env.phase());
            own_action.fill(0.0);
        }
    }
}

#[test]
fn lying_down_is_an_accident() {
    let (mut env, mut observation) = env(ModulationChoice::Direct, |_| {});
    env.reset(&mut common::uniform(1), &mut observation);
    // Motors at +1 and -1 rad: the legs are drawn in until the belly is low.
    let action = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
    for _ in 0..300 {
        let outcome = env.step(&action, &mut observation);
        if let Some(accident) = outcome.terminated {
            assert_eq!(accident, Accident::TooLow);
            return;
        }
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
fn the_place_among_the_variations_decides_the_slope() {
    let (mut env, mut observation) = env(ModulationChoice::Amplitude, |settings| {
        settings.start_noise_rad = 0.0;
        settings.slope_deg = -3.0;
        settings.variation =
            VariationSettings { share: Some(0.5), slope_deg: Some(vec![5.0, 15.0]), ..VariationSettings::nothing() };
    });
    // Half of the places climb from 5 to 15 degrees, the others have the task's own slope.
    for (place, slope_deg) in
        [(0.0, 5.0), (0.1, 7.0), (0.25, 10.0), (0.45, 14.0), (0.5, -3.0), (0.99, -3.0), (0.2, 9.0)]
    {
        env.vary(Variant { place, level: 1.0 });
        env.reset(&mut common::uniform(11), &mut observation);
        // A robot that stands flat on the ground shows its slope by its pitch.
        assert!((-observation[17].to_degrees() - slope_deg).abs() < 1e-4, "{place}: {}", observation[17]);
    }
}

#[test]
fn a_varied_slope_is_the_same_physics_as_that_slope_as_the_tasks_own() {
    let walk = |change: &dyn Fn(&mut canter_sim::TaskSettings)| {
        let (mut env, mut observation) = env(ModulationChoice::Amplitude, change);
        env.vary(Variant { place: 0.5, level: 1.0 });
        env.reset(&mut common::uniform(12), &mut observation);
        for _ in 0..100 {
            env.step_prior(&mut observation);
        }
        (env.position_in_ground(), observation)
    };
    let varied = walk(&|settings| {
        settings.variation =
            VariationSettings { share: None, slope_deg: Some(vec![4.0, 12.0]), ..VariationSettings::nothing() };
    });
    let own = walk(&|settings| settings.slope_deg = 8.0);
    assert!(distance(varied.0, own.0) < 1e-9, "{varied:?} {own:?}");
    assert_ne!(own, walk(&|_| {}));
}

#[test]
fn a_restored_environment_goes_on_with_the_same_bytes() {
    restored_goes_on(|_| {});
    restored_goes_on(|settings| {
        settings.variation =
            VariationSettings { share: None, slope_deg: Some(vec![-10.0, 10.0]), ..VariationSettings::nothing() };
    });
}

fn restored_goes_on(change: impl Fn(&mut canter_sim::TaskSettings)) {
    let (mut original, mut observation) = env(ModulationChoice::Modulate, &change);
    original.vary(Variant { place: 0.9, level: 1.0 });
    original.reset(&mut common::uniform(9), &mut observation);
    let mut uniform = common::uniform(10);
    let mut action = || (0..17).map(|_| (uniform() * 0.6 - 0.3) as f32).collect::<Vec<_>>();
    for _ in 0..77 {
        original.step(&action(), &mut observation);
    }
    let state = original.state();
    let (mut restored, mut restored_observation) = env(ModulationChoice::Modulate, &change);
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
