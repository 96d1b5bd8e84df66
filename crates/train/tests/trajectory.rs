//! Recorded episodes: the evaluation's own steps, in the form that figures read.

mod common;

use std::fs;

use canter_train::config::Resolved;
use canter_train::evaluate::{Mover, evaluate};
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::{RunDirectory, write_trajectory};
use canter_train::trajectory::{Trajectory, record, record_all};
use common::{TemporaryFolder, names};
use serde_json::Value;

/// The default gait `sine` of the tiny preset, `changes` applied, as its file has it.
fn recorded(changes: &[(&str, &str)], mover: Mover<'_>) -> (Resolved, Value) {
    let resolved = common::tiny(changes);
    let trajectory = record(&resolved.task, mover, &resolved.config.evaluation, "sine", "a trot");
    let json = as_written(&trajectory);
    (resolved, json)
}

fn as_written(trajectory: &Trajectory) -> Value {
    let folder = TemporaryFolder::new();
    write_trajectory(&folder.join("new/folder"), trajectory).unwrap();
    let name = format!("{}.json", trajectory.name);
    assert_eq!(names(&folder.join("new/folder")), [name.as_str()]);
    let text = fs::read_to_string(folder.join("new/folder").join(name)).unwrap();
    assert!(text.ends_with("}\n"));
    serde_json::from_str(&text).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn position(value: &Value) -> [f64; 3] {
    std::array::from_fn(|axis| number(&value[axis]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn rows(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list"))
}

/// Sizes of a list of lists.
fn shape(value: &Value) -> Vec<usize> {
    match value {
        Value::Array(rows) => {
            let inner = rows.first().map_or_else(Vec::new, shape);
            assert!(rows.iter().all(|row| shape(row) == inner));
            [vec![rows.len()], inner].concat()
        }
        value => {
            assert!(value.is_number(), "{value}");
            Vec::new()
        }
    }
}

#[test]
fn every_column_has_its_shape_and_the_head_says_what_was_recorded() {
    let (_, json) = recorded(&[("task.slope_deg", "3.0"), ("evaluation.seed", "4")], Mover::Prior);
    let (t, legs, motors) = (200, 4, 8);
    let columns: [(&str, &[usize]); 17] = [
        ("time_s", &[t]),
        ("phase", &[t]),
        ("position_m", &[t, 3]),
        ("orientation_rad", &[t, 3]),
        ("hip_m", &[t, legs, 3]),
        ("knee_m", &[t, legs, 2, 3]),
        ("foot_m", &[t, legs, 3]),
        ("contact", &[t, legs]),
        ("body_contact", &[t]),
        ("commanded_swing_rad", &[t, legs]),
        ("commanded_extension_rad", &[t, legs]),
        ("swing_rad", &[t, legs]),
        ("extension_rad", &[t, legs]),
        ("torque_nm", &[t, motors]),
        ("motor_velocity_rad_per_s", &[t, motors]),
        ("work_j", &[t]),
        ("reward", &[t]),
    ];
    for (name, expected) in columns {
        assert_eq!(shape(&json[name]), expected, "{name}");
    }
    let head = serde_json::json!({
        "version": 1, "name": "sine", "label": "a trot", "robot": "doggo",
        "legs": ["front_left", "back_left", "back_right", "front_right"],
        "control_dt_s": 0.01, "settle_s": 0.5, "slope_deg": 3.0, "seed": 4, "episode": 0, "terminated": null,
        "leg_length_m": 0.17, "max_torque_nm": 4.2,
        "swing_limits_rad": [-1.2, 1.2], "extension_limits_rad": [-1.3129, 1.0422],
    });
    for (key, expected) in head.as_object().unwrap() {
        assert_eq!(json[key], *expected, "{key}");
    }
    assert_eq!(json.as_object().unwrap().len(), head.as_object().unwrap().len() + columns.len());
    assert_eq!((&json["time_s"][0], &json["time_s"][199]), (&Value::from(0.01), &Value::from(2.0)));
}

#[test]
fn the_recorded_way_is_that_of_the_evaluations_episode() {
    let trainer = common::trained(&[], 2);
    let file = PolicyFile::of(&trainer);
    let policy = file.policy();
    for mover in [Mover::Prior, Mover::Policy(&policy)] {
        let (resolved, json) = recorded(&[], mover);
        let report = evaluate(&resolved.task, mover, &resolved.config.evaluation, &common::workers(2));
        // The row with number i is the state after i + 1 steps of 10 ms.
        let forward = |time_s: f64| number(&json["position_m"][(time_s / 0.01).round() as usize - 1][0]);
        let speed = (forward(2.0) - forward(0.5)) / 1.5;
        assert!((speed - report.speeds_m_per_s[0]).abs() < 1e-4, "{speed} {:?}", report.speeds_m_per_s);
        assert!(speed > 0.1);
    }
}

#[test]
fn links_keep_their_lengths_and_leg_space_agrees_with_the_feet() {
    let (resolved, json) = recorded(&[], Mover::Prior);
    let [upper_m, lower_m] = [0.09, 0.162];
    let mut farthest_m: f64 = 0.0;
    for step in 0..rows(&json["time_s"]).len() {
        let pitch = number(&json["orientation_rad"][step][1]);
        for (leg, geometry) in resolved.task.robot.legs.iter().enumerate() {
            let hip = position(&json["hip_m"][step][leg]);
            let foot = position(&json["foot_m"][step][leg]);
            for knee in rows(&json["knee_m"][step][leg]) {
                let knee = position(knee);
                assert!((distance(hip, knee) - upper_m).abs() < 1e-3, "step {step}, leg {leg}");
                assert!((distance(knee, foot) - lower_m).abs() < 1e-3, "step {step}, leg {leg}");
            }
            let length_m = distance(hip, foot);
            assert!(length_m < 0.25 + 1e-3, "no leg is longer than its limit: {length_m}");
            farthest_m = farthest_m.max(distance(hip, foot));
            // The recorded angles, through the controller's kinematics, give the recorded foot.
            let angle = |column: &str| number(&json[column][step][leg]) as f32;
            let leg_position =
                canter_gait::LegPosition { swing: angle("swing_rad"), extension: angle("extension_rad") };
            let foot_below_hip = geometry.geometry.forward(leg_position);
            let reach_m = f64::from(foot_below_hip.forward_m.hypot(foot_below_hip.down_m));
            assert!((length_m - reach_m).abs() < 1e-3, "step {step}, leg {leg}: {length_m} {reach_m}");
            // A pitch turns the leg with the body; a positive one points it back.
            let forward_m = f64::from(foot_below_hip.forward_m) * pitch.cos() - reach_m * pitch.sin();
            assert!((foot[0] - hip[0] - forward_m).abs() < 0.02, "step {step}, leg {leg}");
        }
    }
    assert!(farthest_m > 0.15);
}

#[test]
fn a_trot_touches_with_diagonal_pairs() {
    let (_, json) = recorded(&[], Mover::Prior);
    let contacts = rows(&json["contact"]);
    assert!(contacts.iter().flat_map(rows).all(|contact| *contact == 0 || *contact == 1));
    let together = |a: usize, b: usize| contacts.iter().filter(|row| row[a] == 1 && row[b] == 1).count();
    // Front left, back left, back right, front right.
    let diagonal = together(0, 2) + together(1, 3);
    let lateral = together(0, 1) + together(2, 3);
    assert!(diagonal > 2 * lateral, "{diagonal} {lateral}");
    assert!(json["body_contact"].as_array().unwrap().iter().all(|count| *count == 0));
    // A foot that touches is as low as its radius, 15 mm, one that does not is higher; both within the rounding.
    for (row, feet) in contacts.iter().zip(rows(&json["foot_m"])) {
        for (contact, foot) in rows(row).iter().zip(rows(feet)) {
            let height_m = number(&foot[2]);
            assert!(if *contact == 1 { height_m < 0.0151 } else { height_m > 0.0149 }, "{height_m}");
        }
    }
}

#[test]
fn torques_velocities_and_work_fit_each_other_and_the_motors() {
    let (_, json) = recorded(&[], Mover::Prior);
    let largest =
        |column: &str| rows(&json[column]).iter().flat_map(rows).map(number).map(f64::abs).fold(0.0, f64::max);
    assert!((0.5..=4.2).contains(&largest("torque_nm")), "{}", largest("torque_nm"));
    assert!((1.0..100.0).contains(&largest("motor_velocity_rad_per_s")));
    // |torque x velocity| at the end of each step, over the time, is roughly the work that was measured on the way.
    let power = |step: usize| {
        let of_motor = |motor: usize| {
            let [torque, velocity] =
                ["torque_nm", "motor_velocity_rad_per_s"].map(|column| number(&json[column][step][motor]));
            (torque * velocity).abs()
        };
        (0..8).map(of_motor).sum::<f64>()
    };
    let steps = rows(&json["work_j"]).len();
    let sampled_j: f64 = (0..steps).map(|step| power(step) * 0.01).sum();
    let work_j: f64 = rows(&json["work_j"]).iter().map(number).sum();
    assert!((sampled_j / work_j - 1.0).abs() < 0.2, "{sampled_j} J sampled, {work_j} J measured");
}

#[test]
fn an_episode_that_ends_early_says_why() {
    let lie_down = [1.0, -0.7, 1.0, -1.0, 1.0, -1.0, 1.0, -0.7];
    let (_, json) = recorded(&[("policy.modulation", "direct")], Mover::Constant(&lie_down));
    assert_eq!(json["terminated"], "too_low");
    let steps = rows(&json["time_s"]).len();
    assert!((1..100).contains(&steps), "{steps}");
    assert!(number(&json["position_m"][steps - 1][2]) < 0.1);
}

#[test]
fn what_a_verdict_compares_is_recorded_once_each_with_the_same_bytes_every_time() {
    let trainer = common::trained(&[], 1);
    let file = PolicyFile::of(&trainer);
    let Resolved { config, task } = trainer.resolved();
    let record = |prior: &str, num_threads| {
        record_all(task, prior, Some(&file.policy()), &config.evaluation, &common::workers(num_threads))
    };
    let labels = |trajectories: &[Trajectory]| -> Vec<(String, String)> {
        trajectories.iter().map(|trajectory| (trajectory.name.clone(), trajectory.label.clone())).collect()
    };
    let pair = |name: &str, label: &str| (name.to_owned(), label.to_owned());
    let trajectories = record("sine", 2);
    let expected = [
        pair("learned", "learned gait"),
        pair("stepping", "stepping (default)"),
        pair("sine", "sine (prior, default)"),
    ];
    assert_eq!(labels(&trajectories), expected);
    let expected = [
        pair("learned", "learned gait"),
        pair("stepping", "stepping (default)"),
        pair("sine", "sine (default)"),
        pair("sine-literal", "sine-literal (prior)"),
    ];
    assert_eq!(labels(&record("sine-literal", 2)), expected);

    let folder = TemporaryFolder::new();
    let directory = RunDirectory::create(Some(&folder.join("run")), "tiny", &config.clone()).unwrap();
    let bytes = |trajectories: &[Trajectory]| -> Vec<Vec<u8>> {
        let write = |trajectory: &Trajectory| {
            write_trajectory(&directory.path().join("trajectories"), trajectory).unwrap();
            fs::read(directory.path().join(format!("trajectories/{}.json", trajectory.name))).unwrap()
        };
        trajectories.iter().map(write).collect()
    };
    let first = bytes(&trajectories);
    assert!(first == bytes(&record("sine", 1)));
    assert!(first[0] != first[2]);
    assert_eq!(names(&folder.join("run/trajectories")), ["learned.json", "sine.json", "stepping.json"]);
    // 2 s, so 10 s stay below 1 MB.
    assert!(first.iter().all(|bytes| (50_000..200_000).contains(&bytes.len())));
    // What a killed process left is removed.
    fs::write(folder.join("run/trajectories/sine.json.tmp"), b"half").unwrap();
    drop(directory);
    drop(RunDirectory::open(&folder.join("run")).unwrap());
    assert_eq!(names(&folder.join("run/trajectories")), ["learned.json", "sine.json", "stepping.json"]);
}

#[test]
fn numbers_are_written_with_four_digits_and_without_a_negative_zero() {
    use canter_train::trajectory::Rounded;
    let written = |value: f64| serde_json::to_string(&Rounded(value)).unwrap();
    assert_eq!(written(0.123_45 + 1e-9), "0.1235");
    assert_eq!(written(-2.5), "-2.5");
    assert_eq!(written(-0.000_04), "0.0");
    assert_eq!(written(1e-5), "0.0");
}

#[test]
fn on_uneven_ground_the_height_below_the_feet_is_recorded() {
    let recorded = |ground: &[(&str, &str)]| {
        let resolved = common::tiny(ground);
        record(&resolved.task, Mover::Prior, &resolved.config.evaluation, "sine", "sine")
    };
    let flat = recorded(&[]);
    assert!(flat.steps.foot_ground_m.is_empty());
    let rough = recorded(&[("task.ground.roughness", "0.2")]).steps;
    assert_eq!(rough.foot_ground_m.len(), rough.time_s.len());
    let heights = || rough.foot_ground_m.iter().flatten().map(|height| height.0);
    // At most 0.2 of 0.17 m.
    assert!(heights().all(|height| (0.0..=0.034_001).contains(&height)));
    assert!(heights().any(|height| height > 0.01));
    for step in 0..rough.time_s.len() {
        for leg in (0..4).filter(|&leg| rough.contact[step][leg] == 1) {
            let above = rough.foot_m[step][leg][2].0 - rough.foot_ground_m[step][leg].0;
            // The foot's radius is 15 mm, of which a landing takes some; beside a bump its centre is a little higher above the ground straight below.
            assert!(
                (0.005..0.025).contains(&above),
                "{above} in step {step} under leg {leg}, {:?}",
                rough.foot_m[step][leg]
            );
        }
    }
}
