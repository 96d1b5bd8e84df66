//! A physics that blows up is noticed, whatever it was that blew up, and harms nothing beyond its episode.

mod common;

use std::sync::Arc;

use canter_sim::mujoco::Simulation;
use canter_sim::task::ModulationChoice;
use canter_sim::variation::VariationSettings;
use canter_sim::{Accident, Env, StepOutcome, Task};

/// What a state is poisoned with; MuJoCo itself notices what is above 1e10 only.
const POISONS: [f64; 8] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e20, -1e20, 1e9, -1e9, 1e300];

/// Poisoned states of each way to poison.
const NUM_CASES: usize = 3000;

/// Largest component of an observation that makes sense: velocities are up to 1 km/s [m/s, rad/s].
const LARGEST_OBSERVATION: f32 = 1e3;

/// Largest reward that makes sense: at weights of 1 a way of 10 m costs and earns 59 leg lengths.
const LARGEST_REWARD: f64 = 500.0;

/// Walks whose moments are poisoned.
const NUM_WALKS: u64 = 40;

fn task(modulation: ModulationChoice) -> Arc<Task> {
    common::doggo(&common::task_settings(), &common::policy_settings("sine", modulation))
}

/// A whole number below `bound`.
fn draw(uniform: &mut dyn FnMut() -> f64, bound: usize) -> usize {
    (uniform() * bound as f64) as usize
}

fn random_action(env: &Env, uniform: &mut dyn FnMut() -> f64) -> Vec<f32> {
    (0..env.task().num_actions()).map(|_| (uniform() * 2.4 - 1.2) as f32).collect()
}

/// An environment in the middle of a walk with random actions.
fn walking(task: &Arc<Task>, seed: u64) -> Env {
    let mut uniform = common::uniform(seed);
    let mut observation = vec![0.0; task.num_observations()];
    let mut env = Env::new(task.clone());
    env.reset(&mut uniform, &mut observation);
    for _ in 0..draw(&mut uniform, 40) {
        let action = random_action(&env, &mut uniform);
        env.step(&action, &mut observation);
    }
    env
}

/// Whether nothing but sense was handed on, and nonsense only with its accident.
fn assert_sane(outcome: &StepOutcome, observation: &[f32], env: &Env, case: &str) {
    assert!(outcome.reward.is_finite() && outcome.reward.abs() < LARGEST_REWARD, "{case}: {outcome:?}");
    if outcome.terminated == Some(Accident::Unstable) {
        assert!(observation.iter().all(|&value| value == 0.0), "{case}: {observation:?}");
        assert_eq!((outcome.work_j, outcome.terms.total()), (0.0, 0.0), "{case}");
    } else {
        let is_sane = |value: &f32| value.abs() < LARGEST_OBSERVATION;
        assert!(observation.iter().all(is_sane), "{case}: {observation:?}");
        assert!(outcome.work_j.is_finite() && outcome.terms.total().is_finite(), "{case}: {outcome:?}");
        let physics = env.simulation();
        assert!(canter_sim::frame::is_sane(physics.qpos(), physics.qvel()), "{case}");
    }
}

/// An episode of a few steps: everything that a learner sees of it, and its last state.
fn episode(env: &mut Env, seed: u64) -> (Vec<StepOutcome>, Vec<f32>, Vec<f64>) {
    let mut uniform = common::uniform(seed);
    let mut observation = vec![f32::NAN; env.task().num_observations()];
    env.reset(&mut uniform, &mut observation);
    let (mut outcomes, mut observations) = (Vec::new(), observation.clone());
    for _ in 0..5 {
        let action = random_action(env, &mut uniform);
        outcomes.push(env.step(&action, &mut observation));
        observations.extend_from_slice(&observation);
    }
    (outcomes, observations, env.state())
}

#[test]
fn a_poisoned_state_is_refused_or_noticed_or_harmless() {
    let task = task(ModulationChoice::Modulate);
    let mut uniform = common::uniform(1);
    let states: Vec<Vec<f64>> = (0..NUM_WALKS).map(|seed| walking(&task, seed).state()).collect();
    let expected: Vec<_> = (0..8).map(|seed| episode(&mut Env::new(task.clone()), seed)).collect();
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    let (mut refused, mut unstable, mut harmless) = (0, 0, 0);
    for number in 0..NUM_CASES {
        let mut state = states[number % states.len()].clone();
        let place = draw(&mut uniform, state.len());
        let poison = POISONS[draw(&mut uniform, POISONS.len())];
        state[place] = poison;
        let case = format!("case {number}: {poison} at {place} of {}", state.len());
        if env.set_state(&state, &mut observation).is_ok() {
            assert!(observation.iter().all(|value| value.abs() < LARGEST_OBSERVATION), "{case}");
            let action = random_action(&env, &mut uniform);
            let outcome = env.step(&action, &mut observation);
            assert_sane(&outcome, &observation, &env, &case);
            assert!(env.state().iter().all(|value| value.is_finite()), "{case}: {:?}", env.state());
            match outcome.terminated {
                Some(Accident::Unstable) => unstable += 1,
                _ => harmless += 1,
            }
        } else {
            refused += 1;
        }
        // The next episode is that of a new environment, to the byte.
        assert!(episode(&mut env, number as u64 % 8) == expected[number % 8], "{case}");
    }
    println!("{refused} refused, {unstable} noticed, {harmless} harmless");
    assert!(refused > NUM_CASES / 4 && unstable > NUM_CASES / 20 && harmless > NUM_CASES / 20);
}

