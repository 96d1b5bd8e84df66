//! Training as a whole: presets, what may be combined, the first minibatch, and how a training ends.

mod common;

use canter_gait::Policy;
use canter_learn::Environment;
use canter_sim::settings::{Document, write_commented};
use canter_train::config::{DEFAULT_PRESET, RunConfig, open_preset, preset_names, preset_of, resolve};
use canter_train::environment::TrainingEnvironment;
use canter_train::policy_file::PolicyFile;
use canter_train::trainer::{IterationReport, Trainer};

#[test]
fn every_preset_resolves_and_its_commented_output_reads_back_equal() {
    let names: Vec<_> = preset_names().collect();
    let own = ["doggo", "paper", "minitaur", "q8bot", "quad12", "hexapod", "octopod"];
    let robust = own.iter().filter(|name| **name != "paper").map(|name| format!("{name}-robust"));
    assert_eq!(names, own.iter().map(|name| (*name).to_owned()).chain(robust).collect::<Vec<_>>());
    assert!(names.contains(&DEFAULT_PRESET.to_owned()));
    for name in names {
        let config = resolve(&open_preset(&name).unwrap()).unwrap().config;
        let text = write_commented(&config);
        let again = Document::parse("again.toml", text.as_bytes()).unwrap();
        assert_eq!(again.read::<RunConfig>().unwrap(), config, "{name}");
        assert_eq!(write_commented(&resolve(&again).unwrap().config), text, "{name}");
    }
}

#[test]
fn a_configuration_is_called_by_its_preset_whatever_its_seed_and_evaluation() {
    let name = |preset: &str, changes: &[(&str, &str)]| {
        let mut document = open_preset(preset).unwrap();
        changes.iter().for_each(|(key, value)| document.set(key, value));
        preset_of(&resolve(&document).unwrap().config)
    };
    for preset in ["doggo", "paper", "doggo-robust", "q8bot"] {
        let changes = [("seed", "7"), ("evaluation.seed", "1000"), ("evaluation.num_episodes", "5")];
        assert_eq!(name(preset, &changes).as_deref(), Some(preset));
    }
    assert_eq!(name("doggo", &[("training.max_env_steps", "4096")]), None);
    assert_eq!(name("doggo", &[("robot", "hexapod"), ("policy.prior", "tripod")]).as_deref(), Some("hexapod"));
}

#[test]
fn every_robot_has_the_same_reward() {
    let config = |name: &str| open_preset(name).unwrap().read::<RunConfig>().unwrap();
    let doggo = config("doggo");
    for name in ["doggo-robust", "minitaur", "q8bot", "quad12", "hexapod", "octopod"] {
        assert_eq!((config(name).reward, config(name).network.actor_hidden), (doggo.reward.clone(), 64), "{name}");
    }
}

