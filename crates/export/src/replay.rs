//! The exported thing walks in the simulator, from standing, and somebody takes notes.

use canter_gait::PhaseClock;
use canter_sim::Env;
use canter_train::config::EvaluationSettings;
use canter_train::evaluate::{Drive, Driver, Episode, Mover, Watcher, watch_episodes};
use canter_train::executor::Workers;

use crate::exported::{Exported, Running};
use crate::table::OpenLoop;

/// How near to a limit a command is at it [rad].
const AT_LIMIT_RAD: f32 = 1e-5;

/// At this share of its greatest torque a motor is at the limit.
const AT_MAX_TORQUE: f64 = 0.99;

/// What moves the robot.
#[derive(Clone, Copy, Debug)]
pub enum Subject<'a> {
    /// The policy as it was trained: at once, with the simulator's own controller.
    Policy,
    /// What every runnable export does: ramp in, walk.
    Runtime,
    /// Targets over one cycle, without sensors.
    OpenLoop(&'a OpenLoop),
}

impl Driver for Exported<'_> {
    fn start(&self) -> Box<Drive<'_>> {
        let mut running = Running::new(self);
        running.walk(true);
        Box::new(move |sensors, targets| {
            running.step(*sensors, 0.0);
            targets.copy_from_slice(running.targets());
        })
    }
}

/// An open loop and the robot that it moves.
#[derive(Debug)]
struct OpenLoopDriver<'a> {
    exported: Exported<'a>,
    open_loop: &'a OpenLoop,
}

impl Driver for OpenLoopDriver<'_> {
    fn start(&self) -> Box<Drive<'_>> {
        let dt_s = self.exported.control_dt_s();
        let ramp = dt_s / self.exported.runtime_settings().ramp_s;
        let (mut clock, mut share) = (PhaseClock::default(), 0.0_f32);
        Box::new(move |_, targets| {
            share = (share + ramp).min(1.0);
            self.exported.controller().stand(targets);
            for (target, gait) in targets.iter_mut().zip(self.open_loop.targets_at(clock.phase())) {
                *target += share * (gait - *target);
            }
            clock.advance(self.open_loop.stride_frequency_hz, dt_s);
        })
    }
}

/// What a robot had to bear in one episode, or in many.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wear {
    /// Control steps.
    steps: u64,
    /// `(M)` of the legs' commands in leg space: least, greatest [rad], and steps at a limit.
    commands: Vec<[f64; 3]>,
    /// `(L)` least and greatest commanded leg length [m].
    lengths_m: Vec<[f64; 2]>,
    /// `(M)` the motor angles that were commanded in the step before [rad].
    last_commanded: Vec<f32>,
    /// Greatest speed that the commands ask of a motor [rad/s].
    pub command_speed: f64,
    /// Greatest speed of a motor [rad/s].
    pub motor_speed: f64,
    /// For each motor: sum of squared torques [N^2 m^2], and steps at the greatest torque.
    torques: Vec<[f64; 2]>,
}

impl Watcher for Wear {
    fn watch(&mut self, env: &Env) {
        let robot = &env.task().robot;
        let targets = env.last_command();
        let dt_s = env.task().settings.control_dt_s;
        self.steps += 1;
        self.commands.resize(targets.len(), [f64::INFINITY, f64::NEG_INFINITY, 0.0]);
        self.lengths_m.resize(robot.legs.len(), [f64::INFINITY, f64::NEG_INFINITY]);
        let mut commanded = Vec::with_capacity(targets.len());
        for (i, (leg, pair)) in robot.legs.iter().zip(targets.chunks_exact(2)).enumerate() {
            let position = leg.position_at([pair[0], pair[1]]);
            commanded.extend(leg.geometry.motor_angles(position));
            let coordinates = [(position.swing, leg.limits.swing), (position.extension, leg.limits.extension)];
            for (note, (value, [low, high])) in self.commands[2 * i..].iter_mut().zip(coordinates) {
                let is_at_limit = value <= low + AT_LIMIT_RAD || value >= high - AT_LIMIT_RAD;
                let value = f64::from(value);
                *note = [note[0].min(value), note[1].max(value), note[2] + f64::from(u8::from(is_at_limit))];
            }
            let length = f64::from(leg.geometry.length(position.extension));
            let [low, high] = &mut self.lengths_m[i];
            (*low, *high) = (low.min(length), high.max(length));
        }
        for (now, last) in commanded.iter().zip(&self.last_commanded) {
            self.command_speed = self.command_speed.max(f64::from((now - last).abs()) / dt_s);
        }
        self.last_commanded = commanded;
        let (max_torque_nm, torques) = (robot.settings.motor.max_torque_nm, env.motor_torques());
        self.torques.resize(torques.len(), [0.0; 2]);
        for ([squares, at_limit], torque) in self.torques.iter_mut().zip(torques) {
            *squares += torque * torque;
            *at_limit += f64::from(u8::from(torque.abs() >= AT_MAX_TORQUE * max_torque_nm));
        }
        self.motor_speed = env.motor_speeds().iter().fold(self.motor_speed, |most, speed| most.max(speed.abs()));
    }
}

