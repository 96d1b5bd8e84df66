//! Drafts the `robot.toml` of a model that nobody has described yet, and says what it could not decide.
//!
//! `find` looks for the legs, `pose` makes them stand with their feet below their hips. What the model's file lacks,
//! ground or such a pose, is written into a scene that includes it; the model itself is never changed.

mod find;
mod pose;
mod similarity;
pub mod urdf;

use std::fmt::Write;

use canter_gait::{JointConvention, LegGeometry, LegPosition};

use super::check::is_plain;
use super::settings::{
    Actuated, FiveBarSettings, HeldSettings, KneeSide, LegSettings, LimitSettings, MotorSettings, RobotSettings,
    SerialSettings,
};
use crate::mujoco::Model;
use crate::mujoco::anatomy::Anatomy;
use find::{Found, FoundLeg};
pub use similarity::stepping_by_similarity;

/// What the ground that a scene adds is called.
const FLOOR: &str = "floor";

/// What the keyframe that a scene adds is called.
const KEYFRAME: &str = "standing";

/// A value that the model does not say, or that is a choice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Its key in `robot.toml`.
    pub key: &'static str,
    /// What was taken for it, why, and what to do.
    pub message: String,
}

/// A robot as far as its model says what it is.
#[derive(Clone, Debug)]
pub struct Draft {
    /// What `robot.toml` is to say.
    pub settings: RobotSettings,
    /// MJCF that adds what the model lacks and includes it; none if it lacks nothing.
    pub scene: Option<String>,
    /// What the owner has to look at.
    pub notes: Vec<Note>,
}

/// Why no robot could be drafted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct DraftError(Vec<String>);

/// What a draft is to be called.
#[derive(Clone, Copy, Debug)]
pub struct Names<'a> {
    /// The robot.
    pub robot: &'a str,
    /// The model's file, as seen from `robot.toml`.
    pub model: &'a str,
    /// The scene's file beside it, if there has to be one.
    pub scene: &'a str,
}

/// Drafts the robot of this compiled model.
///
/// # Errors
/// Everything that is in the way: no floating body, fewer than two legs, legs that are built in another way.
pub fn draft(model: &mut Model, names: Names<'_>) -> Result<Draft, DraftError> {
    let mut notes = Vec::new();
    let choice = pose::choose_keyframe(model, &mut notes);
    let anatomy = model.anatomy();
    let found = find::find(&anatomy, &mut notes).map_err(DraftError)?;
    let stood = pose::stand(model, &found, &mut notes).map_err(DraftError)?;
    let anatomy = model.anatomy();
    // The standing pose may have moved the knees to where they are looked for.
    let found = find::find(&anatomy, &mut Vec::new()).map_err(DraftError)?;

    let floor = anatomy.geoms.iter().find(|geom| geom.is_level_ground);
    if floor.is_some_and(|floor| floor.name.is_empty()) {
        let message = "the model's ground, a plane, has no name: give it one, for example name=\"floor\"";
        return Err(DraftError(vec![message.to_owned()]));
    }
    let num_motors = 2 * found.legs.len() + found.held.len();
    let mass_kg = model.total_mass_kg();
    let stance_height_m = stood.stance_height_m;
    let motor = motor(&anatomy, &found, [mass_kg, model.gravity(), stance_height_m], &mut notes);
    let legs = found.legs.iter().map(|leg| leg_settings(&anatomy, leg)).collect::<Vec<_>>();
    let limits = LimitSettings {
        min_height_m: rounded(0.5 * stood.body_height_m),
        max_tilt_deg: 60.0,
        stuck_error_rad: 1.0,
        stuck_time_s: 0.5,
        swing_rad: vec![-1.2, 1.2],
        extension_rad: extension_limits(model, &anatomy, &found, (&legs, stance_height_m)).map_err(DraftError)?,
    };
    note(
        &mut notes,
        "limits.min_height_m",
        "half of the body's height when it stands; lying on its belly it must be lower",
    );
    note(&mut notes, "command_delay_steps", "one control step: measure the delay of the real robot's bus and motors");
    let gaits = similarity::default_gaits(legs.len(), stance_height_m, model.gravity());
    let needs_scene = floor.is_none() || stood.is_new;
    let settings = RobotSettings {
        name: names.robot.to_owned(),
        description: format!("{}: {mass_kg:.1} kg, {} legs, {num_motors} motors", names.robot, legs.len()),
        model: if needs_scene { names.scene } else { names.model }.to_owned(),
        keyframe: if stood.is_new { Some(KEYFRAME.to_owned()) } else { choice },
        body: anatomy.bodies[found.root].name.clone(),
        floor: floor.map_or(FLOOR, |floor| &floor.name).to_owned(),
        stance_height_m,
        command_delay_steps: 1,
        motor,
        limits,
        held: (!found.held.is_empty()).then(|| {
            let held = found.held.iter().map(|&(joint, actuator)| HeldSettings {
                joint: anatomy.joints[joint].name.clone(),
                actuator: anatomy.actuators[actuator].name.clone(),
            });
            held.collect()
        }),
        legs,
        gaits,
    };
    let scene = needs_scene.then(|| scene(names, floor.is_none(), stood.is_new.then(|| model.standing_position())));
    Ok(Draft { settings, scene, notes })
}

