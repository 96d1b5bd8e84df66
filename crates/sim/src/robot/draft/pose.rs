//! Makes a model stand: its feet straight below its hips, all legs of one length.

use super::find::{self, Found};
use super::{Note, note, rounded};
use crate::mujoco::{Model, Simulation};

/// Keyframes whose name has one of these words are standing poses, the first of them first.
const STANDING_WORDS: [&str; 4] = ["home", "stand", "stance", "rest"];

/// How far a foot may be from where it should stand [m].
const TOLERANCE_M: f64 = 2e-4;

/// The longest that a standing leg is, as a share of its links: it has to push down in mid-stance.
const LONGEST_SHARE: f64 = 0.78;

/// How long a leg stands where the model does not say, as a share of its links.
const USUAL_SHARE: f64 = 0.68;

/// How the model stands now.
pub(super) struct Stood {
    /// Leg length [m].
    pub stance_height_m: f64,
    /// The floating body above the ground [m].
    pub body_height_m: f64,
    /// Whether this is no pose of the model's own.
    pub is_new: bool,
}

/// Makes the model stand as in the keyframe that looks like a standing pose; returns its name, none for the reference
/// configuration.
pub(super) fn choose_keyframe(model: &mut Model, notes: &mut Vec<Note>) -> Option<String> {
    let keyframes = model.anatomy().keyframes;
    let is_called = |word: &&str| keyframes.iter().find(|name| name.to_lowercase().contains(*word));
    let chosen = STANDING_WORDS.iter().find_map(is_called);
    let chosen = chosen.or_else(|| keyframes.iter().find(|name| !name.is_empty())).cloned();
    if let Some(name) = chosen.as_ref().filter(|_| keyframes.len() > 1) {
        note(notes, "keyframe", format!("`{name}` of {} keyframes looks most like standing", keyframes.len()));
    }
    chosen.filter(|name| model.stand_as_in(name))
}

/// Puts the feet straight below the hips where they are not, and the body above the ground.
///
/// # Errors
/// Legs that cannot be stood on.
pub(super) fn stand(model: &mut Model, found: &Found, notes: &mut Vec<Note>) -> Result<Stood, Vec<String>> {
    let root = model.free_joint(found.root).expect("the floating body has a free joint");
    let (place, _) = model.joint_addresses(root);
    let mut pose = model.standing_position().to_vec();
    let mut is_new = false;
    let upright = [1.0, 0.0, 0.0, 0.0];
    if pose[place + 3..place + 7].iter().zip(upright).any(|(a, b): (&f64, f64)| (a - b).abs() > 1e-6) {
        pose[place + 3..place + 7].copy_from_slice(&upright);
        is_new = true;
    }
    for &(joint, _) in &found.held {
        let (place, _) = model.joint_addresses(joint);
        let is_sideways = model.anatomy().joints[joint].axis_in_world[0].abs() > 0.9;
        if is_sideways && pose[place] != 0.0 {
            pose[place] = 0.0;
            is_new = true;
        }
    }
    model.stand_at(pose.clone());
    let anatomy = model.anatomy();
    let place_of_foot = |leg: &find::FoundLeg| {
        let (hip, foot) = (leg.hip(&anatomy), anatomy.geoms[leg.foot].position_in_world);
        [foot[0] - hip[0], hip[2] - foot[2]]
    };
    let places: Vec<[f64; 2]> = found.legs.iter().map(place_of_foot).collect();
    let num_legs = places.len() as f64;
    let mean_m = places.iter().map(|[_, down]| down).sum::<f64>() / num_legs;
    let longest_m = found.legs.iter().map(|leg| leg.links_m(&anatomy).iter().sum()).fold(f64::INFINITY, f64::min);
    let is_closed = found.legs.iter().any(|leg| leg.knees.is_some());
    let mut stance_height_m = rounded(mean_m);
    if !is_closed && !(0.3 * longest_m..=LONGEST_SHARE * longest_m).contains(&mean_m) {
        stance_height_m = rounded(USUAL_SHARE * longest_m);
        let message = format!(
            "the model's pose has legs of {mean_m:.3} m of at most {longest_m:.3} m, which leaves no room to push down; \
             {stance_height_m} m were taken"
        );
        note(notes, "stance_height_m", message);
    }
    let is_off = |[ahead, down]: &[f64; 2]| ahead.hypot(down - stance_height_m) > TOLERANCE_M;
    if places.iter().any(is_off) {
        if is_closed {
            return Err(vec![format!(
                "the feet are not straight below the middle of their hips, all {stance_height_m} m down, in the model's \
                 pose: put the standing pose of these closed loops into a keyframe"
            )]);
        }
        for leg in &found.legs {
            solve(model, leg, stance_height_m, &mut pose)?;
        }
        is_new = true;
    }
    // On the ground.
    model.stand_at(pose.clone());
    let anatomy = model.anatomy();
    let lowest = |leg: &find::FoundLeg| {
        let foot = &anatomy.geoms[leg.foot];
        foot.position_in_world[2] - foot.size[0]
    };
    let lowest_m = found.legs.iter().map(lowest).fold(f64::INFINITY, f64::min);
    pose[place + 2] -= lowest_m;
    let body_height_m = pose[place + 2];
    model.stand_at(pose);
    if is_new {
        note(
            notes,
            "keyframe",
            "the model has no pose with every foot straight below its hip, as canter counts leg angles from; one was \
             worked out and is in the scene's file",
        );
    }
    Ok(Stood { stance_height_m, body_height_m, is_new })
}

