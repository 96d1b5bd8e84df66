//! The tuned gait: CMA-ES over the constant actions of a task, so over exactly what a constant policy could do.

use std::cmp::Ordering;
use std::sync::atomic::{self, AtomicBool};

use canter_learn::random::{Purpose, stream};
use canter_sim::{Env, Task};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::config::EvaluationSettings;
use crate::environment::uniform;
use crate::evaluate::{Conditions, Episode, Mover, Starts, run_episodes};
use crate::executor::Workers;
use crate::json::{LARGEST, largest_number};
use crate::search::cma_es::{CmaEs, StrategyParameters, fold};
use crate::statistics::mean;

/// Step size at the start, in a box from -1 to 1 about the prior at 0. Hansen 2016 (appendix A) has 0.3 times the
/// box's width for a search that knows nothing; one that begins at a gait that walks takes half of that.
const INITIAL_SIGMA: f64 = 0.3;

/// Share of the budget that is kept for the choice among the finalists.
const CHOICE_SHARE: f64 = 0.1;

/// Most held-out episodes of a finalist; more do not change the choice.
const MAX_CHOICE_EPISODES: u64 = 20;

/// Candidates that are remembered as finalists, beside the distribution's mean.
const NUM_REMEMBERED: usize = 4;

/// No search takes as many env steps; sums of them do not overflow.
const LARGEST_COUNT: u64 = 1 << 53;

/// What a search looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// What a policy is trained for: the mean return of an episode.
    Return,
    /// The mean speed, but whatever falls less often comes first.
    Speed,
}

impl Objective {
    /// Both, in the order in which they are tried.
    pub const ALL: [Self; 2] = [Self::Return, Self::Speed];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Return => "return",
            Self::Speed => "speed",
        }
    }
}

/// How candidates are tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchSettings {
    /// Env steps in all: every step of every candidate, and the choice at the end.
    pub budget_env_steps: u64,
    /// Episodes of a candidate.
    pub num_episodes: usize,
    /// Length of such an episode [s].
    pub episode_s: f64,
    /// Speed counts from here on [s].
    pub settle_s: f64,
    /// Length of the episodes by which the finalists are judged [s].
    pub choice_episode_s: f64,
    /// Time of one physics step [s].
    pub physics_dt_s: f64,
}

/// How good a gait was in some episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Episodes.
    pub num_episodes: u64,
    /// Those that ended in an accident.
    pub falls: u64,
    /// Mean speed [m/s].
    pub speed_m_per_s: f64,
    /// Mean return.
    pub episode_return: f64,
}

impl Score {
    fn of(episodes: &[Episode]) -> Self {
        let column = |value: fn(&Episode) -> f64| mean(&episodes.iter().map(value).collect::<Vec<_>>());
        Self {
            num_episodes: episodes.len() as u64,
            falls: episodes.iter().filter(|episode| episode.accident.is_some()).count() as u64,
            speed_m_per_s: column(|episode| episode.speed_m_per_s),
            episode_return: column(|episode| episode.episode_return),
        }
    }

    /// Which of two is better under an objective; the better one is `Less` and so comes first when sorted.
    pub fn compare(&self, other: &Self, objective: Objective) -> Ordering {
        let by_return = || other.episode_return.total_cmp(&self.episode_return);
        // As shares: two scores may be over different numbers of episodes.
        let falls = |score: &Self| score.falls as f64 / score.num_episodes as f64;
        let by_speed =
            || falls(self).total_cmp(&falls(other)).then_with(|| other.speed_m_per_s.total_cmp(&self.speed_m_per_s));
        match objective {
            Objective::Return => by_return(),
            Objective::Speed => by_speed(),
        }
    }
}

/// A constant action and how good it was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// `(A)`
    pub action: Vec<f32>,
    /// In the episodes that it was last tried in.
    pub score: Score,
}

/// A search between two generations: what is saved when it stops.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchState {
    /// What it looks for.
    pub objective: Objective,
    /// The distribution.
    pub cma_es: CmaEs,
    /// Env steps taken.
    pub env_steps: u64,
    /// Best candidates so far, best first.
    pub remembered: Vec<Candidate>,
    /// The choice among the finalists; none before the end.
    pub chosen: Option<Candidate>,
}

/// A search for one seed.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    /// Robot, gait and what may be changed.
    pub task: &'a Task,
    /// How candidates are tried.
    pub settings: &'a SearchSettings,
    /// Seed of candidates and starts.
    pub seed: u64,
}

