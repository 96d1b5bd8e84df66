//! Writes the robots that are built from a few numbers: MJCF and robot.toml of `robots/NAME/`.
//!
//! Doggo is written by hand, with a source for every number. The robots here show that the method fits other legs and
//! other numbers of them; each number's source stands beside it, [A] where it is assumed.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::Failure;

/// How a leg is built.
#[derive(Clone, Copy)]
enum Kind {
    /// Two motors at the hip, their axes so far apart [m].
    FiveBar { hip_separation_m: f64 },
    /// Hip and knee motor, and one that would turn the leg sideways and is held still; the knee is behind.
    Serial,
}

/// Everything that makes a robot; SI units.
struct Robot {
    name: &'static str,
    description: &'static str,
    sources: &'static str,
    kind: Kind,
    /// Legs on each side.
    rows: usize,
    row_spacing_m: f64,
    hip_y_m: f64,
    /// Half the body's length, width and height, and its mass without motors.
    body_half_m: [f64; 3],
    body_kg: f64,
    upper_link_m: f64,
    lower_link_m: f64,
    stance_height_m: f64,
    upper_link_kg: f64,
    lower_link_kg: f64,
    foot_kg: f64,
    foot_radius_m: f64,
    motor_kg: f64,
    armature: f64,
    friction_loss_nm: f64,
    max_torque_nm: f64,
    stall_torque_nm: f64,
    no_load_speed_rad_per_s: f64,
    /// Gains of the motors' position control [N m/rad, N m s/rad].
    gains: [f64; 2],
}

/// Doggo's legs, motors and gains, which six and eight legs have too.
const MULTI_LEGGED: Robot = Robot {
    name: "",
    description: "",
    sources: "Legs, motors and gains are Doggo's (docs/doggo-model.md), with a position control for each motor instead of\n\
              the coupled one: half of 6.72 N m/rad. The frame grows with the number of legs [A].",
    kind: Kind::FiveBar { hip_separation_m: 0.0 },
    rows: 3,
    row_spacing_m: 0.24,
    hip_y_m: 0.11,
    body_half_m: [0.30, 0.10, 0.05],
    body_kg: 2.6,
    upper_link_m: 0.09,
    lower_link_m: 0.162,
    stance_height_m: 0.17,
    upper_link_kg: 0.043,
    lower_link_kg: 0.022,
    foot_kg: 0.010,
    foot_radius_m: 0.015,
    motor_kg: 0.2667,
    armature: 0.00045,
    friction_loss_nm: 0.06,
    max_torque_nm: 4.2,
    stall_torque_nm: 35.9,
    no_load_speed_rad_per_s: 263.5,
    gains: [3.36, 0.03],
};

