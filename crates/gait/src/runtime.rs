//! What a robot does around its gait: it stands until told to walk, ramps in and out, and holds its pose when its sensors
//! go stale.

use crate::controller::{Controller, Policy, Workspace};
use crate::observation::Sensors;
use crate::phase::PhaseClock;

/// Times of a [`Runtime`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuntimeSettings {
    /// How long it takes from standing to the whole gait, and back [s].
    pub ramp_s: f32,
    /// Readings that are older are stale [s].
    pub sensor_timeout_s: f32,
}

impl RuntimeSettings {
    /// One cycle of a trot at 2 Hz to get going; sensors may miss four readings at 100 Hz.
    pub const DEFAULT: Self = Self { ramp_s: 0.5, sensor_timeout_s: 0.05 };
}

/// What the robot is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// It stands, or moves back to standing after it held a pose.
    #[default]
    Standing,
    /// It gets going.
    RampingIn,
    /// It walks its whole gait.
    Walking,
    /// It comes to a stand.
    RampingOut,
    /// Its sensors are stale: it keeps its last targets.
    Holding,
}

impl Mode {
    /// Every mode, in the order of the numbers that the C export gives them.
    pub const ALL: [Self; 5] = [Self::Standing, Self::RampingIn, Self::Walking, Self::RampingOut, Self::Holding];

    /// The mode's name in protocols.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standing => "standing",
            Self::RampingIn => "ramping-in",
            Self::Walking => "walking",
            Self::RampingOut => "ramping-out",
            Self::Holding => "holding",
        }
    }
}

/// The readings of one control step and how old they are.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// What the sensors said.
    pub sensors: Sensors<'a>,
    /// Time since then [s]; what is no number is stale.
    pub age_s: f32,
}

/// Memory of a [`Runtime`]; the caller owns it.
#[derive(Debug)]
pub struct Memory<'a> {
    /// Of the control step.
    pub workspace: Workspace<'a>,
    /// `(M)` the pose that the gait is blended with [rad].
    pub base: &'a mut [f32],
}

/// Walks a policy on a robot, from standing to standing.
#[derive(Clone, Copy, Debug)]
pub struct Runtime<'a> {
    controller: Controller<'a>,
    policy: Policy<'a>,
    settings: RuntimeSettings,
    clock: PhaseClock,
    /// How much of the gait there is in the targets, from 0 to 1.
    share: f32,
    is_to_walk: bool,
}

impl<'a> Runtime<'a> {
    /// A robot that stands; writes its pose.
    ///
    /// # Shapes
    /// - `targets`: `(M)` [rad]
    pub fn new(
        controller: Controller<'a>,
        policy: Policy<'a>,
        settings: RuntimeSettings,
        memory: &mut Memory<'_>,
        targets: &mut [f32],
    ) -> Self {
        controller.stand(targets);
        controller.stand(memory.base);
        memory.workspace.action.fill(0.0);
        Self { controller, policy, settings, clock: PhaseClock::default(), share: 0.0, is_to_walk: false }
    }

    /// Tells the robot to walk, or to come to a stand.
    pub fn walk(&mut self, is_to_walk: bool) {
        self.is_to_walk = is_to_walk;
    }

    /// The gait's clock.
    pub fn clock(&self) -> PhaseClock {
        self.clock
    }

