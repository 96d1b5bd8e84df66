//! What is to be done: a robot, a gait, what a policy may see and change, the ground, the reward.

use std::sync::Arc;

use canter_gait::action::MAX_AMPLITUDE_RAD;
use canter_gait::mirror::Mirror;
use canter_gait::observation::observation_len;
use canter_gait::prior::LegGait;
use canter_gait::{ActionLaw, Controller, Gait, Leg, Modulation, ObservationBlock, ParameterRanges, Range};

use crate::ground::{Ground, GroundSettings};
use crate::mirror::MirrorMaps;
use crate::mujoco::Model;
use crate::reward::{RewardScale, RewardWeights};
use crate::robot::Robot;
use crate::settings::{Problems, above};
use crate::variation::{Variant, Variation, VariationSettings, interval};
use crate::world::World;
use crate::{choices, settings};

settings! {
    /// Time, ground, start and end of an episode.
    pub struct TaskSettings {
        /// Time between two commands [s]. Doggo's firmware takes commands at 100 Hz.
        pub control_dt_s: f64 in 1e-4..=0.1,
        /// Time of one physics step [s]; divides `control_dt_s`.
        pub physics_dt_s: f64 in 1e-5..=0.01,
        /// Time limit of an episode [s].
        pub episode_s: f64 in 0.1..=1000.0,
        /// An episode ends well when the robot has come this far [m]; absent: no goal.
        pub goal_distance_m: Option<f64> in above(0.0),
        /// Slope of the ground, positive uphill [deg].
        pub slope_deg: f64 in -45.0..=45.0,
        /// Slope across, positive where the ground rises to the left [deg]; absent: 0.
        pub cross_slope_deg: Option<f64> in -45.0..=45.0,
        /// Sliding friction between feet and ground; absent: the model's own.
        pub friction: Option<f64> in 0.0..=10.0,
        /// Factor of every mass and moment of inertia; absent: 1.
        pub mass_factor: Option<f64> in 0.1..=10.0,
        /// Factor of what the motors can give, see the robot's `motor`; absent: 1.
        pub strength_factor: Option<f64> in 0.1..=10.0,
        /// Time from a command to its effect [s], in whole physics steps; absent: the robot's `command_delay_steps`.
        pub delay_s: Option<f64> in 0.0..=0.5,
        /// What lies on the ground; absent: it is a plane.
        pub ground: Option<GroundSettings>,
        /// What is left of the return after an accident, see the paper's section II.B.
        pub accident_return_weight: f64 in 0.0..=1.0,
        /// What an accident costs besides, in the reward's unit: leg lengths of way at a forward weight of 1.
        pub accident_cost: f64 in 0.0..=1e3,
        /// How far above the robot's least height a training episode ends in an accident already, in stance heights, so
        /// that the policy keeps away from it. Searches and evaluations have none of it.
        pub height_margin: f64 in 0.0..=1.0,
        /// Largest change of the starting heading, tilt and leg angles [rad], drawn uniformly.
        pub start_noise_rad: f64 in 0.0..=0.5,
        /// What differs between the environments of a training. Searches and evaluations have none of it.
        pub variation: VariationSettings,
    }
}

settings! {
    /// Weights of the reward's terms (eq. 6), dimensionless: lengths in leg lengths, work in units of lifting the robot by one.
    pub struct RewardSettings {
        /// Moving forward.
        pub forward: f64 in 0.0..=1e3,
        /// Moving sideways.
        pub drift: f64 in 0.0..=1e3,
        /// Moving up and down.
        pub bounce: f64 in 0.0..=1e3,
        /// The motors' work. The energy term divided by the forward term is this weight times the cost of transport.
        pub energy: f64 in 0.0..=1e3,
        /// Turning, in leg lengths of way for one radian; not in the paper.
        pub turn: f64 in 0.0..=1e3,
        /// Changing the action; not in the paper.
        pub action_rate: f64 in 0.0..=1e3,
    }
}

settings! {
    /// What the policy sees and what it may change.
    pub struct PolicySettings {
        /// Name of the gait in the robot's robot.toml.
        pub prior: String,
        /// What the policy may change.
        pub modulation: ModulationChoice,
        /// How much of it: 0 leaves the gait untouched, 0.5 is the paper's half and half, 1 is free.
        pub authority: f64 in 0.0..=1.0,
        /// What the policy sees, in this order.
        pub observation: Vec<BlockChoice>,
        /// Whether the second half of the cycle is seen in a mirror, left and right exchanged, and the action mirrored
        /// back: the policy has no favourite side. The robot's sides must be equal, the gait in the mirror itself half a
        /// cycle later (as trot, walk and pace are), and the phase be observed.
        pub symmetric: bool,
        /// Box of the gait parameters that `modulate` may use, and the bound of `residual`.
        pub ranges: RangeSettings,
    }
}

