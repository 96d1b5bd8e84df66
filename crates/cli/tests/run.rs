//! `canter run` with a simulated robot at the other end of a pseudo-terminal.
#![cfg(unix)]

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use canter_export::protocol::parse_targets;
use canter_sim::Env;
use canter_train::run_directory::read_config;
use common::{TemporaryFolder, canter_in, train_args};
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
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&controller).unwrap();
        unlockpt(&controller).unwrap();
        let path = ptsname(&controller, Vec::new()).unwrap().into_string().unwrap();
        let mut settings = tcgetattr(&controller).unwrap();
        settings.make_raw();
        tcsetattr(&controller, OptionalActions::Now, &settings).unwrap();
        let task = read_config(run).unwrap().task;
        let mut observation = vec![0.0; task.num_observations()];
        let mut env = Env::new(task);
        // Off its standing pose by as much as noise may bring it.
        env.reset(&mut || 0.9, &mut observation);
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

    /// Sends readings until it hears targets, and returns their line: on a busy machine some may be stale when they are looked at.
    fn first_targets(&mut self) -> String {
        loop {
            self.send_readings();
            let line = self.hear();
            if line != "waiting\n" {
                return line;
            }
        }
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

/// A tiny training in `run`.
fn train(folder: &TemporaryFolder, further: &[&str]) {
    folder.canter(&train_args(&[&["--out", "run"], further].concat())).succeeded();
}

fn spawn(canter: &mut Command) -> Child {
    canter.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// A robot on one side of a pseudo-terminal, `canter run` with a trained run on the other.
fn connected(folder: &TemporaryFolder) -> (Robot, Child) {
    train(folder, &["--set", "policy.authority=0.2"]);
    let (robot, port) = Robot::new(&folder.join("run"));
    (robot, spawn(&mut canter_in(folder.path(), &["run", "run", "--port", &port])))
}

/// What a `canter run` that fails says.
fn failed(canter: Child) -> String {
    let output = canter.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    said
}

#[test]
fn a_simulated_robot_walks_holds_and_stops_over_a_pseudo_terminal() {
    let folder = TemporaryFolder::new();
    let (mut robot, mut canter) = connected(&folder);
    assert_eq!(robot.hear().trim_end(), "canter 1 motors 8 control_dt_s 0.01");
    // No readings yet: no targets.
    assert_eq!(robot.hear(), "waiting\n");
    let line = robot.first_targets();
    // From where it is, not from where it should be.
    let (_, first) = parse_targets(&line).unwrap_or_else(|| panic!("{line}"));
    let sensors = robot.env.sensors();
    for (pair, target) in sensors.motor_angles.chunks_exact(2).zip(first.chunks_exact(2)) {
        let swing = 0.5 * (pair[0] + pair[1]);
        assert!((target[0] - swing).abs() < 0.021, "{swing}: {target:?}");
    }
    robot.send_readings();
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
    robot.until("rising", true);
    robot.until("ramping-in", true);
    robot.say("stop");
    robot.until("standing", true);
    robot.say("walk");
    robot.until("walking", true);
    robot.say("quit");
    robot.until("standing", true);
    let status = canter.wait().unwrap();
    assert!(status.success(), "{status}");
}

/// As [`connected`], and the robot walks.
fn walking(folder: &TemporaryFolder) -> (Robot, Child) {
    let (mut robot, canter) = connected(folder);
    robot.hear();
    robot.first_targets();
    robot.send_readings();
    robot.say("walk");
    robot.until("walking", true);
    (robot, canter)
}

#[test]
fn a_gap_in_the_readings_while_it_comes_to_a_stand_is_survived() {
    let folder = TemporaryFolder::new();
    let (mut robot, canter) = walking(&folder);
    robot.say("quit");
    robot.until("holding", false);
    robot.send_readings();
    robot.until("rising", true);
    robot.until("standing", true);
    let output = canter.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn a_robot_that_cannot_be_brought_to_a_stand_is_an_error() {
    let folder = TemporaryFolder::new();
    let (mut robot, canter) = walking(&folder);
    robot.say("quit");
    robot.until("holding", false);
    let said = failed(canter);
    assert!(said.contains("no readings came before the robot stood"), "{said}");
}

#[test]
fn a_cable_that_comes_off_is_an_error() {
    let folder = TemporaryFolder::new();
    let (robot, canter) = walking(&folder);
    drop(robot);
    let said = failed(canter);
    assert!(said.contains("before the robot stood: it is left in the pose of its last targets"), "{said}");
}

#[test]
fn without_a_port_it_speaks_over_standard_input_and_output() {
    let folder = TemporaryFolder::new();
    train(&folder, &[]);
    // The other side ends at once, and nothing was asked of the robot.
    let said = folder.canter(&["run", "run"]).succeeded();
    let (greeting, waiting) = said.split_once('\n').unwrap();
    assert_eq!(greeting, "canter 1 motors 8 control_dt_s 0.01");
    assert!(waiting.starts_with("waiting\n") && waiting.lines().all(|line| line == "waiting"), "{said}");
    let refused = folder.canter(&["run", "run", "--port", "no-such-port"]).failed_with(1);
    assert!(refused.contains("no-such-port"), "{refused}");
}

#[test]
fn an_input_that_ends_in_mid_stride_is_an_error() {
    let folder = TemporaryFolder::new();
    train(&folder, &[]);
    let mut canter = spawn(canter_in(folder.path(), &["run", "run"]).stdin(Stdio::piped()));
    let mut robot = canter.stdin.take().unwrap();
    let mut said = BufReader::new(canter.stdout.take().unwrap()).lines();
    // Legs that are half a radian from where they stand, and time to begin with one step of the way.
    let mut readings = "sensors".to_owned();
    for value in [0.5; 8].iter().chain(&[0.0; 14]) {
        readings += &format!(" {value}");
    }
    let first = said.find_map(|line| {
        writeln!(robot, "{readings}").unwrap();
        parse_targets(&line.unwrap()).map(|(mode, targets)| (mode.to_owned(), targets))
    });
    let (mode, targets) = first.unwrap();
    assert_eq!(mode, "rising");
    // Swing begins at 0.5 rad, extension at 0.
    for pair in targets.chunks_exact(2) {
        assert!((pair[0] - 0.48).abs() < 1e-5 && pair[1].abs() < 1e-5, "{targets:?}");
    }
    // A command without its end is none.
    write!(robot, "quit").unwrap();
    drop(robot);
    let rest: Vec<String> = said.map(Result::unwrap).collect();
    assert!(rest.last().is_some_and(|line| line.starts_with("targets holding")), "{rest:?}");
    let said = failed(canter);
    assert!(said.contains("the input ended before the robot stood"), "{said}");
}
