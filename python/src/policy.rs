//! Learned policies, as the robot runs them.

use std::path::PathBuf;

use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::{open_config, read_policy};
use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors;

/// A run's policy: mirror, normaliser and network.
#[pyclass(frozen, module = "canter._native")]
pub struct Policy {
    file: PolicyFile,
}

#[pymethods]
impl Policy {
    /// The policy of a run.
    #[new]
    fn new(run: PathBuf) -> PyResult<Self> {
        // A folder that is no run is told so first.
        let file = open_config(&run).and_then(|_| read_policy(&run));
        Ok(Self { file: file.map_err(errors::of_run)? })
    }

    /// Writes the actions, `(K, A)`, for raw observations, `(K, O)`, by the code that runs on the robot.
    fn act(&self, py: Python<'_>, observations: PyBuffer<f32>, actions: PyBuffer<f32>) -> PyResult<()> {
        let policy = self.file.policy();
        let shape = policy.network.shape();
        let [count, length] = *observations.shape() else {
            return Err(PyValueError::new_err("observations: expected two dimensions"));
        };
        if length != shape.input {
            let expected = shape.input;
            return Err(PyValueError::new_err(format!("observation: expected {expected} components, not {length}")));
        }
        let mut observations = observations.to_vec(py)?;
        let mut chosen = vec![0.0; count * shape.output];
        py.detach(|| {
            let mut hidden = vec![0.0; policy.network.workspace_len()];
            let rows = observations.chunks_exact_mut(shape.input).zip(chosen.chunks_exact_mut(shape.output));
            for (observation, action) in rows {
                policy.act(observation, &mut hidden, action);
            }
        });
        actions.copy_from_slice(py, &chosen)
    }

    /// Everything in the policy's file that is not an array, as JSON; see docs/policy-format.md.
    #[getter]
    fn card(&self) -> String {
        serde_json::to_value(&self.file.card).expect("a card has string keys only").to_string()
    }

    /// O.
    #[getter]
    fn num_observations(&self) -> usize {
        self.file.policy().network.shape().input
    }

    /// A.
    #[getter]
    fn num_actions(&self) -> usize {
        self.file.policy().network.shape().output
    }
}
