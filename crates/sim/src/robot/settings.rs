//! What `robot.toml` says.

use canter_gait::LegGeometry;
use canter_gait::phase::{FOOTFALLS, phase_offsets, wrap_cycles};
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
        /// The MuJoCo model (MJCF or URDF): its path from this file's folder.
        pub model: String,
        /// Name of the model's keyframe that is the standing pose; absent: its reference configuration. The feet stand below
        /// the hips in it.
        pub keyframe: Option<String>,
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
        /// Motors that stay where they are in the standing pose, such as those that turn a leg sideways.
        pub held: Option<Vec<HeldSettings>>,
        /// The legs, in the order in which gaits and policies count them: the left ones from front to back, then the right
        /// ones from back to front.
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
        /// For a model whose actuators are given torques: the gain of the position control that takes their place
        /// [N m/rad]; absent: the model's actuators are position servos.
        pub position_gain_nm_per_rad: Option<f64> in above(0.0),
        /// The same control's gain on the joint's velocity [N m s/rad]; absent: 0.
        pub velocity_gain_nm_s_per_rad: Option<f64> in 0.0..=1e6,
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

settings! {
    /// A motor that is held still.
    pub struct HeldSettings {
        /// Its joint, a hinge.
        pub joint: String,
        /// Its position actuator.
        pub actuator: String,
    }
}

tagged! {
    /// How a leg is built.
    pub enum LegSettings {
        /// Two motors at the hip, two upper and two lower links that meet at the foot.
        FiveBar(FiveBarSettings) = "five-bar",
        /// Two links one after the other, a motor at the hip and one at the knee.
        Serial(SerialSettings) = "serial",
    }
}

impl LegSettings {
    /// Name of the leg.
    pub fn name(&self) -> &str {
        match self {
            Self::FiveBar(leg) => &leg.name,
            Self::Serial(leg) => &leg.name,
        }
    }

    /// Geom of the foot.
    pub(super) fn foot(&self) -> &str {
        match self {
            Self::FiveBar(leg) => &leg.foot,
            Self::Serial(leg) => &leg.foot,
        }
    }

    /// Names of the motor joints, and of the actuators.
    pub(super) fn motors_and_actuators(&self) -> (&[String], &[String]) {
        match self {
            Self::FiveBar(leg) => (&leg.motors, &leg.actuators),
            Self::Serial(leg) => (&leg.motors, &leg.actuators),
        }
    }

    /// Names of the passive joints that close a loop.
    pub(super) fn knees(&self) -> Option<&[String]> {
        match self {
            Self::FiveBar(leg) => Some(&leg.knees),
            Self::Serial(_) => None,
        }
    }

    /// Lengths of upper and lower links [m].
    pub(super) fn links_m(&self) -> (f64, f64) {
        match self {
            Self::FiveBar(leg) => (leg.upper_link_m, leg.lower_link_m),
            Self::Serial(leg) => (leg.upper_link_m, leg.lower_link_m),
        }
    }
}

settings! {
    /// A five-bar leg.
    pub struct FiveBarSettings {
        /// Name of the leg.
        pub name: String,
        /// Geom of the foot, a sphere; or a body with one sphere that can touch something.
        pub foot: String,
        /// Length of each upper link [m].
        pub upper_link_m: f64 in above(0.0),
        /// Length of each lower link [m].
        pub lower_link_m: f64 in above(0.0),
        /// Distance between the two hip axes, one before the other [m]; absent: 0, both motors are on one axis.
        pub hip_separation_m: Option<f64> in 0.0..=10.0,
        /// The two motor joints; the one whose link points forward first.
        pub motors: Vec<String>,
        /// The two passive joints between upper and lower links, in the order of the motors.
        pub knees: Vec<String>,
        /// The two position actuators.
        pub actuators: Vec<String>,
        /// What the actuators are commanded in.
        pub actuated: Actuated,
    }
}

settings! {
    /// A leg of two links one after the other.
    pub struct SerialSettings {
        /// Name of the leg.
        pub name: String,
        /// Geom of the foot, a sphere; or a body with one sphere that can touch something.
        pub foot: String,
        /// Length of the upper link, from the hip's axis to the knee's [m].
        pub upper_link_m: f64 in above(0.0),
        /// Length of the lower link, from the knee's axis to the foot's centre [m].
        pub lower_link_m: f64 in above(0.0),
        /// Where the knee is against the line from hip to foot.
        pub knee: KneeSide,
        /// The motor joints of hip and knee.
        pub motors: Vec<String>,
        /// Their position actuators.
        pub actuators: Vec<String>,
    }
}

choices! {
    /// Where a knee is.
    pub enum KneeSide {
        /// In front of the line from hip to foot.
        Front = "front",
        /// Behind it.
        Back = "back",
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
    /// Which legs move together, and when.
    pub enum Footfall {
        /// Four legs: diagonal pairs.
        Trot = "trot",
        /// Four legs: one after the other.
        Walk = "walk",
        /// Four legs: left and right pairs.
        Pace = "pace",
        /// Four legs: front and back pairs.
        Bound = "bound",
        /// Four legs: all together.
        Pronk = "pronk",
        /// Four legs: the back ones one shortly after the other, then the front ones.
        Gallop = "gallop",
        /// Six legs: front and back of one side with the middle of the other.
        Tripod = "tripod",
        /// Six legs: waves from back to front that overlap.
        Ripple = "ripple",
        /// Six or eight legs: one after the other from back to front, one side after the other.
        Wave = "wave",
        /// Eight legs: every other one.
        Alternating = "alternating",
        /// As `phase_offsets_cycles` says.
        Custom = "custom",
    }
}

tagged! {
    /// A hand-made gait.
    pub enum GaitSettings {
        /// Sines for swing and extension (eq. 4 of the paper).
        Sine(SineSettings) = "sine",
        /// The foot trajectory of Doggo's firmware.
        Stepping(SteppingSettings) = "stepping",
        /// Actuator targets over one cycle, recorded from the robot's own controller.
        Table(TableSettings) = "table",
    }
}

settings! {
    /// A recorded gait.
    pub struct TableSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Whether it keeps the robot on its feet without a policy.
        pub stable: bool,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// A CSV file, its path from this file's folder. The first line names the actuators, in any order; each other line has
        /// their targets [rad] at one moment, at equal times over exactly one cycle.
        pub table: String,
    }
}

