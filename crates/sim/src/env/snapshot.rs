//! What figures and replays show of a robot: where its links are, what it touches, what its motors do.

use canter_gait::LegPosition;

use super::Env;

/// A robot at one moment. Positions are in the ground's frame: forward, left, up [m].
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The body.
    pub position: [f64; 3],
    /// Roll, pitch and yaw of the body against the ground [rad].
    pub orientation_rad: [f64; 3],
    /// `(L)` the legs.
    pub legs: Vec<LegSnapshot>,
    /// Contacts of the ground with anything but feet.
    pub num_body_contacts: usize,
    /// `(M)` torques of the motors as of the last physics step [N m].
    pub torques_nm: Vec<f64>,
    /// `(M)` velocities of the motor joints [rad/s].
    pub motor_velocities_rad_per_s: Vec<f64>,
}

/// One leg at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegSnapshot {
    /// The hip: the anchor of the leg's first motor joint, or the middle between those of both where both are at the hip.
    pub hip: [f64; 3],
    /// The anchors of the two passive joints, in the order of the motors.
    pub knees: [[f64; 3]; 2],
    /// The foot's centre.
    pub foot: [f64; 3],
    /// Whether the foot touches the ground.
    pub has_contact: bool,
    /// What the motors were asked for in the last step.
    pub commanded: LegPosition,
    /// Where the leg is.
    pub actual: LegPosition,
}

impl Env {
    /// The robot as it is now, after a reset or a step.
    ///
    /// After a step MuJoCo's positions of bodies, joints and geoms, and its contacts, still belong to the state before
    /// the last physics step. They are computed anew here, so that everything but the torques belongs to the same moment
    /// as [`position_in_ground`](Self::position_in_ground). The next step computes them itself: it does not depend on
    /// whether somebody looked. Torques act *during* a physics step; here they are those of the last one.
    pub fn snapshot(&mut self) -> Snapshot {
        self.simulation.update_positions();
        self.simulation.update_contacts();
        let robot = &self.task.robot;
        let mut touches = vec![false; robot.legs.len()];
        let num_body_contacts = self.ground_contacts(&mut touches);
        let joints = self.simulation.joint_positions_in_world();
        let geoms = self.simulation.geom_positions_in_world();
        let legs = robot.leg_addresses.iter().zip(touches).zip(self.leg_positions());
        let legs = legs.map(|((address, has_contact), (commanded, actual))| LegSnapshot {
            hip: middle(address.motor_joints.map(|joint| joints[joint]), address.knees.is_some()),
            knees: address.knee_joints().map(|joint| joints[joint]),
            foot: geoms[address.foot],
            has_contact,
            commanded,
            actual,
        });
        Snapshot {
            position: self.position_in_ground(),
            orientation_rad: self.orientation_in_ground(),
            legs: legs.collect(),
            num_body_contacts,
            torques_nm: self.buffers.torques[..2 * robot.legs.len()].to_vec(),
            motor_velocities_rad_per_s: self.actual.velocities.iter().map(|&value| f64::from(value)).collect(),
        }
    }
}

/// The middle between the anchors of a leg's motors if both are at the hip, else the first.
fn middle([first, second]: [[f64; 3]; 2], both_at_hip: bool) -> [f64; 3] {
    // Equal anchors stay what they are to the last bit.
    if both_at_hip { std::array::from_fn(|axis| 0.5 * (first[axis] + second[axis])) } else { first }
}
