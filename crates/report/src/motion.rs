//! What is computed from a recorded episode: strides, duty factors, frames of the side view.

use crate::read::Trajectory;

/// A stride's length where the gait's phase does not move [s].
const STRIDE_WITHOUT_PHASE_S: f64 = 0.5;

/// Room around the outermost hips that the body's box takes [leg lengths].
const BODY_MARGIN: f64 = 0.2;

/// Half the thickness of the body's box [leg lengths].
const BODY_HALF_THICKNESS: f64 = 0.22;

/// Rotates a vector of the ground's frame into the body's, whose roll, pitch and yaw are given [rad].
///
/// ```text
/// v_body = R_x(roll)^T R_y(pitch)^T R_z(yaw)^T v_ground
/// ```
///
/// Source: textbook definition of roll, pitch and yaw about z, y', x''.
pub fn into_body([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = yaw.sin_cos();
    let (x, y) = (cos * x + sin * y, cos * y - sin * x);
    let (sin, cos) = pitch.sin_cos();
    let (x, z) = (cos * x - sin * z, sin * x + cos * z);
    let (sin, cos) = roll.sin_cos();
    [x, cos * y + sin * z, cos * z - sin * y]
}

/// A point of step `step` in the body's frame [m].
pub fn in_body(trajectory: &Trajectory, step: usize, point: [f64; 3]) -> [f64; 3] {
    let origin = trajectory.position_m[step];
    into_body(std::array::from_fn(|i| point[i] - origin[i]), trajectory.orientation_rad[step])
}

/// First step after the settling time; the first of all in an episode that ended before.
pub fn settled(trajectory: &Trajectory) -> usize {
    let after = trajectory.time_s.partition_point(|&time| time < trajectory.settle_s);
    if after + 1 < trajectory.time_s.len() { after } else { 0 }
}

/// The strides after the settling time, first step and first step of the next: from one start of the gait's cycle to
/// the next, or pieces of half a second where no cycle runs.
pub fn strides(trajectory: &Trajectory) -> Vec<(usize, usize)> {
    let first = settled(trajectory);
    let steps = trajectory.time_s.len();
    let mut starts: Vec<usize> =
        (first.max(1)..steps).filter(|&i| trajectory.phase[i] < trajectory.phase[i - 1] - 0.5).collect();
    if starts.len() < 2 {
        let length = ((STRIDE_WITHOUT_PHASE_S / trajectory.control_dt_s).round() as usize).clamp(1, steps - 1);
        starts = (first..steps).step_by(length).collect();
    }
    if starts.len() < 2 {
        starts = vec![first, steps - 1];
    }
    starts.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// The stride nearest to the middle of the episode.
pub fn middle_stride(trajectory: &Trajectory) -> (usize, usize) {
    let strides = strides(trajectory);
    strides[strides.len() / 2]
}

/// Share of the time after settling in which a leg's foot touches the ground.
pub fn duty_factor(trajectory: &Trajectory, leg: usize) -> f64 {
    let rows = &trajectory.contact[settled(trajectory)..];
    rows.iter().filter(|row| row[leg] != 0).count() as f64 / rows.len() as f64
}

/// Forward way of each control step [m].
///
/// ```text
/// V = x_1 - x_0
/// ```
///
/// # Shapes
/// - (T) -> (T - 1)
///
/// Source: eq. 7 of the paper.
pub fn speed_per_step(trajectory: &Trajectory) -> Vec<f64> {
    trajectory.position_m.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect()
}

/// Which legs are on the robot's right: the side from which it is seen, so that forward is to the right.
pub fn near_legs(trajectory: &Trajectory) -> Vec<bool> {
    (0..trajectory.legs.len()).map(|leg| in_body(trajectory, 0, trajectory.hip_m[0][leg])[1] <= 0.0).collect()
}

/// Size of the body's box: half its length, half its thickness [m].
pub fn body_box(trajectory: &Trajectory) -> (f64, f64) {
    let reach = trajectory.hip_m[0].iter().map(|&hip| in_body(trajectory, 0, hip)[0].abs()).fold(0.0, f64::max);
    (reach + BODY_MARGIN * trajectory.leg_length_m, BODY_HALF_THICKNESS * trajectory.leg_length_m)
}

/// Corners of the body's box in side view: (forward, up) from the body's foot point on the ground [m].
pub fn body_corners(trajectory: &Trajectory, step: usize) -> [(f64, f64); 4] {
    let (half_length, half_thickness) = body_box(trajectory);
    let (sin, cos) = trajectory.orientation_rad[step][1].sin_cos();
    let height = trajectory.position_m[step][2];
    // A positive pitch lowers the nose: y points left.
    [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(along, up)| {
        let (x, z) = (along * half_length, up * half_thickness);
        (cos * x + sin * z, height - sin * x + cos * z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(a: [f64; 3], b: [f64; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
    }

    #[test]
    fn a_quarter_turn_about_each_axis() {
        let quarter = std::f64::consts::FRAC_PI_2;
        // Turned left, the ground's forward is the body's right.
        assert_close(into_body([1.0, 0.0, 0.0], [0.0, 0.0, quarter]), [0.0, -1.0, 0.0]);
        // Nose down, the ground's forward is the body's up.
        assert_close(into_body([1.0, 0.0, 0.0], [0.0, quarter, 0.0]), [0.0, 0.0, 1.0]);
        // Rolled to the right, the ground's left is the body's down... and up is its left.
        assert_close(into_body([0.0, 0.0, 1.0], [quarter, 0.0, 0.0]), [0.0, 1.0, 0.0]);
    }
}
