//! One control step, from sensors to actuator targets.

use crate::action::{ActionLaw, Modulation, component};
use crate::kinematics::{Leg, LegPosition};
use crate::mirror::Mirror;
use crate::network::Network;
use crate::normaliser::Normaliser;
use crate::observation::{ObservationBlock, Sensors, observation_len, observe};
use crate::phase::PhaseClock;
use crate::prior::Gait;

/// What stands between sensors and actuator targets, except for the policy: it never changes while the robot runs.
#[derive(Clone, Copy, Debug)]
pub struct Controller<'a> {
    legs: &'a [Leg],
    gait: Gait<'a>,
    law: ActionLaw,
    blocks: &'a [ObservationBlock],
}

/// A policy that is ready to run: its network and the normaliser of its observation.
#[derive(Clone, Copy, Debug)]
pub struct Policy<'a> {
    /// Frozen statistics of the observation.
    pub normaliser: Normaliser<'a>,
    /// From the normalised observation to the action.
    pub network: Network<'a>,
    /// In which the second half of the cycle is seen; none: it is seen as it is.
    pub mirror: Option<Mirror<'a>>,
}

impl Policy<'_> {
    /// The action for an observation, which is mirrored, if it is to be, and normalised in place.
    ///
    /// Where a sensor gives no number the action is 0, the middle of its range, so that one bad reading is forgotten with its
    /// step. [`Runtime`](crate::Runtime) does not let such readings come here.
    ///
    /// # Shapes
    /// - `observation`: `(O)`
    /// - `hidden`: `(2 H)`, see [`Network::workspace_len`]
    /// - `action`: `(A)`
    #[inline(always)]
    pub fn act(&self, observation: &mut [f32], hidden: &mut [f32], action: &mut [f32]) {
        let mirror = self.mirror.filter(|mirror| mirror.reflects(observation));
        if let Some(mirror) = &mirror {
            mirror.reflect_observation(observation);
        }
        self.normaliser.apply(observation);
        self.network.forward(observation, hidden, action);
        for component in action.iter_mut().filter(|component| component.is_nan()) {
            *component = 0.0;
        }
        if let Some(mirror) = &mirror {
            mirror.reflect_action(action);
        }
    }
}

/// Buffers that one control step writes; the caller owns them.
#[derive(Debug)]
pub struct Workspace<'a> {
    /// `(O)`
    pub observation: &'a mut [f32],
    /// `(2 H)`
    pub hidden: &'a mut [f32],
    /// `(A)` holds the previous action on entry and the new one on return.
    pub action: &'a mut [f32],
}

impl<'a> Controller<'a> {
    /// Puts a controller together; `None` unless the gait has a part for each leg.
    pub fn new(legs: &'a [Leg], gait: Gait<'a>, law: ActionLaw, blocks: &'a [ObservationBlock]) -> Option<Self> {
        (legs.len() == gait.legs.len()).then_some(Self { legs, gait, law, blocks })
    }

