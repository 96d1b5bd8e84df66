//! The report on a sweep.

use std::path::Path;

use crate::chart::{Axis, Chart, quantity};
use crate::error::ReportError;
use crate::figures::rows::{self, SpeedRow, WIDTH};
use crate::figures::{Figure, Group, Subject};
use crate::page::{BigNumber, Page, Part, Section, html};
use crate::palette::Tone;
use crate::read::{self, Sweep, SweepPoint};
use crate::tables::{Cell, Table, grouped};
use crate::{Written, falls, write};

/// Height of a chart.
const HEIGHT: f64 = 250.0;

/// Reads, draws, writes.
pub fn report(folder: &Path) -> Result<Written, ReportError> {
    let sweep = read::sweep(folder)?;
    let subjects: Vec<Subject> = sweep.points.iter().enumerate().map(|(i, point)| subject(&sweep, i, point)).collect();
    let figures = vec![dial(&sweep).unwrap_or_else(|| ladder(&sweep, &subjects))];
    let tables = vec![table(&sweep)];
    let name = figures[0].name;
    let what = if sweep.preset.is_empty() { "presets" } else { &sweep.preset };
    let (verdict, numbers) = verdict(&sweep, &subjects);
    let page = html(&Page {
        title: format!("{what}: a sweep over {}", sweep.keys.join(", ")),
        subject: format!(
            "{} points \u{00b7} {} training seeds each \u{00b7} canter {}",
            sweep.points.len(),
            sweep.seeds.len(),
            sweep.canter
        ),
        verdict,
        numbers,
        notes: Vec::new(),
        sections: vec![Section {
            id: "gaits",
            title: "The points",
            parts: vec![Part::Figure(name), Part::Table("points")],
        }],
        figures: &figures,
        tables: &tables,
        recorded: &[],
        protocol: protocol_text(&sweep),
    });
    write::report(folder, &page, &figures, &tables)?;
    Ok(Written {
        page: folder.join("report.html"),
        num_figures: figures.len(),
        num_tables: tables.len(),
        left_out: Vec::new(),
    })
}

/// A point as a person calls it: its values; with more than one key each with its key's last word.
fn label(sweep: &Sweep, point: &SweepPoint) -> String {
    if let [value] = point.values.as_slice() {
        return value.clone();
    }
    let short = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
    let named = sweep.keys.iter().zip(&point.values).map(|(key, value)| format!("{} {value}", short(key)));
    named.collect::<Vec<_>>().join(", ")
}

fn subject(sweep: &Sweep, number: usize, point: &SweepPoint) -> Subject {
    let label = label(sweep, point);
    Subject { key: label.clone(), label, tone: Tone::of_run(number) }
}

/// Speed and falls over the values of the one key, if these are numbers.
fn dial(sweep: &Sweep) -> Option<Figure> {
    let [key] = sweep.keys.as_slice() else { return None };
    let number = |point: &SweepPoint| point.values[0].parse::<f64>().ok().filter(|value| value.is_finite());
    let mut points: Vec<(f64, &SweepPoint)> =
        sweep.points.iter().map(|point| Some((number(point)?, point))).collect::<Option<_>>()?;
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    if points.len() < 2 {
        return None;
    }
    let tone = Tone::of_run(0);
    let x = Axis::over(key, points.iter().map(|point| point.0));
    let all = points.iter().flat_map(|(_, point)| point.runs.iter().map(|run| run.speed_m_per_s).chain(point.speed_ci));
    let mut speeds = Chart::new("", (WIDTH, HEIGHT), &x, &Axis::from_zero("speed [m/s]", all), &["learned", "default"]);
    let edges: Vec<[f64; 3]> =
        points.iter().map(|(value, point)| [*value, point.speed_ci[0], point.speed_ci[1]]).collect();
    speeds.band(tone, &edges);
    speeds.line(&format!("line {}", tone.stroke()), points.iter().map(|(value, point)| [*value, point.speed_iqm]));
    for (value, point) in &points {
        for run in &point.runs {
            let tip = format!(
                "{key} {value}, seed {}: {} m/s, {} falls",
                run.seed,
                quantity(run.speed_m_per_s, 2),
                run.falls
            );
            let at = speeds.at([*value, run.speed_m_per_s]);
            speeds.drawing().dot(&format!("seed {}", tone.fill()), at, 4.2, Some(&tip));
        }
    }
    let (_, last) = points[points.len() - 1];
    speeds.label(last.speed_iqm, tone, "learned");
    speeds.level(last.default_speed_m_per_s, Tone::of_gait("sine", 0), "default");
    let share = |point: &SweepPoint| 100.0 * point.falls[0] as f64 / point.falls[1].max(1) as f64;
    let y = Axis::from_zero("episodes that fall [%]", points.iter().map(|(_, point)| share(point)));
    let mut fallen = Chart::new("", (WIDTH, HEIGHT), &x, &y, &["learned"]);
    fallen.line(&format!("line {}", tone.stroke()), points.iter().map(|(value, point)| [*value, share(point)]));
    for (value, point) in &points {
        let at = fallen.at([*value, share(point)]);
        let tip = format!("{key} {value}: {}", falls(point.falls[0], point.falls[1]));
        fallen.drawing().dot(&format!("seed {}", tone.fill()), at, 4.2, Some(&tip));
    }
    Some(Figure {
        name: "dial",
        title: format!("Speed and falls against {key}"),
        caption: format!(
            "Line: interquartile mean over {} training seeds; band: its 95 % interval; dots: single trainings. {}",
            sweep.seeds.len(),
            which(sweep)
        ),
        groups: vec![Group::pairs(vec![speeds.finish(), fallen.finish()])],
    })
}

