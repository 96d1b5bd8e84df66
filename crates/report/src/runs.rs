//! The report on one or several trainings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::chart::quantity;
use crate::error::ReportError;
use crate::figures::recorded::Recorded;
use crate::figures::rows::{self, EnergyRow, FallRow, SpeedRow};
use crate::figures::{Figure, Subject};
use crate::page::{BigNumber, Page, Part, Section, html};
use crate::palette::Tone;
use crate::read::{self, GaitReport, Metrics, Run, Trajectory};
use crate::statistics::interquartile_mean;
use crate::tables::{Cell, Table};
use crate::{Written, falls, recorded_figures, write};

/// Name of the learned gait's trajectory.
const LEARNED: &str = "learned";

/// A gait with what was measured of it.
struct Measured<'a> {
    subject: Subject,
    report: &'a GaitReport,
    trajectory: Option<&'a Trajectory>,
    /// What it is, for the table.
    role: String,
}

/// Reads, draws, writes.
pub fn report(run_dirs: &[PathBuf], out: &Path) -> Result<Written, ReportError> {
    let runs: Vec<Run> = run_dirs.iter().map(|path| read::run(path)).collect::<Result<_, _>>()?;
    let Some(first) = runs.first() else { return Err(ReportError::NoRun) };
    for run in &runs[1..] {
        check_alike(first, run)?;
    }
    let measured = measured(&runs)?;
    let learned = &measured[..runs.len()];
    let recorded: Vec<Recorded<'_>> =
        measured.iter().filter_map(|gait| gait.trajectory.map(|trajectory| (&gait.subject, trajectory))).collect();
    let protocol = &first.verdict.protocol;
    let which = format!("{} episodes of each gait from the same starts.", protocol.num_episodes);

    let mut figures = vec![ladder(&measured, &which)];
    let curves: Vec<(&Subject, &[Metrics])> =
        learned.iter().zip(&runs).map(|(gait, run)| (&gait.subject, run.metrics.as_slice())).collect();
    figures.extend(crate::figures::run::learning(&curves));
    figures.extend(recorded_figures(&recorded));
    figures.push(energy(&measured, &which));
    let fall_rows: Vec<FallRow<'_>> = measured
        .iter()
        .map(|gait| FallRow {
            subject: &gait.subject,
            num_episodes: protocol.num_episodes,
            by_cause: gait.report.falls_by_cause.clone(),
        })
        .collect();
    figures.push(rows::falls(&fall_rows, &which));
    let tables = vec![gait_table(&measured), learning_table(&curves)];

    let mut left_out = Vec::new();
    if recorded.is_empty() {
        left_out.push(
            "No episode was recorded (there is no trajectories folder), so film strips, footfall, foot paths, speed per \
             step, torque, leg space and the replay are left out."
                .to_owned(),
        );
    }
    for gait in measured.iter().filter(|gait| gait.trajectory.is_none() && !recorded.is_empty()) {
        left_out.push(format!(
            "No episode of {} was recorded; it is missing in the figures from recordings.",
            gait.subject.label
        ));
    }
    if figures.iter().all(|figure| figure.name != "learning") {
        left_out.push("metrics.jsonl has fewer than two lines, so the learning curves are left out.".to_owned());
    }
    let (verdict, numbers) = verdict(&runs, learned);
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let page = html(&Page {
        title: format!("{}: {}", names.join(", "), protocol.robot),
        subject: format!("{} \u{00b7} {}", protocol.robot, names.join(", ")),
        verdict,
        numbers,
        notes: left_out.clone(),
        sections: sections(),
        figures: &figures,
        tables: &tables,
        recorded: &recorded,
        protocol: protocol_text(first),
    });
    write::report(out, &page, &figures, &tables)?;
    Ok(Written { page: out.join("report.html"), num_figures: figures.len(), num_tables: tables.len(), left_out })
}