/// Leaving any line out of a preset is an error that names the key, but for the keys that may be absent.
#[test]
fn presets_are_complete() {
    const OPTIONAL: [&str; 13] = [
        "policy.ranges.extension_amplitude_rad",
        "policy.ranges.extension_offset_rad",
        "task.goal_distance_m",
        "task.cross_slope_deg",
        "task.friction",
        "task.mass_factor",
        "task.strength_factor",
        "task.delay_s",
        "task.variation.share",
        "task.variation.slope_deg",
        "ppo.final_learning_rate",
        "ppo.target_kl",
        "training.max_episodes",
    ];
    // The others are made of Doggo's.
    for name in ["doggo", "paper"] {
        let path = format!("{}/../../presets/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let (mut required, mut table) = (0, String::new());
        for (i, line) in text.lines().enumerate() {
            if let Some(header) = line.strip_prefix('[') {
                table = format!("{}.", header.trim_end_matches(']'));
            }
            let Some((key, _)) = line.split_once(" = ").filter(|(key, _)| !key.starts_with('#')) else { continue };
            let without: String =
                text.lines().enumerate().filter(|(j, _)| *j != i).map(|(_, line)| format!("{line}\n")).collect();
            let result = Document::parse("cut.toml", without.as_bytes()).unwrap().read::<RunConfig>();
            if OPTIONAL.contains(&format!("{table}{key}").as_str()) {
                assert!(result.is_ok(), "{name}: {key}");
            } else {
                let message = result.unwrap_err().to_string();
                assert!(message.contains(&format!(": {table}{key} is missing: expected ")), "{name}: {message}");
                required += 1;
            }
        }
        assert!(required > 40, "{name}: {required} keys");
    }
}

#[test]
fn a_value_that_only_fits_alone_is_refused_with_its_place() {
    let refusal = |changes: &[(&str, &str)]| {
        let mut document = open_preset("doggo").unwrap();
        changes.iter().for_each(|(key, value)| document.set(key, value));
        resolve(&document).unwrap_err().to_string()
    };
    assert_eq!(
        refusal(&[("evaluation.settle_s", "10.0")]),
        "--set evaluation.settle_s=10.0: evaluation.settle_s = 10.0 is refused: must leave 1 s of evaluation.episode_s to measure"
    );
    let message = refusal(&[("training.num_environments", "4096"), ("training.horizon", "2000")]);
    assert!(message.starts_with("--set training.horizon=2000: training.horizon = 2000 is refused: "), "{message}");
    let message = refusal(&[("task.physics_dt_s", "0.003")]);
    assert!(message.starts_with("--set task.physics_dt_s=0.003: task.physics_dt_s = 0.003 is refused: "), "{message}");
    let message = refusal(&[("policy.ranges.swing_amplitude_rad", "[0.5, 1.0]")]);
    assert!(message.contains("the prior's own value, 0.415, lies outside"), "{message}");
}

/// Where the policy that collects and the one that learns agree, every ratio of the first minibatch is 1 within 1e-5.
#[test]
fn the_first_minibatch_has_ratio_one() {
    for modulation in ["amplitude", "modulate", "direct"] {
        let changes = [
            ("policy.modulation", modulation),
            ("training.horizon", "100"),
            ("ppo.num_epochs", "1"),
            ("ppo.minibatch_size", "400"),
            ("network.actor_hidden", "64"),
            ("ppo.learning_rate", "1e-2"),
        ];
        let mut resolved = common::tiny(&changes);
        // Below what a configuration allows: `clip_fraction` then counts every ratio that is off by more.
        resolved.config.ppo.clip_epsilon = 1e-5;
        let workers = common::workers(2);
        let mut trainer = Trainer::new(resolved);
        for iteration in 0..4 {
            let update = trainer.iterate(&workers).unwrap().update.unwrap();
            assert_eq!(update.clip_fraction, 0.0, "{modulation}, iteration {iteration}: {update:?}");
            assert!(update.approx_kl.abs() < 1e-8, "{modulation}, iteration {iteration}: {update:?}");
            // The mean of standardised advantages times 1.
            assert!(update.policy_loss.abs() < 1e-5, "{modulation}, iteration {iteration}: {update:?}");
        }
    }
}

fn assert_finite(report: &IterationReport, what: &str) {
    let update = report.update.as_ref().unwrap();
    let numbers = [
        report.speed_m_per_s,
        report.power_w,
        report.mean_std,
        update.policy_loss,
        update.value_loss,
        update.entropy,
        update.approx_kl,
        update.clip_fraction,
        update.explained_variance.expect("returns differ"),
        update.gradient_norm,
        update.learning_rate,
    ];
    assert!(numbers.iter().all(|number| number.is_finite()), "{what}: {report:?}");
    assert!(report.episodes.iter().all(|episode| episode.episode_return.is_finite()), "{what}: {report:?}");
    assert!(
        report.power_w > 0.0 && update.gradient_norm > 0.0 && report.speed_m_per_s.abs() < 5.0,
        "{what}: {report:?}"
    );
}

#[test]
fn every_modulation_trains_on_every_gait_on_level_ground_and_uphill() {
    let workers = common::workers(2);
    for modulation in ["amplitude", "leg-amplitude", "modulate", "direct"] {
        for gait in ["sine", "stepping", "sine-literal"] {
            for slope_deg in ["0.0", "10.0"] {
                let what = format!("{modulation} on {gait} at {slope_deg} degrees");
                let changes =
                    [("policy.modulation", modulation), ("policy.prior", gait), ("task.slope_deg", slope_deg)];
                let mut trainer = Trainer::new(common::tiny(&changes));
                let before = trainer.actor_parameters().to_vec();
                let report = trainer.iterate(&workers).unwrap();
                assert_finite(&report, &what);
                assert_eq!((report.progress.iterations, report.progress.env_steps), (1, 128), "{what}");
                assert!(trainer.actor_parameters() != before, "{what}: nothing was learned");
                assert!(trainer.actor_parameters().iter().all(|parameter| parameter.is_finite()), "{what}");
            }
        }
    }
}

#[test]
fn the_slope_and_the_seed_change_what_is_collected() {
    let speed = |changes: &[(&str, &str)]| {
        let report = Trainer::new(common::tiny(changes)).iterate(&common::workers(2)).unwrap();
        report.speed_m_per_s
    };
    let level = speed(&[]);
    assert_ne!(level, speed(&[("task.slope_deg", "10.0")]));
    assert_ne!(level, speed(&[("seed", "2")]));
    assert_eq!(level, speed(&[]));
}

#[test]
fn the_time_limit_truncates_and_episodes_go_on_across_iterations() {
    let workers = common::workers(2);
    let mut trainer = Trainer::new(common::tiny(&[("task.episode_s", "0.4"), ("policy.authority", "0.0")]));
    let mut lengths = Vec::new();
    for _ in 0..5 {
        let report = trainer.iterate(&workers).unwrap();
        assert_eq!(report.accidents.iter().sum::<u64>(), 0);
        assert!(report.episodes.iter().all(|episode| !episode.terminated));
        lengths.push(report.episodes.iter().map(|episode| episode.episode_length).collect::<Vec<_>>());
    }
    // 40 steps an episode, 32 an iteration, all 4 environments in step: ends at 40, 80, 120 and 160 of 160.
    let expected: [&[u64]; 5] = [&[], &[40; 4], &[40; 4], &[40; 4], &[40; 4]];
    assert_eq!(lengths, expected);
    assert_eq!(trainer.progress().episodes, 16);
}

#[test]
fn accidents_end_episodes_and_are_counted() {
    // Doggo tumbles down a slope of 45 degrees.
    let changes = [("task.slope_deg", "45.0"), ("task.episode_s", "10.0"), ("training.horizon", "200")];
    let report = Trainer::new(common::tiny(&changes)).iterate(&common::workers(2)).unwrap();
    let terminated = report.episodes.iter().filter(|episode| episode.terminated).count() as u64;
    assert!(terminated > 0);
    assert_eq!(report.accidents.iter().sum::<u64>(), terminated);
    assert_eq!(report.progress.episodes, report.episodes.len() as u64);
}

#[test]
fn a_training_ends_with_the_iteration_that_reaches_its_steps_or_its_episodes() {
    let iterations = |changes: &[(&str, &str)]| {
        let workers = common::workers(2);
        let mut trainer = Trainer::new(common::tiny(&[changes, &[("policy.authority", "0.0")]].concat()));
        while !trainer.is_finished() {
            trainer.iterate(&workers).unwrap();
        }
        trainer.progress().iterations
    };
    assert_eq!(iterations(&[("training.max_env_steps", "256")]), 2);
    assert_eq!(iterations(&[("training.max_env_steps", "257")]), 3);
    // Four episodes end with env step 50 of each environment, in iteration 2; four more in iteration 4.
    assert_eq!(iterations(&[("training.max_episodes", "4")]), 2);
    assert_eq!(iterations(&[("training.max_episodes", "5")]), 4);
}

/// What the learner does between its observation and its action is what the robot's code does: the same steps follow.
#[test]
fn the_learner_and_the_robot_look_into_the_same_mirror() {
    let resolved = common::tiny(&[("policy.symmetric", "true")]);
    let mut trainer = Trainer::new(resolved.clone());
    trainer.iterate(&common::workers(2)).unwrap();
    let file = PolicyFile::from_bytes(&PolicyFile::of(&trainer).to_bytes()).unwrap();
    let policy = file.policy();
    assert!(policy.mirror.is_some());
    let without_mirror = Policy { mirror: None, ..policy };
    let (num_observations, num_actions) = (resolved.task.num_observations(), resolved.task.num_actions());
    let mut learner = TrainingEnvironment::new(resolved.task.clone(), 3, 0, 1);
    let mut robot = TrainingEnvironment::new(common::tiny(&[("policy.symmetric", "false")]).task, 3, 0, 1);
    let (mut seen, mut sensed) = (vec![0.0; num_observations], vec![0.0; num_observations]);
    learner.reset(&mut seen);
    robot.reset(&mut sensed);
    let (mut hidden, mut action) = (vec![0.0; policy.network.workspace_len()], vec![0.0; num_actions]);
    let mut num_reflected = 0;
    for step in 0..45 {
        num_reflected += usize::from(seen != sensed);
        without_mirror.act(&mut seen, &mut hidden, &mut action);
        let expected = learner.step(&action, &mut seen);
        policy.act(&mut sensed, &mut hidden, &mut action);
        assert_eq!(robot.step(&action, &mut sensed), expected, "step {step}");
    }
    assert!((10..35).contains(&num_reflected), "{num_reflected}");
}
