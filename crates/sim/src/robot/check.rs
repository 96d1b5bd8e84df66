//! Holds `robot.toml` and the compiled model against each other.

use std::ops::RangeInclusive;
use std::path::Path;

use canter_gait::prior::{LegGait, Waveform};
use canter_gait::{Actuators, FiveBar, JointConvention, Leg, LegGeometry, LegLimits, LegPosition, SerialLeg};

use super::settings::{Actuated, FiveBarSettings, GaitSettings, KneeSide, LegSettings, RobotSettings};
use super::table::Recording;
use super::{HeldMotor, KneeAddresses, LEARNED, LegAddresses, NamedGait, Robot, RobotError};
use crate::env::place_leg;
use crate::mujoco::{Model, ObjectKind, Simulation};
use crate::settings::{Document, Problems};

/// How many legs a robot may have.
const NUM_LEGS: RangeInclusive<usize> = 2..=16;

/// A joint whose angle is the motor angle.
const UNTURNED: JointConvention = JointConvention { sign: 1.0, standing: 0.0 };

/// Checks the settings against the model and resolves every name; reports all problems together.
pub(super) fn assemble(
    document: &Document,
    settings: RobotSettings,
    mut model: Model,
    folder: Option<&Path>,
    fingerprint: u64,
) -> Result<Robot, RobotError> {
    let mut problems = document.problems();
    if let Some(message) = excess(&model) {
        problems.at("model", message);
        return Err(problems.into());
    }
    if !(model.total_mass_kg().is_finite() && model.total_mass_kg() > 0.0) {
        problems.at("model", format!("the compiled model weighs {} kg", model.total_mass_kg()));
    }
    if let Some(keyframe) = &settings.keyframe
        && !model.stand_as_in(keyframe)
    {
        problems.at("keyframe", format!("the model has no keyframe called `{keyframe}`"));
    }
    let mut find = |kind: ObjectKind, key: &str, name: &str| {
        let id = model.id(kind, name).or_else(|| {
            // A foot without a name of its own goes by its body's.
            let body = model.id(ObjectKind::Body, name).filter(|_| key.ends_with(".foot"))?;
            model.only_sphere_of(body)
        });
        if id.is_none() {
            let kind = format!("{kind:?}").to_lowercase();
            problems.at(key, format!("the model has no {kind} called `{}`", name.escape_debug()));
        }
        id
    };
    let body = find(ObjectKind::Body, "body", &settings.body);
    let floor = find(ObjectKind::Geom, "floor", &settings.floor);
    let mut standing = Simulation::new(&model);
    standing.update_positions();
    let convention = |joint| convention(&model, &standing, joint);
    let mut leg_addresses = Vec::new();
    for (i, leg) in settings.legs.iter().enumerate() {
        let foot = find(ObjectKind::Geom, &format!("legs[{i}].foot"), leg.foot());
        let mut pair = |kind, key: &str, names: &[String]| {
            let ids: Vec<_> =
                names.iter().enumerate().map(|(j, name)| find(kind, &format!("legs[{i}].{key}[{j}]"), name)).collect();
            // A list of another length is reported below.
            <[Option<usize>; 2]>::try_from(ids).ok().and_then(|[first, second]| Some([first?, second?]))
        };
        let (motors, actuators) = leg.motors_and_actuators();
        let motors = pair(ObjectKind::Joint, "motors", motors);
        let knees = leg.knees().map(|names| pair(ObjectKind::Joint, "knees", names));
        let actuators = pair(ObjectKind::Actuator, "actuators", actuators);
        // What is missing has been reported.
        if let (Some(foot), Some(motor_joints), Some(actuators)) = (foot, motors, actuators)
            && knees != Some(None)
        {
            leg_addresses.push(LegAddresses {
                foot,
                motor_joints,
                motors: motor_joints.map(|joint| model.joint_addresses(joint)),
                conventions: motor_joints.map(convention),
                knees: knees.flatten().map(|joints| KneeAddresses {
                    joints,
                    places: joints.map(|joint| model.joint_addresses(joint).0),
                    conventions: joints.map(convention),
                }),
                actuators,
            });
        }
    }
    let mut held = Vec::new();
    for (i, motor) in settings.held.iter().flatten().enumerate() {
        let joint = find(ObjectKind::Joint, &format!("held[{i}].joint"), &motor.joint);
        let actuator = find(ObjectKind::Actuator, &format!("held[{i}].actuator"), &motor.actuator);
        if let (Some(joint), Some(actuator)) = (joint, actuator) {
            let (place, velocity) = model.joint_addresses(joint);
            held.push(HeldMotor { joint, velocity, actuator, target: model.standing_position()[place] });
        }
    }
    check_kinds(&model, floor, &leg_addresses, &held, &mut problems);
    if let Some(kp) = settings.motor.position_gain_nm_per_rad {
        let gains = [kp, settings.motor.velocity_gain_nm_s_per_rad.unwrap_or(0.0)];
        let in_legs = leg_addresses.iter().flat_map(|address| address.actuators);
        for actuator in in_legs.chain(held.iter().map(|motor| motor.actuator)) {
            if let Err(reason) = model.make_servo(actuator, gains) {
                let message = format!("an actuator cannot be a position control: {reason}");
                problems.at("motor.position_gain_nm_per_rad", message);
                break;
            }
        }
    } else if settings.motor.velocity_gain_nm_s_per_rad.is_some() {
        problems.at("motor.velocity_gain_nm_s_per_rad", "this needs position_gain_nm_per_rad beside it");
    }
    let in_legs = leg_addresses.iter().flat_map(|address| address.motor_joints);
    for joint in in_legs.chain(held.iter().map(|motor| motor.joint)) {
        model.limit_torque(joint);
    }
    let root = body.and_then(|body| model.free_joint(body)).map(|joint| model.joint_addresses(joint));
    if body.is_some() && root.is_none() {
        problems.at("body", "this body has no free joint: it cannot walk away");
    }
    for (key, range) in [("swing_rad", &settings.limits.swing_rad), ("extension_rad", &settings.limits.extension_rad)] {
        if !matches!(range[..], [low, high] if low < 0.0 && 0.0 < high) {
            let message = "expected a least and a greatest value around 0, the standing pose";
            problems.at(&format!("limits.{key}"), message);
        }
    }
    for (i, leg) in settings.legs.iter().enumerate() {
        if settings.legs[..i].iter().any(|earlier| earlier.name() == leg.name()) {
            problems.at(&format!("legs[{i}].name"), "another leg has this name");
        }
    }
    if !is_file_stem(&settings.name) {
        let message = "files are named after robots: use letters, digits, `-` and `_` only";
        problems.at("name", message);
    }
    if settings.gaits.is_empty() {
        problems.at("gaits", "expected one gait at least");
    }
    if !NUM_LEGS.contains(&settings.legs.len()) {
        let (least, most) = (NUM_LEGS.start(), NUM_LEGS.end());
        problems.at("legs", format!("expected {least} to {most} legs, found {}", settings.legs.len()));
    }
    let legs = settings
        .legs
        .iter()
        .enumerate()
        .filter_map(|(i, leg)| {
            // Without its joints the leg's conventions do not matter any more.
            let joints = leg_addresses.get(i).map_or([UNTURNED; 2], |address: &LegAddresses| address.conventions);
            controller_leg(i, leg, joints, &settings, &mut problems)
        })
        .collect::<Vec<_>>();
    let mut gaits = Vec::new();
    if legs.len() == settings.legs.len() {
        for (i, gait) in settings.gaits.iter().enumerate() {
            if gaits.iter().any(|earlier: &NamedGait| earlier.name == gait.name()) {
                problems.at(&format!("gaits[{i}].name"), "another gait has this name");
            }
            if !is_file_stem(gait.name()) {
                let message = "files are named after gaits: use letters, digits, `-` and `_` only";
                problems.at(&format!("gaits[{i}].name"), message);
            }
            if gait.name() == LEARNED {
                problems.at(&format!("gaits[{i}].name"), "this name is what training makes of a gait");
            }
            gaits.extend(named_gait(i, gait, (&legs, &settings.legs), folder, &mut problems));
        }
    }
    problems.clone().finish(())?;
    let (Some(root), Some(floor), Some(trunk)) = (root, floor, body) else {
        unreachable!("a missing free joint or floor is a problem");
    };
    let robot = Robot { settings, model, legs, gaits, fingerprint, leg_addresses, held, floor, root, trunk };
    check_kinematics(&robot, &mut problems);
    Ok(problems.finish(robot)?)
}

