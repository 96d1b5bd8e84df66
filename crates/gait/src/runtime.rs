//! What a robot does around its gait: it rises from where it is, stands until told to walk, ramps in and out, and holds its
//! pose when its sensors go stale.

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
    /// One cycle of a trot at 2 Hz to get going; sensors may miss four readings.
    pub fn new(control_dt_s: f32) -> Self {
        Self { ramp_s: 0.5, sensor_timeout_s: 5.0 * control_dt_s }
    }
}

/// A whole turn away from standing is no pose of a leg [rad].
const MAX_MOTOR_ANGLE_RAD: f32 = core::f32::consts::TAU;

/// What the robot is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// No reading has come yet: there are no targets, nothing must be sent to the actuators.
    #[default]
    Waiting,
    /// It moves to its standing pose, from where it was found or was held.
    Rising,
    /// It stands.
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
    pub const ALL: [Self; 7] =
        [Self::Waiting, Self::Rising, Self::Standing, Self::RampingIn, Self::Walking, Self::RampingOut, Self::Holding];

    /// The mode's name in protocols.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Rising => "rising",
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
    /// What the sensors said. It is stale too where a motor angle is beyond a whole turn, or what the policy observes is not
    /// finite.
    pub sensors: Sensors<'a>,
    /// Time since then [s]; what is no number is stale.
    pub age_s: f32,
}

/// Memory of a [`Runtime`]; the caller owns it.
#[derive(Debug)]
pub struct Memory<'a> {
    /// Of the control step.
    pub workspace: Workspace<'a>,
    /// `(M)` the targets of the step before [rad].
    pub last: &'a mut [f32],
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
    /// Whether a reading has come, and with it the first targets.
    has_begun: bool,
}

