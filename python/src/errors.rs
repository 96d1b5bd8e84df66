//! What goes wrong, as Python's exceptions with the program's own texts.

use canter_train::config;
use canter_train::run_directory;
use pyo3::exceptions::{PyException, PyOSError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    canter,
    ConfigError,
    PyValueError,
    "A preset, a value of a configuration, or a robot cannot be used."
);
create_exception!(canter, RunError, PyException, "A run's folder, or the policy in it, cannot be used.");

/// The exception of a configuration.
pub fn of_config(error: impl Into<config::ConfigError>) -> PyErr {
    ConfigError::new_err(error.into().to_string())
}

/// The exception of a run.
pub fn of_run(error: run_directory::RunError) -> PyErr {
    match error {
        run_directory::RunError::Config(error) => of_config(error),
        error => RunError::new_err(error.to_string()),
    }
}

/// The exception of threads that the system does not start.
pub fn of_threads(error: std::io::Error) -> PyErr {
    PyOSError::new_err(format!("cannot start the worker threads: {error}"))
}
