//! What can be seen without simulating: masses, inertias, limits, and left against right.

use super::{Checkup, Finding, Origins, Severity};
use crate::mujoco::anatomy::{Anatomy, JointKind, Pull};
use crate::robot::Robot;

/// The elements that have a joint's, a body's and a geom's name.
pub(super) const JOINT: &[&str] = &["joint", "freejoint"];
pub(super) const ACTUATOR: &[&str] = &["actuator"];
pub(super) const GEOM: &[&str] = &["geom"];

/// A trunk whose mass is nearer to its centre than this share of the robot's size is a point.
const LEAST_GYRATION: f64 = 0.05;

/// Least and greatest gravity on which the numbers of gaits are meant [m/s^2].
const GRAVITY: [f64; 2] = [9.0, 10.5];

/// Least sliding friction between a foot and the ground on which gaits walk.
const LEAST_FRICTION: f64 = 0.25;

/// How far masses, links and feet of a left leg and its right counterpart may differ, as a share.
const MIRROR_TOLERANCE: f64 = 0.02;

/// The distance between the two parts of the robot that are farthest apart [m].
fn extent_m(anatomy: &Anatomy) -> f64 {
    let Some(root) = anatomy.floating_body() else {
        let reach =
            |geom: &crate::mujoco::anatomy::GeomPart| geom.position_in_world.iter().map(|x| x * x).sum::<f64>().sqrt();
        let joints = anatomy.joints.iter().map(|j| j.anchor_in_world.iter().map(|x| x * x).sum::<f64>().sqrt());
        let geoms = anatomy.geoms.iter().filter(|geom| geom.body != 0).map(reach);
        return 2.0 * geoms.chain(joints).fold(0.0, f64::max);
    };
    let own = |body: usize| anatomy.ancestors(body).any(|ancestor| ancestor == root);
    let points: Vec<[f64; 3]> = anatomy
        .geoms
        .iter()
        .filter(|geom| own(geom.body))
        .map(|geom| geom.position_in_world)
        .chain(anatomy.joints.iter().filter(|joint| own(joint.body)).map(|joint| joint.anchor_in_world))
        .collect();
    let span = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        (high - low).max(0.0)
    };
    (span(0).powi(2) + span(1).powi(2) + span(2).powi(2)).sqrt()
}

/// Masses and inertias.
pub(super) fn check(anatomy: &Anatomy, origins: &Origins) -> Vec<Finding> {
    let mut findings = Vec::new();
    let extent_m = extent_m(anatomy);
    let root = anatomy.floating_body();
    for (id, body) in anatomy.bodies.iter().enumerate().skip(1) {
        let greatest = body.inertia.iter().copied().fold(0.0, f64::max);
        if body.mass_kg <= 0.0 || greatest <= 0.0 || extent_m <= 0.0 {
            continue;
        }
        // Of two equal halves of the mass, each this far from the middle.
        let radius_m = (greatest / body.mass_kg).sqrt();
        let mut add = |message: String, remedy: &str| {
            findings.push(Finding {
                severity: Severity::Error,
                fault: "placeholder-inertia",
                origin: origins.of_inertia(&body.name),
                message,
                remedy: remedy.to_owned(),
            });
        };
        if radius_m > extent_m {
            add(
                format!(
                    "`{}` has {:.3} kg and an inertia of {greatest} kg m^2, as if its mass were {radius_m:.2} m from its \
                     middle; the whole robot is {extent_m:.2} m long",
                    body.name, body.mass_kg
                ),
                "put in the part's own inertia, or leave it out of an MJCF: MuJoCo then works it out from the geoms",
            );
        } else if Some(id) == root && radius_m < LEAST_GYRATION * extent_m {
            add(
                format!(
                    "`{}` has {:.3} kg and an inertia of {greatest:.3e} kg m^2, as if all of it were within {:.1} mm; the \
                     robot is {extent_m:.2} m long",
                    body.name,
                    body.mass_kg,
                    1e3 * radius_m
                ),
                "put in the body's own inertia, or give it geoms of its size",
            );
        }
    }
    findings
}