impl<'a> Runtime<'a> {
    /// A robot that waits for its first reading.
    pub fn new(controller: Controller<'a>, policy: Policy<'a>, settings: RuntimeSettings) -> Self {
        let clock = PhaseClock::default();
        Self { controller, policy, settings, clock, share: 0.0, is_to_walk: false, has_begun: false }
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
    /// targets = standing + share (gait - standing)
    /// ```
    ///
    /// The first targets are where the robot is. From there, and from a pose that was held, they move to the standing pose at
    /// 1 rad in the ramp's time. Only then the share rises, to 1 within that time; it falls to 0 as slowly. So targets never
    /// jump. Every walk begins with a clock and an action of 0.
    ///
    /// A step that lasts longer than a reading may be old counts as one that long, so that a late one is no leap of the gait.
    ///
    /// # Shapes
    /// - `targets`: `(M)` [rad], untouched while the robot waits
    ///
    /// Source: ours.
    pub fn step(&mut self, reading: &Reading<'_>, dt_s: f32, memory: &mut Memory<'_>, targets: &mut [f32]) -> Mode {
        if self.share == 0.0 {
            self.clock = PhaseClock::default();
            memory.workspace.action.fill(0.0);
        }
        if !self.is_usable(reading, memory) {
            if !self.has_begun {
                return Mode::Waiting;
            }
            self.share = 0.0;
            copy(memory.last, targets);
            return Mode::Holding;
        }
        if !self.has_begun {
            self.controller.stay(reading.sensors.motor_angles, memory.last);
            self.has_begun = true;
        }
        // What is no time is no step. `f32::clamp` is not for what may be no number.
        let dt_s = if dt_s > 0.0 { dt_s.min(self.settings.sensor_timeout_s) } else { 0.0 };
        let mode = self.advance(dt_s, memory, targets);
        copy(targets, memory.last);
        mode
    }

    /// Whether a reading is fresh and made of numbers; leaves the observation in memory.
    fn is_usable(&self, reading: &Reading<'_>, memory: &mut Memory<'_>) -> bool {
        let Workspace { observation, action, .. } = &mut memory.workspace;
        self.controller.observe(&reading.sensors, &self.clock, action, observation);
        (0.0..=self.settings.sensor_timeout_s).contains(&reading.age_s)
            && observation.iter().all(|value| value.is_finite())
            && reading.sensors.motor_angles.iter().all(|angle| angle.abs() <= MAX_MOTOR_ANGLE_RAD)
    }

    /// A step with a good reading, of which the observation is in memory.
    fn advance(&mut self, dt_s: f32, memory: &mut Memory<'_>, targets: &mut [f32]) -> Mode {
        let ramp = dt_s / self.settings.ramp_s;
        self.controller.stand(targets);
        if self.share == 0.0 {
            let mut stands = true;
            for (target, last) in targets.iter_mut().zip(&*memory.last) {
                let way = *target - *last;
                if way.abs() > ramp {
                    *target = *last + if way > 0.0 { ramp } else { -ramp };
                    stands = false;
                }
            }
            if !stands {
                return Mode::Rising;
            }
        }
        self.share = if self.is_to_walk { (self.share + ramp).min(1.0) } else { (self.share - ramp).max(0.0) };
        if self.share == 0.0 {
            return Mode::Standing;
        }
        copy(targets, memory.last);
        let Workspace { observation, hidden, action } = &mut memory.workspace;
        self.policy.act(observation, hidden, action);
        self.controller.act(action, &mut self.clock, dt_s, targets);
        if self.share < 1.0 {
            for (target, standing) in targets.iter_mut().zip(&*memory.last) {
                *target = *standing + self.share * (*target - *standing);
            }
            return if self.is_to_walk { Mode::RampingIn } else { Mode::RampingOut };
        }
        Mode::Walking
    }
}

/// As `copy_from_slice`, which panics where lengths differ.
fn copy(from: &[f32], to: &mut [f32]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
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

    /// Where the motors are [rad].
    const LYING: [f32; 2] = [0.4, -0.3];

    /// What goes into one step.
    #[derive(Clone, Copy)]
    struct In {
        walk: bool,
        age_s: f32,
        angles: [f32; 2],
        dt_s: f32,
    }

    const STAND: In = In { walk: false, age_s: 0.0, angles: LYING, dt_s: DT_S };
    const WALK: In = In { walk: true, ..STAND };

    /// Runs `script` on a leg whose policy commands the prior; the script gets a step.
    fn run(script: impl FnOnce(&mut dyn FnMut(In) -> (Mode, [f32; 2]))) {
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
        let blocks = [ObservationBlock::MotorAngles, ObservationBlock::Orientation];
        let controller = Controller::new(&legs, gait, law, &blocks).unwrap();
        let shape = NetworkShape { input: 5, hidden: 1, output: 2 };
        let policy = Policy {
            normaliser: Normaliser { mean: &[0.0; 5], inverse_std: &[1.0; 5] },
            network: Network::new(shape, &[0.0; 12]).unwrap(),
            mirror: None,
        };
        let (mut observation, mut hidden, mut action, mut last) = ([0.0; 5], [0.0; 2], [0.0; 2], [0.0; 2]);
        let workspace = Workspace { observation: &mut observation, hidden: &mut hidden, action: &mut action };
        let mut memory = Memory { workspace, last: &mut last };
        let mut targets = [9.0; 2];
        let mut runtime = Runtime::new(controller, policy, RuntimeSettings::new(DT_S));
        script(&mut |step| {
            let sensors = Sensors {
                motor_angles: &step.angles,
                // Nothing that this policy looks at.
                motor_velocities: &[f32::NAN; 2],
                orientation: [0.0; 3],
                angular_velocity_in_body: [f32::NAN; 3],
            };
            runtime.walk(step.walk);
            let reading = Reading { sensors, age_s: step.age_s };
            let mode = runtime.step(&reading, step.dt_s, &mut memory, &mut targets);
            (mode, targets)
        });
    }

    /// Steps until the robot stands.
    fn rise(step: &mut dyn FnMut(In) -> (Mode, [f32; 2])) -> usize {
        (1..100).find(|_| step(STAND) == (Mode::Standing, STANDING)).unwrap()
    }

    /// What the prior commands `steps` steps after phase 0.
    fn prior(steps: u16) -> [f32; 2] {
        let t = core::f32::consts::TAU * 2.0 * DT_S * f32::from(steps);
        let (swing, extension) = (0.4 * libm::sinf(t), -0.3 * libm::cosf(t));
        [STANDING[0] + swing - extension, STANDING[1] + swing + extension]
    }

    #[test]
    fn it_waits_for_readings_and_rises_from_where_it_is() {
        run(|step| {
            for age_s in [f32::INFINITY, f32::NAN, 1.0] {
                assert_eq!(step(In { age_s, ..WALK }), (Mode::Waiting, [9.0; 2]));
            }
            assert_eq!(step(In { angles: [0.4, f32::NAN], ..WALK }), (Mode::Waiting, [9.0; 2]));
            // The joints are at 0.65 and -0.8 rad, 0.4 and 0.3 rad from standing; 2 rad/s are 0.02 rad a step.
            for i in 1..20_u8 {
                let (mode, targets) = step(WALK);
                assert_eq!(mode, Mode::Rising);
                let expected = [0.65 - 0.02 * f32::from(i), (-0.8 + 0.02 * f32::from(i)).min(-0.5)];
                for (target, expected) in targets.iter().zip(expected) {
                    assert!((target - expected).abs() < 1e-5, "{i}: {targets:?}");
                }
            }
            // 20 times 0.02 may fall short of 0.4 by rounding.
            assert!([step(WALK).0, step(WALK).0].contains(&Mode::RampingIn));
        });
    }

    #[test]
    fn it_stands_ramps_in_walks_and_comes_to_a_stand() {
        run(|step| {
            rise(step);
            for i in 1..50 {
                let (mode, targets) = step(WALK);
                assert_eq!(mode, Mode::RampingIn);
                for ((target, gait), standing) in targets.iter().zip(prior(i - 1)).zip(STANDING) {
                    let expected = standing + f32::from(i) * 0.02 * (gait - standing);
                    assert!((target - expected).abs() < 1e-4, "{i}: {target} {expected}");
                }
            }
            let mut last = [0.0; 2];
            // 50 times 0.02 may fall short of 1 by rounding.
            for i in 50..60 {
                let (mode, targets) = step(WALK);
                assert!(mode == Mode::Walking || i == 50);
                last = targets;
            }
            for (target, expected) in last.iter().zip(prior(58)) {
                assert!((target - expected).abs() < 1e-4);
            }
            let ramp_out = (0..60).map(|_| step(STAND)).filter(|(mode, _)| *mode == Mode::RampingOut).count();
            assert!((49..=50).contains(&ramp_out), "{ramp_out}");
            assert_eq!(step(STAND), (Mode::Standing, STANDING));
            // The next walk begins where the first one did.
            step(WALK);
            let (_, targets) = step(WALK);
            for ((target, gait), standing) in targets.iter().zip(prior(1)).zip(STANDING) {
                assert!((target - (standing + 0.04 * (gait - standing))).abs() < 1e-5);
            }
        });
    }

    /// `step`, which fails if a target jumps.
    fn smooth(step: &mut dyn FnMut(In) -> (Mode, [f32; 2]), most_rad: f32) -> impl FnMut(In) -> (Mode, [f32; 2]) {
        rise(step);
        let mut last = STANDING;
        move |input| {
            let (mode, targets) = step(input);
            for (now, before) in targets.iter().zip(last) {
                assert!((now - before).abs() < most_rad, "{mode:?}: {before} to {now}");
            }
            last = targets;
            (mode, targets)
        }
    }

    #[test]
    fn a_pose_is_held_while_readings_are_stale_and_no_target_ever_jumps() {
        run(|step| {
            // The gait's own fastest motion is 2 pi 2 Hz 0.5 rad = 6.3 rad/s; the ramp adds 1 rad in half a second.
            let mut walk = smooth(step, 0.09);
            for _ in 0..77 {
                walk(In { age_s: 0.045, ..WALK });
            }
            let (mode, held) = walk(In { age_s: 0.051, ..WALK });
            assert_eq!(mode, Mode::Holding);
            for age_s in [1.0, f32::NAN, f32::INFINITY, -1.0, 1e9] {
                assert_eq!(walk(In { age_s, ..WALK }), (Mode::Holding, held));
                assert_eq!(walk(In { age_s, ..STAND }), (Mode::Holding, held));
            }
            // A fresh reading that is none is as stale.
            for angle in [f32::NAN, f32::INFINITY, 6.3, -1e9] {
                assert_eq!(walk(In { angles: [0.1, angle], ..WALK }), (Mode::Holding, held));
            }
            assert_eq!(walk(WALK).0, Mode::Rising);
            while walk(WALK).0 == Mode::Rising {}
            for _ in 0..30 {
                walk(WALK);
            }
            walk(In { age_s: 1.0, ..WALK });
            for _ in 0..100 {
                walk(STAND);
            }
            assert_eq!(walk(STAND), (Mode::Standing, STANDING));
        });
    }

    #[test]
    fn a_late_step_is_no_leap() {
        run(|step| {
            // Five steps' worth: 0.05 s at 6.3 rad/s, and a tenth of the ramp.
            let mut walk = smooth(step, 0.45);
            // 0.2 s are 0.4 cycles.
            for dt_s in [DT_S, 30.2, f32::INFINITY, f32::NAN, -1.0, DT_S].repeat(20) {
                walk(In { dt_s, ..WALK });
            }
        });
    }
}
