//! What is compared, and by which rules: the gaits, their budgets, how they are measured.

use canter_sim::Task;
use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, EvaluationSettings, Resolved, open_preset, resolve};
use crate::evaluate::Push;
use crate::search::tuned::SearchSettings;

/// When the pushes of a sweep happen, from the start of an episode [s]: the gait has settled, and has time to recover.
const PUSH_AT_S: f64 = 3.0;

/// Slope on which an episode is recorded, as on level ground: that of the paper's fig. 7 [deg].
pub const UPHILL_DEG: f64 = 20.0;

/// One kind of gait that is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// The robot's sine gait, bare.
    Sine,
    /// The firmware's trot, bare.
    Stepping,
    /// The best constant parameters that a search finds.
    Tuned,
    /// The paper's control experiment: learning without a prior, all else as in `paper`.
    Direct,
    /// Learning without a prior as well as we can.
    DirectBest,
    /// The paper's method.
    Paper,
    /// Our method.
    Doggo,
}

/// How a gait comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RungKind {
    /// Its owner has it already.
    Gait,
    /// By a search over constant parameters.
    Tuned,
    /// By learning.
    Learned,
}

impl Rung {
    /// Every rung, from the gait as it is to the best one.
    pub const ALL: [Self; 7] =
        [Self::Sine, Self::Stepping, Self::Tuned, Self::Direct, Self::DirectBest, Self::Paper, Self::Doggo];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sine => "sine",
            Self::Stepping => "stepping",
            Self::Tuned => "tuned",
            Self::Direct => "direct",
            Self::DirectBest => "direct-best",
            Self::Paper => "paper",
            Self::Doggo => "doggo",
        }
    }

    /// The rung of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rung| rung.name() == name)
    }

    /// Its name for readers.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Sine => "default sine gait",
            Self::Stepping => "firmware's trot",
            Self::Tuned => "tuned gait",
            Self::Direct => "no prior, as in the paper",
            Self::DirectBest => "no prior, our best",
            Self::Paper => "the paper's method",
            Self::Doggo => "learned gait",
        }
    }

    /// What it is, in a sentence.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Sine => "The robot's own sine gait, eq. 4 with the firmware trot's amplitudes, without any learning.",
            Self::Stepping => "The trot of the robot's firmware, without any learning.",
            Self::Tuned => {
                "The best constant gait parameters that CMA-ES finds: frequency, and amplitudes and offsets of each leg, in \
                 the ranges that the learned gait may use. It searches twice on level ground, for the training return and for \
                 speed without falls, each time with the full budget, and the better one counts."
            }
            Self::Direct => {
                "The paper's control experiment: same network, reward and hyperparameters as `paper`, but the outputs are \
                 the eight motor angles."
            }
            Self::DirectBest => {
                "Learning without a prior as well as we can: observation, network and hyperparameters of `doggo`, but the \
                 outputs are the eight motor angles, and all training is on level ground."
            }
            Self::Paper => "The paper's method: two amplitudes of the sine gait of eq. 4, from the eight motor angles.",
            Self::Doggo => {
                "Our method: frequency, and amplitudes and offsets of each leg, changed at every control step; trained on \
                 level ground and on slopes up to 24 degrees."
            }
        }
    }

    /// How it comes about.
    pub const fn kind(self) -> RungKind {
        match self {
            Self::Sine | Self::Stepping => RungKind::Gait,
            Self::Tuned => RungKind::Tuned,
            Self::Direct | Self::DirectBest | Self::Paper | Self::Doggo => RungKind::Learned,
        }
    }

    /// Whether it is measured on other grounds and under disturbances as well.
    pub const fn is_swept(self) -> bool {
        !matches!(self, Self::Direct | Self::DirectBest)
    }

    /// The preset that it stands on, and what is changed there.
    fn preset(self) -> (&'static str, &'static [(&'static str, &'static str)]) {
        const DIRECT: &[(&str, &str)] = &[("policy.modulation", "direct"), ("policy.authority", "1.0")];
        // Slopes would only take env steps from level ground, where it is measured.
        const DIRECT_BEST: &[(&str, &str)] =
            &[("policy.modulation", "direct"), ("policy.authority", "1.0"), ("task.variation.share", "0.0")];
        const TUNED: &[(&str, &str)] = &[("policy.modulation", "modulate"), ("policy.authority", "1.0")];
        match self {
            Self::Sine => ("doggo", &[("policy.prior", "sine")]),
            Self::Stepping => ("doggo", &[("policy.prior", "stepping"), ("policy.modulation", "leg-amplitude")]),
            Self::Tuned => ("doggo", TUNED),
            Self::Direct => ("paper", DIRECT),
            Self::DirectBest => ("doggo", DIRECT_BEST),
            Self::Paper => ("paper", &[]),
            Self::Doggo => ("doggo", &[]),
        }
    }

    /// Its configuration for a seed.
    ///
    /// The budget alone ends a training, and none goes beyond it: whole iterations as far as they fit, at least one.
    ///
    /// # Errors
    /// Overrides that do not fit.
    pub fn resolved(self, settings: &CompareSettings, seed: u64) -> Result<Resolved, ConfigError> {
        let (preset, changes) = self.preset();
        let mut document = open_preset(preset)?;
        let own = changes.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        for (key, value) in own.chain(settings.overrides.iter().cloned()) {
            document.set(&key, &value);
        }
        document.set("seed", &seed.to_string());
        let mut resolved = resolve(&document)?;
        let training = &mut resolved.config.training;
        let rollout = (training.num_environments * training.horizon) as u64;
        training.max_episodes = None;
        training.max_env_steps = (settings.budget_env_steps / rollout).max(1) * rollout;
        resolved.config.evaluation = settings.evaluation();
        Ok(resolved)
    }
}