/// What a model lacks that has no `robot.toml` yet.
pub(super) fn check_bare(anatomy: &Anatomy, origins: &Origins) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut add = |severity, fault, origin, message: String, remedy: &str| {
        findings.push(Finding { severity, fault, origin, message, remedy: remedy.to_owned() });
    };
    if anatomy.floating_body().is_none() {
        let message = "no body has a free joint: the robot is bolted to the world".to_owned();
        let remedy = "put <freejoint/> into its trunk; of a URDF `canter robot new` makes an MJCF with one";
        add(Severity::Warning, "no-free-joint", origins.of_tag("robot"), message, remedy);
    }
    let hinges = anatomy.joints.iter().enumerate().filter(|(_, joint)| joint.kind == JointKind::Hinge);
    let limited = |id: usize| {
        let by_actuator = anatomy.actuators_of(id).any(|(_, actuator)| actuator.max_force.is_some());
        by_actuator || anatomy.joints[id].max_torque_nm.is_some_and(|limit| limit > 0.0)
    };
    for (id, joint) in hinges.filter(|(id, _)| !limited(*id)) {
        let is_moved = anatomy.actuators.is_empty() || anatomy.actuators_of(id).next().is_some();
        if is_moved {
            let message = format!("nothing limits the torque on `{}`", joint.name);
            let remedy = "give the joint actuatorfrcrange, or in a URDF <limit effort=\"...\">";
            add(Severity::Warning, "no-torque-limit", origins.of(JOINT, &joint.name), message, remedy);
        }
    }
    findings
}

/// What only shows against `robot.toml`.
pub(super) fn check_robot(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup) -> Vec<Finding> {
    let mut findings = Vec::new();
    check_motors(robot, anatomy, checkup, &mut findings);
    check_limits(robot, anatomy, checkup, &mut findings);
    check_legs(robot, anatomy, checkup, &mut findings);
    let gravity = robot.model.gravity();
    if !(GRAVITY[0]..=GRAVITY[1]).contains(&gravity) {
        findings.push(Finding {
            severity: Severity::Error,
            fault: "gravity",
            origin: checkup.origins.of_tag("option"),
            message: format!("the model's gravity is {gravity:.2} m/s^2"),
            remedy: "set gravity=\"0 0 -9.81\" in <option>".to_owned(),
        });
    }
    if robot.default_gaits().next().is_none() {
        findings.push(Finding {
            severity: Severity::Error,
            fault: "no-default-gait",
            origin: checkup.origin_of("gaits"),
            message: "no gait is a default: there is no speed to compare a learned gait with".to_owned(),
            remedy: "set default = true for the gait that the robot walks today".to_owned(),
        });
    }
    findings
}

/// Kinds and limits of the actuators.
fn check_motors(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup, findings: &mut Vec<Finding>) {
    let origins = &checkup.origins;
    let in_legs = robot.leg_addresses.iter().flat_map(|leg| leg.actuators);
    for actuator in in_legs.chain(robot.held.iter().map(|held| held.actuator)) {
        let part = &anatomy.actuators[actuator];
        if part.position_gain.is_none() {
            findings.push(Finding {
                severity: Severity::Error,
                fault: "torque-actuator",
                origin: origins.of(ACTUATOR, &part.name),
                message: format!("`{}` is given torques, but canter's controller gives angles", part.name),
                remedy: "make it a <position> with kp and kv, or set motor.position_gain_nm_per_rad in robot.toml"
                    .to_owned(),
            });
        }
    }
    let max_torque_nm = robot.settings.motor.max_torque_nm;
    let mut is_reported = false;
    for (joint, _) in robot.motor_joints() {
        let part = &anatomy.joints[joint];
        let own = anatomy.actuators_of(joint).filter_map(|(_, actuator)| match actuator.pull {
            Pull::Joint(..) => actuator.max_force,
            _ => None,
        });
        // The loader puts its own range into the joint; what the file says is in the copy that was kept.
        let limit = own.chain(part.max_torque_nm.filter(|limit| *limit > 0.0)).reduce(f64::min);
        match limit {
            None => findings.push(Finding {
                severity: Severity::Warning,
                fault: "no-torque-limit",
                origin: origins.of(JOINT, &part.name),
                message: format!(
                    "the model does not limit the torque on `{}`; only robot.toml's {max_torque_nm} N m does",
                    part.name
                ),
                remedy: "give the joint actuatorfrcrange, so that other programs have the same robot".to_owned(),
            }),
            Some(limit) if max_torque_nm > 1.01 * limit && !is_reported => {
                is_reported = true;
                findings.push(Finding {
                    severity: Severity::Error,
                    fault: "torque-limits-differ",
                    origin: checkup.origin_of("motor.max_torque_nm"),
                    message: format!(
                        "{max_torque_nm} N m is more than the {limit} N m that the model allows on `{}`",
                        part.name
                    ),
                    remedy: "put the motor's real limit into both".to_owned(),
                });
            }
            Some(_) => {}
        }
    }
    let motor = &robot.settings.motor;
    if motor.stall_torque_nm < motor.max_torque_nm {
        findings.push(Finding {
            severity: Severity::Warning,
            fault: "stall-torque",
            origin: checkup.origin_of("motor.stall_torque_nm"),
            message: format!(
                "{} N m at standstill is less than the limit of {} N m, which is then never reached",
                motor.stall_torque_nm, motor.max_torque_nm
            ),
            remedy: "take torque constant times voltage over winding resistance times gear".to_owned(),
        });
    }
}

