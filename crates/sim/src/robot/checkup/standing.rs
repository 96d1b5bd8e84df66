//! Whether the robot stands: two seconds of simulation with every motor held where it is in the standing pose.

use super::model::{ACTUATOR, GEOM};
use super::{Checkup, Finding, Severity};
use crate::frame;
use crate::mujoco::Simulation;
use crate::mujoco::anatomy::Anatomy;
use crate::robot::Robot;
use canter_gait::LegPosition;

/// Physics step [s]: what gaits are measured with at most.
const DT_S: f64 = 0.002;
/// How long the robot has to stand [s].
const LENGTH_S: f64 = 2.0;
/// The last part of it, in which nothing should move any more [s].
const REST_S: f64 = 0.5;
/// How much a motor may still swing then [rad].
const RESTLESS_RAD: f64 = 0.02;
/// How often it turns back then, if it swings: five times a second and side.
const TURNS: usize = 5;
/// How far the body may sink, as a share of the stance height: Doggo, soft as it is, sinks by a fifth.
const SINK_SHARE: f64 = 0.35;
/// How far it may lean [deg], creep along the ground (share of the stance height).
const LEAN_DEG: f64 = 8.0;
const CREEP_SHARE: f64 = 0.15;
/// How far a foot may be above the lowest one in the standing pose, as a share of the stance height.
const LIFTED_SHARE: f64 = 0.03;

/// How the robot stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// How far its body sank [m].
    pub sink_m: f64,
    /// How far it leant in the end [deg].
    pub lean_deg: f64,
    /// How far it crept along the ground [m].
    pub creep_m: f64,
    /// Greatest swing of a motor in the last half second, from end to end [rad].
    pub swing_rad: f64,
    /// Greatest torque of a motor in the last half second [N m].
    pub torque_nm: f64,
}

/// What happened to one motor in the last part.
#[derive(Clone, Copy)]
struct Motion {
    least: f64,
    greatest: f64,
    last_velocity: f64,
    turns: usize,
}