settings! {
    /// Least and greatest value of each gait parameter.
    pub struct RangeSettings {
        /// Stride frequency as a multiple of the prior's.
        pub frequency_factor: Vec<f64> in 0.1..=10.0,
        /// Swing amplitude [rad].
        pub swing_amplitude_rad: Vec<f64> in -2.0..=2.0,
        /// Extension amplitude [rad]; absent: from 0 to what lengthens the robot's legs by three fifths of its stance height.
        pub extension_amplitude_rad: Option<Vec<f64>> in -2.0..=2.0,
        /// Change of the angle about which a leg swings [rad].
        pub swing_offset_rad: Vec<f64> in -2.0..=2.0,
        /// Change of the extension about which a leg moves [rad]; absent: up to half that amplitude, both ways.
        pub extension_offset_rad: Option<Vec<f64>> in -2.0..=2.0,
        /// How far `residual` may move an actuator target, either way, at full authority [rad]; absent: 0.2.
        pub residual_rad: Option<f64> in 0.0..=2.0,
    }
}

choices! {
    /// What a policy may change, see [`Modulation`].
    pub enum ModulationChoice {
        /// Swing and extension amplitude of all legs together: the paper.
        Amplitude = "amplitude",
        /// Swing and extension amplitude of each leg.
        LegAmplitude = "leg-amplitude",
        /// The stride frequency, and amplitudes and offsets of each leg.
        Modulate = "modulate",
        /// The actuator targets, each by an addition of at most `ranges.residual_rad`.
        Residual = "residual",
        /// The motor angles, without a prior: the paper's control experiment.
        Direct = "direct",
    }
}

choices! {
    /// One block of the observation, see [`ObservationBlock`].
    pub enum BlockChoice {
        /// Angles of the motor joints.
        MotorAngles = "motor_angles",
        /// Velocities of the motor joints.
        MotorVelocities = "motor_velocities",
        /// Roll, pitch, yaw.
        Orientation = "orientation",
        /// Angular velocity in the body's frame.
        AngularVelocity = "angular_velocity",
        /// Sine and cosine of the gait's phase.
        Phase = "phase",
        /// The previous action.
        PreviousAction = "previous_action",
    }
}

impl ModulationChoice {
    /// The controller's word for it.
    pub fn modulation(self) -> Modulation {
        match self {
            Self::Amplitude => Modulation::Amplitude,
            Self::LegAmplitude => Modulation::LegAmplitude,
            Self::Modulate => Modulation::Modulate,
            Self::Residual => Modulation::Residual,
            Self::Direct => Modulation::Direct,
        }
    }
}

impl BlockChoice {
    /// The controller's word for it.
    pub fn block(self) -> ObservationBlock {
        match self {
            Self::MotorAngles => ObservationBlock::MotorAngles,
            Self::MotorVelocities => ObservationBlock::MotorVelocities,
            Self::Orientation => ObservationBlock::Orientation,
            Self::AngularVelocity => ObservationBlock::AngularVelocity,
            Self::Phase => ObservationBlock::Phase,
            Self::PreviousAction => ObservationBlock::PreviousAction,
        }
    }
}

impl TaskSettings {
    /// Control steps until a time in an episode [s].
    pub fn env_steps_until(&self, time_s: f64) -> u32 {
        (time_s / self.control_dt_s).round() as u32
    }
}

/// A robot and all that is asked of it; many environments share one.
#[derive(Clone, Debug)]
pub struct Task {
    /// The robot.
    pub robot: Arc<Robot>,
    /// Time, ground, start and end of an episode.
    pub settings: TaskSettings,
    /// What differs between the environments of a training.
    pub variation: Variation,
    /// What lies on the ground; none: it is a plane.
    pub ground: Option<Ground>,
    /// The robot's model on uneven ground.
    uneven: Option<Arc<Model>>,
    /// The reward's weights.
    pub reward: RewardWeights,
    /// What makes the reward dimensionless.
    pub scale: RewardScale,
    /// Physics steps of one env step.
    pub num_substeps: u32,
    /// Env steps of one episode.
    pub max_env_steps: u32,
    stride_frequency_hz: f32,
    legs: Vec<LegGait>,
    law: ActionLaw,
    blocks: Vec<ObservationBlock>,
    mirror: Option<MirrorMaps>,
}

