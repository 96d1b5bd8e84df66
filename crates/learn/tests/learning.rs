//! The whole algorithm on toy environments: it learns, it repeats itself to the byte, it survives divergence.

mod common;

use canter_learn::gaussian::DiagonalGaussian;
use canter_learn::loss::{LossWorkspace, Samples, loss_and_gradient, ratio};
use canter_learn::network::Activations;
use canter_learn::ppo::{DivergedQuantity, LikelyCause};
use canter_learn::{
    ActorCritic, Environment, Executor, Normaliser, Objective, PpoSettings, PpoWorkspace, Serial, StepOutcome,
};
use common::{Threads, Training, point_training, restored};

/// Standing still costs about 0.77 a step from a uniform start in the square, 15 in 20 steps; going straight to the
/// origin at full speed costs about 2.
#[test]
fn ppo_steers_the_point_to_the_origin() {
    for seed in 0..3 {
        let mut training = point_training(seed);
        training.run_iteration(&Serial);
        let first = training.mean_episode_return();
        for _ in 0..60 {
            training.run_iteration(&Serial);
        }
        let last = training.mean_episode_return();
        assert!(first < -10.0 && last > -3.0, "seed {seed}: from {first} to {last}");
    }
}

#[test]
fn the_papers_unclipped_objective_and_one_step_advantage_learn_too() {
    let mut training = point_training(5);
    training.settings =
        PpoSettings { objective: Objective::Unclipped, gae_lambda: 0.0, num_epochs: 2, ..training.settings };
    training.run_iteration(&Serial);
    let first = training.mean_episode_return();
    for _ in 0..80 {
        training.run_iteration(&Serial);
    }
    let last = training.mean_episode_return();
    assert!(first < -10.0 && last > -5.0, "from {first} to {last}");
}

#[test]
fn same_seed_gives_same_bytes_with_any_number_of_threads() {
    let run = |executor: &dyn Executor| {
        let mut training = point_training(1);
        // 512 samples at once are 4 shards: enough to be spread.
        training.settings.minibatch_size = 512;
        training.workspace = PpoWorkspace::new(&training.model, &training.settings, 512);
        let metrics: Vec<_> = (0..5).map(|_| training.run_iteration(executor)).collect();
        (bits(&training.parameters), training.adam, training.moments, metrics)
    };
    let expected = run(&Serial);
    for num_threads in [1, 2, 3, 7] {
        assert!(run(&Threads(num_threads)) == expected, "{num_threads} threads give other bytes");
    }
}

#[test]
fn another_seed_gives_another_policy() {
    let parameters = |seed| {
        let mut training = point_training(seed);
        training.run_iteration(&Serial);
        bits(&training.parameters)
    };
    assert_ne!(parameters(1), parameters(2));
}

#[test]
fn stopping_and_going_on_gives_the_same_bytes_as_not_stopping() {
    let mut uninterrupted = point_training(1);
    let mut stopped = point_training(1);
    for _ in 0..3 {
        uninterrupted.run_iteration(&Serial);
        stopped.run_iteration(&Serial);
    }
    let mut resumed = point_training(1);
    resumed.iteration = stopped.iteration;
    resumed.parameters = stopped.parameters;
    resumed.adam = stopped.adam;
    resumed.moments = stopped.moments;
    resumed.workers = stopped.workers.into_iter().map(|(point, state)| (point, restored(&state))).collect();
    for _ in 0..3 {
        assert!(uninterrupted.run_iteration(&Serial) == resumed.run_iteration(&Serial));
    }
    assert_eq!(bits(&uninterrupted.parameters), bits(&resumed.parameters));
}

#[test]
fn ratio_is_1_before_the_first_gradient_step() {
    let mut training = point_training(2);
    for _ in 0..5 {
        training.run_iteration(&Serial);
    }
    training.collect(&Serial);
    let num_samples = training.rollout.num_samples();
    let parts = training.model.split(&training.parameters);
    let mut activations = Activations::new(training.model.actor, num_samples);
    training.model.batched_actor().forward(parts.actor, &training.rollout.observations, &mut activations);
    let gaussian = DiagonalGaussian::new(parts.log_std);
    let means = activations.output(num_samples).chunks(2);
    for ((action, mean), &old) in training.rollout.actions.chunks(2).zip(means).zip(&training.rollout.log_probs) {
        let ratio = ratio(gaussian.log_prob(action, mean), old);
        assert!((ratio - 1.0).abs() < 1e-5, "ratio {ratio}");
    }
}

