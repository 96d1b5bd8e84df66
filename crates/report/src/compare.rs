//! The report on a comparison.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

use crate::chart::quantity;
use crate::error::ReportError;
use crate::figures::comparison::{Placed, returns, sweeps, uphill};
use crate::figures::recorded::Recorded;
use crate::figures::rows::{self, EnergyRow, FallRow, SpeedRow};
use crate::figures::{Figure, Subject};
use crate::page::{BigNumber, Page, Part, Section, html};
use crate::palette::{Tone, rung_order};
use crate::read::{self, Comparison, Condition, Kind, SeedResult, Trajectory};
use crate::statistics::mean;
use crate::tables::{Cell, Table, grouped};
use crate::{Written, falls, recorded_figures, write};

/// The rung that a search found.
const TUNED: &str = "tuned";

/// Reads, draws, writes.
pub fn report(folder: &Path) -> Result<Written, ReportError> {
    let (comparison, trajectories) = read::comparison(folder)?;
    let subjects = subjects(&comparison);
    let rungs: Vec<Placed<'_>> = subjects.iter().map(|subject| (subject, &comparison.rungs[&subject.key])).collect();
    let default = rungs
        .iter()
        .find(|(subject, _)| subject.key == comparison.default_rung)
        .expect("checked when the comparison was read");
    let recorded = with_trajectory(&subjects, &trajectories.level);
    let replayed = [recorded.clone(), with_trajectory(&subjects, &trajectories.uphill)].concat();
    let evaluation = &comparison.protocol.evaluation;
    let num_seeds = comparison.protocol.seeds.len();
    let which = format!(
        "{} episodes of each gait and training seed from the same starts; {num_seeds} training seeds.",
        evaluation.num_episodes
    );

    let mut figures = vec![ladder(&rungs, &which)];
    figures.extend(returns(&rungs, default));
    figures.extend(recorded_figures(&recorded));
    let all: Vec<&Subject> = subjects.iter().collect();
    let conditions: Vec<(&String, &Condition)> = comparison.sweeps.iter().collect();
    if let Some(sweep) = comparison.sweeps.get("slope_deg") {
        figures.extend(uphill(sweep, &all, &which));
    }
    figures.extend(sweeps(&conditions, &all, &which));
    figures.push(energy(&rungs, &which));
    figures.push(fallen(&rungs, &which));
    let mut tables = vec![gait_table(&rungs), seed_table(&rungs)];
    if !comparison.claims.is_empty() {
        tables.push(claim_table(&comparison));
    }
    if !conditions.is_empty() {
        tables.push(sweep_table(&conditions));
    }

    let left_out = left_out(&comparison, &recorded, &figures);
    let mut notes = Vec::new();
    if comparison.quick {
        notes.push(
            "A quick comparison: few seeds and a small budget. It shows that everything works; the figures to quote come \
             from a full one."
                .to_owned(),
        );
    }
    notes.extend(faster_but_falling(&rungs));
    notes.extend(left_out.iter().cloned());
    let (verdict, numbers) = verdict(&rungs, default);
    let page = html(&Page {
        title: format!("{}: gaits compared", comparison.robot),
        subject: format!(
            "{} \u{00b7} {} env steps each \u{00b7} {num_seeds} training seeds \u{00b7} canter {}",
            comparison.robot,
            grouped(comparison.protocol.budget_env_steps),
            comparison.canter
        ),
        verdict,
        numbers,
        notes,
        sections: sections(&comparison),
        figures: &figures,
        tables: &tables,
        recorded: &replayed,
        protocol: protocol_text(&comparison),
    });
    write::report(folder, &page, &figures, &tables)?;
    Ok(Written { page: folder.join("report.html"), num_figures: figures.len(), num_tables: tables.len(), left_out })
}

/// The rungs from the gaits as they were to what was learned.
fn subjects(comparison: &Comparison) -> Vec<Subject> {
    let mut keys: Vec<&String> = comparison.rungs.keys().collect();
    keys.sort_by_key(|key| (comparison.rungs[*key].kind, rung_order(key), (*key).clone()));
    keys.iter()
        .enumerate()
        .map(|(i, key)| Subject {
            key: (*key).clone(),
            label: comparison.rungs[*key].label.clone(),
            tone: Tone::of_gait(key, i),
        })
        .collect()
}

