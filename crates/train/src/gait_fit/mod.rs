//! The sine or stepping gait that is closest to a table of actuator targets.
//!
//! Closest in leg space: targets become swing and extension by the robot's own kinematics, and squares of the differences
//! in rad are summed over all legs and rows. All legs share one shape; each has its own phase.

mod sine;
mod stepping;

use canter_gait::phase::{FOOTFALLS, wrap_cycles};
use canter_gait::{Leg, LegPosition};
use canter_sim::robot::{Footfall, GaitSettings};
use canter_sim::{NamedGait, Robot, settings};

/// Rows that are compared; more say nothing new of a cycle.
const MAX_ROWS: usize = 256;

/// Fewest rows that tell a cycle's first harmonic from its mean.
const MIN_ROWS: usize = 4;

/// How far phases may be from those of a named footfall that is taken for them [cycles].
const FOOTFALL_CYCLES: f64 = 0.01;

/// Stride frequencies that a robot.toml may have [Hz].
const FREQUENCIES_HZ: std::ops::RangeInclusive<f64> = 0.01..=20.0;

/// Which kind of gait is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Sines for swing and extension.
    Sine,
    /// The firmware's foot trajectory.
    Stepping,
}

impl Shape {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Sine, Self::Stepping];
}

/// The gait that was found, and how far it is from the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// As it stands in robot.toml, rounded to four decimals.
    pub settings: GaitSettings,
    /// The same on the robot's legs.
    pub gait: NamedGait,
    /// The table's first row is this far in the gait's cycle [cycles].
    pub shift_cycles: f64,
    /// Root mean square of the difference over all legs, rows and both coordinates of leg space [rad].
    pub rms_rad: f64,
    /// `(L)` the same for each leg [rad].
    pub leg_rms_rad: Vec<f64>,
}

/// Why no gait can be fitted.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FitError {
    /// Too few rows.
    #[error("expected at least {MIN_ROWS} rows over the cycle, found {0}")]
    Rows(usize),
    /// A row of another length.
    #[error("row {row} has {found} targets, the robot has {expected} actuators")]
    Width {
        /// Which, from 1.
        row: usize,
        /// Its targets.
        found: usize,
        /// The robot's actuators.
        expected: usize,
    },
    /// A target that is no number.
    #[error("row {0} has a target that is no number")]
    NotFinite(usize),
    /// A frequency that no gait may have.
    #[error("a stride frequency of {0} Hz is not from 0.01 to 20 Hz")]
    Frequency(f64),
    /// A table in which no leg moves.
    #[error("no leg moves in it: there is no gait to be found")]
    Still,
    /// No foot trajectory in the legs' reach.
    #[error("no stepping gait within reach of the legs is near it: fit a sine gait")]
    OutOfReach,
}

settings! {
    /// Gaits as they stand in a robot.toml.
    pub struct GaitBlock {
        /// Hand-made gaits.
        pub gaits: Vec<GaitSettings>,
    }
}

/// Actuator targets in leg space.
struct Cycle<'a> {
    legs: &'a [Leg],
    /// `(L x n)`, the rows at equal times over one cycle.
    positions: Vec<Vec<LegPosition>>,
}

impl<'a> Cycle<'a> {
    fn new(robot: &'a Robot, targets: &[Vec<f32>]) -> Result<Self, FitError> {
        if targets.len() < MIN_ROWS {
            return Err(FitError::Rows(targets.len()));
        }
        let expected = 2 * robot.legs.len();
        for (index, row) in targets.iter().enumerate() {
            if row.len() != expected {
                return Err(FitError::Width { row: index + 1, found: row.len(), expected });
            }
            if row.iter().any(|target| !target.is_finite()) {
                return Err(FitError::NotFinite(index + 1));
            }
        }
        let num_rows = targets.len().min(MAX_ROWS);
        let of_leg = |(index, leg): (usize, &Leg)| {
            let row = |i: usize| {
                // Between two rows on a straight line, as tables are read.
                let place = i as f64 * targets.len() as f64 / num_rows as f64;
                let (from, u) = (place as usize, place.fract() as f32);
                let (from, to) = (&targets[from], &targets[(from + 1) % targets.len()]);
                let at = |column: usize| from[column] + u * (to[column] - from[column]);
                leg.position_at([at(2 * index), at(2 * index + 1)])
            };
            (0..num_rows).map(row).collect()
        };
        Ok(Self { legs: &robot.legs, positions: robot.legs.iter().enumerate().map(of_leg).collect() })
    }

    fn num_rows(&self) -> usize {
        self.positions[0].len()
    }

    /// The phase of a row [cycles].
    fn phase(&self, row: usize) -> f64 {
        row as f64 / self.num_rows() as f64
    }

    /// Mean square of a leg's difference from a motion, given the phase, over rows and both coordinates [rad^2]; infinite if
    /// there is no such motion.
    fn mean_square(&self, leg: usize, motion: impl Fn(f32) -> Option<LegPosition>) -> f64 {
        let square = |(row, position): (usize, &LegPosition)| {
            let Some(other) = motion(self.phase(row) as f32) else { return f64::INFINITY };
            // What lies beyond the leg's limits is commanded as the limit.
            let other = self.legs[leg].limits.clamp(other);
            f64::from(position.swing - other.swing).powi(2) + f64::from(position.extension - other.extension).powi(2)
        };
        self.positions[leg].iter().enumerate().map(square).sum::<f64>() / (2 * self.num_rows()) as f64
    }

