//! A run in one line of the list.

use std::fs::TryLockError;
use std::io::{Read, Seek, SeekFrom};

use serde::Serialize;
use serde_json::Value;

use crate::folder::{Place, Refusal};
use crate::metrics;

/// More of a configuration or verdict is not read for the list [bytes].
const MAX_BYTES: u64 = 1 << 20;

/// So much of the end of `metrics.jsonl` has its last line [bytes].
const TAIL_BYTES: u64 = 16 << 10;

/// What a run is up to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// A process writes into it.
    Training,
    /// It has its verdict.
    Finished,
    /// Neither.
    Stopped,
}

/// A run in the list.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// By which the page asks for it.
    pub id: String,
    /// What it is up to.
    pub state: State,
    /// The robot's name, or the path of its file, from `config.toml`.
    pub robot: Option<String>,
    /// Of the training.
    pub seed: Option<i64>,
    /// How long the training should be [env steps].
    pub max_env_steps: Option<i64>,
    /// How long it was so far [env steps].
    pub env_steps: Option<f64>,
    /// Of the last iteration [m/s].
    pub speed_m_per_s: Option<f64>,
    /// Of the last iteration.
    pub episode_return: Option<f64>,
    /// Since something was written last [s].
    pub updated_s: f64,
    /// From `eval.json`.
    pub verdict: Option<Verdict>,
    /// Names of the recorded gaits, the learned one first.
    pub trajectories: Vec<String>,
    /// Whether it has a page of its own.
    pub report: bool,
    /// What could not be read.
    pub problems: Vec<String>,
}

/// The verdict's main numbers.
#[derive(Debug, Serialize)]
pub struct Verdict {
    /// Of the learned gait [m/s].
    pub speed_m_per_s: Option<f64>,
    /// The name of the fastest default gait.
    pub default_gait: Option<String>,
    /// Its speed [m/s].
    pub default_speed_m_per_s: Option<f64>,
    /// Learned over default speed.
    pub ratio: Option<f64>,
    /// 95 % interval of the ratio.
    pub ratio_ci: Option<Vec<f64>>,
    /// Episodes of the learned gait that ended in an accident.
    pub falls: Option<f64>,
    /// Of how many.
    pub num_episodes: Option<f64>,
}

/// Looks at a run's files.
pub fn of(run: &Place) -> Summary {
    let mut problems = Vec::new();
    let config: Option<toml::Table> = read(run, "config.toml", &mut problems).and_then(|text| {
        let config = toml::from_str(&text);
        config.map_err(|error| problems.push(format!("config.toml: {}", error.message()))).ok()
    });
    let of_config = |key| config.as_ref().and_then(|config| config.get(key));
    let eval: Option<Value> = read(run, "eval.json", &mut problems).and_then(|text| {
        let eval = serde_json::from_str(&text);
        eval.map_err(|error| problems.push(format!("eval.json: {error}"))).ok()
    });
    let last = last_line(run);
    let of_last = |key| last.as_ref().and_then(|line| line[key].as_f64());
    let is_written = is_locked(run);
    Summary {
        id: run.id.clone(),
        state: match (is_written, &eval) {
            (true, _) => State::Training,
            (false, Some(_)) => State::Finished,
            (false, None) => State::Stopped,
        },
        robot: of_config("robot").and_then(|robot| robot.as_str()).map(str::to_owned),
        seed: of_config("seed").and_then(toml::Value::as_integer),
        max_env_steps: of_config("training").and_then(|training| training.get("max_env_steps")?.as_integer()),
        env_steps: of_last("env_steps"),
        speed_m_per_s: of_last("speed_m_per_s"),
        episode_return: of_last("episode_return"),
        updated_s: run.age().as_secs_f64(),
        verdict: eval.as_ref().and_then(verdict),
        trajectories: run.trajectories(),
        report: run.open("report.html").is_ok(),
        problems,
    }
}

/// Whatever `eval.json` has of it: the page says what is missing.
fn verdict(eval: &Value) -> Option<Verdict> {
    let policy = eval.get("policy")?.as_object()?;
    let of_policy = |key| policy.get(key).and_then(Value::as_f64);
    let interval = eval["speed_ratio_ci"].as_array().map(|ends| ends.iter().filter_map(Value::as_f64).collect());
    Some(Verdict {
        speed_m_per_s: of_policy("speed_m_per_s"),
        default_gait: eval["default_gait"].as_str().map(str::to_owned),
        default_speed_m_per_s: eval["default_speed_m_per_s"].as_f64(),
        ratio: eval["speed_ratio"].as_f64(),
        ratio_ci: interval.filter(|ends: &Vec<f64>| ends.len() == 2),
        falls: of_policy("falls"),
        num_episodes: eval["protocol"]["num_episodes"].as_f64(),
    })
}

/// A file as text; `None` if it is not there.
fn read(run: &Place, name: &str, problems: &mut Vec<String>) -> Option<String> {
    match run.read(name, MAX_BYTES) {
        Ok(bytes) => match String::from_utf8(bytes) {
            Ok(text) => return Some(text),
            Err(_) => problems.push(format!("{name}: it is no text")),
        },
        Err(Refusal::File(_, error)) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(refusal) => problems.push(refusal.to_string()),
    }
    None
}

/// The newest whole line of `metrics.jsonl`.
fn last_line(run: &Place) -> Option<Value> {
    let mut file = run.open(metrics::NAME).ok()?;
    let end = file.seek(SeekFrom::End(0)).ok()?;
    file.seek(SeekFrom::Start(end.saturating_sub(TAIL_BYTES))).ok()?;
    let mut tail = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut tail).ok()?;
    let whole = &tail[..tail.iter().rposition(|&byte| byte == b'\n')?];
    whole.rsplit(|&byte| byte == b'\n').find_map(|line| serde_json::from_str(metrics::as_json(line)?).ok())
}

/// Whether a process writes into the run: it holds the lock. We hold it for a moment to see that, which a training that
/// begins in this moment waits for.
fn is_locked(run: &Place) -> bool {
    run.open("lock").is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
}
