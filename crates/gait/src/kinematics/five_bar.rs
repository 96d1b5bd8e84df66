//! Five-bar legs: two motors at the hip, two upper links, two lower links that meet at the foot.

use super::{FootPosition, LegPosition, nearest_triangle_angle, triangle_angle};

/// A five-bar leg with both hips on one axis, as Doggo's and Minitaur's, or one before the other, as Q8bot's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiveBar {
    upper_link_m: f32,
    lower_link_m: f32,
    half_separation_m: f32,
    stance_half_angle: f32,
}

impl FiveBar {
    /// A leg with these link lengths and distance between its hips [m], whose length in the standing pose, from the
    /// middle between the hips to the foot straight below, is `stance_length_m` [m].
    ///
    /// `None` unless all are positive (the distance may be 0) and the leg can have that length.
    pub fn new(upper_link_m: f32, lower_link_m: f32, hip_separation_m: f32, stance_length_m: f32) -> Option<Self> {
        let is_possible = upper_link_m > 0.0 && lower_link_m > 0.0 && hip_separation_m >= 0.0;
        let leg =
            Self { upper_link_m, lower_link_m, half_separation_m: 0.5 * hip_separation_m, stance_half_angle: 0.0 };
        let stance_half_angle = leg.half_angle(stance_length_m)?;
        is_possible.then_some(Self { stance_half_angle, ..leg })
    }

    /// Length of each upper link [m].
    pub fn upper_link_m(&self) -> f32 {
        self.upper_link_m
    }

    /// Length of each lower link [m].
    pub fn lower_link_m(&self) -> f32 {
        self.lower_link_m
    }

    /// Distance between the two hips [m].
    pub fn hip_separation_m(&self) -> f32 {
        2.0 * self.half_separation_m
    }

    /// Angle of each upper link against straight down in the standing pose [rad].
    pub fn stance_half_angle(&self) -> f32 {
        self.stance_half_angle
    }

    /// Distance from the middle of the hips to the foot [m] at this `extension` [rad]; where the lower links cannot
    /// meet, that of the upper links' ends.
    ///
    /// ```text
    /// gamma = gamma_stance - extension
    /// L = L1 cos(gamma) + sqrt(L2^2 - (d / 2 + L1 sin(gamma))^2)
    /// ```
    ///
    /// d -> the distance between the hips. With d = 0 this is Doggo's firmware.
    ///
    /// Source: law of cosines in the triangle hip, knee, foot; Kau et al. 2019, section III (the solution with the foot below the knees).
    pub fn length(&self, extension: f32) -> f32 {
        let gamma = self.stance_half_angle - extension;
        let across = self.half_separation_m + self.upper_link_m * libm::sinf(gamma);
        self.upper_link_m * libm::cosf(gamma)
            + libm::sqrtf((self.lower_link_m * self.lower_link_m - across * across).max(0.0))
    }

    /// The extension [rad] at which the leg has this length [m]; `None` where it cannot have it.
    pub(super) fn extension(&self, length_m: f32) -> Option<f32> {
        Some(self.stance_half_angle - self.half_angle(length_m)?)
    }

    /// Angle of each upper link against straight down [rad] where the foot is straight below at `length_m`.
    fn half_angle(&self, length_m: f32) -> Option<f32> {
        let from_hip_m = libm::hypotf(self.half_separation_m, length_m);
        let between = triangle_angle(self.upper_link_m, from_hip_m, self.lower_link_m)?;
        let angle = between - libm::atan2f(self.half_separation_m, length_m);
        (length_m > 0.0).then_some(angle)
    }

