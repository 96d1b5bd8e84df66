//! What is special about one episode of an environment.

use super::Sensed;
use crate::keyed::{self, Purpose};
use crate::motor::Motor;
use crate::task::Task;
use crate::variation::{Draw, Noise, Pushes};
use crate::world::World;

/// What is special about one episode; all of it follows from task and draw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Episode {
    pub draw: Draw,
    pub world: World,
    /// Physics steps from a command to its effect.
    pub delay_steps: u32,
    pub motor: Motor,
    pub noise: Option<Noise>,
    pushes: Option<Pushes>,
}

impl Episode {
    /// The episode of this draw.
    pub fn new(task: &Task, draw: Draw) -> Self {
        let world = task.variation.world(&draw, World::of(&task.settings));
        Self {
            world,
            delay_steps: task.delay_steps(world.delay_s),
            motor: task.robot.motor().scaled(world.strength_factor),
            noise: task.variation.noise(&draw),
            pushes: task.variation.pushes(&draw),
            draw,
        }
    }

    /// The push before env step number `env_step`, if there is one: change of the body's velocity in the ground's frame [m/s].
    ///
    /// ```text
    /// v = u_1 push_velocity sqrt(g h) (cos(2 pi u_2), sin(2 pi u_2), 0)
    /// ```
    ///
    /// u_1 and u_2 are drawn evenly from [0, 1). The first push comes within the first interval, at a time of its own in
    /// each episode.
    ///
    /// Source: our definition; `sqrt(g h)` is the speed at Froude number 1.
    pub fn push(&self, task: &Task, env_step: u32) -> Option<[f64; 3]> {
        let Pushes { interval_s, velocity } = self.pushes?;
        let interval = ((interval_s / task.settings.control_dt_s).round() as u64).max(1);
        let draw = |counter: u64| keyed::uniform(self.draw.key, Purpose::Push, counter);
        let first = (draw(0) * interval as f64) as u64;
        let step = u64::from(env_step);
        if step % interval != first {
            return None;
        }
        let robot = &task.robot;
        let unit_m_per_s = (robot.model.gravity() * robot.settings.stance_height_m).sqrt();
        let size_m_per_s = draw(1 + 2 * step) * velocity * unit_m_per_s;
        let (sin, cos) = (draw(2 + 2 * step) * std::f64::consts::TAU).sin_cos();
        Some([size_m_per_s * cos, size_m_per_s * sin, 0.0])
    }
}

/// How many control steps old the command is that acts in a physics step of a control step, if commands take
/// `delay_steps` physics steps to their effect: 0 is the command of this control step.
///
/// ```text
/// age = ceil((delay - step) / n)   where delay > step, else 0
/// ```
///
/// `physics_step` -> step, from 0; `num_substeps` -> n.
///
/// Source: our definition.
pub(super) fn command_age(delay_steps: u32, physics_step: u32, num_substeps: u32) -> usize {
    delay_steps.saturating_sub(physics_step).div_ceil(num_substeps) as usize
}

impl Sensed {
    /// Adds an episode's noise after env step number `env_step` to what is.
    pub fn add_noise(&mut self, noise: &Noise, key: u64, env_step: u32) {
        /// No robot has as many components to sense.
        const MAX_COMPONENTS: u64 = 1 << 16;
        let mut counter = u64::from(env_step) * MAX_COMPONENTS;
        let mut add = |values: &mut [f32], largest: f64| {
            for value in values {
                *value += (largest * keyed::either_way(key, Purpose::Noise, counter)) as f32;
                counter += 1;
            }
        };
        add(&mut self.motors.angles, noise.angle_rad);
        add(&mut self.motors.velocities, noise.velocity_rad_per_s);
        add(&mut self.orientation, noise.orientation_rad);
        add(&mut self.angular_velocity_in_body, noise.angular_velocity_rad_per_s);
    }
}

#[cfg(test)]
mod tests {
    use super::command_age;

    #[test]
    fn a_command_acts_after_exactly_its_delay() {
        // Five physics steps a control step. A delay of 7: two steps of the command before the last, three of the last.
        let ages = |delay| (0..5).map(|step| command_age(delay, step, 5)).collect::<Vec<_>>();
        assert_eq!(ages(7), [2, 2, 1, 1, 1]);
        assert_eq!(ages(0), [0; 5]);
        assert_eq!(ages(5), [1; 5]);
        assert_eq!(ages(10), [2; 5]);
        assert_eq!(ages(1), [1, 0, 0, 0, 0]);
        assert_eq!(command_age(3, 0, 1), 3);
    }
}
