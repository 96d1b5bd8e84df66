//! `canter run` with a simulated robot at the other end of a pseudo-terminal.
#![cfg(unix)]

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Stdio;

use canter_export::protocol::parse_targets;
use canter_sim::Env;
use canter_train::run_directory::read_config;
use common::{TINY, TemporaryFolder, canter_in};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A simulated robot: it does what a line of targets says and answers with its readings.
struct Robot {
    env: Env,
    observation: Vec<f32>,
    from_canter: BufReader<File>,
    to_canter: File,
}

impl Robot {
    /// A robot that stands, on one side of a new pseudo-terminal, and the path of the other side.
    fn new(run: &Path) -> (Self, String) {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&controller).unwrap();
        unlockpt(&controller).unwrap();
        let path = ptsname(&controller, Vec::new()).unwrap().into_string().unwrap();
        let mut settings = tcgetattr(&controller).unwrap();
        settings.make_raw();
        tcsetattr(&controller, OptionalActions::Now, &settings).unwrap();
        let task = read_config(run).unwrap().task;
        let mut observation = vec![0.0; task.num_observations()];
        let mut env = Env::new(task);
        env.reset(&mut || 0.5, &mut observation);
        let to_canter = File::from(controller);
        let from_canter = BufReader::new(to_canter.try_clone().unwrap());
        (Self { env, observation, from_canter, to_canter }, path)
    }

    fn say(&mut self, line: &str) {
        writeln!(self.to_canter, "{line}").unwrap();
    }

    fn hear(&mut self) -> String {
        let mut line = String::new();
        self.from_canter.read_line(&mut line).unwrap();
        line
    }

    fn send_readings(&mut self) {
        let sensors = self.env.sensors();
        let parts =
            [sensors.motor_angles, sensors.motor_velocities, &sensors.orientation, &sensors.angular_velocity_in_body];
        let line = parts.concat().iter().fold("sensors".to_owned(), |line, value| format!("{line} {value}"));
        self.say(&line);
    }

    /// One control step: hears targets, moves, and answers unless its sensors fail. Returns mode and targets.
    fn step(&mut self, has_sensors: bool) -> (String, Vec<f32>) {
        let line = self.hear();
        let (mode, targets) = parse_targets(&line).unwrap_or_else(|| panic!("{line}"));
        let (mode, targets) = (mode.to_owned(), targets);
        self.env.step_targets(&targets, &mut self.observation);
        if has_sensors {
            self.send_readings();
        }
        (mode, targets)
    }

    /// Steps until it hears this mode.
    fn until(&mut self, mode: &str, has_sensors: bool) -> Vec<f32> {
        const MOST_STEPS: usize = 2000;
        for _ in 0..MOST_STEPS {
            let (heard, targets) = self.step(has_sensors);
            if heard == mode {
                return targets;
            }
        }
        panic!("{mode} never came");
    }
}

#[test]
fn a_simulated_robot_walks_holds_and_stops_over_a_pseudo_terminal() {
    let folder = TemporaryFolder::new();
    let mut train = vec!["train", "--out", "run", "--set", "policy.authority=0.2"];
    train.extend(TINY);
    folder.canter(&train).succeeded();
    let (mut robot, port) = Robot::new(&folder.join("run"));
    let mut canter = canter_in(folder.path(), &["run", "run", "--port", &port])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    assert_eq!(robot.hear().trim_end(), "canter 1 motors 8 control_dt_s 0.01");
    // No readings yet: it holds the pose that it was built to stand in.
    let standing = robot.until("holding", true);
    assert!(standing.iter().all(|target| *target == 0.0), "{standing:?}");
    robot.until("standing", true);
    robot.say("what");
    robot.say("walk");
    let line = loop {
        let line = robot.hear();
        if !line.starts_with("targets") {
            break line;
        }
        robot.send_readings();
    };
    assert_eq!(line, "error `what` is none of sensors, walk, stop, quit\n");
    robot.until("ramping-in", true);
    robot.until("walking", true);
    let start = robot.env.position_in_ground()[0];
    for _ in 0..150 {
        robot.step(true);
    }
    let way = robot.env.position_in_ground()[0] - start;
    // The gait as it was walks at some 0.5 m/s.
    assert!(way > 0.2, "{way} m in 1.5 s");
    let held = robot.until("holding", false);
    for _ in 0..10 {
        assert_eq!(robot.step(false), ("holding".to_owned(), held.clone()));
    }
    robot.until("ramping-in", true);
    robot.say("stop");
    robot.until("standing", true);
    robot.say("walk");
    robot.until("walking", true);
    robot.say("quit");
    robot.until("ramping-out", true);
    robot.until("standing", true);
    let status = canter.wait().unwrap();
    assert!(status.success(), "{status}");
}

#[test]
fn without_a_port_it_speaks_over_standard_input_and_output() {
    let folder = TemporaryFolder::new();
    let mut train = vec!["train", "--out", "run"];
    train.extend(TINY);
    folder.canter(&train).succeeded();
    // The other side ends at once: so does it, holding.
    let said = folder.canter(&["run", "run"]).succeeded();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines[0], "canter 1 motors 8 control_dt_s 0.01");
    assert!(lines[1..].iter().all(|line| line.starts_with("targets holding 0.000000")), "{said}");
    let refused = folder.canter(&["run", "run", "--port", "no-such-port"]).failed_with(1);
    assert!(refused.contains("no-such-port"), "{refused}");
}
