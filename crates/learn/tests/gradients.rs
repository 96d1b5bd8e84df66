//! Every hand-written gradient against central differences, in double precision.

use canter_gait::network::NetworkShape;
use canter_learn::gaussian::DiagonalGaussian;
use canter_learn::loss::{LossSums, LossWorkspace, Samples, loss_and_gradient};
use canter_learn::network::{Activations, BatchedNetwork, OutputActivation};
use canter_learn::policy::ActorCritic;
use canter_learn::random::{Purpose, stream};
use canter_learn::settings::{Objective, PpoSettings};
use rand_distr::{Distribution, StandardNormal};

/// Largest error relative to the larger of the component and a hundredth of the gradient's largest one.
const MAX_RELATIVE_ERROR: f64 = 1e-6;

/// Step of the differences: both their error of fourth order and that of rounding stay below 1e-10.
const STEP: f64 = 1e-4;

const NUM_ROWS: usize = 70;

fn gaussian_numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut rng = stream(seed, Purpose::Exploration, 0, 0);
    (0..count).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// Holds `gradient` to the central differences of `loss` around `parameters`.
fn check(name: &str, parameters: &[f64], gradient: &[f64], mut loss: impl FnMut(&[f64]) -> f64) {
    let largest = gradient.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
    assert!(largest > 1e-3, "{name}: a gradient of {largest} proves nothing");
    let mut moved = parameters.to_vec();
    for (i, &actual) in gradient.iter().enumerate() {
        let mut at = |offset: f64| {
            moved[i] = parameters[i] + offset * STEP;
            let value = loss(&moved);
            moved[i] = parameters[i];
            value
        };
        let expected = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * STEP);
        let error = (actual - expected).abs() / expected.abs().max(0.01 * largest);
        assert!(error < MAX_RELATIVE_ERROR, "{name}: component {i} is {actual}, not {expected}");
    }
}

#[test]
fn network_gradient_for_both_output_activations() {
    let shape = NetworkShape { input: 3, hidden: 7, output: 2 };
    let parameters: Vec<f64> = gaussian_numbers(shape.num_parameters(), 1).iter().map(|x| 0.5 * x).collect();
    let input = gaussian_numbers(NUM_ROWS * shape.input, 2);
    let weights = gaussian_numbers(NUM_ROWS * shape.output, 3);
    let mut activations = Activations::new(shape, NUM_ROWS);
    for output_activation in [OutputActivation::Tanh, OutputActivation::Linear] {
        let network = BatchedNetwork { shape, output_activation };
        // loss = sum of weights * output
        let mut gradient = vec![0.0; parameters.len()];
        network.forward(&parameters, &input, &mut activations);
        activations.output_and_gradient(NUM_ROWS).1.copy_from_slice(&weights);
        network.backward(&parameters, &input, &mut activations, &mut gradient);
        check(&format!("{output_activation:?}"), &parameters, &gradient, |moved| {
            network.forward(moved, &input, &mut activations);
            activations.output(NUM_ROWS).iter().zip(&weights).map(|(y, w)| y * w).sum()
        });
    }
}

#[test]
fn log_prob_gradient_by_mean_and_log_std() {
    let (action, mean, log_std) = (gaussian_numbers(4, 1), gaussian_numbers(4, 2), gaussian_numbers(4, 3));
    let (mut d_mean, mut d_log_std) = (vec![0.0; 4], vec![0.0; 4]);
    let gaussian = DiagonalGaussian::new(&log_std);
    gaussian.d_loss_d_mean_and_log_std((&action, &mean), 1.0, &mut d_mean, &mut d_log_std);
    check("mean", &mean, &d_mean, |moved| gaussian.log_prob(&action, moved));
    check("log_std", &log_std, &d_log_std, |moved| DiagonalGaussian::new(moved).log_prob(&action, &mean));
    check("entropy", &log_std, &[1.0; 4], |moved| DiagonalGaussian::new(moved).entropy());
}

