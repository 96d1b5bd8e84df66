//! How much of its speed a policy keeps where the world is not the one that it is measured in.

use std::sync::Arc;

use canter_gait::Policy;
use canter_sim::ground::GroundSettings;
use canter_sim::settings::Document;
use canter_sim::variation::VariationSettings;
use canter_sim::{Env, Task, TaskSettings};
use serde::Serialize;

use crate::config::{ConfigError, Resolved};
use crate::evaluate::{Conditions, Mover, Push, run_episodes};
use crate::executor::Workers;
use crate::statistics::mean;

/// A world that differs from the robot's own in what the name says.
#[derive(Clone, Copy, Debug)]
pub struct Condition {
    /// What a table calls it.
    pub name: &'static str,
    change: fn(&mut TaskSettings),
    /// A push from the right in the middle of the episode, as a share of `sqrt(g h)`, h the stance height.
    push: Option<f64>,
}

const fn condition(name: &'static str, change: fn(&mut TaskSettings)) -> Condition {
    Condition { name, change, push: None }
}

/// What every policy is measured under, whatever it was trained on; the first is the robot as it is on level ground, which
/// the others are held against.
pub const CONDITIONS: [Condition; 21] = [
    condition("as it is", |_| {}),
    condition("friction 0.5", |task| task.friction = Some(0.5)),
    condition("friction 0.8", |task| task.friction = Some(0.8)),
    condition("friction 1.2", |task| task.friction = Some(1.2)),
    condition("mass -20 %", |task| task.mass_factor = Some(0.8)),
    condition("mass +20 %", |task| task.mass_factor = Some(1.2)),
    condition("delay 0 ms", |task| task.delay_s = Some(0.0)),
    condition("delay 10 ms", |task| task.delay_s = Some(0.01)),
    condition("delay 20 ms", |task| task.delay_s = Some(0.02)),
    condition("0.5, -20 %, 20 ms", |task| corner(task, 0.5, 0.8, 0.02)),
    condition("0.5, +20 %, 20 ms", |task| corner(task, 0.5, 1.2, 0.02)),
    condition("1.2, -20 %, 0 ms", |task| corner(task, 1.2, 0.8, 0.0)),
    condition("1.2, +20 %, 20 ms", |task| corner(task, 1.2, 1.2, 0.02)),
    condition("motors -15 %", |task| task.strength_factor = Some(0.85)),
    condition("uphill 10 deg", |task| task.slope_deg = 10.0),
    condition("uphill 20 deg", |task| task.slope_deg = 20.0),
    condition("downhill 10 deg", |task| task.slope_deg = -10.0),
    condition("across 10 deg", |task| task.cross_slope_deg = Some(10.0)),
    condition("rough 0.15 h", |task| {
        task.ground = Some(GroundSettings { roughness: Some(0.15), ..GroundSettings::smooth() });
    }),
    condition("curbs 0.1 h", |task| {
        task.ground = Some(GroundSettings { curb_height: Some(0.1), ..GroundSettings::smooth() });
    }),
    Condition { name: "push 0.3 sqrt(g h)", change: |_| {}, push: Some(0.3) },
];

fn corner(task: &mut TaskSettings, friction: f64, mass_factor: f64, delay_s: f64) {
    (task.friction, task.mass_factor, task.delay_s) = (Some(friction), Some(mass_factor), Some(delay_s));
}

/// The same task with the robot as it is, on level ground, whatever was trained for.
fn plain(task: &TaskSettings) -> TaskSettings {
    TaskSettings {
        slope_deg: 0.0,
        cross_slope_deg: None,
        friction: None,
        mass_factor: None,
        strength_factor: None,
        delay_s: None,
        ground: None,
        variation: VariationSettings::nothing(),
        ..task.clone()
    }
}

/// What a policy did under one condition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Mean forward speed [m/s].
    pub speed_m_per_s: f64,
    /// Episodes that ended in an accident.
    pub falls: u64,
    /// Episodes.
    pub num_episodes: usize,
}