fn note(notes: &mut Vec<Note>, key: &'static str, message: impl Into<String>) {
    notes.push(Note { key, message: message.into() });
}

/// To a tenth of a millimetre, or of a thousandth of whatever else.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// A name as it may stand in an attribute of XML.
fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// The name of a robot whose model is called so: what no name may have becomes `_`.
pub fn robot_name(model: &str) -> String {
    let name: String = model.chars().map(|letter| if is_plain(letter) { letter } else { '_' }).collect();
    if name.is_empty() { "robot".to_owned() } else { name }
}

/// The scene that includes the model.
fn scene(names: Names<'_>, needs_floor: bool, standing: Option<&[f64]>) -> String {
    let mut text = format!(
        "<!-- What the model lacks for canter. Written by `canter robot new`; yours to change. -->\n<mujoco model=\"{}\">\n  \
         <include file=\"{}\"/>\n",
        escaped(names.robot),
        escaped(names.model)
    );
    if needs_floor {
        text.push_str("  <worldbody>\n");
        text.push_str(
            "    <geom name=\"floor\" type=\"plane\" size=\"0 0 1\" contype=\"1\" conaffinity=\"1\" rgba=\"0.5 0.5 0.5 1\"/>\n",
        );
        text.push_str("  </worldbody>\n");
    }
    if let Some(standing) = standing {
        let numbers: Vec<_> = standing.iter().map(|value| format!("{}", (value * 1e7).round() / 1e7)).collect();
        let _ = writeln!(
            text,
            "  <keyframe>\n    <!-- The feet straight below the hips. -->\n    <key name=\"{KEYFRAME}\" qpos=\"{}\"/>\n  </keyframe>",
            numbers.join(" ")
        );
    }
    text.push_str("</mujoco>\n");
    text
}

/// What the motors can give, and how their position is controlled.
fn motor(
    anatomy: &Anatomy,
    found: &Found,
    [mass_kg, gravity, stance_height_m]: [f64; 3],
    notes: &mut Vec<Note>,
) -> MotorSettings {
    let weight_torque_nm = mass_kg * gravity * stance_height_m;
    let limits = found.motors().map(|joint| {
        let of_actuators = anatomy.actuators_of(joint).filter_map(|(_, actuator)| match actuator.pull {
            crate::mujoco::anatomy::Pull::Joint(..) => actuator.max_force,
            _ => None,
        });
        of_actuators.chain(anatomy.joints[joint].max_torque_nm).reduce(f64::min)
    });
    let limits: Vec<Option<f64>> = limits.collect();
    let known = limits.iter().flatten().copied().filter(|limit| *limit > 0.0).reduce(f64::min);
    let greatest = limits.iter().flatten().copied().fold(0.0, f64::max);
    let max_torque_nm = known.unwrap_or_else(|| rounded(weight_torque_nm));
    match known {
        None => note(
            notes,
            "motor.max_torque_nm",
            format!(
                "the model limits no motor's torque; {max_torque_nm} N m would lift the robot with one leg stretched out \
                 level: put in the motor's own limit behind its gear"
            ),
        ),
        Some(least) if greatest > least * 1.001 => note(
            notes,
            "motor.max_torque_nm",
            format!("the model's limits differ, up to {greatest} N m; the least is taken for all motors"),
        ),
        Some(_) => {}
    }
    let stall_torque_nm = rounded(2.0 * max_torque_nm);
    let no_load_speed_rad_per_s = ((5.0 * (gravity / stance_height_m).sqrt()) * 10.0).round() / 10.0;
    note(
        notes,
        "motor.stall_torque_nm",
        format!(
            "no model says it; {stall_torque_nm} N m is twice the limit: take torque constant times voltage over winding \
             resistance times gear"
        ),
    );
    note(
        notes,
        "motor.no_load_speed_rad_per_s",
        format!(
            "no model says it; {no_load_speed_rad_per_s} rad/s is usual for this size: take the motor's data sheet"
        ),
    );
    let servos = found.actuators().map(|actuator| anatomy.actuators[actuator].position_gain);
    let needs_control = servos.into_iter().any(|gain| gain.is_none());
    let gains = needs_control.then(|| {
        let kp = 2.0 * weight_torque_nm;
        let kv = 0.12 * kp * (stance_height_m / gravity).sqrt();
        [kp, kv].map(|gain| format!("{gain:.2e}").parse::<f64>().unwrap_or(gain))
    });
    if let Some([kp, kv]) = gains {
        note(
            notes,
            "motor.position_gain_nm_per_rad",
            format!(
                "the model's actuators are given torques, canter's controller gives angles: a position control with \
                 {kp} N m/rad and {kv} N m s/rad takes their place; put in those of the real robot"
            ),
        );
    }
    MotorSettings {
        max_torque_nm,
        stall_torque_nm,
        no_load_speed_rad_per_s,
        position_gain_nm_per_rad: gains.map(|[kp, _]| kp),
        velocity_gain_nm_s_per_rad: gains.map(|[_, kv]| kv),
    }
}

