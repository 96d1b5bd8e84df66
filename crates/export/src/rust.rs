//! A Rust crate without `std` on `canter-gait`: the same controller, with this policy's numbers as constants.

use std::fmt::Write;

use canter_gait::mirror::Component;
use canter_gait::prior::TABLE_POINTS;
use canter_gait::{Actuators, JointConvention, Leg, LegGait, LegGeometry, LegParameters, Range, Waveform};

use crate::c::plain;
use crate::exported::{Exported, TestVector};
use crate::numbers::{lines, list, number};

/// Name of the generated package.
pub const PACKAGE: &str = "canter-policy";

/// The generated crate's files: path within the crate, content.
pub type Files = Vec<(String, String)>;

macro_rules! gait_sources {
    ($($path:literal),+ $(,)?) => {
        [$(($path, include_str!(concat!("../../gait/src/", $path)))),+]
    };
}

/// The sources of `canter-gait`, which travel with the policy: what was exported goes on to be what it was.
pub const GAIT_SOURCES: [(&str, &str); 14] = gait_sources![
    "action.rs",
    "controller.rs",
    "kinematics/five_bar.rs",
    "kinematics/mod.rs",
    "kinematics/serial.rs",
    "lib.rs",
    "mirror.rs",
    "network.rs",
    "normaliser.rs",
    "observation.rs",
    "phase.rs",
    "prior.rs",
    "runtime.rs",
    "tanh.rs",
];

/// Writes a policy as a crate, with the crate that it uses in its folder `gait`.
pub fn export(exported: &Exported<'_>) -> Files {
    let own = [("Cargo.toml", manifest(exported)), ("src/lib.rs", code(exported)), ("src/data.rs", data(exported))];
    let mut files: Files = own.map(|(path, content)| (path.to_owned(), content)).into();
    files.push(("gait/Cargo.toml".to_owned(), GAIT_MANIFEST.replace("@VERSION@", env!("CARGO_PKG_VERSION"))));
    files.extend(GAIT_SOURCES.map(|(path, content)| (format!("gait/src/{path}"), content.to_owned())));
    files
}

const GAIT_MANIFEST: &str = "\
[package]
name = \"canter-gait\"
description = \"What runs on the robot, as canter trained with it\"
version = \"@VERSION@\"
edition = \"2024\"
license = \"MIT OR Apache-2.0\"
publish = false

[dependencies]
libm = \"0.2\"
";

fn manifest(exported: &Exported<'_>) -> String {
    format!(
        "[package]\nname = \"{PACKAGE}\"\ndescription = \"{}\"\nversion = \"0.1.0\"\nedition = \"2024\"\npublish = false\n\n\
         [dependencies]\ncanter-gait = {{ path = \"gait\" }}\n\n# A crate of its own, wherever it lies.\n[workspace]\n",
        plain(&exported.title())
    )
}

const CODE: &str = include_str!("../templates/policy.rs.in");

fn code(exported: &Exported<'_>) -> String {
    let values = [("@TITLE@", plain(&exported.title())), ("@ACTUATORS@", plain(&exported.actuators().join(", ")))];
    values.iter().fold(CODE.to_owned(), |text, (name, value)| text.replace(name, value))
}