const ROBOTS: [Robot; 5] = [
    Robot {
        name: "minitaur",
        description: "Ghost Minitaur: 5 kg, four coaxial five-bar legs without gears, eight motors",
        sources: "Links 0.1 and 0.2 m, upper links level when standing, U8 motors without gears: Kenneally, De and Koditschek\n\
                  2016. Motor: 0.0954 N m/A, 0.186 Ohm at 16 V, limited to 3.5 N m (public model of its simulator);\n\
                  rotor 1.2e-4 kg m^2, 0.24 kg [A]. Total 5 kg; masses of the links, hips, gains [A].",
        kind: Kind::FiveBar { hip_separation_m: 0.0 },
        rows: 2,
        row_spacing_m: 0.38,
        hip_y_m: 0.11,
        body_half_m: [0.20, 0.09, 0.05],
        body_kg: 2.2,
        upper_link_m: 0.1,
        lower_link_m: 0.2,
        stance_height_m: 0.1732,
        upper_link_kg: 0.035,
        lower_link_kg: 0.06,
        foot_kg: 0.015,
        foot_radius_m: 0.015,
        motor_kg: 0.24,
        armature: 0.00012,
        friction_loss_nm: 0.03,
        max_torque_nm: 3.5,
        stall_torque_nm: 8.2,
        no_load_speed_rad_per_s: 168.0,
        gains: [3.5, 0.035],
    },
    Robot {
        name: "q8bot",
        description: "Q8bot-sized: 0.22 kg, four small five-bar legs with their hips apart, eight servos",
        sources: "Links 25 and 40 mm, hips 19.5 mm apart, 0.22 kg, XL330-M077 servos: the public Q8bot project. Servo:\n\
                  0.215 N m and 383 rpm at 5 V, 18 g (its data sheet), torque limited to 0.2 N m, rotor behind the\n\
                  gear 2e-5 kg m^2, gains [A]. Masses of the links, hips [A].",
        kind: Kind::FiveBar { hip_separation_m: 0.0195 },
        rows: 2,
        row_spacing_m: 0.09,
        hip_y_m: 0.035,
        body_half_m: [0.055, 0.03, 0.012],
        body_kg: 0.05,
        upper_link_m: 0.025,
        lower_link_m: 0.04,
        stance_height_m: 0.045,
        upper_link_kg: 0.0012,
        lower_link_kg: 0.0014,
        foot_kg: 0.0005,
        foot_radius_m: 0.004,
        motor_kg: 0.018,
        armature: 0.00002,
        friction_loss_nm: 0.004,
        max_torque_nm: 0.2,
        stall_torque_nm: 0.215,
        no_load_speed_rad_per_s: 40.1,
        gains: [0.35, 0.003],
    },
    Robot {
        name: "quad12",
        description: "A serial-leg quadruped: 9 kg, four legs of two links, twelve motors of which four are held",
        sources: "The size of MIT's Mini Cheetah (Katz, Di Carlo and Kim 2019): 9 kg, links of 0.2 m, 17 N m, 40 rad/s.\n\
                  Its hips stand further apart, as far against its height as Doggo's, so that a trot without a policy stays\n\
                  up [A]. Gains are those at which such robots are run; masses of the links, rotor 6e-5 kg m^2 behind\n\
                  6:1 [A].",
        kind: Kind::Serial,
        rows: 2,
        row_spacing_m: 0.50,
        hip_y_m: 0.175,
        body_half_m: [0.25, 0.14, 0.055],
        body_kg: 2.6,
        upper_link_m: 0.2,
        lower_link_m: 0.2,
        stance_height_m: 0.27,
        upper_link_kg: 0.25,
        lower_link_kg: 0.09,
        foot_kg: 0.03,
        foot_radius_m: 0.02,
        motor_kg: 0.41,
        armature: 0.0022,
        friction_loss_nm: 0.1,
        max_torque_nm: 17.0,
        stall_torque_nm: 36.0,
        no_load_speed_rad_per_s: 40.0,
        gains: [40.0, 0.8],
    },
    Robot {
        name: "hexapod",
        description: "A hexapod with Doggo's legs: 7 kg, six coaxial five-bar legs, twelve motors",
        ..MULTI_LEGGED
    },
    Robot {
        name: "octopod",
        description: "An octopod with Doggo's legs: 9 kg, eight coaxial five-bar legs, sixteen motors",
        rows: 4,
        body_half_m: [0.42, 0.10, 0.05],
        body_kg: 3.4,
        ..MULTI_LEGGED
    },
];

/// A leg's name and hip.
struct Leg {
    name: String,
    x_m: f64,
    y_m: f64,
}

impl Robot {
    /// The legs in canter's order: left from front to back, then right from back to front.
    fn legs(&self) -> Vec<Leg> {
        let names: &[&str] = match self.rows {
            2 => &["front", "back"],
            3 => &["front", "middle", "back"],
            _ => &["first", "second", "third", "fourth"],
        };
        let leg = |row: usize, side: &str, sign: f64| Leg {
            name: format!("{}_{side}", names[row]),
            x_m: self.row_spacing_m * (0.5 * (self.rows - 1) as f64 - row as f64),
            y_m: sign * self.hip_y_m,
        };
        let left = (0..self.rows).map(|row| leg(row, "left", 1.0));
        left.chain((0..self.rows).rev().map(|row| leg(row, "right", -1.0))).collect()
    }

