//! One module a command.

pub mod compare;
pub mod config;
pub mod eval;
pub mod report;
pub mod robots;
pub mod train;

use canter_train::executor::Workers;

use crate::error::CliError;

/// The worker threads.
fn workers(num_threads: Option<u16>) -> Result<Workers, CliError> {
    Workers::new(num_threads.map(usize::from)).map_err(CliError::Threads)
}
