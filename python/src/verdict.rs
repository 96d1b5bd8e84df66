//! Verdicts: a policy or a bare gait against the robot's default gaits.

use std::path::PathBuf;

use canter_train::evaluate;
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::read_policy_for;
use pyo3::prelude::*;

use crate::configuration::Configuration;
use crate::{errors, pass_warnings_on};

/// Measures the policy of a run, or without a run the configuration's bare gait; JSON as `canter eval --json` prints it.
#[pyfunction]
#[pyo3(signature = (configuration, run, threads))]
pub fn judge(
    py: Python<'_>,
    configuration: &Configuration,
    run: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<String> {
    let resolved = configuration.resolve()?;
    let policy = run.map(|run| read_policy_for(&run, &resolved.task)).transpose().map_err(errors::of_run)?;
    let workers = Workers::new(threads).map_err(errors::of_threads)?;
    let verdict = py.detach(|| {
        let policy = policy.as_ref().map(PolicyFile::policy);
        let (prior, settings) = (&resolved.config.policy.prior, &resolved.config.evaluation);
        evaluate::judge(&resolved.task, prior, policy.as_ref(), settings, &workers)
    });
    pass_warnings_on(py)?;
    Ok(serde_json::to_value(&verdict).expect("a verdict has string keys only").to_string())
}
