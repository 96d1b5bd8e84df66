//! A robot as data: `robot.toml` and its MJCF, checked against each other and compiled once.

use std::fs;
use std::path::{Path, PathBuf};

use canter_gait::phase::QUADRUPED_GAITS;
use canter_gait::prior::{LegGait, LegParameters, SineWave, Stepping, SteppingParameters, Waveform};
use canter_gait::{FiveBar, Leg, LegGeometry, LegLimits, LinearMap};

use crate::motor::Motor;
use crate::mujoco::{Model, ObjectKind};
use crate::settings::{Document, Problems, above};
use crate::{choices, settings, tagged};

settings! {
    /// What canter must know of a robot beside its MuJoCo model.
    pub struct RobotSettings {
        /// Short name; policies carry it and run on this robot only.
        pub name: String,
        /// One line for `canter robots`.
        pub description: String,
        /// The MuJoCo model (MJCF or URDF), a file beside this one. Its reference configuration is the standing pose.
        pub model: String,
        /// The floating body whose pose is the robot's.
        pub body: String,
        /// The ground geom.
        pub floor: String,
        /// Leg length in the standing pose, from hip axis to foot centre [m]. Scales the reward.
        pub stance_height_m: f64 in above(0.0),
        /// Control steps between a command and its effect: the bus and the control loop of the real robot.
        pub command_delay_steps: u32 in 0..=10,
        /// What every motor can give at its joint.
        pub motor: MotorSettings,
        /// What counts as an accident and what commands may ask for.
        pub limits: LimitSettings,
        /// The legs, in the order in which gaits and policies count them: front left, back left, back right, front right.
        pub legs: Vec<LegSettings>,
        /// The gaits that its owner already has.
        pub gaits: Vec<GaitSettings>,
    }
}

settings! {
    /// Torque-speed curve and current limit, behind the gear.
    pub struct MotorSettings {
        /// Torque at the current limit [N m].
        pub max_torque_nm: f64 in above(0.0),
        /// Torque at standstill that the supply voltage alone would allow [N m].
        pub stall_torque_nm: f64 in above(0.0),
        /// Joint speed at which the motor gives no torque any more [rad/s].
        pub no_load_speed_rad_per_s: f64 in above(0.0),
    }
}

settings! {
    /// Limits of poses and commands.
    pub struct LimitSettings {
        /// The robot has fallen when its body's centre is lower than this above the ground below it [m].
        pub min_height_m: f64 in 0.0..=10.0,
        /// The robot has rolled over when its up axis leans further than this from the ground's normal [deg].
        pub max_tilt_deg: f64 in 1.0..=179.0,
        /// A leg is stuck when its commanded and actual positions differ by more than this [rad] ...
        pub stuck_error_rad: f64 in above(0.0),
        /// ... for this long without a break [s].
        pub stuck_time_s: f64 in above(0.0),
        /// Least and greatest commanded swing angle [rad].
        pub swing_rad: Vec<f64> in -4.0..=4.0,
        /// Least and greatest commanded extension [rad].
        pub extension_rad: Vec<f64> in -4.0..=4.0,
    }
}

tagged! {
    /// How a leg is built.
    pub enum LegSettings {
        /// Two motors on one hip axis, two upper and two lower links that meet at the foot.
        FiveBar(FiveBarSettings) = "five-bar",
    }
}

settings! {
    /// A coaxial five-bar leg.
    pub struct FiveBarSettings {
        /// Name of the leg.
        pub name: String,
        /// Geom of the foot.
        pub foot: String,
        /// Length of each upper link [m].
        pub upper_link_m: f64 in above(0.0),
        /// Length of each lower link [m].
        pub lower_link_m: f64 in above(0.0),
        /// The two motor joints, zero in the standing pose, positive when the link swings forward; the link that points forward first.
        pub motors: Vec<String>,
        /// The two passive joints between upper and lower links, in the order of the motors.
        pub knees: Vec<String>,
        /// The two position actuators.
        pub actuators: Vec<String>,
        /// What the actuators are commanded in.
        pub actuated: Actuated,
    }
}