/// Limits against the standing pose.
fn check_limits(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup, findings: &mut Vec<Finding>) {
    let standing = robot.model.standing_position();
    for (joint, _) in robot.motor_joints() {
        let part = &anatomy.joints[joint];
        let (place, _) = robot.model.joint_addresses(joint);
        if let Some([low, high]) = part.range
            && !(low..=high).contains(&standing[place])
        {
            findings.push(Finding {
                severity: Severity::Error,
                fault: "pose-beyond-stops",
                origin: checkup.origins.of_attribute((JOINT, &part.name), &["range"]),
                message: format!(
                    "`{}` stands at {:.3} rad, its stops are at {low} and {high}",
                    part.name, standing[place]
                ),
                remedy: "correct the range, or the standing pose".to_owned(),
            });
        }
    }
}

/// Feet, and left against right.
fn check_legs(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup, findings: &mut Vec<Finding>) {
    let origins = &checkup.origins;
    for leg in &robot.leg_addresses {
        let foot = &anatomy.geoms[leg.foot];
        let of_foot = robot.model.contact_friction([leg.foot, robot.floor]);
        if of_foot < LEAST_FRICTION {
            findings.push(Finding {
                severity: Severity::Warning,
                fault: "slippery-foot",
                origin: origins.of_attribute((GEOM, &foot.name), &["friction"]),
                message: format!("`{}` has a sliding friction of {of_foot} on the ground", foot.name),
                remedy: "rubber on a floor has 0.6 to 1".to_owned(),
            });
        }
    }
    let num_legs = robot.leg_addresses.len();
    let of_leg = |leg: usize| {
        let address = &robot.leg_addresses[leg];
        let foot = &anatomy.geoms[address.foot];
        let hip = anatomy.joints[address.motor_joints[0]].anchor_in_world;
        let top = anatomy.joints[address.motor_joints[0]].body;
        let below = |body: usize| anatomy.ancestors(body).any(|ancestor| ancestor == top);
        let mass_kg: f64 = (0..anatomy.bodies.len()).filter(|&b| below(b)).map(|b| anatomy.bodies[b].mass_kg).sum();
        (hip, foot.position_in_world, mass_kg)
    };
    let sides: Vec<bool> = (0..num_legs).map(|leg| of_leg(leg).1[1] > 0.0).collect();
    let is_in_order = (1..num_legs).all(|leg| match (sides[leg - 1], sides[leg]) {
        (true, true) => of_leg(leg - 1).0[0] > of_leg(leg).0[0],
        (false, false) => of_leg(leg - 1).0[0] < of_leg(leg).0[0],
        (true, false) => true,
        (false, true) => false,
    });
    if !is_in_order {
        findings.push(Finding {
            severity: Severity::Error,
            fault: "leg-order",
            origin: checkup.origin_of("legs"),
            message: "the legs do not go round the robot: gaits would move the wrong ones together".to_owned(),
            remedy:
                "list the left legs from front to back, then the right ones from back to front; x is forward, y left"
                    .to_owned(),
        });
        return;
    }
    for left in 0..num_legs / 2 {
        let right = num_legs - 1 - left;
        let ((left_hip, left_foot, left_kg), (right_hip, right_foot, right_kg)) = (of_leg(left), of_leg(right));
        let differ = |a: f64, b: f64, of: f64| (a - b).abs() > MIRROR_TOLERANCE * of;
        let height_m = robot.settings.stance_height_m;
        let name = |leg: usize| robot.settings.legs[leg].name();
        let body = &anatomy.bodies[anatomy.joints[robot.leg_addresses[left].motor_joints[0]].body].name;
        let what = if differ(left_kg, right_kg, left_kg.max(right_kg)) {
            format!("below their hips they weigh {left_kg:.3} and {right_kg:.3} kg")
        } else if differ(left_hip[0], right_hip[0], height_m) || differ(left_hip[1], -right_hip[1], height_m) {
            format!(
                "their hips are at ({:.3}, {:.3}) and ({:.3}, {:.3}) m",
                left_hip[0], left_hip[1], right_hip[0], right_hip[1]
            )
        } else if differ(left_foot[0], right_foot[0], height_m) || differ(left_foot[2], right_foot[2], height_m) {
            format!("their feet are {:.3} and {:.3} m ahead", left_foot[0], right_foot[0])
        } else {
            continue;
        };
        findings.push(Finding {
            severity: Severity::Warning,
            fault: "unequal-sides",
            origin: origins.of(&["body"], body),
            message: format!("`{}` and `{}` are not each other's mirror image: {what}", name(left), name(right)),
            remedy: "correct the one that is wrong; if the robot is built so, set policy.symmetric = false".to_owned(),
        });
    }
}
