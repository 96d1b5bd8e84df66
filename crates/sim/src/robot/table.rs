//! Recorded gaits: a CSV file of actuator targets over one cycle.

use std::path::Path;

use canter_gait::prior::{LegGait, TABLE_POINTS, Table, Waveform};
use canter_gait::{Leg, LegPosition};

use super::{NamedGait, Robot};
use crate::file;
use crate::settings::MAX_FILE_BYTES;

/// How far a recording may go beyond the leg's limits: it is held to them [rad].
const TOLERANCE_RAD: f32 = 0.01;

/// Fewest rows that say something of a cycle.
const MIN_ROWS: usize = 4;

/// Targets of all actuators over one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Names of the columns.
    actuators: Vec<String>,
    /// One row for each moment, at equal times [rad].
    rows: Vec<Vec<f64>>,
}

impl Recording {
    /// Reads a file in the robot's `folder`, or below it.
    ///
    /// # Errors
    /// What is wrong with it, and in which line.
    pub fn load(folder: &Path, name: &str) -> Result<Self, String> {
        let cannot_be_read = |error| format!("cannot be read: {error}");
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        // Links are followed first.
        let path = folder.join(name).canonicalize().map_err(cannot_be_read)?;
        if !path.starts_with(folder.canonicalize().map_err(cannot_be_read)?) {
            return Err("it lies outside the robot's folder: copy it beside robot.toml".to_owned());
        }
        let bytes = file::read(&path, MAX_FILE_BYTES as u64).map_err(cannot_be_read)?;
        if bytes.len() > MAX_FILE_BYTES {
            return Err(format!("expected at most {MAX_FILE_BYTES} bytes"));
        }
        let text = String::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
        Self::parse(&text)
    }

    /// Reads CSV text: a line of names, then lines of numbers.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let (_, head) = lines.next().ok_or("it is empty: the first line names the actuators")?;
        let actuators: Vec<String> = head.split(',').map(|name| name.trim().trim_matches('"').to_owned()).collect();
        let mut rows = Vec::new();
        for (index, line) in lines {
            let number = index + 1;
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            if cells.len() != actuators.len() {
                let (expected, found) = (actuators.len(), cells.len());
                return Err(format!("line {number}: expected {expected} numbers, found {found}"));
            }
            let target = |cell: &&str| {
                let value = cell.parse().ok().filter(|value: &f64| value.is_finite() && value.abs() < 1e3);
                value.ok_or_else(|| format!("line {number}: `{cell}` is no angle in rad"))
            };
            rows.push(cells.iter().map(target).collect::<Result<Vec<f64>, String>>()?);
        }
        if rows.len() < MIN_ROWS {
            return Err(format!("expected at least {MIN_ROWS} lines of numbers, found {}", rows.len()));
        }
        Ok(Self { actuators, rows })
    }

    /// The targets of a robot's actuators, two a leg, in each row, `(n x M)` [rad].
    ///
    /// # Errors
    /// As [`gait`](Self::gait).
    pub fn targets(&self, robot: &Robot) -> Result<Vec<Vec<f32>>, String> {
        self.legs(robot)?;
        let column = |name| self.actuators.iter().position(|actuator| actuator == name);
        let columns: Vec<usize> = robot.actuators().filter_map(column).collect();
        Ok(self.rows.iter().map(|row| columns.iter().map(|&column| row[column] as f32).collect()).collect())
    }

    /// The recording as a gait of a robot; it is neither a default nor said to be stable.
    ///
    /// # Errors
    /// An actuator without a column, or a position that a leg cannot have.
    pub fn gait(&self, robot: &Robot, name: &str, stride_frequency_hz: f32) -> Result<NamedGait, String> {
        let part =
            |table: Table| LegGait { waveform: Waveform::Table(table), phase_offset: 0.0, defaults: table.defaults() };
        let legs = self.legs(robot)?.into_iter().map(part).collect();
        Ok(NamedGait { name: name.to_owned(), is_default: false, is_stable: false, stride_frequency_hz, legs })
    }

    /// The motion of every leg of a robot.
    fn legs(&self, robot: &Robot) -> Result<Vec<Table>, String> {
        let legs = robot.legs.iter().zip(&robot.settings.legs);
        legs.map(|(leg, settings)| self.leg(leg, settings.motors_and_actuators().1)).collect()
    }

    /// The motion of a leg whose two actuators have these names.
    ///
    /// # Errors
    /// An actuator without a column, or a position that the leg cannot have.
    pub fn leg(&self, leg: &Leg, names: &[String]) -> Result<Table, String> {
        let column = |name: &String| {
            let found = self.actuators.iter().position(|actuator| actuator == name);
            found.ok_or_else(|| format!("it has no column for the actuator `{name}`"))
        };
        let columns = names.iter().map(column).collect::<Result<Vec<usize>, String>>()?;
        let &[first, second] = &columns[..] else {
            return Err("a leg has two actuators".to_owned());
        };
        let mut positions = [LegPosition::default(); TABLE_POINTS];
        for (i, position) in positions.iter_mut().enumerate() {
            let place = i as f64 * self.rows.len() as f64 / TABLE_POINTS as f64;
            let (row, u) = (place as usize, place.fract());
            let (from, to) = (&self.rows[row], &self.rows[(row + 1) % self.rows.len()]);
            let at = |column: usize| (from[column] + u * (to[column] - from[column])) as f32;
            let recorded = leg.position_at([at(first), at(second)]);
            *position = leg.limits.clamp(recorded);
            let beyond = (recorded.swing - position.swing).abs().max((recorded.extension - position.extension).abs());
            if beyond.is_nan() || beyond > TOLERANCE_RAD {
                let [first, second] = [at(first), at(second)];
                return Err(format!(
                    "row {} puts `{}` at {first} and `{}` at {second} rad, beyond the leg's limits",
                    row + 1,
                    names[0],
                    names[1]
                ));
            }
        }
        Table::new(&positions).ok_or_else(|| format!("the leg of `{}` cannot be so", names[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_lines_are_named() {
        let error = |text: &str| Recording::parse(text).unwrap_err();
        assert_eq!(error(""), "it is empty: the first line names the actuators");
        assert_eq!(error("a,b\n1,2\n3"), "line 3: expected 2 numbers, found 1");
        assert_eq!(error("a,b\n1,x"), "line 2: `x` is no angle in rad");
        assert_eq!(error("a,b\n1,nan"), "line 2: `nan` is no angle in rad");
        assert_eq!(error("a,b\n1,2"), "expected at least 4 lines of numbers, found 1");
    }
}
