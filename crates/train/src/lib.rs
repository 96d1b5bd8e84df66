//! Workers, the training loop, the run directory, evaluation and statistics.
//!
//! The way of the data: [`config`] resolves a preset into a robot and a task; [`trainer`] owns the environments and the
//! networks and does one iteration at a time, on the threads of [`executor`]; [`run`] is the loop around it and writes
//! [`run_directory`]'s files, among them [`checkpoint`]s, the [`policy_file`] and [`tensorboard`]'s curves; [`evaluate`]
//! measures what was learned, and [`trajectory`] records it step by step.

pub mod checkpoint;
pub mod config;
pub mod environment;
pub mod evaluate;
pub mod executor;
pub mod policy_file;
pub mod run;
pub mod run_directory;
pub mod statistics;
pub mod tensorboard;
pub mod tensors;
pub mod trainer;
pub mod trajectory;
