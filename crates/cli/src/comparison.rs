//! A comparison as a person reads it.

use canter_train::compare::claims::fixed;
use canter_train::compare::protocol::Rung;
use canter_train::compare::results::{Comparison, RungReport};
use canter_train::statistics::mean;

/// The table of the rungs, and the claims.
pub fn describe(comparison: &Comparison) -> String {
    let mut lines = vec![format!(
        "{:<14}{:>24}{:>24}{:>12}{:>12}{:>10}",
        "", "speed m/s [95 %]", "times default [95 %]", "P(> tuned)", "falls", "CoT"
    )];
    let rungs = Rung::ALL.into_iter().filter_map(|rung| Some((rung, comparison.rungs.get(&rung)?)));
    for (rung, report) in rungs {
        let role = if rung == comparison.default_rung { " *" } else { "" };
        lines.push(row(&format!("{}{role}", rung.name()), report));
    }
    lines.push("* the default gait: the faster of the bare ones".to_owned());
    if comparison.quick {
        lines
            .push("A quick comparison: budget, seeds and episodes are too few for its numbers to say much.".to_owned());
    }
    lines.push(String::new());
    for claim in &comparison.claims {
        let mark = match claim.holds {
            Some(true) => "holds",
            Some(false) => "does not hold",
            None => "open",
        };
        lines.push(format!("{mark:<15}{}: {}", claim.claim, claim.ours));
        lines.push(format!("{:<15}{}", "", claim.sentence));
    }
    lines.join("\n")
}

fn row(name: &str, report: &RungReport) -> String {
    let interval =
        |value: f64, [low, high]: [f64; 2]| format!("{} [{}, {}]", fixed(value, 2), fixed(low, 2), fixed(high, 2));
    let ratio = report.ratio_to_default.map_or_else(|| "-".to_owned(), |ratio| interval(ratio.iqm, ratio.ci));
    let faster = report.probability_faster_than_tuned.map_or_else(|| "-".to_owned(), |share| format!("{share:.2}"));
    let falls: u64 = report.seeds.iter().map(|run| run.falls).sum();
    let episodes: usize = report.seeds.iter().map(|run| run.num_episodes).sum();
    // A run that does not move forward has no cost of transport, and then the rung has none.
    let costs: Option<Vec<f64>> = report.seeds.iter().map(|run| run.cost_of_transport).collect();
    let cost = costs.map_or_else(|| "-".to_owned(), |costs| format!("{:.2}", mean(&costs)));
    format!(
        "{name:<14}{:>24}{ratio:>24}{faster:>12}{:>12}{cost:>10}",
        interval(report.speed_iqm, report.speed_ci),
        format!("{falls}/{episodes}")
    )
}
