//! One gait's part of a film: the evaluation's first episode, seen at the film's clock.

use canter_sim::render::{Pose, Terrain};
use canter_sim::{Accident, Env, Task};

use super::FilmError;
use crate::config::EvaluationSettings;
use crate::evaluate::{Mover, evaluation_task, run_episode};
use crate::trajectory::RECORDED_EPISODE;

/// When the pictures of a film are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Length of the film [s].
    pub length_s: f64,
    /// Pictures each second [1/s].
    pub frames_per_s: u32,
}

impl Clock {
    /// How many pictures there are; at least one.
    pub fn num_frames(self) -> usize {
        ((self.length_s * f64::from(self.frames_per_s)).round() as usize).max(1)
    }
}

/// A gait as a film shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// What the gait is called.
    pub label: String,
    /// Slope of the ground, positive uphill [deg].
    pub slope_deg: f64,
    /// What the ground is like; none: it is even.
    pub terrain: Option<Terrain>,
    /// The accident that ended the episode, and when [s].
    pub accident: Option<(Accident, f64)>,
    /// What each picture shows.
    pub shots: Vec<Shot>,
}

/// What one picture shows of one gait.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// How the robot stands. After the end of the episode it stays as it was.
    pub pose: Pose,
    /// The point of the ground that the camera follows: forward, left [m].
    pub target_m: [f64; 2],
    /// Time since the start; goes on after the end of the episode [s].
    pub time_s: f64,
    /// Forward displacement since the start [m].
    pub distance_m: f64,
}

/// The robot after one env step.
#[derive(Clone, Debug)]
struct Moment {
    pose: Pose,
    /// Forward, left [m].
    position_m: [f64; 2],
}

/// The camera follows the mean of the robot's positions over this time before and after, so that it does not shake with
/// the gait [s].
const SMOOTHING_S: f64 = 0.3;

/// Walks the evaluation's first episode again, from the same start, for the length of the film.
///
/// # Errors
/// The first step already ends in a state that makes no sense.
pub fn shoot(
    task: &Task,
    mover: Mover<'_>,
    evaluation: &EvaluationSettings,
    clock: Clock,
    label: &str,
) -> Result<Take, FilmError> {
    // The start depends on the seed alone, so the steps are those of the evaluation for as long as both last.
    let settings = EvaluationSettings { episode_s: clock.length_s, settle_s: 0.0, ..evaluation.clone() };
    let task = evaluation_task(task, &settings);
    let mut env = Env::new(task.clone());
    let mut moments = Vec::new();
    let episode = run_episode(&mut env, mover, &(&settings).into(), RECORDED_EPISODE, |env, outcome| {
        // The numbers of an unstable state mean nothing.
        if outcome.terminated != Some(Accident::Unstable) {
            let [x, y, _] = env.position_in_ground();
            moments.push(Moment { pose: env.pose(), position_m: [x, y] });
        }
    });
    if moments.is_empty() {
        return Err(FilmError::NothingToShow(label.to_owned()));
    }
    let control_dt_s = task.settings.control_dt_s;
    let end_s = f64::from(episode.env_steps) * control_dt_s;
    Ok(Take {
        label: label.to_owned(),
        slope_deg: task.settings.slope_deg,
        terrain: env.terrain(),
        accident: episode.accident.map(|accident| (accident, end_s)),
        shots: (0..clock.num_frames()).map(|number| shot(&moments, control_dt_s, clock, number)).collect(),
    })
}

/// Picture number `number`, of the env step that is nearest to its time; there is none before the first.
fn shot(moments: &[Moment], control_dt_s: f64, clock: Clock, number: usize) -> Shot {
    let time_s = number as f64 / f64::from(clock.frames_per_s);
    let env_step = ((time_s / control_dt_s).round() as usize).max(1);
    let last = (env_step - 1).min(moments.len() - 1);
    let Moment { pose, position_m } = &moments[last];
    Shot {
        pose: pose.clone(),
        target_m: smoothed(moments, last, (SMOOTHING_S / control_dt_s).round() as usize),
        time_s: env_step as f64 * control_dt_s,
        distance_m: position_m[0],
    }
}

/// Mean position over as many moments before as after, at most `reach`.
fn smoothed(moments: &[Moment], middle: usize, reach: usize) -> [f64; 2] {
    let reach = reach.min(middle).min(moments.len() - 1 - middle);
    let window = &moments[middle - reach..=middle + reach];
    [0, 1].map(|axis| window.iter().map(|moment| moment.position_m[axis]).sum::<f64>() / window.len() as f64)
}
