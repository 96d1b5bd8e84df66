//! Workers, the training loop, the run directory, evaluation and statistics.
//!
//! The way of the data: [`config`] resolves a preset into a robot and a task; [`trainer`] owns the environments and the
//! networks and does one iteration at a time, on the threads of [`executor`] and together with other [`ranks`]; [`run`] is the loop around it and writes
//! [`run_directory`]'s files, among them [`checkpoint`]s, the [`policy_file`], [`tensorboard`]'s curves and, should the
//! physics make no sense, what a [`blow_up`] left; [`evaluate`] measures what was learned, its [`footfall`]s among it, and
//! says by which [`protocol`]; [`trajectory`] records it step by step, and [`film`] shows it. [`search`] tunes a gait
//! without learning, [`gait_fit`] finds the parameters of one that was recorded, [`compare`] sets all that side by side.

pub mod blow_up;
pub mod checkpoint;
pub mod compare;
pub mod config;
pub mod environment;
pub mod evaluate;
pub mod executor;
pub mod film;
pub mod footfall;
pub mod gait_fit;
pub mod jobs;
mod json;
mod outcome;
pub mod policy_file;
pub mod protocol;
pub mod ranks;
pub mod robustness;
pub mod run;
pub mod run_directory;
pub mod search;
pub mod statistics;
pub mod sweep;
pub mod tensorboard;
pub mod tensors;
pub mod trainer;
pub mod trajectory;
#[cfg(feature = "mpi")]
pub mod world;