    fn half_separation_m(&self) -> f64 {
        match self.kind {
            Kind::FiveBar { hip_separation_m } => 0.5 * hip_separation_m,
            Kind::Serial => 0.0,
        }
    }

    /// Angle of an upper link against straight down where the foot is straight below at this length [rad].
    fn half_angle(&self, length_m: f64) -> f64 {
        let from_hip = length_m.hypot(self.half_separation_m());
        let squares = self.upper_link_m.powi(2) + from_hip.powi(2) - self.lower_link_m.powi(2);
        (squares / (2.0 * self.upper_link_m * from_hip)).acos() - self.half_separation_m().atan2(length_m)
    }

    /// Least and greatest extension [rad], well inside of what the links allow.
    fn extension_limits(&self) -> [f64; 2] {
        let longest = match self.kind {
            Kind::FiveBar { .. } => {
                ((self.upper_link_m + self.lower_link_m).powi(2) - self.half_separation_m().powi(2)).sqrt()
            }
            Kind::Serial => self.upper_link_m + self.lower_link_m,
        };
        // With links of one length the leg could fold up altogether; the body is in the way.
        let shortest = (self.lower_link_m - self.upper_link_m + self.half_separation_m()).max(0.4 * longest);
        [1.1 * shortest, 0.98 * longest].map(|length| self.half_angle(self.stance_height_m) - self.half_angle(length))
    }

    /// The knee [m], forward and up, of a standing leg's upper link that points to this side: 1 forward, -1 back.
    fn knee(&self, side: f64) -> [f64; 2] {
        let angle = self.half_angle(self.stance_height_m);
        [side * self.upper_link_m * angle.sin(), -self.upper_link_m * angle.cos()]
    }