fn check_alike(first: &Run, run: &Run) -> Result<(), ReportError> {
    let (a, b) = (&first.verdict.protocol, &run.verdict.protocol);
    let what = if a.robot != b.robot {
        format!("their robots are `{}` and `{}`", a.robot, b.robot)
    } else if a != b {
        "their gaits were measured in different ways (`protocol` in eval.json)".to_owned()
    } else {
        return Ok(());
    };
    Err(ReportError::Different { first: first.path.clone(), second: run.path.clone(), what })
}

/// The learned gait of each run, then every bare gait once.
fn measured(runs: &[Run]) -> Result<Vec<Measured<'_>>, ReportError> {
    let mut measured = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let Some(report) = &run.verdict.policy else {
            return Err(ReportError::Wrong {
                path: run.path.join("eval.json"),
                what: "it has no `policy`".to_owned(),
                advice: "a report is about a trained policy; `canter eval` prints the numbers of a bare gait",
            });
        };
        let label = if runs.len() == 1 { "learned gait".to_owned() } else { run.name.clone() };
        measured.push(Measured {
            subject: Subject { key: run.name.clone(), label, tone: Tone::of_run(i) },
            report,
            trajectory: run.trajectories.get(LEARNED),
            role: format!("learned from {}", run.verdict.prior_name),
        });
    }
    let mut bare: BTreeMap<&str, Measured<'_>> = BTreeMap::new();
    for run in runs {
        let verdict = &run.verdict;
        let defaults = verdict.default_gaits.iter().map(|(name, report)| (name.as_str(), report, true));
        for (name, report, is_default) in defaults.chain([(verdict.prior_name.as_str(), &verdict.prior, false)]) {
            let position = bare.len();
            let is_prior = runs.iter().any(|run| run.verdict.prior_name == name);
            let role = match (is_default, is_prior) {
                (true, true) => "default gait and prior",
                (true, false) => "default gait",
                _ => "prior",
            };
            let entry = bare.entry(name).or_insert_with(|| Measured {
                subject: Subject { key: name.to_owned(), label: name.to_owned(), tone: Tone::of_gait(name, position) },
                report,
                trajectory: None,
                role: role.to_owned(),
            });
            entry.trajectory = entry.trajectory.or_else(|| run.trajectories.get(name));
        }
    }
    let num_bare = bare.len();
    measured.extend(bare.into_values());
    for (run, (format, export)) in runs.iter().flat_map(|run| run.exports.iter().map(move |export| (run, export))) {
        // A runnable export is the learned gait itself.
        if !export.is_open_loop {
            continue;
        }
        let key = format!("{}-{format}", run.name);
        let label = if runs.len() == 1 { format!("exported {format}") } else { format!("{}: {format}", run.name) };
        let safety = if export.passed { "" } else { " (not safe)" };
        measured.push(Measured {
            subject: Subject { key, label, tone: Tone::of_gait(format, num_bare + measured.len()) },
            report: &export.exported,
            trajectory: None,
            role: format!("open-loop export{safety}"),
        });
    }
    Ok(measured)
}

