//! Rotations between the body's, the ground's and gravity's frame. x forward, y left, z up; quaternions (w, x, y, z).

/// A rotation matrix, row by row.
pub type Matrix3 = [[f64; 3]; 3];

/// Rotation of a body with these intrinsic z-y-x angles [rad]: yaw first, then pitch, then roll.
pub fn from_euler(roll: f64, pitch: f64, yaw: f64) -> Matrix3 {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
}

/// Roll, pitch and yaw [rad] of a rotation, the inverse of [`from_euler`] for a pitch within +-90 degrees.
pub fn to_euler(rotation: &Matrix3) -> [f64; 3] {
    let [[xx, _, _], [yx, _, _], [zx, zy, zz]] = *rotation;
    [zy.atan2(zz), (-zx).clamp(-1.0, 1.0).asin(), yx.atan2(xx)]
}

/// The same angle within half a turn of 0 [rad].
pub fn smallest_angle(angle_rad: f64) -> f64 {
    angle_rad.sin().atan2(angle_rad.cos())
}

/// Rotation matrix of a quaternion, which need not have unit length.
pub fn from_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3 {
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    [
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ]
}

/// Unit quaternion of a rotation by less than 180 degrees.
pub fn quaternion(rotation: &Matrix3) -> [f64; 4] {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = *rotation;
    let w = 0.5 * (1.0 + xx + yy + zz).max(0.0).sqrt();
    let s = 0.25 / w;
    [w, s * (zy - yz), s * (xz - zx), s * (yx - xy)]
}

