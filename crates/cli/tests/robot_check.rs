//! Faulty robots: `canter robot check` names each fault and the line where it is written.

mod common;

use std::fs;
use std::path::Path;

use common::{TemporaryFolder, for_each};
use serde_json::Value;

/// A copy of a robot with one fault.
struct Faulty {
    robot: &'static str,
    /// Whether the fault is in the model; else in robot.toml.
    is_in_model: bool,
    /// What is written there (the first time), and what instead.
    change: [&'static str; 2],
    fault: &'static str,
    /// What the line of the finding has in it, and whether that is in the model.
    at: (&'static str, bool),
}

const fn model(change: [&'static str; 2], fault: &'static str, at: &'static str) -> Faulty {
    Faulty { robot: "quad12", is_in_model: true, change, fault, at: (at, true) }
}

const fn settings(change: [&'static str; 2], fault: &'static str, at: &'static str) -> Faulty {
    Faulty { robot: "quad12", is_in_model: false, change, fault, at: (at, false) }
}

const FAULTY: &[Faulty] = &[
    // Masses and inertias.
    model(
        [
            "<joint name=\"front_left_knee\" class=\"motor\"/>",
            "<joint name=\"front_left_knee\" class=\"motor\"/>\n<inertial pos=\"0 0 0\" mass=\"0.12\" diaginertia=\"1 1 1\"/>",
        ],
        "placeholder-inertia",
        "diaginertia=\"1 1 1\"",
    ),
    model(
        [
            "<freejoint name=\"root\"/>",
            "<freejoint name=\"root\"/>\n<inertial pos=\"0 0 0\" mass=\"2.6\" diaginertia=\"1e-6 1e-6 1e-6\"/>",
        ],
        "placeholder-inertia",
        "diaginertia=\"1e-6",
    ),
    model(["mass=\"0.03\"", "mass=\"0.3\""], "unequal-sides", "<body name=\"front_left_upper\""),
    // Actuators.
    model([" actuatorfrcrange=\"-17 17\"", ""], "no-torque-limit", "<joint name=\"back_left_knee\""),
    model(
        ["<position name=\"front_left_knee\"", "<motor name=\"front_left_knee\""],
        "torque-actuator",
        "<motor name=\"front_left_knee\"",
    ),
    model(["kp=\"40\" kv=\"0.8\"", "kp=\"40000\" kv=\"0\""], "gains-oscillate", "kp=\"40000\""),
    model(["kp=\"40\"", "kp=\"4\""], "gains-too-soft", "kp=\"4\""),
    settings(["max_torque_nm = 17.0", "max_torque_nm = 1.7"], "motors-too-weak", "max_torque_nm = 1.7"),
    settings(["max_torque_nm = 17.0", "max_torque_nm = 170.0"], "torque-limits-differ", "max_torque_nm = 170.0"),
    settings(["stall_torque_nm = 36.0", "stall_torque_nm = 3.6"], "stall-torque", "stall_torque_nm = 3.6"),
    // The standing pose.
    model(
        ["<geom name=\"body\" type=\"box\"", "<geom name=\"body\" pos=\"1.5 0 0.1\" type=\"box\""],
        "does-not-stand",
        "stance_height_m",
    ),
    model(
        [
            "<geom name=\"back_left_foot\" type=\"sphere\" size=\"0.02\"",
            "<geom name=\"back_left_foot\" type=\"sphere\" size=\"0.005\"",
        ],
        "foot-in-the-air",
        "size=\"0.005\"",
    ),
    model(
        ["mass=\"0.03\" conaffinity=\"1\"", "mass=\"0.03\" conaffinity=\"0\""],
        "foot-cannot-touch",
        "mass=\"0.03\" conaffinity=\"0\"",
    ),
    model(
        [
            "<joint name=\"back_right_knee\" class=\"motor\"/>",
            "<joint name=\"back_right_knee\" class=\"motor\" range=\"0.2 2\"/>",
        ],
        "pose-beyond-stops",
        "range=\"0.2 2\"",
    ),
    model(
        [
            "<freejoint name=\"root\"/>",
            "<freejoint name=\"root\"/>\n<geom name=\"skid\" type=\"capsule\" size=\"0.02\" fromto=\"0 0 0 0 0 -0.32\" mass=\"0.01\" conaffinity=\"1\"/>",
        ],
        "stands-on-something-else",
        "name=\"skid\"",
    ),
    settings(["min_height_m = 0.114", "min_height_m = 0.3"], "falls-by-definition", "min_height_m = 0.3"),
    // The world.
    model(["gravity=\"0 0 -9.81\"", "gravity=\"0 0 -1.62\""], "gravity", "gravity=\"0 0 -1.62\""),
    model(["friction=\"0.8 ", "friction=\"0.1 "], "slippery-foot", "friction=\"0.1 "),
    // The gaits.
    settings(["footfall = \"trot\"", "footfall = \"pronk\""], "gait-falls", "name = \"trot\""),
    Faulty {
        robot: "doggo",
        is_in_model: false,
        change: ["extension_phase_cycles = 0.75", "extension_phase_cycles = 0.25"],
        fault: "gait-walks-backward",
        at: ("name = \"sine\"", false),
    },
    settings(["default = true", "default = false"], "no-default-gait", "[[gaits]]"),
    // What cannot be loaded.
    model(
        ["<joint name=\"front_left_knee\" class=\"motor\"/>", "<joint name=\"front_left_knee\" class=\"motr\"/>"],
        "cannot-load",
        "class=\"motr\"",
    ),
    model(
        ["<worldbody>", "<asset><mesh name=\"m\" file=\"../../etc/passwd\"/></asset>\n<worldbody>"],
        "cannot-load",
        "../../etc/passwd",
    ),
    settings(["foot = \"back_left_foot\"", "foot = \"back_left_toe\""], "cannot-load", "back_left_toe"),
    settings(["lower_link_m = 0.2", "lower_link_m = 0.18"], "cannot-load", "upper_link_m = 0.2"),
];

fn copy_robot(name: &str, folder: &Path) -> [String; 2] {
    fs::create_dir_all(folder).unwrap();
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(name);
    [format!("{name}.xml"), "robot.toml".to_owned()].map(|file| fs::read_to_string(from.join(file)).unwrap())
}

fn findings(folder: &TemporaryFolder, path: &str) -> Vec<Value> {
    let found = folder.canter(&["robot", "check", path, "--json", "--episodes", "2", "--threads", "1"]);
    let json: Value = serde_json::from_str(&found.stdout).unwrap_or_else(|error| panic!("{error}: {found:?}"));
    let findings = json["findings"].as_array().unwrap().clone();
    let has_error = findings.iter().any(|finding| finding["severity"] == "error");
    assert_eq!(found.code, Some(i32::from(has_error)), "{found:?}");
    findings
}

#[test]
fn every_fault_is_named_with_its_line() {
    assert!(FAULTY.len() >= 20);
    for_each(FAULTY, |faulty| {
        let folder = TemporaryFolder::new();
        let robot = folder.join("robot");
        let mut texts = copy_robot(faulty.robot, &robot);
        let text = &mut texts[usize::from(!faulty.is_in_model)];
        let [old, new] = faulty.change;
        assert!(text.contains(old), "{}: {old}", faulty.fault);
        *text = text.replacen(old, new, 1);
        let model = format!("{}.xml", faulty.robot);
        fs::write(robot.join(&model), &texts[0]).unwrap();
        fs::write(robot.join("robot.toml"), &texts[1]).unwrap();
        let (marker, is_in_model) = faulty.at;
        let (marked, file) = if marker == "stance_height_m" || !is_in_model {
            (&texts[1], "robot.toml".to_owned())
        } else {
            (&texts[0], model)
        };
        let line = 1 + marked.lines().position(|line| line.contains(marker)).unwrap();
        let found = findings(&folder, "robot/robot.toml");
        let is_named = found.iter().any(|finding| {
            finding["fault"] == faulty.fault
                && finding["line"] == line
                && finding["file"].as_str().unwrap().ends_with(&file)
                && !finding["message"].as_str().unwrap().is_empty()
        });
        if is_named {
            return Ok(());
        }
        let shown: Vec<String> =
            found.iter().map(|f| format!("{}:{}: {}: {}", f["file"], f["line"], f["fault"], f["message"])).collect();
        Err(format!("{} at {file}:{line}\n  {}", faulty.fault, shown.join("\n  ")))
    });
}

/// What PyBullet's Minitaur has, in a robot of our own: every inertia is 1, which Bullet replaces and MuJoCo believes.
const URDF: &str = r#"<?xml version="1.0"?>
<robot name="stool">
  <link name="trunk">
    <inertial><mass value="3"/><inertia ixx="1.0" iyy="1.0" izz="1.0" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>
  </link>
  <link name="leg">
    <inertial><mass value="0.2"/>
      <inertia ixx="1.0" iyy="1.0" izz="1.0" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <joint name="hip" type="revolute">
    <parent link="trunk"/><child link="leg"/><origin xyz="0.2 0.1 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="0" velocity="0"/>
  </joint>
</robot>
"#;

#[test]
fn a_urdf_with_placeholders_is_caught() {
    let folder = TemporaryFolder::new();
    fs::write(folder.join("stool.urdf"), URDF).unwrap();
    let found = findings(&folder, "stool.urdf");
    let has = |fault: &str, line: u64| found.iter().any(|finding| finding["fault"] == fault && finding["line"] == line);
    assert!(has("placeholder-inertia", 9) && has("no-torque-limit", 12) && has("no-free-joint", 2), "{found:?}");
}

#[test]
fn nothing_is_wrong_with_our_own_robots() {
    let folder = TemporaryFolder::new();
    for_each(&["doggo", "minitaur", "q8bot", "quad12", "hexapod", "octopod"], |robot| {
        let found = findings(&folder, robot);
        if found.is_empty() { Ok(()) } else { Err(format!("{robot}: {found:?}")) }
    });
    let text = folder.canter(&["robot", "check", "octopod", "--episodes", "2", "--threads", "1"]).succeeded();
    assert!(text.contains("\nStanding: sinks 0.0") && text.ends_with("Nothing is wrong.\n"), "{text}");
}