fn leg_settings(anatomy: &Anatomy, leg: &FoundLeg) -> LegSettings {
    let joints = |ids: [usize; 2]| ids.map(|id| anatomy.joints[id].name.clone()).to_vec();
    let actuators = leg.actuators.map(|id| anatomy.actuators[id].name.clone()).to_vec();
    let [upper, lower] = leg.links_m(anatomy).map(rounded);
    let geom = &anatomy.geoms[leg.foot];
    let foot = if geom.name.is_empty() { anatomy.bodies[geom.body].name.clone() } else { geom.name.clone() };
    match leg.knees {
        Some(knees) => LegSettings::FiveBar(FiveBarSettings {
            name: leg.name.clone(),
            foot,
            upper_link_m: upper,
            lower_link_m: lower,
            hip_separation_m: Some(rounded(leg.hip_separation_m(anatomy))).filter(|&separation| separation > 5e-4),
            motors: joints(leg.motors),
            knees: joints(knees),
            actuators,
            actuated: if leg.is_in_leg_space { Actuated::LegSpace } else { Actuated::Motors },
        }),
        None => {
            let [hip, knee] = leg.motors.map(|joint| anatomy.joints[joint].anchor_in_world);
            let is_in_front = knee[0] > hip[0];
            LegSettings::Serial(SerialSettings {
                name: leg.name.clone(),
                foot,
                upper_link_m: upper,
                lower_link_m: lower,
                knee: if is_in_front { KneeSide::Front } else { KneeSide::Back },
                motors: joints(leg.motors),
                actuators,
            })
        }
    }
}

/// Least and greatest extension [rad] that every leg can have: well inside of what links and joints allow.
fn extension_limits(
    model: &Model,
    anatomy: &Anatomy,
    found: &Found,
    (legs, stance_height_m): (&[LegSettings], f64),
) -> Result<Vec<f64>, Vec<String>> {
    const STEP_RAD: f32 = 0.01;
    const FARTHEST_RAD: f32 = 3.0;
    let mut limits = [-FARTHEST_RAD, FARTHEST_RAD];
    for (settings, leg) in legs.iter().zip(&found.legs) {
        let Some(geometry) = super::check::geometry(settings, stance_height_m) else {
            return Err(vec![format!("the leg {} cannot stand at {stance_height_m} m with its links", leg.name)]);
        };
        let lengths = [lengths_m(&geometry)[0], lengths_m(&geometry)[1]];
        let is_possible = |extension: f32| {
            let position = LegPosition { swing: 0.0, extension };
            let length = geometry.length(extension);
            let turned = geometry.motor_angles(position);
            let fits = turned.iter().zip(leg.motors).all(|(&angle, joint)| {
                let part = &anatomy.joints[joint];
                let (place, _) = model.joint_addresses(joint);
                let convention = JointConvention {
                    sign: find::forward_sign(part.axis_in_world) as f32,
                    standing: model.standing_position()[place] as f32,
                };
                let angle = f64::from(convention.joint_angle(angle));
                part.range.is_none_or(|[low, high]| (low..=high).contains(&angle))
            });
            let back = geometry.inverse(geometry.forward(position));
            fits && (lengths[0]..=lengths[1]).contains(&length)
                && back.is_some_and(|back| (back.extension - extension).abs() < 1e-3)
        };
        for (limit, sign) in limits.iter_mut().zip([-1.0_f32, 1.0]) {
            let steps = (1..).map(|i| sign * STEP_RAD * i as f32).take_while(|e| e.abs() <= limit.abs());
            *limit = steps.take_while(|&extension| is_possible(extension)).last().unwrap_or(sign * STEP_RAD);
        }
    }
    Ok(limits.map(|limit| (f64::from(limit) * 1e3).round() / 1e3).to_vec())
}

/// Least and greatest length [m] that a leg is to have.
fn lengths_m(geometry: &LegGeometry) -> [f32; 2] {
    let (upper, lower, half) = match geometry {
        LegGeometry::FiveBar(leg) => (leg.upper_link_m(), leg.lower_link_m(), 0.5 * leg.hip_separation_m()),
        LegGeometry::Serial(leg) => (leg.upper_link_m(), leg.lower_link_m(), 0.0),
    };
    let longest = ((upper + lower).powi(2) - half * half).sqrt();
    // With links of one length the leg could fold up altogether; the body is in the way.
    let shortest = (lower - upper + half).max(0.4 * longest);
    [1.1 * shortest, 0.98 * longest]
}

/// What a draft's file begins with: the notes, as comments.
pub fn header(draft: &Draft) -> String {
    let mut text = format!(
        "# {}.\n# Drafted by `canter robot new`. Look through what the model does not say:\n",
        draft.settings.description
    );
    for Note { key, message } in &draft.notes {
        let _ = writeln!(text, "# - {key}: {message}");
    }
    text.push_str("# Then try it: canter robot check FOLDER/robot.toml\n\n");
    text
}
