//! Figures with one row a gait: speeds with their intervals, falls by cause, cost of transport.

use std::collections::{BTreeMap, BTreeSet};

use crate::chart::{Axis, Chart, KEY_EM, Panel, quantity, round_ticks, shortened};
use crate::figures::{Figure, Flow, Group, Subject};
use crate::svg::{Anchor, Drawing, text_width_em};

/// Width of a figure that stands alone in its row.
pub const WIDTH: f64 = 440.0;

/// Speed below which a cost of transport says nothing, as a share of the fastest gait's.
const SLOWEST_SHARE: f64 = 0.05;

/// Height of a row.
const ROW: f64 = 30.0;

/// A gait's speed: single values, their summary, its interval.
pub struct SpeedRow<'a> {
    /// The gait.
    pub subject: &'a Subject,
    /// Of each seed or episode, and what it is.
    pub values: Vec<(f64, String)>,
    /// Mean or interquartile mean.
    pub centre: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
}

/// Width for the names of the gaits.
fn name_width(subjects: &[&Subject]) -> f64 {
    let widest = subjects.iter().map(|subject| text_width_em(&subject.label)).fold(0.0, f64::max);
    (widest * KEY_EM + 12.0).clamp(60.0, 0.36 * WIDTH)
}

/// Speeds with their intervals, every value shown.
pub fn speeds(rows: &[SpeedRow<'_>]) -> Panel {
    let subjects: Vec<&Subject> = rows.iter().map(|row| row.subject).collect();
    let (left, right, top) = (name_width(&subjects), WIDTH - 84.0, 12.0);
    let values = rows.iter().flat_map(|row| row.values.iter().map(|value| value.0).chain(row.interval));
    let (low, high) = Axis::from_zero("", values).range;
    let x_at = |value: f64| left + (value - low) / (high - low) * (right - left);
    let bottom = top + rows.len() as f64 * ROW;
    let mut drawing = Drawing::default();
    for (value, text) in round_ticks((low, high), 6.0) {
        let x = x_at(value);
        drawing.line(if value.abs() < 1e-12 { "axis" } else { "grid" }, (x, top), (x, bottom));
        drawing.text("mut", (x, bottom + 14.0), Anchor::Middle, &text);
    }
    drawing.text("mut", (0.5 * (left + right), bottom + 29.0), Anchor::Middle, "speed [m/s]");
    for (i, row) in rows.iter().enumerate() {
        let y = top + (i as f64 + 0.5) * ROW;
        let tone = row.subject.tone;
        let name = shortened(&row.subject.label, (left - 10.0) / KEY_EM);
        drawing.text(&format!("key {}", tone.text()), (left - 10.0, y + 3.8), Anchor::End, &name);
        let [from, to] = row.interval.map(x_at);
        drawing.line(&format!("thick {}", tone.stroke()), (from, y), (to, y));
        for (value, tip) in &row.values {
            drawing.dot(&format!("seed {}", tone.fill()), (x_at(*value), y), 2.6, Some(tip));
        }
        let centre = x_at(row.centre);
        drawing.line(&format!("line {}", tone.stroke()), (centre, y - 8.0), (centre, y + 8.0));
        let [low, high] = row.interval.map(|end| quantity(end, 2));
        drawing.text("key ink", (right + 10.0, y - 1.5), Anchor::Start, &quantity(row.centre, 2));
        drawing.text("mut sml", (right + 10.0, y + 10.0), Anchor::Start, &format!("{low} to {high}"));
    }
    Panel { body: drawing.into_body(), size: (WIDTH, bottom + 34.0), alt: "speed of each gait".to_owned() }
}

/// Summaries as bars from zero, with whiskers.
pub fn bars(rows: &[SpeedRow<'_>], (low, high): (f64, f64)) -> Panel {
    let subjects: Vec<&Subject> = rows.iter().map(|row| row.subject).collect();
    let (left, right, row_height) = (name_width(&subjects), WIDTH - 122.0, 22.0);
    let x_at = |value: f64| left + (value - low) / (high - low) * (right - left);
    let bottom = 4.0 + rows.len() as f64 * row_height;
    let mut drawing = Drawing::default();
    for (value, text) in round_ticks((low, high), 6.0) {
        let x = x_at(value);
        drawing.line(if value.abs() < 1e-12 { "axis" } else { "grid" }, (x, 4.0), (x, bottom));
        drawing.text("mut", (x, bottom + 14.0), Anchor::Middle, &text);
    }
    drawing.text("mut", (WIDTH, bottom + 14.0), Anchor::End, "m/s");
    for (i, row) in rows.iter().enumerate() {
        let y = 4.0 + (i as f64 + 0.5) * row_height;
        let tone = row.subject.tone;
        let name = shortened(&row.subject.label, (left - 10.0) / KEY_EM);
        drawing.text(&format!("key {}", tone.text()), (left - 10.0, y + 3.8), Anchor::End, &name);
        let (from, to) = (x_at(row.centre.min(0.0)), x_at(row.centre.max(0.0)));
        drawing.rectangle(&format!("bar {}", tone.fill()), (from, y - 6.0), (to - from, 12.0), 2.0);
        let [from, to] = row.interval.map(x_at);
        drawing.line("whisk rule-solid", (from, y), (to, y));
        let [low, high] = row.interval.map(|end| quantity(end, 2));
        drawing.text("key ink", (right + 6.0, y + 3.8), Anchor::Start, &quantity(row.centre, 2));
        drawing.text("mut sml", (right + 48.0, y + 3.8), Anchor::Start, &format!("{low} to {high}"));
    }
    Panel { body: drawing.into_body(), size: (WIDTH, bottom + 20.0), alt: "speed of each gait".to_owned() }
}

/// A gait's accidents: how many episodes, and how many ended by each cause.
pub struct FallRow<'a> {
    /// The gait.
    pub subject: &'a Subject,
    /// Episodes in all.
    pub num_episodes: u64,
    /// Episodes that ended by a cause.
    pub by_cause: BTreeMap<String, u64>,
}

/// Accidents by cause, one row a gait.
pub fn falls(rows: &[FallRow<'_>], which: &str) -> Figure {
    let mut causes: BTreeSet<&str> = ["leg_stuck", "rollover", "too_low", "unstable"].into();
    causes.extend(rows.iter().flat_map(|row| row.by_cause.keys().map(String::as_str)));
    let subjects: Vec<&Subject> = rows.iter().map(|row| row.subject).collect();
    let (left, top) = (name_width(&subjects), 22.0);
    let columns = causes.len() + 1;
    // The first one holds more text.
    let first = 1.35 * (WIDTH - left) / (columns as f64 + 0.35);
    let column = (WIDTH - left - first) / (columns - 1) as f64;
    let place = |i: usize| match i {
        0 => (left, first),
        i => (left + first + (i - 1) as f64 * column, column),
    };
    let mut drawing = Drawing::default();
    for (i, cause) in ["any"].into_iter().chain(causes.iter().copied()).enumerate() {
        let (x, column) = place(i);
        let name = shortened(&cause.replace('_', " "), column / 11.5);
        drawing.text("mut", (x + 0.5 * column, 12.0), Anchor::Middle, &name);
    }
    for (row_number, row) in rows.iter().enumerate() {
        let y = top + row_number as f64 * ROW;
        let name = shortened(&row.subject.label, (left - 10.0) / KEY_EM);
        let class = format!("key {}", row.subject.tone.text());
        drawing.text(&class, (left - 10.0, y + 0.5 * ROW + 3.8), Anchor::End, &name);
        let counts = causes.iter().map(|cause| row.by_cause.get(*cause).copied().unwrap_or(0));
        for (i, count) in [row.by_cause.values().sum::<u64>()].into_iter().chain(counts).enumerate() {
            let (x, column) = place(i);
            let share = count as f64 / row.num_episodes.max(1) as f64;
            drawing.rectangle("cell", (x + 1.5, y + 1.5), (column - 3.0, ROW - 3.0), 3.0);
            // The bar's length is the share: no colour has to be read.
            drawing.rectangle("alarm fall", (x + 1.5, y + 1.5), ((column - 3.0) * share.min(1.0), ROW - 3.0), 3.0);
            let text = if i == 0 { format!("{count} of {}", row.num_episodes) } else { count.to_string() };
            let class = if count > 0 { "key ink" } else { "mut" };
            drawing.text(class, (x + 0.5 * column, y + 0.5 * ROW + 3.8), Anchor::Middle, &text);
        }
    }
    let height = top + rows.len() as f64 * ROW + 2.0;
    let panel = Panel { body: drawing.into_body(), size: (WIDTH, height), alt: "falls by cause".to_owned() };
    Figure {
        name: "falls",
        title: "Falls by cause".to_owned(),
        caption: format!(
            "Episodes that ended in an accident, by its cause; the filled part of a cell is their share. {which}"
        ),
        groups: vec![alone(panel)],
    }
}

/// A gait's cost of transport at its speed, for each seed that has one.
pub struct EnergyRow<'a> {
    /// The gait.
    pub subject: &'a Subject,
    /// Speed, cost of transport, and what it is.
    pub points: Vec<([f64; 2], String)>,
}

/// Cost of transport against speed.
pub fn energy(rows: &[EnergyRow<'_>], which: &str) -> Figure {
    let fastest = rows.iter().flat_map(|row| &row.points).map(|(point, _)| point[0]).fold(0.0, f64::max);
    let is_drawn = |point: &[f64; 2]| point[0] >= SLOWEST_SHARE * fastest;
    let points = || rows.iter().flat_map(|row| row.points.iter().map(|point| point.0)).filter(is_drawn);
    let x = Axis::from_zero("speed [m/s]", points().map(|point| point[0]));
    let y = Axis::from_zero("cost of transport", points().map(|point| point[1]));
    let labels: Vec<&str> = rows.iter().map(|row| row.subject.label.as_str()).collect();
    let mut chart = Chart::new("", (WIDTH, 250.0), &x, &y, &labels);
    for row in rows {
        for (point, tip) in row.points.iter().filter(|(point, _)| is_drawn(point)) {
            let at = chart.at(*point);
            chart.drawing().dot(&format!("seed {}", row.subject.tone.fill()), at, 4.2, Some(tip));
        }
        // The name goes to the margin, and a line from there to the gait's fastest point.
        if let Some((point, _)) =
            row.points.iter().filter(|(point, _)| is_drawn(point)).max_by(|a, b| a.0[0].total_cmp(&b.0[0]))
        {
            chart.leader(*point, row.subject.tone, &row.subject.label);
        }
    }
    Figure {
        name: "energy",
        title: "What the speed costs".to_owned(),
        caption: format!(
            "Mechanical power over weight times speed, braking counted as work, against speed; lower is better. {which} \
             What is slower than a twentieth of the fastest is not drawn: its cost has no bound."
        ),
        groups: vec![alone(chart.finish())],
    }
}

/// One panel alone in its row.
pub fn alone(panel: Panel) -> Group {
    Group { heading: None, flow: Flow::Pairs, columns: 1, panels: vec![panel] }
}
