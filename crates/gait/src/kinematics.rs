//! Leg space, foot position, motor angles and actuator targets.
//!
//! A leg's position has two coordinates. `swing` [rad] is the angle of the line from hip to foot, positive forward.
//! `extension` [rad] is positive when the leg gets longer and zero in the standing pose. The paper and Doggo's
//! firmware call them theta and gamma; the firmware's gamma grows when the leg gets *shorter*.

/// A position in leg space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegPosition {
    /// Angle of the line from hip to foot [rad], positive forward.
    pub swing: f32,
    /// How far the leg is lengthened from the standing pose [rad].
    pub extension: f32,
}

/// A foot in the leg's plane, seen from its hip.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FootPosition {
    /// Forward of the hip [m].
    pub forward_m: f32,
    /// Below the hip [m].
    pub down_m: f32,
}

/// A coaxial five-bar leg: two upper links on one hip axis, two lower links that meet at the foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiveBar {
    upper_link_m: f32,
    lower_link_m: f32,
    stance_half_angle: f32,
}

impl FiveBar {
    /// A leg with these link lengths [m], whose length in the standing pose is `stance_length_m` [m].
    ///
    /// `None` unless all are positive and the leg can have that length.
    pub fn new(upper_link_m: f32, lower_link_m: f32, stance_length_m: f32) -> Option<Self> {
        let positive = upper_link_m > 0.0 && lower_link_m > 0.0;
        let stance_half_angle = half_angle(upper_link_m, lower_link_m, stance_length_m)?;
        positive.then_some(Self { upper_link_m, lower_link_m, stance_half_angle })
    }

    /// Length of each upper link [m].
    pub fn upper_link_m(&self) -> f32 {
        self.upper_link_m
    }

    /// Length of each lower link [m].
    pub fn lower_link_m(&self) -> f32 {
        self.lower_link_m
    }

    /// Half the angle between the upper links in the standing pose [rad].
    pub fn stance_half_angle(&self) -> f32 {
        self.stance_half_angle
    }

    /// Distance from hip to foot [m] at this `extension` [rad]; NaN where the lower links cannot meet.
    ///
    /// ```text
    /// gamma = gamma_stance - extension
    /// L = L1 cos(gamma) + sqrt(L2^2 - L1^2 sin(gamma)^2)
    /// ```
    ///
    /// Source: law of cosines in the triangle hip, knee, foot; Kau et al. 2019, section III (the solution with the foot below the knees).
    pub fn length(&self, extension: f32) -> f32 {
        let gamma = self.stance_half_angle - extension;
        let across = self.upper_link_m * libm::sinf(gamma);
        self.upper_link_m * libm::cosf(gamma) + libm::sqrtf(self.lower_link_m * self.lower_link_m - across * across)
    }

    /// Foot position [m] at a leg position: the forward kinematics.
    ///
    /// ```text
    /// forward = L sin(swing),  down = L cos(swing)
    /// ```
    ///
    /// Source: Kau et al. 2019, section III.
    pub fn forward(&self, leg: LegPosition) -> FootPosition {
        let length = self.length(leg.extension);
        FootPosition { forward_m: length * libm::sinf(leg.swing), down_m: length * libm::cosf(leg.swing) }
    }

    /// Leg position that puts the foot there: the inverse kinematics. `None` where the leg cannot reach.
    ///
    /// ```text
    /// swing = atan2(forward, down)
    /// extension = gamma_stance - acos((L1^2 + L^2 - L2^2) / (2 L1 L)),  L = hypot(forward, down)
    /// ```
    ///
    /// Source: Kau et al. 2019, section III; Stanford Doggo's firmware.
    pub fn inverse(&self, foot: FootPosition) -> Option<LegPosition> {
        let length = libm::hypotf(foot.forward_m, foot.down_m);
        let gamma = half_angle(self.upper_link_m, self.lower_link_m, length)?;
        let swing = libm::atan2f(foot.forward_m, foot.down_m);
        Some(LegPosition { swing, extension: self.stance_half_angle - gamma })
    }

