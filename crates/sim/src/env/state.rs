//! Everything that the next step of an environment depends on, as numbers.

use canter_gait::PhaseClock;

use super::{Env, KEYS};
use crate::accident::StuckTimer;
use crate::frame;
use crate::reward::{Motion, RewardTerms};
use crate::task::Task;
use crate::variation::{Draw, Variant};

/// Phase, env steps, return and the time of a stuck leg.
const NUM_COUNTERS: usize = 4;

impl Draw {
    /// How many numbers a draw is in a state.
    const NUM_NUMBERS: usize = 3;
    /// Place and level where nothing varies.
    const UNVARIED: (f64, f64) = (-1.0, 1.0);

    fn to_numbers(self) -> [f64; Self::NUM_NUMBERS] {
        let (place, level) = self.variant.map_or(Self::UNVARIED, |variant| (variant.place, variant.level));
        [place, level, self.key as f64]
    }

    fn from_numbers([place, level, key]: [f64; Self::NUM_NUMBERS]) -> Self {
        let variant = ((place, level) != Self::UNVARIED).then_some(Variant { place, level });
        Self { variant, key: key as u64 }
    }
}

impl Env {
    /// Everything that the next step depends on.
    pub fn state(&self) -> Vec<f64> {
        let mut state =
            vec![f64::from(self.clock.phase()), f64::from(self.env_steps), self.return_so_far, self.stuck.seconds()];
        state.extend(self.episode.draw.to_numbers());
        state.extend(self.previous_action.iter().map(|&value| f64::from(value)));
        state.extend(self.commands.iter().flatten().map(|&value| f64::from(value)));
        state.extend(self.simulation.state());
        state
    }

    /// Restores what [`state`](Self::state) gave for the same task, and writes the observation, `(O)`: zeros if the
    /// positions or velocities make no sense, as after a step.
    ///
    /// # Errors
    /// A state that no environment of this task can have, but for its physics, which the next step judges; the environment
    /// must then be reset before it is used.
    pub fn set_state(&mut self, state: &[f64], observation: &mut [f32]) -> Result<(), String> {
        let num_motors = 2 * self.task.robot.legs.len();
        let own = NUM_COUNTERS + Draw::NUM_NUMBERS + self.previous_action.len() + self.commands.len() * num_motors;
        let Some((own, physics)) = state.split_at_checked(own) else {
            return Err(format!("{} numbers are too few for an environment's state", state.len()));
        };
        self.check_own(own)?;
        if physics.iter().any(|value| !value.is_finite()) {
            return Err("the physics' state has numbers that are not finite".to_owned());
        }
        let mut draw = [0.0; Draw::NUM_NUMBERS];
        draw.copy_from_slice(&own[NUM_COUNTERS..NUM_COUNTERS + Draw::NUM_NUMBERS]);
        self.begin(Draw::from_numbers(draw));
        self.simulation.set_state(physics)?;
        // MuJoCo keeps some numbers, the switches of its constraints, as bytes.
        if self.simulation.state() != physics {
            return Err("the physics' state has a switch that is neither on nor off".to_owned());
        }
        self.clock = PhaseClock::at(own[0] as f32);
        self.env_steps = own[1] as u32;
        self.return_so_far = own[2];
        self.stuck = StuckTimer::at(own[3]);
        let rest = self.previous_action.iter_mut().chain(self.commands.iter_mut().flatten());
        for (target, value) in rest.zip(&own[NUM_COUNTERS + Draw::NUM_NUMBERS..]) {
            *target = *value as f32;
        }
        self.observe(!self.makes_sense(), observation);
        Ok(())
    }

    /// Checks the numbers of a state that are not the physics'.
    fn check_own(&self, own: &[f64]) -> Result<(), String> {
        /// No joint is asked for as much [rad].
        const LARGEST_COMMAND: f64 = 1e2;
        let [phase, env_steps, return_so_far, stuck_s, place, level, key] = own[..NUM_COUNTERS + Draw::NUM_NUMBERS]
        else {
            unreachable!("the caller has counted");
        };
        let (actions, commands) = own[NUM_COUNTERS + Draw::NUM_NUMBERS..].split_at(self.previous_action.len());
        let unvaried = (place, level) == Draw::UNVARIED;
        let needs_key = self.task.needs_key((!unvaried).then_some(Variant { place, level }));
        let checks = [
            ("phase", (0.0..1.0).contains(&phase)),
            ("number of env steps", env_steps == f64::from(env_steps as u32)),
            ("return", return_so_far.abs() <= env_steps * self.largest_reward()),
            ("time of a stuck leg", (0.0..=f64::from(u32::MAX)).contains(&stuck_s)),
            ("place among the variations", unvaried || (0.0..1.0).contains(&place) && self.task.variation.is_any()),
            ("level of difficulty", unvaried || self.task.variation.has_level(level)),
            ("key", if needs_key { (0.0..KEYS).contains(&key) && key.fract() == 0.0 } else { key == 0.0 }),
            ("previous action", actions.iter().all(|value| value.abs() <= 1.0)),
            ("command", commands.iter().all(|value| value.abs() < LARGEST_COMMAND)),
        ];
        match checks.iter().find(|(_, is_possible)| !is_possible) {
            Some((what, _)) => Err(format!("an environment's state has a {what} that cannot be")),
            None => Ok(()),
        }
    }

    /// What no reward of a step exceeds, however the robot is thrown about: every term at its largest.
    fn largest_reward(&self) -> f64 {
        let Task { reward, scale, robot, settings, .. } = &*self.task;
        let way = frame::LARGEST_VELOCITY * settings.control_dt_s;
        let terms = RewardTerms::new(
            reward,
            scale,
            &Motion {
                displacement_in_ground: [way; 3],
                work_j: self.buffers.torques.len() as f64 * robot.settings.motor.max_torque_nm * way,
                turn_rad: std::f64::consts::PI,
                // Each component from -1 to 1.
                squared_action_change: 4.0 * self.previous_action.len() as f64,
            },
        );
        // All but the first are penalties.
        2.0 * terms.forward - terms.total()
    }
}
