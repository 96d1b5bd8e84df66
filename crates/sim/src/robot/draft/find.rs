//! Finds the legs of a model: what hangs from the floating body, reaches down and has two motors that swing it.

use super::{Note, note};
use crate::mujoco::anatomy::{Anatomy, GeomPart, JointKind, Pull};

/// How far the axis of a joint that swings a leg may be from straight left or right: its least part along y.
const LEAST_ALONG_Y: f64 = 0.9;

/// A leg.
#[derive(Clone, Debug)]
pub(super) struct FoundLeg {
    pub name: String,
    /// Geom of the foot.
    pub foot: usize,
    /// The motor joints in the order of `robot.toml`.
    pub motors: [usize; 2],
    /// The passive joints of a five-bar leg.
    pub knees: Option<[usize; 2]>,
    pub actuators: [usize; 2],
    /// Whether the actuators pull on tendons that are swing and extension.
    pub is_in_leg_space: bool,
}

/// What was found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// The floating body.
    pub root: usize,
    pub legs: Vec<FoundLeg>,
    /// Joints that are held still, and their actuators.
    pub held: Vec<(usize, usize)>,
}

impl Found {
    /// The motor joints: those of the legs, then those that are held.
    pub fn motors(&self) -> impl Iterator<Item = usize> {
        let legs = self.legs.iter().flat_map(|leg| leg.motors);
        legs.chain(self.held.iter().map(|&(joint, _)| joint))
    }

    /// The actuators in the same order.
    pub fn actuators(&self) -> impl Iterator<Item = usize> {
        let legs = self.legs.iter().flat_map(|leg| leg.actuators);
        legs.chain(self.held.iter().map(|&(_, actuator)| actuator))
    }
}

impl FoundLeg {
    /// Lengths of upper and lower link [m], in the plane of forward and up.
    pub fn links_m(&self, anatomy: &Anatomy) -> [f64; 2] {
        let hip = anatomy.joints[self.motors[0]].anchor_in_world;
        let knee = anatomy.joints[self.knees.map_or(self.motors[1], |[knee, _]| knee)].anchor_in_world;
        let foot = anatomy.geoms[self.foot].position_in_world;
        [distance(hip, knee), distance(knee, foot)]
    }

    /// Distance between the hips of a five-bar leg [m].
    pub fn hip_separation_m(&self, anatomy: &Anatomy) -> f64 {
        let [front, back] = self.motors.map(|joint| anatomy.joints[joint].anchor_in_world);
        if self.knees.is_some() { distance(front, back) } else { 0.0 }
    }

    /// Where the leg hangs from: the hip's axis, or the middle between the two [m].
    pub fn hip(&self, anatomy: &Anatomy) -> [f64; 3] {
        let [first, second] = self.motors.map(|joint| anatomy.joints[joint].anchor_in_world);
        if self.knees.is_some() { std::array::from_fn(|axis| 0.5 * (first[axis] + second[axis])) } else { first }
    }
}

/// Distance of two points in the plane of forward and up [m].
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).hypot(a[2] - b[2])
}

/// 1 where a joint turns a hanging link forward, -1 where it turns it back.
pub(super) fn forward_sign(axis_in_world: [f64; 3]) -> f64 {
    // Forward is x, up is z: a link that hangs down turns forward about -y.
    if axis_in_world[1] > 0.0 { -1.0 } else { 1.0 }
}

/// Finds floating body, legs and motors.
///
/// # Errors
/// What is in the way.
pub(super) fn find(anatomy: &Anatomy, notes: &mut Vec<Note>) -> Result<Found, Vec<String>> {
    let Some(root) = anatomy.floating_body() else {
        let message = "the model has no body with a free joint: it cannot walk away. Put <freejoint/> into its trunk";
        return Err(vec![message.to_owned()]);
    };
    if anatomy.bodies[root].name.is_empty() {
        return Err(vec!["the floating body has no name: give it one".to_owned()]);
    }
    let mut problems = Vec::new();
    let (mut legs, mut held, mut without_foot) = (Vec::new(), Vec::new(), Vec::new());
    for bodies in limbs(anatomy, root) {
        let motors = motors_of(anatomy, &bodies);
        if motors.is_empty() {
            continue;
        }
        match leg(anatomy, &bodies, &motors) {
            Ok(leg) => {
                held.extend(motors.iter().copied().filter(|joint| !leg.motors.contains(joint)));
                legs.push(leg);
            }
            Err(reason) => {
                without_foot.push(format!("`{}`: {reason}", anatomy.bodies[bodies[0]].name));
                held.extend(motors);
            }
        }
    }
    if legs.len() < 2 {
        problems.push(format!("found {} legs; expected at least two that swing about y, forward being x", legs.len()));
        problems.extend(without_foot.iter().map(|reason| format!("what hangs from {reason}")));
        return Err(problems);
    }
    for reason in without_foot {
        note(notes, "legs", format!("what hangs from {reason}; its motors are held still"));
    }
    sort_and_name(anatomy, &mut legs);
    let mut found_held = Vec::new();
    for joint in held {
        let servo = anatomy.actuators_of(joint).find(|(_, actuator)| matches!(actuator.pull, Pull::Joint(..)));
        match servo {
            Some((actuator, _)) => found_held.push((joint, actuator)),
            None => problems
                .push(format!("the motor of `{}` is no joint's own: it cannot be held", anatomy.joints[joint].name)),
        }
    }
    let found = Found { root, legs, held: found_held };
    let unnamed = found.motors().filter(|&joint| anatomy.joints[joint].name.is_empty());
    problems.extend(unnamed.map(|joint| {
        format!("a joint of body `{}` has no name: give it one", anatomy.bodies[anatomy.joints[joint].body].name)
    }));
    for (joint, actuator) in found.motors().zip(found.actuators()) {
        if anatomy.actuators[actuator].name.is_empty() {
            problems.push(format!("the actuator of `{}` has no name: give it one", anatomy.joints[joint].name));
        }
    }
    if problems.is_empty() { Ok(found) } else { Err(problems) }
}

