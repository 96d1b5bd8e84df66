//! What a gait is, from its footfalls: which feet are on the ground together, for how long, how often.

use serde::{Deserialize, Serialize};

/// A foot that leaves the ground for less than this has slipped or bounced, not swung [s].
///
/// A tenth of the shortest swing that canter's gaits have (4 Hz, a third of the cycle in the air, is 0.08 s), and some.
const MIN_SWING_S: f64 = 0.03;

/// Pairs of legs, counted as everywhere: front left, back left, back right, front right.
const DIAGONAL_PAIRS: [[usize; 2]; 2] = [[0, 2], [1, 3]];
const LATERAL_PAIRS: [[usize; 2]; 2] = [[0, 1], [2, 3]];
const TRANSVERSE_PAIRS: [[usize; 2]; 2] = [[0, 3], [1, 2]];

/// The gait of one episode, or the mean over several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Footfall {
    /// Share of the time that a foot is on the ground, over all feet.
    pub duty_factor: f64,
    /// Touchdowns of a foot per second, over all feet [Hz].
    pub stride_frequency_hz: f64,
    /// Share of the time that diagonal legs are both on the ground or both in the air. High in a trot and in a pronk.
    pub diagonal_synchrony: f64,
    /// The same for legs of one side. High in a pace and in a pronk.
    pub lateral_synchrony: f64,
    /// The same for the front legs and for the hind legs. High in a bound and in a pronk.
    pub transverse_synchrony: f64,
}

/// Share of the time that the two feet of a pair are both on the ground or both in the air, mean over two pairs.
///
/// ```text
/// s = mean over pairs (a, b) and env steps of [contact_a = contact_b]
/// ```
///
/// Source: ours, after Hildebrand 1965, who tells gaits apart by which footfalls come together.
fn synchrony(contacts: &[[bool; 4]], pairs: [[usize; 2]; 2]) -> f64 {
    let agree = |feet: &[bool; 4]| pairs.iter().filter(|[a, b]| feet[*a] == feet[*b]).count();
    let count: usize = contacts.iter().map(agree).sum();
    count as f64 / (pairs.len() * contacts.len()) as f64
}

/// Touchdowns of one foot: it comes to the ground after at least [`MIN_SWING_S`] in the air.
fn touchdowns(contacts: &[[bool; 4]], foot: usize, control_dt_s: f64) -> usize {
    let min_steps = (MIN_SWING_S / control_dt_s).ceil() as usize;
    let (mut count, mut steps_in_air) = (0, 0);
    for feet in contacts {
        if feet[foot] {
            count += usize::from(steps_in_air >= min_steps);
            steps_in_air = 0;
        } else {
            steps_in_air += 1;
        }
    }
    count
}

impl Footfall {
    /// The gait that these contacts, `(T x L)`, show; none of no steps.
    pub fn of(contacts: &[[bool; 4]], control_dt_s: f64) -> Option<Self> {
        if contacts.is_empty() {
            return None;
        }
        let num_legs = 4.0;
        let on_ground: usize = contacts.iter().map(|feet| feet.iter().filter(|&&touches| touches).count()).sum();
        let touchdowns: usize = (0..4).map(|foot| touchdowns(contacts, foot, control_dt_s)).sum();
        let num_steps = contacts.len() as f64;
        Some(Self {
            duty_factor: on_ground as f64 / (num_legs * num_steps),
            stride_frequency_hz: touchdowns as f64 / (num_legs * num_steps * control_dt_s),
            diagonal_synchrony: synchrony(contacts, DIAGONAL_PAIRS),
            lateral_synchrony: synchrony(contacts, LATERAL_PAIRS),
            transverse_synchrony: synchrony(contacts, TRANSVERSE_PAIRS),
        })
    }

    /// The mean over episodes or seeds; none of none.
    pub fn mean(footfalls: &[Self]) -> Option<Self> {
        if footfalls.is_empty() {
            return None;
        }
        let mean = |value: fn(&Self) -> f64| footfalls.iter().map(value).sum::<f64>() / footfalls.len() as f64;
        Some(Self {
            duty_factor: mean(|footfall| footfall.duty_factor),
            stride_frequency_hz: mean(|footfall| footfall.stride_frequency_hz),
            diagonal_synchrony: mean(|footfall| footfall.diagonal_synchrony),
            lateral_synchrony: mean(|footfall| footfall.lateral_synchrony),
            transverse_synchrony: mean(|footfall| footfall.transverse_synchrony),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contacts of a gait of 2 Hz and duty factor 0.6 whose legs have these offsets [cycles], over 2 s at 100 Hz.
    fn gait(offsets: [f64; 4]) -> Vec<[bool; 4]> {
        let feet = |step: u32| offsets.map(|offset| (0.005 + 0.02 * f64::from(step) + offset).fract() < 0.6);
        (0..200).map(feet).collect()
    }

    #[test]
    fn a_trot_a_pace_a_bound_and_a_pronk_are_told_apart() {
        let footfall = |offsets| Footfall::of(&gait(offsets), 0.01).unwrap();
        let trot = footfall([0.0, 0.5, 0.0, 0.5]);
        assert_eq!(trot.diagonal_synchrony, 1.0);
        // Half a cycle apart with duty factor 0.6: both on the ground for 0.2 of the cycle, else one of them.
        assert!((trot.lateral_synchrony - 0.2).abs() < 1e-12 && (trot.transverse_synchrony - 0.2).abs() < 1e-12);
        assert!((trot.duty_factor - 0.6).abs() < 1e-12);
        assert!((trot.stride_frequency_hz - 2.0).abs() < 0.26, "{trot:?}");
        assert_eq!(footfall([0.0, 0.0, 0.5, 0.5]).lateral_synchrony, 1.0);
        assert_eq!(footfall([0.0, 0.5, 0.5, 0.0]).transverse_synchrony, 1.0);
        let pronk = footfall([0.0; 4]);
        assert_eq!([pronk.diagonal_synchrony, pronk.lateral_synchrony, pronk.transverse_synchrony], [1.0; 3]);
        assert_eq!(Footfall::mean(&[trot, pronk]).unwrap().diagonal_synchrony, 1.0);
        assert_eq!(Footfall::of(&[], 0.01), None);
    }

    #[test]
    fn a_bounce_is_no_touchdown() {
        let on = [true; 4];
        let off = [false; 4];
        // 2 steps in the air: a bounce. 3 steps: a swing.
        assert_eq!(touchdowns(&[on, off, off, on, off, off, off, on, on], 0, 0.01), 1);
        // It was in the air from the start: that is a touchdown as well.
        assert_eq!(touchdowns(&[off, off, off, on], 1, 0.01), 1);
    }
}