    /// One control step.
    ///
    /// ```text
    /// targets = base + share (gait - base)
    /// ```
    ///
    /// The share rises to 1 and falls to 0 within the ramp's time, base moves to the standing pose at 1 rad in that time.
    /// A pose that is held becomes the base, so that targets never jump. A standing robot's clock and action are 0.
    ///
    /// # Shapes
    /// - `targets`: `(M)` [rad], those of the step before on entry
    ///
    /// Source: ours.
    pub fn step(&mut self, reading: &Reading<'_>, dt_s: f32, memory: &mut Memory<'_>, targets: &mut [f32]) -> Mode {
        let is_fresh = (0.0..=self.settings.sensor_timeout_s).contains(&reading.age_s);
        if !is_fresh {
            for (base, target) in memory.base.iter_mut().zip(&*targets) {
                *base = *target;
            }
            self.share = 0.0;
            memory.workspace.action.fill(0.0);
            return Mode::Holding;
        }
        // A time that is none is no step; and no step, however late, is more than the whole ramp.
        let dt_s = if dt_s >= 0.0 && dt_s.is_finite() { dt_s } else { 0.0 };
        let ramp = (dt_s / self.settings.ramp_s).min(1.0);
        self.share = if self.is_to_walk { (self.share + ramp).min(1.0) } else { (self.share - ramp).max(0.0) };
        self.controller.stand(targets);
        for (base, standing) in memory.base.iter_mut().zip(&*targets) {
            // `f32::clamp` would panic on a ramp of 0 / 0.
            *base += (*standing - *base).min(ramp).max(-ramp);
        }
        if self.share == 0.0 {
            self.clock = PhaseClock::default();
            memory.workspace.action.fill(0.0);
            for (target, base) in targets.iter_mut().zip(&*memory.base) {
                *target = *base;
            }
            return Mode::Standing;
        }
        self.controller.step(&self.policy, &reading.sensors, &mut self.clock, dt_s, &mut memory.workspace, targets);
        if self.share < 1.0 {
            for (target, base) in targets.iter_mut().zip(&*memory.base) {
                *target = *base + self.share * (*target - *base);
            }
            return if self.is_to_walk { Mode::RampingIn } else { Mode::RampingOut };
        }
        Mode::Walking
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::{ActionLaw, Modulation, ParameterRanges, Range};
    use crate::kinematics::{Actuators, FiveBar, JointConvention, Leg, LegGeometry, LegLimits};
    use crate::network::{Network, NetworkShape};
    use crate::normaliser::Normaliser;
    use crate::observation::ObservationBlock;
    use crate::prior::{Gait, LegGait, LegParameters, SineWave, Waveform};

    const RANGE: Range = Range { low: -1.0, high: 1.0 };
    const DT_S: f32 = 0.01;
    /// The standing angles of the two joints [rad].
    const STANDING: [f32; 2] = [0.25, -0.5];

    /// Runs `script` on a leg whose policy commands the prior; the script gets a step of (walk, age) to (mode, targets).
    fn run(script: impl FnOnce(&mut dyn FnMut(bool, f32) -> (Mode, [f32; 2]))) {
        let legs = [Leg {
            geometry: LegGeometry::FiveBar(FiveBar::new(0.09, 0.162, 0.0, 0.17).unwrap()),
            actuators: Actuators::Joints(STANDING.map(|standing| JointConvention { sign: 1.0, standing })),
            limits: LegLimits { swing: [-1.2, 1.2], extension: [-0.5, 0.5] },
        }];
        let parts = [LegGait {
            waveform: Waveform::Sine(SineWave { extension_phase: 0.75 }),
            phase_offset: 0.0,
            defaults: LegParameters { swing_amplitude: 0.4, extension_amplitude: 0.3, ..LegParameters::default() },
        }];
        let ranges = ParameterRanges {
            frequency_factor: Range { low: 0.5, high: 2.0 },
            swing_amplitude: RANGE,
            extension_amplitude: RANGE,
            swing_offset: RANGE,
            extension_offset: RANGE,
        };
        let law = ActionLaw { modulation: Modulation::Amplitude, authority: 0.0, ranges, residual_bound_rad: 0.0 };
        let gait = Gait { stride_frequency_hz: 2.0, legs: &parts };
        let controller = Controller::new(&legs, gait, law, &[ObservationBlock::MotorAngles]).unwrap();
        let shape = NetworkShape { input: 2, hidden: 1, output: 2 };
        let policy = Policy {
            normaliser: Normaliser { mean: &[0.0; 2], inverse_std: &[1.0; 2] },
            network: Network::new(shape, &[0.0; 9]).unwrap(),
            mirror: None,
        };
        let (mut observation, mut hidden, mut action, mut base) = ([0.0; 2], [0.0; 2], [0.0; 2], [0.0; 2]);
        let workspace = Workspace { observation: &mut observation, hidden: &mut hidden, action: &mut action };
        let mut memory = Memory { workspace, base: &mut base };
        let mut targets = [9.0; 2];
        let mut runtime = Runtime::new(controller, policy, RuntimeSettings::DEFAULT, &mut memory, &mut targets);
        assert_eq!(targets, STANDING);
        script(&mut |walk, age_s| {
            let sensors = Sensors {
                motor_angles: &[0.0; 2],
                motor_velocities: &[0.0; 2],
                orientation: [0.0; 3],
                angular_velocity_in_body: [0.0; 3],
            };
            runtime.walk(walk);
            let mode = runtime.step(&Reading { sensors, age_s }, DT_S, &mut memory, &mut targets);
            (mode, targets)
        });
    }

    /// What the prior commands `steps` steps after phase 0.
    fn prior(steps: u16) -> [f32; 2] {
        let t = core::f32::consts::TAU * 2.0 * DT_S * f32::from(steps);
        let (swing, extension) = (0.4 * libm::sinf(t), -0.3 * libm::cosf(t));
        [STANDING[0] + swing - extension, STANDING[1] + swing + extension]
    }

    #[test]
    fn it_stands_ramps_in_walks_and_comes_to_a_stand() {
        run(|step| {
            assert_eq!(step(false, 0.0), (Mode::Standing, STANDING));
            for i in 1..50 {
                let (mode, targets) = step(true, 0.0);
                assert_eq!(mode, Mode::RampingIn);
                for ((target, gait), standing) in targets.iter().zip(prior(i - 1)).zip(STANDING) {
                    let expected = standing + f32::from(i) * 0.02 * (gait - standing);
                    assert!((target - expected).abs() < 1e-4, "{i}: {target} {expected}");
                }
            }
            let mut last = [0.0; 2];
            // 50 times 0.02 may fall short of 1 by rounding.
            for i in 50..60 {
                let (mode, targets) = step(true, 0.0);
                assert!(mode == Mode::Walking || i == 50);
                last = targets;
            }
            for (target, expected) in last.iter().zip(prior(58)) {
                assert!((target - expected).abs() < 1e-4);
            }
            let ramp_out = (0..60).map(|_| step(false, 0.0)).filter(|(mode, _)| *mode == Mode::RampingOut).count();
            assert!((49..=50).contains(&ramp_out), "{ramp_out}");
            assert_eq!(step(false, 0.0), (Mode::Standing, STANDING));
            // The next walk begins where the first one did.
            step(true, 0.0);
            let (_, targets) = step(true, 0.0);
            for ((target, gait), standing) in targets.iter().zip(prior(1)).zip(STANDING) {
                assert!((target - (standing + 0.04 * (gait - standing))).abs() < 1e-5);
            }
        });
    }

    #[test]
    fn a_pose_is_held_while_readings_are_stale_and_no_target_ever_jumps() {
        run(|step| {
            let mut last = STANDING;
            // The gait's own fastest motion is 2 pi 2 Hz 0.5 rad = 6.3 rad/s; the ramp adds 1 rad in half a second.
            let mut walk = |walk: bool, age_s: f32| {
                let (mode, targets) = step(walk, age_s);
                for (now, before) in targets.iter().zip(last) {
                    assert!((now - before).abs() < 0.09, "{mode:?}: {before} to {now}");
                }
                last = targets;
                (mode, targets)
            };
            for _ in 0..77 {
                walk(true, 0.05);
            }
            let (mode, held) = walk(true, 0.051);
            assert_eq!(mode, Mode::Holding);
            for age_s in [1.0, f32::NAN, f32::INFINITY, -1.0, 1e9] {
                assert_eq!(walk(true, age_s), (Mode::Holding, held));
                assert_eq!(walk(false, age_s), (Mode::Holding, held));
            }
            assert_eq!(walk(true, 0.0).0, Mode::RampingIn);
            for _ in 0..20 {
                walk(true, 0.0);
            }
            walk(true, 1.0);
            for _ in 0..100 {
                walk(false, 0.0);
            }
            assert_eq!(walk(false, 0.0), (Mode::Standing, STANDING));
        });
    }
}
