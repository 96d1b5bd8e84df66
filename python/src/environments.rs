//! Environments side by side.

use std::sync::{Mutex, MutexGuard, PoisonError};

use canter_learn::environment::{Environment, StepOutcome};
use canter_learn::executor::{Executor, Serial, for_each_mut};
use canter_sim::Accident;
use canter_train::config::{Resolved, RunConfig};
use canter_train::environment::{TrainingEnvironment, Travel};
use canter_train::evaluate::evaluation_task;
use canter_train::executor::Workers;
use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::configuration::Configuration;
use crate::{errors, pass_warnings_on};

/// Environments of one task, side by side on threads of their own.
///
/// Shapes: N environments, O components of an observation, A of an action.
#[pyclass(frozen, module = "canter._native")]
pub struct Environments {
    /// The configuration, and the task that the environments have.
    resolved: Resolved,
    /// Number of the first environment, and of how many.
    place: (u64, u64),
    /// Whether they begin their episodes as an evaluation does.
    evaluation: bool,
    num_envs: usize,
    batch: Mutex<Batch>,
}

/// What changes.
struct Batch {
    slots: Vec<Slot>,
    executor: Box<dyn Executor + Send>,
}

/// One environment and where it is.
struct Slot {
    environment: TrainingEnvironment,
    /// `(O)` the present one.
    observation: Vec<f32>,
    /// Whether it has to be reset before the next step: its episode has ended, or it has none yet.
    needs_reset: bool,
    /// `(O)` the last one of the last episode that ended and was reset in the same step.
    last_observation: Vec<f32>,
    step: SlotStep,
}

/// What the last step brought.
#[derive(Clone, Copy, Default)]
struct SlotStep {
    outcome: StepOutcome,
    travel: Travel,
    /// Whether the environment was reset instead of stepped.
    was_reset: bool,
}

/// The arrays of Python's that a step writes.
type Results = (PyBuffer<f32>, PyBuffer<f64>, PyBuffer<u8>, PyBuffer<f32>);

#[pymethods]
impl Environments {
    /// `num_envs` environments, or as many as the configuration's training or evaluation has; the first of them is number
    /// `place.0` of `place.1`, or 0 of these. `threads`: as many as there are cores for none.
    ///
    /// `evaluation`: in the states in which an evaluation's episodes begin, with its physics, and without what only
    /// training has.
    #[new]
    #[pyo3(signature = (configuration, num_envs, place, threads, evaluation))]
    fn new(
        py: Python<'_>,
        configuration: &Configuration,
        num_envs: Option<usize>,
        place: Option<(u64, u64)>,
        threads: Option<usize>,
        evaluation: bool,
    ) -> PyResult<Self> {
        if threads == Some(0) {
            return Err(PyValueError::new_err("threads: expected a number from 1 up, or None for all cores"));
        }
        let mut resolved = configuration.resolve()?;
        if evaluation {
            resolved.task = evaluation_task(&resolved.task, &resolved.config.evaluation);
        }
        let RunConfig { training, evaluation: protocol, .. } = &resolved.config;
        let num_envs = num_envs.unwrap_or(if evaluation { protocol.num_episodes } else { training.num_environments });
        let (first, of) = place.unwrap_or((0, num_envs as u64));
        if num_envs == 0 || first.saturating_add(num_envs as u64) > of {
            return Err(PyValueError::new_err(format!("there are no {num_envs} environments from {first} on of {of}")));
        }
        let executor: Box<dyn Executor + Send> = match (threads, num_envs) {
            // The calling thread is one.
            (Some(1), _) | (_, 1) => Box::new(Serial),
            _ => Box::new(Workers::new(threads).map_err(errors::of_threads)?),
        };
        let seed = if evaluation { protocol.seed } else { resolved.config.seed };
        let batch = Mutex::new(Batch { slots: Vec::new(), executor });
        let environments = Self { resolved, place: (first, of), evaluation, num_envs, batch };
        environments.lock().slots = (0..num_envs).map(|i| environments.slot(seed, i)).collect();
        pass_warnings_on(py)?;
        Ok(environments)
    }

    /// Resets the environments in `mask`, `(N)`, all of them for none; those that have a seed begin its stream anew. Writes
    /// all observations, `(N, O)`.
    #[pyo3(signature = (seeds, mask, observations))]
    fn reset(
        &self,
        py: Python<'_>,
        seeds: Vec<Option<u64>>,
        mask: Option<Vec<bool>>,
        observations: PyBuffer<f32>,
    ) -> PyResult<()> {
        let now = py.detach(|| {
            let mut batch = self.lock();
            let Batch { slots, executor } = &mut *batch;
            for_each_mut(&**executor, slots, |i, slot| {
                if mask.as_ref().is_some_and(|mask| !mask.get(i).copied().unwrap_or(false)) {
                    return;
                }
                if let Some(seed) = seeds.get(i).copied().flatten() {
                    *slot = self.slot(seed, i);
                }
                slot.reset();
            });
            batch.observations()
        });
        pass_warnings_on(py)?;
        observations.copy_from_slice(py, &now)
    }