    fn mjcf(&self) -> String {
        let mut text = String::new();
        let mut line = |indent: usize, content: &str| {
            let _ = writeln!(text, "{}{content}", "  ".repeat(indent));
        };
        let [kp, kv] = self.gains;
        let [length, width, height] = self.body_half_m.map(number);
        let standing_m = self.stance_height_m + self.foot_radius_m;
        line(0, "<!--");
        line(0, &format!("{}. Written by `cargo xtask robots`; do not edit.", self.description));
        line(
            0,
            "Units: m, kg, s, rad, N m. Frame: x forward, y left, z up. Hinges turn about -y: positive is forward.",
        );
        line(0, self.sources);
        line(0, "Contacts, friction and solver are Doggo's.");
        line(0, "-->");
        line(0, &format!("<mujoco model=\"{}\">", self.name));
        line(1, "<compiler angle=\"radian\" autolimits=\"true\"/>");
        line(
            1,
            "<option timestep=\"0.002\" integrator=\"implicitfast\" gravity=\"0 0 -9.81\" cone=\"elliptic\" impratio=\"10\"",
        );
        line(1, "        solver=\"Newton\" iterations=\"20\" tolerance=\"1e-8\">");
        line(2, "<flag island=\"disable\"/>");
        line(1, "</option>");
        line(1, "<visual>");
        line(2, "<global offwidth=\"1280\" offheight=\"720\" azimuth=\"120\" elevation=\"-20\"/>");
        line(1, "</visual>");
        line(1, &format!("<statistic extent=\"{}\"/>", number(4.0 * self.stance_height_m)));
        line(1, "<default>");
        line(2, "<equality solref=\"0.004 1\" solimp=\"0.99 0.999 0.0005 0.5 2\"/>");
        line(2, "<default class=\"robot\">");
        line(3, "<geom contype=\"0\" conaffinity=\"0\" condim=\"3\" priority=\"1\" friction=\"0.8 0.005 0.0001\"");
        line(3, "      solref=\"0.01 1\" solimp=\"0.9 0.95 0.001 0.5 2\" rgba=\"0.6 0.62 0.66 1\"/>");
        line(3, "<joint type=\"hinge\" axis=\"0 -1 0\"/>");
        line(3, "<default class=\"motor\">");
        let torque = number(self.max_torque_nm);
        line(
            4,
            &format!(
                "<joint armature=\"{}\" damping=\"{}\" frictionloss=\"{}\" actuatorfrcrange=\"-{torque} {torque}\"/>",
                number(self.armature),
                number(0.3 * kv),
                number(self.friction_loss_nm)
            ),
        );
        line(4, &format!("<position kp=\"{}\" kv=\"{}\"/>", number(kp), number(kv)));
        line(3, "</default>");
        line(3, "<default class=\"knee\">");
        line(4, &format!("<joint damping=\"{}\"/>", number(0.015 * kv)));
        line(3, "</default>");
        line(2, "</default>");
        line(1, "</default>");
        line(1, "<worldbody>");
        line(2, "<geom name=\"floor\" type=\"plane\" size=\"0 0 1\" contype=\"1\" conaffinity=\"0\"/>");
        line(2, &format!("<body name=\"body\" childclass=\"robot\" pos=\"0 0 {}\">", number(standing_m)));
        line(3, "<freejoint name=\"root\"/>");
        line(3, "<light mode=\"trackcom\" pos=\"-0.6 -0.6 3\" dir=\"0.2 0.2 -1\" directional=\"true\"/>");
        let back = number(-6.0 * self.stance_height_m);
        let camera = format!(
            "<camera name=\"side\" mode=\"trackcom\" pos=\"0.1 {back} {}\" xyaxes=\"1 0.09 0 -0.02 0.22 0.97\"/>",
            number(1.5 * self.stance_height_m)
        );
        line(3, &camera);
        line(
            3,
            &format!(
                "<geom name=\"body\" type=\"box\" size=\"{length} {width} {height}\" mass=\"{}\" conaffinity=\"1\" \
                 rgba=\"0.25 0.3 0.4 1\"/>",
                number(self.body_kg)
            ),
        );
        for leg in self.legs() {
            self.write_leg(&leg, &mut line);
        }
        line(2, "</body>");
        line(1, "</worldbody>");
        if let Kind::FiveBar { .. } = self.kind {
            line(1, "<equality>");
            for leg in self.legs() {
                let [x, z] = self.knee(1.0);
                let foot = [-x - self.half_separation_m(), -self.stance_height_m - z].map(number);
                line(
                    2,
                    &format!(
                        "<connect name=\"{0}_loop\" body1=\"{0}_lower_a\" body2=\"{0}_lower_b\" anchor=\"{1} 0 {2}\"/>",
                        leg.name, foot[0], foot[1]
                    ),
                );
            }
            line(1, "</equality>");
        }
        line(1, "<actuator>");
        for leg in self.legs() {
            for joint in self.motor_joints() {
                line(2, &format!("<position name=\"{0}_{joint}\" class=\"motor\" joint=\"{0}_{joint}\"/>", leg.name));
            }
        }
        line(1, "</actuator>");
        line(0, "</mujoco>");
        text
    }