/// Whether files may be named so, on any system.
fn is_file_stem(name: &str) -> bool {
    !name.is_empty() && name.chars().all(is_plain)
}

/// Whether a character may stand in the name of a robot or a gait.
pub(super) fn is_plain(character: char) -> bool {
    character.is_ascii_alphanumeric() || "-_".contains(character)
}

/// Most bodies, geoms and so on of a model: a hundred times what a legged robot has.
const MAX_OBJECTS: usize = 5_000;

/// Most memory that a simulation may reserve for contacts and constraints [B]; each environment has its own.
const MAX_ARENA_BYTES: usize = 1 << 30;

/// What the model has too much of, in words.
pub(super) fn excess(model: &Model) -> Option<String> {
    let too_many = model.sizes().into_iter().find(|&(_, number)| number > MAX_OBJECTS);
    let message =
        |(name, number)| format!("the compiled model has {number} {name}: expected at most {MAX_OBJECTS} of them");
    let bytes = model.arena_bytes();
    let too_large = || {
        let message =
            format!("the compiled model reserves {bytes} bytes a simulation: expected at most {MAX_ARENA_BYTES}");
        (bytes > MAX_ARENA_BYTES).then_some(message)
    };
    too_many.map(message).or_else(too_large)
}

/// How the angle of a hinge counts against the angle by which it turns a hanging link forward since the standing pose.
fn convention(model: &Model, standing: &Simulation, joint: usize) -> JointConvention {
    // Forward is x, up is z: a link that hangs down turns forward about -y.
    let [_, left, _] = standing.joint_axes_in_world()[joint];
    let sign = if left > 0.0 { -1.0 } else { 1.0 };
    let (place, _) = model.joint_addresses(joint);
    JointConvention { sign, standing: model.standing_position()[place] as f32 }
}

