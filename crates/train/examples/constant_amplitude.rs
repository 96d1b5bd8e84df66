//! The best gait that the paper's law can give without any network: a constant (N0, N1) in eq. 4.
//!
//! The grid is searched on starts of its own; the winner is measured like every other gait. The search takes fewer env
//! steps than the training of the `paper` preset: 81 x 4 x 1000 for the grid, 5 x 20 x 1000 for its best.
//!
//! `cargo run --release -p canter-train --example constant_amplitude`

use std::error::Error;

use canter_train::config::{EvaluationSettings, open_preset, resolve};
use canter_train::evaluate::{GaitReport, Mover, evaluate, judge, speed_ratio};
use canter_train::executor::Workers;

/// Seed of the search's starts; the evaluation's is 0.
const SEARCH_SEED: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let resolved = resolve(&open_preset("paper")?)?;
    let workers = Workers::new(None)?;
    let (task, protocol) = (&resolved.task, &resolved.config.evaluation);
    let search = |num_episodes, action: &[f32; 2]| {
        let settings = EvaluationSettings { num_episodes, seed: SEARCH_SEED, ..protocol.clone() };
        evaluate(task, Mover::Constant(action), &settings, &workers)
    };

    let grid: Vec<f32> = (-4..=4).map(|i| i as f32 / 4.0).collect();
    let actions = grid.iter().flat_map(|&swing| grid.iter().map(move |&extension| [swing, extension]));
    let mut candidates: Vec<_> = actions.map(|action| (rank(&search(4, &action)), action)).collect();
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
    let finalists = candidates.iter().take(5).map(|(_, action)| (rank(&search(20, action)), *action));
    let (_, best) = finalists.max_by(|a, b| a.0.total_cmp(&b.0)).ok_or("no candidates")?;

    let report = evaluate(task, Mover::Constant(&best), protocol, &workers);
    let verdict = judge(task, &resolved.config.policy.prior, None, protocol, &workers);
    let controller = task.controller();
    let parameters = controller.law().leg_parameters(&controller.gait().legs[0], 0, &best);
    println!(
        "best constant action {best:?}: swing amplitude {:.3} rad, extension amplitude {:.3} rad",
        parameters.swing_amplitude, parameters.extension_amplitude
    );
    println!("speed {:.3} m/s, {} falls in {} episodes", report.speed_m_per_s, report.falls, protocol.num_episodes);
    let default = &verdict.default_gaits[&verdict.default_gait];
    for (name, other) in [(&verdict.prior_name, &verdict.prior), (&verdict.default_gait, default)] {
        if let Some((ratio, [low, high])) = speed_ratio(&report, other) {
            println!("{ratio:.2} (95 % interval {low:.2} to {high:.2}) times `{name}`, {:.3} m/s", other.speed_m_per_s);
        }
    }
    Ok(())
}

/// What the search maximises: speed, and no gait that falls.
fn rank(report: &GaitReport) -> f64 {
    if report.falls > 0 { f64::NEG_INFINITY } else { report.speed_m_per_s }
}
