//! What a sweep trains: which values of which keys.

use std::str::FromStr;

use canter_learn::random::{Purpose, stream};
use serde::Serialize;

use crate::config::{ConfigError, Resolved, open_preset, resolve};
use crate::environment::uniform;

/// In place of a key it stands for the preset itself.
pub const PRESET: &str = "preset";

/// More trainings than these are a mistake.
const MAX_JOBS: u64 = 10_000;

/// A key and the values that it takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axis {
    /// Path of a configuration value, or [`PRESET`].
    pub key: String,
    /// Its values.
    pub values: Values,
}

/// The values of a key.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Values {
    /// One after the other, as TOML.
    Listed(Vec<String>),
    /// Drawn evenly between two numbers.
    Between {
        /// The lower one.
        low: f64,
        /// The higher one.
        high: f64,
        /// Whether their logarithms are drawn evenly.
        logarithmic: bool,
    },
}

/// What is wrong with a sweep before anything is trained.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// A grid has no numbers between two others.
    #[error("{0}: a range is for random points: say how many with --random N, or list the values as {0}=A,B,C")]
    RangeInGrid(String),
    /// The same key twice.
    #[error("{0}: given twice")]
    Twice(String),
    /// Seeds have their own option.
    #[error("seed: every point is trained with each of --seeds N")]
    Seed,
    /// Nothing to vary.
    #[error("nothing to sweep over: name a key and its values with --over KEY=A,B,C")]
    Nothing,
    /// Far too much.
    #[error("these are {0} trainings; at most {MAX_JOBS} are done in one sweep")]
    TooMany(u128),
}

/// A point: the value of every key.
pub type Point = Vec<(String, String)>;

/// Everything that decides a sweep's results.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Preset or path of a configuration, where no axis names one.
    pub preset: String,
    /// Values that every training has.
    pub overrides: Vec<(String, String)>,
    /// What is varied.
    pub axes: Vec<Axis>,
    /// How many random points; none: every combination.
    pub num_random: Option<u64>,
    /// Each point is trained with these.
    pub seeds: Vec<u64>,
}

impl FromStr for Axis {
    type Err = String;

    /// `KEY=A,B,C`, `KEY=LOW..HIGH` or `KEY=LOW..HIGH/log`.
    fn from_str(text: &str) -> Result<Self, String> {
        const EXPECTED: &str = "expected KEY=A,B,C or KEY=LOW..HIGH or KEY=LOW..HIGH/log, for example \
                                policy.authority=0,0.5,1 or ppo.learning_rate=1e-4..1e-2/log";
        let (key, values) = text.split_once('=').ok_or(EXPECTED)?;
        let (key, values) = (key.trim().to_owned(), values.trim());
        if key.is_empty() || values.is_empty() {
            return Err(EXPECTED.to_owned());
        }
        if let Some((low, high)) = values.split_once("..") {
            let (high, logarithmic) = high.strip_suffix("/log").map_or((high, false), |high| (high, true));
            let (Ok(low), Ok(high)) = (low.trim().parse::<f64>(), high.trim().parse::<f64>()) else {
                return Err(EXPECTED.to_owned());
            };
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(format!("{low} is not less than {high}"));
            }
            if logarithmic && low <= 0.0 {
                return Err(format!("{low} has no logarithm"));
            }
            return Ok(Self { key, values: Values::Between { low, high, logarithmic } });
        }
        Ok(Self { key, values: Values::Listed(listed(values).map_err(str::to_owned)?) })
    }
}

/// The values between commas, but not between those within brackets or quotes.
fn listed(text: &str) -> Result<Vec<String>, &'static str> {
    let (mut values, mut value, mut depth, mut is_quoted) = (Vec::new(), String::new(), 0_i32, false);
    for character in text.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            '[' if !is_quoted => depth += 1,
            ']' if !is_quoted => depth -= 1,
            ',' if !is_quoted && depth == 0 => {
                values.push(std::mem::take(&mut value));
                continue;
            }
            _ => {}
        }
        value.push(character);
    }
    values.push(value);
    let values: Vec<String> = values.iter().map(|value| value.trim().to_owned()).collect();
    if depth != 0 || is_quoted || values.iter().any(String::is_empty) {
        return Err("a value is missing between two commas, or a bracket or quote is open");
    }
    Ok(values)
}

impl Plan {
    /// Every point in its order: all combinations, the last key fastest, or random ones that depend on the plan alone.
    ///
    /// # Errors
    /// A plan that cannot be carried out.
    pub fn points(&self) -> Result<Vec<Point>, PlanError> {
        if self.axes.is_empty() {
            return Err(PlanError::Nothing);
        }
        for (i, axis) in self.axes.iter().enumerate() {
            if self.axes[..i].iter().any(|other| other.key == axis.key) {
                return Err(PlanError::Twice(axis.key.clone()));
            }
            if axis.key == "seed" {
                return Err(PlanError::Seed);
            }
            if matches!(axis.values, Values::Between { .. }) && self.num_random.is_none() {
                return Err(PlanError::RangeInGrid(axis.key.clone()));
            }
        }
        let count = |axis: &Axis| match &axis.values {
            Values::Listed(values) => values.len() as u128,
            Values::Between { .. } => 1,
        };
        let in_grid = self.axes.iter().map(count).fold(1, u128::saturating_mul);
        let num_points = self.num_random.map_or(in_grid, u128::from);
        let num_jobs = num_points.saturating_mul(self.seeds.len() as u128);
        if num_jobs > u128::from(MAX_JOBS) {
            return Err(PlanError::TooMany(num_jobs));
        }
        Ok((0..num_points as u64)
            .map(|number| if self.num_random.is_some() { self.random_point(number) } else { self.grid_point(number) })
            .collect())
    }