    /// Angle of each lower link against straight down [rad] when its own upper link leans by `gamma` forward.
    ///
    /// The lower link of an upper link at swing + gamma points along swing minus this angle, and mirrored for the other.
    ///
    /// ```text
    /// beta = asin(L1 sin(gamma) / L2)
    /// ```
    ///
    /// Source: law of sines in the triangle hip, knee, foot.
    pub fn lower_link_angle(&self, extension: f32) -> f32 {
        let gamma = self.stance_half_angle - extension;
        libm::asinf(self.upper_link_m * libm::sinf(gamma) / self.lower_link_m)
    }
}

/// Half the angle between the upper links [rad] at leg length `length_m`; `None` where the links cannot reach it.
fn half_angle(upper_link_m: f32, lower_link_m: f32, length_m: f32) -> Option<f32> {
    let squares = upper_link_m * upper_link_m + length_m * length_m - lower_link_m * lower_link_m;
    let cosine = squares / (2.0 * upper_link_m * length_m);
    (-1.0..=1.0).contains(&cosine).then(|| libm::acosf(cosine))
}

/// How a leg is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegGeometry {
    /// A coaxial five-bar leg.
    FiveBar(FiveBar),
}

impl LegGeometry {
    /// Forward kinematics, see [`FiveBar::forward`].
    pub fn forward(&self, leg: LegPosition) -> FootPosition {
        match self {
            Self::FiveBar(five_bar) => five_bar.forward(leg),
        }
    }

    /// Inverse kinematics, see [`FiveBar::inverse`].
    pub fn inverse(&self, foot: FootPosition) -> Option<LegPosition> {
        match self {
            Self::FiveBar(five_bar) => five_bar.inverse(foot),
        }
    }
}

/// An invertible linear map between a leg position (swing, extension) and two joint or actuator values.
///
/// Both sides are zero in the standing pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearMap {
    matrix: [[f32; 2]; 2],
    inverse: [[f32; 2]; 2],
}

impl LinearMap {
    /// The map (swing, extension) -> `matrix` (swing, extension); `None` if it cannot be inverted.
    pub fn new(matrix: [[f32; 2]; 2]) -> Option<Self> {
        let [[a, b], [c, d]] = matrix;
        let determinant = a * d - b * c;
        let inverse = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]];
        inverse.iter().flatten().all(|value| value.is_finite()).then_some(Self { matrix, inverse })
    }

    /// The identity: actuators that are commanded in leg space.
    pub fn identity() -> Self {
        let matrix = [[1.0, 0.0], [0.0, 1.0]];
        Self { matrix, inverse: matrix }
    }

    /// A coaxial five-bar's two motors, both positive in the sense of a growing swing angle.
    ///
    /// ```text
    /// motor_a = swing - extension,  motor_b = swing + extension
    /// ```
    ///
    /// Source: Stanford Doggo's firmware (swing and half-angle are half the sum and half the difference of the motors' angles).
    pub fn five_bar_motors() -> Self {
        Self { matrix: [[1.0, -1.0], [1.0, 1.0]], inverse: [[0.5, 0.5], [-0.5, 0.5]] }
    }

    /// The two joint or actuator values at a leg position.
    pub fn apply(&self, leg: LegPosition) -> [f32; 2] {
        let [[a, b], [c, d]] = self.matrix;
        [a * leg.swing + b * leg.extension, c * leg.swing + d * leg.extension]
    }

    /// The leg position at two joint or actuator values.
    pub fn invert(&self, values: [f32; 2]) -> LegPosition {
        let [[a, b], [c, d]] = self.inverse;
        let [first, second] = values;
        LegPosition { swing: a * first + b * second, extension: c * first + d * second }
    }
}

/// The part of leg space that commands may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegLimits {
    /// Least and greatest swing angle [rad].
    pub swing: [f32; 2],
    /// Least and greatest extension [rad].
    pub extension: [f32; 2],
}