/// As if the physics itself had come to it: nothing looks at the state before the step.
#[test]
fn a_poisoned_physics_is_noticed_or_harmless() {
    let task = task(ModulationChoice::Modulate);
    let mut uniform = common::uniform(2);
    let states: Vec<Vec<f64>> = (0..NUM_WALKS).map(|seed| walking(&task, seed).simulation().state()).collect();
    let expected: Vec<_> = (0..8).map(|seed| episode(&mut Env::new(task.clone()), seed)).collect();
    let mut model = task.robot.model.clone();
    model.set_timestep_s(task.settings.physics_dt_s);
    let mut observation = vec![0.0; task.num_observations()];
    let (mut unstable, mut harmless) = (0, 0);
    for number in 0..NUM_CASES {
        let mut state = states[number % states.len()].clone();
        let place = draw(&mut uniform, state.len());
        let poison = POISONS[draw(&mut uniform, POISONS.len())];
        state[place] = poison;
        let case = format!("case {number}: {poison} at {place} of {}", state.len());
        let mut simulation = Simulation::new(&model);
        simulation.set_state(&state).unwrap();
        let mut env = Env::with_simulation(task.clone(), simulation);
        let action = random_action(&env, &mut uniform);
        let outcome = env.step(&action, &mut observation);
        assert_sane(&outcome, &observation, &env, &case);
        if outcome.terminated == Some(Accident::Unstable) {
            unstable += 1;
        } else {
            harmless += 1;
        }
        assert!(episode(&mut env, number as u64 % 8) == expected[number % 8], "{case}");
    }
    println!("{unstable} noticed, {harmless} harmless");
    assert!(unstable > NUM_CASES / 4 && harmless > NUM_CASES / 20);
}

/// Which numbers of the physics' state are positions and velocities: those cannot be wrong without notice.
#[test]
fn no_position_and_no_velocity_is_poisoned_without_notice() {
    let task = task(ModulationChoice::Amplitude);
    let mut env = walking(&task, 1);
    let mut observation = vec![f32::NAN; task.num_observations()];
    let healthy = env.state();
    let physics = healthy.len() - env.simulation().state().len();
    let (nq, nv) = (env.simulation().qpos().len(), env.simulation().qvel().len());
    // The time comes first.
    for place in physics + 1..physics + 1 + nq + nv {
        for poison in [1e9, -1e9, 1e20, 2e6] {
            let mut state = healthy.clone();
            state[place] = poison;
            env.set_state(&state, &mut observation).unwrap();
            assert!(observation.iter().all(|&value| value == 0.0), "{poison} at {place}");
            let outcome = env.step_prior(&mut observation);
            assert_eq!(outcome.terminated, Some(Accident::Unstable), "{poison} at {place}");
        }
    }
    env.set_state(&healthy, &mut observation).unwrap();
    assert_eq!(env.step_prior(&mut observation).terminated, None);
}

#[test]
fn an_environments_own_numbers_cannot_be_nonsense() {
    let mut settings = common::task_settings();
    settings.variation =
        VariationSettings { share: Some(0.5), slope_deg: Some(vec![5.0, 15.0]), ..VariationSettings::nothing() };
    let task = common::doggo(&settings, &common::policy_settings("sine", ModulationChoice::Amplitude));
    let mut env = walking(&task, 3);
    let mut observation = vec![0.0; task.num_observations()];
    let healthy = env.state();
    let mut refusal = |place: usize, value: f64| {
        let mut state = healthy.clone();
        state[place] = value;
        env.set_state(&state, &mut observation).err()
    };
    // Phase, env steps, return, time of a stuck leg, place, level, key, two previous actions, commands.
    for (place, wrong, right) in [
        (0, 1.0, 0.999),
        (0, -0.1, 0.0),
        (1, 0.5, 7.0),
        (1, -1.0, 0.0),
        (1, 1e10, 4e9),
        (2, 1e9, 12.0),
        (3, -1.0, 0.4),
        (4, 1.0, 0.3),
        (4, -0.1, 0.0),
        (5, 0.5, 1.0),
        (6, 7.0, 0.0),
        (7, 1.01, -1.0),
        (9, 1e3, 0.7),
    ] {
        let message = refusal(place, wrong).unwrap_or_else(|| panic!("{wrong} at {place}"));
        assert!(message.starts_with("an environment's state has a ") && message.ends_with(" that cannot be"));
        // Where no step was taken no return is possible.
        let is_start = (place, right) == (1, 0.0);
        assert_eq!(refusal(place, right).is_some(), is_start && healthy[2] != 0.0, "{right} at {place}");
    }
}

#[test]
fn an_action_that_is_no_number_is_the_priors() {
    let task = task(ModulationChoice::Modulate);
    let (mut with_nan, mut with_zeros) = (walking(&task, 4), walking(&task, 4));
    let num_actions = task.num_actions();
    let (mut observation, mut expected) = (vec![0.0; task.num_observations()], vec![0.0; task.num_observations()]);
    for _ in 0..3 {
        let outcome = with_nan.step(&vec![f32::NAN; num_actions], &mut observation);
        assert_eq!(outcome, with_zeros.step(&vec![0.0; num_actions], &mut expected));
        assert_eq!(observation, expected);
    }
}
