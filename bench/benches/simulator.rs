//! The simulator's parts and the whole: one env step, collecting, one iteration of training.

use canter_bench::level::{document, resolve_on_level_ground};
use canter_sim::Env;
use canter_train::config::resolve;
use canter_train::executor::Workers;
use canter_train::trainer::Trainer;
use criterion::{Criterion, criterion_group, criterion_main};

criterion_group!(benches, env_step, training);
criterion_main!(benches);

/// One env step of the walking prior, every physics step of it included.
fn env_step(criterion: &mut Criterion) {
    let task = resolve_on_level_ground(&[]).expect("the preset is valid").task;
    let mut observation = vec![0.0; task.num_observations()];
    let action = vec![0.0; task.num_actions()];
    let mut env = Env::new(task);
    let reset = |env: &mut Env, observation: &mut [f32]| env.reset(&mut || 0.5, observation);
    reset(&mut env, &mut observation);
    criterion.bench_function("env_step", |bencher| {
        bencher.iter(|| {
            let outcome = env.step(&action, &mut observation);
            if outcome.terminated.is_some() || outcome.truncated {
                reset(&mut env, &mut observation);
            }
        });
    });
}

/// Collecting one rollout of the preset's size, and a whole iteration, on one thread.
fn training(criterion: &mut Criterion) {
    let resolved = resolve(&document(&[]).expect("the preset is there")).expect("the preset is valid");
    let workers = Workers::new(Some(1)).expect("the system has a thread");
    let mut trainer = Trainer::new(resolved);
    let mut group = criterion.benchmark_group("training");
    group.sample_size(10);
    group.bench_function("collect", |bencher| bencher.iter(|| trainer.collect(&workers)));
    group.bench_function("iteration", |bencher| bencher.iter(|| trainer.iterate(&workers).expect("no divergence")));
    group.finish();
}
