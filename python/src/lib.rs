//! The extension module `canter._native`: what the Python files of the package `canter` stand on.
//!
//! It holds no rule of its own: configurations, environments, policies and verdicts are those of the program. What may
//! take long runs without Python's lock.

#![cfg(feature = "extension")]
// What Python calls takes its arguments by value.
#![expect(clippy::needless_pass_by_value)]

mod configuration;
mod environments;
mod errors;
mod policy;
mod verdict;

use pyo3::prelude::*;

/// The module.
#[pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::configuration::{Configuration, preset_names, robot_names, set_program};
    #[pymodule_export]
    use crate::environments::Environments;
    #[pymodule_export]
    use crate::errors::{ConfigError, RunError};
    #[pymodule_export]
    use crate::policy::Policy;
    #[pymodule_export]
    use crate::verdict::judge;

    /// Version of canter.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Python's own streams cannot be used: MuJoCo ends the process, on any thread.
        canter_sim::mujoco::set_fatal_handler(|message| eprintln!("canter: MuJoCo: {message}"));
        Ok(())
    }
}

/// Passes MuJoCo's warnings on as Python's.
fn pass_warnings_on(py: Python<'_>) -> PyResult<()> {
    let mut messages = canter_sim::mujoco::take_messages();
    messages.dedup();
    for message in messages {
        let text = std::ffi::CString::new(format!("MuJoCo: {message}").replace('\0', " "))?;
        PyErr::warn(py, &py.get_type::<pyo3::exceptions::PyRuntimeWarning>(), &text, 2)?;
    }
    Ok(())
}
