//! Figures of a comparison: returns over seeds, slopes, sweeps.

use crate::chart::{Axis, Chart, PANEL, Panel, quantity};
use crate::figures::{Figure, Group, Subject, rows};
use crate::read::{Condition, Rung};
use crate::statistics::{interpolate, interquartile_mean, interquartile_mean_interval};

/// Points of a curve over seeds.
const NUM_CURVE_POINTS: usize = 60;

/// Slope of the paper's figure 7 [deg].
const UPHILL_DEG: f64 = 20.0;

/// A rung with its place on the page.
pub type Placed<'a> = (&'a Subject, &'a Rung);

/// Return against env steps; none if no rung learned.
pub fn returns(rungs: &[Placed<'_>], default: &Placed<'_>) -> Option<Figure> {
    let curves: Vec<(&Subject, Vec<[f64; 4]>)> = rungs
        .iter()
        .filter_map(|(subject, rung)| {
            let curves: Vec<&[[f64; 2]]> =
                rung.seeds.iter().map(|seed| seed.return_curve.as_slice()).filter(|curve| curve.len() > 1).collect();
            let first = curves.iter().map(|curve| curve[0][0]).fold(f64::NEG_INFINITY, f64::max);
            let last = curves.iter().map(|curve| curve[curve.len() - 1][0]).fold(f64::INFINITY, f64::min);
            (!curves.is_empty() && first < last).then(|| {
                let points = (0..NUM_CURVE_POINTS).map(|i| {
                    let x = first + (last - first) * i as f64 / (NUM_CURVE_POINTS - 1) as f64;
                    let values: Vec<f64> = curves.iter().map(|curve| interpolate(curve, x)).collect();
                    let [low, high] = interquartile_mean_interval(&values);
                    [x, interquartile_mean(&values), low, high]
                });
                (*subject, points.collect())
            })
        })
        .collect();
    if curves.is_empty() {
        return None;
    }
    let points = || curves.iter().flat_map(|(_, points)| points);
    let level = default.1.return_iqm;
    let x = Axis::from_zero("env steps", points().map(|point| point[0]));
    let y = Axis::from_zero("return of an episode", points().flat_map(|point| [point[2], point[3]]).chain([level]));
    let labels: Vec<&str> =
        curves.iter().map(|(subject, _)| *subject).chain([default.0]).map(|subject| subject.label.as_str()).collect();
    let mut chart = Chart::new("", (rows::WIDTH, 270.0), &x, &y, &labels);
    for (subject, points) in &curves {
        let edges: Vec<[f64; 3]> = points.iter().map(|&[x, _, low, high]| [x, low, high]).collect();
        chart.band(subject.tone, &edges);
    }
    chart.level(level, default.0.tone, &default.0.label);
    for (subject, points) in &curves {
        chart.line(&format!("line {}", subject.tone.dashed()), points.iter().map(|&[x, y, _, _]| [x, y]));
        chart.label(points[NUM_CURVE_POINTS - 1][1], subject.tone, &subject.label);
    }
    let seeds = rungs.iter().map(|(_, rung)| rung.seeds.len()).max().unwrap_or(0);
    Some(Figure {
        name: "return",
        title: "Learning with the prior and without".to_owned(),
        caption: format!(
            "Return of an episode while learning, with exploration, against all env steps taken. Line: interquartile \
             mean over {seeds} training seeds; band: its 95 % bootstrap interval. A gait that is trained on slopes too has \
             their episodes in its mean. Dashed level: return of the default \
             gait in the evaluation. Paper: figure 5."
        ),
        groups: vec![rows::alone(chart.finish())],
    })
}

/// Curves of one value over a sweep.
fn sweep_panel(
    title: &str,
    axis: (&str, f64),
    y_label: &str,
    sweep: &Condition,
    subjects: &[&Subject],
    value: impl Fn(&Subject, usize) -> [f64; 3],
    range: Option<(f64, f64)>,
) -> Panel {
    let drawn: Vec<&&Subject> = subjects.iter().filter(|subject| sweep.rungs.contains_key(&subject.key)).collect();
    let xs: Vec<f64> = sweep.values.iter().map(|value| value * axis.1).collect();
    let all = drawn.iter().flat_map(|subject| (0..xs.len()).flat_map(|i| value(subject, i)));
    let y = match range {
        Some(range) => Axis::exactly(y_label, range),
        None => Axis::from_zero(y_label, all),
    };
    let (first, last) = (xs.first().copied().unwrap_or(0.0), xs.last().copied().unwrap_or(1.0));
    let x = Axis::exactly(axis.0, if first < last { (first, last) } else { (first - 0.5, first + 0.5) });
    let labels: Vec<&str> = drawn.iter().map(|subject| subject.label.as_str()).collect();
    let mut chart = Chart::new(title, PANEL, &x, &y, &labels);
    for subject in &drawn {
        let edges: Vec<[f64; 3]> = xs
            .iter()
            .enumerate()
            .map(|(i, &x)| {
                let [_, low, high] = value(subject, i);
                [x, low, high]
            })
            .collect();
        chart.band(subject.tone, &edges);
    }
    for subject in &drawn {
        let points: Vec<[f64; 2]> = xs.iter().enumerate().map(|(i, &x)| [x, value(subject, i)[0]]).collect();
        chart.line(&format!("line {}", subject.tone.dashed()), points.iter().copied());
        for (i, &point) in points.iter().enumerate() {
            let at = chart.at(point);
            let tip = format!("{}, {} {}: {}", subject.label, sweep.values[i], sweep.unit, quantity(point[1], 2));
            chart.drawing().dot(&subject.tone.fill(), at, 2.2, Some(&tip));
        }
        if let Some(point) = points.last() {
            chart.label(point[1], subject.tone, &subject.label);
        }
    }
    chart.finish()
}

/// What is known of the sweeps: key, name of the figure, title, axis, factor from the file's unit to the axis'.
const SWEEPS: [(&str, &str, &str, &str, f64); 5] = [
    ("slope_deg", "slope", "Speed against slope", "slope, positive uphill [deg]", 1.0),
    ("friction", "friction", "Slippery ground", "sliding friction of feet and ground", 1.0),
    ("mass_factor", "mass", "Another weight", "mass over the model's", 1.0),
    ("delay_s", "delay", "Late commands", "delay of the commands [ms]", 1e3),
    ("push_m_per_s", "push", "Pushes", "sudden change of the body's velocity [m/s]", 1.0),
];

/// Speed and falls over each varied condition.
pub fn sweeps(sweeps: &[(&String, &Condition)], subjects: &[&Subject], num_episodes: &str) -> Vec<Figure> {
    let mut figures: Vec<Figure> = SWEEPS
        .iter()
        .filter_map(|&(key, name, title, axis, factor)| {
            let (_, sweep) = sweeps.iter().find(|(found, _)| *found == key)?;
            Some(sweep_figure(name, title, (axis, factor), sweep, subjects, num_episodes))
        })
        .collect();
    let others = sweeps.iter().filter(|(key, _)| SWEEPS.iter().all(|known| known.0 != *key));
    let groups: Vec<Group> = others
        .flat_map(|(key, sweep)| {
            let axis = format!("{key} [{}]", sweep.unit);
            sweep_figure("other-sweeps", key, (&axis, 1.0), sweep, subjects, num_episodes).groups
        })
        .collect();
    if !groups.is_empty() {
        let (name, title) = ("other-sweeps", "Further conditions".to_owned());
        figures.push(Figure { name, title, caption: sweep_caption(num_episodes), groups });
    }
    figures
}

fn sweep_caption(num_episodes: &str) -> String {
    format!(
        "Left: mean speed; band: its 95 % bootstrap interval. Right: share of the episodes that end in a fall. {num_episodes}"
    )
}

fn sweep_figure(
    name: &'static str,
    title: &str,
    axis: (&str, f64),
    sweep: &Condition,
    subjects: &[&Subject],
    num_episodes: &str,
) -> Figure {
    let curve = |subject: &Subject| &sweep.rungs[&subject.key];
    let speed = |subject: &Subject, i: usize| {
        let [low, high] = curve(subject).speed_ci[i];
        [curve(subject).speed_m_per_s[i], low, high]
    };
    let falls = |subject: &Subject, i: usize| [100.0 * curve(subject).falls_per_episode[i]; 3];
    let groups = vec![Group::pairs(vec![
        sweep_panel("Speed", axis, "m/s", sweep, subjects, speed, None),
        sweep_panel("Falls", axis, "% of the episodes", sweep, subjects, falls, Some((0.0, 100.0))),
    ])];
    Figure { name, title: title.to_owned(), caption: sweep_caption(num_episodes), groups }
}

/// Flat and 20 degrees uphill; none if the sweep lacks one of the two.
pub fn uphill(sweep: &Condition, subjects: &[&Subject], num_episodes: &str) -> Option<Figure> {
    let place = |slope: f64| sweep.values.iter().position(|value| (value - slope).abs() < 1e-9);
    let (flat, steep) = (place(0.0)?, place(UPHILL_DEG)?);
    let drawn: Vec<&&Subject> = subjects.iter().filter(|subject| sweep.rungs.contains_key(&subject.key)).collect();
    let ends = drawn.iter().flat_map(|subject| {
        let curve = &sweep.rungs[&subject.key];
        [flat, steep].into_iter().flat_map(|i| [curve.speed_m_per_s[i], curve.speed_ci[i][0], curve.speed_ci[i][1]])
    });
    let range = Axis::from_zero("", ends).range;
    let side = |i: usize| {
        let rows: Vec<_> = drawn
            .iter()
            .map(|subject| {
                let curve = &sweep.rungs[&subject.key];
                rows::SpeedRow {
                    subject,
                    values: Vec::new(),
                    centre: curve.speed_m_per_s[i],
                    interval: curve.speed_ci[i],
                }
            })
            .collect();
        rows::bars(&rows, range)
    };
    let group = |heading: &str, i: usize| Group { heading: Some((heading.to_owned(), None)), ..rows::alone(side(i)) };
    Some(Figure {
        name: "uphill",
        title: "On the flat and 20 degrees uphill".to_owned(),
        caption: format!(
            "Mean speed; whisker: its 95 % bootstrap interval; below zero the robot slides back. {num_episodes} Paper: figure 7."
        ),
        groups: vec![group("Level ground", flat), group("20 degrees uphill", steep)],
    })
}