#[test]
fn divergence_is_reported_and_leaves_parameters_and_optimiser_untouched() {
    let mut training = point_training(3);
    training.run_iteration(&Serial);
    training.collect(&Serial);
    let (parameters, adam) = (bits(&training.parameters), training.adam.clone());

    // Some of these samples are in the first minibatch of 4, others after gradient steps have been taken.
    let mut minibatches = Vec::new();
    for sample in 0..20 {
        let sound = std::mem::replace(&mut training.rollout.returns[sample], f32::NAN);
        let divergence = training.update(&Serial).unwrap_err();
        assert_eq!((divergence.iteration, divergence.epoch, divergence.quantity), (1, 0, DivergedQuantity::Loss));
        assert!(divergence.to_string().contains("iteration 1, epoch 0"), "{divergence}");
        assert_eq!(divergence.likely_cause, LikelyCause::HugeNumbers);
        assert_eq!((bits(&training.parameters), &training.adam), (parameters.clone(), &adam));
        minibatches.push(divergence.minibatch);
        training.rollout.returns[sample] = sound;
    }
    assert!((0..4).all(|minibatch| minibatches.contains(&minibatch)), "{minibatches:?}");

    // A return of 1e18 has a finite loss, but the square of its gradient overflows.
    let sound = std::mem::replace(&mut training.rollout.returns[0], 1e18);
    training.settings.value_coefficient = 1e10;
    assert_eq!(training.update(&Serial).unwrap_err().quantity, DivergedQuantity::Gradient);
    assert_eq!((bits(&training.parameters), &training.adam), (parameters.clone(), &adam));

    training.rollout.returns[0] = sound;
    training.settings.value_coefficient = 1e300;
    assert_eq!(training.update(&Serial).unwrap_err().likely_cause, LikelyCause::LearningRate);
    training.settings.value_coefficient = 1.0;
    training.update(&Serial).unwrap();
    assert_ne!(bits(&training.parameters), parameters);
}

#[test]
fn a_gradient_step_follows_the_mean_over_all_samples_whatever_the_shards() {
    let mut training = point_training(8);
    training.run_iteration(&Serial);
    training.settings = PpoSettings {
        num_epochs: 1,
        minibatch_size: 512,
        target_kl: None,
        max_gradient_norm: 1e9,
        ..training.settings
    };
    training.workspace = PpoWorkspace::new(&training.model, &training.settings, 512);
    training.collect(&Serial);

    let rollout = &training.rollout;
    let mean = rollout.advantages.iter().sum::<f32>() / 512.0;
    let std = (rollout.advantages.iter().map(|a| (a - mean).powi(2)).sum::<f32>() / 512.0).sqrt();
    let advantages: Vec<f32> = rollout.advantages.iter().map(|a| (a - mean) / std).collect();
    let samples = Samples {
        observations: &rollout.observations,
        actions: &rollout.actions,
        old_log_probs: &rollout.log_probs,
        advantages: &advantages,
        returns: &rollout.returns,
    };
    let mut workspace = LossWorkspace::new(&training.model, 512);
    let sums = loss_and_gradient(&training.model, &training.parameters, &samples, &training.settings, &mut workspace);
    let gradient: Vec<f32> = workspace.d_loss_d_parameters.iter().map(|g| g / 512.0).collect();
    let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
    let first_moment_before = training.adam.first_moment.clone();

    let metrics = training.update(&Serial).unwrap();
    assert!((metrics.gradient_norm / norm - 1.0).abs() < 1e-4, "{} is not {norm}", metrics.gradient_norm);
    assert!((metrics.value_loss / (sums.value_loss / 512.0) - 1.0).abs() < 1e-5);
    let first_moments = first_moment_before.iter().zip(&training.adam.first_moment);
    for ((before, after), expected) in first_moments.zip(&gradient) {
        let actual = (after - 0.9 * before) / 0.1;
        assert!((actual - expected).abs() < 1e-4 * norm as f32 + 1e-6, "{actual} is not {expected}");
    }
}