/// Checks that joints are hinges, feet spheres, the floor level, and that nothing is used twice.
fn check_kinds(
    model: &Model,
    floor: Option<usize>,
    legs: &[LegAddresses],
    held: &[HeldMotor],
    problems: &mut Problems,
) {
    if floor.is_some_and(|floor| !model.is_level_ground(floor)) {
        problems.at("floor", "expected a plane at z = 0 of the world; slopes are a setting of the task");
    }
    let (mut feet, mut joints, mut actuators) = (Vec::new(), Vec::new(), Vec::new());
    for (i, leg) in legs.iter().enumerate() {
        let place = format!("legs[{i}].foot");
        if !model.is_sphere(leg.foot) {
            problems.at(&place, "expected a sphere, whose centre is the foot");
        }
        if feet.contains(&leg.foot) {
            problems.at(&place, "this geom is named already");
        }
        feet.push(leg.foot);
        let knees = leg.knees.as_ref().map(|knees| ("knees", knees.joints));
        for (key, pair) in [("motors", leg.motor_joints)].into_iter().chain(knees) {
            for (j, joint) in pair.into_iter().enumerate() {
                let place = format!("legs[{i}].{key}[{j}]");
                if !model.is_hinge(joint) {
                    problems.at(&place, "expected a hinge");
                }
                if joints.contains(&joint) {
                    problems.at(&place, "this joint is named already");
                }
                joints.push(joint);
            }
        }
        for (j, actuator) in leg.actuators.into_iter().enumerate() {
            if actuators.contains(&actuator) {
                problems.at(&format!("legs[{i}].actuators[{j}]"), "this actuator is named already");
            }
            actuators.push(actuator);
        }
    }
    for (i, motor) in held.iter().enumerate() {
        if !model.is_hinge(motor.joint) {
            problems.at(&format!("held[{i}].joint"), "expected a hinge");
        }
        if joints.contains(&motor.joint) {
            problems.at(&format!("held[{i}].joint"), "this joint is named already");
        }
        if actuators.contains(&motor.actuator) {
            problems.at(&format!("held[{i}].actuator"), "this actuator is named already");
        }
        joints.push(motor.joint);
        actuators.push(motor.actuator);
    }
}

