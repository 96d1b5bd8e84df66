//! The firmware's foot trajectory, the same for all legs.

use canter_gait::FootPosition;
use canter_gait::phase::wrap_cycles;
use canter_gait::prior::SteppingParameters;
use canter_learn::random::{Purpose, stream};
use canter_sim::robot::{GaitSettings, SteppingSettings};

use super::{Cycle, FitError, footfall, rounded};
use crate::search::cma_es::{CmaEs, StrategyParameters};
use crate::search::tuned::standard_normal;

/// Numbers that all legs share: stance height, down amplitude, up amplitude, step length [stance heights of the robot],
/// flight fraction. A phase for each leg [cycles] follows.
const NUM_SHARED: usize = 5;

/// How far the first candidates are from the guess, in these units.
const INITIAL_SIGMA: f64 = 0.05;

/// Generations for each dimension.
const GENERATIONS_PER_DIMENSION: u64 = 60;

/// A search that has come to steps as small as this has ended.
const FINAL_SIGMA: f64 = 1e-7;

/// Flight fractions that a robot.toml may have.
const FLIGHT: std::ops::RangeInclusive<f64> = 0.05..=0.95;

/// The settings of the closest trajectory, and where in its cycle the gait begins [cycles].
///
/// CMA-ES from what the feet's outermost points say: corners of the trajectory have no derivative. The same table gives the
/// same gait.
pub(super) fn fit(cycle: &Cycle<'_>, stride_frequency_hz: f64, unit_m: f64) -> Result<(GaitSettings, f64), FitError> {
    let cost = |point: &[f64]| cost(cycle, unit_m, point);
    let start = within_reach(guess(cycle, unit_m), cost).ok_or(FitError::OutOfReach)?;
    let strategy = StrategyParameters::new(start.len());
    let (mut best, mut search) = ((cost(&start), start.clone()), CmaEs::new(start, INITIAL_SIGMA));
    for generation in 0..GENERATIONS_PER_DIMENSION * best.1.len() as u64 {
        let mut rng = stream(0, Purpose::Search, 0, generation);
        let candidates = search.sample(&strategy, &mut || standard_normal(&mut rng));
        let mut tried: Vec<(f64, Vec<f64>)> = candidates.into_iter().map(|point| (cost(&point), point)).collect();
        tried.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        if tried[0].0 < best.0 {
            best = tried[0].clone();
        }
        let ranked: Vec<Vec<f64>> = tried.into_iter().map(|(_, point)| point).collect();
        search.update(&strategy, &ranked);
        if search.sigma < FINAL_SIGMA {
            break;
        }
    }
    let (_, point) = best;
    let (footfall, phase_offsets_cycles, shift_cycles) = footfall(&point[NUM_SHARED..]);
    let metres = |value: f64| rounded(value * unit_m);
    let settings = SteppingSettings {
        name: "fitted".to_owned(),
        default: false,
        stable: false,
        footfall,
        phase_offsets_cycles,
        stride_frequency_hz,
        stance_height_m: metres(point[0]),
        down_amplitude_m: metres(point[1]),
        up_amplitude_m: metres(point[2]),
        step_length_m: metres(point[3]).max(1e-4),
        flight_fraction: rounded(point[4]),
    };
    Ok((GaitSettings::Stepping(settings), shift_cycles))
}

/// Mean square of the difference over all legs [rad^2]; infinite for what a robot.toml may not have or a leg cannot reach.
fn cost(cycle: &Cycle<'_>, unit_m: f64, point: &[f64]) -> f64 {
    let [height, down, up, length, flight] = [point[0], point[1], point[2], point[3], point[4]];
    if !(height > 0.0 && down >= 0.0 && up >= 0.0 && length > 0.0 && FLIGHT.contains(&flight)) {
        return f64::INFINITY;
    }
    let parameters = SteppingParameters {
        stance_height_m: (height * unit_m) as f32,
        down_amplitude_m: (down * unit_m) as f32,
        up_amplitude_m: (up * unit_m) as f32,
        flight_fraction: flight as f32,
        step_length_m: (length * unit_m) as f32,
    };
    let of_leg = |(index, phase_offset): (usize, &f64)| {
        let geometry = cycle.legs[index].geometry;
        let motion =
            |phase: f32| geometry.inverse(parameters.foot(wrap_cycles(phase + phase_offset.rem_euclid(1.0) as f32)));
        cycle.mean_square(index, motion)
    };
    point[NUM_SHARED..].iter().enumerate().map(of_leg).sum::<f64>() / cycle.legs.len() as f64
}

/// What the outermost points of the feet say: a step goes from the hindmost point to the foremost one through the air.
fn guess(cycle: &Cycle<'_>, unit_m: f64) -> Vec<f64> {
    let (mut shared, mut phases) = ([0.0; NUM_SHARED], Vec::new());
    let num_legs = cycle.legs.len() as f64;
    for (leg, positions) in cycle.legs.iter().zip(&cycle.positions) {
        let feet: Vec<FootPosition> = positions.iter().map(|&position| leg.geometry.forward(position)).collect();
        let extreme = |of: &dyn Fn(&FootPosition) -> f32| {
            let rows = 0..feet.len();
            let row = rows.max_by(|&a, &b| of(&feet[a]).total_cmp(&of(&feet[b])));
            row.expect("a cycle has rows")
        };
        let (front, back) = (extreme(&|foot| foot.forward_m), extreme(&|foot| -foot.forward_m));
        let (low, high) = (extreme(&|foot| foot.down_m), extreme(&|foot| -foot.down_m));
        let height = 0.5 * f64::from(feet[front].down_m + feet[back].down_m);
        let flight = (cycle.phase(front) - cycle.phase(back)).rem_euclid(1.0);
        let own = [
            height / unit_m,
            ((f64::from(feet[low].down_m) - height) / unit_m).max(0.01),
            ((height - f64::from(feet[high].down_m)) / unit_m).max(0.01),
            (f64::from(feet[front].forward_m - feet[back].forward_m) / unit_m).max(0.01),
            flight.clamp(0.1, 0.9),
        ];
        for (sum, value) in shared.iter_mut().zip(own) {
            *sum += value / num_legs;
        }
        phases.push(-cycle.phase(back));
    }
    shared.into_iter().chain(phases).collect()
}

/// The guess, with smaller steps where a leg cannot reach; none if it cannot stand there either.
fn within_reach(mut point: Vec<f64>, cost: impl Fn(&[f64]) -> f64) -> Option<Vec<f64>> {
    const NUM_TRIES: usize = 20;
    const SHRINK: f64 = 0.8;
    for _ in 0..NUM_TRIES {
        if cost(&point).is_finite() {
            return Some(point);
        }
        point[1..4].iter_mut().for_each(|amplitude| *amplitude *= SHRINK);
    }
    None
}
