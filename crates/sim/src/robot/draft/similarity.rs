//! The default gait of a robot of any size: Doggo's stepping trot by dynamic similarity.

use crate::robot::settings::{Footfall, GaitSettings, SteppingSettings};

/// Doggo's stance height [m] and the gravity under which its trot is 2 Hz [m/s^2].
const DOGGO_HEIGHT_M: f64 = 0.17;
const DOGGO_GRAVITY: f64 = 9.81;

/// Doggo's stepping trot for legs that are `stance_height_m` long, with another footfall.
///
/// ```text
/// lengths = Doggo's * h / 0.17 m,  f = 2 Hz * sqrt((g / h) / (9.81 m/s^2 / 0.17 m))
/// ```
///
/// Source: dynamic similarity, Alexander and Jayes 1983: at equal Froude numbers legged motion scales so.
pub fn stepping_by_similarity(footfall: Footfall, stance_height_m: f64, gravity: f64) -> SteppingSettings {
    let scale = stance_height_m / DOGGO_HEIGHT_M;
    let length = |metres: f64| (metres * scale * 1e4).round() / 1e4;
    let frequency_hz = 2.0 * (gravity / DOGGO_GRAVITY / scale).sqrt();
    SteppingSettings {
        name: footfall.name().to_owned(),
        default: false,
        stable: false,
        footfall,
        phase_offsets_cycles: None,
        stride_frequency_hz: (frequency_hz * 100.0).round() / 100.0,
        stance_height_m,
        down_amplitude_m: length(0.04),
        up_amplitude_m: length(0.06),
        flight_fraction: 0.35,
        step_length_m: length(0.15),
    }
}

/// The gaits for so many legs, the default one first. With six and eight legs all keep the robot on its feet.
pub(super) fn default_gaits(num_legs: usize, stance_height_m: f64, gravity: f64) -> Vec<GaitSettings> {
    let (footfalls, are_stable): (&[Footfall], bool) = match num_legs {
        4 => (
            &[Footfall::Trot, Footfall::Walk, Footfall::Pace, Footfall::Bound, Footfall::Pronk, Footfall::Gallop],
            false,
        ),
        6 => (&[Footfall::Tripod, Footfall::Ripple, Footfall::Wave], true),
        8 => (&[Footfall::Alternating, Footfall::Wave], true),
        _ => (&[Footfall::Custom], false),
    };
    let gait = |(i, footfall): (usize, &Footfall)| {
        let mut gait = stepping_by_similarity(*footfall, stance_height_m, gravity);
        (gait.default, gait.stable) = (i == 0, i == 0 || are_stable);
        if *footfall == Footfall::Custom {
            // Every other leg, round the robot.
            gait.name = "alternating".to_owned();
            gait.phase_offsets_cycles = Some((0..num_legs).map(|leg| 0.5 * (leg % 2) as f64).collect());
        }
        GaitSettings::Stepping(gait)
    };
    footfalls.iter().enumerate().map(gait).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;

    /// `cargo xtask robots` works the same numbers out by itself: it uses nothing of ours.
    #[test]
    fn our_own_robots_have_the_gait_of_their_size() {
        for name in ["minitaur", "q8bot", "quad12", "hexapod", "octopod"] {
            let robot = Robot::load(name).unwrap();
            let GaitSettings::Stepping(ours) = &robot.settings.gaits[0] else { panic!("{name}") };
            let mut similar = stepping_by_similarity(ours.footfall, robot.settings.stance_height_m, 9.81);
            (similar.default, similar.stable) = (true, true);
            assert_eq!(similar, *ours, "{name}");
        }
    }
}