/// Leg positions at which the model is held to the kinematics [rad].
const PROBES: [(f32, f32); 4] = [(0.0, 0.0), (0.3, 0.0), (0.0, 0.2), (-0.2, -0.2)];

/// How far foot and loops may be from where the kinematics have them [m].
const KINEMATICS_TOLERANCE_M: f64 = 1e-3;

/// How far a knee is turned to see whether the loop holds it [rad]: far more than rounding for any length of link.
const KNEE_PROBE_RAD: f64 = 0.5;

/// Checks that the model's feet are where the link lengths put them, that its loops are closed there, and that something
/// holds them closed.
fn check_kinematics(robot: &Robot, problems: &mut Problems) {
    let mut simulation = Simulation::new(&robot.model);
    for (i, (leg, address)) in robot.legs.iter().zip(&robot.leg_addresses).enumerate() {
        let mut feet = Vec::new();
        let mut has_gap = false;
        for (swing, extension) in PROBES {
            let position = leg.limits.clamp(LegPosition { swing, extension });
            place_leg(&mut simulation, robot, i, position);
            has_gap |= is_off(simulation.loop_gap());
            let foot = simulation.geom_positions_in_world()[address.foot];
            let expected = leg.geometry.forward(position);
            feet.push((foot, expected));
        }
        place_leg(&mut simulation, robot, i, LegPosition::default());
        let (standing, standing_expected) = feet[0];
        let far = feet.iter().any(|(foot, expected)| {
            let forward = f64::from(expected.forward_m - standing_expected.forward_m);
            let down = f64::from(expected.down_m - standing_expected.down_m);
            is_off((foot[0] - standing[0] - forward).hypot(foot[2] - standing[2] + down))
        });
        if simulation.is_unstable() {
            let message = "MuJoCo drops contacts or constraints of the standing pose; raise <size memory>, or let fewer parts \
                           touch each other";
            problems.at("model", message);
            return;
        }
        let is_held = address.knees.as_ref().is_none_or(|knees| {
            simulation.qpos_mut()[knees.places[1]] += KNEE_PROBE_RAD;
            is_off(simulation.loop_gap())
        });
        place_leg(&mut simulation, robot, i, LegPosition::default());
        let key = format!("legs[{i}].upper_link_m");
        if far {
            problems.at(&key, "the model's foot does not move as link lengths, stance height and motors say");
        } else if has_gap {
            problems.at(&key, "the model's loop does not close where link lengths, stance height and knees say");
        } else if !is_held {
            let message = "nothing in the model holds this leg's loop closed: the second knee turns freely";
            problems.at(&format!("legs[{i}].knees[1]"), message);
        }
    }
}

/// Whether a distance [m] is more than rounding, or no number.
fn is_off(distance: f64) -> bool {
    distance.is_nan() || distance > KINEMATICS_TOLERANCE_M
}