choices! {
    /// The space of a leg's actuator targets.
    pub enum Actuated {
        /// Swing and extension, in this order: tendons that couple the motors.
        LegSpace = "leg-space",
        /// The angles of the two motors.
        Motors = "motors",
    }
}

choices! {
    /// Which legs move together.
    pub enum Footfall {
        /// Diagonal pairs.
        Trot = "trot",
        /// One leg after the other.
        Walk = "walk",
        /// Left and right pairs.
        Pace = "pace",
        /// Front and back pairs.
        Bound = "bound",
        /// All legs together.
        Pronk = "pronk",
    }
}

tagged! {
    /// A hand-made gait.
    pub enum GaitSettings {
        /// Sines for swing and extension (eq. 4 of the paper).
        Sine(SineSettings) = "sine",
        /// The foot trajectory of Doggo's firmware.
        Stepping(SteppingSettings) = "stepping",
    }
}

settings! {
    /// A gait of two sines a leg.
    pub struct SineSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Which legs move together.
        pub footfall: Footfall,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// Amplitude of the swing angle [rad].
        pub swing_amplitude_rad: f64 in 0.0..=1.5,
        /// Amplitude of the extension [rad].
        pub extension_amplitude_rad: f64 in 0.0..=1.5,
        /// How far the extension's sine is ahead of the swing's [cycles]: 0.5 is eq. 4's pi, 0.75 makes the leg
        /// shortest in the middle of its forward swing.
        pub extension_phase_cycles: f64 in 0.0..=1.0,
    }
}

settings! {
    /// The firmware's trajectory.
    pub struct SteppingSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Which legs move together.
        pub footfall: Footfall,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// Depth of the foot below the hip between flight and stance [m].
        pub stance_height_m: f64 in above(0.0),
        /// How far the foot pushes below that in the middle of stance [m].
        pub down_amplitude_m: f64 in 0.0..=10.0,
        /// How far the foot lifts above that in the middle of flight [m].
        pub up_amplitude_m: f64 in 0.0..=10.0,
        /// Share of the cycle that the foot is in the air.
        pub flight_fraction: f64 in 0.05..=0.95,
        /// Way of the foot between touchdown and lift-off [m].
        pub step_length_m: f64 in above(0.0),
    }
}

impl GaitSettings {
    /// Name of the gait.
    pub fn name(&self) -> &str {
        match self {
            Self::Sine(sine) => &sine.name,
            Self::Stepping(stepping) => &stepping.name,
        }
    }

    /// Whether its speed counts as a default speed.
    pub fn is_default(&self) -> bool {
        match self {
            Self::Sine(sine) => sine.default,
            Self::Stepping(stepping) => stepping.default,
        }
    }

    /// Cycles per second [1/s].
    pub fn stride_frequency_hz(&self) -> f64 {
        match self {
            Self::Sine(sine) => sine.stride_frequency_hz,
            Self::Stepping(stepping) => stepping.stride_frequency_hz,
        }
    }

    fn footfall(&self) -> Footfall {
        match self {
            Self::Sine(sine) => sine.footfall,
            Self::Stepping(stepping) => stepping.footfall,
        }
    }

    /// Shape and parameters for a leg; `None` where the leg cannot reach the trajectory.
    fn waveform(&self, geometry: LegGeometry) -> Option<(Waveform, LegParameters)> {
        match self {
            Self::Sine(sine) => {
                let wave = SineWave { extension_phase: sine.extension_phase_cycles as f32 };
                let defaults = LegParameters {
                    swing_amplitude: sine.swing_amplitude_rad as f32,
                    extension_amplitude: sine.extension_amplitude_rad as f32,
                    ..LegParameters::default()
                };
                Some((Waveform::Sine(wave), defaults))
            }
            Self::Stepping(settings) => {
                let parameters = SteppingParameters {
                    stance_height_m: settings.stance_height_m as f32,
                    down_amplitude_m: settings.down_amplitude_m as f32,
                    up_amplitude_m: settings.up_amplitude_m as f32,
                    flight_fraction: settings.flight_fraction as f32,
                    step_length_m: settings.step_length_m as f32,
                };
                let stepping = Stepping::new(parameters, geometry)?;
                Some((Waveform::Stepping(stepping), stepping.defaults()))
            }
        }
    }
}