/// A model, parameters of it, and samples whose ratios lie on both sides of the clip.
struct Problem {
    model: ActorCritic,
    parameters: Vec<f64>,
    observations: Vec<f64>,
    actions: Vec<f64>,
    old_log_probs: Vec<f64>,
    advantages: Vec<f64>,
    returns: Vec<f64>,
}

impl Problem {
    fn new() -> Self {
        let model = ActorCritic::new(3, 2, 6, 5);
        let mut parameters: Vec<f64> = gaussian_numbers(model.num_parameters(), 10).iter().map(|x| 0.5 * x).collect();
        parameters[model.log_std_range()].copy_from_slice(&[-0.4, 0.2]);
        let observations = gaussian_numbers(NUM_ROWS * 3, 11);
        let actions = gaussian_numbers(NUM_ROWS * 2, 12);
        let parts = model.split(&parameters);
        let mut activations = Activations::new(model.actor, NUM_ROWS);
        model.batched_actor().forward(parts.actor, &observations, &mut activations);
        let gaussian = DiagonalGaussian::new(parts.log_std);
        let rows = actions.chunks(2).zip(activations.output(NUM_ROWS).chunks(2));
        let log_ratios = gaussian_numbers(NUM_ROWS, 13);
        let old_log_probs = rows.zip(log_ratios).map(|((a, m), r)| gaussian.log_prob(a, m) - 0.3 * r).collect();
        Self {
            model,
            parameters,
            observations,
            actions,
            old_log_probs,
            advantages: gaussian_numbers(NUM_ROWS, 14),
            returns: gaussian_numbers(NUM_ROWS, 15),
        }
    }

    fn loss(&self, parameters: &[f64], settings: &PpoSettings, workspace: &mut LossWorkspace<f64>) -> LossSums {
        let samples = Samples {
            observations: &self.observations,
            actions: &self.actions,
            old_log_probs: &self.old_log_probs,
            advantages: &self.advantages,
            returns: &self.returns,
        };
        loss_and_gradient(&self.model, parameters, &samples, settings, workspace)
    }

    /// Checks the gradient of the complete loss with these settings, and returns the sums of its terms.
    fn check(&self, name: &str, settings: &PpoSettings) -> LossSums {
        let mut workspace = LossWorkspace::new(&self.model, NUM_ROWS);
        let sums = self.loss(&self.parameters, settings, &mut workspace);
        let gradient = workspace.d_loss_d_parameters.clone();
        check(name, &self.parameters, &gradient, |moved| self.loss(moved, settings, &mut workspace).total(settings));
        sums
    }
}

fn settings(objective: Objective, value_coefficient: f64, entropy_coefficient: f64) -> PpoSettings {
    PpoSettings { objective, value_coefficient, entropy_coefficient, ..PpoSettings::default() }
}

#[test]
fn policy_loss_gradient_through_log_prob_and_log_std() {
    let problem = Problem::new();
    for objective in [Objective::Clipped, Objective::Unclipped] {
        let sums = problem.check(&format!("{objective:?}"), &settings(objective, 0.0, 0.0));
        assert!((10..NUM_ROWS - 10).contains(&sums.num_clipped), "{} samples are clipped", sums.num_clipped);
    }
}

#[test]
fn value_loss_gradient() {
    let mut problem = Problem::new();
    problem.advantages.fill(0.0);
    problem.check("value loss", &settings(Objective::Clipped, 0.7, 0.0));
}

#[test]
fn entropy_gradient() {
    let mut problem = Problem::new();
    problem.advantages.fill(0.0);
    problem.check("entropy", &settings(Objective::Clipped, 0.0, 0.3));
}

#[test]
fn complete_loss_gradient() {
    let problem = Problem::new();
    for objective in [Objective::Clipped, Objective::Unclipped] {
        problem.check(&format!("complete, {objective:?}"), &settings(objective, 0.5, 0.02));
    }
}
