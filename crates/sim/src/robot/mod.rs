//! A robot as data: `robot.toml` and its MJCF, checked against each other and compiled once.
//!
//! A robot of the user's passes four doors, each with its own words: the settings are read, the model's files are
//! screened ([`ModelProblems`]), the guard tries to compile them ([`set_model_guard`]), and the compiled model is held
//! against the settings. Its files may use nothing outside the folder of `robot.toml`.

mod check;
pub mod checkup;
pub mod draft;
pub mod guard;
mod screen;
mod settings;
pub mod table;
mod xml;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use canter_gait::prior::LegGait;
use canter_gait::{JointConvention, Leg};

use crate::file;
use crate::motor::Motor;
use crate::mujoco::{Model, Simulation};
use crate::settings::{Document, MAX_FILE_BYTES, Problems};

pub use screen::ModelProblems;
pub use settings::{
    Actuated, FiveBarSettings, Footfall, GaitSettings, HeldSettings, KneeSide, LegSettings, LimitSettings,
    MotorSettings, RobotSettings, SerialSettings, SineSettings, SteppingSettings, TableSettings,
};

/// What the learned gait is called beside the robot's own gaits; none of those may have this name.
pub const LEARNED: &str = "learned";

/// A gait that a robot's legs can walk: what [`canter_gait::Gait`] borrows.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedGait {
    /// Its name in `robot.toml`.
    pub name: String,
    /// Whether its speed counts as a default speed.
    pub is_default: bool,
    /// Whether it keeps the robot on its feet without a policy.
    pub is_stable: bool,
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
    /// How the joints' angles count against motor angles, which are positive forward and 0 in the standing pose.
    pub conventions: [JointConvention; 2],
    /// The passive joints that close the loop; a serial leg has none.
    pub knees: Option<KneeAddresses>,
    /// Places in `ctrl`.
    pub actuators: [usize; 2],
}

impl LegAddresses {
    /// The joints at which the two upper links end: those of a serial leg are one.
    pub fn knee_joints(&self) -> [usize; 2] {
        self.knees.as_ref().map_or([self.motor_joints[1]; 2], |knees| knees.joints)
    }
}

/// Where MuJoCo keeps the passive joints of one leg.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KneeAddresses {
    /// The joints.
    pub joints: [usize; 2],
    /// Places in `qpos`.
    pub places: [usize; 2],
    /// How the joints' angles count against knee angles, which are positive forward and 0 in the standing pose.
    pub conventions: [JointConvention; 2],
}

/// A motor that is held still.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeldMotor {
    /// Its joint.
    pub joint: usize,
    /// Its place in `qvel`.
    pub velocity: usize,
    /// Its place in `ctrl`.
    pub actuator: usize,
    /// The angle that it is held at [rad].
    pub target: f64,
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
    /// Changes whenever `robot.toml`, the model's file, a file that it uses or a recorded gait does.
    pub fingerprint: u64,
    pub(crate) leg_addresses: Vec<LegAddresses>,
    pub(crate) held: Vec<HeldMotor>,
    /// The ground geom.
    pub(crate) floor: usize,
    /// Places in `qpos` and `qvel` of the body's free joint.
    pub(crate) root: (usize, usize),
    /// The body that floats.
    pub(crate) trunk: usize,
}

/// A robot and the files that it was read from.
struct Loaded {
    robot: Robot,
    document: Document,
    /// The model's files, its own first; none of a built-in robot.
    files: Vec<PathBuf>,
    /// Path and text of a built-in robot's model.
    texts: Option<(String, &'static str)>,
}

/// Why a robot cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// No built-in robot has this name.
    #[error("no robot is called `{name}`: there are {}; a robot of your own is given by the path of its file, like {name}/robot.toml", .known.join(", "))]
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
    /// The model's files are wrong, or ask for too much.
    #[error(transparent)]
    Files(#[from] ModelProblems),
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

macro_rules! built_in {
    ($($name:literal),+ $(,)?) => {
        [$(BuiltIn {
            name: $name,
            settings: include_str!(concat!("../../../../robots/", $name, "/robot.toml")),
            model: include_str!(concat!("../../../../robots/", $name, "/", $name, ".xml")),
        }),+]
    };
}

const BUILT_IN: [BuiltIn; 6] = built_in!["doggo", "minitaur", "q8bot", "quad12", "hexapod", "octopod"];

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
        Self::load_with_sources(name_or_path).map(|loaded| loaded.robot)
    }

    fn load_with_sources(name_or_path: &str) -> Result<Loaded, RobotError> {
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
        let refused = |message| RobotError::Model { path: path.clone(), message };
        let model = Model::parse(robot.model).map_err(refused)?;
        let mut fingerprint = Fingerprint::new();
        fingerprint.add(robot.settings.as_bytes());
        fingerprint.add(robot.model.as_bytes());
        let texts = Some((path, robot.model));
        let robot = check::assemble(&document, settings, model, None, fingerprint.0)?;
        Ok(Loaded { robot, document, files: Vec::new(), texts })
    }

