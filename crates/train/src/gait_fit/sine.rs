//! Two sines a leg, of the same amplitudes and offsets for all legs.

use std::f64::consts::TAU;

use canter_gait::LegPosition;
use canter_sim::robot::{GaitSettings, SineSettings};

use super::{Cycle, FitError, footfall, rounded};

/// Rounds of the alternation; each shrinks the error by a constant factor, and most tables need few.
const NUM_ROUNDS: usize = 200;

/// Largest amplitude and offset that a robot.toml may have [rad].
const LARGEST_RAD: f64 = 1.5;

/// Less than this is no motion [rad].
const STILL_RAD: f64 = 1e-4;

/// A complex number.
#[derive(Clone, Copy)]
struct Phasor {
    re: f64,
    im: f64,
}

impl Phasor {
    /// This one turned back by an angle [rad].
    fn turned_back(self, angle: f64) -> Self {
        let (sine, cosine) = angle.sin_cos();
        Self { re: self.re * cosine + self.im * sine, im: self.im * cosine - self.re * sine }
    }

    /// This one and another one, each with its weight.
    fn weighted(self, weight: f64, other: Self, other_weight: f64) -> Self {
        Self { re: weight * self.re + other_weight * other.re, im: weight * self.im + other_weight * other.im }
    }

    fn angle(self) -> f64 {
        self.im.atan2(self.re)
    }

    fn length(self) -> f64 {
        self.re.hypot(self.im)
    }
}

/// The phasor whose sine is closest to a coordinate of a leg over the cycle.
///
/// ```text
/// A exp(i phi) = 2 i / n sum over rows of x exp(-i t),  t = 2 pi row / n;  then x is near A sin(t + phi)
/// ```
///
/// Source: the first Fourier coefficient, which is the least-squares fit at equal times.
fn phasor(cycle: &Cycle<'_>, leg: usize, coordinate: fn(&LegPosition) -> f32) -> Phasor {
    let scale = 2.0 / cycle.num_rows() as f64;
    let mut phasor = Phasor { re: 0.0, im: 0.0 };
    for (row, position) in cycle.positions[leg].iter().enumerate() {
        let (sine, cosine) = (TAU * cycle.phase(row)).sin_cos();
        let value = scale * f64::from(coordinate(position));
        phasor.re += value * sine;
        phasor.im += value * cosine;
    }
    phasor
}

/// Phases of the legs [rad], the amplitude of one coordinate, and amplitude and lead of the other as a phasor.
///
/// With a leg's phasors x and y of the two coordinates, the squares that are left are smallest where, in turn,
///
/// ```text
/// phi_leg = arg(A x + conj(B) y),  A = mean of Re(x exp(-i phi)),  B = mean of y exp(-i phi)
/// ```
///
/// Source: alternating least squares; every step is the exact minimum over its own unknowns.
fn alternate(leading: &[Phasor], other: &[Phasor]) -> (Vec<f64>, f64, Phasor) {
    let num_legs = leading.len();
    let mean = |of: &dyn Fn(usize) -> f64| (0..num_legs).map(of).sum::<f64>() / num_legs as f64;
    let mut phases: Vec<f64> = leading.iter().map(|phasor| phasor.angle()).collect();
    let mut round = 0;
    loop {
        let amplitude = mean(&|leg| leading[leg].turned_back(phases[leg]).re);
        let turned = |leg: usize| other[leg].turned_back(phases[leg]);
        let lead = Phasor { re: mean(&|leg| turned(leg).re), im: mean(&|leg| turned(leg).im) };
        if round == NUM_ROUNDS {
            return (phases, amplitude, lead);
        }
        for (leg, phase) in phases.iter_mut().enumerate() {
            let seen = other[leg].turned_back(lead.angle());
            *phase = leading[leg].weighted(amplitude, seen, lead.length()).angle();
        }
        round += 1;
    }
}

/// The settings of the closest sines, and where in its cycle the gait begins [cycles].
pub(super) fn fit(cycle: &Cycle<'_>, stride_frequency_hz: f64) -> Result<(GaitSettings, f64), FitError> {
    let num_legs = cycle.legs.len();
    let swing: Vec<Phasor> = (0..num_legs).map(|leg| phasor(cycle, leg, |position| position.swing)).collect();
    let extension: Vec<Phasor> = (0..num_legs).map(|leg| phasor(cycle, leg, |position| position.extension)).collect();
    let furthest = |phasors: &[Phasor]| phasors.iter().map(|phasor| phasor.length()).fold(0.0, f64::max);
    if furthest(&swing).max(furthest(&extension)) < STILL_RAD {
        return Err(FitError::Still);
    }
    // The coordinate that moves more tells the phases to begin with.
    let (phases, swing_amplitude, extension_amplitude, extension_lead) = if furthest(&swing) >= furthest(&extension) {
        let (phases, amplitude, lead) = alternate(&swing, &extension);
        (phases, amplitude, lead.length(), lead.angle())
    } else {
        let (phases, amplitude, lead) = alternate(&extension, &swing);
        // A leg's phase is that of its swing.
        let of_swing = phases.iter().map(|phase| phase + lead.angle()).collect();
        (of_swing, lead.length(), amplitude, -lead.angle())
    };
    let mean = |coordinate: fn(&LegPosition) -> f32| {
        let all = cycle.positions.iter().flatten().map(|position| f64::from(coordinate(position)));
        all.sum::<f64>() / (num_legs * cycle.num_rows()) as f64
    };
    let offset = |value: f64| Some(rounded(value.clamp(-LARGEST_RAD, LARGEST_RAD))).filter(|&offset| offset != 0.0);
    let cycles: Vec<f64> = phases.iter().map(|phase| phase / TAU).collect();
    let (footfall, phase_offsets_cycles, shift_cycles) = footfall(&cycles);
    let settings = SineSettings {
        name: "fitted".to_owned(),
        default: false,
        stable: false,
        footfall,
        phase_offsets_cycles,
        stride_frequency_hz,
        swing_amplitude_rad: rounded(swing_amplitude.min(LARGEST_RAD)),
        extension_amplitude_rad: rounded(extension_amplitude.min(LARGEST_RAD)),
        extension_phase_cycles: rounded((extension_lead / TAU).rem_euclid(1.0)),
        swing_offset_rad: offset(mean(|position| position.swing)),
        extension_offset_rad: offset(mean(|position| position.extension)),
    };
    Ok((GaitSettings::Sine(settings), shift_cycles))
}
