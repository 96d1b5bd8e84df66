//! `canter run`.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, SyncSender, TryRecvError};
use std::thread;
use std::time::{Duration, Instant};

use canter_export::Exported;
use canter_export::exported::{Readings, Running};
use canter_export::protocol::{self, MAX_LINE_BYTES, Said};
use canter_gait::{Mode, RuntimeSettings};
use rustix::termios;

use crate::args::RunArgs;
use crate::commands::learned;
use crate::error::CliError;
use crate::interrupt::Interrupt;

/// Lines that may wait to be looked at; a robot that sends more waits itself.
const WAITING_LINES: usize = 64;

/// What came from the robot's side, and when.
type Heard = (Instant, Result<Option<Said>, String>);

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
    let (sender, heard) = mpsc::sync_channel(WAITING_LINES);
    let num_motors = exported.controller().num_motors();
    thread::spawn(move || listen(input, num_motors, &sender));
    let mut session =
        Session { running: Running::new(&exported, RuntimeSettings::DEFAULT), newest: None, is_ending: false, heard };
    match session.run(&exported, &mut output, || interrupt.stop.load(Ordering::Relaxed)) {
        // The other side has gone: there is nobody left to move.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(unreachable(args.port.as_deref().unwrap_or(Path::new("standard output")), error))
        }
        _ => Ok(ExitCode::SUCCESS),
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
    termios::tcsetattr(&file, termios::OptionalActions::Now, &settings)?;
    Ok(file)
}

/// Reads lines until the other side ends.
fn listen(input: impl Read, num_motors: usize, sender: &SyncSender<Heard>) {
    let mut input = BufReader::new(input);
    let mut line = Vec::new();
    loop {
        line.clear();
        match input.by_ref().take(MAX_LINE_BYTES as u64).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let said = match std::str::from_utf8(&line) {
            Ok(text) if text.ends_with('\n') || line.len() < MAX_LINE_BYTES => protocol::parse(text, num_motors),
            Ok(_) => Err(format!("a line has at most {MAX_LINE_BYTES} bytes")),
            Err(_) => Err("a line is text".to_owned()),
        };
        if sender.send((Instant::now(), said)).is_err() {
            return;
        }
    }
}

/// A robot at the other end.
struct Session<'a> {
    running: Running<'a>,
    /// The newest readings and when they came.
    newest: Option<(Instant, Readings)>,
    /// Whether it comes to a stand for good.
    is_ending: bool,
    heard: Receiver<Heard>,
}

impl Session<'_> {
    /// Steps at the control rate until the robot stands for good.
    fn run(
        &mut self,
        exported: &Exported<'_>,
        output: &mut dyn Write,
        is_stopped: impl Fn() -> bool,
    ) -> io::Result<()> {
        let period = Duration::from_secs_f64(exported.task().settings.control_dt_s);
        // Before the first readings the pose is held; what they are does not matter.
        let nothing = Readings::zero(exported.controller().num_motors());
        writeln!(output, "{}", protocol::greeting(exported))?;
        output.flush()?;
        let mut next = Instant::now();
        loop {
            for message in self.listen() {
                writeln!(output, "{}", protocol::problem(&message))?;
            }
            if is_stopped() {
                self.end();
            }
            let (sensors, age_s) = match &self.newest {
                Some((at, readings)) => (readings, at.elapsed().as_secs_f32()),
                None => (&nothing, f32::INFINITY),
            };
            let mode = self.running.step(sensors.sensors(), age_s);
            writeln!(output, "{}", protocol::targets(mode, self.running.targets()))?;
            output.flush()?;
            if self.is_ending && matches!(mode, Mode::Standing | Mode::Holding) {
                return Ok(());
            }
            next += period;
            match next.checked_duration_since(Instant::now()) {
                Some(rest) => thread::sleep(rest),
                // Too late: the steps that were missed are not made up for in a rush.
                None => next = Instant::now(),
            }
        }
    }

    fn end(&mut self) {
        self.is_ending = true;
        self.running.walk(false);
    }

    /// Takes in what has come since the last step; returns what was not understood.
    fn listen(&mut self) -> Vec<String> {
        let mut problems = Vec::new();
        loop {
            match self.heard.try_recv() {
                Ok((at, Ok(Some(Said::Sensors(readings))))) => self.newest = Some((at, readings)),
                Ok((_, Ok(Some(Said::Walk)))) if !self.is_ending => self.running.walk(true),
                Ok((_, Ok(Some(Said::Walk) | None))) => {}
                Ok((_, Ok(Some(Said::Stop)))) => self.running.walk(false),
                Ok((_, Ok(Some(Said::Quit)))) => self.end(),
                Ok((_, Err(message))) => problems.push(message),
                Err(TryRecvError::Empty) => return problems,
                Err(TryRecvError::Disconnected) => {
                    self.end();
                    return problems;
                }
            }
        }
    }
}
