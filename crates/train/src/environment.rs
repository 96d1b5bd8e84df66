//! The simulator's environment as the learner wants it, with its own random starts.

use std::sync::Arc;

use canter_learn::environment::{Environment, StepOutcome};
use canter_learn::random::{Purpose, stream};
use canter_sim::variation::Variant;
use canter_sim::{Accident, Env, Task};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use crate::blow_up::{BlowUp, Recorder};

/// A number in [0, 1) with 53 random bits.
pub fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * UNIT
}

/// How hard an environment's next episode is, from how hard the last one was and whether it ended well.
///
/// ```text
/// level' = min(level + 1/20, 1) after the time limit or the goal,  max(level - 1/20, 0) after an accident
/// ```
///
/// It stays where it is where half of the episodes end well.
///
/// Source: our definition, after the game-inspired curriculum of Rudin et al. 2021.
fn next_level(level: f64, ended_well: bool) -> f64 {
    const STEP: f64 = 0.05;
    (if ended_well { level + STEP } else { level - STEP }).clamp(0.0, 1.0)
}

/// What an environment did in one iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Travel {
    /// Way forward [m].
    pub forward_m: f64,
    /// Work of the motors [J].
    pub work_j: f64,
    /// Episodes that ended in each accident, in the order of [`Accident::ALL`].
    pub accidents: [u64; Accident::ALL.len()],
}

/// One environment of the training.
#[derive(Debug)]
pub struct TrainingEnvironment {
    env: Env,
    seed: u64,
    /// Its number among how many.
    place: (u64, u64),
    /// Purpose and row of its random starts; with seed and number of the episode they select one.
    starts: (Purpose, u64),
    /// Number of the next episode.
    next_episode: u64,
    /// How hard its next episode is, from 0 to 1, see [`next_level`]; 1 without a curriculum.
    level: f64,
    /// Whether the learner sees the present state in the mirror.
    is_reflected: bool,
    /// The action as the robot gets it.
    action: Vec<f32>,
    /// What happened since this was last taken.
    pub travel: Travel,
    recorder: Recorder,
    /// The first blow-up since this was last taken.
    pub blow_up: Option<BlowUp>,
}

impl TrainingEnvironment {
    /// Environment number `index` of `num_environments` of the run with this seed.
    pub fn new(task: Arc<Task>, seed: u64, index: u64, num_environments: u64) -> Self {
        let place = (index, num_environments);
        let action = vec![0.0; task.num_actions()];
        let level = if task.variation.has_curriculum() { 0.0 } else { 1.0 };
        Self {
            env: Env::new(task),
            seed,
            place,
            starts: (Purpose::Reset, index),
            next_episode: 0,
            level,
            is_reflected: false,
            action,
            travel: Travel::default(),
            recorder: Recorder::default(),
            blow_up: None,
        }
    }

    /// An environment that starts as the episode `number` of an evaluation with this seed does, then as the one after it,
    /// and so on. Nothing varies. `task` is [`evaluation_task`](crate::evaluate::evaluation_task)'s.
    pub fn of_evaluation(task: Arc<Task>, seed: u64, number: u64) -> Self {
        Self { starts: (Purpose::Evaluation, 0), next_episode: number, ..Self::new(task, seed, 0, 1) }
    }

    /// How hard its next episode is, from 0 to 1; none without a curriculum.
    pub fn level(&self) -> Option<f64> {
        self.env.task().variation.has_curriculum().then_some(self.level)
    }

    /// Everything that the next step depends on.
    pub fn state(&self) -> Vec<f64> {
        let mut state = vec![self.next_episode as f64, self.level];
        state.extend(self.env.state());
        state
    }

    /// Restores what [`state`](Self::state) gave, and writes the observation, `(O)`.
    ///
    /// # Errors
    /// A state of another length is refused.
    pub fn set_state(&mut self, state: &[f64], observation: &mut [f32]) -> Result<(), String> {
        let [next_episode, level, ref rest @ ..] = *state else {
            return Err("an environment's state is too short".to_owned());
        };
        let can_be = if self.env.task().variation.has_curriculum() { 0.0..=1.0 } else { 1.0..=1.0 };
        if !can_be.contains(&level) {
            return Err("an environment's state has a level that cannot be".to_owned());
        }
        self.next_episode = next_episode as u64;
        self.level = level;
        self.env.set_state(rest, observation)?;
        self.recorder.begin(&self.env);
        self.reflect(observation);
        Ok(())
    }
}

impl TrainingEnvironment {
    /// Shows the observation, `(O)`, as a policy with the task's mirror sees it.
    ///
    /// The learner never hears of the mirror: it is the robot's own [`Policy::act`](canter_gait::Policy::act) that does
    /// the same on the robot.
    fn reflect(&mut self, observation: &mut [f32]) {
        let mirror = self.env.task().mirror().filter(|mirror| mirror.reflects(observation));
        self.is_reflected = mirror.is_some();
        if let Some(mirror) = mirror {
            mirror.reflect_observation(observation);
        }
    }
}

impl Environment for TrainingEnvironment {
    fn num_observations(&self) -> usize {
        self.env.task().num_observations()
    }

    fn num_actions(&self) -> usize {
        self.env.task().num_actions()
    }

    fn reset(&mut self, observation: &mut [f32]) {
        let (index, num_environments) = self.place;
        let (purpose, row) = self.starts;
        let mut rng = stream(self.seed, purpose, row, self.next_episode);
        self.next_episode += 1;
        if self.env.task().variation.is_any() && purpose == Purpose::Reset {
            let place = (index as f64 + uniform(&mut rng)) / num_environments as f64;
            self.env.vary(Variant { place, level: self.level });
        }
        self.env.reset(&mut || uniform(&mut rng), observation);
        self.recorder.begin(&self.env);
        self.reflect(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome {
        let before = self.env.position_in_ground()[0];
        self.action.copy_from_slice(action);
        if let Some(mirror) = self.env.task().mirror().filter(|_| self.is_reflected) {
            mirror.reflect_action(&mut self.action);
        }
        self.recorder.record(&self.env, &self.action);
        let outcome = self.env.step(&self.action, observation);
        self.reflect(observation);
        if outcome.terminated == Some(Accident::Unstable) {
            self.blow_up.get_or_insert_with(|| self.recorder.blow_up(&self.env, self.place.0));
        } else {
            self.travel.forward_m += self.env.position_in_ground()[0] - before;
            self.travel.work_j += outcome.work_j;
        }
        if let Some(accident) = outcome.terminated {
            self.travel.accidents[accident as usize] += 1;
        }
        if self.env.task().variation.has_curriculum() && (outcome.terminated.is_some() || outcome.truncated) {
            self.level = next_level(self.level, outcome.truncated);
        }
        StepOutcome {
            reward: outcome.reward as f32,
            terminated: outcome.terminated.is_some(),
            truncated: outcome.truncated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::next_level;

    #[test]
    fn the_level_follows_the_success_and_stays_between_0_and_1() {
        assert_eq!(next_level(0.0, false), 0.0);
        assert_eq!(next_level(0.0, true), 0.05);
        assert_eq!(next_level(1.0, true), 1.0);
        assert!((next_level(next_level(0.5, true), false) - 0.5).abs() < 1e-15);
    }
}
