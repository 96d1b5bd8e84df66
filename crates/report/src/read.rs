//! The files that are read, and what has to be true of them. `docs/run-directory.md` and `docs/metrics.md` describe them.

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};

use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer};

use crate::error::ReportError;

/// The version of `compare.json` and of trajectories.
const VERSION: u64 = 1;

/// More of a file is not read: an episode of 100,000 steps, the longest that is recorded, has half of it [bytes].
const MAX_FILE_BYTES: u64 = 1 << 28;

/// Numbers of our files stay far below it, seeds included; beyond it nothing can be drawn.
const LARGEST_NUMBER: f64 = 1e20;

/// Sums of such counts do not overflow.
const LARGEST_COUNT: u64 = 1 << 53;

/// What a robot's times, lengths and torques lie between [s, m, N m].
const POSSIBLE_SIZES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// The replay has a bit for each leg.
const MAX_LEGS: usize = 16;

const TRAIN_AGAIN: &str = "it comes from `canter train`; `canter resume RUN` writes it again";
const COMPARE_AGAIN: &str = "it comes from `canter compare`; run that again";
const SWEEP_AGAIN: &str = "it comes from `canter sweep`; run that again";
const EXPORT_AGAIN: &str = "remove the file, and export again";
const TRAJECTORY_AGAIN: &str = "remove the file to leave its gait out, or record it again";

/// `eval.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Verdict {
    pub protocol: Protocol,
    pub policy: Option<GaitReport>,
    pub prior: GaitReport,
    pub prior_name: String,
    pub default_gaits: BTreeMap<String, GaitReport>,
    pub default_gait: String,
    pub default_speed_m_per_s: f64,
    pub speed_ratio: Option<f64>,
    pub speed_ratio_ci: Option<[f64; 2]>,
    pub prior_speed_ratio: Option<f64>,
    pub prior_speed_ratio_ci: Option<[f64; 2]>,
}

/// How a verdict was measured.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Protocol {
    pub robot: String,
    #[serde(deserialize_with = "count")]
    pub num_episodes: u64,
    pub episode_s: f64,
    pub settle_s: f64,
    pub seed: u64,
    pub slope_deg: f64,
    pub friction: Option<f64>,
    /// What else of the world was changed, by its key.
    #[serde(default)]
    pub changed: BTreeMap<String, Changed>,
}

/// A value of a task: a number, or a least and a greatest one.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Changed {
    Number(f64),
    Range([f64; 2]),
}

impl Display for Changed {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Range([low, high]) => write!(f, "{low} to {high}"),
        }
    }
}

/// A gait in `eval.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct GaitReport {
    pub speed_m_per_s: f64,
    pub speed_ci: [f64; 2],
    pub displacement_speed_m_per_s: f64,
    #[serde(deserialize_with = "count")]
    pub falls: u64,
    #[serde(deserialize_with = "counts")]
    pub falls_by_cause: BTreeMap<String, u64>,
    pub drift_m: f64,
    pub heading_deg: f64,
    pub height_std_m: f64,
    pub power_w: f64,
    pub cost_of_transport: Option<f64>,
    pub episode_return: f64,
    pub speeds_m_per_s: Vec<f64>,
}

/// A line of `metrics.jsonl`.
#[derive(Clone, Debug, Deserialize)]
pub struct Metrics {
    #[serde(deserialize_with = "count")]
    pub env_steps: u64,
    pub episode_return: Option<f64>,
    #[serde(deserialize_with = "counts")]
    pub accidents: BTreeMap<String, u64>,
    pub speed_m_per_s: f64,
    pub power_w: f64,
    pub mean_std: f64,
    pub approx_kl: f64,
    pub explained_variance: Option<f64>,
}