    /// The difference of each leg from a gait that begins `shift_cycles` in its cycle, `(L)` [rad].
    ///
    /// ```text
    /// rms = sqrt(sum over rows of (swing - swing')^2 + (extension - extension')^2, over 2 n)
    /// ```
    ///
    /// Source: our definition.
    fn leg_rms_rad(&self, gait: &NamedGait, shift_cycles: f64) -> Vec<f64> {
        let of_leg = |(index, leg): (usize, &canter_gait::prior::LegGait)| {
            self.mean_square(index, |phase| Some(leg.position(phase + shift_cycles as f32, &leg.defaults))).sqrt()
        };
        gait.legs.iter().enumerate().map(of_leg).collect()
    }
}

/// The gait of one shape that is closest to the `targets`, `(n x M)` [rad], at equal times over one cycle of
/// `stride_frequency_hz`.
///
/// The gait is called `fitted`, and is neither a default nor said to be stable: that is for its owner to say.
///
/// # Errors
/// Targets that are no gait of the robot.
pub fn fit(robot: &Robot, targets: &[Vec<f32>], stride_frequency_hz: f64, shape: Shape) -> Result<Fit, FitError> {
    if !FREQUENCIES_HZ.contains(&stride_frequency_hz) {
        return Err(FitError::Frequency(stride_frequency_hz));
    }
    let cycle = Cycle::new(robot, targets)?;
    let (settings, shift_cycles) = match shape {
        Shape::Sine => sine::fit(&cycle, stride_frequency_hz)?,
        Shape::Stepping => stepping::fit(&cycle, stride_frequency_hz, robot.settings.stance_height_m)?,
    };
    let gait = robot.shaped_gait(&settings).ok_or(FitError::OutOfReach)?;
    let leg_rms_rad = cycle.leg_rms_rad(&gait, shift_cycles);
    let mean_square = leg_rms_rad.iter().map(|rms| rms * rms).sum::<f64>() / leg_rms_rad.len() as f64;
    Ok(Fit { settings, gait, shift_cycles, rms_rad: mean_square.sqrt(), leg_rms_rad })
}

/// The gait of either shape that is closest, as [`fit`] has it.
///
/// # Errors
/// As [`fit`], where neither shape can be fitted.
pub fn closest(robot: &Robot, targets: &[Vec<f32>], stride_frequency_hz: f64) -> Result<Fit, FitError> {
    let sine = fit(robot, targets, stride_frequency_hz, Shape::Sine)?;
    match fit(robot, targets, stride_frequency_hz, Shape::Stepping) {
        Ok(stepping) if stepping.rms_rad < sine.rms_rad => Ok(stepping),
        Ok(_) | Err(_) => Ok(sine),
    }
}

/// Actuator targets of a robot's gait at `num_rows` equal times over one cycle, `(n x M)` [rad].
pub fn targets(robot: &Robot, gait: &NamedGait, num_rows: usize) -> Vec<Vec<f32>> {
    let row = |index: usize| {
        let phase = index as f32 / num_rows as f32;
        let of_leg = |(leg, part): (&Leg, &canter_gait::prior::LegGait)| {
            leg.targets(leg.limits.clamp(part.position(phase, &part.defaults)))
        };
        robot.legs.iter().zip(&gait.legs).flat_map(of_leg).collect()
    };
    (0..num_rows).map(row).collect()
}

/// A footfall for the legs' phases [cycles], its offsets if it has no name, and how far the whole gait is moved in its
/// cycle by the name's offsets [cycles].
fn footfall(phases: &[f64]) -> (Footfall, Option<Vec<f64>>, f64) {
    let mut nearest: Option<(f64, &str, f64)> = None;
    for (name, offsets) in FOOTFALLS.iter().filter(|(_, offsets)| offsets.len() == phases.len()) {
        let apart =
            phases.iter().zip(*offsets).map(|(phase, offset)| (phase - f64::from(*offset)) * std::f64::consts::TAU);
        // The mean of angles is that of their points on the circle.
        let (sine, cosine) = apart.clone().fold((0.0, 0.0), |(sine, cosine), a| (sine + a.sin(), cosine + a.cos()));
        let shift = sine.atan2(cosine);
        let furthest = apart.map(|a| (a - shift).sin().atan2((a - shift).cos()).abs()).fold(0.0, f64::max);
        if nearest.is_none_or(|(least, ..)| furthest < least) {
            nearest = Some((furthest, name, shift));
        }
    }
    let near = nearest.filter(|(furthest, ..)| *furthest < FOOTFALL_CYCLES * std::f64::consts::TAU);
    let named = near.and_then(|(_, name, shift)| {
        let footfall = Footfall::ALL.iter().find(|footfall| footfall.name() == name)?;
        Some((*footfall, None, f64::from(wrap_cycles((shift / std::f64::consts::TAU) as f32))))
    });
    let custom = || (Footfall::Custom, Some(phases.iter().map(|&phase| rounded(phase.rem_euclid(1.0))).collect()), 0.0);
    named.unwrap_or_else(custom)
}

/// Four decimals: a tenth of a millimetre or of a milliradian is more than a gait's owner can tell.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
