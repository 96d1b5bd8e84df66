//! The state of a training and one iteration of it: collect, estimate advantages, update.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use canter_gait::Network;
use canter_learn::adam::Adam;
use canter_learn::advantage::{compute_values, estimate_advantages};
use canter_learn::collect::{CollectorState, EpisodeRecord, PolicyView, collect_column};
use canter_learn::communicator::{Alone, Communicator, Message, Received, exchange, own_part, part};
use canter_learn::metrics::UpdateMetrics;
use canter_learn::normaliser::{Normaliser, RunningMoments};
use canter_learn::policy::ActorCritic;
use canter_learn::ppo::{Divergence, PpoWorkspace, UpdateContext, annealed_learning_rate, update};
use canter_learn::random::{Purpose, stream};
use canter_learn::rollout::{Rollout, RolloutColumn};
use canter_learn::settings::PpoSettings;
use canter_sim::Accident;
use canter_sim::forward::{Forward, fastest_forward};
use rayon::prelude::*;

use crate::blow_up::BlowUp;
use crate::config::Resolved;
use crate::environment::TrainingEnvironment;
use crate::executor::Workers;
use crate::outcome::Outcome;
use crate::statistics::mean;

/// Updates of a training that may diverge and be undone; the next one ends it.
pub(crate) const MAX_DIVERGENCES: u64 = 5;

/// What a divergence does to the learning rate, from then on.
const LEARNING_RATE_FACTOR: f64 = 0.5;

/// How far a training has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Iterations done.
    pub iterations: u64,
    /// Env steps taken, over all environments.
    pub env_steps: u64,
    /// Episodes finished.
    pub episodes: u64,
    /// Updates that diverged and were undone.
    pub divergences: u64,
}

/// What one iteration brought; `docs/metrics.md` defines every number.
#[derive(Clone, Debug, PartialEq)]
pub struct IterationReport {
    /// How far the training has come with this iteration.
    pub progress: Progress,
    /// Episodes that ended in this iteration.
    pub episodes: Vec<EpisodeRecord>,
    /// Accidents of this iteration, in the order of [`Accident::ALL`].
    pub accidents: [u64; Accident::ALL.len()],
    /// Forward speed over all env steps of the iteration, under exploration [m/s].
    pub speed_m_per_s: f64,
    /// Mechanical power over all env steps of the iteration [W].
    pub power_w: f64,
    /// Mean level of the curriculum over the environments, after the iteration; none without a curriculum.
    pub difficulty: Option<f64>,
    /// Mean standard deviation of the exploration noise.
    pub mean_std: f64,
    /// Losses and the like; an update that diverged was undone, and the training goes on at half the learning rate.
    pub update: Result<UpdateMetrics, Divergence>,
    /// Episodes that ended in physics that made no sense, at most one of each environment.
    pub blow_ups: Vec<BlowUp>,
    /// Wall time of collecting [s].
    pub collect_s: f64,
    /// Wall time of advantages and update, and of waiting for the other ranks and their samples [s].
    pub update_s: f64,
}

/// A training between two iterations. On several ranks each holds all of it but the other ranks' environments.
#[derive(Debug)]
pub struct Trainer {
    pub(crate) communicator: Arc<dyn Communicator>,
    resolved: Resolved,
    model: ActorCritic,
    settings: PpoSettings,
    forward: Forward,
    pub(crate) parameters: Vec<f32>,
    pub(crate) adam: Adam,
    pub(crate) moments: RunningMoments,
    /// This rank's environments, and each one's side of the collection.
    pub(crate) environments: Vec<TrainingEnvironment>,
    pub(crate) collectors: Vec<CollectorState>,
    /// What every rank's environments brought in this iteration.
    outcomes: Vec<Outcome>,
    pub(crate) progress: Progress,
    rollout: Rollout,
    workspace: PpoWorkspace,
}

impl Trainer {
    /// A training that has not begun, in this process alone.
    pub fn new(resolved: Resolved) -> Self {
        Self::on_ranks(resolved, Arc::new(Alone))
    }

