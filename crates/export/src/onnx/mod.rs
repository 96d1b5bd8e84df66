//! ONNX: one graph from sensors, phase and previous action to actuator targets, next phase and action.
//!
//! A second, small graph says which targets are where the robot already is, for the start.
//!
//! Mirror, normaliser, network, action law, prior, limits and kinematics are inside, made of standard operators. Every
//! value has the control steps as rows, N of them: a robot runs one, a test many.

mod graph;
mod legs;
mod proto;

use canter_gait::normaliser::OBSERVATION_LIMIT;
use canter_gait::{Modulation, ObservationBlock};
use prost::Message;
use serde_json::{Value as Json, json};

use crate::exported::Exported;
use graph::{Builder, Value};

/// The version of ONNX's file format (2021): what runtimes of the last years read.
const IR_VERSION: i64 = 8;
/// The version of ONNX's operators that belongs to it.
const OPSET: i64 = 17;

/// A Python program that runs the models on a robot: rises, ramps in, stops, holds the pose without readings.
pub const RUNNER: &str = include_str!("../../templates/run_policy.py");

/// A policy as an ONNX model; the file's bytes.
pub fn export(exported: &Exported<'_>) -> Vec<u8> {
    let controller = exported.controller();
    let (num_motors, num_actions) = (controller.num_motors(), controller.num_actions());
    let num_sensed: usize = sensed(exported).map(|(_, len)| len).sum();

    let mut builder = Builder::default();
    let g = &mut builder;
    let readings =
        g.input("observation", num_sensed, "the sensors' raw readings, see the metadata's observation_layout");
    let phase = g.input("phase", 1, "the gait's phase [cycles, in [0, 1)]; 0 at the start");
    let previous = g.input("previous_action", num_actions, "the action of the step before; 0 at the start");

    let circle = on_circle(g, &phase);
    let observation = observe(g, exported, [&readings, &phase, &previous], &circle);
    let action = act(g, exported, &observation, &circle);
    let targets: Vec<Value> =
        (0..controller.legs().len()).flat_map(|index| legs::targets(g, exported, index, [&phase, &action])).collect();
    let targets = g.side_by_side(&targets);
    let next_phase = legs::next_phase(g, exported, [&phase, &action]);
    g.output(&targets, "actuator_targets", num_motors, "position commands [rad], in the metadata's order of actuators");
    g.output(&next_phase, "next_phase", 1, "phase for the next step [cycles]");
    g.output(&action, "action", num_actions, "previous_action for the next step, each in [-1, 1]");

    model(exported, builder.finish("control_step"), metadata(exported))
}

/// From motor angles to the actuator targets at which the robot already is, as an ONNX model; the file's bytes.
pub fn export_start(exported: &Exported<'_>) -> Vec<u8> {
    let controller = exported.controller();
    let num_motors = controller.num_motors();
    let mut builder = Builder::default();
    let g = &mut builder;
    let angles = g.input("motor_angles", num_motors, unit(ObservationBlock::MotorAngles));
    let legs = controller.legs().iter().enumerate();
    let targets: Vec<Value> = legs.flat_map(|(index, leg)| legs::targets_at(g, leg, index, &angles)).collect();
    let targets = g.side_by_side(&targets);
    g.output(&targets, "actuator_targets", num_motors, "position commands [rad] that move nothing");
    model(exported, builder.finish("start"), Vec::new())
}

fn model(exported: &Exported<'_>, graph: proto::Graph, metadata: Vec<proto::Entry>) -> Vec<u8> {
    let model = proto::Model {
        ir_version: IR_VERSION,
        producer_name: "canter".to_owned(),
        producer_version: exported.file().card.provenance.canter.clone(),
        doc_string: exported.title(),
        graph: Some(graph),
        opset_import: vec![proto::OperatorSet { domain: String::new(), version: OPSET }],
        metadata,
    };
    model.encode_to_vec()
}

/// The blocks of the observation that are sensors' readings, with their lengths.
fn sensed(exported: &Exported<'_>) -> impl Iterator<Item = (ObservationBlock, usize)> {
    let controller = exported.controller();
    let (num_motors, num_actions) = (controller.num_motors(), controller.num_actions());
    let is_sensed =
        |block: &&ObservationBlock| !matches!(block, ObservationBlock::Phase | ObservationBlock::PreviousAction);
    controller.blocks().iter().filter(is_sensed).map(move |block| (*block, block.len(num_motors, num_actions)))
}

/// Sine and cosine of the phase.
fn on_circle(g: &mut Builder, phase: &Value) -> [Value; 2] {
    let angle = g.times(phase, std::f32::consts::TAU);
    ["Sin", "Cos"].map(|function| g.op(function, &[&angle], &[]))
}

