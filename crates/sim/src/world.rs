//! What the physics of an episode is like: ground, robot and motors as they differ from the model's file.

use crate::frame;
use crate::mujoco::Simulation;
use crate::robot::Robot;
use crate::task::TaskSettings;

/// What the physics of an episode is like. Nothing of it changes during the episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// Slope of the ground, positive uphill [rad].
    pub slope_rad: f64,
    /// Slope across, positive where the ground rises to the left [rad].
    pub cross_slope_rad: f64,
    /// Roughness of the ground, in stance heights.
    pub roughness: f64,
    /// Sliding friction; none: the model's own.
    pub friction: Option<f64>,
    /// Factor of every mass and moment of inertia.
    pub mass_factor: f64,
    /// Shift of the trunk's centre of mass along its axes, in stance heights.
    pub com_shift: [f64; 3],
    /// Factor of what the motors can give.
    pub strength_factor: f64,
    /// Factor of the position controllers' gains.
    pub gain_factor: f64,
    /// Time from a command to its effect [s]; none: the robot's own.
    pub delay_s: Option<f64>,
}

impl World {
    /// A task's own, without any variation.
    pub fn of(task: &TaskSettings) -> Self {
        Self {
            slope_rad: task.slope_deg.to_radians(),
            cross_slope_rad: task.cross_slope_deg.unwrap_or(0.0).to_radians(),
            roughness: task.ground.as_ref().and_then(|ground| ground.roughness).unwrap_or(0.0),
            friction: task.friction,
            mass_factor: task.mass_factor.unwrap_or(1.0),
            com_shift: [0.0; 3],
            strength_factor: task.strength_factor.unwrap_or(1.0),
            gain_factor: 1.0,
            delay_s: task.delay_s,
        }
    }

    /// Makes the physics that was `before`, on the robot's own model, what this says; what is equal is not touched.
    ///
    /// The simulation's state is lost.
    pub(crate) fn apply(&self, before: &Self, robot: &Robot, simulation: &mut Simulation) {
        let slopes = |world: &Self| [world.slope_rad, world.cross_slope_rad];
        if slopes(self) != slopes(before) {
            simulation.set_gravity(frame::gravity_in_ground(robot.model.gravity(), slopes(self)));
        }
        if self.friction != before.friction {
            simulation.set_friction(&robot.model, self.friction);
        }
        if self.gain_factor != before.gain_factor {
            simulation.set_gains(&robot.model, self.gain_factor);
        }
        let masses = |world: &Self| (world.mass_factor, world.com_shift);
        if masses(self) != masses(before) {
            let shift_m = self.com_shift.map(|shift| shift * robot.settings.stance_height_m);
            simulation.set_masses(&robot.model, self.mass_factor, robot.trunk, shift_m);
        }
    }

    /// The physics of a robot's model as its file has it.
    pub(crate) const PLAIN: Self = Self {
        slope_rad: 0.0,
        cross_slope_rad: 0.0,
        roughness: 0.0,
        friction: None,
        mass_factor: 1.0,
        com_shift: [0.0; 3],
        strength_factor: 1.0,
        gain_factor: 1.0,
        delay_s: None,
    };
}