/// A gait that a robot's legs can walk: what [`canter_gait::Gait`] borrows.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedGait {
    /// Its name in `robot.toml`.
    pub name: String,
    /// Whether its speed counts as a default speed.
    pub is_default: bool,
    /// Cycles per second [1/s].
    pub stride_frequency_hz: f32,
    /// `(L)` the legs' parts.
    pub legs: Vec<LegGait>,
}

/// Where MuJoCo keeps what belongs to one leg.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LegAddresses {
    /// Geom of the foot.
    pub foot: usize,
    /// The motor joints.
    pub motor_joints: [usize; 2],
    /// Places in `qpos` and `qvel` of the motor joints.
    pub motors: [(usize, usize); 2],
    /// Places in `qpos` of the passive joints.
    pub knees: [usize; 2],
    /// Places in `ctrl`.
    pub actuators: [usize; 2],
}

/// A robot that has passed all checks.
#[derive(Clone, Debug)]
pub struct Robot {
    /// What `robot.toml` says.
    pub settings: RobotSettings,
    /// The compiled model, with the MJCF's own time step, gravity and friction.
    pub model: Model,
    /// The legs as the controller sees them, L.
    pub legs: Vec<Leg>,
    /// The gaits of `robot.toml`.
    pub gaits: Vec<NamedGait>,
    /// Changes whenever `robot.toml` or the model's file does.
    pub fingerprint: u64,
    pub(crate) leg_addresses: Vec<LegAddresses>,
    /// The ground geom.
    pub(crate) floor: usize,
    /// Places in `qpos` and `qvel` of the body's free joint.
    pub(crate) root: (usize, usize),
}

/// Why a robot cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// No built-in robot has this name.
    #[error("no robot is called `{name}`: there are {}; a robot of your own is given by the path of its robot.toml", .known.join(", "))]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// A file could not be read.
    #[error("{}: cannot be read: {source}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// `robot.toml` is wrong.
    #[error(transparent)]
    Settings(#[from] Problems),
    /// MuJoCo refuses the model.
    #[error("{path}: MuJoCo cannot load this model: {message}")]
    Model {
        /// The model's file.
        path: String,
        /// MuJoCo's words.
        message: String,
    },
}

/// A robot that comes with canter.
struct BuiltIn {
    name: &'static str,
    settings: &'static str,
    model: &'static str,
}

const BUILT_IN: [BuiltIn; 1] = [BuiltIn {
    name: "doggo",
    settings: include_str!("../../../robots/doggo/robot.toml"),
    model: include_str!("../../../robots/doggo/doggo.xml"),
}];

/// Names of the robots that come with canter.
pub fn built_in_robots() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|robot| robot.name)
}

/// Whether a robot is given by the path of its `robot.toml`, not by its name.
pub fn is_robot_path(name_or_path: &str) -> bool {
    name_or_path.contains(std::path::MAIN_SEPARATOR) || name_or_path.ends_with(".toml")
}

impl Robot {
    /// Loads a built-in robot by its name, or a robot of the user's by the path of its `robot.toml`.
    ///
    /// # Errors
    /// Everything that is wrong with `robot.toml` at once, or what MuJoCo says of the model.
    pub fn load(name_or_path: &str) -> Result<Self, RobotError> {
        if is_robot_path(name_or_path) {
            return Self::from_file(Path::new(name_or_path));
        }
        let Some(robot) = BUILT_IN.iter().find(|robot| robot.name == name_or_path) else {
            let known = built_in_robots().map(str::to_owned).collect();
            return Err(RobotError::Unknown { name: name_or_path.to_owned(), known });
        };
        let place = format!("robots/{name_or_path}/robot.toml");
        let document = Document::parse(&place, robot.settings.as_bytes())?;
        let settings = document.read::<RobotSettings>()?;
        let path = format!("robots/{name_or_path}/{}", settings.model);
        let model = Model::parse(robot.model).map_err(|message| RobotError::Model { path, message })?;
        let fingerprint = fingerprint(&[robot.settings.as_bytes(), robot.model.as_bytes()]);
        Self::assemble(&document, settings, model, fingerprint)
    }

