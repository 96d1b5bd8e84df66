//! Left and right exchanged: what becomes of observation and action in a mirror.

use canter_gait::mirror::{Component, Mirror};
use canter_gait::prior::LegGait;
use canter_gait::{Modulation, ObservationBlock};

use crate::mujoco::Simulation;
use crate::robot::Robot;

/// How far a foot may stand from where the mirror has its partner [m].
const TOLERANCE_M: f64 = 1e-4;

/// How far a leg may be from its partner's position half a cycle later [rad].
const TOLERANCE_RAD: f32 = 1e-3;

/// What [`Mirror`] borrows, checked to be a mirror.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorMaps {
    observation: Vec<Component>,
    action: Vec<Component>,
    sine: usize,
}

impl MirrorMaps {
    /// The mirror of a policy on a robot's gait: left and right legs change places.
    ///
    /// # Errors
    /// Why robot, gait or observation have no mirror image that is themselves half a cycle later.
    pub fn new(
        robot: &Robot,
        legs: &[LegGait],
        modulation: Modulation,
        blocks: &[ObservationBlock],
    ) -> Result<Self, String> {
        let partners = partners(robot)?;
        check_gait(legs, &partners)?;
        let action = match modulation {
            Modulation::Amplitude => unchanged(2),
            Modulation::LegAmplitude | Modulation::Residual | Modulation::Direct => of_legs(&partners, 2),
            Modulation::Modulate => {
                // The frequency, then as many parameters for each leg.
                let width = (modulation.num_actions(partners.len()) - 1) / partners.len();
                append(unchanged(1), &of_legs(&partners, width))
            }
        };
        let (mut observation, mut sine) = (Vec::new(), None);
        for block in blocks {
            let components = match block {
                ObservationBlock::MotorAngles | ObservationBlock::MotorVelocities => of_legs(&partners, 2),
                // Roll and yaw turn about axes in the mirror's plane, pitch about the one across it.
                ObservationBlock::Orientation | ObservationBlock::AngularVelocity => signed(&[-1.0, 1.0, -1.0]),
                ObservationBlock::Phase => {
                    sine = Some(observation.len());
                    // Half a cycle later.
                    signed(&[-1.0, -1.0])
                }
                ObservationBlock::PreviousAction => action.clone(),
            };
            observation = append(observation, &components);
        }
        let sine = sine.ok_or("the policy has to observe `phase`")?;
        Ok(Self { observation, action, sine })
    }

    /// Maps from a file; none if they are no mirror.
    ///
    /// # Shapes
    /// - `observation`: `(O)`
    /// - `action`: `(A)`
    /// - `sine`: which component of the observation is the sine of the phase
    pub fn from_components(observation: Vec<Component>, action: Vec<Component>, sine: usize) -> Option<Self> {
        Mirror::new(&observation, &action, sine)?;
        Some(Self { observation, action, sine })
    }

    /// What becomes of each component of an observation, `(O)`.
    pub fn observation(&self) -> &[Component] {
        &self.observation
    }

    /// What becomes of each component of an action, `(A)`.
    pub fn action(&self) -> &[Component] {
        &self.action
    }

    /// Which component of the observation is the sine of the phase.
    pub fn sine(&self) -> usize {
        self.sine
    }

    /// The maps as the robot's code takes them.
    #[inline]
    pub fn mirror(&self) -> Mirror<'_> {
        Mirror::from_checked(&self.observation, &self.action, self.sine)
    }
}

fn unchanged(len: usize) -> Vec<Component> {
    (0..len).map(|source| Component { source, sign: 1.0 }).collect()
}

fn signed(signs: &[f32]) -> Vec<Component> {
    signs.iter().enumerate().map(|(source, &sign)| Component { source, sign }).collect()
}

/// `width` components for each leg, taken from its partner.
fn of_legs(partners: &[usize], width: usize) -> Vec<Component> {
    let component = |source| Component { source, sign: 1.0 };
    partners.iter().flat_map(|partner| (0..width).map(move |i| component(partner * width + i))).collect()
}

/// Components behind others; their sources move on by as many.
fn append(mut first: Vec<Component>, second: &[Component]) -> Vec<Component> {
    let start = first.len();
    first.extend(second.iter().map(|&Component { source, sign }| Component { source: start + source, sign }));
    first
}

/// For each leg the one that the mirror has in its place.
fn partners(robot: &Robot) -> Result<Vec<usize>, String> {
    let mut simulation = Simulation::new(&robot.model);
    simulation.update_positions();
    let (root, _) = robot.root;
    let origin = [simulation.qpos()[root], simulation.qpos()[root + 1]];
    let feet: Vec<[f64; 2]> = robot
        .leg_addresses
        .iter()
        .map(|address| simulation.geom_positions_in_world()[address.foot])
        .map(|foot| [foot[0] - origin[0], foot[1] - origin[1]])
        .collect();
    let partner = |(index, foot): (usize, &[f64; 2])| {
        let is_mirrored = |other: &[f64; 2]| (foot[0] - other[0]).hypot(foot[1] + other[1]) < TOLERANCE_M;
        let place = feet.iter().position(is_mirrored);
        // Motors that turn the other way, or other links, would need signs that are not known here.
        let place = place.filter(|&place| robot.legs[place] == robot.legs[index]);
        place.ok_or_else(|| {
            let (name, robot) = (robot.settings.legs[index].name(), &robot.settings.name);
            format!("leg `{name}` of {robot} has no equal leg in its place on the other side")
        })
    };
    feet.iter().enumerate().map(partner).collect()
}

/// Phases at which a gait is held to its image.
const PROBES: usize = 32;

/// Whether the gait in the mirror is the gait half a cycle later.
fn check_gait(legs: &[LegGait], partners: &[usize]) -> Result<(), String> {
    let is_mirrored = legs.iter().zip(partners).all(|(leg, &partner)| {
        let partner = &legs[partner];
        let is_near = |a: f32, b: f32| (a - b).abs() < TOLERANCE_RAD;
        (0..PROBES).all(|probe| {
            let phase = probe as f32 / PROBES as f32;
            let (own, image) = (leg.position(phase, &leg.defaults), partner.position(phase + 0.5, &partner.defaults));
            is_near(own.swing, image.swing) && is_near(own.extension, image.extension)
        })
    });
    if is_mirrored { Ok(()) } else { Err("in the mirror its gait is not itself half a cycle later".to_owned()) }
}
