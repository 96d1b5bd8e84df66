//! The reward, eq. 6 of the paper: one function a term, each dimensionless.
//!
//! Lengths are divided by the standing leg length and energies by the work of lifting the robot by that length, so
//! that the same weights fit a robot of 0.2 kg and one of 50 kg. Positions are in the ground's frame.

/// Weights of the terms, all dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RewardWeights {
    /// Weight of moving forward; the paper's lambda_0.
    pub forward: f64,
    /// Weight of moving sideways; lambda_1.
    pub drift: f64,
    /// Weight of moving up or down; lambda_2.
    pub bounce: f64,
    /// Weight of the motors' work; lambda_3.
    pub energy: f64,
    /// Weight of turning; not in the paper, which has 0.
    pub turn: f64,
    /// Weight of a change of the action; not in the paper, which has 0.
    pub action_rate: f64,
}

/// What makes the terms dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RewardScale {
    /// Leg length in the standing pose [m].
    pub leg_length_m: f64,
    /// Mass times gravity times that length [J].
    pub lift_energy_j: f64,
}

/// What happened in one env step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Change of the body's position in the ground's frame, forward, left, up [m].
    pub displacement_in_ground: [f64; 3],
    /// Work of the motors, see [`mechanical_work_j`] [J].
    pub work_j: f64,
    /// Change of the heading [rad].
    pub turn_rad: f64,
    /// Sum of the squared changes of the action's components.
    pub squared_action_change: f64,
}

/// The reward's terms, weighted, so that their sum is the reward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RewardTerms {
    /// See [`forward_term`].
    pub forward: f64,
    /// See [`drift_term`].
    pub drift: f64,
    /// See [`bounce_term`].
    pub bounce: f64,
    /// See [`energy_term`].
    pub energy: f64,
    /// See [`turn_term`].
    pub turn: f64,
    /// See [`action_rate_term`].
    pub action_rate: f64,
}

impl RewardTerms {
    /// The reward of one env step.
    ///
    /// ```text
    /// R = forward + drift + bounce + energy + turn + action_rate
    /// ```
    ///
    /// Source: eq. 6 of the paper; the last two terms are ours.
    pub fn new(weights: &RewardWeights, scale: &RewardScale, motion: &Motion) -> Self {
        let [forward, left, up] = motion.displacement_in_ground.map(|length| length / scale.leg_length_m);
        Self {
            forward: forward_term(weights.forward, forward),
            drift: drift_term(weights.drift, left),
            bounce: bounce_term(weights.bounce, up),
            energy: energy_term(weights.energy, motion.work_j / scale.lift_energy_j),
            turn: turn_term(weights.turn, motion.turn_rad),
            action_rate: action_rate_term(weights.action_rate, motion.squared_action_change),
        }
    }

    /// The terms' sum.
    pub fn total(&self) -> f64 {
        self.forward + self.drift + self.bounce + self.energy + self.turn + self.action_rate
    }
}

/// Reward for moving forward by `dx` leg lengths.
///
/// ```text
/// w0 dx
/// ```
///
/// Source: eq. 6 of the paper, first term.
pub fn forward_term(weight: f64, dx: f64) -> f64 {
    weight * dx
}

/// Penalty for moving sideways by `dy` leg lengths.
///
/// ```text
/// -w1 |dy|
/// ```
///
/// Source: eq. 6 of the paper, second term. Deviation: the paper prints dy with its sign, which would reward drifting to one side.
pub fn drift_term(weight: f64, dy: f64) -> f64 {
    -weight * dy.abs()
}

/// Penalty for moving up or down by `dz` leg lengths against the ground.
///
/// ```text
/// -w2 |dz|
/// ```
///
/// Source: eq. 6 of the paper, third term. Deviation: the paper prints dz with its sign, which would reward sinking.
pub fn bounce_term(weight: f64, dz: f64) -> f64 {
    -weight * dz.abs()
}

/// Penalty for work, in units of lifting the robot by one leg length.
///
/// ```text
/// -w3 E,  E = sum_i |tau_i omega_i| dt / (m g l)
/// ```
///
/// Source: eq. 6 of the paper, fourth term. Deviation: absolute values and the time step, see [`mechanical_work_j`].
pub fn energy_term(weight: f64, work: f64) -> f64 {
    -weight * work
}

