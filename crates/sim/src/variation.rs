//! What differs between the environments and episodes of a training, so that the policy learns to cope with it.
//!
//! The ground is spread evenly over the environments instead of being drawn for each episode: where a robot falls at
//! once its episodes are short, and drawn episodes would hardly ever train what is hard. Everything else, which no robot
//! falls of at once, is drawn anew for each episode.
//!
//! What an episode is like follows from a [`Draw`] alone: a state needs to hold nothing else of it.

use crate::keyed::{self, Purpose};
use crate::settings;
use crate::settings::{Problems, above};
use crate::task::TaskSettings;
use crate::world::World;

settings! {
    /// What differs between the environments and episodes of a training. Ranges are a least and a greatest value, drawn
    /// evenly between them for each episode; absent: the task's own value.
    pub struct VariationSettings {
        /// Share of the environments whose ground differs (slopes, roughness), the others have the task's own; absent: all.
        pub share: Option<f64> in 0.0..=1.0,
        /// Slope of the ground, positive uphill [deg]: spread evenly over the environments instead of drawn.
        pub slope_deg: Option<Vec<f64>> in -45.0..=45.0,
        /// Slope across, positive where the ground rises to the left [deg].
        pub cross_slope_deg: Option<Vec<f64>> in -45.0..=45.0,
        /// Roughness of the ground, see `task.ground`, in stance heights.
        pub roughness: Option<Vec<f64>> in 0.0..=1.0,
        /// Sliding friction.
        pub friction: Option<Vec<f64>> in 0.0..=10.0,
        /// Factor of every mass and moment of inertia.
        pub mass_factor: Option<Vec<f64>> in 0.1..=10.0,
        /// Largest shift of the trunk's centre of mass along each of its axes, either way, in stance heights.
        pub com_shift: Option<f64> in 0.0..=1.0,
        /// Factor of what the motors can give: of the torque at the current limit and at standstill.
        pub strength_factor: Option<Vec<f64>> in 0.1..=10.0,
        /// Factor of the position controllers' gains, of stiffness and damping alike.
        pub gain_factor: Option<Vec<f64>> in 0.1..=10.0,
        /// Time from a command to its effect [s], in whole physics steps, instead of the robot's `command_delay_steps`.
        pub delay_s: Option<Vec<f64>> in 0.0..=0.5,
        /// Largest error of each motor angle [rad], either way, drawn anew at each control step like all sensor noise.
        pub angle_noise_rad: Option<f64> in 0.0..=1.0,
        /// Largest error of each motor velocity [rad/s].
        pub velocity_noise_rad_per_s: Option<f64> in 0.0..=100.0,
        /// Largest error of roll, pitch and yaw [rad].
        pub orientation_noise_rad: Option<f64> in 0.0..=1.0,
        /// Largest error of each component of the angular velocity [rad/s].
        pub angular_velocity_noise_rad_per_s: Option<f64> in 0.0..=100.0,
        /// Time between two pushes [s], each from any side; absent: none.
        pub push_interval_s: Option<f64> in 0.1..=100.0,
        /// Largest change of the body's velocity by a push, as a share of `sqrt(g h)`, h the stance height; absent: no pushes.
        pub push_velocity: Option<f64> in above(0.0),
        /// Whether slopes, roughness and pushes grow from nothing to what is said here, for each environment with its
        /// success; absent: they are all there from the start.
        pub curriculum: Option<bool>,
    }
}

impl VariationSettings {
    /// Every environment is as the task has it.
    pub fn nothing() -> Self {
        Self {
            share: None,
            slope_deg: None,
            cross_slope_deg: None,
            roughness: None,
            friction: None,
            mass_factor: None,
            com_shift: None,
            strength_factor: None,
            gain_factor: None,
            delay_s: None,
            angle_noise_rad: None,
            velocity_noise_rad_per_s: None,
            orientation_noise_rad: None,
            angular_velocity_noise_rad_per_s: None,
            push_interval_s: None,
            push_velocity: None,
            curriculum: None,
        }
    }
}

/// What an episode's differences are drawn from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Draw {
    /// Which of the grounds the environment has, in [0, 1), and its level of difficulty, in [0, 1]; none: the task's own values.
    pub variant: Option<Variant>,
    /// A whole number below 2^53: all that is random in the episode after its start.
    pub key: u64,
}

