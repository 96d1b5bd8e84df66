//! One header and one source file in C99: the whole controller without a heap.
//!
//! The code is the same for every robot and lies in `templates/`; what differs are the numbers and which parts the
//! preprocessor keeps.

use std::fmt::Write;

use canter_gait::mirror::Component;
use canter_gait::normaliser::OBSERVATION_LIMIT;
use canter_gait::prior::TABLE_POINTS;
use canter_gait::{Actuators, Leg, LegGait, LegGeometry, Modulation, ObservationBlock, Range, Waveform, action, tanh};

use crate::exported::{Exported, TestVector};
use crate::numbers::{lines, list, number};

const HEADER: &str = include_str!("../templates/policy.h");
const SOURCE: &str = include_str!("../templates/policy.c");

/// Name of the header; the source includes it.
pub const HEADER_NAME: &str = "canter_policy.h";
/// Name of the source.
pub const SOURCE_NAME: &str = "canter_policy.c";
/// The Arduino sketch's name, which its folder must have too.
pub const SKETCH_NAME: &str = "canter_sketch.ino";
/// An Arduino sketch that runs the policy on a Teensy.
pub const SKETCH: &str = include_str!("../templates/canter_sketch.ino");

/// Header and source of a policy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CFiles {
    /// [`HEADER_NAME`]
    pub header: String,
    /// [`SOURCE_NAME`]
    pub source: String,
}

/// A number in C.
fn c(value: f32) -> String {
    number(value, "f")
}

/// Writes a policy as C.
pub fn export(exported: &Exported<'_>) -> CFiles {
    CFiles { header: header(exported), source: source(exported) }
}

fn fill(template: &str, values: &[(&str, String)]) -> String {
    values.iter().fold(template.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), value))
}

fn header(exported: &Exported<'_>) -> String {
    let controller = exported.controller();
    let card = &exported.file().card;
    let unused: Vec<&str> = [
        ObservationBlock::MotorAngles,
        ObservationBlock::MotorVelocities,
        ObservationBlock::Orientation,
        ObservationBlock::AngularVelocity,
    ]
    .into_iter()
    .filter(|block| !controller.blocks().contains(block))
    .map(ObservationBlock::name)
    .collect();
    let unused = match &unused[..] {
        [] => "This policy uses all of them.".to_owned(),
        names => format!("This policy does not use {}.", names.join(", ")),
    };
    fill(
        HEADER,
        &[
            ("TITLE", plain(&exported.title())),
            ("VERSION", plain(&card.provenance.canter)),
            ("RATE", format!("{:.0}", 1.0 / exported.control_dt_s())),
            ("ROBOT", plain(&card.robot.name)),
            ("GAIT", plain(&card.gait.name)),
            ("NUM_LEGS", controller.legs().len().to_string()),
            ("NUM_OBSERVATIONS", controller.num_observations().to_string()),
            ("NUM_ACTIONS", controller.num_actions().to_string()),
            ("NUM_HIDDEN", exported.policy().network.shape().hidden.to_string()),
            ("CONTROL_DT", c(exported.control_dt_s())),
            ("RAMP", c(exported.runtime_settings().ramp_s)),
            ("TIMEOUT", c(exported.runtime_settings().sensor_timeout_s)),
            ("ACTUATORS", plain(&exported.actuators().join(", "))),
            ("UNUSED", unused),
        ],
    )
}

/// A name without what could end a string or a comment: names come from files that anybody may have made.
pub(crate) fn plain(name: &str) -> String {
    name.chars()
        .map(|letter| if letter.is_ascii_alphanumeric() || " ,._-+".contains(letter) { letter } else { '_' })
        .collect()
}

fn source(exported: &Exported<'_>) -> String {
    let blocks: Vec<String> = exported.controller().blocks().iter().map(|block| block.name().to_uppercase()).collect();
    let mirror = exported.task().mirror_maps();
    let components = |components: &[Component]| {
        components.iter().map(|from| format!("{{{}, {}}}", from.source, from.sign)).collect::<Vec<_>>().join(", ")
    };
    let vectors: String = exported.test_vectors().iter().map(test_vector).collect();
    fill(
        SOURCE,
        &[
            ("TITLE", plain(&exported.title())),
            ("DATA", data(exported)),
            ("BLOCKS", blocks.join(", ")),
            ("MIRRORED_OBSERVATION", mirror.map_or(String::new(), |maps| components(maps.observation()))),
            ("MIRRORED_ACTION", mirror.map_or(String::new(), |maps| components(maps.action()))),
            ("TANH_SATURATION", c(tanh::SATURATION)),
            ("TANH_NUMERATOR", horner(&tanh::NUMERATOR)),
            ("TANH_DENOMINATOR", horner(&[&[1.0], &tanh::DENOMINATOR[..]].concat())),
            ("OBSERVATION_LIMIT", c(OBSERVATION_LIMIT)),
            ("MAX_AMPLITUDE", c(action::MAX_AMPLITUDE_RAD)),
            ("MIN_POSITIVE", c(f32::MIN_POSITIVE)),
            ("TEST_VECTORS", vectors),
        ],
    )
}

