//! What `robot.toml` says.

use canter_gait::LegGeometry;
use canter_gait::prior::{LegParameters, SineWave, Stepping, SteppingParameters, Waveform};

use crate::settings::above;
use crate::{choices, settings, tagged};

settings! {
    /// What canter must know of a robot beside its MuJoCo model.
    pub struct RobotSettings {
        /// Short name; policies carry it and run on this robot only.
        pub name: String,
        /// One line for `canter robots`.
        pub description: String,
        /// The MuJoCo model (MJCF or URDF), a file beside this one. Its reference configuration is the standing pose.
        pub model: String,
        /// The floating body whose pose is the robot's.
        pub body: String,
        /// The ground geom.
        pub floor: String,
        /// Leg length in the standing pose, from hip axis to foot centre [m]. Scales the reward.
        pub stance_height_m: f64 in above(0.0),
        /// Control steps between a command and its effect: the bus and the control loop of the real robot.
        pub command_delay_steps: u32 in 0..=10,
        /// What every motor can give at its joint.
        pub motor: MotorSettings,
        /// What counts as an accident and what commands may ask for.
        pub limits: LimitSettings,
        /// The legs, in the order in which gaits and policies count them: front left, back left, back right, front right.
        pub legs: Vec<LegSettings>,
        /// The gaits that its owner already has.
        pub gaits: Vec<GaitSettings>,
    }
}

settings! {
    /// Torque-speed curve and current limit, behind the gear.
    pub struct MotorSettings {
        /// Torque at the current limit [N m].
        pub max_torque_nm: f64 in above(0.0),
        /// Torque at standstill that the supply voltage alone would allow [N m].
        pub stall_torque_nm: f64 in above(0.0),
        /// Joint speed at which the motor gives no torque any more [rad/s].
        pub no_load_speed_rad_per_s: f64 in above(0.0),
    }
}

settings! {
    /// Limits of poses and commands.
    pub struct LimitSettings {
        /// The robot has fallen when its body's centre is lower than this above the ground below it [m].
        pub min_height_m: f64 in 0.0..=10.0,
        /// The robot has rolled over when its up axis leans further than this from the ground's normal [deg].
        pub max_tilt_deg: f64 in 1.0..=179.0,
        /// A leg is stuck when its commanded and actual positions differ by more than this [rad] ...
        pub stuck_error_rad: f64 in above(0.0),
        /// ... for this long without a break [s].
        pub stuck_time_s: f64 in above(0.0),
        /// Least and greatest commanded swing angle [rad].
        pub swing_rad: Vec<f64> in -4.0..=4.0,
        /// Least and greatest commanded extension [rad].
        pub extension_rad: Vec<f64> in -4.0..=4.0,
    }
}

tagged! {
    /// How a leg is built.
    pub enum LegSettings {
        /// Two motors on one hip axis, two upper and two lower links that meet at the foot.
        FiveBar(FiveBarSettings) = "five-bar",
    }
}

impl LegSettings {
    /// Name of the leg.
    pub fn name(&self) -> &str {
        let Self::FiveBar(leg) = self;
        &leg.name
    }
}

settings! {
    /// A coaxial five-bar leg.
    pub struct FiveBarSettings {
        /// Name of the leg.
        pub name: String,
        /// Geom of the foot.
        pub foot: String,
        /// Length of each upper link [m].
        pub upper_link_m: f64 in above(0.0),
        /// Length of each lower link [m].
        pub lower_link_m: f64 in above(0.0),
        /// The two motor joints, zero in the standing pose, positive when the link swings forward; the link that points forward first.
        pub motors: Vec<String>,
        /// The two passive joints between upper and lower links, in the order of the motors.
        pub knees: Vec<String>,
        /// The two position actuators.
        pub actuators: Vec<String>,
        /// What the actuators are commanded in.
        pub actuated: Actuated,
    }
}

choices! {
    /// The space of a leg's actuator targets.
    pub enum Actuated {
        /// Swing and extension, in this order: tendons that couple the motors.
        LegSpace = "leg-space",
        /// The angles of the two motors.
        Motors = "motors",
    }
}