/// What hangs from the body, each limb as its bodies, those that a loop closes together as one.
fn limbs(anatomy: &Anatomy, root: usize) -> Vec<Vec<usize>> {
    let num_bodies = anatomy.bodies.len();
    // The body of each limb that hangs from the root itself.
    let mut limb_of: Vec<Option<usize>> = (0..num_bodies)
        .map(|body| {
            anatomy.ancestors(body).find(|&ancestor| anatomy.bodies[ancestor].parent == root && ancestor != root)
        })
        .collect();
    for [first, second] in &anatomy.connected {
        if let (Some(first), Some(second)) = (limb_of[*first], limb_of[*second]) {
            let joined = |limb: &mut Option<usize>| {
                if *limb == Some(second) {
                    *limb = Some(first);
                }
            };
            limb_of.iter_mut().for_each(joined);
        }
    }
    let mut limbs: Vec<(usize, Vec<usize>)> = Vec::new();
    for (body, limb) in limb_of.iter().enumerate() {
        let Some(limb) = *limb else { continue };
        match limbs.iter_mut().find(|(number, _)| *number == limb) {
            Some((_, bodies)) => bodies.push(body),
            None => limbs.push((limb, vec![body])),
        }
    }
    limbs.into_iter().map(|(_, bodies)| bodies).collect()
}

/// The hinges in these bodies that actuators pull on, nearest to the root first.
fn motors_of(anatomy: &Anatomy, bodies: &[usize]) -> Vec<usize> {
    let is_motor = |&joint: &usize| {
        let part = &anatomy.joints[joint];
        bodies.contains(&part.body) && part.kind == JointKind::Hinge && anatomy.actuators_of(joint).next().is_some()
    };
    let mut motors: Vec<usize> = (0..anatomy.joints.len()).filter(is_motor).collect();
    motors.sort_by_key(|&joint| anatomy.ancestors(anatomy.joints[joint].body).count());
    motors
}

/// The leg that these bodies are.
fn leg(anatomy: &Anatomy, bodies: &[usize], motors: &[usize]) -> Result<FoundLeg, String> {
    let along_y = |&&joint: &&usize| anatomy.joints[joint].axis_in_world[1].abs() > LEAST_ALONG_Y;
    let swinging: Vec<usize> = motors.iter().filter(along_y).copied().collect();
    let lowest = |geom: &GeomPart| geom.position_in_world[2] - geom.size[0];
    let spheres = (0..anatomy.geoms.len()).filter(|&id| {
        let geom = &anatomy.geoms[id];
        bodies.contains(&geom.body) && geom.collides && geom.is_sphere
    });
    let foot = spheres.min_by(|&a, &b| lowest(&anatomy.geoms[a]).total_cmp(&lowest(&anatomy.geoms[b])));
    let Some(foot) = foot else {
        return Err("it has no sphere that can touch the ground, for a foot".to_owned());
    };
    if anatomy.geoms[foot].name.is_empty() && anatomy.bodies[anatomy.geoms[foot].body].name.is_empty() {
        return Err("its foot, a sphere, has no name".to_owned());
    }
    let &[first, second, ..] = &swinging[..] else {
        return Err(format!("{} of its motors swing it about y; expected two", swinging.len()));
    };
    let is_loop = anatomy.connected.iter().any(|pair| pair.iter().all(|body| bodies.contains(body)));
    if is_loop {
        return five_bar(anatomy, bodies, [first, second], foot);
    }
    let is_above =
        |joint: usize| anatomy.ancestors(anatomy.geoms[foot].body).any(|body| body == anatomy.joints[joint].body);
    if !is_above(first) || !is_above(second) {
        return Err("its motors are not one after the other on the way to its foot".to_owned());
    }
    let servo = |joint: usize| {
        let own = anatomy.actuators_of(joint).find(|(_, actuator)| matches!(actuator.pull, Pull::Joint(..)));
        own.map(|(id, _)| id).ok_or_else(|| format!("`{}` has no actuator of its own", anatomy.joints[joint].name))
    };
    Ok(FoundLeg {
        name: String::new(),
        foot,
        motors: [first, second],
        knees: None,
        actuators: [servo(first)?, servo(second)?],
        is_in_leg_space: false,
    })
}