/// A file of `trajectories/`: one recorded episode with T steps, L legs, M motors.
#[derive(Clone, Debug, Deserialize)]
pub struct Trajectory {
    pub name: String,
    pub robot: String,
    pub legs: Vec<String>,
    pub control_dt_s: f64,
    pub settle_s: f64,
    pub slope_deg: f64,
    pub terminated: Option<String>,
    pub leg_length_m: f64,
    pub max_torque_nm: f64,
    pub swing_limits_rad: [f64; 2],
    pub extension_limits_rad: [f64; 2],
    /// (T) [s]
    pub time_s: Vec<f64>,
    /// (T) [cycles]
    pub phase: Vec<f64>,
    /// (T) in the ground's frame [m]
    pub position_m: Vec<[f64; 3]>,
    /// (T) roll, pitch, yaw [rad]
    pub orientation_rad: Vec<[f64; 3]>,
    /// (T x L) in the ground's frame [m]
    pub hip_m: Vec<Vec<[f64; 3]>>,
    /// (T x L x 2) in the ground's frame [m]
    pub knee_m: Vec<Vec<[[f64; 3]; 2]>>,
    /// (T x L) in the ground's frame [m]
    pub foot_m: Vec<Vec<[f64; 3]>>,
    /// (T x L) 1: touches the ground
    pub contact: Vec<Vec<u8>>,
    /// (T) contacts of anything but feet with the ground
    pub body_contact: Vec<u64>,
    /// (T x L) [rad]
    pub commanded_swing_rad: Vec<Vec<f64>>,
    /// (T x L) [rad]
    pub commanded_extension_rad: Vec<Vec<f64>>,
    /// (T x L) [rad]
    pub swing_rad: Vec<Vec<f64>>,
    /// (T x L) [rad]
    pub extension_rad: Vec<Vec<f64>>,
    /// (T x M) [N m]
    pub torque_nm: Vec<Vec<f64>>,
}

/// `compare.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Comparison {
    pub robot: String,
    pub canter: String,
    pub quick: bool,
    pub protocol: ComparisonProtocol,
    pub default_rung: String,
    pub rungs: BTreeMap<String, Rung>,
    pub sweeps: BTreeMap<String, Condition>,
    pub claims: Vec<Claim>,
    pub trajectories: BTreeMap<String, String>,
    pub uphill_trajectories: BTreeMap<String, String>,
}

/// The recorded episodes of a comparison, by rung.
#[derive(Clone, Debug)]
pub struct ComparedTrajectories {
    /// On level ground.
    pub level: BTreeMap<String, Trajectory>,
    /// On a slope.
    pub uphill: BTreeMap<String, Trajectory>,
}

/// How a comparison was made.
#[derive(Clone, Debug, Deserialize)]
pub struct ComparisonProtocol {
    #[serde(deserialize_with = "count")]
    pub budget_env_steps: u64,
    pub seeds: Vec<u64>,
    pub evaluation: Evaluation,
    pub text: String,
}

/// How each gait of a comparison was measured.
#[derive(Clone, Debug, Deserialize)]
pub struct Evaluation {
    #[serde(deserialize_with = "count")]
    pub num_episodes: u64,
    pub episode_s: f64,
    pub settle_s: f64,
    pub seed: u64,
}

/// One way to a gait.
#[derive(Clone, Debug, Deserialize)]
pub struct Rung {
    pub label: String,
    pub kind: Kind,
    pub description: String,
    pub seeds: Vec<SeedResult>,
    pub speed_iqm: f64,
    pub speed_ci: [f64; 2],
    pub return_iqm: f64,
    pub return_ci: [f64; 2],
    pub ratio_to_default: Option<Ratio>,
    pub probability_faster_than_default: Option<f64>,
    pub probability_faster_than_tuned: Option<f64>,
}

/// How a rung came to its gait.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    Gait,
    Tuned,
    Learned,
}

/// A ratio of interquartile means with its interval.
#[derive(Clone, Debug, Deserialize)]
pub struct Ratio {
    pub iqm: f64,
    pub ci: [f64; 2],
}

/// A rung with one seed.
#[derive(Clone, Debug, Deserialize)]
pub struct SeedResult {
    pub seed: Option<u64>,
    #[serde(deserialize_with = "count")]
    pub env_steps: u64,
    pub speed_m_per_s: f64,
    pub displacement_speed_m_per_s: f64,
    #[serde(deserialize_with = "count")]
    pub falls: u64,
    #[serde(deserialize_with = "count")]
    pub num_episodes: u64,
    #[serde(deserialize_with = "counts")]
    pub falls_by_cause: BTreeMap<String, u64>,
    pub episode_return: f64,
    pub drift_m: f64,
    pub heading_deg: f64,
    pub height_std_m: f64,
    pub power_w: f64,
    pub cost_of_transport: Option<f64>,
    pub speed_per_step_std_m: f64,
    pub speeds_m_per_s: Vec<f64>,
    pub return_curve: Vec<[f64; 2]>,
}