/// Lets the robot stand.
pub(super) fn check(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup) -> (Standing, Vec<Finding>) {
    let mut findings = Vec::new();
    check_feet(robot, anatomy, checkup, &mut findings);
    let mut model = robot.model.clone();
    model.set_timestep_s(DT_S);
    let mut simulation = Simulation::new(&model);
    let (root, _) = robot.root;
    lift_onto_ground(robot, &mut simulation);
    let begin: [f64; 3] = std::array::from_fn(|axis| simulation.qpos()[root + axis]);
    for (leg, address) in robot.legs.iter().zip(&robot.leg_addresses) {
        for (target, actuator) in leg.targets(LegPosition::default()).into_iter().zip(address.actuators) {
            simulation.ctrl_mut()[actuator] = f64::from(target);
        }
    }
    for held in &robot.held {
        simulation.ctrl_mut()[held.actuator] = held.target;
    }
    let joints: Vec<(usize, usize)> = robot.motor_joints().collect();
    let places: Vec<usize> = joints.iter().map(|&(joint, _)| robot.model.joint_addresses(joint).0).collect();
    let start = Motion { least: f64::INFINITY, greatest: f64::NEG_INFINITY, last_velocity: 0.0, turns: 0 };
    let mut motions = vec![start; joints.len()];
    let (motor, mut torque_nm) = (robot.motor(), 0.0_f64);
    let (mut least_height_m, mut is_unstable) = (f64::INFINITY, false);
    let num_steps = (LENGTH_S / DT_S) as usize;
    for step in 0..num_steps {
        for &(joint, velocity) in &joints {
            let range = motor.torque_range_nm(simulation.qvel()[velocity]);
            simulation.set_torque_range(joint, range);
        }
        simulation.step();
        is_unstable |= simulation.is_unstable() || !frame::is_sane(simulation.qpos(), simulation.qvel());
        if is_unstable {
            break;
        }
        least_height_m = least_height_m.min(simulation.qpos()[root + 2]);
        if (step as f64) * DT_S < LENGTH_S - REST_S {
            continue;
        }
        for ((motion, &place), &(_, velocity)) in motions.iter_mut().zip(&places).zip(&joints) {
            let (angle, speed) = (simulation.qpos()[place], simulation.qvel()[velocity]);
            motion.least = motion.least.min(angle);
            motion.greatest = motion.greatest.max(angle);
            motion.turns += usize::from(speed * motion.last_velocity < 0.0);
            motion.last_velocity = speed;
            torque_nm = torque_nm.max(simulation.actuator_torques()[velocity].abs());
        }
    }
    let end: [f64; 3] = std::array::from_fn(|axis| simulation.qpos()[root + axis]);
    let up = frame::from_quaternion(std::array::from_fn(|i| simulation.qpos()[root + 3 + i]))[2][2];
    let swing = |motion: &Motion| (motion.greatest - motion.least).max(0.0);
    let standing = Standing {
        sink_m: begin[2] - least_height_m.min(end[2]),
        lean_deg: up.clamp(-1.0, 1.0).acos().to_degrees(),
        creep_m: (end[0] - begin[0]).hypot(end[1] - begin[1]),
        swing_rad: motions.iter().map(swing).fold(0.0, f64::max),
        torque_nm,
    };
    let gains = |joint: usize| {
        let actuator = anatomy.actuators_of(joint).next();
        match (&robot.settings.motor.position_gain_nm_per_rad, actuator) {
            (Some(_), _) | (_, None) => checkup.origin_of("motor.position_gain_nm_per_rad"),
            (None, Some((_, part))) => checkup.origins.of_attribute((ACTUATOR, &part.name), &["kp", "gainprm"]),
        }
    };
    let restless = (0..joints.len()).filter(|&i| motions[i].turns >= TURNS && swing(&motions[i]) > RESTLESS_RAD);
    let restless = restless.max_by(|&a, &b| swing(&motions[a]).total_cmp(&swing(&motions[b])));
    let error = |fault, origin, message: String, remedy: &str| Finding {
        severity: Severity::Error,
        fault,
        origin,
        message,
        remedy: remedy.to_owned(),
    };
    let pose = || checkup.origin_of(if robot.settings.keyframe.is_some() { "keyframe" } else { "stance_height_m" });
    let height_m = robot.settings.stance_height_m;
    if is_unstable {
        findings.push(error(
            "blows-up",
            joints.first().map_or_else(|| checkup.origins.model(), |&(joint, _)| gains(joint)),
            format!("the physics makes no sense any more after less than {LENGTH_S} s of standing"),
            "lower the gains, raise inertias and armatures, and look for parts that overlap",
        ));
        return (standing, findings);
    }
    if let Some(i) = restless {
        let joint = joints[i].0;
        findings.push(error(
            "gains-oscillate",
            gains(joint),
            format!(
                "`{}` keeps swinging by {:.3} rad while the robot stands, {} times a second",
                anatomy.joints[joint].name,
                swing(&motions[i]),
                motions[i].turns as f64 / REST_S / 2.0
            ),
            "lower kp, raise kv, or give the joint its motor's armature",
        ));
    }
    if standing.lean_deg > LEAN_DEG {
        findings.push(error(
            "does-not-stand",
            pose(),
            format!("after {LENGTH_S} s of standing the robot leans by {:.0} degrees", standing.lean_deg),
            "its centre of mass is not between its feet: correct the masses, or the standing pose",
        ));
    } else if standing.sink_m > SINK_SHARE * height_m {
        let (joint, needs) = (joints[0].0, standing.torque_nm);
        let is_at_limit = needs > 0.95 * robot.settings.motor.max_torque_nm;
        let origin = if is_at_limit { checkup.origin_of("motor.max_torque_nm") } else { gains(joint) };
        findings.push(error(
            if is_at_limit { "motors-too-weak" } else { "gains-too-soft" },
            origin,
            format!(
                "standing, the body sinks by {:.3} m of its {height_m} m; a motor gives {needs:.2} N m",
                standing.sink_m
            ),
            "raise kp or the torque limit, or lower the masses, to those of the real robot",
        ));
    } else if standing.creep_m > CREEP_SHARE * height_m && restless.is_none() {
        findings.push(error(
            "does-not-stand",
            pose(),
            format!("within {LENGTH_S} s of standing the robot creeps {:.3} m along the ground", standing.creep_m),
            "feet that push against each other, or wheels: correct the standing pose and the feet's friction",
        ));
    }
    let min_height_m = robot.settings.limits.min_height_m;
    if min_height_m >= least_height_m {
        findings.push(error(
            "falls-by-definition",
            checkup.origin_of("limits.min_height_m"),
            format!("the body stands {least_height_m:.3} m high, and counts as fallen below {min_height_m} m"),
            "set it between lying on the belly and standing",
        ));
    }
    check_contacts(robot, anatomy, (&simulation, checkup), &mut findings);
    (standing, findings)
}