    /// The motors of a leg, those that are held last.
    fn motor_joints(&self) -> &'static [&'static str] {
        match self.kind {
            Kind::FiveBar { .. } => &["motor_a", "motor_b"],
            Kind::Serial => &["hip", "knee", "abduction"],
        }
    }

    fn write_leg(&self, leg: &Leg, line: &mut impl FnMut(usize, &str)) {
        let name = &leg.name;
        let [x, y] = [leg.x_m, leg.y_m].map(number);
        let (motor_kg, radius) = (number(self.motor_kg), number(0.35 * self.foot_radius_m + 0.2 * self.foot_radius_m));
        let width = number(0.4 * self.foot_radius_m);
        match self.kind {
            Kind::FiveBar { .. } => {
                for (half, side, motor_z) in [("a", 1.0, 0.5), ("b", -1.0, -0.5)] {
                    let hip = number(leg.x_m + side * self.half_separation_m());
                    let [knee_x, knee_z] = self.knee(side);
                    let foot = [-knee_x - side * self.half_separation_m(), -self.stance_height_m - knee_z].map(number);
                    let [knee_x, knee_z] = [knee_x, knee_z].map(number);
                    line(
                        3,
                        &format!(
                            "<geom name=\"{name}_{half}_motor\" type=\"sphere\" size=\"{radius}\" pos=\"{hip} {} {}\" \
                             mass=\"{motor_kg}\"/>",
                            number(0.8 * leg.y_m),
                            number(motor_z * self.body_half_m[2])
                        ),
                    );
                    line(3, &format!("<body name=\"{name}_upper_{half}\" pos=\"{hip} {y} 0\">"));
                    line(4, &format!("<joint name=\"{name}_motor_{half}\" class=\"motor\"/>"));
                    line(
                        4,
                        &format!(
                            "<geom type=\"capsule\" size=\"{radius}\" fromto=\"0 0 0 {knee_x} 0 {knee_z}\" mass=\"{}\" \
                             conaffinity=\"1\"/>",
                            number(self.upper_link_kg)
                        ),
                    );
                    line(4, &format!("<body name=\"{name}_lower_{half}\" pos=\"{knee_x} 0 {knee_z}\">"));
                    line(5, &format!("<joint name=\"{name}_knee_{half}\" class=\"knee\"/>"));
                    line(
                        5,
                        &format!(
                            "<geom type=\"capsule\" size=\"{width}\" fromto=\"0 0 0 {} 0 {}\" mass=\"{}\" conaffinity=\"1\"/>",
                            foot[0],
                            foot[1],
                            number(self.lower_link_kg)
                        ),
                    );
                    // The other half of the foot's mass is on link b; it touches nothing.
                    let (geom, touches) = if half == "a" { ("foot", "1") } else { ("foot_half", "0") };
                    line(
                        5,
                        &format!(
                            "<geom name=\"{name}_{geom}\" type=\"sphere\" size=\"{}\" pos=\"{} 0 {}\" mass=\"{}\" \
                             conaffinity=\"{touches}\" rgba=\"0.12 0.12 0.13 1\"/>",
                            number(self.foot_radius_m),
                            foot[0],
                            foot[1],
                            number(self.foot_kg)
                        ),
                    );
                    line(4, "</body>");
                    line(3, "</body>");
                }
            }
            Kind::Serial => {
                let [knee_x, knee_z] = self.knee(-1.0);
                let foot = [-knee_x, -self.stance_height_m - knee_z].map(number);
                let [knee_x, knee_z] = [knee_x, knee_z].map(number);
                let size = number(0.8 * self.foot_radius_m);
                line(3, &format!("<body name=\"{name}_hip\" pos=\"{x} {y} 0\">"));
                line(4, &format!("<joint name=\"{name}_abduction\" class=\"motor\" axis=\"1 0 0\"/>"));
                line(4, &format!("<geom type=\"sphere\" size=\"{size}\" mass=\"{motor_kg}\"/>"));
                line(4, &format!("<body name=\"{name}_upper\">"));
                line(5, &format!("<joint name=\"{name}_hip\" class=\"motor\"/>"));
                // The knee's motor sits at the hip too.
                line(5, &format!("<geom type=\"sphere\" size=\"{size}\" mass=\"{}\"/>", number(2.0 * self.motor_kg)));
                line(
                    5,
                    &format!(
                        "<geom type=\"capsule\" size=\"{radius}\" fromto=\"0 0 0 {knee_x} 0 {knee_z}\" mass=\"{}\" \
                         conaffinity=\"1\"/>",
                        number(self.upper_link_kg)
                    ),
                );
                line(5, &format!("<body name=\"{name}_lower\" pos=\"{knee_x} 0 {knee_z}\">"));
                line(6, &format!("<joint name=\"{name}_knee\" class=\"motor\"/>"));
                line(
                    6,
                    &format!(
                        "<geom type=\"capsule\" size=\"{width}\" fromto=\"0 0 0 {} 0 {}\" mass=\"{}\" conaffinity=\"1\"/>",
                        foot[0],
                        foot[1],
                        number(self.lower_link_kg)
                    ),
                );
                line(
                    6,
                    &format!(
                        "<geom name=\"{name}_foot\" type=\"sphere\" size=\"{}\" pos=\"{} 0 {}\" mass=\"{}\" conaffinity=\"1\" \
                         rgba=\"0.12 0.12 0.13 1\"/>",
                        number(self.foot_radius_m),
                        foot[0],
                        foot[1],
                        number(self.foot_kg)
                    ),
                );
                line(5, "</body>");
                line(4, "</body>");
                line(3, "</body>");
            }
        }
    }

    fn toml(&self) -> String {
        let mut text = String::new();
        let mut line = |content: &str| {
            let _ = writeln!(text, "{content}");
        };
        let [least, greatest] = self.extension_limits();
        let body_height = self.body_half_m[2];
        // A quarter of the way from lying on the belly to standing, as Doggo's.
        let min_height = body_height + 0.25 * (self.stance_height_m + self.foot_radius_m - body_height);
        line(&format!("# {}.", self.description));
        line("# Written by `cargo xtask robots`; do not edit. The model has the numbers' sources.\n");
        line(&format!("name = \"{}\"", self.name));
        line(&format!("description = \"{}\"", self.description));
        line(&format!("model = \"{}.xml\"", self.name));
        line("body = \"body\"\nfloor = \"floor\"");
        line(&format!("stance_height_m = {}", toml_number(self.stance_height_m)));
        line("command_delay_steps = 1\n");
        line("[motor]");
        line(&format!("max_torque_nm = {}", toml_number(self.max_torque_nm)));
        line(&format!("stall_torque_nm = {}", toml_number(self.stall_torque_nm)));
        line(&format!("no_load_speed_rad_per_s = {}\n", toml_number(self.no_load_speed_rad_per_s)));
        line("[limits]");
        line(&format!("min_height_m = {}", toml_number((min_height * 1000.0).round() / 1000.0)));
        line("max_tilt_deg = 60.0\nstuck_error_rad = 1.0\nstuck_time_s = 0.5\nswing_rad = [-1.2, 1.2]");
        line(&format!("extension_rad = [{least:.4}, {greatest:.4}]"));
        if let Kind::Serial = self.kind {
            for leg in self.legs() {
                line(&format!("\n[[held]]\njoint = \"{0}_abduction\"\nactuator = \"{0}_abduction\"", leg.name));
            }
        }
        for leg in self.legs() {
            let name = &leg.name;
            let quoted = |joints: &[&str]| {
                let names: Vec<String> = joints.iter().map(|joint| format!("\"{name}_{joint}\"")).collect();
                format!("[{}]", names.join(", "))
            };
            let motors = quoted(&self.motor_joints()[..2]);
            line("\n[[legs]]");
            match self.kind {
                Kind::FiveBar { .. } => line("kind = \"five-bar\""),
                Kind::Serial => line("kind = \"serial\""),
            }
            line(&format!("name = \"{name}\"\nfoot = \"{name}_foot\""));
            line(&format!("upper_link_m = {}", toml_number(self.upper_link_m)));
            line(&format!("lower_link_m = {}", toml_number(self.lower_link_m)));
            match self.kind {
                Kind::FiveBar { hip_separation_m } => {
                    if hip_separation_m > 0.0 {
                        line(&format!("hip_separation_m = {}", toml_number(hip_separation_m)));
                    }
                    line(&format!("motors = {motors}\nknees = {}", quoted(&["knee_a", "knee_b"])));
                    line(&format!("actuators = {motors}\nactuated = \"motors\""));
                }
                Kind::Serial => line(&format!("knee = \"back\"\nmotors = {motors}\nactuators = {motors}")),
            }
        }
        let footfalls: &[(&str, bool)] = match self.rows {
            2 => &[
                ("trot", true),
                ("walk", false),
                ("pace", false),
                ("bound", false),
                ("pronk", false),
                ("gallop", false),
            ],
            3 => &[("tripod", true), ("ripple", true), ("wave", true)],
            _ => &[("alternating", true), ("wave", true)],
        };
        for (i, (footfall, stable)) in footfalls.iter().enumerate() {
            line(&self.gait(footfall, i == 0, *stable));
        }
        text
    }

    /// Doggo's stepping trot by dynamic similarity: lengths by the stance height, the frequency by the root of gravity over
    /// it.
    fn gait(&self, footfall: &str, is_default: bool, is_stable: bool) -> String {
        let scale = self.stance_height_m / 0.17;
        let millimetres = |metres: f64| toml_number((metres * scale * 1e4).round() / 1e4);
        format!(
            "\n[[gaits]]\nkind = \"stepping\"\nname = \"{footfall}\"\ndefault = {is_default}\nstable = {is_stable}\n\
             footfall = \"{footfall}\"\nstride_frequency_hz = {:.2}\nstance_height_m = {}\ndown_amplitude_m = {}\n\
             up_amplitude_m = {}\nflight_fraction = 0.35\nstep_length_m = {}",
            2.0 / scale.sqrt(),
            toml_number(self.stance_height_m),
            millimetres(0.04),
            millimetres(0.06),
            millimetres(0.15),
        )
    }
}