choices! {
    /// Which legs move together.
    pub enum Footfall {
        /// Diagonal pairs.
        Trot = "trot",
        /// One leg after the other.
        Walk = "walk",
        /// Left and right pairs.
        Pace = "pace",
        /// Front and back pairs.
        Bound = "bound",
        /// All legs together.
        Pronk = "pronk",
    }
}

tagged! {
    /// A hand-made gait.
    pub enum GaitSettings {
        /// Sines for swing and extension (eq. 4 of the paper).
        Sine(SineSettings) = "sine",
        /// The foot trajectory of Doggo's firmware.
        Stepping(SteppingSettings) = "stepping",
    }
}

settings! {
    /// A gait of two sines a leg.
    pub struct SineSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Which legs move together.
        pub footfall: Footfall,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// Amplitude of the swing angle [rad].
        pub swing_amplitude_rad: f64 in 0.0..=1.5,
        /// Amplitude of the extension [rad].
        pub extension_amplitude_rad: f64 in 0.0..=1.5,
        /// How far the extension's sine is ahead of the swing's [cycles]: 0.5 is eq. 4's pi, 0.75 makes the leg
        /// shortest in the middle of its forward swing.
        pub extension_phase_cycles: f64 in 0.0..=1.0,
    }
}

settings! {
    /// The firmware's trajectory.
    pub struct SteppingSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Which legs move together.
        pub footfall: Footfall,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// Depth of the foot below the hip between flight and stance [m].
        pub stance_height_m: f64 in above(0.0),
        /// How far the foot pushes below that in the middle of stance [m].
        pub down_amplitude_m: f64 in 0.0..=10.0,
        /// How far the foot lifts above that in the middle of flight [m].
        pub up_amplitude_m: f64 in 0.0..=10.0,
        /// Share of the cycle that the foot is in the air.
        pub flight_fraction: f64 in 0.05..=0.95,
        /// Way of the foot between touchdown and lift-off [m].
        pub step_length_m: f64 in above(0.0),
    }
}

impl GaitSettings {
    /// Name of the gait.
    pub fn name(&self) -> &str {
        match self {
            Self::Sine(sine) => &sine.name,
            Self::Stepping(stepping) => &stepping.name,
        }
    }

    /// Whether its speed counts as a default speed.
    pub fn is_default(&self) -> bool {
        match self {
            Self::Sine(sine) => sine.default,
            Self::Stepping(stepping) => stepping.default,
        }
    }

    /// Cycles per second [1/s].
    pub fn stride_frequency_hz(&self) -> f64 {
        match self {
            Self::Sine(sine) => sine.stride_frequency_hz,
            Self::Stepping(stepping) => stepping.stride_frequency_hz,
        }
    }

    pub(super) fn footfall(&self) -> Footfall {
        match self {
            Self::Sine(sine) => sine.footfall,
            Self::Stepping(stepping) => stepping.footfall,
        }
    }

    /// Shape and parameters for a leg; `None` where the leg cannot reach the trajectory.
    pub(super) fn waveform(&self, geometry: LegGeometry) -> Option<(Waveform, LegParameters)> {
        match self {
            Self::Sine(sine) => {
                let wave = SineWave { extension_phase: sine.extension_phase_cycles as f32 };
                let defaults = LegParameters {
                    swing_amplitude: sine.swing_amplitude_rad as f32,
                    extension_amplitude: sine.extension_amplitude_rad as f32,
                    ..LegParameters::default()
                };
                Some((Waveform::Sine(wave), defaults))
            }
            Self::Stepping(settings) => {
                let parameters = SteppingParameters {
                    stance_height_m: settings.stance_height_m as f32,
                    down_amplitude_m: settings.down_amplitude_m as f32,
                    up_amplitude_m: settings.up_amplitude_m as f32,
                    flight_fraction: settings.flight_fraction as f32,
                    step_length_m: settings.step_length_m as f32,
                };
                let stepping = Stepping::new(parameters, geometry)?;
                Some((Waveform::Stepping(stepping), stepping.defaults()))
            }
        }
    }
}