#[test]
fn an_epoch_visits_every_sample_once_in_an_order_of_its_iteration() {
    let mut training = point_training(9);
    training.collect(&Serial);
    // So small a learning rate leaves the parameters as they are: the metrics are those of the whole rollout.
    training.settings = PpoSettings { num_epochs: 1, target_kl: None, ..training.settings };
    training.adam.learning_rate = 1e-12;
    let metrics = training.update(&Serial).unwrap();
    let errors = training.rollout.values.iter().zip(&training.rollout.returns).map(|(v, r)| f64::from(v - r));
    let value_loss = errors.map(|e| 0.5 * e * e).sum::<f64>() / 512.0;
    assert!((metrics.value_loss / value_loss - 1.0).abs() < 1e-5, "{} is not {value_loss}", metrics.value_loss);
    assert!(metrics.approx_kl.abs() < 1e-6 && metrics.clip_fraction == 0.0, "{metrics:?}");

    let (mut first, mut second) = (point_training(9), point_training(9));
    (first.rollout, second.rollout) = (training.rollout.clone(), training.rollout);
    second.iteration = 1;
    first.update(&Serial).unwrap();
    second.update(&Serial).unwrap();
    assert_ne!(bits(&first.parameters), bits(&second.parameters));
}

#[test]
fn collection_keeps_samples_unclamped_and_counts_every_observation_once() {
    let mut training = point_training(4);
    training.collect(&Serial);
    assert!(training.rollout.actions.iter().any(|a| a.abs() > 1.0));
    assert_eq!(training.moments.count, 512);
    // Without statistics the first observations reach the rollout as they are, up to the limit of 10.
    let mean: f64 = training.rollout.observations.chunks(3).map(|row| f64::from(row[0])).sum::<f64>() / 512.0;
    assert!((training.moments.mean[0] - mean).abs() < 0.5, "{} is not {mean}", training.moments.mean[0]);
    assert_eq!(training.moments.mean[2], 1.0);
    // 8 environments of 64 steps: 3 episodes of 20 each.
    assert!(training.workers.iter().all(|(_, state)| state.finished_episodes.len() == 3));
}

#[test]
fn the_learning_rate_follows_the_target_but_not_at_the_first_gradient_step() {
    let learning_rate = |num_epochs, target_kl| {
        let mut training = point_training(6);
        training.settings = PpoSettings { num_epochs, minibatch_size: 512, target_kl, ..training.settings };
        training.workspace = PpoWorkspace::new(&training.model, &training.settings, 512);
        training.run_iteration(&Serial).learning_rate
    };
    assert_eq!(learning_rate(1, Some(1e9)), 1e-3);
    assert_eq!(learning_rate(3, Some(1e9)), 1e-3 * 1.5 * 1.5);
    assert_eq!(learning_rate(3, Some(1e-9)), 1e-3 / 1.5 / 1.5);
    assert_eq!(learning_rate(3, None), 1e-3);
}

#[test]
fn normalised_advantages_make_the_step_independent_of_the_rewards_scale() {
    let parameters = |scale: f32, normalise_advantages| {
        let mut training = point_training(7);
        training.settings = PpoSettings { normalise_advantages, value_coefficient: 0.0, ..training.settings };
        training.collect(&Serial);
        training.rollout.advantages.iter_mut().for_each(|a| *a *= scale);
        let metrics = training.update(&Serial).unwrap();
        (training.parameters, metrics.gradient_norm)
    };
    let (expected, _) = parameters(1.0, true);
    let (actual, _) = parameters(1000.0, true);
    assert!(actual.iter().zip(&expected).all(|(a, e)| (a - e).abs() < 1e-4));
    assert!(parameters(1000.0, false).1 > 100.0 * parameters(1.0, false).1);
}

/// Reward 1 for ever, cut every 10 steps by an accident or by a limit.
struct Constant {
    num_steps: u32,
    by_accident: bool,
}