/// A polynomial in `s`, its constant first: `((c2) * s + c1) * s + c0`.
fn horner(coefficients: &[f32]) -> String {
    let (last, rest) = coefficients.split_last().expect("a polynomial has a coefficient");
    rest.iter().rev().fold(c(*last), |inner, coefficient| format!("({inner}) * s + {}", c(*coefficient)))
}

/// What differs between policies: sizes, switches of the preprocessor, numbers.
fn data(exported: &Exported<'_>) -> String {
    let controller = exported.controller();
    let (law, gait, legs) = (controller.law(), controller.gait(), controller.legs());
    let mut text = String::new();
    let mut define = |name: &str, value: String| {
        let _ = writeln!(text, "#define {name} {value}");
    };
    for (i, modulation) in Modulation::ALL.into_iter().enumerate() {
        define(&switch(modulation), i.to_string());
    }
    define("CANTER_MODULATION", switch(law.modulation));
    let flag = |value: bool| i32::from(value).to_string();
    let any_leg = |test: fn(&Leg) -> bool| legs.iter().any(test);
    let any_wave = |test: fn(&Waveform) -> bool| {
        law.modulation != Modulation::Direct && gait.legs.iter().any(|leg| test(&leg.waveform))
    };
    let has_serial = any_leg(|leg| matches!(leg.geometry, LegGeometry::Serial(_)));
    let has_separated = any_leg(|leg| half_separation(leg) != 0.0);
    let has_stepping = any_wave(|wave| matches!(wave, Waveform::Stepping(_)));
    let has_joints = any_leg(|leg| matches!(leg.actuators, Actuators::Joints(_)));
    // Geometry is code only where something has to be converted.
    let is_direct = law.modulation == Modulation::Direct;
    let has_leg_space = any_leg(|leg| matches!(leg.actuators, Actuators::LegSpace));
    // From motor angles to leg space, as what a residual has moved, and where the robot is at the start.
    let converts_back = has_leg_space || is_direct || (law.modulation == Modulation::Residual && has_joints);
    let converts = has_joints || converts_back;
    define("CANTER_HAS_MIRROR", flag(exported.task().mirror_maps().is_some()));
    define("CANTER_HAS_JOINTS", flag(has_joints));
    define("CANTER_HAS_LEG_SPACE", flag(has_leg_space));
    define("CANTER_HAS_SERIAL", flag(has_serial && converts));
    define("CANTER_HAS_SEPARATED_HIPS", flag(has_separated && converts));
    define("CANTER_HAS_STEPPING", flag(has_stepping));
    define("CANTER_HAS_TABLE", flag(any_wave(|wave| matches!(wave, Waveform::Table(_)))));
    let has_triangles = has_stepping || (has_separated && converts) || (has_serial && converts_back);
    define("CANTER_HAS_TRIANGLES", flag(has_triangles));
    define("CANTER_CONVERTS_BACK", flag(converts_back));
    define("AUTHORITY", c(law.authority));
    define("RESIDUAL_REACH", c(law.authority * law.residual_bound_rad));
    define("FREQUENCY_HZ", c(gait.stride_frequency_hz));
    define("TABLE_POINTS", TABLE_POINTS.to_string());
    if let Some(maps) = exported.task().mirror_maps() {
        define("CANTER_SINE", maps.sine().to_string());
    }
    if law.modulation == Modulation::Modulate {
        let range = |range: Range| format!("{{{}, {}}}", c(range.low), c(range.high));
        let ranges = law.ranges;
        let _ = writeln!(text, "\nstatic const float frequency_factor[2] = {};", range(ranges.frequency_factor));
        let pair = |a, b| format!("{{{}, {}}}", range(a), range(b));
        let amplitudes = pair(ranges.swing_amplitude, ranges.extension_amplitude);
        let _ = writeln!(text, "static const float amplitude_ranges[2][2] = {amplitudes};");
        let offsets = pair(ranges.swing_offset, ranges.extension_offset);
        let _ = writeln!(text, "static const float offset_ranges[2][2] = {offsets};");
    }
    text += LEG;
    for (i, part) in gait.legs.iter().enumerate() {
        if let (Waveform::Table(table), true) = (part.waveform, law.modulation != Modulation::Direct) {
            let points: Vec<f32> = table.wave().iter().flat_map(|leg| [leg.swing, leg.extension]).collect();
            let _ = writeln!(text, "\nstatic const float table_{i}[2 * TABLE_POINTS] = {{\n{}}};", lines(&points, "f"));
        }
    }
    text += "\nstatic const leg legs[CANTER_NUM_LEGS] = {\n";
    for (i, (own, part)) in legs.iter().zip(gait.legs).enumerate() {
        text += &leg(i, own, part, law.modulation);
    }
    text += "};\n";
    let policy = exported.policy();
    let mut array = |name: &str, values: &[f32]| {
        let _ = writeln!(text, "\nstatic const float {name}[{}] = {{\n{}}};", values.len(), lines(values, "f"));
    };
    array("mean", policy.normaliser.mean);
    array("inverse_std", policy.normaliser.inverse_std);
    let parameters = policy.network.parameters();
    for (i, layer) in policy.network.shape().layers().into_iter().enumerate() {
        array(&format!("weights_{i}"), &parameters[layer.weights..layer.biases]);
        array(&format!("biases_{i}"), &parameters[layer.biases..layer.biases + layer.outputs]);
    }
    text.push('\n');
    text
}

