//! Leg space, foot position, motor angles and actuator targets.
//!
//! A leg's position has two coordinates. `swing` [rad] is the angle of the line from hip to foot, positive forward.
//! `extension` [rad] is positive when the leg gets longer and zero in the standing pose. The paper and Doggo's
//! firmware call them theta and gamma; the firmware's gamma grows when the leg gets *shorter*.

mod five_bar;
mod serial;

pub use five_bar::FiveBar;
pub use serial::SerialLeg;

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

/// The angle between two sides of a triangle [rad] whose third side is `opposite` (all of one unit); `None` where there
/// is no such triangle.
///
/// ```text
/// acos((a^2 + b^2 - c^2) / (2 a b))
/// ```
///
/// Source: law of cosines.
fn triangle_angle(side: f32, other_side: f32, opposite: f32) -> Option<f32> {
    let cosine = triangle_cosine(side, other_side, opposite);
    (-1.0..=1.0).contains(&cosine).then(|| libm::acosf(cosine))
}

/// The same angle, or that of the nearest triangle that there is: commands and readings just outside of what a leg can do
/// must not become something that is no number.
fn nearest_triangle_angle(side: f32, other_side: f32, opposite: f32) -> f32 {
    libm::acosf(triangle_cosine(side, other_side, opposite).clamp(-1.0, 1.0))
}

fn triangle_cosine(side: f32, other_side: f32, opposite: f32) -> f32 {
    (side * side + other_side * other_side - opposite * opposite) / (2.0 * side * other_side)
}

/// How a leg is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegGeometry {
    /// Two motors at the hip, two upper and two lower links.
    FiveBar(FiveBar),
    /// A motor at the hip and one at the knee.
    Serial(SerialLeg),
}

impl LegGeometry {
    /// Distance from hip to foot [m] at this `extension` [rad].
    pub fn length(&self, extension: f32) -> f32 {
        match self {
            Self::FiveBar(leg) => leg.length(extension),
            Self::Serial(leg) => leg.length(extension),
        }
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
    /// extension = gamma_stance - gamma(L),  L = hypot(forward, down)
    /// ```
    ///
    /// Source: Kau et al. 2019, section III; Stanford Doggo's firmware.
    pub fn inverse(&self, foot: FootPosition) -> Option<LegPosition> {
        let length = libm::hypotf(foot.forward_m, foot.down_m);
        let extension = match self {
            Self::FiveBar(leg) => leg.extension(length),
            Self::Serial(leg) => leg.extension(length),
        }?;
        Some(LegPosition { swing: libm::atan2f(foot.forward_m, foot.down_m), extension })
    }

    /// Angles of the leg's two motors [rad], positive when their link swings forward, zero in the standing pose.
    #[inline]
    pub fn motor_angles(&self, leg: LegPosition) -> [f32; 2] {
        match self {
            Self::FiveBar(five_bar) => five_bar.motor_angles(leg),
            Self::Serial(serial) => serial.motor_angles(leg),
        }
    }

    /// The leg position at these motor angles [rad], or the nearest that the leg can have.
    #[inline]
    pub fn leg_position(&self, motor_angles: [f32; 2]) -> LegPosition {
        match self {
            Self::FiveBar(five_bar) => five_bar.leg_position(motor_angles),
            Self::Serial(serial) => serial.leg_position(motor_angles),
        }
    }
}

/// How a joint's own angle counts against the motor angle of [`LegGeometry`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointConvention {
    /// 1, or -1 where the joint turns the other way.
    pub sign: f32,
    /// The joint's own angle in the standing pose [rad].
    pub standing: f32,
}

impl JointConvention {
    /// The joint's own angle [rad] at a motor angle [rad].
    pub fn joint_angle(self, motor_angle: f32) -> f32 {
        self.standing + self.sign * motor_angle
    }

    /// The motor angle [rad] at the joint's own angle [rad].
    pub fn motor_angle(self, joint_angle: f32) -> f32 {
        self.sign * (joint_angle - self.standing)
    }
}

/// What a leg's two actuators are commanded in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Actuators {
    /// Swing and extension [rad]: tendons that couple the motors.
    LegSpace,
    /// The joints of the two motors [rad].
    Joints([JointConvention; 2]),
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
    /// What its actuators are commanded in.
    pub actuators: Actuators,
    /// The part of leg space that commands may use.
    pub limits: LegLimits,
}

impl Leg {
    /// The two actuator targets [rad] at a leg position.
    #[inline]
    pub fn targets(&self, leg: LegPosition) -> [f32; 2] {
        match self.actuators {
            Actuators::LegSpace => [leg.swing, leg.extension],
            Actuators::Joints([first, second]) => {
                let [a, b] = self.geometry.motor_angles(leg);
                [first.joint_angle(a), second.joint_angle(b)]
            }
        }
    }

    /// The two actuator targets [rad] at which the leg already is, whatever its limits.
    #[inline]
    pub fn targets_at(&self, motor_angles: [f32; 2]) -> [f32; 2] {
        match self.actuators {
            Actuators::LegSpace => {
                let position = self.geometry.leg_position(motor_angles);
                [position.swing, position.extension]
            }
            Actuators::Joints([first, second]) => {
                let [a, b] = motor_angles;
                [first.joint_angle(a), second.joint_angle(b)]
            }
        }
    }