/// An environment's place among the task's variations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// In [0, 1): evenly spread over the environments.
    pub place: f64,
    /// How hard it is, from 0 to 1; 1 without a curriculum.
    pub level: f64,
}

/// Sensor noise: the largest error, either way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Of a motor angle [rad].
    pub angle_rad: f64,
    /// Of a motor velocity [rad/s].
    pub velocity_rad_per_s: f64,
    /// Of roll, pitch and yaw [rad].
    pub orientation_rad: f64,
    /// Of a component of the angular velocity [rad/s].
    pub angular_velocity_rad_per_s: f64,
}

/// Pushes at regular times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pushes {
    /// Time between two [s].
    pub interval_s: f64,
    /// Largest change of the velocity, as a share of `sqrt(g h)`.
    pub velocity: f64,
}

/// A range, low and high.
type Interval = [f64; 2];

/// What differs between the environments and episodes of a training, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    share: f64,
    slope_rad: Option<Interval>,
    cross_slope_rad: Option<Interval>,
    roughness: Option<Interval>,
    friction: Option<Interval>,
    mass_factor: Option<Interval>,
    com_shift: f64,
    strength_factor: Option<Interval>,
    gain_factor: Option<Interval>,
    delay_s: Option<Interval>,
    noise: Noise,
    pushes: Option<Pushes>,
    has_curriculum: bool,
}

impl Variation {
    /// The variation of a task; what is wrong is reported at `task.variation`.
    pub(crate) fn new(task: &TaskSettings, problems: &mut Problems) -> Self {
        let settings = &task.variation;
        let mut range = |key: &str, values: &Option<Vec<f64>>| {
            values.as_deref().and_then(|values| interval(&format!("task.variation.{key}"), values, problems))
        };
        let mut variation = Self {
            share: settings.share.unwrap_or(1.0),
            slope_rad: range("slope_deg", &settings.slope_deg).map(|slope| slope.map(f64::to_radians)),
            cross_slope_rad: range("cross_slope_deg", &settings.cross_slope_deg)
                .map(|slope| slope.map(f64::to_radians)),
            roughness: range("roughness", &settings.roughness),
            friction: range("friction", &settings.friction),
            mass_factor: range("mass_factor", &settings.mass_factor),
            com_shift: settings.com_shift.unwrap_or(0.0),
            strength_factor: range("strength_factor", &settings.strength_factor),
            gain_factor: range("gain_factor", &settings.gain_factor),
            delay_s: range("delay_s", &settings.delay_s),
            noise: Noise {
                angle_rad: settings.angle_noise_rad.unwrap_or(0.0),
                velocity_rad_per_s: settings.velocity_noise_rad_per_s.unwrap_or(0.0),
                orientation_rad: settings.orientation_noise_rad.unwrap_or(0.0),
                angular_velocity_rad_per_s: settings.angular_velocity_noise_rad_per_s.unwrap_or(0.0),
            },
            pushes: None,
            has_curriculum: settings.curriculum.unwrap_or(false),
        };
        match (settings.push_interval_s, settings.push_velocity) {
            (Some(interval_s), Some(velocity)) => variation.pushes = Some(Pushes { interval_s, velocity }),
            (None, None) => {}
            (Some(_), None) => problems.at("task.variation.push_interval_s", "pushes need a push_velocity as well"),
            (None, Some(_)) => problems.at("task.variation.push_velocity", "pushes need a push_interval_s as well"),
        }
        if variation.has_curriculum && !variation.has_levels() {
            problems.at("task.variation.curriculum", "no slopes, roughness or pushes vary that could grow");
        }
        variation
    }

    /// Whether anything varies.
    pub fn is_any(&self) -> bool {
        self.varies_ground() || self.is_drawn()
    }

    /// Whether the difficulty of an environment follows its success.
    pub fn has_curriculum(&self) -> bool {
        self.has_curriculum
    }

    /// Whether an environment may have this level of difficulty.
    pub(crate) fn has_level(&self, level: f64) -> bool {
        if self.has_curriculum { (0.0..=1.0).contains(&level) } else { level == 1.0 }
    }

