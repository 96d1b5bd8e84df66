//! A robot as data: `robot.toml` and its MJCF, checked against each other and compiled once.

mod check;
mod settings;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use canter_gait::Leg;
use canter_gait::prior::LegGait;

use crate::motor::Motor;
use crate::mujoco::Model;
use crate::settings::{Document, Problems};

pub use settings::{
    Actuated, FiveBarSettings, Footfall, GaitSettings, LegSettings, LimitSettings, MotorSettings, RobotSettings,
    SineSettings, SteppingSettings,
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
    /// The passive joints.
    pub knee_joints: [usize; 2],
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
    /// MuJoCo refuses the model.
    #[error("{path}: MuJoCo cannot load this model: {message}")]
    Model {
        /// The model's file.
        path: String,
        /// MuJoCo's words.
        message: String,
    },
}

/// More of a robot's file is not read: no description has as much, but a device that never ends has [bytes].
const MAX_FILE_BYTES: u64 = 1 << 26;

/// A robot that comes with canter.
struct BuiltIn {
    name: &'static str,
    settings: &'static str,
    model: &'static str,
}

const BUILT_IN: [BuiltIn; 1] = [BuiltIn {
    name: "doggo",
    settings: include_str!("../../../../robots/doggo/robot.toml"),
    model: include_str!("../../../../robots/doggo/doggo.xml"),
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
        check::assemble(&document, settings, model, fingerprint)
    }

    fn from_file(path: &Path) -> Result<Self, RobotError> {
        let read = |path: &Path| {
            let mut bytes = Vec::new();
            let result = File::open(path).and_then(|file| file.take(MAX_FILE_BYTES).read_to_end(&mut bytes));
            result.map(|_| bytes).map_err(|source| RobotError::Unreadable { path: path.to_owned(), source })
        };
        let bytes = read(path)?;
        let document = Document::parse(&path.display().to_string(), &bytes)?;
        let settings = document.read::<RobotSettings>()?;
        let model_path = path.with_file_name(&settings.model);
        let model_bytes = read(&model_path)?;
        let model = Model::load(&model_path)
            .map_err(|message| RobotError::Model { path: model_path.display().to_string(), message })?;
        check::assemble(&document, settings, model, fingerprint(&[&bytes, &model_bytes]))
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
