//! Environments share nothing: one that blows up changes nothing of the others.

mod common;

use canter_learn::rollout::Rollout;
use canter_sim::{Accident, Env};
use canter_train::checkpoint::Checkpoint;
use canter_train::tensors::TensorFile;
use canter_train::trainer::Trainer;

const NUM_ENVIRONMENTS: usize = 64;

/// The one that blows up.
const POISONED: usize = 17;

/// An environment's part of every array of a rollout.
fn column(rollout: &Rollout, environment: usize) -> Vec<Vec<u32>> {
    let of = |values: &[f32]| -> Vec<u32> {
        let width = values.len() / NUM_ENVIRONMENTS;
        values[environment * width..(environment + 1) * width].iter().map(|value| value.to_bits()).collect()
    };
    let flags = |flags: &[bool]| of(&flags.iter().map(|&flag| f32::from(u8::from(flag))).collect::<Vec<_>>());
    let arrays = [
        &rollout.observations,
        &rollout.actions,
        &rollout.log_probs,
        &rollout.rewards,
        &rollout.values,
        &rollout.next_values,
        &rollout.advantages,
        &rollout.returns,
    ];
    let mut column: Vec<Vec<u32>> = arrays.iter().map(|values| of(values)).collect();
    column.extend([flags(&rollout.terminated), flags(&rollout.truncated)]);
    column.push(rollout.bootstrap_observations[environment].iter().map(|value| value.to_bits()).collect());
    column
}

/// The checkpoint with one number of one environment's physics changed.
fn poisoned(checkpoint: &Checkpoint, trainer: &Trainer, place: impl Fn(&Env) -> usize) -> Checkpoint {
    let bytes = checkpoint.to_bytes();
    let file = TensorFile::from_bytes(&bytes).unwrap();
    let shape = file.shape("environments.state").unwrap().to_vec();
    let mut states = file.get::<f64>("environments.state", &shape).unwrap();
    let env = Env::new(trainer.resolved().task.clone());
    // The physics' state stands at the end of a row.
    let physics = shape[1] - env.simulation().state().len();
    states[POISONED * shape[1] + physics + place(&env)] = 1e9;
    let mut changed = file.clone();
    changed.push("environments.state", &shape, &states);
    Checkpoint::from_bytes(&changed.to_bytes()).unwrap()
}

#[test]
fn a_blow_up_in_one_environment_changes_nothing_of_the_others() {
    let num_environments = NUM_ENVIRONMENTS.to_string();
    let changes = [("training.num_environments", &*num_environments), ("task.variation.share", "0.5")];
    let workers = common::workers(2);
    let mut undisturbed = common::trained(&changes, 2);
    let checkpoint = Checkpoint::of(&undisturbed);
    let expected = undisturbed.iterate(&workers).unwrap();
    // Time, positions, velocities, the solver's start, controls, forces on joints, forces on bodies.
    let (nq, nv) = {
        let env = Env::new(undisturbed.resolved().task.clone());
        (env.simulation().qpos().len(), env.simulation().qvel().len())
    };
    let root_velocity = 1 + nq;
    let force_on_a_joint = 1 + nq + 2 * nv + 8 + 6;
    for (what, place) in [("velocity", root_velocity), ("position", 1), ("force", force_on_a_joint)] {
        let mut trainer = Trainer::new(undisturbed.resolved().clone());
        poisoned(&checkpoint, &undisturbed, |_| place).restore(&mut trainer).unwrap();
        let report = trainer.iterate(&workers).unwrap();
        for environment in (0..NUM_ENVIRONMENTS).filter(|&environment| environment != POISONED) {
            let (own, other) = (column(trainer.rollout(), environment), column(undisturbed.rollout(), environment));
            assert!(own == other, "{what}: environment {environment}");
        }
        assert!(column(trainer.rollout(), POISONED) != column(undisturbed.rollout(), POISONED), "{what}");
        let unstable = Accident::Unstable as usize;
        assert_eq!(report.accidents[unstable], expected.accidents[unstable] + 1, "{what}");
        // What the learner sees of it is an accident at the first step, and sense.
        let rollout = trainer.rollout();
        assert!(rollout.terminated[POISONED * rollout.num_steps()], "{what}");
        assert!(rollout.rewards.iter().all(|reward| reward.abs() < 100.0), "{what}");
        // Nothing of it is left in the statistics that the next iteration stands on.
        let (own, other) = (trainer.normaliser(), undisturbed.normaliser());
        for (own, other) in own.mean.iter().zip(&other.mean).chain(own.inverse_std.iter().zip(&other.inverse_std)) {
            assert!((own - other).abs() < 0.05 * other.abs().max(1.0), "{what}: {own} is not about {other}");
        }
    }
}
