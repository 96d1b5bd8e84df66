//! Robots of a user's own: what does not fit together is named before anything moves.

mod common;

use std::fs;
use std::path::PathBuf;

use canter_sim::task::ModulationChoice;
use canter_sim::{Env, Robot};

/// Writes Doggo with changed files into a folder of its own and loads it.
fn changed(name: &str, settings: &[(&str, &str)], model: &[(&str, &str)]) -> Result<Robot, String> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&folder).unwrap();
    let doggo = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../robots/doggo");
    for (file, changes) in [("robot.toml", settings), ("doggo.xml", model)] {
        let mut text = fs::read_to_string(doggo.join(file)).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        fs::write(folder.join(file), text).unwrap();
    }
    Robot::load(folder.join("robot.toml").to_str().unwrap()).map_err(|error| error.to_string())
}

#[track_caller]
fn refused(name: &str, settings: &[(&str, &str)], model: &[(&str, &str)], expected: &str) {
    let message = changed(name, settings, model).unwrap_err();
    assert!(message.contains(expected), "{message}");
}

#[test]
fn a_model_that_is_not_what_robot_toml_says_is_refused() {
    changed("as_it_is", &[], &[]).unwrap();
    refused("links", &[("upper_link_m = 0.09", "upper_link_m = 0.10")], &[], "foot does not move as link lengths");
    let swapped = [("upper_link_m = 0.09", "upper_link_m = 0.162"), ("lower_link_m = 0.162", "lower_link_m = 0.09")];
    refused("swapped", &swapped, &[], "foot does not move as link lengths");
    let crossed = [(
        "motors = [\"front_left_motor_a\", \"front_left_motor_b\"]",
        "motors = [\"front_left_motor_b\", \"front_left_motor_a\"]",
    )];
    refused("crossed", &crossed, &[], "legs[0].upper_link_m");
    let knees = [(
        "knees = [\"back_left_knee_a\", \"back_left_knee_b\"]",
        "knees = [\"back_left_knee_b\", \"back_left_knee_a\"]",
    )];
    refused("knees", &knees, &[], "legs[1].upper_link_m");
    refused("root", &[("\"front_left_motor_a\"", "\"root\"")], &[], "expected a hinge");
    refused("twice", &[("\"back_left_motor_a\"", "\"front_left_motor_a\"")], &[], "this joint is named already");
    refused("actuator", &[("\"back_left_swing\"", "\"front_left_swing\"")], &[], "this actuator is named already");
    let zero = [("\"back_left_swing\"", "\"back_left\\u0000swing\"")];
    refused(
        "zero",
        &zero,
        &[],
        "legs[1].actuators[0] = \"back_left\\u0000swing\" is refused: the model has no actuator called",
    );
    refused("box_foot", &[("foot = \"front_left_foot\"", "foot = \"chassis\"")], &[], "expected a sphere");
    let raised = [("<geom name=\"floor\" type=\"plane\"", "<geom name=\"floor\" type=\"plane\" pos=\"0 0 0.5\"")];
    refused("raised", &[], &raised, "expected a plane at z = 0");
    refused("no_floor", &[("floor = \"floor\"", "floor = \"chassis\"")], &[], "expected a plane at z = 0");
}

#[test]
fn a_loop_needs_something_that_holds_it() {
    let freely =
        "legs[1].knees[1] = \"back_left_knee_b\" is refused: nothing in the model holds this leg's loop closed";
    let open = [("<connect name=\"back_left_loop\"", "<connect active=\"false\" name=\"back_left_loop\"")];
    refused("open", &[], &open, freely);
    // No number is no small distance either.
    let nowhere = [("_left_lower_b\" pos=\"-0.084256798931", "_left_lower_b\" pos=\"inf")];
    refused("nowhere", &[], &nowhere, "legs[0].");
}

#[test]
fn a_robot_uses_what_lies_in_its_folder_and_changes_with_it() {
    let include = [("<asset>", "<compiler meshdir=\"meshes\"/>\n<include file=\"parts/more.xml\"/>\n<asset>")];
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("parts");
    for part in ["parts", "meshes"] {
        fs::create_dir_all(folder.join(part)).unwrap();
    }
    let load = |edge: &str| {
        let mesh = format!("v 0 0 0\nv {edge} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
        fs::write(folder.join("meshes/corner.obj"), mesh).unwrap();
        let more = "<mujoco><!-- more -- or less --><asset><mesh file=\"corner.obj\"/></asset></mujoco>";
        fs::write(folder.join("parts/more.xml"), more).unwrap();
        changed("parts", &[], &include).unwrap().fingerprint
    };
    let fingerprint = load("1");
    assert_eq!(load("1"), fingerprint);
    assert_ne!(load("2"), fingerprint);
}

#[test]
fn the_motor_limits_hold_whatever_the_model_says() {
    let way = |name: &str, model: &[(&str, &str)]| {
        let robot = changed(name, &[("max_torque_nm = 4.2", "max_torque_nm = 1.0")], model).unwrap();
        let policy = common::policy_settings("stepping", ModulationChoice::Amplitude);
        let task = common::task(robot, &common::task_settings(), &policy);
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        env.reset(&mut common::uniform(1), &mut observation);
        for _ in 0..200 {
            env.step_prior(&mut observation);
        }
        env.position_in_ground()
    };
    let limited = way("limited", &[]);
    let stripped = way("stripped", &[(" actuatorfrcrange=\"-4.2 4.2\"", "")]);
    assert_eq!(limited, stripped);
}

#[test]
fn distances_count_from_the_start() {
    let robot = changed("moved", &[], &[("0 0 0.185", "5 2 0.185")]).unwrap();
    let task =
        common::task(robot, &common::task_settings(), &common::policy_settings("sine", ModulationChoice::Amplitude));
    let mut env = Env::new(task.clone());
    env.reset(&mut common::uniform(1), &mut vec![0.0; task.num_observations()]);
    assert_eq!(env.position_in_ground()[..2], [0.0, 0.0]);
}

#[test]
fn extensions_left_to_the_robot_are_as_much_length_of_leg_for_each() {
    let ranges_of = |robot: &str, prior: &str| {
        let mut policy = common::policy_settings(prior, ModulationChoice::Modulate);
        (policy.ranges.extension_amplitude_rad, policy.ranges.extension_offset_rad) = (None, None);
        let task = common::task(Robot::load(robot).unwrap(), &common::task_settings(), &policy);
        let ranges = task.controller().law().ranges;
        (ranges.extension_amplitude, ranges.extension_offset)
    };
    // Doggo's are those with which the published results were learned, to the bit.
    let (amplitude, offset) = ranges_of("doggo", "sine");
    assert_eq!((amplitude.low, amplitude.high), (0.0, 1.0));
    assert_eq!((offset.low, offset.high), (-0.5, 0.5));
    // Two links of 0.2 m that stand at 0.27 m: L = 0.4 sin(e), dL/de = 0.4 cos(asin(0.675)) = 0.2951 m per radian,
    // so 0.61 * 0.27 m / 0.2951 m = 0.558.
    let (amplitude, offset) = ranges_of("quad12", "trot");
    assert_eq!((amplitude.high, offset.low, offset.high), (0.56, -0.28, 0.28));
}