settings! {
    /// A gait of two sines a leg.
    pub struct SineSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Whether it keeps the robot on its feet without a policy; a test holds the robots that come with canter to it.
        pub stable: bool,
        /// Which legs move together, and when.
        pub footfall: Footfall,
        /// For the footfall `custom`: how far each leg is ahead of the clock, in the order of the legs [cycles].
        pub phase_offsets_cycles: Option<Vec<f64>>,
        /// Cycles per second [Hz].
        pub stride_frequency_hz: f64 in 0.01..=20.0,
        /// Amplitude of the swing angle [rad].
        pub swing_amplitude_rad: f64 in 0.0..=1.5,
        /// Amplitude of the extension [rad].
        pub extension_amplitude_rad: f64 in 0.0..=1.5,
        /// How far the extension's sine is ahead of the swing's [cycles]: 0.5 is eq. 4's pi, 0.75 makes the leg
        /// shortest in the middle of its forward swing.
        pub extension_phase_cycles: f64 in 0.0..=1.0,
        /// Swing angle about which the legs move [rad]; absent: 0, straight down.
        pub swing_offset_rad: Option<f64> in -1.5..=1.5,
        /// Extension about which the legs move [rad]; absent: 0, that of the standing pose.
        pub extension_offset_rad: Option<f64> in -1.5..=1.5,
    }
}

settings! {
    /// The firmware's trajectory.
    pub struct SteppingSettings {
        /// Name of the gait.
        pub name: String,
        /// Whether its speed counts as a default speed, which a learned gait is compared with.
        pub default: bool,
        /// Whether it keeps the robot on its feet without a policy; a test holds the robots that come with canter to it.
        pub stable: bool,
        /// Which legs move together, and when.
        pub footfall: Footfall,
        /// For the footfall `custom`: how far each leg is ahead of the clock, in the order of the legs [cycles].
        pub phase_offsets_cycles: Option<Vec<f64>>,
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
            Self::Table(table) => &table.name,
        }
    }

    /// Whether its speed counts as a default speed.
    pub fn is_default(&self) -> bool {
        match self {
            Self::Sine(sine) => sine.default,
            Self::Stepping(stepping) => stepping.default,
            Self::Table(table) => table.default,
        }
    }

    /// Cycles per second [1/s].
    pub fn stride_frequency_hz(&self) -> f64 {
        match self {
            Self::Sine(sine) => sine.stride_frequency_hz,
            Self::Stepping(stepping) => stepping.stride_frequency_hz,
            Self::Table(table) => table.stride_frequency_hz,
        }
    }

    /// Whether it keeps the robot on its feet without a policy.
    pub fn is_stable(&self) -> bool {
        match self {
            Self::Sine(sine) => sine.stable,
            Self::Stepping(stepping) => stepping.stable,
            Self::Table(table) => table.stable,
        }
    }

    /// Each leg's phase offset [cycles].
    ///
    /// # Errors
    /// The key that is wrong, and why.
    pub(super) fn phase_offsets(&self, num_legs: usize) -> Result<Vec<f32>, (&'static str, String)> {
        let (footfall, custom) = match self {
            Self::Sine(sine) => (sine.footfall, &sine.phase_offsets_cycles),
            Self::Stepping(stepping) => (stepping.footfall, &stepping.phase_offsets_cycles),
            // Each leg has a wave of its own.
            Self::Table(_) => return Ok(vec![0.0; num_legs]),
        };
        const KEY: &str = "phase_offsets_cycles";
        match (footfall, custom) {
            (Footfall::Custom, Some(offsets)) if offsets.len() == num_legs => {
                Ok(offsets.iter().map(|&offset| wrap_cycles(offset as f32)).collect())
            }
            (Footfall::Custom, Some(offsets)) => {
                Err((KEY, format!("expected one for each of {num_legs} legs, found {}", offsets.len())))
            }
            (Footfall::Custom, None) => Err(("footfall", format!("a `custom` one needs {KEY}"))),
            (_, Some(_)) => Err((KEY, "these are for the footfall `custom` only".to_owned())),
            (footfall, None) => {
                let offsets = phase_offsets(footfall.name(), num_legs);
                let names = || {
                    let names = FOOTFALLS.iter().filter(|(_, offsets)| offsets.len() == num_legs);
                    names.map(|(name, _)| format!("`{name}`, ")).collect::<String>()
                };
                let offsets = offsets.map(<[f32]>::to_vec);
                offsets.ok_or_else(|| ("footfall", format!("for {num_legs} legs there are {}`custom`", names())))
            }
        }
    }

    /// The file of a recorded gait.
    pub(super) fn table(&self) -> Option<&str> {
        match self {
            Self::Table(table) => Some(&table.table),
            Self::Sine(_) | Self::Stepping(_) => None,
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
                    swing_offset: sine.swing_offset_rad.unwrap_or(0.0) as f32,
                    extension_offset: sine.extension_offset_rad.unwrap_or(0.0) as f32,
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
            // Its waves are in its file.
            Self::Table(_) => None,
        }
    }
}