/// The raw observation, `(N x O)`.
fn observe(
    g: &mut Builder,
    exported: &Exported<'_>,
    [readings, _, previous]: [&Value; 3],
    circle: &[Value; 2],
) -> Value {
    let controller = exported.controller();
    let (num_motors, num_actions) = (controller.num_motors(), controller.num_actions());
    let (mut parts, mut start) = (Vec::new(), 0);
    for block in controller.blocks() {
        match block {
            ObservationBlock::Phase => parts.extend(circle.iter().cloned()),
            ObservationBlock::PreviousAction => parts.push(previous.clone()),
            sensed => {
                let columns: Vec<usize> = (start..start + sensed.len(num_motors, num_actions)).collect();
                start += columns.len();
                parts.push(g.columns(readings, &columns));
            }
        }
    }
    g.side_by_side(&parts)
}

/// The action, `(N x A)`: mirror, normaliser, network; 0 where a reading is no number.
fn act(g: &mut Builder, exported: &Exported<'_>, observation: &Value, circle: &[Value; 2]) -> Value {
    let policy = exported.policy();
    let mirror = exported.task().mirror_maps();
    let is_second_half = g.is_below(&circle[0], 0.0);
    let reflect = |g: &mut Builder, block: &Value, components: &[canter_gait::mirror::Component]| {
        let sources: Vec<usize> = components.iter().map(|from| from.source).collect();
        let signs: Vec<f32> = components.iter().map(|from| from.sign).collect();
        let (image, signs) = (g.columns(block, &sources), g.tensor(&[1, signs.len()], &signs));
        let image = g.mul(&image, &signs);
        g.choose(&is_second_half, &image, block)
    };
    let has_nan = g.any_nan(observation);
    let mut x = match mirror {
        Some(maps) => reflect(g, observation, maps.observation()),
        None => observation.clone(),
    };
    let normaliser = policy.normaliser;
    let row = [1, normaliser.mean.len()];
    let (mean, inverse_std) = (g.tensor(&row, normaliser.mean), g.tensor(&row, normaliser.inverse_std));
    x = g.sub(&x, &mean);
    x = g.mul(&x, &inverse_std);
    x = g.clip(&x, [-OBSERVATION_LIMIT, OBSERVATION_LIMIT]);
    let parameters = policy.network.parameters();
    for layer in policy.network.shape().layers() {
        let weights = g.tensor(&[layer.inputs, layer.outputs], &parameters[layer.weights..layer.biases]);
        let biases = g.tensor(&[1, layer.outputs], &parameters[layer.biases..layer.biases + layer.outputs]);
        x = g.op("MatMul", &[&x, &weights], &[]);
        x = g.add(&x, &biases);
        x = g.op("Tanh", &[&x], &[]);
    }
    if let Some(maps) = mirror {
        x = reflect(g, &x, maps.action());
    }
    let zero = g.number(0.0);
    g.choose(&has_nan, &zero, &x)
}

/// What a person or a program must know to connect the graph to a robot.
fn metadata(exported: &Exported<'_>) -> Vec<proto::Entry> {
    let card = &exported.file().card;
    let mut start = 0;
    let layout: Vec<Json> = sensed(exported)
        .map(|(block, len)| {
            let entry = json!({ "block": block.name(), "start": start, "length": len, "unit": unit(block) });
            start += len;
            entry
        })
        .collect();
    let dt = exported.task().settings.control_dt_s;
    let mut standing = vec![0.0; exported.controller().num_motors()];
    exported.controller().stand(&mut standing);
    let entries = [
        ("robot", card.robot.name.clone()),
        ("robot_fingerprint", card.robot.fingerprint.clone()),
        ("gait", card.gait.name.clone()),
        ("modulation", card.action.modulation.clone()),
        ("observation_layout", Json::from(layout).to_string()),
        ("actuators", json!(exported.actuators()).to_string()),
        ("standing_targets", Json::from(standing).to_string()),
        ("units", "angles in rad, angular velocities in rad/s, phase in cycles; action without unit".to_owned()),
        ("control_dt_s", dt.to_string()),
        ("ramp_s", exported.runtime_settings().ramp_s.to_string()),
        ("sensor_timeout_s", exported.runtime_settings().sensor_timeout_s.to_string()),
        ("control_rate_hz", (1.0 / dt).to_string()),
        ("provenance", serde_json::to_value(&card.provenance).expect("it has string keys only").to_string()),
    ];
    entries.into_iter().map(|(key, value)| proto::Entry { key: format!("canter.{key}"), value }).collect()
}

fn unit(block: ObservationBlock) -> &'static str {
    match block {
        ObservationBlock::MotorAngles => "rad, 0 in the standing pose, positive forward",
        ObservationBlock::MotorVelocities => "rad/s",
        ObservationBlock::Orientation => "rad: roll and pitch against gravity, yaw against the direction of walking",
        ObservationBlock::AngularVelocity => "rad/s in the body's frame: forward, left, up",
        ObservationBlock::Phase | ObservationBlock::PreviousAction => "1",
    }
}

/// Whether the policy commands motor angles, without a gait.
fn is_direct(exported: &Exported<'_>) -> bool {
    exported.controller().law().modulation == Modulation::Direct
}
