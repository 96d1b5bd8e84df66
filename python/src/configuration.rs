//! Configurations: a preset, a file, or a run's, with values put over it.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use canter_sim::built_in_robots;
use canter_sim::robot::{guard, set_model_guard};
use canter_sim::settings::Document;
use canter_train::config::{self, Resolved, bare_gait, open_preset};
use canter_train::run_directory::open_config;
use pyo3::prelude::*;

use crate::errors;

/// A configuration whose values may still be overridden.
#[pyclass(module = "canter._native")]
#[derive(Debug)]
pub struct Configuration {
    document: Document,
}

#[pymethods]
impl Configuration {
    /// The preset of this name, or the configuration file at this path.
    #[staticmethod]
    fn of_preset(name_or_path: &str) -> PyResult<Self> {
        Ok(Self { document: open_preset(name_or_path).map_err(errors::of_config)? })
    }

    /// That of a run.
    #[staticmethod]
    fn of_run(run: PathBuf) -> PyResult<Self> {
        Ok(Self { document: open_config(&run).map_err(errors::of_run)? })
    }

    /// A bare gait of a robot under the default preset's protocol.
    #[staticmethod]
    fn of_gait(robot: &str, gait: &str) -> PyResult<Self> {
        Ok(Self { document: bare_gait(robot, gait).map_err(errors::of_config)? })
    }

    /// Puts a value, in TOML, in the place of another, as `--set key=value` does. What is wrong with it is reported
    /// together with everything else, when the configuration is used.
    fn set(&mut self, key: &str, value: &str) {
        self.document.set(key, value);
    }
}

impl Configuration {
    /// Robot and task put together.
    pub fn resolve(&self) -> PyResult<Resolved> {
        config::resolve(&self.document).map_err(errors::of_config)
    }
}

/// Names of the presets that come with canter.
#[pyfunction]
pub fn preset_names() -> Vec<String> {
    config::preset_names().collect()
}

/// Names of the robots that come with canter.
#[pyfunction]
pub fn robot_names() -> Vec<&'static str> {
    built_in_robots().collect()
}

/// The program `canter`.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Says where the program `canter` lies, which tries models of the user's; the first call counts.
#[pyfunction]
pub fn set_program(path: PathBuf) {
    if PROGRAM.set(path).is_ok() {
        set_model_guard(model_guard);
    }
}

/// Tries a model with the program.
fn model_guard(model: &Path) -> Result<(), String> {
    guard::try_in_a_process(PROGRAM.get().map_or(Path::new("canter"), PathBuf::as_path), model)
}
