//! Contracts of every modulation on every robot, on its own gait and on a recording of it.

mod common;

use std::sync::Arc;

use canter_gait::prior::{LegGait, TABLE_POINTS, Table};
use canter_gait::{Actuators, Controller, LegPosition, PhaseClock, Waveform};
use canter_sim::robot::built_in_robots;
use canter_sim::task::ModulationChoice;
use canter_sim::{Env, NamedGait, PolicySettings, Robot, Task};

const RECORDED: &str = "recorded";

/// How far a recording may be from its original between two of its points, a corner of it included [rad].
const RECORDING_RAD: f32 = 0.05;

/// Steps of a walk that is looked at.
const NUM_STEPS: usize = 150;

/// Every built-in robot, its first gait recorded as another one.
fn robots() -> impl Iterator<Item = Robot> {
    built_in_robots().map(|name| {
        let mut robot = Robot::load(name).unwrap();
        let original = robot.gaits[0].clone();
        let legs = original.legs.iter().map(recorded).collect();
        robot.gaits.push(NamedGait { name: RECORDED.to_owned(), legs, ..original });
        robot
    })
}

/// A leg's part of a gait as points of its cycle.
fn recorded(leg: &LegGait) -> LegGait {
    let at = |i: usize| leg.position(i as f32 / TABLE_POINTS as f32, &leg.defaults);
    let points: [LegPosition; TABLE_POINTS] = std::array::from_fn(at);
    let table = Table::new(&points).unwrap();
    LegGait { waveform: Waveform::Table(table), phase_offset: 0.0, defaults: table.defaults() }
}

/// The task of a modulation on a gait; `direct` has full authority, whatever is asked.
fn task(robot: &Robot, gait: &str, modulation: ModulationChoice, authority: f64) -> Arc<Task> {
    let mut policy: PolicySettings = common::policy_settings(gait, modulation);
    // The robot's own.
    (policy.ranges.extension_amplitude_rad, policy.ranges.extension_offset_rad) = (None, None);
    if modulation != ModulationChoice::Direct {
        policy.authority = authority;
    }
    common::task(robot.clone(), &common::task_settings(), &policy)
}

/// Calls `check` for every robot, every modulation, and both gaits.
fn for_each(mut check: impl FnMut(&Robot, &str, ModulationChoice, &str)) {
    for robot in robots() {
        for gait in [robot.gaits[0].name.as_str(), RECORDED] {
            for modulation in ModulationChoice::ALL.iter().copied() {
                let what = format!("{} {gait} {}", robot.settings.name, modulation.name());
                check(&robot, gait, modulation, &what);
            }
        }
    }
}

fn random_action(task: &Task, uniform: &mut impl FnMut() -> f64) -> Vec<f32> {
    (0..task.num_actions()).map(|_| (2.4 * uniform() - 1.2) as f32).collect()
}

/// The targets over some control steps under these actions.
fn targets(controller: &Controller<'_>, mut action: impl FnMut() -> Option<Vec<f32>>) -> Vec<Vec<f32>> {
    let mut clock = PhaseClock::at(0.3);
    let step = |_| {
        let mut targets = vec![f32::NAN; controller.num_motors()];
        match action() {
            Some(action) => controller.act(&action, &mut clock, 0.01, &mut targets),
            None => controller.act_prior(&mut clock, 0.01, &mut targets),
        }
        targets
    };
    (0..NUM_STEPS).map(step).collect()
}

#[test]
fn without_authority_every_gait_stays_as_it_is_to_the_byte() {
    for_each(|robot, gait, modulation, what| {
        if modulation == ModulationChoice::Direct {
            return;
        }
        let task = task(robot, gait, modulation, 0.0);
        let mut uniform = common::uniform(1);
        let with_policy = targets(&task.controller(), || Some(random_action(&task, &mut uniform)));
        let prior = targets(&task.controller(), || None);
        let bits = |rows: &[Vec<f32>]| rows.iter().flatten().map(|target| target.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&with_policy), bits(&prior), "{what}");
    });
}

#[test]
fn an_action_of_zero_is_the_prior_where_the_policy_adds_to_it() {
    for_each(|robot, gait, modulation, what| {
        if !matches!(modulation, ModulationChoice::Modulate | ModulationChoice::Residual) {
            return;
        }
        let task = task(robot, gait, modulation, 1.0);
        let still = targets(&task.controller(), || Some(vec![0.0; task.num_actions()]));
        assert_eq!(still, targets(&task.controller(), || None), "{what}");
    });
}