    /// Angles of the two motors [rad], the one whose link points forward first; both are positive when their link swings
    /// forward and zero in the standing pose.
    ///
    /// ```text
    /// d = 0:      motor_a = swing - extension,  motor_b = swing + extension
    /// otherwise:  motor_a = alpha_a + delta_a - gamma_stance,  motor_b = alpha_b - delta_b + gamma_stance,
    ///             alpha_i = atan2(forward -+ d / 2, down),  r_i = hypot(forward -+ d / 2, down),
    ///             delta_i = acos((L1^2 + r_i^2 - L2^2) / (2 L1 r_i))
    /// ```
    ///
    /// Source: Stanford Doggo's firmware for d = 0; law of cosines in the triangles hip, knee, foot otherwise.
    pub fn motor_angles(&self, leg: LegPosition) -> [f32; 2] {
        if self.half_separation_m == 0.0 {
            return [leg.swing - leg.extension, leg.swing + leg.extension];
        }
        let length = self.length(leg.extension);
        let (forward, down) = (length * libm::sinf(leg.swing), length * libm::cosf(leg.swing));
        [1.0, -1.0].map(|side: f32| {
            let ahead = forward - side * self.half_separation_m;
            let from_hip = libm::hypotf(ahead, down);
            let delta = nearest_triangle_angle(self.upper_link_m, from_hip, self.lower_link_m);
            libm::atan2f(ahead, down) + side * (delta - self.stance_half_angle)
        })
    }

    /// The leg position at these motor angles; where the lower links cannot meet, the foot is between the knees.
    ///
    /// ```text
    /// d = 0:      swing = (motor_a + motor_b) / 2,  extension = (motor_b - motor_a) / 2
    /// otherwise:  the foot is the lower intersection of two circles of radius L2 about the knees
    /// ```
    ///
    /// Source: as [`motor_angles`](Self::motor_angles).
    pub fn leg_position(&self, [motor_a, motor_b]: [f32; 2]) -> LegPosition {
        if self.half_separation_m == 0.0 {
            return LegPosition { swing: 0.5 * motor_a + 0.5 * motor_b, extension: -0.5 * motor_a + 0.5 * motor_b };
        }
        let knee = |side: f32, angle: f32| {
            let angle = angle + side * self.stance_half_angle;
            let forward_m = side * self.half_separation_m + self.upper_link_m * libm::sinf(angle);
            FootPosition { forward_m, down_m: self.upper_link_m * libm::cosf(angle) }
        };
        let (front, back) = (knee(1.0, motor_a), knee(-1.0, motor_b));
        let (forward, down) = (front.forward_m - back.forward_m, front.down_m - back.down_m);
        // Knees in one place are no line to be across.
        let half = (0.5 * libm::hypotf(forward, down)).max(f32::MIN_POSITIVE);
        // From the middle between the knees, across the line between them.
        let across = libm::sqrtf((self.lower_link_m * self.lower_link_m - half * half).max(0.0)) / (2.0 * half);
        let foot = FootPosition {
            forward_m: 0.5 * (front.forward_m + back.forward_m) - across * down,
            down_m: 0.5 * (front.down_m + back.down_m) + across * forward,
        };
        let from_hip_m = libm::hypotf(libm::hypotf(foot.forward_m, foot.down_m), self.half_separation_m);
        let between = nearest_triangle_angle(self.upper_link_m, from_hip_m, self.lower_link_m);
        let length = libm::hypotf(foot.forward_m, foot.down_m);
        let extension = self.stance_half_angle - (between - libm::atan2f(self.half_separation_m, length));
        LegPosition { swing: libm::atan2f(foot.forward_m, foot.down_m), extension }
    }

