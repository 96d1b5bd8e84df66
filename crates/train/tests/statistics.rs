//! The statistics agree with numpy, scipy and counted-out bootstraps: `tests/golden/statistics.py`.

use canter_train::statistics::{
    bootstrap_interval, interquartile_mean, mean, nested_bootstrap_interval, population_std,
    probability_of_improvement, quantile,
};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("../../../tests/golden/statistics.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[track_caller]
fn assert_close(value: f64, expected: &Value) {
    let expected = expected.as_f64().unwrap();
    assert!((value - expected).abs() < 1e-12 * expected.abs().max(1.0), "{value} {expected}");
}

#[test]
fn means_spreads_and_quantiles() {
    let golden = golden();
    let summaries = golden["summaries"].as_array().unwrap();
    assert_eq!(summaries.len(), 8);
    for summary in summaries {
        let mut values = numbers(&summary["values"]);
        assert_close(interquartile_mean(&values), &summary["interquartile_mean"]);
        assert_close(population_std(&values), &summary["population_std"]);
        values.sort_by(f64::total_cmp);
        for (q, expected) in [0.0, 0.1, 0.5, 0.83, 1.0].into_iter().zip(summary["quantiles"].as_array().unwrap()) {
            assert_close(quantile(&values, q), expected);
        }
    }
}

#[test]
fn probabilities_of_improvement() {
    let golden = golden();
    let cases = golden["improvements"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let (x, y) = (numbers(&case["x"]), numbers(&case["y"]));
        let probability = probability_of_improvement(&x, &y);
        assert_close(probability, &case["probability"]);
        assert!((probability_of_improvement(&y, &x) + probability - 1.0).abs() < 1e-12);
    }
    assert!(probability_of_improvement(&[], &[1.0]).is_nan());
}

#[track_caller]
fn assert_within([low, high]: [f64; 2], brackets: &Value) {
    let brackets = numbers(brackets);
    let slack = 1e-12;
    assert!(brackets[0] - slack <= low && low <= brackets[1] + slack, "{low} {brackets:?}");
    assert!(brackets[2] - slack <= high && high <= brackets[3] + slack, "{high} {brackets:?}");
}

#[test]
fn drawn_bootstraps_agree_with_counted_out_ones() {
    let golden = golden();
    let cases = golden["bootstraps"].as_array().unwrap();
    assert_eq!(cases.len(), 2);
    for case in cases {
        let groups: Vec<Vec<f64>> = case["groups"].as_array().unwrap().iter().map(numbers).collect();
        let borrowed: Vec<&[f64]> = groups.iter().map(|group| &group[..]).collect();
        let interval = bootstrap_interval(&borrowed, |resampled| {
            let means: Vec<f64> = resampled.iter().map(|group| interquartile_mean(group)).collect();
            means[0] / means.get(1).unwrap_or(&1.0)
        });
        assert_within(interval, &case["brackets"]);
    }
    let runs: Vec<Vec<f64>> = golden["nested"]["runs"].as_array().unwrap().iter().map(numbers).collect();
    let centre = |runs: &[Vec<f64>]| mean(&runs.iter().map(|episodes| mean(episodes)).collect::<Vec<_>>());
    let interval = nested_bootstrap_interval(&[&runs], |groups| centre(&groups[0]));
    assert_within(interval, &golden["nested"]["brackets"]);
    // Episodes of a run are alike: resampling them as if they were independent runs gives too narrow an interval.
    let [low, high] = bootstrap_interval(&[&runs.concat()], |groups| mean(&groups[0]));
    assert!(high - low < 0.9 * (interval[1] - interval[0]), "{low} {high} {interval:?}");
}