/// A number for MJCF: ten significant digits, no trailing zeros.
fn number(value: f64) -> String {
    let text = format!("{value:.10}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// A number for TOML, always with a point.
fn toml_number(value: f64) -> String {
    format!("{value:?}")
}

/// Writes the robots, or checks that they are as they would be written.
pub fn write(root: &Path, only_check: bool) -> Result<(), Failure> {
    for robot in ROBOTS {
        let folder = root.join("robots").join(robot.name);
        for (name, text) in [(format!("{}.xml", robot.name), robot.mjcf()), ("robot.toml".to_owned(), robot.toml())] {
            let path = folder.join(name);
            if only_check {
                if fs::read_to_string(&path).unwrap_or_default() != text {
                    let message = format!("{} is out of date; `cargo xtask robots` writes it anew", path.display());
                    return Err(Failure::Task(message));
                }
                continue;
            }
            let written = fs::create_dir_all(&folder).and_then(|()| fs::write(&path, text));
            written.map_err(|error| Failure::Task(format!("cannot write {}: {error}", path.display())))?;
        }
    }
    println!("robots: {} {}", ROBOTS.len(), if only_check { "are up to date" } else { "written" });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_go_round_the_robot() {
        let hexapod = &ROBOTS[3];
        let names: Vec<String> = hexapod.legs().into_iter().map(|leg| leg.name).collect();
        let expected = ["front_left", "middle_left", "back_left", "back_right", "middle_right", "front_right"];
        assert_eq!(names, expected);
        assert!((hexapod.legs()[0].x_m - 0.24).abs() < 1e-12 && hexapod.legs()[1].x_m == 0.0);
    }

    #[test]
    fn the_standing_leg_is_as_long_as_it_should_be() {
        for robot in &ROBOTS {
            let [x, z] = robot.knee(1.0);
            let lower = (x + robot.half_separation_m()).hypot(robot.stance_height_m + z);
            assert!((lower - robot.lower_link_m).abs() < 1e-12, "{}", robot.name);
            let [least, greatest] = robot.extension_limits();
            assert!(
                least < -0.1 && greatest > 0.1 && greatest - least < std::f64::consts::TAU,
                "{}: {least} {greatest}",
                robot.name
            );
        }
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([number(0.5), number(-0.0), number(3.0), number(1e-4)], ["0.5", "0", "3", "0.0001"]);
    }
}