impl Wear {
    /// Both together.
    fn add(&mut self, other: &Self) {
        if self.steps == 0 {
            self.clone_from(other);
            return;
        }
        self.steps += other.steps;
        for (own, other) in self.commands.iter_mut().zip(&other.commands) {
            *own = [own[0].min(other[0]), own[1].max(other[1]), own[2] + other[2]];
        }
        for (own, other) in self.lengths_m.iter_mut().zip(&other.lengths_m) {
            *own = [own[0].min(other[0]), own[1].max(other[1])];
        }
        for (own, other) in self.torques.iter_mut().zip(&other.torques) {
            *own = [own[0] + other[0], own[1] + other[1]];
        }
        self.command_speed = self.command_speed.max(other.command_speed);
        self.motor_speed = self.motor_speed.max(other.motor_speed);
    }

    /// Number of the coordinate in leg space, two a leg, that is at a limit most often, and in which share of the steps.
    pub fn most_limited(&self) -> (usize, f64) {
        largest(self.commands.iter().map(|note| note[2] / self.steps.max(1) as f64))
    }

    /// Number of the coordinate in leg space that is commanded farthest beyond its limits, and how far [rad].
    pub fn farthest_beyond(&self, exported: &Exported<'_>) -> (usize, f64) {
        let legs = exported.controller().legs();
        let limits = legs.iter().flat_map(|leg| [leg.limits.swing, leg.limits.extension]);
        largest(self.commands.iter().zip(limits).map(|([low, high, _], [least, greatest])| {
            (f64::from(least) - low).max(high - f64::from(greatest)).max(0.0)
        }))
    }

    /// Least and greatest commanded leg length [m].
    pub fn lengths_m(&self) -> [f64; 2] {
        self.lengths_m
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], own| [low.min(own[0]), high.max(own[1])])
    }

    /// Number of the motor with the greatest root mean square of torque, and that [N m].
    ///
    /// ```text
    /// tau_rms = sqrt(mean over steps of tau^2)
    /// ```
    ///
    /// Source: the heat of a motor's winding is proportional to the current's square, and the torque to the current.
    pub fn rms_torque_nm(&self) -> (usize, f64) {
        largest(self.torques.iter().map(|[squares, _]| (squares / self.steps.max(1) as f64).sqrt()))
    }

    /// Number of the motor that is at its greatest torque most often, and in which share of the steps.
    pub fn time_at_torque_limit(&self) -> (usize, f64) {
        largest(self.torques.iter().map(|[_, at_limit]| at_limit / self.steps.max(1) as f64))
    }
}

/// Place and value of the largest.
fn largest(values: impl Iterator<Item = f64>) -> (usize, f64) {
    values.enumerate().fold((0, 0.0), |most, own| if own.1 > most.1 { own } else { most })
}

/// The evaluation's episodes with this subject: each episode, and what the robot had to bear in all of them.
pub fn replay(
    exported: &Exported<'_>,
    subject: Subject<'_>,
    settings: &EvaluationSettings,
    workers: &Workers,
) -> (Vec<Episode>, Wear) {
    let policy = exported.policy();
    let open_loop;
    let mover = match subject {
        Subject::Policy => Mover::Policy(&policy),
        Subject::Runtime => Mover::Driver(exported),
        Subject::OpenLoop(own) => {
            open_loop = OpenLoopDriver { exported: *exported, open_loop: own };
            Mover::Driver(&open_loop)
        }
    };
    let (mut episodes, mut all) = (Vec::new(), Wear::default());
    for (episode, wear) in watch_episodes::<Wear>(exported.task(), mover, settings, workers) {
        episodes.push(episode);
        all.add(&wear);
    }
    (episodes, all)
}

/// Name of a coordinate in leg space, two a leg.
pub fn coordinate_name(exported: &Exported<'_>, index: usize) -> String {
    let leg = exported.task().robot.settings.legs.get(index / 2).map_or("a leg", |leg| leg.name());
    format!("{} of {leg}", ["swing", "extension"][index % 2])
}

/// Name of a motor: its leg's and its number; held ones have none.
pub fn motor_name(exported: &Exported<'_>, index: usize) -> String {
    match exported.task().robot.settings.legs.get(index / 2) {
        Some(leg) => format!("motor {} of {}", index % 2 + 1, leg.name()),
        None => "a held motor".to_owned(),
    }
}
