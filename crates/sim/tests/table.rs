//! A gait that was recorded and given back walks as the one that it was recorded from.

mod common;

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use canter_gait::PhaseClock;
use canter_sim::task::ModulationChoice;
use canter_sim::{Env, Robot};

/// Doggo with a recording of its firmware's trot in `recorded.csv`, and what that has changed by `change`.
fn recorded(name: &str, change: impl Fn(String) -> String) -> Result<Robot, String> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).unwrap();
    let doggo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/doggo");
    fs::copy(doggo.join("doggo.xml"), folder.join("doggo.xml")).unwrap();
    let settings = fs::read_to_string(doggo.join("robot.toml")).unwrap();
    let gait = "\n[[gaits]]\nkind = \"table\"\nname = \"recorded\"\ndefault = false\nstable = true\n\
                stride_frequency_hz = 2.0\ntable = \"recorded.csv\"\n";
    fs::write(folder.join("robot.toml"), settings + gait).unwrap();
    fs::write(folder.join("recorded.csv"), change(recording())).unwrap();
    Robot::load(folder.join("robot.toml").to_str().unwrap()).map_err(|error| error.to_string())
}

/// The actuator targets of the firmware's trot over one cycle, every 10 ms.
fn recording() -> String {
    let policy = common::policy_settings("stepping", ModulationChoice::Direct);
    let task = common::doggo(&common::task_settings(), &policy);
    let names: Vec<String> = ["front_left", "back_left", "back_right", "front_right"]
        .iter()
        .flat_map(|leg| [format!("{leg}_swing"), format!("{leg}_extension")])
        .collect();
    let mut text = names.join(",") + "\n";
    let (mut clock, mut targets) = (PhaseClock::default(), [0.0; 8]);
    for _ in 0..50 {
        task.controller().act_prior(&mut clock, 0.01, &mut targets);
        let cells: Vec<String> = targets.iter().map(|target| format!("{target:.4}")).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    text
}

/// Way forward in 20 s from one of several starts, the mean of them [m].
fn way(robot: &Robot, gait: &str) -> f64 {
    const NUM_STARTS: u64 = 6;
    let policy = common::policy_settings(gait, ModulationChoice::Direct);
    let task = common::task(robot.clone(), &common::task_settings(), &policy);
    let mut sum = 0.0;
    for start in 0..NUM_STARTS {
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        env.reset(&mut common::uniform(start), &mut observation);
        for _ in 0..2000 {
            env.step_prior(&mut observation);
        }
        sum += env.position_in_ground()[0];
    }
    sum / NUM_STARTS as f64
}

#[test]
fn a_recorded_trot_walks_as_fast_as_the_original() {
    let robot = recorded("recorded", |text| text).unwrap();
    let (original, again) = (way(&robot, "stepping"), way(&robot, "recorded"));
    assert!((again / original - 1.0).abs() < 0.02, "{original} m became {again} m");
}

#[test]
fn what_is_wrong_with_a_recording_is_named() {
    let refused = |name: &str, change: fn(String) -> String, words: &str| {
        let message = recorded(name, change).unwrap_err();
        assert!(message.contains("].table = \"recorded.csv\"") && message.contains(words), "{message}");
    };
    refused("no_column", |text| text.replacen("back_left_swing", "back_left_swung", 1), "no column for the actuator");
    refused("cut", |text| text.lines().next().unwrap().to_owned(), "expected at least 4 lines of numbers, found 0");
    refused("degrees", |text| text.replacen("0.", "40.", 9), "beyond the leg's limits");
    refused("words", |text| text.replacen('.', "x", 1), "is no angle in rad");
}
