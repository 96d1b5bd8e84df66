//! Broken and hostile robot files: each is refused by name, at once, and nothing is left behind.
#![cfg(unix)]

mod common;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use common::{TemporaryFolder, for_each, in_repository, names};

/// What a case does to the folder of a copy of Doggo, `robot/`.
enum Change {
    /// Replaces the first of these words in robot.toml.
    Settings(&'static str, &'static str),
    /// Replaces all of them.
    AllSettings(&'static str, &'static str),
    /// Replaces the first of these words in doggo.xml.
    Model(&'static str, &'static str),
    /// Replaces all of them.
    AllModel(&'static str, &'static str),
    /// Puts an element into the model's root, before everything else.
    Element(&'static str),
    /// Puts an element into the world.
    Body(&'static str),
    /// Anything else.
    Files(fn(&Path)),
}

use Change::{AllModel, AllSettings, Body, Element, Files, Model, Settings};

/// Changes of robot.toml, and words of the message.
const SETTINGS: &[(Change, &str)] = &[
    // TOML.
    (Settings("name = \"doggo\"", "name = \"doggo"), "robot.toml:4:14: not valid TOML"),
    (Settings("name = \"doggo\"", "name = doggo"), "robot.toml:4:8: not valid TOML"),
    (
        Settings("name = \"doggo\"", "name = \"doggo\"\nname = \"puppy\""),
        "robot.toml:5:1: not valid TOML: duplicate key",
    ),
    (Settings("[motor]", "[motor"), "not valid TOML"),
    (Settings("[limits]", "[motor]"), "not valid TOML: duplicate key"),
    (
        Settings("\"doggo\"", "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]"),
        "nested too deep",
    ),
    (Settings("\"doggo\"", "\"\\ud800\""), "robot.toml:4:"),
    // Keys.
    (Settings("description", "descripton"), "descripton = \"Stanford Doggo: 4.8 kg"),
    (
        Settings("body = \"chassis\"", "bodi = \"chassis\""),
        "bodi = \"chassis\" is not a known key: did you mean \"body\"?",
    ),
    (Settings("body = \"chassis\"\n", ""), "body is missing: expected a string"),
    (Settings("model = \"doggo.xml\"\n", ""), "model is missing: expected a string"),
    (Settings("stuck_time_s = 0.5\n", ""), "limits.stuck_time_s is missing: expected a number above 0"),
    (Settings("up_amplitude_m = 0.06\n", ""), "gaits[0].up_amplitude_m is missing"),
    (Settings("kind = \"five-bar\"\n", ""), "legs[0].kind is missing"),
    (Settings("actuated = \"leg-space\"\n", ""), "legs[0].actuated is missing"),
    (AllSettings("[[legs]]", "[[leg]]"), "legs is missing"),
    (AllSettings("[[gaits]]", "[[gait]]"), "gaits is missing"),
    (Settings("step_length_m = 0.15", "step_length_m = 0.15\nspeed = 9"), "gaits[0].speed = 9 is not a known key"),
    (Settings("name = \"doggo\"", "name = \"doggo\"\n\"\\u0000\" = 1"), "is not a known key"),
    // Types.
    (Settings("\"doggo\"", "1"), "name = 1 has the wrong type: expected a string"),
    (Settings("\"doggo\"", "[\"doggo\"]"), "name = (an array) has the wrong type: expected a string"),
    (Settings("\"doggo\"", "1979-05-27"), "name = 1979-05-27 has the wrong type: expected a string"),
    (Settings("stance_height_m = 0.17", "stance_height_m = \"0.17\""), "stance_height_m = \"0.17\" has the wrong type"),
    (Settings("command_delay_steps = 1", "command_delay_steps = 1.5"), "command_delay_steps = 1.5 has the wrong type"),
    (Settings("no_load_speed_rad_per_s = 263.5", "no_load_speed_rad_per_s = true"), "= true has the wrong type"),
    (Settings("swing_rad = [-1.2, 1.2]", "swing_rad = 1.2"), "limits.swing_rad = 1.2 has the wrong type"),
    (
        Settings("swing_rad = [-1.2, 1.2]", "swing_rad = [\"a\", \"b\"]"),
        "limits.swing_rad[0] = \"a\" has the wrong type",
    ),
    (Settings("[motor]", "[[motor]]"), "motor = (an array) has the wrong type"),
    (
        Settings("motors = [\"front_left_motor_a\", \"front_left_motor_b\"]", "motors = \"a\""),
        "legs[0].motors = \"a\" has the wrong type",
    ),
    (Settings("default = true", "default = \"yes\""), "gaits[0].default = \"yes\" has the wrong type"),
    // Numbers.
    (
        Settings("stance_height_m = 0.17", "stance_height_m = 0"),
        "stance_height_m = 0 is out of range: expected a number above 0",
    ),
    (Settings("stance_height_m = 0.17", "stance_height_m = -0.17"), "stance_height_m = -0.17 is out of range"),
    (Settings("stance_height_m = 0.17", "stance_height_m = nan"), "stance_height_m = nan is not finite"),
    (Settings("stance_height_m = 0.17", "stance_height_m = inf"), "stance_height_m = inf is not finite"),
    (Settings("stance_height_m = 0.17", "stance_height_m = 1e400"), "stance_height_m = 1e400 is not finite"),
    (Settings("stance_height_m = 0.17", "stance_height_m = 1e-300"), "cannot stand at stance_height_m = "),
    (Settings("command_delay_steps = 1", "command_delay_steps = 11"), "command_delay_steps = 11 is out of range"),
    (Settings("command_delay_steps = 1", "command_delay_steps = -1"), "command_delay_steps = -1 is out of range"),
    (Settings("command_delay_steps = 1", "command_delay_steps = 99999999999999999999"), "is out of range"),
    (
        Settings("command_delay_steps = 1", "command_delay_steps = 999999999999999999999999999999999999999999"),
        "is too long: expected an integer of 64 bits",
    ),
    (Settings("max_torque_nm = 4.2", "max_torque_nm = 0.0"), "motor.max_torque_nm = 0.0 is out of range"),
    (Settings("stall_torque_nm = 35.9", "stall_torque_nm = nan"), "motor.stall_torque_nm = nan is not finite"),
    (Settings("min_height_m = 0.10", "min_height_m = 11"), "limits.min_height_m = 11 is out of range"),
    (Settings("max_tilt_deg = 60.0", "max_tilt_deg = 180"), "limits.max_tilt_deg = 180 is out of range"),
    (Settings("stuck_error_rad = 1.0", "stuck_error_rad = -1.0"), "limits.stuck_error_rad = -1.0 is out of range"),
    (Settings("swing_rad = [-1.2, 1.2]", "swing_rad = []"), "expected a least and a greatest value around 0"),
    (Settings("swing_rad = [-1.2, 1.2]", "swing_rad = [1.2, -1.2]"), "expected a least and a greatest value around 0"),
    (
        Settings("swing_rad = [-1.2, 1.2]", "swing_rad = [-1.2, 0, 1.2]"),
        "expected a least and a greatest value around 0",
    ),
    (Settings("extension_rad = [-1.3129", "extension_rad = [-5"), "limits.extension_rad[0] = -5 is out of range"),
    (Settings("extension_rad = [-1.3129", "extension_rad = [0.1"), "expected a least and a greatest value around 0"),
    (Settings("extension_rad = [-1.3129", "extension_rad = [nan"), "limits.extension_rad[0] = nan is not finite"),
    (
        Settings("stride_frequency_hz = 2.0", "stride_frequency_hz = 0"),
        "gaits[0].stride_frequency_hz = 0 is out of range",
    ),
    (
        Settings("stride_frequency_hz = 2.0", "stride_frequency_hz = 21"),
        "gaits[0].stride_frequency_hz = 21 is out of range",
    ),
    (Settings("flight_fraction = 0.35", "flight_fraction = 1"), "gaits[0].flight_fraction = 1 is out of range"),
    (Settings("step_length_m = 0.15", "step_length_m = 0"), "gaits[0].step_length_m = 0 is out of range"),
    (
        Settings("swing_amplitude_rad = 0.415", "swing_amplitude_rad = 2"),
        "gaits[1].swing_amplitude_rad = 2 is out of range",
    ),
    (
        Settings("extension_phase_cycles = 0.75", "extension_phase_cycles = -0.1"),
        "gaits[1].extension_phase_cycles = -0.1",
    ),
    (Settings("step_length_m = 0.15", "step_length_m = 1.5"), "gaits[0] = (a table) is refused: a leg cannot reach"),
    // Links that the model does not have.
    (Settings("upper_link_m = 0.09", "upper_link_m = 0"), "legs[0].upper_link_m = 0 is out of range"),
    (Settings("upper_link_m = 0.09", "upper_link_m = 1e300"), "links of these lengths cannot stand at stance_height_m"),
    (Settings("upper_link_m = 0.09", "upper_link_m = 10"), "links of these lengths cannot stand at stance_height_m"),
    (Settings("upper_link_m = 0.09", "upper_link_m = 0.1"), "foot does not move as link lengths"),
    (Settings("lower_link_m = 0.162", "lower_link_m = inf"), "legs[0].lower_link_m = inf is not finite"),
    (
        Settings("lower_link_m = 0.162", "lower_link_m = 1e-300"),
        "links of these lengths cannot stand at stance_height_m",
    ),
    (AllSettings("stance_height_m = 0.17", "stance_height_m = 0.2"), "foot does not move as link lengths"),
    // Names that the model does not have, or has for something else.
    (
        Settings("body = \"chassis\"", "body = \"trunk\""),
        "body = \"trunk\" is refused: the model has no body called `trunk`",
    ),
    (Settings("body = \"chassis\"", "body = \"world\""), "this body has no free joint: it cannot walk away"),
    (Settings("body = \"chassis\"", "body = \"front_left_upper_a\""), "this body has no free joint"),
    (Settings("floor = \"floor\"", "floor = \"ground\""), "the model has no geom called `ground`"),
    (Settings("floor = \"floor\"", "floor = \"chassis\""), "expected a plane at z = 0 of the world"),
    (Settings("foot = \"front_left_foot\"", "foot = \"\""), "the model has no geom called ``"),
    (Settings("foot = \"front_left_foot\"", "foot = \"front_left_foot\\u0000\""), "the model has no geom called"),
    (
        Settings("foot = \"front_left_foot\"", "foot = \"chassis\""),
        "legs[0].foot = \"chassis\" is refused: expected a sphere",
    ),
    (
        Settings("foot = \"back_left_foot\"", "foot = \"front_left_foot\""),
        "legs[1].foot = \"front_left_foot\" is refused: this geom is named already",
    ),
    (
        Settings("motors = [\"front_left_motor_a\", ", "motors = ["),
        "legs[0].motors = (an array) is refused: expected 2 names, found 1",
    ),
    (Settings("motors = [", "motors = [\"root\", "), "expected 2 names, found 3"),
    (
        Settings("motors = [\"front_left_motor_a\"", "motors = [\"hip\""),
        "legs[0].motors[0] = \"hip\" is refused: the model has no joint",
    ),
    (
        Settings("motors = [\"front_left_motor_a\"", "motors = [\"root\""),
        "legs[0].motors[0] = \"root\" is refused: expected a hinge",
    ),
    (Settings("motors = [\"back_left_motor_a\"", "motors = [\"front_left_motor_a\""), "this joint is named already"),
    (Settings("knees = [\"front_left_knee_a\"", "knees = [\"elbow\""), "legs[0].knees[0] = \"elbow\" is refused"),
    (Settings("knees = [\"front_left_knee_a\"", "knees = [\"front_left_motor_a\""), "this joint is named already"),
    (
        Settings("actuators = [\"front_left_swing\"", "actuators = [\"swing\""),
        "the model has no actuator called `swing`",
    ),
    (
        Settings("actuators = [\"back_left_swing\"", "actuators = [\"front_left_swing\""),
        "this actuator is named already",
    ),
    (Settings("actuated = \"leg-space\"", "actuated = \"leg space\""), "did you mean \"leg-space\"?"),
    (Settings("kind = \"five-bar\"", "kind = \"four-bar\""), "legs[0].kind = \"four-bar\" is not a known choice"),
    // Legs and gaits.
    (
        Settings("name = \"back_left\"", "name = \"front_left\""),
        "legs[1].name = \"front_left\" is refused: another leg has this name",
    ),
    (Files(|robot| change(robot, "robot.toml", without_the_first_leg)), "for 3 legs there are `custom`"),
    (
        Files(|robot| change(robot, "robot.toml", twice_the_first_leg)),
        "legs[1].foot = \"front_left_foot\" is refused: this geom is named already",
    ),
    (Settings("kind = \"stepping\"", "kind = \"steping\""), "did you mean \"stepping\"?"),
    (Settings("footfall = \"trot\"", "footfall = \"trott\""), "gaits[0].footfall = \"trott\" is not a known choice"),
    (
        Settings("name = \"sine\"", "name = \"stepping\""),
        "gaits[1].name = \"stepping\" is refused: another gait has this name",
    ),
    (
        Settings("name = \"doggo\"", "name = \"*/ doggo\""),
        "name = \"*/ doggo\" is refused: files are named after robots",
    ),
    (Settings("name = \"sine\"", "name = \"../sine\""), "files are named after gaits"),
    (Settings("name = \"sine\"", "name = \"learned\""), "this name is what training makes of a gait"),
    (
        Files(|robot| change(robot, "robot.toml", without_gaits)),
        "gaits = (an array) is refused: expected one gait at least",
    ),
    // The model's name.
    (
        Settings("\"doggo.xml\"", "\"\""),
        "robot/: expected the name of a model's file to end in one of .xml, .mjcf, .urdf",
    ),
    (Settings("\"doggo.xml\"", "\"doggy.xml\""), "robot/doggy.xml: cannot be read: No such file"),
    (Settings("\"doggo.xml\"", "\"do\\u0000ggo.xml\""), "cannot be read"),
    (Settings("\"doggo.xml\"", "\"robot.toml\""), "robot/robot.toml: expected the name of a model's file to end"),
    (Settings("\"doggo.xml\"", "\"/dev/zero\""), "/dev/zero: this model is outside the robot's folder"),
    (Settings("\"doggo.xml\"", "\"/etc/passwd\""), "/etc/passwd: this model is outside the robot's folder"),
    (Settings("\"doggo.xml\"", "\"..\""), "this model is outside the robot's folder"),
    // The file itself.
    (Files(|robot| write(robot, "robot.toml", b"")), "robot.toml:1:1: name is missing"),
    (Files(|robot| write(robot, "robot.toml", b"\0\0\0\0")), "not valid TOML"),
    (
        Files(|robot| write(robot, "robot.toml", b"name = \"\xff\"")),
        "not UTF-8: the byte at offset 8 belongs to no character",
    ),
    (Files(|robot| write(robot, "robot.toml", &[b'#'; 2 << 20])), "file too large: expected at most 1048576 bytes"),
    (
        Files(|robot| instead(robot, "robot.toml", |path| fs::create_dir(path).unwrap())),
        "this is a folder; expected a file",
    ),
    (Files(|robot| instead(robot, "robot.toml", pipe)), "this is a pipe or a device; expected a file"),
    (
        Files(|robot| instead(robot, "robot.toml", |path| symlink("/dev/zero", path).unwrap())),
        "this is a pipe or a device",
    ),
    (Files(|robot| instead(robot, "robot.toml", |path| symlink("robot.toml", path).unwrap())), "cannot be read: "),
];

/// Changes of the model and the files around it, and words of the message.
const MODELS: &[(Change, &str)] = &[
    // XML.
    (Model("</mujoco>", ""), "not well-formed XML: the root node was opened but never closed"),
    (Model("<mujoco model=", "<robot model="), "not well-formed XML: expected 'robot' tag, not 'mujoco'"),
    (Model("<worldbody>", "<worldbody"), "this tag or comment has no end"),
    (Model("<worldbody>", "<worldbody> <!-- "), "not well-formed XML"),
    (Model("type=\"plane\"", "type=\"plane\" type=\"box\""), "attribute 'type' at"),
    (Model("type=\"plane\"", "type=plane"), "not well-formed XML"),
    (Model("type=\"plane\"", "type=\"pl&ne;\""), "not well-formed XML: unknown entity reference 'ne'"),
    (Model("type=\"plane\"", "type=\"p\0ane\""), "a non-XML character"),
    (Element("<!DOCTYPE a [<!ENTITY b \"bb\">]>"), "document types and entities are refused"),
    (Files(billion_laughs), "doggo.xml:1: document types and entities are refused"),
    (
        Files(|robot| write(robot, "doggo.xml", &[b"<body>".repeat(100_000), b"</body>".repeat(100_000)].concat())),
        "expected at most 64 elements inside each other",
    ),
    (
        Files(|robot| {
            change(robot, "doggo.xml", |text| {
                text.replace("<worldbody>", &format!("<worldbody>{}", "<geom/>".repeat(20_001)))
            });
        }),
        "expected at most 20000 elements",
    ),
    (
        Files(|robot| {
            change(robot, "doggo.xml", |text| {
                text.replace("type=\"plane\"", &(0..1000).map(|i| format!(" a{i}=\"\"")).collect::<String>())
            });
        }),
        "expected at most 256 attributes",
    ),
    (
        Files(|robot| write(robot, "doggo.xml", b"<mujoco model=\"\xff\"/>")),
        "not UTF-8: the byte at offset 15 belongs to no character",
    ),
    (Files(|robot| write(robot, "doggo.xml", b"\xff\xfe<\0m\0/\0>\0")), "not UTF-8: the byte at offset 0"),
    (Files(|robot| write(robot, "doggo.xml", b"")), "not well-formed XML: the document does not have a root node"),
    (Files(|robot| write(robot, "doggo.xml", b"\n \n")), "not well-formed XML: the document does not have a root node"),
    (Files(|robot| write(robot, "doggo.xml", b"name = \"doggo\"")), "doggo.xml:1: not well-formed XML"),
    (Files(|robot| write(robot, "doggo.xml", &[b' '; 17 << 20])), "doggo.xml: too large: expected at most 16 MiB"),
    (Files(|robot| write(robot, "doggo.xml", b"<mujoco/>")), "the model has no body called `chassis`"),
    (Files(|robot| write(robot, "doggo.xml", b"<sdf/>")), "Unrecognized XML model type: 'sdf'"),
    (Files(|robot| write(robot, "doggo.xml", b"<robot name=\"a\"/>")), "the model has no body called `chassis`"),
    // The file itself.
    (
        Files(|robot| instead(robot, "doggo.xml", |path| fs::create_dir(path).unwrap())),
        "doggo.xml: cannot be read: this is a folder",
    ),
    (Files(|robot| instead(robot, "doggo.xml", pipe)), "doggo.xml: cannot be read: this is a pipe or a device"),
    (
        Files(|robot| instead(robot, "doggo.xml", |path| symlink("/dev/zero", path).unwrap())),
        "this model is outside the robot's folder",
    ),
    (
        Files(|robot| instead(robot, "doggo.xml", |path| symlink("../outside.xml", path).unwrap())),
        "this model is outside the robot's folder",
    ),
    (
        Files(|robot| instead(robot, "doggo.xml", |path| symlink("doggo.xml", path).unwrap())),
        "doggo.xml: cannot be read",
    ),
    // MJCF.
    (AllModel("mujoco", "mojoco"), "Unrecognized XML model type: 'mojoco'"),
    (Body("<gem/>"), "unrecognized element"),
    (Body("<geom type=\"blob\" size=\"1\"/>"), "invalid keyword: 'blob'"),
    (Body("<geom name=\"floor\" size=\"1\"/>"), "repeated name 'floor' in geom"),
    (Body("<body name=\"chassis\"/>"), "repeated name 'chassis' in body"),
    (Model("<freejoint name=\"root\"/>", "<freejoint name=\"root\" speed=\"1\"/>"), "unrecognized attribute: 'speed'"),
    (Files(|robot| change(robot, "doggo.xml", without_free_joint)), "this body has no free joint: it cannot walk away"),
    (
        Model("<joint name=\"front_left_knee_a\" class=\"knee\"/>", "<freejoint name=\"front_left_knee_a\"/>"),
        "free joint can only be used on top level",
    ),
    (Model("mass=\"1.7064\"", "mass=\"-1\""), "mass"),
    (Model("mass=\"1.7064\"", "mass=\"nan\""), "<geom mass=\"nan\"> is not a number"),
    (Model("mass=\"1.7064\"", "mass=\"inf\""), "Element name 'chassis'"),
    (Model("mass=\"1.7064\"", "mass=\"1e400\""), "mass"),
    (Model("mass=\"1.7064\"", "mass=\"heavy\""), "bad format in attribute 'mass'"),
    (Model("size=\"0.21 0.10 0.07\"", "size=\"-0.21 0.10 0.07\""), "must be positive in geom"),
    (Model("size=\"0.21 0.10 0.07\"", "size=\"0.21\""), "must be positive in geom"),
    (Model("pos=\"0 0 0.185\"", "pos=\"nan 0 0.185\""), "<body pos=\"nan 0 0.185\"> is not a number"),
    (Model("pos=\"0 0 0.185\"", "pos=\"0 0\""), "attribute 'pos' does not have enough data"),
    (Model("axis=\"0 -1 0\"", "axis=\"0 0 0\""), "axis"),
    (Model("class=\"motor_body\"", "class=\"engine\""), "class"),
    (Model("childclass=\"robot\"", "childclass=\"cat\""), "unknown default childclass"),
    (Model("<joint joint=\"front_left_motor_a\"", "<joint joint=\"hip\""), "hip"),
    (Model("tendon=\"front_left_swing\"", "tendon=\"string\""), "string"),
    (Model("body1=\"front_left_lower_a\"", "body1=\"shin\""), "shin"),
    (Model("qpos=\"0 0 0.185", "qpos=\"0 0 0 0.185"), "qpos"),
    (Element("<extension><plugin plugin=\"mujoco.no.such\"/></extension>"), "mujoco.no.such"),
    (Body("<attach model=\"cat\" prefix=\"a\"/>"), "cat"),
    // What robot.toml says otherwise.
    (
        Model("<geom name=\"floor\" type=\"plane\"", "<geom name=\"floor\" pos=\"0 0 1\" type=\"plane\""),
        "expected a plane at z = 0",
    ),
    (Model("type=\"plane\" size=\"0 0 1\"", "type=\"box\" size=\"1 1 1\""), "expected a plane at z = 0"),
    (Model("type=\"sphere\" size=\"0.015\"", "type=\"box\" size=\"0.01 0.01 0.01\""), "expected a sphere"),
    (
        Model("<joint damping=\"0.0005\"/>", "<joint type=\"slide\" damping=\"0.0005\"/>"),
        "legs[0].knees[0] = \"front_left_knee_a\" is refused: expected a hinge",
    ),
    (
        Model("name=\"front_left_motor_a\" class", "name=\"hip\" class"),
        "joint 'front_left_motor_a' not found in tendon",
    ),
    (AllModel("front_left_motor_a", "hip"), "the model has no joint called `front_left_motor_a`"),
    (AllModel("\"back_left_foot\"", "\"paw\""), "the model has no geom called `back_left_foot`"),
    (
        Model("<body name=\"front_left_lower_a\" pos=\"0.08", "<body name=\"front_left_lower_a\" pos=\"0.09"),
        "foot does not move as link lengths",
    ),
    // Loops.
    (Model("anchor=\"-0.084256798931 0 -0.138364705882\"", "anchor=\"0 0 0\""), "loop does not close"),
    (
        Model("<connect name=\"front_left_loop\"", "<connect name=\"front_left_loop\" active=\"false\""),
        "legs[0].knees[1] = \"front_left_knee_b\" is refused: nothing in the model holds this leg's loop closed",
    ),
    (
        Files(|robot| {
            change(robot, "doggo.xml", |text| {
                text.replace("<connect name=\"back_left_loop\"", "<!-- <connect").replacen(
                    "<connect name=\"back_right",
                    "--> <connect name=\"back_right",
                    1,
                )
            });
        }),
        "legs[1].knees[1]",
    ),
    // Files outside.
    (Element("<include file=\"../outside.xml\"/>"), "<include file=\"../outside.xml\">: "),
    (Element("<include file=\"../nothing.xml\"/>"), "this file is outside the robot's folder; copy it there"),
    (Element("<include file=\"..\\outside.xml\"/>"), "outside the robot's folder"),
    (Element("<INCLUDE file=\"../outside.xml\"/>"), "outside the robot's folder"),
    (Element("<include file=\"/etc/passwd\"/>"), "/etc/passwd is outside the robot's folder"),
    (Element("<include file=\"LoadModelFromString:<mujoco/>\"/>"), "not well-formed XML"),
    (Element("<include file=\"LoadModelFromString:&lt;mujoco/>\"/>"), "there is no such file"),
    (
        Element("<asset><mesh file=\"/dev/zero\"/></asset>"),
        "doggo.xml:49: <mesh file=\"/dev/zero\">: /dev/zero is outside the robot's folder",
    ),
    (Element("<asset><mesh file=\"package://doggo/leg.stl\"/></asset>"), "outside the robot's folder; copy it there"),
    (
        Element("<asset><hfield file=\"/etc/passwd\" size=\"1 1 1 1\"/></asset>"),
        "/etc/passwd is outside the robot's folder",
    ),
    (
        Element("<asset><texture type=\"skybox\" fileleft=\"/etc/passwd\"/></asset>"),
        "<texture fileleft=\"/etc/passwd\">",
    ),
    (Element("<asset><skin file=\"/etc/passwd\"/></asset>"), "<skin file=\"/etc/passwd\">"),
    (Element("<asset><model name=\"a\" file=\"../outside.xml\"/></asset>"), "<model file=\"../outside.xml\">"),
    (Body("<flexcomp name=\"a\" type=\"mesh\" file=\"../outside.obj\"/>"), "<flexcomp file=\"../outside.obj\">"),
    (
        Files(|robot| {
            change(robot, "doggo.xml", |text| {
                text.replace("<compiler ", "<compiler meshdir=\"/etc\" ")
                    .replace("<asset>", "<asset><mesh file=\"passwd\"/>")
            });
        }),
        "/etc/passwd is outside the robot's folder",
    ),
    (
        Files(|robot| with_link(robot, "link.xml", "../outside.xml", "<include file=\"link.xml\"/>")),
        "outside.xml is outside the robot's folder",
    ),
    (
        Files(|robot| with_link(robot, "link.obj", "/etc/passwd", "<asset><mesh file=\"link.obj\"/></asset>")),
        "/etc/passwd is outside the robot's folder",
    ),
    (
        Files(|robot| with_link(robot, "link", "/etc", "<asset><mesh file=\"link/passwd\"/></asset>")),
        "/etc/passwd is outside the robot's folder",
    ),
    (
        Files(|robot| {
            with_file(
                robot,
                "a.xml",
                b"<mujoco>\n<include file=\"../outside.xml\"/></mujoco>",
                "<include file=\"a.xml\"/>",
            );
        }),
        "robot/a.xml:2: <include file=\"../outside.xml\">",
    ),
    // Files that are not there, or not what they should be.
    (Element("<include/>"), "file"),
    (Element("<include file=\"nothing.xml\"/>"), "doggo.xml:49: <include file=\"nothing.xml\">: there is no such file"),
    (Element("<asset><mesh file=\"nothing.stl\"/></asset>"), "<mesh file=\"nothing.stl\">: there is no such file"),
    (Element("<asset><mesh file=\"robot.toml\"/></asset>"), "robot.toml"),
    (Files(|robot| with_file(robot, "a.stl", b"solid nothing", "<asset><mesh file=\"a.stl\"/></asset>")), "a.stl"),
    (Files(|robot| with_file(robot, "a.stl", b"", "<asset><mesh file=\"a.stl\"/></asset>")), "a.stl"),
    (Files(|robot| with_file(robot, "a.png", b"not a picture", "<asset><texture file=\"a.png\"/></asset>")), "a.png"),
    (Files(|robot| with_file(robot, "a.xml", b"", "<include file=\"a.xml\"/>")), "robot/a.xml:1: not well-formed XML"),
    (
        Files(|robot| with_file(robot, "a.xml", b"<mujoco", "<include file=\"a.xml\"/>")),
        "robot/a.xml:1: not well-formed XML",
    ),
    (
        Files(|robot| with_file(robot, "a.mjz", b"PK", "<asset><model file=\"a.mjz\"/></asset>")),
        "robot/a.mjz: expected the name of a model's file to end in one of",
    ),
    (
        Files(|robot| {
            fs::create_dir(robot.join("a.stl")).unwrap();
            element(robot, "<asset><mesh file=\"a.stl\"/></asset>");
        }),
        "<mesh file=\"a.stl\">: cannot be read: this is a folder",
    ),
    (
        Files(|robot| {
            pipe(&robot.join("a.stl"));
            element(robot, "<asset><mesh file=\"a.stl\"/></asset>");
        }),
        "<mesh file=\"a.stl\">: cannot be read: this is a pipe or a device",
    ),
    (
        Files(|robot| {
            fs::File::create(robot.join("a.stl")).unwrap().set_len(65 << 20).unwrap();
            element(robot, "<asset><mesh file=\"a.stl\"/></asset>");
        }),
        "<mesh file=\"a.stl\">: too large: expected at most 64 MiB",
    ),
    (Files(five_large_files), "too large: expected all files of the model to have at most 256 MiB"),
    // Files that name each other.
    (Element("<include file=\"doggo.xml\"/>"), "<include file=\"doggo.xml\">: this file includes itself"),
    (Element("<include file=\"./doggo.xml\"/>"), "<include file=\"./doggo.xml\">: this file includes itself"),
    (
        Element("<asset><model name=\"a\" file=\"doggo.xml\"/></asset>"),
        "<model file=\"doggo.xml\">: this file includes itself",
    ),
    (
        Files(|robot| {
            with_file(robot, "a.xml", b"<mujoco><include file=\"doggo.xml\"/></mujoco>", "<include file=\"a.xml\"/>");
        }),
        "robot/a.xml:1: <include file=\"doggo.xml\">: this file includes itself",
    ),
    (
        Files(|robot| with_link(robot, "a.xml", "doggo.xml", "<include file=\"a.xml\"/>")),
        "<include file=\"a.xml\">: this file includes itself",
    ),
    (Files(chain_of_includes), "expected at most 16 includes inside each other"),
    (
        Files(|robot| {
            with_file(robot, "a.xml", b"<mujoco><default/></mujoco>", &"<include file=\"a.xml\"/>".repeat(1001));
        }),
        "expected at most 1000 names of files",
    ),
    // Sizes.
    (
        Body("<replicate count=\"1000000000\"><geom size=\"1\"/></replicate>"),
        "<replicate> stands for 2000000000 elements; expected at most 20000",
    ),
    (
        Body("<replicate count=\"1000\"><replicate count=\"1000\"><geom size=\"1\"/></replicate></replicate>"),
        "elements; expected at most 20000",
    ),
    (
        Body("<replicate count=\"9999999999999999999999\"><geom size=\"1\"/></replicate>"),
        "elements; expected at most 20000",
    ),
    (Body("<replicate count=\"6000\"><geom size=\"1\" contype=\"0\"/></replicate>"), "the compiled model has 60"),
    // Parts that touch each other: MuJoCo ends the process, or goes on without some of them.
    (Body("<replicate count=\"3000\"><body><geom size=\"1\"/></body></replicate>"), "mj_stackAlloc: out of memory"),
    (
        Body("<replicate count=\"1000\"><body><geom size=\"1\"/></body></replicate>"),
        "MuJoCo drops contacts or constraints",
    ),
    (Body("<composite type=\"cable\" count=\"1000000 1 1\"/>"), "<composite> stands for 1000000 elements"),
    (
        Body("<flexcomp name=\"a\" type=\"grid\" count=\"1000 1000 1000\"/>"),
        "<flexcomp> stands for 1000000000 elements",
    ),
    (Element("<size memory=\"1T\"/>"), "<size memory=\"1T\"> is out of range: expected at most 1000000000"),
    (Element("<size memory=\"99999999999999\"/>"), "<size memory=\"99999999999999\"> is out of range"),
    (Element("<size nuserdata=\"1000000000\"/>"), "<size nuserdata=\"1000000000\"> is out of range"),
    (Element("<size njmax=\"1000000000\"/>"), "<size njmax=\"1000000000\"> is out of range"),
    (Element("<size nstack=\"1000000000000\"/>"), "<size nstack=\"1000000000000\"> is out of range"),
    (Element("<size nkey=\"2000000000\"/>"), "<size nkey=\"2000000000\"> is out of range"),
    (Element("<size nuser_geom=\"2000000000\"/>"), "<size nuser_geom=\"2000000000\"> is out of range"),
    (Element("<size nuser_geom=\"-2\"/>"), "nuser_geom"),
    (Model("iterations=\"20\"", "iterations=\"2000000000\""), "<option iterations=\"2000000000\"> is out of range"),
    (
        Element("<asset><hfield name=\"a\" nrow=\"100000\" ncol=\"100000\" size=\"1 1 1 1\"/></asset>"),
        "<hfield nrow=\"100000\"> is out of range: expected at most 2048",
    ),
    (Model("width=\"256\"", "width=\"1000000\""), "<texture width=\"1000000\"> is out of range"),
    (Element("<sensor><user dim=\"2000000000\"/></sensor>"), "<user dim=\"2000000000\"> is out of range"),
    (
        Element("<custom><numeric name=\"a\" size=\"2000000000\"/></custom>"),
        "<numeric size=\"2000000000\"> is out of range",
    ),
    (Element("<visual><quality shadowsize=\"1000000\"/></visual>"), "<quality shadowsize=\"1000000\"> is out of range"),
];

/// Replaces a file of the robot by what `edit` makes of it.
fn change(robot: &Path, name: &str, edit: impl FnOnce(&str) -> String) {
    let text = fs::read_to_string(robot.join(name)).unwrap();
    let changed = edit(&text);
    assert_ne!(changed, text);
    write(robot, name, changed.as_bytes());
}

fn write(robot: &Path, name: &str, bytes: &[u8]) {
    fs::write(robot.join(name), bytes).unwrap();
}

/// Puts something else in a file's place.
fn instead(robot: &Path, name: &str, make: impl FnOnce(&Path)) {
    fs::remove_file(robot.join(name)).unwrap();
    make(&robot.join(name));
}

/// Makes a named pipe, which nobody ever writes to.
fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// Puts an element in front of the model's others.
fn element(robot: &Path, text: &str) {
    let root = "<mujoco model=\"stanford_doggo\">";
    change(robot, "doggo.xml", |model| model.replacen(root, &format!("{root}{text}"), 1));
}

/// Adds a file and an element that names it.
fn with_file(robot: &Path, name: &str, bytes: &[u8], text: &str) {
    write(robot, name, bytes);
    element(robot, text);
}

/// Adds a link and an element that names it.
fn with_link(robot: &Path, name: &str, target: &str, text: &str) {
    symlink(target, robot.join(name)).unwrap();
    element(robot, text);
}

/// Where the first leg begins and ends in robot.toml.
fn first_leg(text: &str) -> [usize; 2] {
    [0, 1].map(|leg| text.match_indices("[[legs]]").nth(leg).unwrap().0)
}

fn without_the_first_leg(text: &str) -> String {
    let [begin, end] = first_leg(text);
    [&text[..begin], &text[end..]].concat()
}

fn twice_the_first_leg(text: &str) -> String {
    let [begin, end] = first_leg(text);
    format!("{}{}{}", &text[..end], &text[begin..end], &text[end..])
}

fn without_free_joint(text: &str) -> String {
    let (start, _) = text.split_once("<keyframe>").unwrap();
    start.replace("<freejoint name=\"root\"/>", "") + "</mujoco>"
}

fn without_gaits(text: &str) -> String {
    let (start, _) = text.split_once("[[gaits]]").unwrap();
    format!("gaits = []\n{start}")
}

fn billion_laughs(robot: &Path) {
    let entities = (1..10).map(|i| format!("<!ENTITY l{i} \"{}\">", format!("&l{};", i - 1).repeat(10)));
    let text =
        format!("<!DOCTYPE mujoco [<!ENTITY l0 \"ha\">{}]><mujoco model=\"&l9;\"/>", entities.collect::<String>());
    write(robot, "doggo.xml", text.as_bytes());
}

fn chain_of_includes(robot: &Path) {
    for i in 0..20 {
        let text = format!("<mujoco><include file=\"a{}.xml\"/></mujoco>", i + 1);
        write(robot, &format!("a{i}.xml"), text.as_bytes());
    }
    with_file(robot, "a20.xml", b"<mujoco/>", "<include file=\"a0.xml\"/>");
}

fn five_large_files(robot: &Path) {
    let mut meshes = String::new();
    for i in 0..5 {
        fs::File::create(robot.join(format!("{i}.stl"))).unwrap().set_len(60 << 20).unwrap();
        meshes += &format!("<mesh file=\"{i}.stl\"/>");
    }
    element(robot, &format!("<asset>{meshes}</asset>"));
}

impl Change {
    fn apply(&self, robot: &Path) {
        match self {
            Settings(from, to) => change(robot, "robot.toml", |text| text.replacen(from, to, 1)),
            AllSettings(from, to) => change(robot, "robot.toml", |text| text.replace(from, to)),
            Model(from, to) => change(robot, "doggo.xml", |text| text.replacen(from, to, 1)),
            AllModel(from, to) => change(robot, "doggo.xml", |text| text.replace(from, to)),
            Element(text) => element(robot, text),
            Body(text) => {
                change(robot, "doggo.xml", |model| model.replacen("<worldbody>", &format!("<worldbody>{text}"), 1));
            }
            Files(make) => make(robot),
        }
    }
}

/// A folder with a copy of Doggo in `robot/`, and a model outside it.
fn copy_of_doggo() -> TemporaryFolder {
    let folder = TemporaryFolder::new();
    fs::create_dir(folder.join("robot")).unwrap();
    for name in ["robot.toml", "doggo.xml"] {
        fs::copy(in_repository("robots/doggo").join(name), folder.join("robot").join(name)).unwrap();
    }
    fs::write(folder.join("outside.xml"), "<mujoco><default/></mujoco>").unwrap();
    fs::write(folder.join("outside.obj"), "v 0 0 0\n").unwrap();
    folder
}

/// How long canter may take to refuse a file before the test calls it stuck [s]: far longer than a busy machine takes.
const STUCK_AFTER_S: u64 = 120;

/// Runs canter on a folder; an error unless it refuses with these words and leaves the folder as it was.
fn refuses(folder: &TemporaryFolder, args: &[&str], words: &str) -> Result<(), String> {
    let files = || [names(folder.path()), names(&folder.join("robot"))];
    let before = files();
    let Some(finished) = folder.canter_within(args, STUCK_AFTER_S) else {
        return Err(format!("expected: {words}\n   found: stuck"));
    };
    let is_good = finished.code == Some(1)
        && finished.stdout.is_empty()
        // MuJoCo's warnings come first.
        && finished.stderr.lines().any(|line| line.starts_with("error: "))
        && finished.stderr.contains(words)
        && !finished.stderr.contains("panicked");
    if is_good && files() == before {
        return Ok(());
    }
    let start: String = finished.stderr.chars().take(600).collect();
    Err(format!("expected: {words}\n   found: code {:?}, {start}", finished.code))
}

fn check(cases: &[(Change, &str)]) {
    for_each(cases, |(change, words)| {
        let folder = copy_of_doggo();
        change.apply(&folder.join("robot"));
        refuses(&folder, &["robots", "robot/robot.toml"], words)
    });
}

#[test]
fn the_files_are_good_before_they_are_changed() {
    let folder = copy_of_doggo();
    assert!(folder.canter(&["robots", "robot/robot.toml"]).succeeded().starts_with("# The compiled model weighs 4.8"));
}

#[test]
fn broken_settings_are_refused_by_name() {
    check(SETTINGS);
}

#[test]
fn broken_models_are_refused_by_name() {
    check(MODELS);
}

#[test]
fn there_are_enough_cases() {
    assert!(SETTINGS.len() + MODELS.len() > 200, "{} and {}", SETTINGS.len(), MODELS.len());
}

#[test]
fn whatever_is_no_file_is_refused_unopened() {
    let folder = copy_of_doggo();
    pipe(&folder.join("pipe.toml"));
    fs::create_dir(folder.join("folder.toml")).unwrap();
    for (path, what) in [
        ("pipe.toml", "this is a pipe or a device; expected a file"),
        ("folder.toml", "this is a folder; expected a file"),
        ("/dev/zero", "this is a pipe or a device; expected a file"),
    ] {
        let words = format!("{path}: cannot be read: {what}");
        let robot = format!("robot={path}");
        for args in [&["robots", path][..], &["config", path], &["train", path], &["train", "--set", &robot]] {
            refuses(&folder, args, &words).unwrap();
        }
    }
}

#[test]
fn all_faults_of_the_files_are_reported_at_once() {
    let folder = copy_of_doggo();
    let robot = folder.join("robot");
    fs::write(robot.join("a.xml"), "<mujoco>\n<size njmax=\"1e9\"/>\n<asset><mesh file=\"b.stl\"/></asset></mujoco>")
        .unwrap();
    element(&robot, "<include file=\"a.xml\"/><include file=\"../outside.xml\"/>");
    let outside = folder.path().canonicalize().unwrap().join("outside.xml");
    let message = format!(
        "error: robot/a.xml:2: <size njmax=\"1e9\"> is out of range: expected at most 100000\n\
         robot/doggo.xml:49: <include file=\"../outside.xml\">: {} is outside the robot's folder; copy it there and name it \
         by its way from the model's file\n\
         robot/a.xml:3: <mesh file=\"b.stl\">: there is no such file; expected it beside the model's file or in the folder \
         that <compiler> names\n\
         3 problems\n",
        outside.display()
    );
    assert_eq!(folder.canter(&["robots", "robot/robot.toml"]).failed_with(1), message);
}