fn data(exported: &Exported<'_>) -> String {
    let controller = exported.controller();
    let (law, gait, policy) = (controller.law(), controller.gait(), exported.policy());
    let shape = policy.network.shape();
    let n = |value: f32| number(value, "");
    let mut text = String::from(
        "//! The policy's numbers, written by canter.\n\n\
         use canter_gait::mirror::Component;\nuse canter_gait::*;\n\n",
    );
    let constants = [
        ("NUM_LEGS", "usize", controller.legs().len().to_string()),
        ("NUM_OBSERVATIONS", "usize", controller.num_observations().to_string()),
        ("NUM_ACTIONS", "usize", controller.num_actions().to_string()),
        ("NUM_HIDDEN", "usize", shape.hidden.to_string()),
        ("CONTROL_DT_S", "f32", n(exported.control_dt_s())),
        ("STRIDE_FREQUENCY_HZ", "f32", n(gait.stride_frequency_hz)),
        ("SINE", "usize", exported.task().mirror_maps().map_or(0, canter_sim::mirror::MirrorMaps::sine).to_string()),
    ];
    for (name, kind, value) in constants {
        let _ = writeln!(text, "pub const {name}: {kind} = {value};");
    }
    let blocks: Vec<String> = controller.blocks().iter().map(|block| format!("ObservationBlock::{block:?}")).collect();
    let _ = writeln!(text, "pub const BLOCKS: [ObservationBlock; {}] = [{}];", blocks.len(), blocks.join(", "));
    let range = |range: Range| format!("Range {{ low: {}, high: {} }}", n(range.low), n(range.high));
    let _ = writeln!(
        text,
        "pub const LAW: ActionLaw = ActionLaw {{\n    modulation: Modulation::{:?},\n    authority: {},\n    \
         ranges: ParameterRanges {{\n        frequency_factor: {},\n        swing_amplitude: {},\n        \
         extension_amplitude: {},\n        swing_offset: {},\n        extension_offset: {},\n    }},\n    residual_bound_rad: {},\n}};",
        law.modulation,
        n(law.authority),
        range(law.ranges.frequency_factor),
        range(law.ranges.swing_amplitude),
        range(law.ranges.extension_amplitude),
        range(law.ranges.swing_offset),
        range(law.ranges.extension_offset),
        n(law.residual_bound_rad),
    );
    let legs: String = controller.legs().iter().map(leg).collect();
    let _ = writeln!(text, "pub fn legs() -> Option<[Leg; NUM_LEGS]> {{\n    Some([\n{legs}    ])\n}}");
    for (i, part) in gait.legs.iter().enumerate() {
        if let Waveform::Table(table) = part.waveform {
            // The wave's own span: its parameters are given apart, and scaling it anew would round.
            let points: Vec<f32> = table.wave().iter().flat_map(|leg| [leg.swing, leg.extension]).collect();
            let _ = writeln!(text, "static TABLE_{i}: [f32; {}] = [\n{}];", 2 * TABLE_POINTS, lines(&points, ""));
        }
    }
    let parts: String = gait.legs.iter().enumerate().map(|(i, part)| leg_gait(i, part)).collect();
    let _ = writeln!(
        text,
        "pub fn gait(legs: &[Leg; NUM_LEGS]) -> Option<[LegGait; NUM_LEGS]> {{\n    let _ = legs;\n    Some([\n{parts}    ])\n}}"
    );
    let mut array = |name: &str, values: &[f32]| {
        let _ = writeln!(text, "pub static {name}: [f32; {}] = [\n{}];", values.len(), lines(values, ""));
    };
    array("MEAN", policy.normaliser.mean);
    array("INVERSE_STD", policy.normaliser.inverse_std);
    array("PARAMETERS", policy.network.parameters());
    let mut components = |name: &str, values: &[Component]| {
        let entries: Vec<String> =
            values.iter().map(|own| format!("Component {{ source: {}, sign: {} }}", own.source, n(own.sign))).collect();
        let _ = writeln!(text, "pub static {name}: [Component; {}] = [{}];", values.len(), entries.join(", "));
    };
    let maps = exported.task().mirror_maps();
    components("MIRRORED_OBSERVATION", maps.map_or(&[], |maps| maps.observation()));
    components("MIRRORED_ACTION", maps.map_or(&[], |maps| maps.action()));
    let vectors: String = exported.test_vectors().iter().map(test_vector).collect();
    let _ = writeln!(
        text,
        "pub struct TestVector {{\n    pub readings: ([f32; 2 * NUM_LEGS], [f32; 2 * NUM_LEGS], [f32; 3], [f32; 3]),\n    \
         pub phase: f32,\n    pub previous_action: [f32; NUM_ACTIONS],\n    pub targets: [f32; 2 * NUM_LEGS],\n    \
         pub next_phase: f32,\n}}\n\
         pub static TEST_VECTORS: [TestVector; {}] = [\n{vectors}];",
        exported.test_vectors().len()
    );
    text
}