/// Everything that decides a comparison's result, but for the version of canter and the robot's files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompareSettings {
    /// Whether it is the short form.
    pub quick: bool,
    /// Env steps of each learned gait and each search, for each seed.
    pub budget_env_steps: u64,
    /// Seeds of training and search.
    pub seeds: Vec<u64>,
    /// What is compared.
    pub rungs: Vec<Rung>,
    /// How speeds are measured.
    pub evaluation: EvaluationCard,
    /// How the search tries its candidates.
    pub search: SearchCard,
    /// Other grounds and disturbances.
    pub sweeps: Vec<Sweep>,
    /// Episodes of each value of a sweep, over all seeds of a rung together.
    pub sweep_episodes: usize,
    /// Changes of every preset, as with `--set`: for tests.
    pub overrides: Vec<(String, String)>,
}

/// Number, length and starts of the episodes of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationCard {
    /// Episodes of each gait and seed.
    pub num_episodes: usize,
    /// Length of an episode [s].
    pub episode_s: f64,
    /// The speed counts from here on [s].
    pub settle_s: f64,
    /// Time of one physics step [s].
    pub physics_dt_s: f64,
    /// Seed of the starts; no training and no search ever sees them.
    pub seed: u64,
}

/// How the search tries a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchCard {
    /// Episodes of a candidate.
    pub num_episodes: usize,
    /// Length of such an episode [s].
    pub episode_s: f64,
}

/// One condition that is varied while everything else stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// What is varied.
    pub quantity: Quantity,
    /// Its values.
    pub values: Vec<f64>,
}

/// What a sweep varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Quantity {
    /// Slope of the ground, positive uphill [deg].
    #[serde(rename = "slope_deg")]
    Slope,
    /// Sliding friction.
    #[serde(rename = "friction")]
    Friction,
    /// Factor of every mass and moment of inertia.
    #[serde(rename = "mass_factor")]
    Mass,
    /// Time from a command to its effect, the robot's own delay included [s].
    #[serde(rename = "delay_s")]
    Delay,
    /// Change of the body's sideways velocity by a push [m/s].
    #[serde(rename = "push_m_per_s")]
    Push,
}