    /// This rank's part of a training that has not begun.
    ///
    /// # Panics
    /// If there are more ranks than environments.
    pub fn on_ranks(resolved: Resolved, communicator: Arc<dyn Communicator>) -> Self {
        let Resolved { config, task } = &resolved;
        let model = config.network.model(task);
        let settings = config.ppo.settings();
        let training = &config.training;
        let num_environments = training.num_environments as u64;
        let own = own_part(&*communicator, training.num_environments);
        assert!(!own.is_empty(), "a rank without an environment has nothing to collect");
        let mut environments: Vec<_> = own
            .map(|index| TrainingEnvironment::new(task.clone(), config.seed, index as u64, num_environments))
            .collect();
        let collectors = environments.iter_mut().map(CollectorState::start).collect();
        let num_samples = training.num_environments * training.horizon;
        Self {
            communicator,
            model,
            forward: fastest_forward(),
            parameters: model.initial_parameters(config.seed, config.network.initial_log_std),
            adam: Adam::new(model.num_parameters(), settings.learning_rate),
            moments: RunningMoments::new(model.num_observations()),
            environments,
            collectors,
            outcomes: Vec::new(),
            progress: Progress::default(),
            rollout: Rollout::new(
                training.num_environments,
                training.horizon,
                model.num_observations(),
                model.num_actions(),
            ),
            workspace: PpoWorkspace::new(&model, &settings, num_samples),
            settings,
            resolved,
        }
    }

    /// The configuration and the task.
    pub fn resolved(&self) -> &Resolved {
        &self.resolved
    }

    /// Sizes of what is learned.
    pub fn model(&self) -> &ActorCritic {
        &self.model
    }

    /// How far the training has come.
    pub fn progress(&self) -> Progress {
        self.progress
    }

    /// The actor's parameters as they are now.
    pub fn actor_parameters(&self) -> &[f32] {
        self.model.split(&self.parameters[..]).actor
    }

    /// The observation's statistics as they are now.
    pub fn normaliser(&self) -> Normaliser {
        Normaliser::from_moments(&self.moments)
    }

    /// The ranks that train together.
    pub fn communicator(&self) -> &dyn Communicator {
        &*self.communicator
    }

    /// The numbers of this rank's environments.
    pub(crate) fn own_environments(&self) -> Range<usize> {
        own_part(&*self.communicator, self.resolved.config.training.num_environments)
    }

    /// What the last collection brought, and what the last update made of it; of the other ranks' environments only what
    /// an update reads.
    pub fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    /// Whether the configured number of env steps or episodes is reached.
    pub fn is_finished(&self) -> bool {
        let training = &self.resolved.config.training;
        self.progress.env_steps >= training.max_env_steps
            || training.max_episodes.is_some_and(|episodes| self.progress.episodes >= episodes)
    }

    /// One iteration.
    ///
    /// # Errors
    /// [`Divergence`] if one update too many met a number that is not finite.
    pub fn iterate(&mut self, workers: &Workers) -> Result<IterationReport, Divergence> {
        let start = Instant::now();
        self.collect(workers);
        let collected = Instant::now();
        // On a thread of the pool: from outside, every minibatch would wake the pool and be woken by it.
        let update = workers.install(|| {
            self.estimate_advantages(workers);
            self.share_samples();
            self.update(workers)
        });
        if let Err(divergence) = update {
            self.progress.divergences += 1;
            if self.progress.divergences > MAX_DIVERGENCES {
                return Err(divergence);
            }
            // Where it follows target_kl; elsewhere `set_learning_rate` takes care.
            self.adam.learning_rate *= LEARNING_RATE_FACTOR;
        }
        let updated = Instant::now();
        Ok(self.report(update, (collected - start).as_secs_f64(), (updated - collected).as_secs_f64()))
    }

    /// Estimates the advantages of this rank's samples.
    fn estimate_advantages(&mut self, workers: &Workers) {
        let own = self.own_environments();
        let mut columns: Vec<RolloutColumn<'_>> = self.rollout.columns_mut().collect();
        let columns = &mut columns[own];
        compute_values(columns, &self.model, &self.parameters, workers);
        estimate_advantages(columns, self.settings.gamma, self.settings.gae_lambda);
    }

    /// Gives every rank the samples of all, and what their environments did.
    fn share_samples(&mut self) {
        let own = self.own_environments();
        let collected = self.environments.iter_mut().zip(&self.collectors);
        let outcomes: Vec<Outcome> =
            collected.map(|(environment, collector)| Outcome::take(environment, collector)).collect();
        let num_ranks = self.communicator.num_ranks();
        if num_ranks == 1 {
            self.outcomes = outcomes;
            return;
        }
        let mut columns: Vec<RolloutColumn<'_>> = self.rollout.columns_mut().collect();
        let mut message = Message::default();
        for (column, outcome) in columns[own].iter().zip(&outcomes) {
            column.write(&mut message);
            outcome.write(&mut message);
        }
        self.outcomes.clear();
        let num_environments = columns.len();
        for (rank, message) in exchange(&*self.communicator, message.bytes()).iter().enumerate() {
            let mut received = Received::new(message);
            for column in &mut columns[part(num_environments, num_ranks, rank)] {
                column.read(&mut received);
                self.outcomes.push(Outcome::read(&mut received));
            }
        }
    }