#[test]
fn with_full_authority_commands_are_free_within_the_legs_limits() {
    for_each(|robot, gait, modulation, what| {
        let task = task(robot, gait, modulation, 1.0);
        let mut uniform = common::uniform(2);
        let moved = targets(&task.controller(), || Some(random_action(&task, &mut uniform)));
        for row in &moved {
            for (leg, pair) in robot.legs.iter().zip(row.chunks_exact(2)) {
                let position = leg.position_at([pair[0], pair[1]]);
                let held = leg.limits.clamp(position);
                let beyond = (position.swing - held.swing).abs().max((position.extension - held.extension).abs());
                assert!(beyond < 2e-3, "{what}: {position:?} in {:?}", leg.limits);
            }
        }
        let prior = targets(&task.controller(), || None);
        let furthest = moved.iter().flatten().zip(prior.iter().flatten()).map(|(a, b)| (a - b).abs());
        let furthest = furthest.fold(0.0, f32::max);
        assert!(furthest > 0.1, "{what}: at most {furthest} rad from the prior");
        if modulation == ModulationChoice::Residual {
            // Limits draw swing and extension back towards the prior's, which lie within them. A joint that is drawn back
            // takes the leg's other one with it, so that joints may go further.
            let in_leg_space = robot.legs.iter().all(|leg| leg.actuators == Actuators::LegSpace);
            let bound = if in_leg_space { 0.2 } else { 0.4 };
            assert!(furthest < bound + 2e-3, "{what}: {furthest} rad from the prior");
        }
    });
}

#[test]
fn every_robot_steps_under_every_modulation() {
    for_each(|robot, gait, modulation, what| {
        let task = task(robot, gait, modulation, 0.5);
        let mut env = Env::new(task.clone());
        let mut observation = vec![f32::NAN; task.num_observations()];
        let mut uniform = common::uniform(3);
        env.reset(&mut uniform, &mut observation);
        for _ in 0..50 {
            let outcome = env.step(&random_action(&task, &mut uniform), &mut observation);
            assert!(outcome.reward.is_finite() && observation.iter().all(|value| value.is_finite()), "{what}");
            if outcome.terminated.is_some() {
                break;
            }
        }
    });
}

#[test]
fn a_recording_is_as_symmetric_as_its_original() {
    let mut num_symmetric = 0;
    for robot in robots() {
        for modulation in ModulationChoice::ALL.iter().copied() {
            let maps = |gait: &str| {
                let task = task(&robot, gait, modulation, 1.0);
                let gait = robot.gait(gait).unwrap();
                let maps =
                    canter_sim::mirror::MirrorMaps::new(&robot, &gait.legs, modulation.modulation(), task.blocks());
                maps.ok()
            };
            let original = maps(&robot.gaits[0].name);
            assert_eq!(original, maps(RECORDED), "{} {}", robot.settings.name, modulation.name());
            num_symmetric += usize::from(original.is_some());
        }
    }
    assert!(num_symmetric >= ModulationChoice::ALL.len());
}

/// What a recorded gait gives a policy besides the residual: its time, and its motion about its mean.
#[test]
fn modulate_stretches_a_recording_in_time_and_about_its_mean() {
    for robot in robots() {
        let name = &robot.settings.name;
        let task = task(&robot, RECORDED, ModulationChoice::Modulate, 1.0);
        let (controller, num_legs) = (task.controller(), robot.legs.len());
        let gait = controller.gait();
        // Frequency: the clock runs twice as fast, the targets at each phase stay.
        let mut action = vec![0.0; task.num_actions()];
        action[0] = 1.0;
        let (mut slow, mut fast) = (PhaseClock::default(), PhaseClock::default());
        let (mut expected, mut found) = (vec![0.0; 2 * num_legs], vec![0.0; 2 * num_legs]);
        for _ in 0..40 {
            controller.act(&action, &mut fast, 0.01, &mut found);
            controller.act_prior(&mut slow, 0.01, &mut expected);
            controller.act_prior(&mut slow, 0.01, &mut vec![0.0; 2 * num_legs]);
            assert!(expected.iter().zip(&found).all(|(a, b)| (a - b).abs() < 2e-3), "{name}: {expected:?} {found:?}");
        }
        // Amplitude: least swing amplitude is 0, so an action of -0.5 halves the way from the mean, and of -1 leaves it.
        for (ask, share) in [(-0.5, 0.5), (-1.0, 0.0)] {
            action.fill(0.0);
            action.iter_mut().skip(1).step_by(4).for_each(|swing| *swing = ask);
            for (index, leg) in gait.legs.iter().enumerate() {
                let parameters = controller.law().leg_parameters(leg, index, &action);
                for phase in [0.0, 0.2, 0.45, 0.7] {
                    let (original, changed) = (leg.position(phase, &leg.defaults), leg.position(phase, &parameters));
                    let mean = leg.defaults.swing_offset;
                    assert!((changed.swing - mean - share * (original.swing - mean)).abs() < 1e-5, "{name}");
                    assert_eq!(changed.extension, original.extension, "{name}");
                }
            }
        }
        // It is the robot's own gait that was recorded.
        for (own, recorded) in robot.gaits[0].legs.iter().zip(gait.legs) {
            for i in 0..100 {
                let at = |leg: &LegGait| leg.position(i as f32 / 100.0, &leg.defaults);
                let (own, recorded) = (at(own), at(recorded));
                assert!((own.swing - recorded.swing).abs() < RECORDING_RAD, "{name}");
                assert!((own.extension - recorded.extension).abs() < RECORDING_RAD, "{name}");
            }
        }
    }
}
