//! What the policy observes: named blocks, put together by configuration.

/// What the robot's sensors say at one control step.
#[derive(Clone, Copy, Debug)]
pub struct Sensors<'a> {
    /// `(M)` angles of the motor joints [rad], zero in the standing pose.
    pub motor_angles: &'a [f32],
    /// `(M)` velocities of the motor joints [rad/s].
    pub motor_velocities: &'a [f32],
    /// Roll and pitch of the body against gravity, yaw against the direction in which it is to walk [rad] (intrinsic z-y-x).
    pub orientation: [f32; 3],
    /// Angular velocity of the body in its own frame [rad/s].
    pub angular_velocity_in_body: [f32; 3],
}

/// One named part of the observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObservationBlock {
    /// Angles of the motor joints, `(M)` [rad]; all that the paper observes.
    MotorAngles,
    /// Velocities of the motor joints, `(M)` [rad/s].
    MotorVelocities,
    /// Roll, pitch, yaw, `(3)` [rad].
    Orientation,
    /// Angular velocity in the body frame, `(3)` [rad/s].
    AngularVelocity,
    /// Sine and cosine of the gait's phase, `(2)`.
    Phase,
    /// The action of the control step before, `(A)`, clamped to [-1, 1].
    PreviousAction,
}

impl ObservationBlock {
    /// Every block, in the order in which documents list them.
    pub const ALL: [Self; 6] = [
        Self::MotorAngles,
        Self::MotorVelocities,
        Self::Orientation,
        Self::AngularVelocity,
        Self::Phase,
        Self::PreviousAction,
    ];

    /// The block's name in configurations and policy files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::MotorAngles => "motor_angles",
            Self::MotorVelocities => "motor_velocities",
            Self::Orientation => "orientation",
            Self::AngularVelocity => "angular_velocity",
            Self::Phase => "phase",
            Self::PreviousAction => "previous_action",
        }
    }

    /// The block of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|block| block.name() == name)
    }

    /// Number of components for a robot of `num_motors` motors and a policy of `num_actions` outputs.
    pub const fn len(self, num_motors: usize, num_actions: usize) -> usize {
        match self {
            Self::MotorAngles | Self::MotorVelocities => num_motors,
            Self::Orientation | Self::AngularVelocity => 3,
            Self::Phase => 2,
            Self::PreviousAction => num_actions,
        }
    }
}

/// Number of components of the whole observation, O.
pub fn observation_len(blocks: &[ObservationBlock], num_motors: usize, num_actions: usize) -> usize {
    blocks.iter().map(|block| block.len(num_motors, num_actions)).sum()
}

/// Writes the blocks one after the other.
///
/// Slices of other lengths than these end the observation early; nothing panics.
///
/// # Shapes
/// - `phase`: gait phase [cycles]
/// - `previous_action`: `(A)`
/// - `observation`: `(O)`
#[inline]
pub fn observe(
    blocks: &[ObservationBlock],
    sensors: &Sensors<'_>,
    phase: f32,
    previous_action: &[f32],
    observation: &mut [f32],
) {
    let mut rest = observation;
    for block in blocks {
        rest = match block {
            ObservationBlock::MotorAngles => append(rest, sensors.motor_angles),
            ObservationBlock::MotorVelocities => append(rest, sensors.motor_velocities),
            ObservationBlock::Orientation => append(rest, &sensors.orientation),
            ObservationBlock::AngularVelocity => append(rest, &sensors.angular_velocity_in_body),
            ObservationBlock::Phase => {
                let angle = core::f32::consts::TAU * phase;
                append(rest, &[libm::sinf(angle), libm::cosf(angle)])
            }
            ObservationBlock::PreviousAction => append(rest, previous_action),
        };
    }
}

/// Copies `values` to the front of `target` and returns what is left of it.
#[inline]
fn append<'a>(target: &'a mut [f32], values: &[f32]) -> &'a mut [f32] {
    match target.split_at_mut_checked(values.len()) {
        Some((front, rest)) => {
            for (to, from) in front.iter_mut().zip(values) {
                *to = *from;
            }
            rest
        }
        None => &mut [],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSORS: Sensors<'static> = Sensors {
        motor_angles: &[0.1, 0.2],
        motor_velocities: &[1.0, 2.0],
        orientation: [0.01, 0.02, 0.03],
        angular_velocity_in_body: [4.0, 5.0, 6.0],
    };

    #[test]
    fn blocks_follow_the_order_of_the_configuration() {
        let blocks = [ObservationBlock::Phase, ObservationBlock::MotorAngles, ObservationBlock::PreviousAction];
        let mut observation = [9.0; 5];
        assert_eq!(observation_len(&blocks, 2, 1), 5);
        observe(&blocks, &SENSORS, 0.25, &[-0.5], &mut observation);
        assert_eq!(observation[0], 1.0);
        assert!(observation[1].abs() < 1e-6);
        assert_eq!(observation[2..], [0.1, 0.2, -0.5]);
    }

    #[test]
    fn every_block_fills_exactly_its_length() {
        for block in ObservationBlock::ALL {
            let mut observation = [f32::NAN; 8];
            observe(&[block], &SENSORS, 0.1, &[0.5, 0.6, 0.7, 0.8], &mut observation);
            let len = block.len(2, 4);
            assert!(observation[..len].iter().all(|value| value.is_finite()), "{block:?}");
            assert!(observation[len..].iter().all(|value| value.is_nan()), "{block:?}");
            assert_eq!(ObservationBlock::from_name(block.name()), Some(block));
        }
        assert_eq!(ObservationBlock::from_name("motor_angle"), None);
    }
}
