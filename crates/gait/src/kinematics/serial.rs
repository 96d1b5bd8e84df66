//! Serial legs: a hip motor that swings the upper link and a knee motor that turns the lower link against it.

use super::{FiveBar, LegPosition, nearest_triangle_angle};

/// A leg of two links one after the other, as most quadrupeds have it. A third motor that turns the leg sideways is held
/// still and is not part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SerialLeg {
    /// The five-bar leg with both hips on one axis that this is one half of: the angle between the upper link and the line
    /// from hip to foot is the same.
    half: FiveBar,
    /// 1 where the knee is in front of the line from hip to foot, -1 where it is behind.
    knee_side: f32,
}

impl SerialLeg {
    /// A leg with these link lengths [m], whose length in the standing pose, from hip to foot, is `stance_length_m` [m].
    ///
    /// `None` unless all are positive and the leg can have that length.
    pub fn new(upper_link_m: f32, lower_link_m: f32, knee_in_front: bool, stance_length_m: f32) -> Option<Self> {
        let half = FiveBar::new(upper_link_m, lower_link_m, 0.0, stance_length_m)?;
        Some(Self { half, knee_side: if knee_in_front { 1.0 } else { -1.0 } })
    }

    /// Length of the upper link [m].
    pub fn upper_link_m(&self) -> f32 {
        self.half.upper_link_m()
    }

    /// Length of the lower link [m].
    pub fn lower_link_m(&self) -> f32 {
        self.half.lower_link_m()
    }

    /// Angle of the upper link against the line from hip to foot in the standing pose [rad], without its sign.
    pub fn stance_half_angle(&self) -> f32 {
        self.half.stance_half_angle()
    }

    /// Whether the knee is in front of the line from hip to foot.
    pub fn knee_in_front(&self) -> bool {
        self.knee_side > 0.0
    }

    /// Distance from hip to foot [m] at this `extension` [rad], see [`FiveBar::length`].
    pub fn length(&self, extension: f32) -> f32 {
        self.half.length(extension)
    }

    /// The extension [rad] at which the leg has this length [m]; `None` where it cannot have it.
    pub(super) fn extension(&self, length_m: f32) -> Option<f32> {
        self.half.extension(length_m)
    }

    /// Angle at the knee by which the lower link departs from the upper link's direction [rad], without its sign.
    fn fold(&self, gamma: f32) -> f32 {
        let sine = self.upper_link_m() * libm::sinf(gamma) / self.lower_link_m();
        gamma + libm::asinf(sine.clamp(-1.0, 1.0))
    }

    /// Angles of hip and knee motor [rad]: positive when their link swings forward, zero in the standing pose.
    ///
    /// ```text
    /// hip = swing - s extension,  knee = s (fold(gamma_stance) - fold(gamma)),
    /// fold(gamma) = gamma + asin(L1 sin(gamma) / L2),  gamma = gamma_stance - extension
    /// ```
    ///
    /// s -> 1 where the knee is in front, -1 where it is behind.
    ///
    /// Source: laws of sines and cosines in the triangle hip, knee, foot.
    pub fn motor_angles(&self, leg: LegPosition) -> [f32; 2] {
        let gamma = self.half.stance_half_angle() - leg.extension;
        let knee = self.fold(self.half.stance_half_angle()) - self.fold(gamma);
        [leg.swing - self.knee_side * leg.extension, self.knee_side * knee]
    }

    /// The leg position at these motor angles.
    ///
    /// ```text
    /// fold = fold(gamma_stance) - s knee,  L^2 = L1^2 + L2^2 + 2 L1 L2 cos(fold),
    /// extension = gamma_stance - acos((L1^2 + L^2 - L2^2) / (2 L1 L)),  swing = hip + s extension
    /// ```
    ///
    /// Source: as [`motor_angles`](Self::motor_angles).
    pub fn leg_position(&self, [hip, knee]: [f32; 2]) -> LegPosition {
        let fold = self.fold(self.half.stance_half_angle()) - self.knee_side * knee;
        let (upper, lower) = (self.upper_link_m(), self.lower_link_m());
        let squares = upper * upper + lower * lower + 2.0 * upper * lower * libm::cosf(fold);
        // Rounding must not make a stretched or folded leg longer or shorter than it can be.
        let length = libm::sqrtf(squares.max(0.0)).max(f32::MIN_POSITIVE);
        let extension = self.half.stance_half_angle() - nearest_triangle_angle(upper, length, lower);
        LegPosition { swing: hip + self.knee_side * extension, extension }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leg_of_equal_links_by_hand() {
        // 0.2 m links, standing at 0.2 m: an equilateral triangle, 60 degrees everywhere, the knee folded by 120.
        let leg = SerialLeg::new(0.2, 0.2, false, 0.2).unwrap();
        let third = core::f32::consts::FRAC_PI_3;
        assert!((leg.length(0.0) - 0.2).abs() < 1e-6 && (leg.length(third) - 0.4).abs() < 1e-6);
        // Stretched out: the upper link has swung forward to the line, the lower link has unfolded by 120 degrees.
        let [hip, knee] = leg.motor_angles(LegPosition { swing: 0.0, extension: third });
        assert!((hip - third).abs() < 1e-6 && (knee + 2.0 * third).abs() < 1e-6, "{hip} {knee}");
    }

    #[test]
    fn motors_lead_back_to_the_leg_position() {
        for knee_in_front in [false, true] {
            let leg = SerialLeg::new(0.213, 0.213, knee_in_front, 0.27).unwrap();
            for (swing, extension) in [(0.0, 0.0), (0.3, 0.1), (-0.4, 0.2), (0.2, -0.3)] {
                let back = leg.leg_position(leg.motor_angles(LegPosition { swing, extension }));
                assert!((back.swing - swing).abs() < 1e-5 && (back.extension - extension).abs() < 1e-5, "{back:?}");
            }
        }
    }

    #[test]
    fn impossible_legs_are_refused() {
        assert_eq!(SerialLeg::new(0.2, 0.2, true, 0.5), None);
        assert_eq!(SerialLeg::new(-0.2, 0.2, true, 0.2), None);
    }
}
