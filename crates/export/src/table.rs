//! The learned gait in open loop: what its targets are, on average, at each place of the cycle.

use std::fmt::Write;

use canter_gait::phase::wrap_cycles;
use canter_gait::prior::TABLE_POINTS;
use canter_sim::Env;
use canter_train::config::EvaluationSettings;
use canter_train::evaluate::{Mover, Watcher, watch_episodes};
use canter_train::executor::Workers;

use crate::exported::Exported;

/// Control steps of an episode that are left out: the gait has to settle first.
const SETTLE_STEPS: u64 = 100;

/// Targets over one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenLoop {
    /// Cycles per second [Hz].
    pub stride_frequency_hz: f32,
    /// One row for each place of the cycle, at equal distances from phase 0; each `(M)` [rad].
    pub rows: Vec<Vec<f32>>,
    /// Standard deviation of each of these [rad].
    pub spread: Vec<Vec<f32>>,
}

impl OpenLoop {
    /// The targets at this phase [cycles]: straight lines between the rows.
    pub fn targets_at(&self, phase: f32) -> impl Iterator<Item = f32> + '_ {
        let place = wrap_cycles(phase) * self.rows.len() as f32;
        let (index, u) = (place as usize % self.rows.len(), place.fract());
        let (from, to) = (&self.rows[index], &self.rows[(index + 1) % self.rows.len()]);
        from.iter().zip(to).map(move |(from, to)| from + u * (to - from))
    }

    /// The rows as CSV, as a robot's `table` gait reads it; with the spread as further columns if it is asked for.
    pub fn to_csv(&self, exported: &Exported<'_>, of_spread: bool) -> String {
        let rows = if of_spread { &self.spread } else { &self.rows };
        let mut text = exported.actuators().join(",") + "\n";
        for row in rows {
            let cells: Vec<String> = row.iter().map(|value| format!("{value:.6}")).collect();
            let _ = writeln!(text, "{}", cells.join(","));
        }
        text
    }
}

/// What stands in a robot.toml for the rows, saved as `gait.csv` beside it.
pub fn toml(open_loop: &OpenLoop) -> String {
    let frequency_hz = open_loop.stride_frequency_hz;
    format!(
        "[[gaits]]\nkind = \"table\"\nname = \"exported\"\ndefault = false\nstable = false\n\
         stride_frequency_hz = {frequency_hz:.4}\ntable = \"gait.csv\"\n"
    )
}

/// Sums over the steps of an episode, by place in the cycle.
#[derive(Clone, Debug, Default)]
struct Cycle {
    steps: u64,
    last_phase: f32,
    cycles: f64,
    counted_steps: u64,
    /// For each place: weight, and for each target the weighted sum and sum of squares.
    places: Vec<(f64, Vec<[f64; 2]>)>,
}

impl Watcher for Cycle {
    fn watch(&mut self, env: &Env) {
        let (targets, phase) = (env.last_command(), env.phase());
        self.places.resize_with(TABLE_POINTS, || (0.0, vec![[0.0; 2]; targets.len()]));
        self.steps += 1;
        if self.steps > SETTLE_STEPS {
            self.cycles += f64::from(wrap_cycles(phase - self.last_phase));
            self.counted_steps += 1;
            // The command was made at the phase before; each step counts for the two places beside it.
            let place = f64::from(self.last_phase) * TABLE_POINTS as f64;
            let (index, u) = (place as usize, place.fract());
            for (index, weight) in [(index, 1.0 - u), (index + 1, u)] {
                let (sum, targets_sums) = &mut self.places[index % TABLE_POINTS];
                *sum += weight;
                for (sums, &target) in targets_sums.iter_mut().zip(targets) {
                    let target = f64::from(target);
                    *sums = [sums[0] + weight * target, sums[1] + weight * target * target];
                }
            }
        }
        self.last_phase = phase;
    }
}

/// Averages the targets of a policy's walk by phase; none if it never walked for long enough to pass every place of the
/// cycle.
pub fn average(exported: &Exported<'_>, settings: &EvaluationSettings, workers: &Workers) -> Option<OpenLoop> {
    let policy = exported.policy();
    let episodes = watch_episodes::<Cycle>(exported.task(), Mover::Policy(&policy), settings, workers);
    let num_motors = exported.controller().num_motors();
    let mut places = vec![(0.0, vec![[0.0; 2]; num_motors]); TABLE_POINTS];
    let (mut cycles, mut steps) = (0.0, 0);
    for (_, episode) in &episodes {
        cycles += episode.cycles;
        steps += episode.counted_steps;
        for ((sum, targets), (weight, own)) in places.iter_mut().zip(&episode.places) {
            *sum += weight;
            for (sums, own) in targets.iter_mut().zip(own) {
                *sums = [sums[0] + own[0], sums[1] + own[1]];
            }
        }
    }
    if places.iter().any(|(weight, _)| *weight == 0.0) {
        return None;
    }
    let row = |value: fn(f64, [f64; 2]) -> f64| -> Vec<Vec<f32>> {
        places
            .iter()
            .map(|(weight, targets)| targets.iter().map(|&sums| value(*weight, sums) as f32).collect())
            .collect()
    };
    let deviation = |weight: f64, [sum, squares]: [f64; 2]| (squares / weight - (sum / weight).powi(2)).max(0.0).sqrt();
    Some(OpenLoop {
        stride_frequency_hz: (cycles / steps as f64 / f64::from(exported.control_dt_s())) as f32,
        rows: row(|weight, [sum, _]| sum / weight),
        spread: row(deviation),
    })
}