/// Links and how they are connected; `None` where they cannot stand so high.
pub(super) fn geometry(leg: &LegSettings, stance_height_m: f64) -> Option<LegGeometry> {
    let (upper, lower) = leg.links_m();
    let (upper, lower, stance) = (upper as f32, lower as f32, stance_height_m as f32);
    match leg {
        LegSettings::FiveBar(leg) => {
            let separation = leg.hip_separation_m.unwrap_or(0.0) as f32;
            FiveBar::new(upper, lower, separation, stance).map(LegGeometry::FiveBar)
        }
        LegSettings::Serial(leg) => {
            let in_front = leg.knee == KneeSide::Front;
            SerialLeg::new(upper, lower, in_front, stance).map(LegGeometry::Serial)
        }
    }
}

/// The leg as the controller sees it; `joints` are its motors'.
fn controller_leg(
    index: usize,
    leg: &LegSettings,
    joints: [JointConvention; 2],
    settings: &RobotSettings,
    problems: &mut Problems,
) -> Option<Leg> {
    let (motors, actuators) = leg.motors_and_actuators();
    for (key, names) in [("motors", motors), ("knees", leg.knees().unwrap_or(motors)), ("actuators", actuators)] {
        if names.len() != 2 {
            problems.at(&format!("legs[{index}].{key}"), format!("expected 2 names, found {}", names.len()));
        }
    }
    let geometry = geometry(leg, settings.stance_height_m);
    let actuators = match leg {
        LegSettings::FiveBar(FiveBarSettings { actuated: Actuated::LegSpace, .. }) => Actuators::LegSpace,
        LegSettings::FiveBar(_) | LegSettings::Serial(_) => Actuators::Joints(joints),
    };
    if geometry.is_none() {
        let message =
            format!("links of these lengths cannot stand at stance_height_m = {:?}", settings.stance_height_m);
        problems.at(&format!("legs[{index}].upper_link_m"), message);
    }
    let limits = &settings.limits;
    let pair = |values: &[f64]| Some([*values.first()? as f32, *values.get(1)? as f32]);
    Some(Leg {
        geometry: geometry?,
        actuators,
        limits: LegLimits { swing: pair(&limits.swing_rad)?, extension: pair(&limits.extension_rad)? },
    })
}

/// The gait for these legs; `folder` is where recorded ones are.
fn named_gait(
    index: usize,
    gait: &GaitSettings,
    (legs, settings): (&[Leg], &[LegSettings]),
    folder: Option<&Path>,
    problems: &mut Problems,
) -> Option<NamedGait> {
    let mut problem = |key: &str, message: String| {
        let key = if key.is_empty() { format!("gaits[{index}]") } else { format!("gaits[{index}].{key}") };
        problems.at(&key, message);
    };
    let offsets = gait.phase_offsets(legs.len()).map_err(|(key, message)| problem(key, message)).ok()?;
    let recording = match gait.table() {
        Some(table) => {
            let loaded = Recording::load(folder.unwrap_or(Path::new("")), table);
            Some(loaded.map_err(|message| problem("table", message)).ok()?)
        }
        None => None,
    };
    let mut parts = Vec::new();
    for ((leg, settings), phase_offset) in legs.iter().zip(settings).zip(offsets) {
        let (waveform, defaults) = if let Some(recording) = &recording {
            let table = recording.leg(leg, settings.motors_and_actuators().1);
            let table = table.map_err(|message| problem("table", message)).ok()?;
            (Waveform::Table(table), table.defaults())
        } else if let Some(waveform) = gait.waveform(leg.geometry) {
            waveform
        } else {
            problem("", "a leg cannot reach every point of this trajectory".to_owned());
            return None;
        };
        parts.push(LegGait { waveform, phase_offset, defaults });
    }
    Some(NamedGait {
        name: gait.name().to_owned(),
        is_default: gait.is_default(),
        is_stable: gait.is_stable(),
        stride_frequency_hz: gait.stride_frequency_hz() as f32,
        legs: parts,
    })
}