/// The rungs that have a recorded episode, with it.
fn with_trajectory<'a>(subjects: &'a [Subject], trajectories: &'a BTreeMap<String, Trajectory>) -> Vec<Recorded<'a>> {
    let of_subject = |subject: &'a Subject| Some((subject, trajectories.get(&subject.key)?));
    subjects.iter().filter_map(of_subject).collect()
}

fn verdict(rungs: &[Placed<'_>], default: &Placed<'_>) -> (String, Vec<BigNumber>) {
    let (subject, best) = best_learned(rungs).unwrap_or(default);
    let tuned = rungs.iter().find(|(subject, rung)| subject.key == TUNED && rung.speed_iqm > 0.0);
    let episodes: u64 = best.seeds.iter().map(|seed| seed.num_episodes).sum();
    let num_falls: u64 = best.seeds.iter().map(|seed| seed.falls).sum();
    let seeds = best.seeds.len();
    let [low, high] = best.speed_ci.map(|end| quantity(end, 2));
    let mut sentence = format!("{} walks {} m/s", capitalised(&subject.label), quantity(best.speed_iqm, 2));
    let mut numbers = vec![BigNumber {
        value: quantity(best.speed_iqm, 2),
        unit: "m/s".to_owned(),
        meaning: format!("{}; 95 % interval {low} to {high} over {seeds} seeds", subject.label),
    }];
    let is_default = subject.key == default.0.key;
    if let (Some(ratio), false) = (&best.ratio_to_default, is_default) {
        let times = quantity(ratio.iqm, 2);
        sentence += &format!(": {times} times as fast as the default gait ({} m/s)", quantity(default.1.speed_iqm, 2));
        let [low, high] = ratio.ci.map(|end| quantity(end, 2));
        numbers.push(BigNumber {
            value: times,
            unit: "times".to_owned(),
            meaning: format!("as fast as the default gait, {}; 95 % interval {low} to {high}", default.0.label),
        });
    }
    if let Some((tuned_subject, tuned)) = tuned {
        let times = quantity(best.speed_iqm / tuned.speed_iqm, 2);
        sentence += &format!(" and {times} times as fast as the best constant gait that a search found");
        let probability = best
            .probability_faster_than_tuned
            .map_or(String::new(), |share| format!("; faster with probability {}", quantity(share, 2)));
        numbers.push(BigNumber {
            value: times,
            unit: "times".to_owned(),
            meaning: format!("as fast as {}, {} m/s{probability}", tuned_subject.label, quantity(tuned.speed_iqm, 2)),
        });
    }
    sentence += &format!(", with {}.", falls(num_falls, episodes));
    numbers.push(BigNumber {
        value: num_falls.to_string(),
        unit: if num_falls == 1 { "fall" } else { "falls" }.to_owned(),
        meaning: format!("in {} episodes over {seeds} training seeds", grouped(episodes)),
    });
    (sentence, numbers)
}

/// Share of the episodes of a rung that end in a fall.
fn fall_share(rung: &read::Rung) -> f64 {
    let count = |value: fn(&SeedResult) -> u64| rung.seeds.iter().map(value).sum::<u64>() as f64;
    count(|seed| seed.falls) / count(|seed| seed.num_episodes).max(1.0)
}

/// The order in which a verdict prefers gaits: one that falls less often comes first, as in the search for the tuned gait.
fn safer_then_faster(a: &Placed<'_>, b: &Placed<'_>) -> Ordering {
    fall_share(b.1).total_cmp(&fall_share(a.1)).then(a.1.speed_iqm.total_cmp(&b.1.speed_iqm))
}

fn learned<'a, 'b>(rungs: &'a [Placed<'b>]) -> impl Iterator<Item = &'a Placed<'b>> {
    rungs.iter().filter(|(_, rung)| rung.kind == Kind::Learned)
}

/// The learned gait that the verdict is about; none if nothing was learned.
fn best_learned<'a, 'b>(rungs: &'a [Placed<'b>]) -> Option<&'a Placed<'b>> {
    learned(rungs).max_by(|a, b| safer_then_faster(a, b))
}

