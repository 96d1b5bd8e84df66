//! A toy environment and the training loop around it.
#![allow(dead_code, reason = "each test binary uses its part")]

use canter_gait::network::Network;
use canter_learn::{
    ActorCritic, Adam, Alone, CollectorState, Divergence, Environment, Executor, Normaliser, OngoingEpisode,
    PORTABLE_FORWARD, PolicyView, PpoSettings, PpoWorkspace, Purpose, Rollout, RolloutColumn, RunningMoments,
    StepOutcome, UpdateContext, UpdateMetrics, collect_column, compute_values, estimate_advantages, for_each_mut,
    stream, update,
};
use rand_chacha::rand_core::Rng;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A point that is to be steered to the origin of a plane; a limit of 20 steps, an accident beyond a distance of 3.
///
/// Observed are 10 times its position and a constant; the reward is minus the distance after the step.
#[derive(Clone)]
pub struct Point {
    seed: u64,
    index: u64,
    episode: u64,
    num_steps: u32,
    position: [f32; 2],
}

impl Point {
    pub fn new(seed: u64, index: u64) -> Self {
        Self { seed, index, episode: 0, num_steps: 0, position: [0.0; 2] }
    }

    fn observe(&self, observation: &mut [f32]) {
        observation.copy_from_slice(&[10.0 * self.position[0], 10.0 * self.position[1], 1.0]);
    }

    fn distance(&self) -> f32 {
        self.position[0].hypot(self.position[1])
    }
}

impl Environment for Point {
    fn num_observations(&self) -> usize {
        3
    }

    fn num_actions(&self) -> usize {
        2
    }

    fn reset(&mut self, observation: &mut [f32]) {
        let mut rng = stream(self.seed, Purpose::Reset, self.index, self.episode);
        self.episode += 1;
        self.num_steps = 0;
        self.position = [(); 2].map(|()| rng.next_u32() as f32 / u32::MAX as f32 * 2.0 - 1.0);
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome {
        assert!(action.iter().all(|a| (-1.0..=1.0).contains(a)), "{action:?} was not clamped");
        self.num_steps += 1;
        for (x, a) in self.position.iter_mut().zip(action) {
            *x += 0.2 * a;
        }
        self.observe(observation);
        StepOutcome { reward: -self.distance(), terminated: self.distance() > 3.0, truncated: self.num_steps == 20 }
    }
}

/// Runs work on this many threads of its own.
pub struct Threads(pub usize);

impl Executor for Threads {
    fn for_each(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..self.0 {
                scope.spawn(|| {
                    while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < count) {
                        work(i);
                    }
                });
            }
        });
    }
}

/// Everything that training changes, and the environments.
pub struct Training<E> {
    pub model: ActorCritic,
    pub settings: PpoSettings,
    pub seed: u64,
    pub iteration: u64,
    pub parameters: Vec<f32>,
    pub adam: Adam,
    pub moments: RunningMoments,
    pub workers: Vec<(E, CollectorState)>,
    pub rollout: Rollout,
    pub workspace: PpoWorkspace,
}

impl<E: Environment> Training<E> {
    pub fn new(model: ActorCritic, settings: PpoSettings, seed: u64, environments: Vec<E>, num_steps: usize) -> Self {
        let parameters = model.initial_parameters(seed, -0.5);
        let rollout = Rollout::new(environments.len(), num_steps, model.num_observations(), model.num_actions());
        let start = |mut environment| {
            let state = CollectorState::start(&mut environment);
            (environment, state)
        };
        Self {
            adam: Adam::new(parameters.len(), settings.learning_rate),
            moments: RunningMoments::new(model.num_observations()),
            workers: environments.into_iter().map(start).collect(),
            workspace: PpoWorkspace::new(&model, &settings, rollout.num_samples()),
            iteration: 0,
            model,
            settings,
            seed,
            parameters,
            rollout,
        }
    }

    /// Fills the rollout with the current policy, up to its values and advantages.
    pub fn collect(&mut self, executor: &dyn Executor) {
        let parts = self.model.split(&self.parameters);
        let normaliser = Normaliser::from_moments(&self.moments);
        let policy = PolicyView {
            actor: Network::new(self.model.actor, parts.actor).unwrap(),
            log_std: parts.log_std,
            normaliser: &normaliser,
            forward: PORTABLE_FORWARD,
        };
        let (seed, iteration) = (self.seed, self.iteration);
        let mut work: Vec<(RolloutColumn<'_>, &mut (E, CollectorState))> =
            self.rollout.columns_mut().zip(&mut self.workers).collect();
        for_each_mut(executor, &mut work, |n, (column, (environment, state))| {
            let mut rng = stream(seed, Purpose::Exploration, n as u64, iteration);
            collect_column(environment, &policy, column, state, &mut rng);
        });
        for (_, state) in &self.workers {
            self.moments.merge(&state.moments);
        }
        let mut columns: Vec<_> = self.rollout.columns_mut().collect();
        compute_values(&mut columns, &self.model, &self.parameters, executor);
        estimate_advantages(&mut columns, self.settings.gamma, self.settings.gae_lambda);
    }

    pub fn update(&mut self, executor: &dyn Executor) -> Result<UpdateMetrics, Divergence> {
        let context = UpdateContext {
            model: &self.model,
            settings: &self.settings,
            executor,
            communicator: &Alone,
            seed: self.seed,
            iteration: self.iteration,
        };
        update(&mut self.parameters, &mut self.adam, &self.rollout, &context, &mut self.workspace)
    }

    pub fn run_iteration(&mut self, executor: &dyn Executor) -> UpdateMetrics {
        self.collect(executor);
        let metrics = self.update(executor).unwrap();
        self.iteration += 1;
        metrics
    }

    /// Mean return of the episodes that ended in the last iteration.
    pub fn mean_episode_return(&self) -> f64 {
        let returns: Vec<f64> =
            self.workers.iter().flat_map(|(_, state)| &state.finished_episodes).map(|e| e.episode_return).collect();
        returns.iter().sum::<f64>() / returns.len() as f64
    }
}

/// Training on [`Point`] with 8 environments of 64 steps.
pub fn point_training(seed: u64) -> Training<Point> {
    let settings = PpoSettings { minibatch_size: 128, learning_rate: 1e-3, gamma: 0.95, ..PpoSettings::default() };
    let environments = (0..8).map(|index| Point::new(seed, index)).collect();
    Training::new(ActorCritic::new(3, 2, 16, 16), settings, seed, environments, 64)
}

/// Leaves of a collector's state only what a checkpoint keeps.
pub fn restored(state: &CollectorState) -> CollectorState {
    let OngoingEpisode { observation, episode_return, episode_length } = state.ongoing.clone();
    CollectorState::resume(OngoingEpisode { observation, episode_return, episode_length })
}
