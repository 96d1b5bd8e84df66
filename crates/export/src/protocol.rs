//! The line protocol of `canter run`: `docs/line-protocol.md` describes it.

use std::io::{self, BufRead, BufReader, Read};

use canter_gait::Mode;

use crate::exported::{Exported, Readings};

/// Version of the protocol.
pub const VERSION: u32 = 1;

/// A longer line is refused as a whole [bytes, with its end].
pub const MAX_LINE_BYTES: usize = 4096;

/// What the robot's side says.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// Readings of all sensors.
    Sensors(Readings),
    /// Get going.
    Walk,
    /// Come to a stand.
    Stop,
    /// Come to a stand and end.
    Quit,
}

/// One line from the robot's side: none if it says nothing, an error if it was not understood.
pub type Heard = Result<Option<Said>, String>;

/// Reads what the robot's side says.
#[derive(Debug)]
pub struct Listener<R> {
    input: BufReader<R>,
    line: Vec<u8>,
    num_motors: usize,
}

impl<R: Read> Listener<R> {
    /// Reads from here on.
    pub fn new(input: R, num_motors: usize) -> Self {
        Self { input: BufReader::new(input), line: Vec::new(), num_motors }
    }

    /// Waits for the next line; none once there will be no more. A line counts when its end has come: what a connection
    /// leaves when it breaks is no command.
    ///
    /// # Errors
    /// The system's.
    pub fn hear(&mut self) -> io::Result<Option<Heard>> {
        self.line.clear();
        let num_bytes = self.input.by_ref().take(MAX_LINE_BYTES as u64).read_until(b'\n', &mut self.line)?;
        if self.line.ends_with(b"\n") {
            let text = std::str::from_utf8(&self.line).map_err(|_| "a line is text".to_owned());
            return Ok(Some(text.and_then(|text| parse(text, self.num_motors))));
        }
        if num_bytes < MAX_LINE_BYTES {
            return Ok(None);
        }
        self.input.skip_until(b'\n')?;
        Ok(Some(Err(format!("a line has at most {MAX_LINE_BYTES} bytes"))))
    }
}

/// Understands one line from the robot's side; none if it is empty or a comment.
///
/// # Errors
/// What is wrong with it.
pub fn parse(line: &str, num_motors: usize) -> Heard {
    let mut words = line.split_ascii_whitespace();
    let said = match words.next() {
        None => return Ok(None),
        Some(word) if word.starts_with('#') => return Ok(None),
        Some("walk") => Said::Walk,
        Some("stop") => Said::Stop,
        Some("quit") => Said::Quit,
        Some("sensors") => {
            let number = |word: &str| {
                let value = word.parse().ok().filter(|value: &f32| value.is_finite());
                value.ok_or_else(|| format!("`{}` is no finite number", word.escape_default()))
            };
            let values = words.by_ref().map(number).collect::<Result<Vec<f32>, String>>()?;
            let expected = 2 * num_motors + 6;
            if values.len() != expected {
                return Err(format!("sensors: expected {expected} numbers, found {}", values.len()));
            }
            let (motor_angles, rest) = values.split_at(num_motors);
            let (motor_velocities, rest) = rest.split_at(num_motors);
            Said::Sensors(Readings {
                motor_angles: motor_angles.to_vec(),
                motor_velocities: motor_velocities.to_vec(),
                orientation: [rest[0], rest[1], rest[2]],
                angular_velocity_in_body: [rest[3], rest[4], rest[5]],
            })
        }
        Some(word) => return Err(format!("`{}` is none of sensors, walk, stop, quit", word.escape_default())),
    };
    match words.next() {
        None => Ok(Some(said)),
        Some(word) => Err(format!("`{}` is too much", word.escape_default())),
    }
}

/// The first line to the robot's side.
pub fn greeting(exported: &Exported<'_>) -> String {
    let (motors, dt_s) = (exported.controller().num_motors(), exported.task().settings.control_dt_s);
    format!("canter {VERSION} motors {motors} control_dt_s {dt_s}")
}

/// The line of one control step; while the robot waits there are no targets.
pub fn targets(mode: Mode, targets: &[f32]) -> String {
    if mode == Mode::Waiting {
        return mode.name().to_owned();
    }
    targets.iter().fold(format!("targets {}", mode.name()), |line, target| format!("{line} {target:.6}"))
}

/// The line about one from the robot's side that was not understood.
pub fn problem(message: &str) -> String {
    format!("error {message}")
}

/// What a line of [`targets`] says, for the robot's side: the mode's name and the targets [rad].
pub fn parse_targets(line: &str) -> Option<(&str, Vec<f32>)> {
    let mut words = line.strip_prefix("targets ")?.split_ascii_whitespace();
    let mode = words.next()?;
    Some((mode, words.map(str::parse).collect::<Result<_, _>>().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_understood() {
        assert_eq!(parse("walk\r", 2), Ok(Some(Said::Walk)));
        assert_eq!(parse("", 2), Ok(None));
        assert_eq!(parse("# a comment", 2), Ok(None));
        let Ok(Some(Said::Sensors(readings))) = parse("sensors 1 2 3 4 5 6 7 8 9 1e1", 2) else { panic!() };
        assert_eq!(readings.flat(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    }

    #[test]
    fn wrong_lines_are_told_what_is_wrong() {
        assert_eq!(parse("sensors 1 2", 2), Err("sensors: expected 10 numbers, found 2".to_owned()));
        assert_eq!(parse("sensors 1 nan", 2), Err("`nan` is no finite number".to_owned()));
        assert_eq!(parse("run", 2), Err("`run` is none of sensors, walk, stop, quit".to_owned()));
        assert_eq!(parse("stop now", 2), Err("`now` is too much".to_owned()));
        assert_eq!(parse("\u{1b}[2J", 2), Err("`\\u{1b}[2J` is none of sensors, walk, stop, quit".to_owned()));
    }

    #[test]
    fn targets_read_back() {
        let line = targets(Mode::RampingIn, &[0.5, -1.25]);
        assert_eq!(line, "targets ramping-in 0.500000 -1.250000");
        assert_eq!(parse_targets(&line), Some(("ramping-in", vec![0.5, -1.25])));
        assert_eq!(parse_targets("targets walking x"), None);
        assert_eq!(targets(Mode::Waiting, &[0.0; 2]), "waiting");
    }

    #[test]
    fn only_whole_lines_of_bearable_length_count() {
        let mut said = "quit ".repeat(MAX_LINE_BYTES);
        said += "quit\nwalk\n";
        // As long as may be, and one byte too long.
        said += &format!("#{}\n", "x".repeat(MAX_LINE_BYTES - 2));
        said += &format!("#{}\nstop", "x".repeat(MAX_LINE_BYTES - 1));
        let mut listener = Listener::new(said.as_bytes(), 2);
        let too_long = || Some(Err("a line has at most 4096 bytes".to_owned()));
        assert_eq!(listener.hear().unwrap(), too_long());
        assert_eq!(listener.hear().unwrap(), Some(Ok(Some(Said::Walk))));
        assert_eq!(listener.hear().unwrap(), Some(Ok(None)));
        assert_eq!(listener.hear().unwrap(), too_long());
        assert_eq!(listener.hear().unwrap(), None);
        let mut listener = Listener::new(&b"stop \xff\n"[..], 2);
        assert_eq!(listener.hear().unwrap(), Some(Err("a line is text".to_owned())));
    }
}