impl Task {
    /// Puts a task together and checks what only shows when the parts meet.
    ///
    /// Problems are reported at `policy.*` and `task.*`, the tables of a preset.
    ///
    /// # Errors
    /// Returns everything that is wrong, added to `problems`.
    pub fn new(
        robot: Arc<Robot>,
        settings: &TaskSettings,
        reward: &RewardSettings,
        policy: &PolicySettings,
        mut problems: Problems,
    ) -> Result<Self, Problems> {
        let num_substeps = num_substeps(settings.control_dt_s, settings.physics_dt_s);
        if num_substeps.is_none() {
            let message = format!("control_dt_s = {} is not a whole number of physics steps", settings.control_dt_s);
            problems.at("task.physics_dt_s", message);
        }
        if policy.observation.is_empty() {
            problems.at("policy.observation", "a policy has to see something");
        }
        for (i, block) in policy.observation.iter().enumerate() {
            if policy.observation[..i].contains(block) {
                problems.at(&format!("policy.observation[{i}]"), format!("`{}` is there already", block.name()));
            }
        }
        if policy.modulation == ModulationChoice::Direct && policy.authority < 1.0 {
            problems.at("policy.authority", "`direct` has no prior to leave a share to: set it to 1");
        }
        let gait = robot.gait(&policy.prior);
        if gait.is_none() {
            let known: Vec<_> = robot.gaits.iter().map(|gait| format!("`{}`", gait.name)).collect();
            let message = format!(
                "{} has no gait called `{}`: set it to one of {}",
                robot.settings.name,
                policy.prior,
                known.join(", ")
            );
            problems.at("policy.prior", message);
        }
        let legs = gait.map_or(&[][..], |gait| &gait.legs);
        if matches!(policy.modulation, ModulationChoice::Amplitude | ModulationChoice::LegAmplitude)
            && let Some(amplitude) = legs.iter().map(largest_amplitude).find(|&amplitude| amplitude > MAX_AMPLITUDE_RAD)
        {
            let message = format!("its amplitude of {amplitude} rad is above eq. 5's limit of 1 rad; use `modulate`");
            problems.at("policy.prior", message);
        }
        // Only `modulate` uses the box, so only then must the prior lie in it.
        let boxed = if policy.modulation == ModulationChoice::Modulate { legs } else { &[] };
        let ranges = parameter_ranges(&policy.ranges, boxed, reach_rad(&robot), &mut problems);
        let variation = Variation::new(settings, &mut problems);
        if let (Some(gait), Some(ranges)) = (gait, &ranges) {
            let fastest_hz = f64::from(gait.stride_frequency_hz * ranges.frequency_factor.high.max(1.0));
            if fastest_hz * settings.control_dt_s > 0.5 {
                let message = format!("{fastest_hz} Hz is more than half the control frequency");
                problems.at("policy.ranges.frequency_factor", message);
            }
        }
        let modulation = policy.modulation.modulation();
        // Others have none, so that its value is no part of their action law.
        let residual_bound_rad = match modulation {
            Modulation::Residual => policy.ranges.residual_rad.unwrap_or(RESIDUAL_RAD) as f32,
            _ => 0.0,
        };
        let blocks: Vec<ObservationBlock> = policy.observation.iter().map(|block| block.block()).collect();
        let mut mirror = None;
        if let (true, Some(gait)) = (policy.symmetric, gait) {
            match MirrorMaps::new(&robot, &gait.legs, modulation, &blocks) {
                Ok(maps) => mirror = Some(maps),
                Err(reason) => problems.at("policy.symmetric", format!("{reason}; else set it to false")),
            }
        }
        let leg_length_m = robot.settings.stance_height_m;
        let max_roughness = World::of(settings).roughness.max(variation.greatest_roughness());
        let on_ground = settings.ground.clone().or((max_roughness > 0.0).then(GroundSettings::smooth));
        let ground = on_ground.map(|ground| Ground::new(&ground, max_roughness, leg_length_m, &mut problems));
        let mut uneven = None;
        if let Some(ground) = ground.as_ref().filter(|ground| ground.is_uneven()) {
            match robot.model.on_uneven_ground(robot.floor, &robot.settings.floor, &ground.field()) {
                Ok(model) => uneven = Some(Arc::new(model)),
                Err(message) => {
                    problems.at("task.ground", format!("MuJoCo cannot put this ground under the robot: {message}"));
                }
            }
        }
        problems.finish(())?;
        let (Some(gait), Some(ranges), Some(num_substeps)) = (gait, ranges, num_substeps) else {
            unreachable!("a missing gait, range or number of steps is a problem");
        };
        let lift_energy_j = robot.model.total_mass_kg() * robot.model.gravity() * leg_length_m;
        Ok(Self {
            settings: settings.clone(),
            variation,
            ground,
            uneven,
            reward: RewardWeights {
                forward: reward.forward,
                drift: reward.drift,
                bounce: reward.bounce,
                energy: reward.energy,
                turn: reward.turn,
                action_rate: reward.action_rate,
            },
            scale: RewardScale { leg_length_m, lift_energy_j },
            num_substeps,
            max_env_steps: settings.env_steps_until(settings.episode_s).max(1),
            stride_frequency_hz: gait.stride_frequency_hz,
            legs: gait.legs.clone(),
            law: ActionLaw { modulation, authority: policy.authority as f32, ranges, residual_bound_rad },
            blocks,
            mirror,
            robot,
        })
    }