    fn grid_point(&self, mut number: u64) -> Point {
        let mut point: Point = Vec::new();
        for axis in self.axes.iter().rev() {
            let Values::Listed(values) = &axis.values else { unreachable!("refused by the caller") };
            point.push((axis.key.clone(), values[(number % values.len() as u64) as usize].clone()));
            number /= values.len() as u64;
        }
        point.reverse();
        point
    }

    fn random_point(&self, number: u64) -> Point {
        let mut rng = stream(0, Purpose::Sweep, 0, number);
        let mut draw = |values: &Values| {
            let share = uniform(&mut rng);
            match values {
                Values::Listed(values) => values[(share * values.len() as f64) as usize].clone(),
                Values::Between { low, high, logarithmic: false } => format!("{:?}", low + share * (high - low)),
                Values::Between { low, high, logarithmic: true } => {
                    format!("{:?}", (low.ln() + share * (high.ln() - low.ln())).exp().clamp(*low, *high))
                }
            }
        };
        self.axes.iter().map(|axis| (axis.key.clone(), draw(&axis.values))).collect()
    }

    /// The configuration of a point with a seed.
    ///
    /// # Errors
    /// Whatever is wrong with it.
    pub fn resolved(&self, point: &Point, seed: u64) -> Result<Resolved, ConfigError> {
        let preset = point.iter().find(|(key, _)| key == PRESET).map_or(&self.preset, |(_, value)| value);
        let mut document = open_preset(preset)?;
        let values = point.iter().filter(|(key, _)| key != PRESET);
        for (key, value) in self.overrides.iter().chain(values) {
            document.set(key, value);
        }
        document.set("seed", &seed.to_string());
        resolve(&document)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(axes: &[&str], num_random: Option<u64>) -> Plan {
        Plan {
            preset: "doggo".to_owned(),
            overrides: Vec::new(),
            axes: axes.iter().map(|axis| axis.parse().unwrap()).collect(),
            num_random,
            seeds: vec![1, 2],
        }
    }

    #[test]
    fn a_grid_is_every_combination_the_last_key_fastest() {
        let points = plan(&["policy.authority=0.5, 1", "policy.ranges.frequency_factor=[0.5,2],[1,2]"], None).points();
        let values: Vec<Vec<String>> =
            points.unwrap().into_iter().map(|point| point.into_iter().map(|(_, value)| value).collect()).collect();
        assert_eq!(values, [["0.5", "[0.5,2]"], ["0.5", "[1,2]"], ["1", "[0.5,2]"], ["1", "[1,2]"]]);
    }

    #[test]
    fn random_points_lie_in_their_ranges_and_are_the_same_each_time() {
        let plan = plan(&["ppo.learning_rate=1e-4..1e-2/log", "ppo.gamma=0.9..0.99", "ppo.num_epochs=4,8"], Some(200));
        let points = plan.points().unwrap();
        assert_eq!(points, plan.points().unwrap());
        let mut below_middle = 0;
        for point in &points {
            let number = |i: usize| point[i].1.parse::<f64>().unwrap();
            assert!((1e-4..=1e-2).contains(&number(0)) && (0.9..=0.99).contains(&number(1)));
            assert!(["4", "8"].contains(&point[2].1.as_str()));
            below_middle += u32::from(number(0) < 1e-3);
        }
        // Half of the logarithms lie below the middle one; evenly drawn rates would leave a tenth there.
        assert!((70..=130).contains(&below_middle), "{below_middle}");
    }

    #[test]
    fn what_cannot_be_carried_out_is_refused() {
        let refusal = |axes: &[&str], num_random| plan(axes, num_random).points().unwrap_err();
        assert_eq!(refusal(&[], None), PlanError::Nothing);
        assert_eq!(refusal(&["ppo.gamma=0.9..0.99"], None), PlanError::RangeInGrid("ppo.gamma".to_owned()));
        assert_eq!(refusal(&["a=1", "a=2"], None), PlanError::Twice("a".to_owned()));
        assert_eq!(refusal(&["seed=1,2"], None), PlanError::Seed);
        assert_eq!(refusal(&["a=1"], Some(5001)), PlanError::TooMany(10_002));
        for wrong in ["a", "a=", "=1", "a=1,,2", "a=[1,2", "a=2..1", "a=1..x", "a=0..1/log", "a=nan..1"] {
            assert!(wrong.parse::<Axis>().is_err(), "{wrong}");
        }
    }
}