    /// The gait that is modulated.
    pub fn gait(&self) -> Gait<'a> {
        self.gait
    }

    /// The legs.
    pub fn legs(&self) -> &'a [Leg] {
        self.legs
    }

    /// What the policy observes.
    pub fn blocks(&self) -> &'a [ObservationBlock] {
        self.blocks
    }

    /// The action law.
    pub fn law(&self) -> ActionLaw {
        self.law
    }

    /// Number of motors, M, and of actuators: two a leg.
    pub fn num_motors(&self) -> usize {
        2 * self.legs.len()
    }

    /// Number of components of the action, A.
    pub fn num_actions(&self) -> usize {
        self.law.modulation.num_actions(self.legs.len())
    }

    /// Number of components of the observation, O.
    pub fn num_observations(&self) -> usize {
        observation_len(self.blocks, self.num_motors(), self.num_actions())
    }

    /// Writes the raw observation, `(O)`, see [`observe`].
    #[inline]
    pub fn observe(&self, sensors: &Sensors<'_>, clock: &PhaseClock, previous_action: &[f32], observation: &mut [f32]) {
        observe(self.blocks, sensors, clock.phase(), previous_action, observation);
    }

    /// Writes the actuator targets under `action` and moves the clock on by one control step.
    ///
    /// # Shapes
    /// - `action`: `(A)`, clamped to [-1, 1] here
    /// - `targets`: `(M)` [rad], two for each leg in the order of the legs
    #[inline]
    pub fn act(&self, action: &[f32], clock: &mut PhaseClock, control_dt_s: f32, targets: &mut [f32]) {
        let phase = clock.phase();
        for (i, ((leg, leg_gait), target)) in
            self.legs.iter().zip(self.gait.legs).zip(targets.chunks_exact_mut(2)).enumerate()
        {
            let position = match self.law.modulation {
                // One radian of motor angle for an action of 1, as eq. 4 has for amplitudes.
                Modulation::Direct => {
                    leg.geometry.leg_position([component(action, 2 * i), component(action, 2 * i + 1)])
                }
                Modulation::Amplitude | Modulation::LegAmplitude | Modulation::Modulate => {
                    leg_gait.position(phase, &self.law.leg_parameters(leg_gait, i, action))
                }
                Modulation::Residual => {
                    self.with_residual(leg, leg_gait.position(phase, &leg_gait.defaults), i, action)
                }
            };
            command(leg, position, target);
        }
        clock.advance(self.law.stride_frequency_hz(&self.gait, action), control_dt_s);
    }

    /// The position that leg number `index` is asked to have where the prior alone would have it at `prior`.
    #[inline]
    fn with_residual(&self, leg: &Leg, prior: LegPosition, index: usize, action: &[f32]) -> LegPosition {
        let targets = leg.targets(leg.limits.clamp(prior));
        let moved = self.law.residual(targets, index, action);
        // The way through joint angles and back rounds; where nothing is added the prior's bytes are kept.
        if moved == targets { prior } else { leg.position_at(moved) }
    }

    /// Writes the actuator targets of the standing pose, `(M)` [rad].
    #[inline]
    pub fn stand(&self, targets: &mut [f32]) {
        for (leg, target) in self.legs.iter().zip(targets.chunks_exact_mut(2)) {
            command(leg, LegPosition::default(), target);
        }
    }

    /// Writes the actuator targets at which the robot already is, `(M)` [rad], from its motor angles, `(M)` [rad].
    #[inline]
    pub fn stay(&self, motor_angles: &[f32], targets: &mut [f32]) {
        let pairs = motor_angles.chunks_exact(2).zip(targets.chunks_exact_mut(2));
        for (leg, (angles, target)) in self.legs.iter().zip(pairs) {
            target.copy_from_slice(&leg.targets_at([angles[0], angles[1]]));
        }
    }

    /// Writes the actuator targets of the prior alone, `(M)` [rad], and moves the clock on by one control step.
    #[inline]
    pub fn act_prior(&self, clock: &mut PhaseClock, control_dt_s: f32, targets: &mut [f32]) {
        for ((leg, leg_gait), target) in self.legs.iter().zip(self.gait.legs).zip(targets.chunks_exact_mut(2)) {
            command(leg, leg_gait.position(clock.phase(), &leg_gait.defaults), target);
        }
        clock.advance(self.gait.stride_frequency_hz, control_dt_s);
    }

    /// One control step on the robot: sensors in, actuator targets, `(M)` [rad], out.
    #[inline]
    pub fn step(
        &self,
        policy: &Policy<'_>,
        sensors: &Sensors<'_>,
        clock: &mut PhaseClock,
        control_dt_s: f32,
        workspace: &mut Workspace<'_>,
        targets: &mut [f32],
    ) {
        self.observe(sensors, clock, workspace.action, workspace.observation);
        policy.act(workspace.observation, workspace.hidden, workspace.action);
        self.act(workspace.action, clock, control_dt_s, targets);
    }
}