    /// Updates the networks with the samples of all ranks.
    fn update(&mut self, workers: &Workers) -> Result<UpdateMetrics, Divergence> {
        self.set_learning_rate();
        let context = UpdateContext {
            model: &self.model,
            settings: &self.settings,
            executor: workers,
            communicator: &*self.communicator,
            seed: self.resolved.config.seed,
            iteration: self.progress.iterations,
        };
        update(&mut self.parameters, &mut self.adam, &self.rollout, &context, &mut self.workspace)
    }

    /// Sets the learning rate of this iteration, unless it follows the policy's divergence.
    fn set_learning_rate(&mut self) {
        let config = &self.resolved.config;
        if config.ppo.target_kl.is_none() {
            let first = config.ppo.learning_rate;
            let last = config.ppo.final_learning_rate.unwrap_or(first);
            let share = self.progress.env_steps as f64 / config.training.max_env_steps as f64;
            let lowered = LEARNING_RATE_FACTOR.powi(self.progress.divergences as i32);
            self.adam.learning_rate = lowered * annealed_learning_rate(first, last, share);
        }
    }

    /// Fills this rank's part of the rollout: every thread steps whole environments, none waits for another.
    pub fn collect(&mut self, workers: &Workers) {
        let normaliser = self.normaliser();
        let parts = self.model.split(&self.parameters[..]);
        let policy = PolicyView {
            actor: Network::new(self.model.actor, parts.actor).expect("the model's own part"),
            log_std: parts.log_std,
            normaliser: &normaliser,
            forward: self.forward,
        };
        let (seed, iteration) = (self.resolved.config.seed, self.progress.iterations);
        let own = self.own_environments();
        let first = own.start;
        let mut columns: Vec<_> = self.rollout.columns_mut().collect();
        let columns = &mut columns[own];
        let (environments, collectors) = (&mut self.environments, &mut self.collectors);
        workers.install(|| {
            environments
                .par_iter_mut()
                .zip(collectors.par_iter_mut())
                .zip(columns.par_iter_mut())
                .enumerate()
                .with_max_len(1)
                .for_each(|(index, ((environment, collector), column))| {
                    let mut rng = stream(seed, Purpose::Exploration, (first + index) as u64, iteration);
                    collect_column(environment, &policy, column, collector, &mut rng);
                });
        });
    }

    /// Moves the counters on, merges the observations' statistics in the order of the environments, and reports.
    fn report(&mut self, update: Result<UpdateMetrics, Divergence>, collect_s: f64, update_s: f64) -> IterationReport {
        let (mut episodes, mut levels, mut blow_ups) = (Vec::new(), Vec::new(), Vec::new());
        let (mut forward_m, mut work_j, mut accidents) = (0.0, 0.0, [0; Accident::ALL.len()]);
        for outcome in self.outcomes.drain(..) {
            self.moments.merge(&outcome.moments);
            episodes.extend(outcome.finished_episodes);
            levels.extend(outcome.level);
            if let Some(mut blow_up) = outcome.blow_up {
                blow_up.iteration = self.progress.iterations + 1;
                blow_ups.push(blow_up);
            }
            forward_m += outcome.travel.forward_m;
            work_j += outcome.travel.work_j;
            for (total, count) in accidents.iter_mut().zip(outcome.travel.accidents) {
                *total += count;
            }
        }
        let num_samples = self.rollout.num_samples();
        self.progress.iterations += 1;
        self.progress.env_steps += num_samples as u64;
        self.progress.episodes += episodes.len() as u64;
        let time_s = num_samples as f64 * self.resolved.config.task.control_dt_s;
        let log_std = self.model.split(&self.parameters[..]).log_std;
        IterationReport {
            progress: self.progress,
            episodes,
            accidents,
            speed_m_per_s: forward_m / time_s,
            power_w: work_j / time_s,
            difficulty: (!levels.is_empty()).then(|| mean(&levels)),
            mean_std: log_std.iter().map(|value| f64::from(value.exp())).sum::<f64>() / log_std.len() as f64,
            update,
            blow_ups,
            collect_s,
            update_s,
        }
    }
}
