//! A robot, its gait and the ground become an environment, on MuJoCo.
//!
//! The way of the data: [`robot`] reads `robot.toml` and the MJCF; [`task`] adds what is asked of the robot and what a
//! policy may see and change; [`env`] steps it, with the [`motor`] model, the [`reward`] (eq. 6) and the [`accident`]s.
//! The controller itself is `canter_gait`'s, the code that runs on the robot. [`render`] draws robots. Only [`mujoco`] names
//! MuJoCo.

pub mod accident;
pub mod env;
pub mod file;
pub mod forward;
pub mod frame;
pub mod ground;
mod keyed;
pub mod mirror;
pub mod motor;
pub mod mujoco;
pub mod render;
pub mod reward;
pub mod robot;
pub mod settings;
pub mod task;
pub mod variation;
pub mod world;

pub use accident::Accident;
pub use env::snapshot::{LegSnapshot, Snapshot};
pub use env::{Env, StepOutcome};
pub use robot::{LEARNED, NamedGait, Robot, RobotError, built_in_robots};
pub use task::{PolicySettings, RewardSettings, Task, TaskSettings};