    /// Steps every environment by its row of `actions`, `(N, A)`, each component clamped to [-1, 1]. One that has to be
    /// reset is reset instead, with reward 0. With `same_step`, one whose episode ends is reset at once.
    ///
    /// Writes into `results`: the observations, `(N, O)`; reward, way forward [m] and work of the motors [J], `(3, N)`;
    /// whether the episode ended in an accident or at a limit, and whether the environment was reset instead of stepped,
    /// `(3, N)`; and with `same_step` the last observation of each episode that ended, `(N, O)`. Returns the accident of each
    /// environment that had one.
    fn step(
        &self,
        py: Python<'_>,
        actions: PyBuffer<f32>,
        same_step: bool,
        results: Results,
    ) -> PyResult<Vec<(usize, &'static str)>> {
        let num_actions = self.resolved.task.num_actions();
        let expected = [self.num_envs, num_actions];
        if actions.shape() != expected {
            let shape = actions.shape();
            return Err(PyValueError::new_err(format!("actions: expected the shape {expected:?}, not {shape:?}")));
        }
        // A copy: another thread of Python's may write the array meanwhile.
        let actions = actions.to_vec(py)?;
        let (observations, last_observations, steps) = py.detach(|| {
            let mut batch = self.lock();
            let Batch { slots, executor } = &mut *batch;
            for_each_mut(&**executor, slots, |i, slot| {
                slot.step(&actions[i * num_actions..(i + 1) * num_actions], same_step);
            });
            let steps: Vec<SlotStep> = slots.iter().map(|slot| slot.step).collect();
            let last_observations = same_step.then(|| rows(slots, |slot| &slot.last_observation));
            (batch.observations(), last_observations, steps)
        });
        pass_warnings_on(py)?;
        let row = |number: fn(&SlotStep) -> f64| steps.iter().map(number);
        let rewards = row(|step| f64::from(step.outcome.reward));
        let numbers: Vec<f64> =
            rewards.chain(row(|step| step.travel.forward_m)).chain(row(|step| step.travel.work_j)).collect();
        let row = |flag: fn(&SlotStep) -> bool| steps.iter().map(move |step| u8::from(flag(step)));
        let terminations = row(|step| step.outcome.terminated);
        let truncations = row(|step| step.outcome.truncated && !step.outcome.terminated);
        let flags: Vec<u8> = terminations.chain(truncations).chain(row(|step| step.was_reset)).collect();
        results.0.copy_from_slice(py, &observations)?;
        results.1.copy_from_slice(py, &numbers)?;
        results.2.copy_from_slice(py, &flags)?;
        if let Some(last_observations) = last_observations {
            results.3.copy_from_slice(py, &last_observations)?;
        }
        Ok(steps.iter().enumerate().filter_map(|(i, step)| Some((i, accident(&step.travel)?))).collect())
    }

    /// Name of the robot.
    #[getter]
    fn robot(&self) -> &str {
        &self.resolved.task.robot.settings.name
    }

    /// Name of the gait that is modulated.
    #[getter]
    fn gait(&self) -> &str {
        &self.resolved.config.policy.prior
    }

    /// N.
    #[getter]
    fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// O.
    #[getter]
    fn num_observations(&self) -> usize {
        self.resolved.task.num_observations()
    }

    /// A.
    #[getter]
    fn num_actions(&self) -> usize {
        self.resolved.task.num_actions()
    }

    /// Names of the observation's blocks, in order.
    #[getter]
    fn observation_blocks(&self) -> Vec<&'static str> {
        self.resolved.task.blocks().iter().map(|block| block.name()).collect()
    }

    /// Time between two commands [s].
    #[getter]
    fn control_dt_s(&self) -> f64 {
        self.resolved.task.settings.control_dt_s
    }

    /// Env steps of an episode, if nothing else ends it.
    #[getter]
    fn max_env_steps(&self) -> u32 {
        self.resolved.task.max_env_steps
    }

    /// Env steps of an episode before an evaluation counts.
    #[getter]
    fn settle_steps(&self) -> u32 {
        self.resolved.task.settings.env_steps_until(self.resolved.config.evaluation.settle_s)
    }
}

impl Environments {
    /// What changes. A panic in a step is a bug; it is no reason to panic in the next one too.
    fn lock(&self) -> MutexGuard<'_, Batch> {
        self.batch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Environment number `index` of these, with the random starts of this seed.
    fn slot(&self, seed: u64, index: usize) -> Slot {
        let (first, of) = self.place;
        let (task, number) = (self.resolved.task.clone(), first + index as u64);
        Slot::new(if self.evaluation {
            TrainingEnvironment::of_evaluation(task, seed, number)
        } else {
            TrainingEnvironment::new(task, seed, number, of)
        })
    }
}

impl Batch {
    /// All observations, `(N x O)`.
    fn observations(&self) -> Vec<f32> {
        rows(&self.slots, |slot| &slot.observation)
    }
}

/// An array of each environment's, `(O)`, one after the other.
fn rows(slots: &[Slot], row: fn(&Slot) -> &[f32]) -> Vec<f32> {
    slots.iter().flat_map(row).copied().collect()
}

impl Slot {
    /// An environment that has no episode yet.
    fn new(environment: TrainingEnvironment) -> Self {
        let observation = vec![0.0; environment.num_observations()];
        let last_observation = observation.clone();
        Self { environment, observation, needs_reset: true, last_observation, step: SlotStep::default() }
    }

    fn reset(&mut self) {
        self.environment.reset(&mut self.observation);
        self.needs_reset = false;
    }

    fn step(&mut self, action: &[f32], same_step: bool) {
        self.step = SlotStep::default();
        if self.needs_reset {
            self.step.was_reset = true;
            return self.reset();
        }
        let outcome = self.environment.step(action, &mut self.observation);
        self.step.outcome = outcome;
        self.step.travel = std::mem::take(&mut self.environment.travel);
        // What a run's folder keeps for a replay has no place here.
        self.environment.blow_up = None;
        self.needs_reset = outcome.terminated || outcome.truncated;
        if self.needs_reset && same_step {
            self.last_observation.copy_from_slice(&self.observation);
            self.reset();
        }
    }
}

/// The accident of a step, by name.
fn accident(travel: &Travel) -> Option<&'static str> {
    Accident::ALL.into_iter().zip(travel.accidents).find_map(|(accident, count)| (count > 0).then(|| accident.name()))
}