    /// The leg position at two actuator targets [rad].
    #[inline]
    pub fn position_at(&self, [a, b]: [f32; 2]) -> LegPosition {
        match self.actuators {
            Actuators::LegSpace => LegPosition { swing: a, extension: b },
            Actuators::Joints([first, second]) => {
                self.geometry.leg_position([first.motor_angle(a), second.motor_angle(b)])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legs() -> [LegGeometry; 3] {
        [
            LegGeometry::FiveBar(FiveBar::new(0.09, 0.162, 0.0, 0.17).unwrap()),
            LegGeometry::FiveBar(FiveBar::new(0.06, 0.09, 0.04, 0.11).unwrap()),
            LegGeometry::Serial(SerialLeg::new(0.09, 0.162, true, 0.17).unwrap()),
        ]
    }

    #[test]
    fn inverse_undoes_forward_over_the_whole_leg_space() {
        for leg in legs() {
            for i in -30..=30 {
                for j in -10..=8 {
                    let position = LegPosition { swing: i as f32 * 0.05, extension: j as f32 * 0.05 };
                    let back = leg.inverse(leg.forward(position)).unwrap();
                    assert!((back.swing - position.swing).abs() < 2e-5, "{position:?} {back:?}");
                    assert!((back.extension - position.extension).abs() < 5e-4, "{position:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn swinging_forward_moves_the_foot_forward_and_extending_lengthens() {
        for leg in legs() {
            assert!(leg.forward(LegPosition { swing: 0.3, extension: 0.0 }).forward_m > 0.0);
            assert!(leg.length(0.2) > leg.length(0.0) && leg.length(0.0) > leg.length(-0.2));
        }
    }

    #[test]
    fn what_cannot_be_reached_has_no_inverse() {
        let [leg, ..] = legs();
        assert_eq!(leg.inverse(FootPosition { forward_m: 0.0, down_m: 0.26 }), None);
        assert_eq!(leg.inverse(FootPosition { forward_m: 0.0, down_m: 0.05 }), None);
        assert_eq!(leg.inverse(FootPosition { forward_m: f32::NAN, down_m: 0.1 }), None);
        assert_eq!(FiveBar::new(0.09, 0.162, 0.0, 0.3), None);
        assert_eq!(FiveBar::new(-0.09, 0.162, 0.0, 0.17), None);
        assert_eq!(FiveBar::new(0.09, 0.162, -0.01, 0.17), None);
    }

    #[test]
    fn doggos_motors_follow_the_firmware() {
        let [leg, ..] = legs();
        let [a, b] = leg.motor_angles(LegPosition { swing: 0.3, extension: 0.1 });
        assert!((a - 0.2).abs() < 1e-6 && (b - 0.4).abs() < 1e-6);
    }

    #[test]
    fn targets_lead_back_to_the_leg_position() {
        let turned = JointConvention { sign: -1.0, standing: 0.9 };
        let straight = JointConvention { sign: 1.0, standing: -1.8 };
        let limits = LegLimits { swing: [-1.0, 1.0], extension: [-0.5, 0.25] };
        for (geometry, actuators) in legs()
            .into_iter()
            .flat_map(|leg| [(leg, Actuators::LegSpace), (leg, Actuators::Joints([turned, straight]))])
        {
            let leg = Leg { geometry, actuators, limits };
            let back = leg.position_at(leg.targets(LegPosition { swing: 0.3, extension: -0.1 }));
            assert!((back.swing - 0.3).abs() < 1e-4 && (back.extension + 0.1).abs() < 1e-3, "{leg:?}: {back:?}");
            // Where the motors are is beyond these limits, and stays there.
            let beyond = leg.geometry.motor_angles(LegPosition { swing: 1.2, extension: -0.1 });
            let there = leg.position_at(leg.targets_at(beyond));
            assert!((there.swing - 1.2).abs() < 1e-4 && (there.extension + 0.1).abs() < 1e-3, "{leg:?}: {there:?}");
        }
        assert_eq!(turned.joint_angle(0.25), 0.65);
        assert_eq!(straight.joint_angle(0.0), -1.8);
    }

    #[test]
    fn whatever_is_asked_of_a_leg_its_targets_are_numbers() {
        for geometry in legs().into_iter().chain([LegGeometry::Serial(SerialLeg::new(0.2, 0.1, false, 0.2).unwrap())]) {
            for i in -40..=40 {
                for j in -40..=40 {
                    let position = LegPosition { swing: i as f32 * 0.1, extension: j as f32 * 0.1 };
                    let angles = geometry.motor_angles(position);
                    let back = geometry.leg_position([position.swing, position.extension]);
                    let all = [angles[0], angles[1], back.swing, back.extension, geometry.length(position.extension)];
                    assert!(all.iter().all(|value| value.is_finite()), "{geometry:?} {position:?}: {all:?}");
                }
            }
        }
    }

    #[test]
    fn limits_clamp_and_replace_nan() {
        let limits = LegLimits { swing: [-1.0, 1.0], extension: [-0.5, 0.25] };
        let clamped = limits.clamp(LegPosition { swing: 3.0, extension: f32::NAN });
        assert_eq!(clamped, LegPosition { swing: 1.0, extension: 0.0 });
    }
}
