//! Figures of trainings: the curves of `metrics.jsonl`.

use crate::chart::{Axis, Chart, PANEL};
use crate::figures::{Figure, Group, Subject};
use crate::read::Metrics;
use crate::statistics::moving_average;

/// A curve with more lines than this is drawn faintly, with its moving average over it.
const MANY_ITERATIONS: usize = 80;

/// Windows of the moving average that fit a training.
const NUM_WINDOWS: usize = 40;

type Value = fn(&Metrics) -> f64;

/// What the curves show.
const CURVES: [(&str, &str, Value); 6] = [
    ("Return of an episode", "mean return", |line| line.episode_return.unwrap_or(f64::NAN)),
    ("Speed while exploring", "m/s", |line| line.speed_m_per_s),
    ("Accidents", "episodes an iteration", |line| line.accidents.values().sum::<u64>() as f64),
    ("Exploration", "mean std of the action", |line| line.mean_std),
    ("Step of the policy", "approx. KL [nats]", |line| line.approx_kl),
    ("Explained variance", "share of the returns' variance", |line| line.explained_variance.unwrap_or(f64::NAN)),
];

/// Learning curves of one or several runs; none if no run has two iterations.
pub fn learning(runs: &[(&Subject, &[Metrics])]) -> Option<Figure> {
    let runs: Vec<_> = runs.iter().filter(|(_, metrics)| metrics.len() > 1).collect();
    let x_values = || runs.iter().flat_map(|(_, metrics)| metrics.iter().map(|line| line.env_steps as f64));
    let last = x_values().fold(0.0, f64::max);
    if runs.is_empty() {
        return None;
    }
    let x = Axis::exactly("env steps", (0.0, last));
    let panels = CURVES
        .iter()
        .map(|(title, unit, value)| {
            let all = || runs.iter().flat_map(|(_, metrics)| metrics.iter().map(value));
            let y = if *unit == "mean return" { Axis::over(unit, all()) } else { Axis::from_zero(unit, all()) };
            // A value model that has not learned yet may be far below 0, which tells nothing.
            let y = if title.starts_with("Explained") { Axis::exactly(unit, (y.range.0.max(-1.0), 1.0)) } else { y };
            let labels: Vec<&str> =
                if runs.len() > 1 { runs.iter().map(|run| run.0.label.as_str()).collect() } else { Vec::new() };
            let mut chart = Chart::new(title, PANEL, &x, &y, &labels);
            for (subject, metrics) in &runs {
                let points: Vec<[f64; 2]> = metrics
                    .iter()
                    .map(|line| (line.env_steps as f64, value(line)))
                    .map(|(x, value)| [x, if value < y.range.0 { y.range.0 } else { value }])
                    .collect();
                let end = if metrics.len() > MANY_ITERATIONS {
                    chart.line(&format!("faint {}", subject.tone.stroke()), points.iter().copied());
                    let (steps, values): (Vec<f64>, Vec<f64>) =
                        points.iter().filter(|point| point[1].is_finite()).map(|point| (point[0], point[1])).unzip();
                    let smooth = moving_average(&values, metrics.len() / NUM_WINDOWS);
                    chart.line(
                        &format!("line {}", subject.tone.dashed()),
                        steps.into_iter().zip(smooth.iter().copied()).map(|(x, y)| [x, y]),
                    );
                    smooth.last().copied()
                } else {
                    chart.line(&format!("line {}", subject.tone.dashed()), points.iter().copied());
                    points.iter().rev().map(|point| point[1]).find(|value| value.is_finite())
                };
                if runs.len() > 1 {
                    chart.label(end.unwrap_or(f64::NAN), subject.tone, &subject.label);
                }
            }
            chart.finish()
        })
        .collect();
    let smoothed = if runs.iter().any(|(_, metrics)| metrics.len() > MANY_ITERATIONS) {
        format!(" Faint: each iteration; strong: moving average over 1/{NUM_WINDOWS} of the training.")
    } else {
        String::new()
    };
    let which = match runs.len() {
        1 => "one training".to_owned(),
        num => format!("{num} trainings, each drawn on its own"),
    };
    Some(Figure {
        name: "learning",
        title: "How it learned".to_owned(),
        caption: format!(
            "Of {which}, from metrics.jsonl: means over the episodes that ended in an iteration, with exploration, so \
             slower than in the evaluation.{smoothed}"
        ),
        groups: vec![Group::pairs(panels)],
    })
}