/// What to know of gaits that are faster than the verdict's: they fall.
fn faster_but_falling(rungs: &[Placed<'_>]) -> Option<String> {
    let (_, best) = best_learned(rungs)?;
    let faster: Vec<String> = learned(rungs)
        .filter(|(_, rung)| rung.speed_iqm > best.speed_iqm)
        .map(|(subject, rung)| {
            let episodes = rung.seeds.iter().map(|seed| seed.num_episodes).sum();
            let num_falls = rung.seeds.iter().map(|seed| seed.falls).sum();
            format!("{}, {} m/s with {}", subject.label, quantity(rung.speed_iqm, 2), falls(num_falls, episodes))
        })
        .collect();
    (!faster.is_empty()).then(|| format!("Faster, but falling more often: {}.", faster.join("; ")))
}

/// The label as it begins a sentence.
fn capitalised(label: &str) -> String {
    let mut characters = label.chars();
    characters.next().map_or_else(String::new, |first| first.to_uppercase().chain(characters).collect())
}

/// "doggo, seed 3", or the gait alone where there is no seed.
fn name(subject: &Subject, seed: &SeedResult) -> String {
    seed.seed.map_or_else(|| subject.label.clone(), |number| format!("{}, seed {number}", subject.label))
}

fn ladder(rungs: &[Placed<'_>], which: &str) -> Figure {
    let rows: Vec<SpeedRow<'_>> = rungs
        .iter()
        .map(|(subject, rung)| SpeedRow {
            subject,
            values: rung
                .seeds
                .iter()
                .map(|seed| {
                    let tip = format!("{}: {} m/s", name(subject, seed), quantity(seed.speed_m_per_s, 3));
                    (seed.speed_m_per_s, tip)
                })
                .collect(),
            centre: rung.speed_iqm,
            interval: rung.speed_ci,
        })
        .collect();
    Figure {
        name: "ladder",
        title: "The ladder: speed at an equal budget".to_owned(),
        caption: format!(
            "Dots: each training seed; upright line: interquartile mean; bar: its 95 % bootstrap interval. Gaits without \
             learning have one dot. {which}"
        ),
        groups: vec![rows::alone(rows::speeds(&rows))],
    }
}

fn energy(rungs: &[Placed<'_>], which: &str) -> Figure {
    let rows: Vec<EnergyRow<'_>> = rungs
        .iter()
        .map(|(subject, rung)| EnergyRow {
            subject,
            points: rung
                .seeds
                .iter()
                .filter_map(|seed| {
                    let cost = seed.cost_of_transport?;
                    let tip = format!(
                        "{}: {} at {} m/s",
                        name(subject, seed),
                        quantity(cost, 2),
                        quantity(seed.speed_m_per_s, 2)
                    );
                    Some(([seed.speed_m_per_s, cost], tip))
                })
                .collect(),
        })
        .collect();
    rows::energy(&rows, &format!("One dot a training seed. {which}"))
}

fn fallen(rungs: &[Placed<'_>], which: &str) -> Figure {
    let rows: Vec<FallRow<'_>> = rungs
        .iter()
        .map(|(subject, rung)| {
            let mut by_cause = BTreeMap::new();
            for (cause, count) in rung.seeds.iter().flat_map(|seed| &seed.falls_by_cause) {
                *by_cause.entry(cause.clone()).or_default() += count;
            }
            let num_episodes = rung.seeds.iter().map(|seed| seed.num_episodes).sum();
            FallRow { subject, num_episodes, by_cause }
        })
        .collect();
    rows::falls(&rows, which)
}

/// Mean over the seeds; none if one has no value.
fn over_seeds(rung: &read::Rung, value: impl Fn(&SeedResult) -> Option<f64>) -> Option<f64> {
    let values: Option<Vec<f64>> = rung.seeds.iter().map(value).collect();
    values.map(|values| mean(&values))
}

fn gait_table(rungs: &[Placed<'_>]) -> Table {
    Table {
        name: "gaits",
        columns: vec![
            ("gait", "gait", ""),
            ("speed_m_per_s", "speed", "m/s"),
            ("ratio_to_default", "times the default", ""),
            ("probability_faster_than_default", "faster than default", "probability"),
            ("probability_faster_than_tuned", "faster than tuned", "probability"),
            ("falls", "falls", ""),
            ("num_episodes", "episodes", ""),
            ("episode_return", "return", ""),
            ("drift_m", "drift", "m"),
            ("heading_deg", "turn", "deg"),
            ("height_std_mm", "bounce", "mm"),
            ("power_w", "power", "W"),
            ("cost_of_transport", "cost of transport", ""),
            ("env_steps", "env steps", "each seed"),
        ],
        rows: rungs
            .iter()
            .map(|(subject, rung)| {
                let ratio = &rung.ratio_to_default;
                let mean = |value: fn(&SeedResult) -> f64| over_seeds(rung, |seed| Some(value(seed)));
                vec![
                    Cell::Gait(subject.label.clone(), subject.tone),
                    Cell::Interval(rung.speed_iqm, rung.speed_ci, 3),
                    ratio.as_ref().map_or(Cell::Missing, |ratio| Cell::Interval(ratio.iqm, ratio.ci, 2)),
                    (rung.probability_faster_than_default, 2).into(),
                    (rung.probability_faster_than_tuned, 2).into(),
                    Cell::Count(rung.seeds.iter().map(|seed| seed.falls).sum()),
                    Cell::Count(rung.seeds.iter().map(|seed| seed.num_episodes).sum()),
                    Cell::Interval(rung.return_iqm, rung.return_ci, 1),
                    (mean(|seed| seed.drift_m), 2).into(),
                    (mean(|seed| seed.heading_deg), 1).into(),
                    (mean(|seed| seed.height_std_m * 1e3), 1).into(),
                    (mean(|seed| seed.power_w), 1).into(),
                    (over_seeds(rung, |seed| seed.cost_of_transport), 2).into(),
                    Cell::Count(rung.seeds.iter().map(|seed| seed.env_steps).max().unwrap_or(0)),
                ]
            })
            .collect(),
    }
}

fn seed_table(rungs: &[Placed<'_>]) -> Table {
    Table {
        name: "seeds",
        columns: vec![
            ("gait", "gait", ""),
            ("seed", "seed", ""),
            ("env_steps", "env steps", ""),
            ("speed_m_per_s", "speed", "m/s"),
            ("speed_min_m_per_s", "slowest episode", "m/s"),
            ("falls", "falls", ""),
            ("num_episodes", "episodes", ""),
            ("episode_return", "return", ""),
            ("drift_m", "drift", "m"),
            ("heading_deg", "turn", "deg"),
            ("height_std_mm", "bounce", "mm"),
            ("speed_per_step_std_mm", "unsteadiness", "mm a step"),
            ("power_w", "power", "W"),
            ("cost_of_transport", "cost of transport", ""),
            ("displacement_speed_m_per_s", "displaced", "m/s"),
        ],
        rows: rungs
            .iter()
            .flat_map(|(subject, rung)| {
                rung.seeds.iter().map(|seed| {
                    vec![
                        Cell::Gait(subject.label.clone(), subject.tone),
                        seed.seed.map_or(Cell::Missing, Cell::Count),
                        Cell::Count(seed.env_steps),
                        Cell::Number(seed.speed_m_per_s, 3),
                        (seed.speeds_m_per_s.iter().copied().reduce(f64::min), 3).into(),
                        Cell::Count(seed.falls),
                        Cell::Count(seed.num_episodes),
                        Cell::Number(seed.episode_return, 1),
                        Cell::Number(seed.drift_m, 2),
                        Cell::Number(seed.heading_deg, 1),
                        Cell::Number(seed.height_std_m * 1e3, 1),
                        Cell::Number(seed.speed_per_step_std_m * 1e3, 2),
                        Cell::Number(seed.power_w, 1),
                        (seed.cost_of_transport, 2).into(),
                        Cell::Number(seed.displacement_speed_m_per_s, 3),
                    ]
                })
            })
            .collect(),
    }
}

fn claim_table(comparison: &Comparison) -> Table {
    Table {
        name: "claims",
        columns: vec![
            ("claim", "claim", ""),
            ("source", "where", ""),
            ("paper", "paper", ""),
            ("ours", "ours", ""),
            ("holds", "verdict", ""),
            ("sentence", "why", ""),
        ],
        rows: comparison
            .claims
            .iter()
            .map(|claim| {
                vec![
                    Cell::Text(claim.claim.clone()),
                    Cell::Text(claim.source.clone()),
                    Cell::Text(claim.paper.clone()),
                    Cell::Text(claim.ours.clone()),
                    Cell::Holds(claim.holds),
                    Cell::Text(claim.sentence.clone()),
                ]
            })
            .collect(),
    }
}

/// The sweeps as numbers, for other programs; not on the page.
fn sweep_table(sweeps: &[(&String, &Condition)]) -> Table {
    let mut rows = Vec::new();
    for (name, sweep) in sweeps {
        for (rung, curve) in &sweep.rungs {
            for (i, &value) in sweep.values.iter().enumerate() {
                rows.push(vec![
                    Cell::Text((*name).clone()),
                    Cell::Text(sweep.unit.clone()),
                    Cell::Number(value, 3),
                    Cell::Text(rung.clone()),
                    Cell::Interval(curve.speed_m_per_s[i], curve.speed_ci[i], 3),
                    Cell::Number(curve.falls_per_episode[i], 3),
                ]);
            }
        }
    }
    Table {
        name: "sweeps",
        columns: vec![
            ("condition", "condition", ""),
            ("unit", "unit", ""),
            ("value", "value", ""),
            ("rung", "gait", ""),
            ("speed_m_per_s", "speed", "m/s"),
            ("falls_per_episode", "falls an episode", ""),
        ],
        rows,
    }
}

fn left_out(comparison: &Comparison, recorded: &[Recorded<'_>], figures: &[Figure]) -> Vec<String> {
    let mut left_out = Vec::new();
    if recorded.is_empty() {
        left_out.push(
            "No episode was recorded, so film strips, footfall, foot paths, speed per step, torque, leg space and the \
             replay are left out."
                .to_owned(),
        );
    } else {
        let missing: Vec<&str> = comparison
            .rungs
            .iter()
            .filter(|(key, _)| !comparison.trajectories.contains_key(*key))
            .map(|(_, rung)| rung.label.as_str())
            .collect();
        if !missing.is_empty() {
            left_out.push(format!(
                "No episode was recorded of {}: missing in the figures from recordings.",
                missing.join(", ")
            ));
        }
    }
    for (name, what) in
        [("return", "No learning curve was kept"), ("uphill", "No gait was measured at 0 and 20 degrees")]
    {
        if figures.iter().all(|figure| figure.name != name) {
            left_out.push(format!("{what}, so that figure is left out."));
        }
    }
    left_out
}

fn sections(comparison: &Comparison) -> Vec<Section> {
    let section = |id, title, parts| Section { id, title, parts };
    let figures = |names: &[&'static str]| names.iter().map(|name| Part::Figure(name)).collect::<Vec<_>>();
    let descriptions = subjects(comparison)
        .into_iter()
        .map(|subject| (subject.label, comparison.rungs[&subject.key].description.clone()))
        .collect();
    vec![
        section("gaits", "The gaits", vec![Part::Table("gaits"), Part::Figure("ladder"), Part::Names(descriptions)]),
        section(
            "claims",
            "The paper\u{2019}s claims",
            vec![
                Part::Text("Each claim with our measurement beside it; what does not hold stands here too.".to_owned()),
                Part::Table("claims"),
            ],
        ),
        section("learning", "Learning", figures(&["return"])),
        section("walk", "How they walk", figures(&["film-strip", "footfall", "foot-paths", "speed-per-step"])),
        section("uphill", "Uphill and downhill", figures(&["uphill", "slope"])),
        section("conditions", "Other conditions", figures(&["friction", "mass", "delay", "push", "other-sweeps"])),
        section("limits", "Energy, limits, falls", figures(&["energy", "torque", "leg-space", "falls"])),
        section("seeds", "Every seed", vec![Part::Table("seeds")]),
    ]
}

fn protocol_text(comparison: &Comparison) -> String {
    let protocol = &comparison.protocol;
    let seeds: Vec<String> = protocol.seeds.iter().map(u64::to_string).collect();
    format!(
        "Budget: {} env steps; what each seed took is in its table. Training seeds: {}. \
         Evaluation: {} episodes of {} s, every gait from the same random starts (seed {}); speed counts forward, from {} s \
         on.\n\n{}",
        grouped(protocol.budget_env_steps),
        seeds.join(", "),
        protocol.evaluation.num_episodes,
        protocol.evaluation.episode_s,
        protocol.evaluation.seed,
        protocol.evaluation.settle_s,
        protocol.text.trim()
    )
}