/// What the runs of one configuration, each of its own seed, did under one condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The condition's name.
    pub condition: &'static str,
    /// Mean over the runs of the mean forward speed [m/s].
    pub speed_m_per_s: f64,
    /// Mean over the runs of [`share`]; none if a run does not move forward where the robot is as it is.
    pub share: Option<f64>,
    /// The least of them.
    pub least_share: Option<f64>,
    /// Episodes of all runs that ended in an accident.
    pub falls: u64,
    /// Episodes of all runs.
    pub num_episodes: usize,
    /// Mean forward speed of each run [m/s].
    pub speeds_m_per_s: Vec<f64>,
}

/// How much of its speed a run keeps.
///
/// ```text
/// share = speed / speed where the robot is as it is
/// ```
///
/// Source: our definition. None unless the run moves forward there.
pub fn share(speed_m_per_s: f64, own_speed_m_per_s: f64) -> Option<f64> {
    (own_speed_m_per_s > 0.0).then(|| speed_m_per_s / own_speed_m_per_s)
}

/// Measures a run's policy under every one of [`CONDITIONS`], from the same starts.
///
/// # Errors
/// A condition that the robot's model cannot have.
pub fn measure(resolved: &Resolved, policy: &Policy<'_>, workers: &Workers) -> Result<Vec<Measured>, ConfigError> {
    CONDITIONS.iter().map(|condition| measure_one(condition, resolved, policy, workers)).collect()
}

fn measure_one(
    condition: &Condition,
    resolved: &Resolved,
    policy: &Policy<'_>,
    workers: &Workers,
) -> Result<Measured, ConfigError> {
    let Resolved { config, task } = resolved;
    let mut settings = plain(&config.task);
    (condition.change)(&mut settings);
    let problems = Document::parse(condition.name, b"")?.problems();
    let task = Task::new(Arc::clone(&task.robot), &settings, &config.reward, &config.policy, problems)?;
    let mut conditions = Conditions::from(&config.evaluation);
    conditions.push = condition.push.map(|push| {
        let unit_m_per_s = (task.robot.model.gravity() * task.robot.settings.stance_height_m).sqrt();
        Push { at_s: 0.5 * config.evaluation.episode_s, velocity_m_per_s: push * unit_m_per_s }
    });
    let episodes = run_episodes(&task, Env::new, Mover::Policy(policy), conditions, workers);
    let speeds: Vec<f64> = episodes.iter().map(|episode| episode.speed_m_per_s).collect();
    Ok(Measured {
        speed_m_per_s: mean(&speeds),
        falls: episodes.iter().filter(|episode| episode.accident.is_some()).count() as u64,
        num_episodes: episodes.len(),
    })
}

/// Puts runs of one configuration together, each measured by [`measure`]: one row for each condition.
pub fn rows(runs: &[Vec<Measured>]) -> Vec<Row> {
    let of = |(number, condition): (usize, &Condition)| {
        let speeds: Vec<f64> = runs.iter().map(|run| run[number].speed_m_per_s).collect();
        let shares: Option<Vec<f64>> =
            runs.iter().map(|run| share(run[number].speed_m_per_s, run[0].speed_m_per_s)).collect();
        Row {
            condition: condition.name,
            speed_m_per_s: mean(&speeds),
            share: shares.as_deref().map(mean),
            least_share: shares.map(|shares| shares.into_iter().fold(f64::INFINITY, f64::min)),
            falls: runs.iter().map(|run| run[number].falls).sum(),
            num_episodes: runs.iter().map(|run| run[number].num_episodes).sum(),
            speeds_m_per_s: speeds,
        }
    };
    CONDITIONS.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_a_runs_own_speed() {
        let measured = |speed_m_per_s: f64| Measured { speed_m_per_s, falls: 1, num_episodes: 20 };
        let run = |own: f64, other: f64| {
            let mut run = vec![measured(other); CONDITIONS.len()];
            run[0] = measured(own);
            run
        };
        // 1.6 of 2 is 0.8, 0.9 of 1 is 0.9.
        let rows = rows(&[run(2.0, 1.6), run(1.0, 0.9)]);
        assert_eq!((rows[0].speed_m_per_s, rows[0].share), (1.5, Some(1.0)));
        assert!((rows[5].share.unwrap() - 0.85).abs() < 1e-12 && (rows[5].least_share.unwrap() - 0.8).abs() < 1e-12);
        assert_eq!((rows[5].falls, rows[5].num_episodes), (2, 40));
        assert_eq!(share(1.0, -0.1), None);
    }
}