/// A row of speeds for each point.
fn ladder(sweep: &Sweep, subjects: &[Subject]) -> Figure {
    let rows: Vec<SpeedRow<'_>> = sweep
        .points
        .iter()
        .zip(subjects)
        .map(|(point, subject)| SpeedRow {
            subject,
            values: point
                .runs
                .iter()
                .map(|run| (run.speed_m_per_s, format!("seed {}: {} m/s", run.seed, quantity(run.speed_m_per_s, 2))))
                .collect(),
            centre: point.speed_iqm,
            interval: point.speed_ci,
        })
        .collect();
    Figure {
        name: "ladder",
        title: "Speed of each point".to_owned(),
        caption: format!(
            "Dots: single trainings; upright line: interquartile mean over {} training seeds; bar: its 95 % interval. {}",
            sweep.seeds.len(),
            which(sweep)
        ),
        groups: vec![rows::alone(rows::speeds(&rows))],
    }
}

fn which(sweep: &Sweep) -> String {
    let episodes = sweep.points[0].runs[0].num_episodes;
    format!("{} episodes of each training from the same starts.", grouped(episodes))
}

fn verdict(sweep: &Sweep, subjects: &[Subject]) -> (String, Vec<BigNumber>) {
    let ratio = |point: &SweepPoint| point.ratio_iqm.unwrap_or(f64::NEG_INFINITY);
    let (best, subject) = sweep
        .points
        .iter()
        .zip(subjects)
        .max_by(|a, b| ratio(a.0).total_cmp(&ratio(b.0)))
        .expect("checked when the sweep was read");
    let num_falls: u64 = sweep.points.iter().map(|point| point.falls[0]).sum();
    let episodes: u64 = sweep.points.iter().map(|point| point.falls[1]).sum();
    let times = best.ratio_iqm.map_or_else(
        || "its default gait does not move forward".to_owned(),
        |ratio| format!("{} times its default gait {}", quantity(ratio, 2), best.default_gait),
    );
    let sentence = format!(
        "The most is won with {}: {} m/s, {times}, with {}.",
        subject.label,
        quantity(best.speed_iqm, 2),
        falls(best.falls[0], best.falls[1])
    );
    let number = |value: String, unit: &str, meaning: String| BigNumber { value, unit: unit.to_owned(), meaning };
    let mut numbers = vec![number(quantity(best.speed_iqm, 2), "m/s", format!("with {}", subject.label))];
    if let Some(ratio) = best.ratio_iqm {
        numbers.push(number(quantity(ratio, 2), "times", format!("as fast as the default gait {}", best.default_gait)));
    }
    let unit = if num_falls == 1 { "fall" } else { "falls" };
    numbers.push(number(num_falls.to_string(), unit, format!("in {} episodes of all points", grouped(episodes))));
    (sentence, numbers)
}

fn table(sweep: &Sweep) -> Table {
    let point = |point: &SweepPoint| {
        let ratio = match (point.ratio_iqm, point.ratio_ci) {
            (Some(iqm), Some(ci)) => Cell::Interval(iqm, ci, 2),
            _ => Cell::Missing,
        };
        vec![
            Cell::Text(label(sweep, point)),
            Cell::Text(point.robot.clone()),
            Cell::Text(point.default_gait.clone()),
            Cell::Number(point.default_speed_m_per_s, 2),
            Cell::Count(point.default_falls),
            Cell::Interval(point.speed_iqm, point.speed_ci, 2),
            ratio,
            Cell::Count(point.falls[0]),
            Cell::Count(point.falls[1]),
        ]
    };
    Table {
        name: "points",
        columns: vec![
            ("point", "point", ""),
            ("robot", "robot", ""),
            ("default_gait", "default gait", ""),
            ("default_speed_m_per_s", "its speed", "m/s"),
            ("default_falls", "its falls", ""),
            ("speed_m_per_s", "learned speed", "m/s"),
            ("speed_ratio", "times the default", ""),
            ("falls", "falls", ""),
            ("num_episodes", "episodes", ""),
        ],
        rows: sweep.points.iter().map(point).collect(),
    }
}

fn protocol_text(sweep: &Sweep) -> String {
    let seeds: Vec<String> = sweep.seeds.iter().map(u64::to_string).collect();
    let overrides =
        if sweep.overrides.is_empty() { String::new() } else { format!(" All have {}.", sweep.overrides.join(", ")) };
    format!(
        "Each point is trained with the seeds {}, and every gait is measured from the same random starts, which no training \
         uses; a robot that falls keeps the full time.{overrides}\nSpeeds and ratios are interquartile means over the \
         trainings; intervals are 95 % bootstraps over the trainings. The falls of a default gait are those of one run's \
         episodes. Each training has left a folder of its own, named after the point and the seed, where the sweep was made.",
        seeds.join(", ")
    )
}