    /// Whether an episode with this variant has anything that its key decides.
    pub(crate) fn needs_key(&self, variant: Option<Variant>) -> bool {
        variant.is_some() && (self.is_drawn() || self.cross_slope_rad.is_some() || self.roughness.is_some())
    }

    /// Whether anything is drawn for each episode of every environment.
    fn is_drawn(&self) -> bool {
        let ranges = [self.friction, self.mass_factor, self.strength_factor, self.gain_factor, self.delay_s];
        ranges.iter().any(Option::is_some)
            || self.com_shift > 0.0
            || self.noise != Noise::default()
            || self.pushes.is_some()
    }

    /// The greatest roughness of an episode, beside the task's own.
    pub(crate) fn greatest_roughness(&self) -> f64 {
        self.roughness.filter(|_| self.share > 0.0).map_or(0.0, |[_, high]| high)
    }

    /// The longest delay of a command [s]; none if delays do not vary.
    pub(crate) fn longest_delay_s(&self) -> Option<f64> {
        self.delay_s.map(|[_, high]| high)
    }

    fn varies_ground(&self) -> bool {
        let ranges = [self.slope_rad, self.cross_slope_rad, self.roughness];
        self.share > 0.0 && ranges.iter().any(Option::is_some)
    }

    fn has_levels(&self) -> bool {
        self.varies_ground() || self.pushes.is_some()
    }

    /// What the episode of this draw is like, where the task has `own` without variations.
    ///
    /// ```text
    /// slope = own + level (low + (high - low) place / share - own)   where place < share, else the task's own
    /// drawn = low + (high - low) u,   u of the key
    /// ```
    ///
    /// Source: our definition.
    pub fn world(&self, draw: &Draw, own: World) -> World {
        let mut world = own;
        let Some(Variant { place, level }) = draw.variant else { return world };
        let drawn = |range: Option<Interval>, purpose: Purpose| {
            range.map(|[low, high]| low + (high - low) * keyed::uniform(draw.key, purpose, 0))
        };
        if place < self.share {
            let slope_rad = self.slope_rad.map(|[low, high]| low + (high - low) * place / self.share);
            raise(&mut world.slope_rad, slope_rad, level);
            raise(&mut world.cross_slope_rad, drawn(self.cross_slope_rad, Purpose::CrossSlope), level);
            raise(&mut world.roughness, drawn(self.roughness, Purpose::Roughness), level);
        }
        world.friction = drawn(self.friction, Purpose::Friction).or(world.friction);
        world.mass_factor = drawn(self.mass_factor, Purpose::Mass).unwrap_or(world.mass_factor);
        world.strength_factor = drawn(self.strength_factor, Purpose::Strength).unwrap_or(world.strength_factor);
        world.gain_factor = drawn(self.gain_factor, Purpose::Gain).unwrap_or(world.gain_factor);
        world.delay_s = drawn(self.delay_s, Purpose::Delay).or(world.delay_s);
        if self.com_shift > 0.0 {
            world.com_shift = std::array::from_fn(|axis| {
                self.com_shift * keyed::either_way(draw.key, Purpose::CentreOfMass, axis as u64)
            });
        }
        world
    }

    /// The sensor noise of an episode; none outside of training.
    pub fn noise(&self, draw: &Draw) -> Option<Noise> {
        (draw.variant.is_some() && self.noise != Noise::default()).then_some(self.noise)
    }

    /// The pushes of an episode; none outside of training.
    pub fn pushes(&self, draw: &Draw) -> Option<Pushes> {
        let level = draw.variant?.level;
        let Pushes { interval_s, velocity } = self.pushes?;
        Some(Pushes { interval_s, velocity: level * velocity })
    }
}

/// Moves a value by a level's share of the way to another.
fn raise(value: &mut f64, full: Option<f64>, level: f64) {
    let Some(full) = full else { return };
    *value = if level >= 1.0 { full } else { *value + level * (full - *value) };
}

/// Two numbers of which the first is the lesser one.
pub(crate) fn interval(path: &str, values: &[f64], problems: &mut Problems) -> Option<Interval> {
    let [low, high] = *values else {
        problems.at(path, "expected a least and a greatest value");
        return None;
    };
    if low >= high {
        problems.at(path, format!("{low} is not less than {high}"));
        return None;
    }
    Some([low, high])
}
