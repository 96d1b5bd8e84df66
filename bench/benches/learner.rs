//! The learner's parts at the preset's sizes: one action, the advantages and the update of one rollout.

use std::hint::black_box;

use canter_bench::level::resolve_on_level_ground;
use canter_gait::{Network, Policy};
use canter_learn::adam::Adam;
use canter_learn::advantage::{compute_values, estimate_advantages};
use canter_learn::collect::{CollectorState, PolicyView, collect_column};
use canter_learn::communicator::Alone;
use canter_learn::executor::Serial;
use canter_learn::normaliser::Normaliser;
use canter_learn::policy::ActorCritic;
use canter_learn::ppo::{PpoWorkspace, UpdateContext, update};
use canter_learn::random::{Purpose, stream};
use canter_learn::rollout::Rollout;
use canter_sim::forward::{fastest_forward, portable_forward};
use canter_train::config::Resolved;
use canter_train::environment::TrainingEnvironment;
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};

criterion_group!(benches, policy_forward, policy_act, gae, ppo_update);
criterion_main!(benches);

fn preset() -> Resolved {
    resolve_on_level_ground(&[]).expect("the preset is valid")
}

/// The preset's networks with their first parameters.
fn model(Resolved { config, task }: &Resolved) -> (ActorCritic, Vec<f32>) {
    let model = config.network.model(task);
    (model, model.initial_parameters(config.seed, config.network.initial_log_std))
}

/// The actor's forward pass for one observation, as the simulator runs it and as a robot without AVX2 does.
fn policy_forward(criterion: &mut Criterion) {
    let (model, parameters) = model(&preset());
    let network = Network::new(model.actor, model.split(&parameters[..]).actor).expect("the model's own part");
    let observation = vec![0.5; model.num_observations()];
    let mut hidden = vec![0.0; network.workspace_len()];
    let mut action = vec![0.0; model.num_actions()];
    for (name, forward) in [("policy_forward", fastest_forward()), ("policy_forward_portable", portable_forward)] {
        criterion.bench_function(name, |bencher| {
            bencher.iter(|| forward(&network, black_box(&observation), &mut hidden, &mut action));
        });
    }
}

/// One step of a policy: mirror, normaliser, network.
fn policy_act(criterion: &mut Criterion) {
    let resolved = preset();
    let (model, parameters) = model(&resolved);
    let normaliser = Normaliser::identity(model.num_observations());
    let policy = Policy {
        normaliser: normaliser.view(),
        network: Network::new(model.actor, model.split(&parameters[..]).actor).expect("the model's own part"),
        mirror: resolved.task.mirror(),
    };
    let observation = vec![0.5; model.num_observations()];
    let mut seen = observation.clone();
    let mut hidden = vec![0.0; policy.network.workspace_len()];
    let mut action = vec![0.0; model.num_actions()];
    criterion.bench_function("policy_act", |bencher| {
        bencher.iter(|| {
            seen.copy_from_slice(black_box(&observation));
            policy.act(&mut seen, &mut hidden, &mut action);
        });
    });
}

/// Advantages of one rollout whose values are known.
fn gae(criterion: &mut Criterion) {
    let resolved = preset();
    let mut rollout = collected(&resolved);
    let ppo = &resolved.config.ppo;
    let mut columns: Vec<_> = rollout.columns_mut().collect();
    criterion.bench_function("gae", |bencher| {
        bencher.iter(|| estimate_advantages(black_box(&mut columns), ppo.gamma, ppo.gae_lambda));
    });
}

/// The update of one iteration, all epochs, on one thread.
fn ppo_update(criterion: &mut Criterion) {
    let resolved = preset();
    let rollout = collected(&resolved);
    let (model, parameters) = model(&resolved);
    let settings = resolved.config.ppo.settings();
    let adam = Adam::new(model.num_parameters(), settings.learning_rate);
    let mut workspace = PpoWorkspace::new(&model, &settings, rollout.num_samples());
    let context = UpdateContext {
        model: &model,
        settings: &settings,
        executor: &Serial,
        communicator: &Alone,
        seed: 1,
        iteration: 0,
    };
    let mut group = criterion.benchmark_group("learner");
    group.sample_size(10);
    group.bench_function("ppo_update", |bencher| {
        bencher.iter_batched_ref(
            || (parameters.clone(), adam.clone()),
            |(parameters, adam)| {
                update(parameters, adam, &rollout, &context, &mut workspace).expect("finite losses");
            },
            BatchSize::PerIteration,
        );
    });
    group.finish();
}

/// A rollout of the preset's size under its untrained policy, with values and advantages.
fn collected(resolved: &Resolved) -> Rollout {
    let Resolved { config, task } = resolved;
    let (model, parameters) = model(resolved);
    let parts = model.split(&parameters[..]);
    let normaliser = Normaliser::identity(model.num_observations());
    let policy = PolicyView {
        actor: Network::new(model.actor, parts.actor).expect("the model's own part"),
        log_std: parts.log_std,
        normaliser: &normaliser,
        forward: fastest_forward(),
    };
    let num_environments = config.training.num_environments;
    let mut rollout =
        Rollout::new(num_environments, config.training.horizon, model.num_observations(), model.num_actions());
    for (index, mut column) in (0..).zip(rollout.columns_mut()) {
        let mut environment = TrainingEnvironment::new(task.clone(), config.seed, index, num_environments as u64);
        let mut collector = CollectorState::start(&mut environment);
        let mut rng = stream(config.seed, Purpose::Exploration, index, 0);
        collect_column(&mut environment, &policy, &mut column, &mut collector, &mut rng);
    }
    let mut columns: Vec<_> = rollout.columns_mut().collect();
    compute_values(&mut columns, &model, &parameters, &Serial);
    estimate_advantages(&mut columns, config.ppo.gamma, config.ppo.gae_lambda);
    rollout
}
