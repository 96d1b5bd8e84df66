//! Contracts of every robot that comes with canter: it stands, and walks with every gait that it declares stable.

mod common;

use std::sync::Arc;

use canter_sim::robot::{NamedGait, built_in_robots};
use canter_sim::task::ModulationChoice;
use canter_sim::{Env, Robot, Task};

/// Random starts of each gait.
const NUM_STARTS: u64 = 3;

/// Time that it has to walk without an accident, a part of which it needs to get going [s].
const WALK_S: f64 = 6.0;

fn robots() -> Vec<Robot> {
    built_in_robots().map(|name| Robot::load(name).unwrap()).collect()
}

fn task(robot: &Robot, gait: &str) -> Arc<Task> {
    let policy = common::policy_settings(gait, ModulationChoice::Direct);
    common::task(robot.clone(), &common::task_settings(), &policy)
}

/// The gait with its legs still in the standing pose.
fn standing(task: &Task) -> Vec<f32> {
    vec![0.0; task.num_actions()]
}

#[test]
fn every_robot_stands() {
    for robot in robots() {
        let name = robot.settings.name.clone();
        let task = task(&robot, &robot.gaits[0].name);
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        env.reset(&mut || 0.5, &mut observation);
        let start = env.position_in_ground();
        for _ in 0..200 {
            let outcome = env.step(&standing(&task), &mut observation);
            assert_eq!(outcome.terminated, None, "{name}");
        }
        let end = env.position_in_ground();
        let height = robot.settings.stance_height_m;
        let moved = (end[0] - start[0]).hypot(end[1] - start[1]);
        assert!(moved < 0.2 * height && end[2] > 0.8 * start[2], "{name}: {start:?} became {end:?}");
    }
}

#[test]
fn every_stable_gait_walks() {
    for robot in robots() {
        assert!(robot.default_gaits().count() > 0, "{}", robot.settings.name);
        for gait in robot.gaits.iter().filter(|gait| gait.is_stable) {
            for start in 0..NUM_STARTS {
                assert_walks(&robot, gait, start);
            }
        }
    }
}

/// Half a stance height a second is slow for any gait, and far from standing.
#[track_caller]
fn assert_walks(robot: &Robot, gait: &NamedGait, start: u64) {
    let what = format!("{} {} {start}", robot.settings.name, gait.name);
    let task = task(robot, &gait.name);
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut common::uniform(start), &mut observation);
    for _ in 0..(WALK_S / task.settings.control_dt_s) as usize {
        assert_eq!(env.step_prior(&mut observation).terminated, None, "{what}");
    }
    let [forward, ..] = env.position_in_ground();
    assert!(forward > 0.5 * robot.settings.stance_height_m * WALK_S, "{what}: {forward} m");
}
