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

/// A point of step `step` in side view, wherever the robot looks: forward of its body along its heading, and above the
/// ground [m].
///
/// ```text
/// ((p - p_body) . (cos yaw, sin yaw, 0), p_z)
/// ```
///
/// Source: our definition. Seen along the ground's axes, a robot that has turned would look shortened.
pub fn side_view(trajectory: &Trajectory, step: usize, point: [f64; 3]) -> (f64, f64) {
    let origin = trajectory.position_m[step];
    let (sin, cos) = trajectory.orientation_rad[step][2].sin_cos();
    ((point[0] - origin[0]) * cos + (point[1] - origin[1]) * sin, point[2])
}

/// Way along the robot's heading up to each step [m]: what the ground under a side view has moved.
///
/// ```text
/// s_t = s_(t-1) + (p_t - p_(t-1)) . (cos yaw_t, sin yaw_t),  s_0 = 0
/// ```
///
/// # Shapes
/// - (T) -> (T)
///
/// Source: our definition.
pub fn way_along_heading(trajectory: &Trajectory) -> Vec<f64> {
    let mut way = 0.0;
    let mut ways = vec![0.0];
    for (pair, orientation) in trajectory.position_m.windows(2).zip(&trajectory.orientation_rad[1..]) {
        let (sin, cos) = orientation[2].sin_cos();
        way += (pair[1][0] - pair[0][0]) * cos + (pair[1][1] - pair[0][1]) * sin;
        ways.push(way);
    }
    ways
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

/// Corners of the body's box in side view: as [`side_view`] has it [m].
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
    fn a_robot_that_walks_to_the_left_is_seen_from_its_right() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let column = |value: f64| vec![vec![value]; 2];
        let points = || vec![vec![[1.0, 2.3, 0.1]]; 2];
        let trajectory = Trajectory {
            name: String::new(),
            robot: String::new(),
            legs: vec![String::new()],
            control_dt_s: 0.01,
            settle_s: 0.0,
            slope_deg: 0.0,
            terminated: None,
            leg_length_m: 0.2,
            max_torque_nm: 1.0,
            swing_limits_rad: [-1.0, 1.0],
            extension_limits_rad: [-1.0, 1.0],
            time_s: vec![0.01, 0.02],
            phase: vec![0.0; 2],
            position_m: vec![[1.0, 2.0, 0.2], [1.0, 2.1, 0.2]],
            orientation_rad: vec![[0.0, 0.0, quarter]; 2],
            hip_m: points(),
            knee_m: vec![vec![[[1.0, 2.3, 0.1]; 2]]; 2],
            foot_m: points(),
            contact: vec![vec![1], vec![0]],
            body_contact: vec![0; 2],
            commanded_swing_rad: column(0.0),
            commanded_extension_rad: column(0.0),
            swing_rad: column(0.0),
            extension_rad: column(0.0),
            torque_nm: column(0.0),
        };
        let (forward, up) = side_view(&trajectory, 0, [1.0, 2.3, 0.1]);
        assert!((forward - 0.3).abs() < 1e-12 && up == 0.1, "{forward} {up}");
        assert!((way_along_heading(&trajectory)[1] - 0.1).abs() < 1e-12);
        assert_eq!(speed_per_step(&trajectory), [0.0]);
        assert_eq!(duty_factor(&trajectory, 0), 0.5);
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