impl LegLimits {
    /// The nearest allowed position; a coordinate that is not a number becomes that of the standing pose.
    pub fn clamp(&self, leg: LegPosition) -> LegPosition {
        LegPosition { swing: clamp(leg.swing, self.swing), extension: clamp(leg.extension, self.extension) }
    }
}

fn clamp(value: f32, [low, high]: [f32; 2]) -> f32 {
    let value = if value.is_nan() { 0.0 } else { value };
    // `f32::clamp` would panic on limits that are out of order.
    value.max(low).min(high)
}

/// One leg as the controller sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Link lengths and how they are connected.
    pub geometry: LegGeometry,
    /// Leg position -> angles of its two motor joints [rad].
    pub motors: LinearMap,
    /// Leg position -> its two actuator targets [rad].
    pub actuators: LinearMap,
    /// The part of leg space that commands may use.
    pub limits: LegLimits,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doggo() -> FiveBar {
        FiveBar::new(0.09, 0.162, 0.17).unwrap()
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
        // Knee at 0.09 sin(gamma) = 0.084267 m beside the leg's line: beta = asin(0.084267 / 0.162) = 0.547018
        assert!((leg.lower_link_angle(0.0) - 0.547_02).abs() < 1e-4);
    }

    #[test]
    fn inverse_undoes_forward_over_the_whole_leg_space() {
        let leg = doggo();
        for i in -30..=30 {
            for j in -26..=20 {
                let position = LegPosition { swing: i as f32 * 0.05, extension: j as f32 * 0.05 };
                let back = leg.inverse(leg.forward(position)).unwrap();
                assert!((back.swing - position.swing).abs() < 2e-5, "{position:?} {back:?}");
                assert!((back.extension - position.extension).abs() < 2e-4, "{position:?} {back:?}");
            }
        }
    }

    #[test]
    fn swinging_forward_moves_the_foot_forward_and_extending_lengthens() {
        let leg = doggo();
        assert!(leg.forward(LegPosition { swing: 0.3, extension: 0.0 }).forward_m > 0.0);
        assert!(leg.length(0.4) > leg.length(0.0) && leg.length(0.0) > leg.length(-0.4));
    }

    #[test]
    fn what_cannot_be_reached_has_no_inverse() {
        let leg = doggo();
        assert_eq!(leg.inverse(FootPosition { forward_m: 0.0, down_m: 0.26 }), None);
        assert_eq!(leg.inverse(FootPosition { forward_m: 0.0, down_m: 0.05 }), None);
        assert_eq!(leg.inverse(FootPosition { forward_m: f32::NAN, down_m: 0.1 }), None);
        assert_eq!(FiveBar::new(0.09, 0.162, 0.3), None);
        assert_eq!(FiveBar::new(-0.09, 0.162, 0.17), None);
    }

    #[test]
    fn five_bar_motors_follow_the_firmware_and_invert() {
        let map = LinearMap::five_bar_motors();
        let position = LegPosition { swing: 0.3, extension: 0.1 };
        let [a, b] = map.apply(position);
        assert!((a - 0.2).abs() < 1e-6 && (b - 0.4).abs() < 1e-6);
        let back = map.invert([a, b]);
        assert!((back.swing - 0.3).abs() < 1e-6 && (back.extension - 0.1).abs() < 1e-6);
        assert_eq!(LinearMap::new([[1.0, 2.0], [2.0, 4.0]]), None);
        assert_eq!(LinearMap::new([[1.0, -1.0], [1.0, 1.0]]), Some(map));
    }

    #[test]
    fn limits_clamp_and_replace_nan() {
        let limits = LegLimits { swing: [-1.0, 1.0], extension: [-0.5, 0.25] };
        let clamped = limits.clamp(LegPosition { swing: 3.0, extension: f32::NAN });
        assert_eq!(clamped, LegPosition { swing: 1.0, extension: 0.0 });
    }
}