/// Turns hip and knee until the foot is straight below the hip, so far down [m].
fn solve(model: &Model, leg: &find::FoundLeg, stance_height_m: f64, pose: &mut [f64]) -> Result<(), Vec<String>> {
    let anatomy = model.anatomy();
    let places = leg.motors.map(|joint| model.joint_addresses(joint).0);
    let mut simulation = Simulation::new(model);
    let mut error = |angles: [f64; 2], pose: &mut [f64]| {
        for (place, angle) in places.into_iter().zip(angles) {
            pose[place] = angle;
        }
        simulation.qpos_mut().copy_from_slice(pose);
        simulation.update_positions();
        let hip = simulation.joint_positions_in_world()[leg.motors[0]];
        let foot = simulation.geom_positions_in_world()[leg.foot];
        [foot[0] - hip[0], hip[2] - foot[2] - stance_height_m]
    };
    let began = places.map(|place| pose[place]);
    // A stretched leg does not know which way to bend.
    let knee = &anatomy.joints[leg.motors[1]];
    let middle = knee.range.map_or(0.0, |[low, high]| 0.5 * (low + high));
    let behind = -1.2 * find::forward_sign(knee.axis_in_world);
    let starts = [began, [began[0], middle], [began[0] - 0.5 * behind, behind], [began[0] + 0.5 * behind, -behind]];
    for start in starts {
        let mut angles = start;
        for _ in 0..50 {
            let [x, z] = error(angles, pose);
            if x.hypot(z) < 1e-7 {
                break;
            }
            const STEP_RAD: f64 = 1e-5;
            let columns = [0, 1].map(|axis| {
                let mut moved = angles;
                moved[axis] += STEP_RAD;
                let [moved_x, moved_z] = error(moved, pose);
                [(moved_x - x) / STEP_RAD, (moved_z - z) / STEP_RAD]
            });
            let determinant = columns[0][0] * columns[1][1] - columns[1][0] * columns[0][1];
            if determinant.abs() < 1e-9 {
                break;
            }
            let step = [
                (x * columns[1][1] - z * columns[1][0]) / determinant,
                (z * columns[0][0] - x * columns[0][1]) / determinant,
            ];
            for (angle, step) in angles.iter_mut().zip(step) {
                *angle -= step.clamp(-0.3, 0.3);
            }
        }
        let [x, z] = error(angles, pose);
        let is_allowed =
            leg.motors.iter().zip(angles).all(|(&joint, angle)| {
                anatomy.joints[joint].range.is_none_or(|[low, high]| (low..=high).contains(&angle))
            });
        if x.hypot(z) < TOLERANCE_M && is_allowed {
            return Ok(());
        }
    }
    Err(vec![format!("the leg {} cannot stand with its foot {stance_height_m} m straight below its hip", leg.name)])
}