/// A standard normal number.
///
/// ```text
/// z = sqrt(-2 ln(1 - u)) cos(2 pi v),  u, v uniform in [0, 1)
/// ```
///
/// Source: Box and Muller 1958.
pub(crate) fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v) = (uniform(rng), uniform(rng));
    (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

impl Search<'_> {
    /// A search that has not begun: its distribution stands around the prior.
    pub fn start(&self, objective: Objective) -> SearchState {
        SearchState {
            objective,
            cma_es: CmaEs::new(vec![0.0; self.task.num_actions()], INITIAL_SIGMA),
            env_steps: 0,
            remembered: Vec::new(),
            chosen: None,
        }
    }

    /// Checks that a search for `objective` can go on from a state.
    ///
    /// # Errors
    /// What cannot be: another objective or number of dimensions, numbers beyond all measure.
    pub fn check(&self, state: &SearchState, objective: Objective) -> Result<(), String> {
        let value = serde_json::to_value(state).map_err(|error| error.to_string())?;
        if largest_number(&value) > LARGEST || state.env_steps > LARGEST_COUNT {
            return Err("it holds a number that is beyond all measure".to_owned());
        }
        if state.objective != objective {
            return Err(format!("it searches for `{}`, not for `{}`", state.objective.name(), objective.name()));
        }
        let num_actions = self.task.num_actions();
        if !state.cma_es.is_sound(num_actions) {
            return Err(format!("its distribution is none over {num_actions} dimensions"));
        }
        let is_candidate = |candidate: &Candidate| {
            let is_action = candidate.action.iter().all(|component| (-1.0..=1.0).contains(component));
            candidate.action.len() == num_actions && is_action && candidate.score.num_episodes > 0
        };
        if state.remembered.len() > NUM_REMEMBERED || !state.remembered.iter().chain(&state.chosen).all(is_candidate) {
            return Err(format!("it has candidates that are no actions of {num_actions} components that were tried"));
        }
        Ok(())
    }

    /// Searches until the budget is spent, or until `stop`; `observe` sees the state after every generation.
    ///
    /// A generation is begun only if it fits into the budget even when none of its episodes ends early.
    pub fn run(
        &self,
        state: &mut SearchState,
        workers: &Workers,
        stop: &AtomicBool,
        observe: &mut dyn FnMut(&SearchState),
    ) {
        let parameters = StrategyParameters::new(self.task.num_actions());
        let generation_steps = (parameters.lambda() * self.settings.num_episodes) as u64 * self.steps_of_an_episode();
        let choice_steps = self.choice_episodes() * self.steps_of_a_choice_episode();
        let for_candidates = self.settings.budget_env_steps.saturating_sub(choice_steps);
        while state.env_steps + generation_steps <= for_candidates || state.cma_es.generation == 0 {
            if stop.load(atomic::Ordering::Relaxed) {
                return;
            }
            self.generation(state, &parameters, workers);
            observe(state);
        }
        self.choose(state, workers);
        observe(state);
    }

    /// Tries one generation, all its candidates from the same starts, which no other generation has.
    fn generation(&self, state: &mut SearchState, parameters: &StrategyParameters, workers: &Workers) {
        let generation = u64::from(state.cma_es.generation);
        let mut rng = stream(self.seed, Purpose::Search, row(state.objective, Row::Candidates), generation);
        let conditions = self.conditions(state.objective, Row::Starts, generation);
        let mut tried: Vec<(Vec<f64>, Candidate)> = state
            .cma_es
            .sample(parameters, &mut || standard_normal(&mut rng))
            .into_iter()
            .map(|point| {
                let candidate = self.tried(action(&point), &conditions, workers, &mut state.env_steps);
                (point, candidate)
            })
            .collect();
        tried.sort_by(|(_, a), (_, b)| a.score.compare(&b.score, state.objective));
        let (ranked, candidates): (Vec<_>, Vec<_>) = tried.into_iter().unzip();
        state.cma_es.update(parameters, &ranked);
        state.remembered.extend(candidates);
        // A stable sort: of equals the older one stays.
        state.remembered.sort_by(|a, b| a.score.compare(&b.score, state.objective));
        state.remembered.truncate(NUM_REMEMBERED);
    }

    /// Tries a constant action.
    fn tried(&self, action: Vec<f32>, conditions: &Conditions, workers: &Workers, env_steps: &mut u64) -> Candidate {
        let episodes = run_episodes(self.task, Env::new, Mover::Constant(&action), conditions.clone(), workers);
        *env_steps += episodes.iter().map(|episode| u64::from(episode.env_steps)).sum::<u64>();
        Candidate { action, score: Score::of(&episodes) }
    }

    /// Judges the mean and the remembered candidates on starts that the search has not seen; the best one is chosen.
    fn choose(&self, state: &mut SearchState, workers: &Workers) {
        let mut conditions = self.conditions(state.objective, Row::Choice, 0);
        conditions.settings.num_episodes = (self.choice_episodes() / (NUM_REMEMBERED as u64 + 1)) as usize;
        conditions.settings.episode_s = self.settings.choice_episode_s;
        let remembered = state.remembered.iter().map(|candidate| candidate.action.clone());
        let actions: Vec<Vec<f32>> = std::iter::once(action(&state.cma_es.mean)).chain(remembered).collect();
        let mut finalists: Vec<Candidate> =
            actions.into_iter().map(|action| self.tried(action, &conditions, workers, &mut state.env_steps)).collect();
        finalists.sort_by(|a, b| a.score.compare(&b.score, state.objective));
        state.chosen = finalists.into_iter().next();
    }

    fn conditions(&self, objective: Objective, rows: Row, generation: u64) -> Conditions {
        let SearchSettings { num_episodes, episode_s, settle_s, physics_dt_s, .. } = *self.settings;
        Conditions {
            settings: EvaluationSettings { num_episodes, episode_s, settle_s, physics_dt_s, seed: self.seed },
            starts: Starts {
                purpose: Purpose::Search,
                row: row(objective, rows),
                first: generation * num_episodes as u64,
            },
            push: None,
        }
    }

    fn steps_of_an_episode(&self) -> u64 {
        (self.settings.episode_s / self.task.settings.control_dt_s).round() as u64
    }

    fn steps_of_a_choice_episode(&self) -> u64 {
        (self.settings.choice_episode_s / self.task.settings.control_dt_s).round() as u64
    }

    /// Held-out episodes of all finalists together: what their share of the budget allows, at least one each.
    fn choice_episodes(&self) -> u64 {
        let num_finalists = NUM_REMEMBERED as u64 + 1;
        let reserve = (CHOICE_SHARE * self.settings.budget_env_steps as f64) as u64;
        (reserve / (num_finalists * self.steps_of_a_choice_episode())).clamp(1, MAX_CHOICE_EPISODES) * num_finalists
    }
}