    /// Angles of the two passive joints between upper and lower links [rad], in the order of the motors: how far the lower
    /// link is turned forward against its upper link since the standing pose.
    ///
    /// ```text
    /// knee_i = (angle of lower link i - angle of upper link i) - (the same in the standing pose)
    /// d = 0:  knee_a = -knee_b = fold(0) - fold(extension),  fold = gamma + asin(L1 sin(gamma) / L2)
    /// ```
    ///
    /// Source: law of sines in the triangles hip, knee, foot.
    pub fn knee_angles(&self, leg: LegPosition) -> [f64; 2] {
        if self.half_separation_m == 0.0 {
            let fold = |extension: f32| {
                let gamma = self.stance_half_angle - extension;
                let beta = libm::asinf(self.upper_link_m * libm::sinf(gamma) / self.lower_link_m);
                f64::from(gamma) + f64::from(beta)
            };
            let change = fold(leg.extension) - fold(0.0);
            return [-change, change];
        }
        let fold = |leg: LegPosition| {
            let length = self.length(leg.extension);
            let (forward, down) = (length * libm::sinf(leg.swing), length * libm::cosf(leg.swing));
            let [front, back] = self.motor_angles(leg);
            [(1.0, front), (-1.0, back)].map(|(side, motor): (f32, f32)| {
                let upper = motor + side * self.stance_half_angle;
                let ahead = forward - side * self.half_separation_m - self.upper_link_m * libm::sinf(upper);
                f64::from(libm::atan2f(ahead, down - self.upper_link_m * libm::cosf(upper)) - upper)
            })
        };
        let ([front, back], [standing_front, standing_back]) = (fold(leg), fold(LegPosition::default()));
        [front - standing_front, back - standing_back]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doggo() -> FiveBar {
        FiveBar::new(0.09, 0.162, 0.0, 0.17).unwrap()
    }

    /// Hips 40 mm apart.
    fn apart() -> FiveBar {
        FiveBar::new(0.06, 0.09, 0.04, 0.11).unwrap()
    }

    #[test]
    fn standing_doggo_matches_the_triangle_computed_by_hand() {
        let leg = doggo();
        // cos(gamma) = (0.0081 + 0.0289 - 0.026244) / 0.0306 = 0.351503
        assert!((leg.stance_half_angle() - 1.211_61).abs() < 1e-4);
        assert!((leg.length(0.0) - 0.17).abs() < 1e-6);
        // Straight leg: gamma = 0, L = 0.09 + 0.162.
        assert!((leg.length(leg.stance_half_angle()) - 0.252).abs() < 1e-6);
        // Upper links level: gamma = pi/2, L = sqrt(0.162^2 - 0.09^2) = 0.134700
        let level = leg.stance_half_angle() - core::f32::consts::FRAC_PI_2;
        assert!((leg.length(level) - 0.134_700).abs() < 1e-5);
    }

    #[test]
    fn hips_apart_by_hand() {
        // Foot below the front hip, 0.11 m deep: r_a = 0.11, cos(delta_a) = (0.0036 + 0.0121 - 0.0081) / 0.0132 = 0.575758
        let leg = apart();
        let foot_m = libm::hypotf(0.02, 0.11);
        let position = LegPosition { swing: libm::atan2f(0.02, 0.11), extension: leg.extension(foot_m).unwrap() };
        let [motor_a, _] = leg.motor_angles(position);
        assert!((motor_a + leg.stance_half_angle() - 0.957_25).abs() < 1e-4, "{motor_a}");
        assert_eq!(leg.motor_angles(LegPosition::default()).map(|angle| (angle * 1e5) as i32), [0, 0]);
    }

    #[test]
    fn lengthening_is_turning_the_upper_links_down_by_the_extension() {
        for leg in [doggo(), apart()] {
            let [a, b] = leg.motor_angles(LegPosition { swing: 0.0, extension: 0.2 });
            assert!((a + 0.2).abs() < 1e-5 && (b - 0.2).abs() < 1e-5, "{a} {b}");
            assert!(leg.length(0.2) > leg.length(0.0) && leg.length(0.0) > leg.length(-0.2));
        }
    }

    #[test]
    fn motors_lead_back_to_the_leg_position() {
        for leg in [doggo(), apart()] {
            for (swing, extension) in [(0.0, 0.0), (0.3, 0.1), (-0.4, 0.2), (0.2, -0.3), (0.0, -0.2)] {
                let back = leg.leg_position(leg.motor_angles(LegPosition { swing, extension }));
                assert!((back.swing - swing).abs() < 1e-4 && (back.extension - extension).abs() < 1e-3, "{back:?}");
            }
        }
    }

    #[test]
    fn knees_of_a_coaxial_leg_fold_alike() {
        let [front, back] = doggo().knee_angles(LegPosition { swing: 0.4, extension: 0.3 });
        assert!((front + back).abs() < 1e-5 && front.abs() > 0.1, "{front} {back}");
    }
}
