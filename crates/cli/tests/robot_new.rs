//! A model becomes a robot that walks: `canter robot new`.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{TemporaryFolder, for_each, names};
use serde_json::Value;

fn model_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(name).join(format!("{name}.xml"))
}

/// Speed [m/s] and falls of the first default gait.
fn walk(folder: &TemporaryFolder, robot: &str) -> (f64, u64) {
    let text = folder.canter(&["robot", "check", robot, "--json", "--threads", "1"]).succeeded();
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["findings"], Value::Array(Vec::new()), "{robot}");
    let gait = json["gaits"].as_object().unwrap().values().next().unwrap();
    (gait["speed_m_per_s"].as_f64().unwrap(), gait["falls"].as_u64().unwrap())
}

#[test]
fn our_own_models_walk_again() {
    let folder = TemporaryFolder::new();
    for_each(&["doggo", "minitaur", "q8bot", "quad12", "hexapod", "octopod"], |name| {
        let from = model_of(name);
        let said = folder.canter(&["robot", "new", "--from", from.to_str().unwrap(), "--out", name, "--threads", "1"]);
        let said = said.succeeded();
        assert!(said.contains("motor.stall_torque_nm: no model says it"), "{said}");
        // They have ground and stand: nothing is added.
        assert_eq!(names(&folder.join(name)), [format!("{name}.xml"), "robot.toml".to_owned()]);
        let text = fs::read_to_string(folder.join(name).join("robot.toml")).unwrap();
        assert!(
            text.contains("\n# - motor.no_load_speed_rad_per_s: ") && text.contains("\n# Torque at the current limit")
        );
        let (speed, falls) = walk(&folder, &format!("{name}/robot.toml"));
        if speed > 0.2 && falls == 0 { Ok(()) } else { Err(format!("{name}: {speed} m/s, {falls} falls")) }
    });
}

/// The legs of a drafted quad12 are those that we wrote by hand.
#[test]
fn a_draft_has_the_numbers_of_the_model() {
    let folder = TemporaryFolder::new();
    let from = model_of("quad12");
    folder.canter(&["robot", "new", "--from", from.to_str().unwrap(), "--out", "r", "--name", "rex"]).succeeded();
    let drafted: toml::Table = fs::read_to_string(folder.join("r/robot.toml")).unwrap().parse().unwrap();
    let ours: toml::Table = fs::read_to_string(from.with_file_name("robot.toml")).unwrap().parse().unwrap();
    for key in ["body", "floor", "stance_height_m", "legs"] {
        assert_eq!(drafted[key], ours[key], "{key}");
    }
    let held = |robot: &toml::Table| {
        let mut held: Vec<String> = robot["held"].as_array().unwrap().iter().map(ToString::to_string).collect();
        held.sort();
        held
    };
    assert_eq!(held(&drafted), held(&ours));
    assert_eq!(drafted["name"].as_str(), Some("rex"));
}