/// One condition that was varied.
#[derive(Clone, Debug, Deserialize)]
pub struct Condition {
    pub unit: String,
    pub values: Vec<f64>,
    pub rungs: BTreeMap<String, SweepCurve>,
}

/// A rung over the values of a sweep.
#[derive(Clone, Debug, Deserialize)]
pub struct SweepCurve {
    pub speed_m_per_s: Vec<f64>,
    pub speed_ci: Vec<[f64; 2]>,
    pub falls_per_episode: Vec<f64>,
}

/// A row of the claims table.
#[derive(Clone, Debug, Deserialize)]
pub struct Claim {
    pub claim: String,
    pub source: String,
    pub paper: String,
    pub ours: String,
    pub holds: Option<bool>,
    pub sentence: String,
}

/// `sweep.json`.
#[derive(Clone, Debug, Deserialize)]
pub struct Sweep {
    pub canter: String,
    pub preset: String,
    pub overrides: Vec<String>,
    pub keys: Vec<String>,
    pub seeds: Vec<u64>,
    pub points: Vec<SweepPoint>,
}

/// One point of a sweep over its seeds.
#[derive(Clone, Debug, Deserialize)]
pub struct SweepPoint {
    pub values: Vec<String>,
    pub robot: String,
    pub default_gait: String,
    pub default_speed_m_per_s: f64,
    #[serde(deserialize_with = "count")]
    pub default_falls: u64,
    pub runs: Vec<SweepRun>,
    pub speed_iqm: f64,
    pub speed_ci: [f64; 2],
    pub ratio_iqm: Option<f64>,
    pub ratio_ci: Option<[f64; 2]>,
    pub falls: [u64; 2],
}

/// One training of a sweep.
#[derive(Clone, Debug, Deserialize)]
pub struct SweepRun {
    pub seed: u64,
    pub speed_m_per_s: f64,
    #[serde(deserialize_with = "count")]
    pub falls: u64,
    #[serde(deserialize_with = "count")]
    pub num_episodes: u64,
}

/// A run directory as far as a report needs it.
#[derive(Clone, Debug)]
pub struct Run {
    /// Last part of its path.
    pub name: String,
    pub path: PathBuf,
    pub verdict: Verdict,
    pub metrics: Vec<Metrics>,
    /// By the gait's name; `learned` is the policy.
    pub trajectories: BTreeMap<String, Trajectory>,
    /// What was exported, by format.
    pub exports: BTreeMap<String, Export>,
}

/// An entry of `export.json`: how an exported gait did in its replay.
#[derive(Clone, Debug, Deserialize)]
pub struct Export {
    /// Whether it kept every limit.
    pub passed: bool,
    /// Whether it runs without sensors.
    pub is_open_loop: bool,
    pub exported: GaitReport,
}

fn count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let count = u64::deserialize(deserializer)?;
    if count > LARGEST_COUNT {
        Err(D::Error::custom(format!("{count} is more than can be counted")))
    } else {
        Ok(count)
    }
}