/// A leg that closes a loop.
fn five_bar(anatomy: &Anatomy, bodies: &[usize], motors: [usize; 2], foot: usize) -> Result<FoundLeg, String> {
    let is_passive = |&joint: &usize| {
        let part = &anatomy.joints[joint];
        part.kind == JointKind::Hinge && bodies.contains(&part.body) && anatomy.actuators_of(joint).next().is_none()
    };
    let passive: Vec<usize> = (0..anatomy.joints.len()).filter(is_passive).collect();
    let knee_of = |motor: usize| {
        let body = anatomy.joints[motor].body;
        let below = |&joint: &usize| anatomy.ancestors(anatomy.joints[joint].body).any(|ancestor| ancestor == body);
        let knee = passive.iter().copied().find(below);
        knee.ok_or_else(|| format!("`{}` has no passive joint below it", anatomy.joints[motor].name))
    };
    let mut halves = [(motors[0], knee_of(motors[0])?), (motors[1], knee_of(motors[1])?)];
    let ahead = |&(motor, knee): &(usize, usize)| {
        anatomy.joints[knee].anchor_in_world[0] - anatomy.joints[motor].anchor_in_world[0]
    };
    // The one whose link points forward first.
    halves.sort_by(|a, b| ahead(b).total_cmp(&ahead(a)));
    let (motors, knees) = (halves.map(|(motor, _)| motor), halves.map(|(_, knee)| knee));
    let own = |joint: usize| {
        let mut actuators = anatomy.actuators_of(joint);
        actuators.find(|(_, actuator)| matches!(actuator.pull, Pull::Joint(..))).map(|(id, _)| id)
    };
    let (actuators, is_in_leg_space) = match motors.map(own) {
        [Some(first), Some(second)] => ([first, second], false),
        _ => (coupled(anatomy, motors)?, true),
    };
    Ok(FoundLeg { name: String::new(), foot, motors, knees: Some(knees), actuators, is_in_leg_space })
}

/// The two actuators that pull on both motors: the one for swing, which turns both the same way, then that for extension.
fn coupled(anatomy: &Anatomy, motors: [usize; 2]) -> Result<[usize; 2], String> {
    let (mut swing, mut extension) = (None, None);
    for (id, actuator) in anatomy.actuators_of(motors[0]) {
        let Pull::Tendon(joints) = &actuator.pull else { continue };
        let forward = |motor: usize| {
            let coefficient = joints.iter().find(|(joint, _)| *joint == motor).map(|(_, coefficient)| *coefficient);
            coefficient.map(|value| value * forward_sign(anatomy.joints[motor].axis_in_world))
        };
        if let (Some(front), Some(back)) = (forward(motors[0]), forward(motors[1])) {
            if front * back > 0.0 { swing = Some(id) } else { extension = Some(id) }
        }
    }
    swing.zip(extension).map(Into::into).ok_or_else(|| {
        format!("`{}` is neither turned by itself nor coupled as swing and extension", anatomy.joints[motors[0]].name)
    })
}

/// Left legs from front to back, then right legs from back to front, named by where they are.
fn sort_and_name(anatomy: &Anatomy, legs: &mut [FoundLeg]) {
    let place = |leg: &FoundLeg| {
        let hip = leg.hip(anatomy);
        let foot = anatomy.geoms[leg.foot].position_in_world;
        (foot[1] > 0.0, hip[0])
    };
    legs.sort_by(|a, b| {
        let ((a_left, a_x), (b_left, b_x)) = (place(a), place(b));
        // Left first; forward first on the left, backward first on the right.
        b_left.cmp(&a_left).then(if a_left { b_x.total_cmp(&a_x) } else { a_x.total_cmp(&b_x) })
    });
    let lefts: Vec<bool> = legs.iter().map(|leg| place(leg).0).collect();
    for side in [true, false] {
        let count = lefts.iter().filter(|&&left| left == side).count();
        let own = legs.iter_mut().zip(&lefts).filter(|(_, left)| **left == side);
        for (row, (leg, _)) in own.enumerate() {
            let from_front = if side { row } else { count - 1 - row };
            let row_name = match (count, from_front) {
                (2..=3, 0) => "front".to_owned(),
                (2, 1) | (3, 2) => "back".to_owned(),
                (3, 1) => "middle".to_owned(),
                _ => format!("row{}", from_front + 1),
            };
            leg.name = format!("{row_name}_{}", if side { "left" } else { "right" });
        }
    }
}
