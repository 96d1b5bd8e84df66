//! The motor model: torque-speed curve and current limit, applied outside the MJCF at every physics step.

/// What a motor can give at its joint, behind the gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Torque at the current limit [N m].
    pub max_torque_nm: f64,
    /// Torque at standstill that the supply voltage alone would allow [N m].
    pub stall_torque_nm: f64,
    /// Speed at which the back electromotive force equals the supply voltage [rad/s].
    pub no_load_speed_rad_per_s: f64,
}

impl Motor {
    /// The motor with this multiple of its torque, at the same no-load speed: another magnet or winding, not another supply.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            max_torque_nm: factor * self.max_torque_nm,
            stall_torque_nm: factor * self.stall_torque_nm,
            no_load_speed_rad_per_s: self.no_load_speed_rad_per_s,
        }
    }

    /// Least and greatest torque [N m] at joint speed `velocity` [rad/s].
    ///
    /// ```text
    /// high = min(tau_max,  tau_stall (1 - omega / omega_0)), at least 0
    /// low  = max(-tau_max, -tau_stall (1 + omega / omega_0)), at most 0
    /// ```
    ///
    /// Source: the linear torque-speed curve of a brushed or field-oriented motor at constant voltage.
    /// Deviation: a motor faster than its no-load speed gives no torque forward and does not brake by itself.
    #[inline]
    pub fn torque_range_nm(&self, velocity: f64) -> [f64; 2] {
        let ratio = velocity / self.no_load_speed_rad_per_s;
        let high = (self.stall_torque_nm * (1.0 - ratio)).clamp(0.0, self.max_torque_nm);
        let low = (-self.stall_torque_nm * (1.0 + ratio)).clamp(-self.max_torque_nm, 0.0);
        [low, high]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTOR: Motor = Motor { max_torque_nm: 4.0, stall_torque_nm: 10.0, no_load_speed_rad_per_s: 100.0 };

    #[test]
    fn the_curve_by_hand() {
        assert_eq!(MOTOR.torque_range_nm(0.0), [-4.0, 4.0]);
        // 10 (1 - 0.8) = 2 forward, limited to 4 backward
        let [low, high] = MOTOR.torque_range_nm(80.0);
        assert!((high - 2.0).abs() < 1e-12 && low == -4.0);
        let [low, high] = MOTOR.torque_range_nm(-80.0);
        assert!((low + 2.0).abs() < 1e-12 && high == 4.0);
        assert_eq!(MOTOR.torque_range_nm(150.0), [-4.0, 0.0]);
    }
}