    fn from_file(path: &Path) -> Result<Self, RobotError> {
        let read =
            |path: &Path| fs::read(path).map_err(|source| RobotError::Unreadable { path: path.to_owned(), source });
        let bytes = read(path)?;
        let document = Document::parse(&path.display().to_string(), &bytes)?;
        let settings = document.read::<RobotSettings>()?;
        let model_path = path.with_file_name(&settings.model);
        let model_bytes = read(&model_path)?;
        let model = Model::load(&model_path)
            .map_err(|message| RobotError::Model { path: model_path.display().to_string(), message })?;
        Self::assemble(&document, settings, model, fingerprint(&[&bytes, &model_bytes]))
    }

    /// The gait of this name.
    pub fn gait(&self, name: &str) -> Option<&NamedGait> {
        self.gaits.iter().find(|gait| gait.name == name)
    }

    /// The gaits whose speed counts as a default speed.
    pub fn default_gaits(&self) -> impl Iterator<Item = &NamedGait> {
        self.gaits.iter().filter(|gait| gait.is_default)
    }

    /// Torque-speed curve and current limit of every motor.
    pub fn motor(&self) -> Motor {
        let MotorSettings { max_torque_nm, stall_torque_nm, no_load_speed_rad_per_s } = self.settings.motor;
        Motor { max_torque_nm, stall_torque_nm, no_load_speed_rad_per_s }
    }

    /// Checks the settings against the model and resolves every name; reports all problems together.
    fn assemble(
        document: &Document,
        settings: RobotSettings,
        model: Model,
        fingerprint: u64,
    ) -> Result<Self, RobotError> {
        let mut problems = document.problems();
        let mut find = |kind: ObjectKind, key: &str, name: &str| {
            let id = model.id(kind, name);
            if id.is_none() {
                let kind = format!("{kind:?}").to_lowercase();
                problems.at(key, format!("the model has no {kind} called `{name}`"));
            }
            id
        };
        let body = find(ObjectKind::Body, "body", &settings.body);
        let floor = find(ObjectKind::Geom, "floor", &settings.floor);
        let mut leg_addresses = Vec::new();
        for (i, LegSettings::FiveBar(leg)) in settings.legs.iter().enumerate() {
            let foot = find(ObjectKind::Geom, &format!("legs[{i}].foot"), &leg.foot);
            let mut pair = |kind, key: &str, names: &[String]| {
                let ids: Vec<_> = names
                    .iter()
                    .enumerate()
                    .map(|(j, name)| find(kind, &format!("legs[{i}].{key}[{j}]"), name))
                    .collect();
                // A list of another length is reported below.
                <[Option<usize>; 2]>::try_from(ids).ok().and_then(|[first, second]| Some([first?, second?]))
            };
            let motors = pair(ObjectKind::Joint, "motors", &leg.motors);
            let knees = pair(ObjectKind::Joint, "knees", &leg.knees);
            let actuators = pair(ObjectKind::Actuator, "actuators", &leg.actuators);
            if let (Some(foot), Some(motor_joints), Some(knees), Some(actuators)) = (foot, motors, knees, actuators) {
                leg_addresses.push(LegAddresses {
                    foot,
                    motor_joints,
                    motors: motor_joints.map(|joint| model.joint_addresses(joint)),
                    knees: knees.map(|joint| model.joint_addresses(joint).0),
                    actuators,
                });
            }
        }
        let root = body.and_then(|body| model.free_joint(body)).map(|joint| model.joint_addresses(joint));
        if body.is_some() && root.is_none() {
            problems.at("body", "this body has no free joint: it cannot walk away");
        }
        for (key, range) in
            [("swing_rad", &settings.limits.swing_rad), ("extension_rad", &settings.limits.extension_rad)]
        {
            if !matches!(range[..], [low, high] if low < 0.0 && 0.0 < high) {
                let message = "expected a least and a greatest value around 0, the standing pose";
                problems.at(&format!("limits.{key}"), message);
            }
        }
        if settings.legs.len() != 4 {
            problems.at("legs", format!("expected 4 legs, found {}", settings.legs.len()));
        }
        let legs = settings
            .legs
            .iter()
            .enumerate()
            .filter_map(|(i, leg)| controller_leg(i, leg, &settings, &mut problems))
            .collect::<Vec<_>>();
        let mut gaits = Vec::new();
        if legs.len() == 4 {
            for (i, gait) in settings.gaits.iter().enumerate() {
                if gaits.iter().any(|earlier: &NamedGait| earlier.name == gait.name()) {
                    problems.at(&format!("gaits[{i}].name"), "another gait has this name");
                }
                gaits.extend(named_gait(i, gait, &legs, &mut problems));
            }
        }
        problems.finish(())?;
        let (Some(root), Some(floor)) = (root, floor) else {
            unreachable!("a missing free joint or floor is a problem");
        };
        Ok(Self { settings, model, legs, gaits, fingerprint, leg_addresses, floor, root })
    }
}