/// Puts the lowest foot onto the ground.
fn lift_onto_ground(robot: &Robot, simulation: &mut Simulation) {
    simulation.update_positions();
    let feet = robot.leg_addresses.iter().map(|leg| leg.foot);
    let bottom = |foot: usize| simulation.geom_positions_in_world()[foot][2] - robot.model.geom_radius_m(foot);
    let lowest_m = feet.map(bottom).fold(f64::INFINITY, f64::min);
    let (root, _) = robot.root;
    simulation.qpos_mut()[root + 2] -= lowest_m;
}

/// Feet that are not on one level in the standing pose.
fn check_feet(robot: &Robot, anatomy: &Anatomy, checkup: &Checkup, findings: &mut Vec<Finding>) {
    let bottom = |foot: usize| anatomy.geoms[foot].position_in_world[2] - robot.model.geom_radius_m(foot);
    let lowest_m = robot.leg_addresses.iter().map(|leg| bottom(leg.foot)).fold(f64::INFINITY, f64::min);
    for leg in &robot.leg_addresses {
        let lifted_m = bottom(leg.foot) - lowest_m;
        if lifted_m > LIFTED_SHARE * robot.settings.stance_height_m {
            let name = &anatomy.geoms[leg.foot].name;
            findings.push(Finding {
                severity: Severity::Error,
                fault: "foot-in-the-air",
                origin: checkup.origins.of(GEOM, name),
                message: format!("`{name}` is {lifted_m:.3} m above the lowest foot in the standing pose"),
                remedy: "correct the leg, its foot's size, or the standing pose".to_owned(),
            });
        }
    }
}

/// What touches the ground in the end, and what should.
fn check_contacts(
    robot: &Robot,
    anatomy: &Anatomy,
    (simulation, checkup): (&Simulation, &Checkup),
    findings: &mut Vec<Finding>,
) {
    let contacts: Vec<[usize; 2]> = simulation.contacts().collect();
    let on_ground = |geom: usize| contacts.iter().any(|pair| pair.contains(&geom) && pair.contains(&robot.floor));
    let is_down = |geom: usize| simulation.geom_positions_in_world()[geom][2] < 0.5 * robot.model.geom_radius_m(geom);
    for leg in &robot.leg_addresses {
        let name = &anatomy.geoms[leg.foot].name;
        if !on_ground(leg.foot) && is_down(leg.foot) {
            findings.push(Finding {
                severity: Severity::Error,
                fault: "foot-cannot-touch",
                origin: checkup.origins.of_attribute((GEOM, name), &["contype", "conaffinity"]),
                message: format!("`{name}` goes through the ground"),
                remedy: "contype of one has to share a bit with conaffinity of the other".to_owned(),
            });
        }
    }
    // The end of a link may be inside of a soft foot.
    let is_of_foot = |geom: usize| {
        robot.leg_addresses.iter().any(|leg| {
            let own = anatomy.geoms[leg.foot].body;
            let body = anatomy.geoms[geom].body;
            (body == own || body == anatomy.bodies[own].parent) && on_ground(leg.foot)
        })
    };
    let is_other = |&geom: &usize| robot.model.is_on_robot(geom) && !is_of_foot(geom) && on_ground(geom);
    let other = (0..anatomy.geoms.len()).find(is_other);
    if let Some(geom) = other {
        let part = &anatomy.geoms[geom];
        let body = &anatomy.bodies[part.body].name;
        let origin = if part.name.is_empty() {
            checkup.origins.of(&["body"], body)
        } else {
            checkup.origins.of(GEOM, &part.name)
        };
        findings.push(Finding {
            severity: Severity::Error,
            fault: "stands-on-something-else",
            origin,
            message: format!("a part of `{body}` that is no foot is on the ground while the robot stands"),
            remedy: "name the part that stands on the ground as the foot, or correct the standing pose".to_owned(),
        });
    }
}