    /// The same task with another gait of the robot as its prior.
    pub fn with_gait(&self, name: &str) -> Option<Self> {
        let gait = self.robot.gait(name)?;
        Some(Self { stride_frequency_hz: gait.stride_frequency_hz, legs: gait.legs.clone(), ..self.clone() })
    }

    /// The code that runs on the robot, for this task.
    pub fn controller(&self) -> Controller<'_> {
        let gait = Gait { stride_frequency_hz: self.stride_frequency_hz, legs: &self.legs };
        Controller::new(&self.robot.legs, gait, self.law, &self.blocks).expect("every leg has its part of the gait")
    }

    /// The same task with another physics step [s]; none unless it divides the control step.
    pub fn with_physics_dt_s(mut self, physics_dt_s: f64) -> Option<Self> {
        self.num_substeps = num_substeps(self.settings.control_dt_s, physics_dt_s)?;
        self.settings.physics_dt_s = physics_dt_s;
        Some(self)
    }

    /// What the policy observes.
    pub fn blocks(&self) -> &[ObservationBlock] {
        &self.blocks
    }

    /// In which a policy sees the second half of the cycle; none if it is to see it as it is.
    pub fn mirror(&self) -> Option<Mirror<'_>> {
        self.mirror.as_ref().map(MirrorMaps::mirror)
    }

    /// What that mirror borrows.
    pub fn mirror_maps(&self) -> Option<&MirrorMaps> {
        self.mirror.as_ref()
    }

    /// Weight of the robot [N].
    pub fn weight_n(&self) -> f64 {
        let model = &self.robot.model;
        model.total_mass_kg() * self.settings.mass_factor.unwrap_or(1.0) * model.gravity()
    }

    /// The longest time from a command to its effect in any episode, in physics steps.
    pub(crate) fn longest_delay(&self) -> u32 {
        let varied = self.variation.longest_delay_s().map(|delay_s| self.delay_steps(Some(delay_s)));
        self.delay_steps(self.settings.delay_s).max(varied.unwrap_or(0))
    }

    /// A time from a command to its effect [s] in physics steps; none: the robot's own.
    pub(crate) fn delay_steps(&self, delay_s: Option<f64>) -> u32 {
        match delay_s {
            Some(delay_s) => (delay_s / self.settings.physics_dt_s).round() as u32,
            None => self.robot.settings.command_delay_steps * self.num_substeps,
        }
    }

    /// Whether an episode with this variant has anything that its key decides.
    pub(crate) fn needs_key(&self, variant: Option<Variant>) -> bool {
        let roughness = World::of(&self.settings).roughness;
        self.variation.needs_key(variant) || self.ground.as_ref().is_some_and(|ground| ground.needs_key(roughness))
    }

    /// The robot's model on this task's ground.
    pub(crate) fn model(&self) -> &Model {
        self.uneven.as_deref().unwrap_or(&self.robot.model)
    }

    /// How close to the ground the body may come before that is an accident [m].
    ///
    /// ```text
    /// z_min = min_height + height_margin h
    /// ```
    ///
    /// Source: our definition; h is the stance height.
    pub fn min_height_m(&self) -> f64 {
        let robot = &self.robot.settings;
        robot.limits.min_height_m + self.settings.height_margin * robot.stance_height_m
    }

    /// Number of components of the observation, O.
    pub fn num_observations(&self) -> usize {
        observation_len(&self.blocks, 2 * self.legs.len(), self.num_actions())
    }

    /// Number of components of the action, A.
    pub fn num_actions(&self) -> usize {
        self.law.modulation.num_actions(self.legs.len())
    }
}