fn counts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, u64>, D::Error> {
    #[derive(Deserialize)]
    struct Count(#[serde(deserialize_with = "count")] u64);
    let counts = BTreeMap::<String, Count>::deserialize(deserializer)?;
    Ok(counts.into_iter().map(|(name, Count(count))| (name, count)).collect())
}

/// Reads a run directory. Without `trajectories/` it has no trajectories; everything else has to be there.
pub fn run(path: &Path) -> Result<Run, ReportError> {
    let verdict_path = path.join("eval.json");
    let verdict: Verdict = json(&verdict_path, TRAIN_AGAIN)?;
    if !verdict.default_gaits.contains_key(&verdict.default_gait) {
        return Err(wrong(
            &verdict_path,
            format!("`default_gait` is `{}`, which is none of `default_gaits`", verdict.default_gait),
            TRAIN_AGAIN,
        ));
    }
    for (name, report) in verdict
        .default_gaits
        .iter()
        .map(|(name, report)| (name.as_str(), report))
        .chain(verdict.policy.iter().map(|report| ("policy", report)).chain([("prior", &verdict.prior)]))
    {
        if report.speeds_m_per_s.len() as u64 != verdict.protocol.num_episodes {
            let what = format!(
                "`{name}` has {} speeds for {} episodes",
                report.speeds_m_per_s.len(),
                verdict.protocol.num_episodes
            );
            return Err(wrong(&verdict_path, what, TRAIN_AGAIN));
        }
    }
    let mut trajectories = BTreeMap::new();
    let folder = path.join("trajectories");
    for file in files_of(&folder)? {
        if file.extension().is_some_and(|extension| extension == "json") {
            let trajectory = trajectory(&file)?;
            if trajectory.robot != verdict.protocol.robot {
                let what = format!("robot `{}`, but the run's is `{}`", trajectory.robot, verdict.protocol.robot);
                return Err(wrong(&file, what, TRAJECTORY_AGAIN));
            }
            trajectories.insert(trajectory.name.clone(), trajectory);
        }
    }
    let export_path = path.join("export.json");
    let exports: BTreeMap<String, Export> =
        if export_path.exists() { json(&export_path, EXPORT_AGAIN)? } else { BTreeMap::new() };
    if let Some((name, _)) = exports.iter().find(|(_, export)| export.exported.speeds_m_per_s.is_empty()) {
        return Err(wrong(&export_path, format!("`{name}` has no speeds"), EXPORT_AGAIN));
    }
    let name = path.canonicalize().map_err(ReportError::io(path))?;
    Ok(Run {
        name: name.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned()),
        path: path.to_path_buf(),
        metrics: metrics(&path.join("metrics.jsonl"))?,
        verdict,
        trajectories,
        exports,
    })
}

/// Reads a comparison's folder: `compare.json` and the trajectories that it names.
pub fn comparison(folder: &Path) -> Result<(Comparison, ComparedTrajectories), ReportError> {
    let path = folder.join("compare.json");
    let comparison: Comparison = versioned(&path, COMPARE_AGAIN)?;
    let refusal = |what: String| wrong(&path, what, COMPARE_AGAIN);
    let complain = |what: String| Err(refusal(what));
    if !comparison.rungs.contains_key(&comparison.default_rung) {
        return complain(format!("`default_rung` is `{}`, which is none of `rungs`", comparison.default_rung));
    }
    for (name, rung) in &comparison.rungs {
        if rung.seeds.is_empty() {
            return complain(format!("rung `{name}` has no seeds"));
        }
        if let Some(seed) = rung.seeds.iter().find(|seed| seed.falls > seed.num_episodes) {
            return complain(format!("rung `{name}` has {} falls in {} episodes", seed.falls, seed.num_episodes));
        }
        if rung.seeds.iter().any(|seed| seed.return_curve.windows(2).any(|pair| pair[0][0] >= pair[1][0])) {
            return complain(format!("rung `{name}` has a return_curve whose env_steps do not grow"));
        }
    }
    for (name, sweep) in &comparison.sweeps {
        if sweep.values.windows(2).any(|pair| pair[0] >= pair[1]) {
            return complain(format!("the values of sweep `{name}` do not grow"));
        }
        for (rung, curve) in &sweep.rungs {
            if !comparison.rungs.contains_key(rung) {
                return complain(format!("sweep `{name}` has a rung `{rung}`, which is none of `rungs`"));
            }
            let lengths = [curve.speed_m_per_s.len(), curve.speed_ci.len(), curve.falls_per_episode.len()];
            if lengths.iter().any(|&length| length != sweep.values.len()) {
                let num_values = sweep.values.len();
                return complain(format!("sweep `{name}`, rung `{rung}`: {lengths:?} numbers for {num_values} values"));
            }
        }
    }
    let read = |files: &BTreeMap<String, String>| {
        let mut trajectories = BTreeMap::new();
        for (rung, file) in files {
            if !comparison.rungs.contains_key(rung) {
                return Err(refusal(format!("`trajectories` has a rung `{rung}`, which is none of `rungs`")));
            }
            // A file from elsewhere must not put other files of this machine on the page.
            if file.is_empty() || Path::new(file).components().any(|part| !matches!(part, Component::Normal(_))) {
                return Err(refusal(format!("trajectory {file:?} is not a path below the folder")));
            }
            trajectories.insert(rung.clone(), trajectory(&folder.join(file))?);
        }
        Ok(trajectories)
    };
    let trajectories =
        ComparedTrajectories { level: read(&comparison.trajectories)?, uphill: read(&comparison.uphill_trajectories)? };
    Ok((comparison, trajectories))
}