/// Penalty for turning.
///
/// ```text
/// -w5 |dpsi|
/// ```
///
/// dpsi -> `turn_rad` [rad]. A robot that has turned goes less far forward, but on a steep slope, where it is slow, that
/// costs it little.
///
/// Source: usual in the field as a penalty on the yaw rate (legged_gym); not in the paper, whose weight is 0.
pub fn turn_term(weight: f64, turn_rad: f64) -> f64 {
    -weight * turn_rad.abs()
}

/// Penalty for changing the action from one env step to the next.
///
/// ```text
/// -w4 sum_j (a_j - a'_j)^2
/// ```
///
/// Source: usual in the field (legged_gym, rsl_rl); not in the paper, whose weight is 0.
pub fn action_rate_term(weight: f64, squared_action_change: f64) -> f64 {
    -weight * squared_action_change
}

/// Mechanical work of the motors over `dt_s` [J]; braking counts as much as driving.
///
/// ```text
/// E = sum_i |tau_i omega_i| dt
/// ```
///
/// Source: the definition of E under eq. 6 of the paper. Deviation: the paper prints the signed product, by which a
/// robot that is pushed would earn energy.
pub fn mechanical_work_j(torques_nm: &[f64], velocities: &[f64], dt_s: f64) -> f64 {
    torques_nm.iter().zip(velocities).map(|(torque, velocity)| (torque * velocity).abs()).sum::<f64>() * dt_s
}

/// What an accident takes from the return: the reward that is added to the terminal step.
///
/// ```text
/// min(0, (weight - 1) return_so_far) - cost
/// ```
///
/// Source: the paper, section II.B: the sum of the rewards so far is multiplied by a weight in [0, 1]. Deviations: a
/// negative return stays as it is, because the product would reward falling; and a fixed cost, 0 in the paper, makes an
/// accident bad even where nothing was won before it.
pub fn accident_penalty(weight: f64, cost: f64, return_so_far: f64) -> f64 {
    ((weight - 1.0) * return_so_far).min(0.0) - cost
}

#[cfg(test)]
mod tests {
    use super::*;

    const WEIGHTS: RewardWeights =
        RewardWeights { forward: 1.0, drift: 0.5, bounce: 0.25, energy: 0.1, turn: 0.3, action_rate: 2.0 };
    const SCALE: RewardScale = RewardScale { leg_length_m: 0.2, lift_energy_j: 8.0 };

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    #[test]
    fn each_term_by_hand() {
        let motion = Motion {
            displacement_in_ground: [0.02, -0.004, 0.002],
            work_j: 0.4,
            turn_rad: -0.05,
            squared_action_change: 0.03,
        };
        let terms = RewardTerms::new(&WEIGHTS, &SCALE, &motion);
        assert!(close(terms.forward, 0.1)); // 0.02 / 0.2
        assert!(close(terms.drift, -0.01)); // 0.5 * 0.004 / 0.2
        assert!(close(terms.bounce, -0.0025)); // 0.25 * 0.002 / 0.2
        assert!(close(terms.energy, -0.005)); // 0.1 * 0.4 / 8
        assert!(close(terms.turn, -0.015));
        assert!(close(terms.action_rate, -0.06));
        assert!(close(terms.total(), 0.1 - 0.01 - 0.0025 - 0.005 - 0.015 - 0.06));
    }

    #[test]
    fn penalties_do_not_care_for_the_direction() {
        assert_eq!(drift_term(1.0, 0.3), drift_term(1.0, -0.3));
        assert_eq!(bounce_term(1.0, 0.3), bounce_term(1.0, -0.3));
        assert_eq!(turn_term(1.0, 0.3), turn_term(1.0, -0.3));
    }

    #[test]
    fn work_counts_braking() {
        // |2 * 3| + |-1 * 4| = 10 W for 0.01 s
        assert!(close(mechanical_work_j(&[2.0, -1.0], &[3.0, 4.0], 0.01), 0.1));
    }

    #[test]
    fn an_accident_takes_a_share_of_a_gain_and_never_of_a_loss() {
        assert!(close(accident_penalty(0.25, 0.0, 8.0), -6.0));
        assert_eq!(accident_penalty(0.25, 0.0, -8.0), 0.0);
        assert_eq!(accident_penalty(1.0, 0.0, 8.0), 0.0);
        assert!(close(accident_penalty(0.25, 2.0, 8.0), -8.0));
        assert_eq!(accident_penalty(0.25, 2.0, -8.0), -2.0);
    }
}