/// What a modulation is called in C.
fn switch(modulation: Modulation) -> String {
    format!("CANTER_{}", modulation.name().to_uppercase().replace('-', "_"))
}

const LEG: &str = "
enum kind { FIVE_BAR, SERIAL };
enum waveform { SINE, STEPPING, TABLE };

/* A leg and its part of the gait; pairs are swing and extension, or the two motors. */
typedef struct {
    unsigned char kind;
    unsigned char waveform;
    unsigned char has_joints;
    float upper_link, lower_link, half_separation, stance_half_angle, knee_side;
    float joint_sign[2], joint_standing[2];
    float limits[2][2];
    float phase_offset;
    float amplitudes[2], offsets[2];
    float extension_phase;
    /* Stance height, down and up amplitude, flight fraction, step length. */
    float stepping[5];
    /* What takes the stepping trajectory into [-1, 1]. */
    float centre[2], half_range[2];
    const float *table;
} leg;
";

fn half_separation(leg: &Leg) -> f32 {
    match leg.geometry {
        LegGeometry::FiveBar(leg) => 0.5 * leg.hip_separation_m(),
        LegGeometry::Serial(_) => 0.0,
    }
}

/// One entry of the table of legs.
fn leg(index: usize, leg: &Leg, part: &LegGait, modulation: Modulation) -> String {
    let (kind, upper, lower, stance, knee_side) = match leg.geometry {
        LegGeometry::FiveBar(leg) => ("FIVE_BAR", leg.upper_link_m(), leg.lower_link_m(), leg.stance_half_angle(), 0.0),
        LegGeometry::Serial(leg) => {
            let side = if leg.knee_in_front() { 1.0 } else { -1.0 };
            ("SERIAL", leg.upper_link_m(), leg.lower_link_m(), leg.stance_half_angle(), side)
        }
    };
    let joints = match leg.actuators {
        Actuators::LegSpace => None,
        Actuators::Joints(joints) => Some(joints),
    };
    let of_joints = |value: fn(canter_gait::JointConvention) -> f32| joints.map_or([0.0; 2], |both| both.map(value));
    let (mut stepping, mut span, mut extension_phase) = ([0.0; 5], [[0.0; 2], [1.0; 2]], 0.0);
    let (waveform, table) = match part.waveform {
        Waveform::Sine(sine) => {
            extension_phase = sine.extension_phase;
            ("SINE", "0".to_owned())
        }
        Waveform::Stepping(trajectory) => {
            let p = trajectory.parameters();
            stepping = [p.stance_height_m, p.down_amplitude_m, p.up_amplitude_m, p.flight_fraction, p.step_length_m];
            let defaults = trajectory.defaults();
            span = [
                [defaults.swing_offset, defaults.extension_offset],
                [defaults.swing_amplitude, defaults.extension_amplitude],
            ];
            ("STEPPING", "0".to_owned())
        }
        Waveform::Table(_) if modulation == Modulation::Direct => ("TABLE", "0".to_owned()),
        Waveform::Table(_) => ("TABLE", format!("table_{index}")),
    };
    let pair = |values: [f32; 2]| format!("{{{}}}", list(&values, "f"));
    let p = part.defaults;
    let fields = [
        kind.to_owned(),
        waveform.to_owned(),
        u8::from(joints.is_some()).to_string(),
        list(&[upper, lower, half_separation(leg), stance, knee_side], "f"),
        pair(of_joints(|joint| joint.sign)),
        pair(of_joints(|joint| joint.standing)),
        format!("{{{}, {}}}", pair(leg.limits.swing), pair(leg.limits.extension)),
        c(part.phase_offset),
        pair([p.swing_amplitude, p.extension_amplitude]),
        pair([p.swing_offset, p.extension_offset]),
        c(extension_phase),
        format!("{{{}}}", list(&stepping, "f")),
        pair(span[0]),
        pair(span[1]),
        table,
    ];
    format!("    {{{}}},\n", fields.join(", "))
}

fn test_vector(vector: &TestVector) -> String {
    let braced = |values: &[f32]| format!("{{{}}}", list(values, "f"));
    let readings = &vector.readings;
    format!(
        "    {{{{{}, {}, {}, {}, 0.0f}}, {},\n     {},\n     {}, {}}},\n",
        braced(&readings.motor_angles),
        braced(&readings.motor_velocities),
        braced(&readings.orientation),
        braced(&readings.angular_velocity_in_body),
        c(vector.phase),
        braced(&vector.previous_action),
        braced(&vector.targets),
        c(vector.next_phase),
    )
}
