//! `canter run`.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use canter_export::Exported;
use canter_export::exported::{Readings, Running};
use canter_export::protocol::{self, Listener, Said};
use canter_gait::Mode;
use rustix::termios;

use crate::args::RunArgs;
use crate::commands::learned;
use crate::error::CliError;
use crate::interrupt::Interrupt;

/// How long a robot that has to come to a stand may be without readings.
const GRACE: Duration = Duration::from_secs(1);

/// Problems that are told in one step; further ones are the same robot's.
const MOST_PROBLEMS: usize = 8;

/// `canter run`.
pub fn run(args: &RunArgs) -> Result<ExitCode, CliError> {
    let (resolved, policy) = learned(&args.run, |document| document)?;
    let exported = Exported::new(&resolved.task, &policy)?;
    let (input, mut output): (Box<dyn Read + Send>, Box<dyn Write>) = match &args.port {
        Some(port) => {
            let file = open_port(port, args.baud).map_err(|source| unreachable(port, source))?;
            let input = file.try_clone().map_err(|source| unreachable(port, source))?;
            (Box::new(input), Box::new(file))
        }
        None => (Box::new(io::stdin()), Box::new(io::stdout())),
    };
    let interrupt = Interrupt::listen("\ncoming to a stand; once more ends at once")?;
    let inbox = Arc::new(Mutex::new(Inbox::default()));
    let listener = Listener::new(input, exported.controller().num_motors());
    let shared = inbox.clone();
    thread::spawn(move || listen(listener, &shared));
    let mut session = Session::new(&exported, &inbox);
    let end = session.run(&exported, &mut output, || interrupt.stop.load(Ordering::Relaxed));
    let path = args.port.as_deref().unwrap_or(Path::new("standard input and output"));
    match end {
        Ok(()) => Ok(ExitCode::SUCCESS),
        // Whoever piped the lines somewhere has read enough.
        Err(Failure::Io(error)) if error.kind() == io::ErrorKind::BrokenPipe && session.stands() => {
            Ok(ExitCode::SUCCESS)
        }
        Err(Failure::Io(error)) if session.stands() => Err(unreachable(path, error)),
        Err(Failure::Io(_)) => Err(CliError::LeftMoving { why: "the connection was lost", path: path.to_owned() }),
        Err(Failure::LeftMoving(why)) => Err(CliError::LeftMoving { why, path: path.to_owned() }),
    }
}

fn unreachable(port: &Path, source: io::Error) -> CliError {
    CliError::Port { path: port.to_owned(), source }
}

/// Opens a serial port raw: bytes as they are, no echo.
fn open_port(path: &Path, baud: u32) -> io::Result<File> {
    let no_control = rustix::fs::OFlags::NOCTTY.bits() as i32;
    let file = OpenOptions::new().read(true).write(true).custom_flags(no_control).open(path)?;
    let mut settings = termios::tcgetattr(&file)?;
    settings.make_raw();
    settings.set_speed(baud)?;
    // What came before now is not how the robot is.
    termios::tcsetattr(&file, termios::OptionalActions::Flush, &settings)?;
    Ok(file)
}

/// What has come from the robot's side and was not looked at yet.
#[derive(Default)]
struct Inbox {
    /// The newest readings, and when they came.
    newest: Option<(Instant, Readings)>,
    /// The last word on whether to walk.
    walk: Option<bool>,
    quits: bool,
    /// What was not understood.
    problems: Vec<String>,
    /// How the other side's words ended.
    end: Option<io::Result<()>>,
}