/// How many physics steps of `physics_dt_s` [s] a control step of `control_dt_s` [s] has; none unless it is a whole number.
pub fn num_substeps(control_dt_s: f64, physics_dt_s: f64) -> Option<u32> {
    let steps = (control_dt_s / physics_dt_s).round();
    let is_whole = (steps * physics_dt_s - control_dt_s).abs() <= 1e-9 && steps >= 1.0;
    is_whole.then_some(steps as u32)
}

/// The bound of `residual` where the settings have none [rad]: half the swing of Doggo's trot, a fifth of a leg's length at
/// the foot.
const RESIDUAL_RAD: f64 = 0.2;

/// The larger of a leg's two amplitudes [rad].
fn largest_amplitude(leg: &LegGait) -> f32 {
    leg.defaults.swing_amplitude.max(leg.defaults.extension_amplitude)
}

/// The extension that lengthens a robot's legs by [`REACH`] stance heights [rad], to a hundredth: the same freedom in
/// metres of foot for every kind of leg. A straight leg of two links takes half the angle of Doggo's.
///
/// ```text
/// reach = REACH h / (dL / d extension), at standing, of the leg that lengthens fastest
/// ```
///
/// Source: our definition.
fn reach_rad(robot: &Robot) -> f64 {
    /// Where the slope of a leg's length is taken, either side of standing [rad].
    const STEP_RAD: f32 = 0.01;
    /// What one radian of Doggo's extension is, the range on which the hyperparameters were chosen [stance heights].
    const REACH: f64 = 0.61;
    let lengthening = |leg: &Leg| {
        let change = leg.geometry.length(STEP_RAD) - leg.geometry.length(-STEP_RAD);
        f64::from(change.abs() / (2.0 * STEP_RAD)) / robot.settings.stance_height_m
    };
    let fastest = robot.legs.iter().map(lengthening).fold(f64::MIN_POSITIVE, f64::max);
    (REACH / fastest * 100.0).round() / 100.0
}

/// The box of parameters; every leg's defaults must lie in it, so that an untrained policy can be the prior. `reach_rad`
/// is the range of extensions where the settings leave it to the robot.
fn parameter_ranges(
    settings: &RangeSettings,
    legs: &[LegGait],
    reach_rad: f64,
    problems: &mut Problems,
) -> Option<ParameterRanges> {
    let mut range = |key: &str, values: &[f64], defaults: &[f32]| {
        let path = format!("policy.ranges.{key}");
        let [low, high] = interval(&path, values, problems)?;
        let range = Range { low: low as f32, high: high as f32 };
        if let Some(outside) = defaults.iter().find(|&&default| default < range.low || default > range.high) {
            let message = format!("the prior's own value, {outside}, lies outside");
            problems.at(&path, message);
        }
        Some(range)
    };
    let of_legs = |value: fn(&LegGait) -> f32| legs.iter().map(value).collect::<Vec<_>>();
    let frequency_factor = range("frequency_factor", &settings.frequency_factor, &[1.0]);
    let swing_amplitude =
        range("swing_amplitude_rad", &settings.swing_amplitude_rad, &of_legs(|leg| leg.defaults.swing_amplitude));
    let extension_amplitudes = of_legs(|leg| leg.defaults.extension_amplitude);
    let largest = extension_amplitudes.iter().map(|&amplitude| f64::from(amplitude)).fold(reach_rad, f64::max);
    let extension_amplitude = range(
        "extension_amplitude_rad",
        settings.extension_amplitude_rad.as_deref().unwrap_or(&[0.0, largest]),
        &extension_amplitudes,
    );
    let swing_offset = range("swing_offset_rad", &settings.swing_offset_rad, &[0.0]);
    let both_ways = [-reach_rad / 2.0, reach_rad / 2.0];
    let extension_offset =
        range("extension_offset_rad", settings.extension_offset_rad.as_deref().unwrap_or(&both_ways), &[0.0]);
    Some(ParameterRanges {
        frequency_factor: frequency_factor?,
        swing_amplitude: swing_amplitude?,
        extension_amplitude: extension_amplitude?,
        swing_offset: swing_offset?,
        extension_offset: extension_offset?,
    })
}