impl Quantity {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Slope => "slope_deg",
            Self::Friction => "friction",
            Self::Mass => "mass_factor",
            Self::Delay => "delay_s",
            Self::Push => "push_m_per_s",
        }
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Slope => "deg",
            Self::Friction | Self::Mass => "-",
            Self::Delay => "s",
            Self::Push => "m/s",
        }
    }

    /// The task, and the push if there is one, with this value.
    pub fn applied(self, task: &Task, value: f64) -> (Task, Option<Push>) {
        let mut task = task.clone();
        let mut push = None;
        match self {
            Self::Slope => task.settings.slope_deg = value,
            Self::Friction => task.settings.friction = Some(value),
            Self::Mass => task.settings.mass_factor = Some(value),
            Self::Delay => task.settings.delay_s = Some(value),
            Self::Push => push = Some(Push { at_s: PUSH_AT_S, velocity_m_per_s: value }),
        }
        (task, push)
    }
}

impl CompareSettings {
    /// The full comparison.
    pub fn full(budget_env_steps: u64, num_seeds: u64) -> Self {
        let sweep = |quantity, values: &[f64]| Sweep { quantity, values: values.to_vec() };
        Self {
            quick: false,
            budget_env_steps,
            seeds: (1..=num_seeds).collect(),
            rungs: Rung::ALL.to_vec(),
            evaluation: EvaluationCard {
                num_episodes: 20,
                episode_s: 10.0,
                settle_s: 1.0,
                physics_dt_s: 0.002,
                seed: 0,
            },
            // Two episodes of a candidate, and so half as many generations, found slower gaits on seed 1.
            search: SearchCard { num_episodes: 1, episode_s: 5.0 },
            sweeps: vec![
                sweep(Quantity::Slope, &[-20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0, 25.0]),
                sweep(Quantity::Friction, &[0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2]),
                sweep(Quantity::Mass, &[0.7, 0.85, 1.0, 1.15, 1.3]),
                sweep(Quantity::Delay, &[0.0, 0.01, 0.02, 0.03, 0.04]),
                sweep(Quantity::Push, &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
            ],
            sweep_episodes: 20,
            overrides: Vec::new(),
        }
    }

    /// The short comparison: says whether everything works, not how good a gait is.
    pub fn quick(budget_env_steps: u64, num_seeds: u64) -> Self {
        let sweep = |quantity, values: &[f64]| Sweep { quantity, values: values.to_vec() };
        let full = Self::full(budget_env_steps, num_seeds);
        Self {
            quick: true,
            evaluation: EvaluationCard { num_episodes: 6, ..full.evaluation },
            sweeps: vec![
                sweep(Quantity::Slope, &[-20.0, -10.0, 0.0, 10.0, 20.0, 25.0]),
                sweep(Quantity::Friction, &[0.3, 0.8, 1.2]),
                sweep(Quantity::Mass, &[0.7, 1.0, 1.3]),
                sweep(Quantity::Delay, &[0.0, 0.02, 0.04]),
                sweep(Quantity::Push, &[0.0, 0.3, 0.6]),
            ],
            sweep_episodes: 4,
            ..full
        }
    }

    /// The evaluation in the words of a run's configuration.
    pub fn evaluation(&self) -> EvaluationSettings {
        let EvaluationCard { num_episodes, episode_s, settle_s, physics_dt_s, seed } = self.evaluation;
        EvaluationSettings { num_episodes, episode_s, settle_s, physics_dt_s, seed }
    }

    /// The search's own settings.
    pub fn search(&self) -> SearchSettings {
        SearchSettings {
            budget_env_steps: self.budget_env_steps,
            num_episodes: self.search.num_episodes,
            episode_s: self.search.episode_s,
            settle_s: self.evaluation.settle_s,
            choice_episode_s: self.evaluation.episode_s,
            physics_dt_s: self.evaluation.physics_dt_s,
        }
    }

    /// Episodes that one of `num_runs` runs of a rung takes for a value of a sweep; at least one.
    pub fn sweep_episodes_of_a_run(&self, num_runs: usize) -> usize {
        (self.sweep_episodes / num_runs).max(1)
    }

    /// What a sceptic has to know, in plain words.
    pub fn text(&self) -> String {
        let EvaluationCard { num_episodes, episode_s, settle_s, physics_dt_s, seed } = self.evaluation;
        let seeds: Vec<String> = self.seeds.iter().map(u64::to_string).collect();
        format!(
            "Each learned gait is trained, and each search runs, with at most {} env steps for each of the seeds {}. Every \
             env step counts, those of episodes that fall early and those for choosing among a search's finalists too; the \
             tuned gait searches twice, each time with the full budget. A training's last policy is taken: nothing is \
             selected among checkpoints or seeds. Afterwards each gait is measured once, without exploration, in {num_episodes} \
             episodes of {episode_s} s from random starts of seed {seed}, the same for every gait and never seen in training or \
             search; speed is the way forward after {settle_s} s divided by the remaining time, and a robot that falls keeps \
             the full time. Every gait is searched and measured with physics steps of {physics_dt_s} s, whatever it was \
             trained with. A gait's speed is the interquartile mean over its seeds, with the 95 % bootstrap interval over the \
             seeds; a gait that is not learned has no seeds, and its interval is over episodes. The default gait is the \
             faster of the bare gaits. Under other conditions each gait is measured in {} episodes for each value, shared \
             among its seeds, with seeds and episodes resampled; pushes come from the side {PUSH_AT_S} s after the start. \
             The hyperparameters of `doggo` and `paper` were chosen beforehand on seeds from 101 on.",
            self.budget_env_steps,
            seeds.join(", "),
            self.sweep_episodes
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rung_resolves_and_none_goes_beyond_the_budget() {
        let settings = CompareSettings::full(1_000_000, 5);
        for rung in Rung::ALL {
            let resolved = rung.resolved(&settings, 3).unwrap();
            let training = &resolved.config.training;
            assert_eq!((training.max_env_steps, training.max_episodes), (999_424, None), "{}", rung.name());
            assert_eq!(resolved.config.seed, 3);
            assert_eq!(Rung::from_name(rung.name()), Some(rung));
        }
    }

    /// What the paper's control experiment keeps and what it changes.
    #[test]
    fn direct_differs_from_paper_in_its_outputs_alone() {
        let settings = CompareSettings::full(1_000_000, 5);
        let config = |rung: Rung| rung.resolved(&settings, 1).unwrap();
        let (direct, mut paper) = (config(Rung::Direct), config(Rung::Paper));
        assert_eq!((direct.task.num_observations(), direct.task.num_actions()), (8, 8));
        assert_eq!((paper.task.num_observations(), paper.task.num_actions()), (8, 2));
        paper.config.policy.modulation = direct.config.policy.modulation;
        paper.config.policy.authority = direct.config.policy.authority;
        assert_eq!(direct.config, paper.config);
    }

    /// A constant policy of `doggo` and a candidate of the search have the same gaits to choose from.
    #[test]
    fn tuned_searches_what_a_constant_policy_of_doggo_can_do() {
        let settings = CompareSettings::full(1_000_000, 5);
        let task = |rung: Rung| rung.resolved(&settings, 1).unwrap().task;
        let (tuned, doggo) = (task(Rung::Tuned), task(Rung::Doggo));
        assert_eq!(tuned.controller().law(), doggo.controller().law());
        assert_eq!(tuned.controller().gait().legs, doggo.controller().gait().legs);
        assert_eq!(tuned.num_actions(), 17);
        assert_eq!(tuned.reward, doggo.reward);
    }

    #[test]
    fn a_sweep_changes_what_it_says() {
        let task = Rung::Sine.resolved(&CompareSettings::quick(1, 1), 1).unwrap().task;
        let mass = |task: &Task| task.weight_n() / task.robot.model.gravity();
        let (heavy, push) = Quantity::Mass.applied(&task, 1.3);
        assert!((mass(&heavy) / mass(&task) - 1.3).abs() < 1e-12 && push.is_none());
        assert_eq!(Quantity::Delay.applied(&task, 0.03).0.settings.delay_s, Some(0.03));
        assert_eq!(Quantity::Slope.applied(&task, 20.0).0.settings.slope_deg, 20.0);
        assert_eq!(Quantity::Friction.applied(&task, 0.3).0.settings.friction, Some(0.3));
        assert_eq!(Quantity::Push.applied(&task, 0.6).1.unwrap().velocity_m_per_s, 0.6);
        assert_eq!(task.robot.settings.command_delay_steps, 1);
    }
}