    fn from_file(path: &Path) -> Result<Loaded, RobotError> {
        let bytes = file::read(path, MAX_FILE_BYTES as u64)
            .map_err(|source| RobotError::Unreadable { path: path.to_owned(), source })?;
        let document = Document::parse(&path.display().to_string(), &bytes)?;
        let settings = document.read::<RobotSettings>()?;
        let mut fingerprint = Fingerprint::new();
        fingerprint.add(&bytes);
        let model_path = path.with_file_name(&settings.model);
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = screen::screen(folder, &model_path, &mut fingerprint)?;
        for table in settings.gaits.iter().filter_map(GaitSettings::table) {
            // A table that cannot be read is reported with what else is wrong.
            fingerprint.add(&file::read(&folder.join(table), MAX_FILE_BYTES as u64).unwrap_or_default());
        }
        let model = compile(&model_path)?;
        let robot = check::assemble(&document, settings, model, Some(folder), fingerprint.0)?;
        Ok(Loaded { robot, document, files, texts: None })
    }

    /// The gait of this name.
    pub fn gait(&self, name: &str) -> Option<&NamedGait> {
        self.gaits.iter().find(|gait| gait.name == name)
    }

    /// A gait of sines or of the firmware's trajectory on this robot's legs; none if a leg cannot reach every point of it,
    /// the footfall does not fit so many legs, or it is a table, which needs its file.
    pub fn shaped_gait(&self, settings: &GaitSettings) -> Option<NamedGait> {
        let offsets = settings.phase_offsets(self.legs.len()).ok()?;
        let part = |(leg, phase_offset): (&Leg, f32)| {
            let (waveform, defaults) = settings.waveform(leg.geometry)?;
            Some(LegGait { waveform, phase_offset, defaults })
        };
        Some(NamedGait {
            name: settings.name().to_owned(),
            is_default: settings.is_default(),
            is_stable: settings.is_stable(),
            stride_frequency_hz: settings.stride_frequency_hz() as f32,
            legs: self.legs.iter().zip(offsets).map(part).collect::<Option<_>>()?,
        })
    }

    /// Names of the legs' actuators, two a leg.
    pub fn actuators(&self) -> impl Iterator<Item = &str> {
        self.settings.legs.iter().flat_map(|leg| leg.motors_and_actuators().1).map(String::as_str)
    }

    /// The gaits whose speed counts as a default speed.
    pub fn default_gaits(&self) -> impl Iterator<Item = &NamedGait> {
        self.gaits.iter().filter(|gait| gait.is_default)
    }

    /// Joint and place in `qvel` of every motor: those of the legs in their order, then those that are held.
    pub(crate) fn motor_joints(&self) -> impl Iterator<Item = (usize, usize)> {
        let legs = self.leg_addresses.iter().flat_map(|leg| {
            leg.motor_joints.into_iter().zip(leg.motors).map(|(joint, (_, velocity))| (joint, velocity))
        });
        legs.chain(self.held.iter().map(|held| (held.joint, held.velocity)))
    }

    /// Torque-speed curve and current limit of every motor.
    pub fn motor(&self) -> Motor {
        let MotorSettings { max_torque_nm, stall_torque_nm, no_load_speed_rad_per_s, .. } = self.settings.motor;
        Motor { max_torque_nm, stall_torque_nm, no_load_speed_rad_per_s }
    }
}

/// Screens and compiles a model of the user's that has no `robot.toml` yet; returns it with the files that it uses, its
/// own first.
///
/// # Errors
/// What is wrong with its files, or what MuJoCo says of them.
pub fn load_model(path: &Path) -> Result<(Model, Vec<PathBuf>), RobotError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = screen::screen(folder, path, &mut Fingerprint::new())?;
    Ok((compile(path)?, files))
}

/// Compiles a screened model, which the guard tries before.
fn compile(path: &Path) -> Result<Model, RobotError> {
    let refused = |message| RobotError::Model { path: path.display().to_string(), message };
    if let Some(guard) = MODEL_GUARD.get() {
        guard(path).map_err(refused)?;
    }
    Model::load(path).map_err(refused)
}

/// Tries a user's model, given the path of its file, before this process compiles it. An error is in words that follow
/// "MuJoCo cannot load this model:".
pub type ModelGuard = fn(&Path) -> Result<(), String>;

static MODEL_GUARD: OnceLock<ModelGuard> = OnceLock::new();

/// Has every user's model tried by `guard` from now on; a second call changes nothing.
///
/// MuJoCo compiles whatever a file asks for: it may take minutes and gigabytes, or crash. A program that must survive
/// that gives a guard which calls [`try_model`] in a process with limits: [`guard::try_in_a_process`]. Without a guard models are compiled directly.
pub fn set_model_guard(guard: ModelGuard) {
    // The first guard stays.
    let _ = MODEL_GUARD.set(guard);
}

/// Compiles a model and takes one physics step: what a guard does in a process that may come to grief.
///
/// # Errors
/// MuJoCo's own words about what is wrong with the file, or ours about what is too large.
pub fn try_model(path: &Path) -> Result<(), String> {
    let model = Model::load(path)?;
    if let Some(message) = check::excess(&model) {
        return Err(message);
    }
    Simulation::new(&model).step();
    Ok(())
}

/// 64-bit FNV-1a over files, each followed by its length: tells versions of a robot apart, no protection against intent.
struct Fingerprint(u64);

impl Fingerprint {
    fn new() -> Self {
        const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
        Self(OFFSET_BASIS)
    }

    fn add(&mut self, file: &[u8]) {
        const PRIME: u64 = 0x0000_0100_0000_01b3;
        let length = (file.len() as u64).to_le_bytes();
        let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(PRIME);
        self.0 = file.iter().chain(&length).fold(self.0, step);
    }
}