fn leg(leg: &Leg) -> String {
    let n = |value: f32| number(value, "");
    let stance = n(leg.geometry.length(0.0));
    let geometry = match leg.geometry {
        LegGeometry::FiveBar(own) => format!(
            "LegGeometry::FiveBar(FiveBar::new({}, {}, {}, {stance})?)",
            n(own.upper_link_m()),
            n(own.lower_link_m()),
            n(own.hip_separation_m())
        ),
        LegGeometry::Serial(own) => format!(
            "LegGeometry::Serial(SerialLeg::new({}, {}, {}, {stance})?)",
            n(own.upper_link_m()),
            n(own.lower_link_m()),
            own.knee_in_front()
        ),
    };
    let actuators = match leg.actuators {
        Actuators::LegSpace => "Actuators::LegSpace".to_owned(),
        Actuators::Joints(joints) => {
            let [a, b] = joints.map(|JointConvention { sign, standing }| {
                format!("JointConvention {{ sign: {}, standing: {} }}", n(sign), n(standing))
            });
            format!("Actuators::Joints([{a}, {b}])")
        }
    };
    format!(
        "        Leg {{\n            geometry: {geometry},\n            actuators: {actuators},\n            \
         limits: LegLimits {{ swing: [{}], extension: [{}] }},\n        }},\n",
        list(&leg.limits.swing, ""),
        list(&leg.limits.extension, "")
    )
}

fn leg_gait(index: usize, part: &LegGait) -> String {
    let n = |value: f32| number(value, "");
    let waveform = match part.waveform {
        Waveform::Sine(own) => format!("Waveform::Sine(SineWave {{ extension_phase: {} }})", n(own.extension_phase)),
        Waveform::Stepping(own) => {
            let p = own.parameters();
            format!(
                "Waveform::Stepping(Stepping::new(\n                SteppingParameters {{\n                    \
                 stance_height_m: {},\n                    down_amplitude_m: {},\n                    \
                 up_amplitude_m: {},\n                    flight_fraction: {},\n                    \
                 step_length_m: {},\n                }},\n                legs[{index}].geometry,\n            )?)",
                n(p.stance_height_m),
                n(p.down_amplitude_m),
                n(p.up_amplitude_m),
                n(p.flight_fraction),
                n(p.step_length_m)
            )
        }
        Waveform::Table(_) => format!("Waveform::Table(crate::table(&TABLE_{index})?)"),
    };
    let LegParameters { swing_amplitude, extension_amplitude, swing_offset, extension_offset } = part.defaults;
    format!(
        "        LegGait {{\n            waveform: {waveform},\n            phase_offset: {},\n            \
         defaults: LegParameters {{\n                swing_amplitude: {},\n                \
         extension_amplitude: {},\n                swing_offset: {},\n                extension_offset: {},\n            \
         }},\n        }},\n",
        n(part.phase_offset),
        n(swing_amplitude),
        n(extension_amplitude),
        n(swing_offset),
        n(extension_offset)
    )
}

fn test_vector(vector: &TestVector) -> String {
    let readings = &vector.readings;
    format!(
        "    TestVector {{\n        readings: ([{}], [{}], [{}], [{}]),\n        phase: {},\n        \
         previous_action: [{}],\n        targets: [{}],\n        next_phase: {},\n    }},\n",
        list(&readings.motor_angles, ""),
        list(&readings.motor_velocities, ""),
        list(&readings.orientation, ""),
        list(&readings.angular_velocity_in_body, ""),
        number(vector.phase, ""),
        list(&vector.previous_action, ""),
        list(&vector.targets, ""),
        number(vector.next_phase, "")
    )
}