/// Reads `sweep.json` in a sweep's folder.
pub fn sweep(folder: &Path) -> Result<Sweep, ReportError> {
    let path = folder.join("sweep.json");
    let sweep: Sweep = versioned(&path, SWEEP_AGAIN)?;
    let complain = |what: &str| Err(wrong(&path, what.to_owned(), SWEEP_AGAIN));
    if sweep.points.is_empty() || sweep.keys.is_empty() {
        return complain("it has no points or no keys");
    }
    for point in &sweep.points {
        if point.values.len() != sweep.keys.len() {
            return complain("a point has not one value for each key");
        }
        if point.runs.is_empty() || point.falls[0] > point.falls[1] || point.falls[1] > LARGEST_COUNT {
            return complain("a point has no runs, or more falls than episodes");
        }
    }
    Ok(sweep)
}

fn metrics(path: &Path) -> Result<Vec<Metrics>, ReportError> {
    let text = text(path, TRAIN_AGAIN)?;
    let mut metrics = Vec::new();
    for (i, line) in text.split_inclusive('\n').enumerate() {
        match serde_json::from_str(line) {
            Ok(line) => metrics.push(line),
            // A process that was killed leaves half a line.
            Err(_) if !line.ends_with('\n') => {}
            Err(error) => return Err(wrong(path, format!("line {}: {error}", i + 1), TRAIN_AGAIN)),
        }
    }
    Ok(metrics)
}

fn trajectory(path: &Path) -> Result<Trajectory, ReportError> {
    let trajectory: Trajectory = versioned(path, TRAJECTORY_AGAIN)?;
    let t = &trajectory;
    let (steps, legs) = (t.time_s.len(), t.legs.len());
    if steps < 2 || !(1..=MAX_LEGS).contains(&legs) {
        return Err(wrong(path, format!("{steps} steps of {legs} legs"), TRAJECTORY_AGAIN));
    }
    let per_step = [
        ("phase", t.phase.len()),
        ("position_m", t.position_m.len()),
        ("orientation_rad", t.orientation_rad.len()),
        ("hip_m", t.hip_m.len()),
        ("knee_m", t.knee_m.len()),
        ("foot_m", t.foot_m.len()),
        ("contact", t.contact.len()),
        ("body_contact", t.body_contact.len()),
        ("commanded_swing_rad", t.commanded_swing_rad.len()),
        ("commanded_extension_rad", t.commanded_extension_rad.len()),
        ("swing_rad", t.swing_rad.len()),
        ("extension_rad", t.extension_rad.len()),
        ("torque_nm", t.torque_nm.len()),
    ];
    if let Some((name, length)) = per_step.iter().find(|(_, length)| *length != steps) {
        return Err(wrong(path, format!("`{name}` has {length} rows for {steps} steps"), TRAJECTORY_AGAIN));
    }
    let per_leg = [
        ("hip_m", t.hip_m.iter().all(|row| row.len() == legs)),
        ("knee_m", t.knee_m.iter().all(|row| row.len() == legs)),
        ("foot_m", t.foot_m.iter().all(|row| row.len() == legs)),
        ("contact", t.contact.iter().all(|row| row.len() == legs)),
        ("commanded_swing_rad", t.commanded_swing_rad.iter().all(|row| row.len() == legs)),
        ("commanded_extension_rad", t.commanded_extension_rad.iter().all(|row| row.len() == legs)),
        ("swing_rad", t.swing_rad.iter().all(|row| row.len() == legs)),
        ("extension_rad", t.extension_rad.iter().all(|row| row.len() == legs)),
    ];
    if let Some((name, _)) = per_leg.iter().find(|(_, fits)| !fits) {
        return Err(wrong(
            path,
            format!("a row of `{name}` has not one entry for each of {legs} legs"),
            TRAJECTORY_AGAIN,
        ));
    }
    let sizes =
        [("control_dt_s", t.control_dt_s), ("leg_length_m", t.leg_length_m), ("max_torque_nm", t.max_torque_nm)];
    if let Some((name, value)) = sizes.iter().find(|(_, value)| !POSSIBLE_SIZES.contains(value)) {
        let what = format!(
            "`{name}` is {value}, expected a number from {} to {}",
            POSSIBLE_SIZES.start(),
            POSSIBLE_SIZES.end()
        );
        return Err(wrong(path, what, TRAJECTORY_AGAIN));
    }
    Ok(trajectory)
}