fn verdict(runs: &[Run], learned: &[Measured<'_>]) -> (String, Vec<BigNumber>) {
    let verdict = &runs[0].verdict;
    let num_episodes = verdict.protocol.num_episodes * runs.len() as u64;
    let num_falls: u64 = learned.iter().map(|gait| gait.report.falls).sum();
    let speeds: Vec<f64> = learned.iter().map(|gait| gait.report.speed_m_per_s).collect();
    let speed = interquartile_mean(&speeds);
    let ratios: Vec<f64> = runs.iter().filter_map(|run| run.verdict.speed_ratio).collect();
    let ratio = (ratios.len() == runs.len()).then(|| interquartile_mean(&ratios));
    let default =
        format!("the default gait {} ({} m/s)", verdict.default_gait, quantity(verdict.default_speed_m_per_s, 2));
    let compared = ratio.map_or_else(
        || format!("{default} does not move forward here"),
        |ratio| format!("{} times as fast as {default}", quantity(ratio, 2)),
    );
    let fallen = falls(num_falls, num_episodes);
    let [low, high] = [f64::min, f64::max].map(|pick| speeds.iter().copied().reduce(pick).unwrap_or(speed));
    let (sentence, spread) = if runs.len() == 1 {
        let [low, high] = learned[0].report.speed_ci;
        (
            format!("The learned gait walks {} m/s: {compared}, with {fallen}.", quantity(speed, 2)),
            format!(
                "speed of the learned gait; 95 % interval over the episodes {} to {}",
                quantity(low, 2),
                quantity(high, 2)
            ),
        )
    } else {
        (
            format!(
                "{} trainings walk {} to {} m/s: {compared}, with {fallen}.",
                runs.len(),
                quantity(low, 2),
                quantity(high, 2)
            ),
            format!("interquartile mean over {} trainings", runs.len()),
        )
    };
    let mut numbers = vec![BigNumber { value: quantity(speed, 2), unit: "m/s".to_owned(), meaning: spread }];
    if let Some(ratio) = ratio {
        let interval = match (runs.len(), verdict.speed_ratio_ci) {
            (1, Some([low, high])) => format!("; 95 % interval {} to {}", quantity(low, 2), quantity(high, 2)),
            _ => String::new(),
        };
        let meaning = format!("as fast as the default gait {}{interval}", verdict.default_gait);
        numbers.push(BigNumber { value: quantity(ratio, 2), unit: "times".to_owned(), meaning });
    }
    if let (1, Some(ratio), Some([low, high]), true) = (
        runs.len(),
        verdict.prior_speed_ratio,
        verdict.prior_speed_ratio_ci,
        verdict.prior_name != verdict.default_gait,
    ) {
        let meaning = format!(
            "as fast as its own prior {}; 95 % interval {} to {}",
            verdict.prior_name,
            quantity(low, 2),
            quantity(high, 2)
        );
        numbers.push(BigNumber { value: quantity(ratio, 2), unit: "times".to_owned(), meaning });
    }
    numbers.push(BigNumber {
        value: num_falls.to_string(),
        unit: if num_falls == 1 { "fall" } else { "falls" }.to_owned(),
        meaning: format!("in {num_episodes} episodes of {} s", quantity(verdict.protocol.episode_s, 0)),
    });
    (sentence, numbers)
}

fn ladder(measured: &[Measured<'_>], which: &str) -> Figure {
    let rows: Vec<SpeedRow<'_>> = measured
        .iter()
        .map(|gait| SpeedRow {
            subject: &gait.subject,
            values: gait
                .report
                .speeds_m_per_s
                .iter()
                .enumerate()
                .map(|(i, &speed)| (speed, format!("{}, episode {i}: {} m/s", gait.subject.label, quantity(speed, 3))))
                .collect(),
            centre: gait.report.speed_m_per_s,
            interval: gait.report.speed_ci,
        })
        .collect();
    Figure {
        name: "ladder",
        title: "Speed of each gait".to_owned(),
        caption: format!(
            "Dots: single episodes; upright line: their mean; bar: its 95 % bootstrap interval over the episodes. {which} \
             The interval covers the starts, not what another training seed would give."
        ),
        groups: vec![rows::alone(rows::speeds(&rows))],
    }
}

fn energy(measured: &[Measured<'_>], which: &str) -> Figure {
    let rows: Vec<EnergyRow<'_>> = measured
        .iter()
        .map(|gait| EnergyRow {
            subject: &gait.subject,
            points: gait
                .report
                .cost_of_transport
                .map(|cost| {
                    let tip = format!(
                        "{}: {} at {} m/s",
                        gait.subject.label,
                        quantity(cost, 2),
                        quantity(gait.report.speed_m_per_s, 2)
                    );
                    ([gait.report.speed_m_per_s, cost], tip)
                })
                .into_iter()
                .collect(),
        })
        .collect();
    rows::energy(&rows, &format!("Means over {which}"))
}

fn gait_table(measured: &[Measured<'_>]) -> Table {
    Table {
        name: "gaits",
        columns: vec![
            ("gait", "gait", ""),
            ("role", "role", ""),
            ("speed_m_per_s", "speed", "m/s"),
            ("falls", "falls", ""),
            ("drift_m", "drift", "m"),
            ("heading_deg", "turn", "deg"),
            ("height_std_mm", "bounce", "mm"),
            ("power_w", "power", "W"),
            ("cost_of_transport", "cost of transport", ""),
            ("displacement_speed_m_per_s", "displaced", "m/s"),
            ("episode_return", "return", ""),
        ],
        rows: measured
            .iter()
            .map(|gait| {
                let report = gait.report;
                vec![
                    Cell::Gait(gait.subject.label.clone(), gait.subject.tone),
                    Cell::Text(gait.role.clone()),
                    Cell::Interval(report.speed_m_per_s, report.speed_ci, 3),
                    Cell::Count(report.falls),
                    Cell::Number(report.drift_m, 2),
                    Cell::Number(report.heading_deg, 1),
                    Cell::Number(report.height_std_m * 1e3, 1),
                    Cell::Number(report.power_w, 1),
                    (report.cost_of_transport, 2).into(),
                    Cell::Number(report.displacement_speed_m_per_s, 3),
                    Cell::Number(report.episode_return, 1),
                ]
            })
            .collect(),
    }
}

/// The curves as numbers, for other programs; not on the page.
fn learning_table(curves: &[(&Subject, &[Metrics])]) -> Table {
    Table {
        name: "learning",
        columns: vec![
            ("run", "run", ""),
            ("env_steps", "env steps", ""),
            ("episode_return", "return", ""),
            ("speed_m_per_s", "speed", "m/s"),
            ("power_w", "power", "W"),
            ("accidents", "accidents", ""),
            ("mean_std", "std", ""),
            ("approx_kl", "KL", "nats"),
            ("explained_variance", "explained variance", ""),
        ],
        rows: curves
            .iter()
            .flat_map(|(subject, metrics)| {
                metrics.iter().map(|line| {
                    vec![
                        Cell::Text(subject.key.clone()),
                        Cell::Count(line.env_steps),
                        (line.episode_return, 2).into(),
                        Cell::Number(line.speed_m_per_s, 3),
                        Cell::Number(line.power_w, 1),
                        Cell::Count(line.accidents.values().sum()),
                        Cell::Number(line.mean_std, 3),
                        Cell::Number(line.approx_kl, 4),
                        (line.explained_variance, 3).into(),
                    ]
                })
            })
            .collect(),
    }
}

fn sections() -> Vec<Section> {
    let section = |id, title, parts| Section { id, title, parts };
    vec![
        section("gaits", "The gaits", vec![Part::Table("gaits"), Part::Figure("ladder")]),
        section("learning", "Learning", vec![Part::Figure("learning")]),
        section(
            "walk",
            "How they walk",
            vec![
                Part::Figure("film-strip"),
                Part::Figure("footfall"),
                Part::Figure("foot-paths"),
                Part::Figure("speed-per-step"),
            ],
        ),
        section(
            "limits",
            "Energy, limits, falls",
            vec![Part::Figure("energy"), Part::Figure("torque"), Part::Figure("leg-space"), Part::Figure("falls")],
        ),
    ]
}

fn protocol_text(run: &Run) -> String {
    let protocol = &run.verdict.protocol;
    let friction = protocol
        .friction
        .map_or_else(|| "the model\u{2019}s own friction".to_owned(), |value| format!("friction {value}"));
    let changed: String = protocol.changed.iter().map(|(key, value)| format!(", {key} {value}")).collect();
    format!(
        "{} episodes of {} s for each gait, on a slope of {} degrees with {friction}{changed}, every gait from the same random \
         starts (seed {}), which no training uses. Speed counts forward, from {} s on; a robot that falls keeps the full \
         time. Intervals are 95 % percentile bootstraps over the episodes: they cover the starts of these policies, not \
         what another training seed would give. Power is mechanical, braking included.",
        protocol.num_episodes, protocol.episode_s, protocol.slope_deg, protocol.seed, protocol.settle_s
    )
}