/// The action that a point of the search stands for, `(A)`.
fn action(point: &[f64]) -> Vec<f32> {
    point.iter().map(|&x| fold(x) as f32).collect()
}

/// What a row of random streams is for.
#[derive(Clone, Copy)]
enum Row {
    Candidates,
    Starts,
    Choice,
}

/// The number of a row: the searches of a seed share none but that of the choice, so that their results can be compared.
fn row(objective: Objective, row: Row) -> u64 {
    match row {
        Row::Choice => 0,
        Row::Candidates => 1 + 2 * objective as u64,
        Row::Starts => 2 + 2 * objective as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(falls: u64, speed_m_per_s: f64, episode_return: f64) -> Score {
        Score { num_episodes: 4, falls, speed_m_per_s, episode_return }
    }

    #[test]
    fn falls_come_last_for_speed_and_only_the_return_counts_for_return() {
        let (safe, fast) = (score(0, 0.5, 10.0), score(1, 2.0, 40.0));
        assert_eq!(safe.compare(&fast, Objective::Speed), Ordering::Less);
        assert_eq!(safe.compare(&fast, Objective::Return), Ordering::Greater);
        assert_eq!(score(1, 2.0, 0.0).compare(&score(1, 1.0, 9.0), Objective::Speed), Ordering::Less);
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut rng = stream(3, Purpose::Search, 0, 0);
        let values: Vec<f64> = (0..20_000).map(|_| standard_normal(&mut rng)).collect();
        let square = mean(&values.iter().map(|value| value * value).collect::<Vec<_>>());
        assert!(mean(&values).abs() < 0.03 && (square - 1.0).abs() < 0.04, "{} {square}", mean(&values));
    }

    #[test]
    fn the_searches_of_a_seed_share_the_starts_of_the_choice_alone() {
        let rows = Objective::ALL
            .map(|objective| [Row::Candidates, Row::Starts, Row::Choice].map(|kind| row(objective, kind)));
        assert_eq!(rows, [[1, 2, 0], [3, 4, 0]]);
    }
}