/// The leg as the controller sees it.
fn controller_leg(
    index: usize,
    LegSettings::FiveBar(leg): &LegSettings,
    settings: &RobotSettings,
    problems: &mut Problems,
) -> Option<Leg> {
    for (key, names) in [("motors", &leg.motors), ("knees", &leg.knees), ("actuators", &leg.actuators)] {
        if names.len() != 2 {
            problems.at(&format!("legs[{index}].{key}"), format!("expected 2 names, found {}", names.len()));
        }
    }
    let five_bar = FiveBar::new(leg.upper_link_m as f32, leg.lower_link_m as f32, settings.stance_height_m as f32);
    if five_bar.is_none() {
        let message = format!("links of these lengths cannot stand at stance_height_m = {}", settings.stance_height_m);
        problems.at(&format!("legs[{index}].upper_link_m"), message);
    }
    let limits = &settings.limits;
    let pair = |values: &[f64]| Some([*values.first()? as f32, *values.get(1)? as f32]);
    Some(Leg {
        geometry: LegGeometry::FiveBar(five_bar?),
        motors: LinearMap::five_bar_motors(),
        actuators: match leg.actuated {
            Actuated::LegSpace => LinearMap::identity(),
            Actuated::Motors => LinearMap::five_bar_motors(),
        },
        limits: LegLimits { swing: pair(&limits.swing_rad)?, extension: pair(&limits.extension_rad)? },
    })
}

/// The gait for these legs.
fn named_gait(index: usize, gait: &GaitSettings, legs: &[Leg], problems: &mut Problems) -> Option<NamedGait> {
    let footfall = gait.footfall().name();
    let (_, offsets) = QUADRUPED_GAITS.iter().find(|(name, _)| *name == footfall)?;
    let mut parts = Vec::new();
    for (leg, &phase_offset) in legs.iter().zip(offsets) {
        let Some((waveform, defaults)) = gait.waveform(leg.geometry) else {
            problems.at(&format!("gaits[{index}]"), "a leg cannot reach every point of this trajectory");
            return None;
        };
        parts.push(LegGait { waveform, phase_offset, defaults });
    }
    Some(NamedGait {
        name: gait.name().to_owned(),
        is_default: gait.is_default(),
        stride_frequency_hz: gait.stride_frequency_hz() as f32,
        legs: parts,
    })
}

/// 64-bit FNV-1a over the files, each followed by its length: tells versions of a robot apart, no protection against
/// intent. Files that the model includes are not read.
fn fingerprint(files: &[&[u8]]) -> u64 {
    const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(PRIME);
    files.iter().fold(OFFSET_BASIS, |hash, file| {
        let length = (file.len() as u64).to_le_bytes();
        file.iter().chain(&length).fold(hash, step)
    })
}