/// As models of MuJoCo Menagerie and others are: no ground, torque motors, feet without names, a pose with bent knees.
#[test]
fn a_model_without_ground_and_servos_walks_too() {
    let folder = TemporaryFolder::new();
    fs::create_dir(folder.join("m")).unwrap();
    let mut text = fs::read_to_string(model_of("quad12")).unwrap();
    let floor = text.lines().find(|line| line.contains("name=\"floor\"")).unwrap().to_owned();
    text = text.replace(&floor, "");
    text = text
        .replace("<position kp=\"40\" kv=\"0.8\"/>", "<motor ctrlrange=\"-17 17\"/>")
        .replace("<position name", "<motor name");
    text = text.replace("<geom name=\"back_left_foot\"", "<geom");
    // Standing a little further back than its feet.
    let pose = "0 -0.15 0.1";
    let legs = [pose; 4].join(" ");
    let key = format!("<keyframe><key name=\"home\" qpos=\"0 0 0.3 1 0 0 0 {legs}\"/></keyframe>\n</mujoco>");
    text = text.replace("</mujoco>", &key);
    fs::write(folder.join("m/bare & \"1\".xml"), &text).unwrap();
    let said = folder.canter(&["robot", "new", "--from", "m/bare & \"1\".xml"]).succeeded();
    for words in [
        "Wrote:    m/robot.toml",
        "Wrote:    m/bare & \"1\"_scene.xml",
        "motor.position_gain_nm_per_rad: ",
        "keyframe: the model has no pose",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // The model is as it was.
    assert_eq!(fs::read_to_string(folder.join("m/bare & \"1\".xml")).unwrap(), text);
    let (speed, falls) = walk(&folder, "m/robot.toml");
    assert!(speed > 0.2 && falls == 0, "{speed} m/s, {falls} falls");
    // Names of files may be what names of robots may not.
    assert!(fs::read_to_string(folder.join("m/robot.toml")).unwrap().contains("\nname = \"bare____1_\"\n"));
    let refused = folder.canter(&["robot", "new", "--from", "m/bare & \"1\".xml", "--name", "a*/"]).failed_with(2);
    assert!(refused.contains("use letters, digits, `-` and `_` only"), "{refused}");
    // Nothing that is there is written over.
    let refused = folder.canter(&["robot", "new", "--from", "m/bare & \"1\".xml"]).failed_with(1);
    assert!(refused.contains("m/robot.toml is there already"), "{refused}");
}

#[test]
fn what_is_no_robot_is_refused_with_reasons() {
    let folder = TemporaryFolder::new();
    let cases = [
        (
            "fixed",
            "<worldbody><body name='a'><joint axis='0 1 0'/><geom size='0.1'/></body></worldbody>",
            "no body with a free joint",
        ),
        ("ball", "<worldbody><body name='a'><freejoint/><geom size='0.1'/></body></worldbody>", "found 0 legs"),
        ("bad", "<worldbody><bodi/></worldbody>", "MuJoCo cannot load this model"),
    ];
    for (name, content, words) in cases {
        let path = format!("{name}.xml");
        fs::write(folder.join(&path), format!("<mujoco>{content}</mujoco>")).unwrap();
        let refused = folder.canter(&["robot", "new", "--from", &path]).failed_with(1);
        assert!(refused.contains(words), "{refused}");
    }
    assert_eq!(names(folder.path()), ["bad.xml", "ball.xml", "fixed.xml"]);
}

/// A quadruped of eight motors as a URDF, with feet at fixed joints.
fn urdf() -> String {
    let inertia = |mass: f64, moment: f64| {
        format!(
            "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" iyy=\"{moment}\" izz=\"{moment}\" ixy=\"0\" \
             ixz=\"0\" iyz=\"0\"/></inertial>"
        )
    };
    let mut text = format!(
        "<robot name=\"stool\">\n<link name=\"trunk\">{}<collision><geometry><box size=\"0.4 0.2 0.1\"/></geometry>\
         </collision></link>\n",
        inertia(5.0, 0.06)
    );
    for (name, x, y) in [("fl", 0.2, 0.15), ("fr", 0.2, -0.15), ("hl", -0.2, 0.15), ("hr", -0.2, -0.15)] {
        let joint = |joint: &str, parent: &str, child: &str, place: &str| {
            format!(
                "<joint name=\"{name}_{joint}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{name}_{child}\"/>\
                 <origin xyz=\"{place}\"/><axis xyz=\"0 1 0\"/><limit lower=\"-2.5\" upper=\"2.5\" effort=\"12\" velocity=\"30\"/>\
                 <dynamics damping=\"0.2\"/></joint>\n"
            )
        };
        text += &format!("<link name=\"{name}_upper\">{}</link>\n", inertia(0.4, 0.002));
        text += &format!("<link name=\"{name}_lower\">{}</link>\n", inertia(0.1, 0.001));
        text += &format!(
            "<link name=\"{name}_toe\">{}<collision><geometry><sphere radius=\"0.02\"/></geometry></collision></link>\n",
            inertia(0.02, 1e-5)
        );
        text += &joint("hip", "trunk", "upper", &format!("{x} {y} 0"));
        text += &joint("knee", &format!("{name}_upper"), "lower", "0 0 -0.2");
        text += &format!(
            "<joint name=\"{name}_ankle\" type=\"fixed\"><parent link=\"{name}_lower\"/><child link=\"{name}_toe\"/>\
             <origin xyz=\"0 0 -0.2\"/></joint>\n"
        );
    }
    text + "</robot>\n"
}

#[test]
fn a_urdf_becomes_a_robot_that_walks() {
    let folder = TemporaryFolder::new();
    fs::write(folder.join("stool.urdf"), urdf()).unwrap();
    let said = folder.canter(&["robot", "new", "--from", "stool.urdf", "--out", "stool"]).succeeded();
    assert!(said.contains("stance_height_m: the model's pose has legs of 0.400 m"), "{said}");
    assert_eq!(names(&folder.join("stool")), ["robot.toml", "stool.urdf", "stool.xml", "stool_scene.xml"]);
    // Nothing of the trunk is lost: 5 kg and four times 0.52 kg.
    assert!(said.starts_with("stool: 7.1 kg, 4 legs, 8 motors\n"), "{said}");
    let (speed, falls) = walk(&folder, "stool/robot.toml");
    assert!(speed > 0.1 && falls == 0, "{speed} m/s, {falls} falls");
}