impl Environment for Constant {
    fn num_observations(&self) -> usize {
        1
    }

    fn num_actions(&self) -> usize {
        1
    }

    fn reset(&mut self, observation: &mut [f32]) {
        self.num_steps = 0;
        observation.fill(0.0);
    }

    fn step(&mut self, _: &[f32], observation: &mut [f32]) -> StepOutcome {
        self.num_steps += 1;
        observation.fill(self.num_steps as f32);
        let ended = self.num_steps == 10;
        // An accident at the limit is both.
        StepOutcome { reward: 1.0, terminated: ended && self.by_accident, truncated: ended }
    }
}

/// The critic says 1 / (1 - gamma) = 10 everywhere, the true value if the episode never ends.
fn constant_training(by_accident: bool, gae_lambda: f64) -> Training<Constant> {
    let settings = PpoSettings { gamma: 0.9, gae_lambda, ..PpoSettings::default() };
    let environments = vec![Constant { num_steps: 0, by_accident }];
    let mut training = Training::new(ActorCritic::new(1, 1, 4, 4), settings, 0, environments, 25);
    let critic = training.model.critic_range();
    training.parameters[critic.clone()].fill(0.0);
    training.parameters[critic.end - 1] = 10.0;
    training.collect(&Serial);
    training
}

#[test]
fn a_limit_bootstraps() {
    for gae_lambda in [0.0, 0.95] {
        let training = constant_training(false, gae_lambda);
        assert_eq!(training.rollout.truncated.iter().filter(|&&cut| cut).count(), 2);
        assert!(training.rollout.next_values.iter().all(|&value| value == 10.0));
        assert!(training.rollout.advantages.iter().all(|a| a.abs() < 1e-5), "{:?}", training.rollout.advantages);
        let lengths: Vec<u64> = training.workers[0].1.finished_episodes.iter().map(|e| e.episode_length).collect();
        assert_eq!((lengths, training.workers[0].1.ongoing.episode_length), (vec![10, 10], 5));
    }
}

#[test]
fn an_accident_does_not_bootstrap() {
    let training = constant_training(true, 0.5);
    assert!(!training.rollout.truncated.contains(&true));
    let advantages = &training.rollout.advantages;
    // At the accident 1 - 10 = -9; k steps before it -9 (0.9 * 0.5)^k; after the last accident 0.
    for (t, &advantage) in advantages.iter().enumerate() {
        let expected = if t < 20 { -9.0 * 0.45_f32.powi(9 - (t % 10) as i32) } else { 0.0 };
        assert!((advantage - expected).abs() < 1e-4, "step {t}: {advantage} is not {expected}");
    }
    assert!(training.workers[0].1.finished_episodes.iter().all(|e| e.terminated && e.episode_return == 10.0));
}

#[test]
fn the_bootstrap_value_is_that_of_the_last_observation_before_the_reset() {
    let mut training = constant_training(false, 0.0);
    // A critic that tells observations apart: V(10) after the limit, V(5) after the last step, never V(0).
    training.parameters = training.model.initial_parameters(5, 0.0);
    training.iteration = 1;
    training.workers[0].0.num_steps = 0;
    training.workers[0].1.ongoing.observation.fill(0.0);
    let normaliser = Normaliser::from_moments(&training.moments);
    training.collect(&Serial);
    let value = |observation: f32| {
        let mut activations = Activations::new(training.model.critic, 1);
        let critic = training.model.split(&training.parameters).critic;
        let mut normalised = [0.0];
        normaliser.apply(&[observation], &mut normalised);
        training.model.batched_critic().forward(critic, &normalised, &mut activations);
        activations.output(1)[0]
    };
    for (t, &next_value) in training.rollout.next_values.iter().enumerate() {
        let expected = value((t % 10 + 1) as f32);
        assert!((next_value - expected).abs() < 1e-6, "step {t}: {next_value} is not {expected}");
    }
    assert!((value(10.0) - value(0.0)).abs() > 0.1, "the critic does not tell the observations apart");
}

fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|x| x.to_bits()).collect()
}