/// The files in a folder, sorted; none if there is no such folder.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(ReportError::io(folder))?,
    };
    let mut files = Vec::new();
    for entry in entries {
        files.push(entry.map_err(ReportError::io(folder))?.path());
    }
    files.sort();
    Ok(files)
}

fn versioned<T: DeserializeOwned>(path: &Path, advice: &'static str) -> Result<T, ReportError> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u64,
    }
    let text = text(path, advice)?;
    let failed = |source| ReportError::Json { path: path.to_path_buf(), source, advice };
    // First, because a file of another version may well lack a key.
    let Versioned { version } = serde_json::from_str(&text).map_err(failed)?;
    if version != VERSION {
        return Err(ReportError::Version { path: path.to_path_buf(), found: version, expected: VERSION });
    }
    serde_json::from_str(&text).map_err(failed)
}

fn json<T: DeserializeOwned>(path: &Path, advice: &'static str) -> Result<T, ReportError> {
    let text = text(path, advice)?;
    serde_json::from_str(&text).map_err(|source| ReportError::Json { path: path.to_path_buf(), source, advice })
}

fn text(path: &Path, advice: &'static str) -> Result<String, ReportError> {
    let mut text = String::new();
    let mut read = || {
        let metadata = path.metadata()?;
        // Opening a pipe would wait for its other end.
        if !metadata.is_file() {
            return Err(std::io::Error::other("this is no file"));
        }
        let is_large = metadata.len() > MAX_FILE_BYTES;
        let file = File::open(path)?;
        // It may grow while it is read.
        file.take(if is_large { 0 } else { MAX_FILE_BYTES }).read_to_string(&mut text)?;
        Ok(is_large || text.len() as u64 == MAX_FILE_BYTES)
    };
    let is_large = read().map_err(|source: std::io::Error| match source.kind() {
        ErrorKind::NotFound => ReportError::Missing { path: path.to_path_buf(), advice },
        _ => ReportError::Io { path: path.to_path_buf(), source },
    })?;
    if is_large {
        return Err(wrong(path, format!("it has more than {} MiB", MAX_FILE_BYTES >> 20), advice));
    }
    match beyond_measure(&text) {
        Some(number) => Err(wrong(path, format!("the number {number} is beyond all measure"), advice)),
        None => Ok(text),
    }
}

/// The first number in a JSON text, shortened, that is too large for anything that is computed from it.
fn beyond_measure(text: &str) -> Option<String> {
    const MAX_SHOWN: usize = 30;
    // So few characters without an exponent are no large number.
    const FEW: usize = 20;
    let bytes = text.as_bytes();
    let (mut i, mut is_in_string) = (0, false);
    while i < bytes.len() {
        match bytes[i] {
            b'\\' if is_in_string => i += 1,
            b'"' => is_in_string = !is_in_string,
            b'0'..=b'9' if !is_in_string => {
                let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
                let length = bytes[i..].iter().take_while(|byte| is_part(byte)).count();
                let number = &text[i..i + length];
                if (length > FEW || number.contains(['e', 'E']))
                    && number.parse().is_ok_and(|value: f64| value > LARGEST_NUMBER)
                {
                    return Some(number.chars().take(MAX_SHOWN).collect());
                }
                i += length;
                continue;
            }
            _ => {}
        }
        i += 1;
    }
    None
}

fn wrong(path: &Path, what: String, advice: &'static str) -> ReportError {
    ReportError::Wrong { path: path.to_path_buf(), what, advice }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beyond_all_measure_are_found_outside_of_texts() {
        let found = |text: &str| beyond_measure(text);
        assert_eq!(found(r#"{"a": [1.5, -2e3], "seed": 18446744073709551615, "1e99": "\\\"1e99"}"#), None);
        assert_eq!(found(r#"{"a": [1.5, -1e21]}"#), Some("1e21".to_owned()));
        assert_eq!(found(&format!("[{}]", "9".repeat(40))), Some("9".repeat(30)));
        assert_eq!(found("[1e-400, 0.000000000000000000000001]"), None);
    }
}
