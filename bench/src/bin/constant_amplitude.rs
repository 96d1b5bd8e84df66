//! The best gait that the paper's law can give without any network: a constant (N0, N1) in eq. 4.
//!
//! A grid is searched on starts of its own, then refined around its best; the winner is measured like every other gait.
//! A candidate that falls keeps the full time, as everywhere. The search takes as many env steps as the training of the
//! `paper` preset: 81 x 4 x 1000 for the grid, 9 x 20 x 1000 around its best.
//!
//! `cargo run --release -p canter-bench --bin constant_amplitude`

use std::error::Error;

use canter_train::config::{EvaluationSettings, open_preset, resolve};
use canter_train::evaluate::{Mover, evaluate, judge, speed_ratio};
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
    let fastest = |candidates: Vec<[f32; 2]>, num_episodes| {
        let measured = candidates.into_iter().map(|action| (search(num_episodes, &action).speed_m_per_s, action));
        measured.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, action)| action)
    };
    let [swing, extension] = fastest(actions.collect(), 4).ok_or("no candidates")?;
    let steps = [-0.125, 0.0, 0.125];
    let around = steps.iter().flat_map(|a| steps.iter().map(move |b| [swing + a, extension + b]));
    let best = fastest(around.map(|action| action.map(|value| value.clamp(-1.0, 1.0))).collect(), 20).ok_or("none")?;

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