/// The product `a b`.
pub fn multiply(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Rotation from the frame of ground with these slopes, forward and to the left [rad], to gravity's.
///
/// ```text
/// R = R_y(-slope) R_x(cross)
/// ```
///
/// Source: rotation of the frame; level ground is first turned about its forward axis, then about level left.
pub fn gravity_from_ground([slope_rad, cross_slope_rad]: [f64; 2]) -> Matrix3 {
    from_euler(cross_slope_rad, -slope_rad, 0.0)
}

/// Gravity [m/s^2] seen from ground that rises forward by the first and to the left by the second slope [rad].
///
/// ```text
/// g' = g (-sin(slope), -cos(slope) sin(cross), -cos(slope) cos(cross))
/// ```
///
/// A plane that is tilted under straight gravity and a level plane under tilted gravity are the same physics; the
/// second keeps MuJoCo's world the ground's frame.
///
/// Source: rotation of the frame.
pub fn gravity_in_ground(gravity: f64, [slope_rad, cross_slope_rad]: [f64; 2]) -> [f64; 3] {
    let (sin_cross, cos_cross) = cross_slope_rad.sin_cos();
    // 0 - 0 is 0 without a sign.
    let left = 0.0 - gravity * slope_rad.cos() * sin_cross;
    [-gravity * slope_rad.sin(), left, -gravity * slope_rad.cos() * cos_cross]
}

/// Positions and angles of a robot stay below this [m, rad]: no walk of the longest episode comes near it.
const LARGEST_POSITION: f64 = 1e6;

/// Velocities of a robot stay below this [m/s, rad/s], ten times what the fastest motors and the hardest falls give.
pub const LARGEST_VELOCITY: f64 = 1e3;

/// Whether a state could be a robot's: finite, within 1000 km and 1 km/s.
///
/// MuJoCo itself notices values above 1e10 only.
pub fn is_sane(qpos: &[f64], qvel: &[f64]) -> bool {
    qpos.iter().all(|value| value.abs() < LARGEST_POSITION) && qvel.iter().all(|value| value.abs() < LARGEST_VELOCITY)
}

/// Whether a robot could have come this far [m] in `dt_s` [s]: not faster than the velocities that [`is_sane`] allows.
pub fn is_possible_way(displacement: [f64; 3], dt_s: f64) -> bool {
    displacement.iter().all(|way| way.abs() < LARGEST_VELOCITY * dt_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn angles_survive_matrix_and_quaternion() {
        for [roll, pitch, yaw] in [[0.1, -0.4, 2.0], [-1.2, 1.3, -0.3], [0.0, 0.0, 0.0]] {
            let rotation = from_euler(roll, pitch, yaw);
            assert!(close(&to_euler(&rotation), &[roll, pitch, yaw]));
            let back = from_quaternion(quaternion(&rotation));
            assert!(close(back.as_flattened(), rotation.as_flattened()));
        }
    }

    #[test]
    fn a_positive_yaw_turns_left_and_a_positive_pitch_noses_down() {
        let forward = |rotation: Matrix3| [rotation[0][0], rotation[1][0], rotation[2][0]];
        assert!(forward(from_euler(0.0, 0.0, 0.3))[1] > 0.0);
        assert!(forward(from_euler(0.0, 0.3, 0.0))[2] < 0.0);
    }

    #[test]
    fn uphill_gravity_pulls_back() {
        let [x, y, z] = gravity_in_ground(9.81, [20_f64.to_radians(), 0.0]);
        assert!(close(&[x, y, z], &[-9.81 * 0.342_020_143_325_668_7, 0.0, -9.81 * 0.939_692_620_785_908_4]));
        // A robot that stands flat on the slope has its nose up against gravity: negative pitch.
        let gravity_from_ground = gravity_from_ground([20_f64.to_radians(), 0.0]);
        let up_in_gravity_frame = multiply(&gravity_from_ground, &from_euler(0.0, 0.0, 0.0));
        assert!(to_euler(&up_in_gravity_frame)[1] < 0.0);
        // Gravity in the ground's frame, taken to gravity's frame, points straight down.
        let down: Vec<f64> = gravity_from_ground.iter().map(|row| row[0] * x + row[1] * y + row[2] * z).collect();
        assert!(close(&down, &[0.0, 0.0, -9.81]));
    }

    #[test]
    fn on_ground_that_rises_to_the_left_gravity_pulls_right_and_the_robot_leans_right() {
        let slopes = [10_f64.to_radians(), 30_f64.to_radians()];
        let pull = gravity_in_ground(10.0, slopes);
        // sin 10, cos 10 sin 30, cos 10 cos 30 degrees.
        assert!(close(&pull, &[-1.736_481_776_669_303_3, -4.924_038_765_061_04, -8.528_685_319_524_433]));
        let gravity_from_ground = gravity_from_ground(slopes);
        let down: Vec<f64> = gravity_from_ground.iter().map(|row| (0..3).map(|i| row[i] * pull[i]).sum()).collect();
        assert!(close(&down, &[0.0, 0.0, -10.0]));
        // Left side up is a positive roll.
        let [roll, pitch, _] = to_euler(&gravity_from_ground);
        assert!(close(&[roll, pitch], &[slopes[1], -slopes[0]]));
    }

    #[test]
    fn a_turn_across_half_a_turn_is_a_small_one() {
        let turn = |from: f64, to: f64| smallest_angle((to - from).to_radians()).to_degrees();
        for (from, to, expected) in [(10.0, 30.0, 20.0), (175.0, -175.0, 10.0), (-170.0, 170.0, -20.0)] {
            assert!((turn(from, to) - expected).abs() < 1e-9, "{from} to {to}: {}", turn(from, to));
        }
    }

    #[test]
    fn the_longest_walk_makes_sense() {
        // 1000 s at 10 m/s.
        assert!(is_sane(&[10_000.0, -500.0], &[10.0]));
    }

    #[test]
    fn nonsense_is_noticed() {
        assert!(is_sane(&[0.1, -3.0], &[20.0]));
        for bad in [f64::NAN, f64::INFINITY, 1e9, -1e20] {
            assert!(!is_sane(&[bad], &[]) && !is_sane(&[], &[bad]));
            assert!(!is_possible_way([0.0, bad, 0.0], 0.01));
        }
        assert!(is_possible_way([0.03, -0.01, 0.0], 0.01) && !is_possible_way([0.0, 0.0, 10.5], 0.01));
    }
}