impl Inbox {
    fn take(shared: &Mutex<Self>) -> Self {
        std::mem::take(&mut *shared.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Listens until the other side ends. Readings are looked at when they come, so that none waits and grows old in a queue.
fn listen(mut listener: Listener<impl Read>, inbox: &Mutex<Inbox>) {
    loop {
        let heard = listener.hear();
        let mut inbox = inbox.lock().unwrap_or_else(PoisonError::into_inner);
        match heard {
            Ok(Some(Ok(Some(Said::Sensors(readings))))) => inbox.newest = Some((Instant::now(), readings)),
            Ok(Some(Ok(Some(Said::Walk)))) => inbox.walk = Some(true),
            Ok(Some(Ok(Some(Said::Stop)))) => inbox.walk = Some(false),
            Ok(Some(Ok(Some(Said::Quit)))) => inbox.quits = true,
            Ok(Some(Ok(None))) => {}
            Ok(Some(Err(message))) if inbox.problems.len() < MOST_PROBLEMS => inbox.problems.push(message),
            Ok(Some(Err(_))) => {}
            Ok(None) => return inbox.end = Some(Ok(())),
            Err(error) => return inbox.end = Some(Err(error)),
        }
    }
}

/// Why a session ended otherwise than with a robot that stands.
enum Failure {
    Io(io::Error),
    LeftMoving(&'static str),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// A robot at the other end.
struct Session<'a> {
    running: Running<'a>,
    inbox: &'a Mutex<Inbox>,
    /// The newest readings, and when they came.
    newest: Option<(Instant, Readings)>,
    /// What the robot was doing when it last did anything but hold its pose.
    last_mode: Mode,
    holds_since: Option<Instant>,
    /// Whether it comes to a stand for good.
    is_ending: bool,
    /// How the other side's words ended.
    end: Option<io::Result<()>>,
}

impl<'a> Session<'a> {
    fn new(exported: &Exported<'a>, inbox: &'a Mutex<Inbox>) -> Self {
        Self {
            running: Running::new(exported),
            inbox,
            newest: None,
            last_mode: Mode::Waiting,
            holds_since: None,
            is_ending: false,
            end: None,
        }
    }

    /// Steps at the control rate until the robot stands for good, or cannot be brought there.
    fn run(
        &mut self,
        exported: &Exported<'_>,
        output: &mut dyn Write,
        is_stopped: impl Fn() -> bool,
    ) -> Result<(), Failure> {
        let period = Duration::from_secs_f64(exported.task().settings.control_dt_s);
        let nothing = Readings::zero(exported.controller().num_motors());
        writeln!(output, "{}", protocol::greeting(exported))?;
        output.flush()?;
        let mut next = Instant::now();
        loop {
            for message in self.take_in() {
                writeln!(output, "{}", protocol::problem(&message))?;
            }
            if self.end.is_some() || is_stopped() {
                self.stand_for_good();
            }
            let (sensors, age_s) = match &self.newest {
                Some((at, readings)) => (readings, at.elapsed().as_secs_f32()),
                None => (&nothing, f32::INFINITY),
            };
            let mode = self.running.step(sensors.sensors(), age_s);
            writeln!(output, "{}", protocol::targets(mode, self.running.targets()))?;
            output.flush()?;
            self.note(mode);
            if self.is_ending && self.is_over(mode)? {
                return self.end.take().unwrap_or(Ok(())).map_err(Failure::Io);
            }
            // What is late is not made up for by a hasty step.
            let now = Instant::now();
            next = if now < next + period { next + period } else { now + period };
            thread::sleep(next.saturating_duration_since(now));
        }
    }

    /// Takes in what has come since the last step; returns what was not understood.
    fn take_in(&mut self) -> Vec<String> {
        let inbox = Inbox::take(self.inbox);
        self.newest = inbox.newest.or(self.newest.take());
        self.end = inbox.end.or(self.end.take());
        if let (Some(walk), false) = (inbox.walk, self.is_ending) {
            self.running.walk(walk);
        }
        if inbox.quits {
            self.stand_for_good();
        }
        inbox.problems
    }

    fn stand_for_good(&mut self) {
        self.is_ending = true;
        self.running.walk(false);
    }

    fn note(&mut self, mode: Mode) {
        if mode == Mode::Holding {
            self.holds_since.get_or_insert_with(Instant::now);
        } else {
            (self.holds_since, self.last_mode) = (None, mode);
        }
    }

    /// Whether the robot stands, or nothing was ever asked of it.
    fn stands(&self) -> bool {
        matches!(self.last_mode, Mode::Standing | Mode::Waiting)
    }

    /// Whether a robot that is to stand for good does.
    fn is_over(&mut self, mode: Mode) -> Result<bool, Failure> {
        if self.stands() || mode != Mode::Holding {
            return Ok(self.stands());
        }
        match self.end.take() {
            Some(Ok(())) => Err(Failure::LeftMoving("the input ended")),
            Some(Err(error)) => Err(Failure::Io(error)),
            None if self.holds_since.is_some_and(|since| since.elapsed() > GRACE) => {
                Err(Failure::LeftMoving("no readings came"))
            }
            None => Ok(false),
        }
    }
}
