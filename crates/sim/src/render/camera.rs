//! Where the robot is seen from: its own right side, a little from behind and above, upright under gravity.

use crate::frame::{self, Matrix3};
use crate::mujoco::painter::{Camera, Sun};

/// Direction of the sight against the ground's forward axis [rad]: 90 degrees is straight from the right, less is from
/// behind. A view that is not quite from the side tells the near legs from the far ones.
const AZIMUTH_RAD: f64 = 1.36;
/// Angle between the sight and the horizontal [rad].
const ELEVATION_RAD: f64 = -0.26;
/// Distance of the eye, as a multiple of the robot's size.
const DISTANCE: f64 = 5.6;
/// See [`Camera::half_height`]: some three robots stand above each other.
const HALF_HEIGHT: f64 = 0.2;
/// Height above the ground that is in the middle of the picture, as a multiple of the robot's size: above the robot there
/// is text.
const MIDDLE_HEIGHT: f64 = 0.5;
/// Away from the sun, seen along the slope: from behind the eye and high up, so that the near side is bright and the
/// shadow lies under the robot and beyond.
const SUN_DIRECTION: [f64; 3] = [0.25, 0.4, -0.88];
/// Height of the [`Sun`]'s position, as a multiple of the robot's size.
const SUN_DISTANCE: f64 = 4.0;

/// A camera that follows a robot of this size [m] above the point `target` of the ground [m].
///
/// The simulator tilts gravity instead of the ground. The camera stands upright under gravity, so ground that rises
/// forward by `slope_rad` rises to the right of the picture.
pub fn beside(target: [f64; 2], reach_m: f64, slope_rad: f64) -> Camera {
    let ((sa, ca), (se, ce)) = (AZIMUTH_RAD.sin_cos(), ELEVATION_RAD.sin_cos());
    let ground_from_gravity = transpose(&frame::from_euler(0.0, -slope_rad, 0.0));
    let forward = apply(&ground_from_gravity, [ca * ce, sa * ce, se]);
    let middle = [target[0], target[1], MIDDLE_HEIGHT * reach_m];
    Camera {
        position: std::array::from_fn(|axis| middle[axis] - DISTANCE * reach_m * forward[axis]),
        forward,
        up: apply(&ground_from_gravity, [-ca * se, -sa * se, ce]),
        half_height: HALF_HEIGHT,
    }
}

/// The sun above the point `target` of the ground [m], on which a robot of this size [m] stands.
pub fn sun_above(target: [f64; 2], reach_m: f64) -> Sun {
    let length = SUN_DIRECTION.iter().map(|value| value * value).sum::<f64>().sqrt();
    let direction = SUN_DIRECTION.map(|value| value / length);
    let middle = [target[0], target[1], 0.0];
    let position = std::array::from_fn(|axis| middle[axis] - SUN_DISTANCE * reach_m * direction[axis]);
    Sun { position, direction }
}

fn transpose(rotation: &Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| rotation[j][i]))
}

fn apply(rotation: &Matrix3, vector: [f64; 3]) -> [f64; 3] {
    rotation.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// The unit vector to the right of the picture.
    fn right(camera: &Camera) -> [f64; 3] {
        let ([a, b, c], [x, y, z]) = (camera.forward, camera.up);
        [b * z - c * y, c * x - a * z, a * y - b * x]
    }

    #[test]
    fn gravity_points_straight_down_in_the_picture() {
        for slope_rad in [-0.3, 0.0, 0.35] {
            let camera = beside([1.0, -2.0], 0.3, slope_rad);
            let gravity = frame::gravity_in_ground(9.81, [slope_rad, 0.0]);
            assert!(dot(right(&camera), gravity).abs() < 1e-12 && dot(camera.up, gravity) < -9.0, "{slope_rad}");
            assert!(dot(camera.forward, camera.up).abs() < 1e-12);
        }
    }

    #[test]
    fn forward_goes_right_and_uphill_goes_up() {
        let level = beside([0.0; 2], 0.3, 0.0);
        assert!(right(&level)[0] > 0.9 && level.up[2] > 0.9 && level.position[1] < -1.0);
        // How far up in the picture a step along the ground leads.
        assert!((beside([0.0; 2], 0.3, 0.35).up[0] - level.up[0]) > 0.3);
        assert!((beside([0.0; 2], 0.3, -0.35).up[0] - level.up[0]) < -0.3);
    }

    #[test]
    fn the_middle_of_the_picture_is_above_the_target() {
        let camera = beside([3.0, 1.0], 0.4, 0.2);
        let middle: [f64; 3] = std::array::from_fn(|axis| camera.position[axis] + 5.6 * 0.4 * camera.forward[axis]);
        for (value, expected) in middle.into_iter().zip([3.0, 1.0, 0.2]) {
            assert!((value - expected).abs() < 1e-12);
        }
    }
}
