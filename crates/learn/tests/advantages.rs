//! Advantages against vectors of an independent script, and against their definitions on random cases.

use canter_learn::advantage::{Steps, generalised_advantage, one_step_advantage};
use canter_learn::random::{Purpose, stream};
use canter_learn::real::Real;
use rand_chacha::rand_core::Rng;
use serde_json::Value;

const NUM_STEPS: usize = 25;
const GAMMA: f64 = 0.97;

/// One environment's random steps; `episode_end` is the chance that a step is its episode's last.
struct Case {
    rewards: Vec<f64>,
    values: Vec<f64>,
    next_values: Vec<f64>,
    terminated: Vec<bool>,
    truncated: Vec<bool>,
}

impl Case {
    fn random(seed: u64, episode_end: f64) -> Self {
        let mut rng = stream(seed, Purpose::Reset, 0, 0);
        let mut uniform = || f64::from(rng.next_u32()) / f64::from(u32::MAX);
        let mut numbers = || (0..NUM_STEPS).map(|_| 4.0 * uniform() - 2.0).collect::<Vec<_>>();
        let (rewards, values, mut next_values) = (numbers(), numbers(), numbers());
        let terminated: Vec<bool> = (0..NUM_STEPS).map(|_| uniform() < episode_end / 2.0).collect();
        let truncated: Vec<bool> =
            terminated.iter().map(|&accident| !accident && uniform() < episode_end / 2.0).collect();
        for t in 0..NUM_STEPS {
            if terminated[t] {
                next_values[t] = 0.0;
            } else if !truncated[t] && t + 1 < NUM_STEPS {
                next_values[t] = values[t + 1];
            }
        }
        Self { rewards, values, next_values, terminated, truncated }
    }

    fn advantages(&self, gae_lambda: f64) -> Vec<f64> {
        let steps = Steps {
            rewards: &self.rewards,
            values: &self.values,
            next_values: &self.next_values,
            terminated: &self.terminated,
            truncated: &self.truncated,
        };
        let mut advantages = vec![0.0; NUM_STEPS];
        generalised_advantage(&steps, GAMMA, gae_lambda, &mut advantages);
        advantages
    }
}

fn cases() -> impl Iterator<Item = Case> {
    (0..200).map(|seed| Case::random(seed, [0.0, 0.1, 0.5, 1.0][seed as usize % 4]))
}

#[test]
fn lambda_0_is_the_papers_one_step_advantage() {
    for case in cases() {
        for (t, advantage) in case.advantages(0.0).into_iter().enumerate() {
            let expected = one_step_advantage(case.rewards[t], GAMMA, case.values[t], case.next_values[t]);
            assert_eq!(advantage, expected);
        }
    }
}

#[test]
fn lambda_1_is_the_discounted_return_minus_the_value() {
    for case in cases() {
        for (t, advantage) in case.advantages(1.0).into_iter().enumerate() {
            let (mut discounted_return, mut discount) = (0.0, 1.0);
            for s in t..NUM_STEPS {
                discounted_return += discount * case.rewards[s];
                discount *= GAMMA;
                if case.terminated[s] || case.truncated[s] || s + 1 == NUM_STEPS {
                    discounted_return += discount * case.next_values[s];
                    break;
                }
            }
            assert!((advantage - (discounted_return - case.values[t])).abs() < 1e-12);
        }
    }
}

#[test]
fn advantages_agree_with_the_golden_vectors() {
    let golden: Value = serde_json::from_str(include_str!("../../../tests/golden/gae.json")).unwrap();
    let cases = golden.as_array().unwrap();
    assert!(cases.len() >= 16);
    for case in cases {
        check_golden::<f64>(case, 1e-12);
        check_golden::<f32>(case, 1e-5);
    }
}

fn check_golden<T: Real>(case: &Value, tolerance: f64) {
    let numbers =
        |key: &str| case[key].as_array().unwrap().iter().map(|v| T::from_f64(v.as_f64().unwrap())).collect::<Vec<T>>();
    let flags = |key: &str| case[key].as_array().unwrap().iter().map(|v| v.as_bool().unwrap()).collect::<Vec<bool>>();
    let (rewards, values, next_values) = (numbers("rewards"), numbers("values"), numbers("next_values"));
    let (terminated, truncated) = (flags("terminated"), flags("truncated"));
    let steps = Steps {
        rewards: &rewards,
        values: &values,
        next_values: &next_values,
        terminated: &terminated,
        truncated: &truncated,
    };
    let number = |key: &str| T::from_f64(case[key].as_f64().unwrap());
    let mut advantages = vec![T::ZERO; rewards.len()];
    generalised_advantage(&steps, number("gamma"), number("gae_lambda"), &mut advantages);
    for (actual, expected) in advantages.iter().zip(numbers("advantages")) {
        assert!((actual.to_f64() - expected.to_f64()).abs() < tolerance, "{actual:?} is not {expected:?}");
    }
}