/// Limits a leg position and writes its two actuator targets.
#[inline]
fn command(leg: &Leg, position: LegPosition, target: &mut [f32]) {
    let values = leg.targets(leg.limits.clamp(position));
    for (to, from) in target.iter_mut().zip(values) {
        *to = from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::action::{ParameterRanges, Range};
    use crate::kinematics::{Actuators, FiveBar, JointConvention, LegGeometry, LegLimits};
    use crate::network::NetworkShape;
    use crate::prior::{LegGait, LegParameters, SineWave, Waveform};

    const UNIT: Range = Range { low: -1.0, high: 1.0 };
    const RANGES: ParameterRanges = ParameterRanges {
        frequency_factor: Range { low: 0.5, high: 2.0 },
        swing_amplitude: Range { low: 0.0, high: 1.0 },
        extension_amplitude: Range { low: 0.0, high: 1.0 },
        swing_offset: UNIT,
        extension_offset: UNIT,
    };

    fn leg() -> Leg {
        Leg {
            geometry: LegGeometry::FiveBar(FiveBar::new(0.09, 0.162, 0.0, 0.17).unwrap()),
            actuators: Actuators::LegSpace,
            limits: LegLimits { swing: [-1.2, 1.2], extension: [-0.5, 0.5] },
        }
    }

    /// A leg whose motors are commanded one by one, its limits closer than the gait goes.
    fn jointed_leg() -> Leg {
        let joints = [JointConvention { sign: -1.0, standing: 0.9 }, JointConvention { sign: 1.0, standing: 0.2 }];
        Leg {
            actuators: Actuators::Joints(joints),
            limits: LegLimits { swing: [-0.3, 0.3], extension: [-0.2, 0.4] },
            ..leg()
        }
    }

    fn legs_gait() -> [LegGait; 2] {
        let part = |phase_offset| LegGait {
            waveform: Waveform::Sine(SineWave { extension_phase: 0.75 }),
            phase_offset,
            defaults: LegParameters { swing_amplitude: 0.4, extension_amplitude: 0.45, ..LegParameters::default() },
        };
        [part(0.0), part(0.5)]
    }

    fn controller<'a>(
        legs: &'a [Leg],
        parts: &'a [LegGait],
        modulation: Modulation,
        authority: f32,
        blocks: &'a [ObservationBlock],
    ) -> Controller<'a> {
        let law = ActionLaw { modulation, authority, ranges: RANGES, residual_bound_rad: 0.2 };
        Controller::new(legs, Gait { stride_frequency_hz: 2.0, legs: parts }, law, blocks).unwrap()
    }

    #[test]
    fn authority_zero_is_the_prior_byte_for_byte_over_a_whole_walk() {
        let (legs, jointed, parts) = ([leg(); 2], [jointed_leg(); 2], legs_gait());
        let with_prior = Modulation::ALL.into_iter().filter(|&modulation| modulation != Modulation::Direct);
        for (modulation, legs) in with_prior.flat_map(|modulation| [(modulation, legs), (modulation, jointed)]) {
            let controller = controller(&legs, &parts, modulation, 0.0, &[]);
            let (mut with_policy, mut alone) = (PhaseClock::at(0.1), PhaseClock::at(0.1));
            for step in 0..500 {
                let action = [libm::sinf(step as f32 * 0.37); 17];
                let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
                controller.act(&action, &mut with_policy, 0.01, &mut a);
                controller.act_prior(&mut alone, 0.01, &mut b);
                assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits));
                assert_eq!(with_policy, alone);
            }
        }
    }

    #[test]
    fn direct_commands_motor_angles_within_the_leg_limits() {
        let (legs, parts) = ([leg(); 2], legs_gait());
        let controller = controller(&legs, &parts, Modulation::Direct, 1.0, &[]);
        let mut targets = [0.0; 4];
        controller.act(&[0.2, 0.6, -1.0, 1.0], &mut PhaseClock::default(), 0.01, &mut targets);
        // Motors 0.2 and 0.6: swing 0.4, extension 0.2. Motors -1 and 1: extension 1, limited to 0.5.
        for (actual, expected) in targets.iter().zip([0.4, 0.2, 0.0, 0.5]) {
            assert!((actual - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn a_residual_is_added_to_the_actuator_targets_within_the_leg_limits() {
        let parts = legs_gait();
        let act = |legs: &[Leg; 2], phase: f32, action: &[f32]| {
            let controller = controller(legs, &parts, Modulation::Residual, 0.5, &[]);
            let (mut targets, mut prior) = ([0.0; 4], [0.0; 4]);
            controller.act(action, &mut PhaseClock::at(phase), 0.01, &mut targets);
            controller.act_prior(&mut PhaseClock::at(phase), 0.01, &mut prior);
            (targets, prior)
        };
        // Half of 0.2 rad for an action of 1. At phase 0 the first leg swings through 0, and is shortest: -0.45 rad. Its
        // limit is -0.5 rad.
        let (targets, prior) = act(&[leg(); 2], 0.0, &[1.0, -1.0, -0.5, 0.0]);
        assert!((prior[0]).abs() < 1e-6 && (prior[1] + 0.45).abs() < 1e-6);
        for (actual, expected) in targets.iter().zip([0.1, -0.5, prior[2] - 0.05, prior[3]]) {
            assert!((actual - expected).abs() < 1e-6, "{targets:?} {prior:?}");
        }
        // Joint by joint, whichever way a joint turns.
        let wide = LegLimits { swing: [-1.2, 1.2], extension: [-0.5, 0.5] };
        let legs = [Leg { limits: wide, ..jointed_leg() }; 2];
        let (targets, prior) = act(&legs, 0.3, &[1.0, 0.0, 0.0, -0.5]);
        for (actual, expected) in targets.iter().zip([prior[0] + 0.1, prior[1], prior[2], prior[3] - 0.05]) {
            assert!((actual - expected).abs() < 1e-3, "{targets:?} {prior:?}");
        }
        // With the narrow limits the leg stays within them, whatever is added.
        let legs = [jointed_leg(); 2];
        for i in 0..100 {
            let phase = i as f32 / 100.0;
            let (targets, _) = act(&legs, phase, &[1.0, -1.0, -1.0, 1.0]);
            let position = legs[0].position_at([targets[0], targets[1]]);
            assert!(position.swing.abs() < 0.3 + 1e-3, "{phase}: {position:?}");
            assert!((-0.2 - 1e-3..0.4 + 1e-3).contains(&position.extension), "{phase}: {position:?}");
        }
    }

    #[test]
    fn a_step_runs_the_whole_chain() {
        let (legs, parts) = ([leg(); 2], legs_gait());
        let blocks = [ObservationBlock::MotorAngles, ObservationBlock::PreviousAction];
        let controller = controller(&legs, &parts, Modulation::Amplitude, 0.5, &blocks);
        let shape = NetworkShape { input: 6, hidden: 4, output: 2 };
        // All weights zero but the last biases: the action is tanh(0.5), tanh(-0.5) whatever the observation.
        let mut parameters = [0.0; 6 * 4 + 4 + 16 + 4 + 8 + 2];
        parameters[56] = 0.5;
        parameters[57] = -0.5;
        let policy = Policy {
            normaliser: Normaliser { mean: &[0.0; 6], inverse_std: &[1.0; 6] },
            network: Network::new(shape, &parameters).unwrap(),
            mirror: None,
        };
        let sensors = Sensors {
            motor_angles: &[0.1, 0.2, 0.3, 0.4],
            motor_velocities: &[0.0; 4],
            orientation: [0.0; 3],
            angular_velocity_in_body: [0.0; 3],
        };
        let (mut observation, mut hidden, mut action, mut targets) = ([0.0; 6], [0.0; 8], [0.9, -0.9], [0.0; 4]);
        let mut clock = PhaseClock::at(0.25);
        let mut workspace = Workspace { observation: &mut observation, hidden: &mut hidden, action: &mut action };
        controller.step(&policy, &sensors, &mut clock, 0.01, &mut workspace, &mut targets);
        assert_eq!(observation, [0.1, 0.2, 0.3, 0.4, 0.9, -0.9]);
        // swing = 0.5 tanh(0.5) + 0.5 * 0.4 = 0.4310586 at a quarter of the cycle, and its negative half a cycle later
        assert!((targets[0] - 0.431_058_6).abs() < 1e-6 && (targets[2] + 0.431_058_6).abs() < 1e-6);
        assert!((clock.phase() - 0.27).abs() < 1e-6);
    }

    #[test]
    fn a_bad_reading_is_forgotten_with_its_step() {
        let (legs, parts) = ([leg(); 2], legs_gait());
        let blocks = [ObservationBlock::MotorAngles, ObservationBlock::PreviousAction];
        let controller = controller(&legs, &parts, Modulation::Amplitude, 0.5, &blocks);
        let shape = NetworkShape { input: 6, hidden: 4, output: 2 };
        let parameters: [f32; 58] = core::array::from_fn(|i| (i % 7) as f32 * 0.1 - 0.3);
        let policy = Policy {
            normaliser: Normaliser { mean: &[0.0; 6], inverse_std: &[1.0; 6] },
            network: Network::new(shape, &parameters).unwrap(),
            mirror: None,
        };
        let (mut observation, mut hidden, mut action, mut targets) = ([0.0; 6], [0.0; 8], [0.3; 2], [0.0; 4]);
        let mut clock = PhaseClock::at(0.2);
        let mut step = |angle: f32, action: &mut [f32], targets: &mut [f32]| {
            let angles = [angle, 0.2, 0.3, 0.4];
            let sensors = Sensors {
                motor_angles: &angles,
                motor_velocities: &[0.0; 4],
                orientation: [0.0; 3],
                angular_velocity_in_body: [0.0; 3],
            };
            let mut workspace = Workspace { observation: &mut observation, hidden: &mut hidden, action };
            controller.step(&policy, &sensors, &mut clock, 0.01, &mut workspace, targets);
        };
        step(f32::NAN, &mut action, &mut targets);
        assert_eq!(action, [0.0; 2]);
        let mut expected = [0.0; 4];
        controller.act(&[0.0; 2], &mut PhaseClock::at(0.2), 0.01, &mut expected);
        assert_eq!(targets, expected);
        step(0.1, &mut action, &mut targets);
        assert!(action.iter().all(|value| value.is_finite() && *value != 0.0));
    }

    #[test]
    fn short_or_unreal_input_cannot_panic() {
        let (legs, parts) = ([leg(); 2], legs_gait());
        for modulation in Modulation::ALL {
            let controller = controller(&legs, &parts, modulation, 1.0, &ObservationBlock::ALL);
            let mut clock = PhaseClock::default();
            let mut targets = [0.0; 4];
            for action in [&[][..], &[f32::NAN; 17], &[f32::INFINITY; 3]] {
                controller.act(action, &mut clock, f32::NAN, &mut targets);
                assert!(targets.iter().all(|target| target.is_finite()), "{modulation:?} {action:?}");
            }
            controller.act(&[0.5; 17], &mut clock, 0.01, &mut targets[..3]);
            let sensors = Sensors {
                motor_angles: &[],
                motor_velocities: &[f32::NAN],
                orientation: [0.0; 3],
                angular_velocity_in_body: [0.0; 3],
            };
            controller.observe(&sensors, &clock, &[], &mut [0.0; 3]);
        }
        assert!(
            Controller::new(
                &legs,
                Gait { stride_frequency_hz: 2.0, legs: &parts[..1] },
                controller(&legs, &parts, Modulation::Amplitude, 0.5, &[]).law(),
                &[]
            )
            .is_none()
        );
    }
}
