//! A whole comparison, made tiny: it ends, it goes on after a stop to the same bytes, and refuses other settings.

mod common;

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use canter_train::compare::protocol::{CompareSettings, EvaluationCard, Quantity, Rung, SearchCard, Sweep};
use canter_train::compare::{CompareFolder, compare};
use canter_train::jobs::JobsError;
use canter_train::search::tuned::{Objective, Search, SearchSettings};
use common::{TemporaryFolder, looking_on};
use serde_json::Value;

fn tiny() -> CompareSettings {
    let overrides = [
        ("task.episode_s", "0.3"),
        ("network.actor_hidden", "16"),
        ("network.critic_hidden", "16"),
        ("ppo.num_epochs", "1"),
        ("ppo.minibatch_size", "64"),
        ("training.num_environments", "2"),
        ("training.horizon", "40"),
        ("training.checkpoint_env_steps", "80"),
    ];
    CompareSettings {
        evaluation: EvaluationCard { num_episodes: 2, episode_s: 3.5, settle_s: 0.5, physics_dt_s: 0.005, seed: 0 },
        search: SearchCard { num_episodes: 1, episode_s: 0.3 },
        sweeps: vec![
            Sweep { quantity: Quantity::Slope, values: vec![0.0, 20.0] },
            Sweep { quantity: Quantity::Mass, values: vec![1.3] },
            Sweep { quantity: Quantity::Delay, values: vec![0.03] },
            Sweep { quantity: Quantity::Push, values: vec![0.4] },
        ],
        sweep_episodes: 2,
        overrides: overrides.map(|(key, value)| (key.to_owned(), value.to_owned())).to_vec(),
        ..CompareSettings::quick(400, 2)
    }
}

/// Whether it came to its end; `stop_after` counts what the jobs report.
fn run_in(path: &Path, settings: &CompareSettings, num_threads: usize, stop_after: Option<u64>) -> bool {
    let folder = CompareFolder::open(Some(path), settings).unwrap();
    let stop = AtomicBool::new(false);
    compare(&folder, num_threads, &stop, &looking_on(&stop, stop_after)).unwrap().is_some()
}

#[test]
fn a_comparison_ends_and_goes_on_after_stops_to_the_same_bytes() {
    let folder = TemporaryFolder::new();
    let (undisturbed, stopped) = (folder.join("undisturbed"), folder.join("stopped"));
    let settings = tiny();
    assert!(run_in(&undisturbed, &settings, 2, None));
    let mut starts = 1;
    // Stops in searches, trainings and measurements; later starts are cut shorter by what is done already.
    while !run_in(&stopped, &settings, 1 + starts % 2, Some(3 + 5 * starts as u64)) {
        assert!(!stopped.join("compare.json").exists());
        starts += 1;
        assert!(starts < 100, "every start comes further");
    }
    assert!(starts > 4, "{starts}");
    let bytes = |run: &Path| fs::read_to_string(run.join("compare.json")).unwrap();
    assert_eq!(bytes(&stopped), bytes(&undisturbed));

    let comparison: Value = serde_json::from_str(&bytes(&undisturbed)).unwrap();
    let mut names: Vec<_> = Rung::ALL.iter().map(|rung| rung.name()).collect();
    names.sort_unstable();
    let rungs = comparison["rungs"].as_object().unwrap();
    assert_eq!(rungs.keys().collect::<Vec<_>>(), names);
    for (name, rung) in rungs {
        let is_gait = rung["kind"] == "gait";
        let seeds: Vec<_> = rung["seeds"].as_array().unwrap().iter().map(|run| &run["seed"]).cloned().collect();
        assert_eq!(seeds, if is_gait { vec![Value::Null] } else { vec![Value::from(1), Value::from(2)] }, "{name}");
        for run in rung["seeds"].as_array().unwrap() {
            assert_eq!(run["speeds_m_per_s"].as_array().unwrap().len(), 2, "{name}");
            let steps = run["env_steps"].as_u64().unwrap();
            match rung["kind"].as_str().unwrap() {
                "gait" => assert_eq!(steps, 0, "{name}"),
                "learned" => assert_eq!(steps, 400, "{name}"),
                _ => assert!(steps > 0, "{name}"),
            }
            assert_eq!(run["return_curve"].as_array().unwrap().is_empty(), rung["kind"] != "learned", "{name}");
        }
        assert!(rung["speed_ci"][0].as_f64() <= rung["speed_iqm"].as_f64(), "{name}");
    }
    let slope = &comparison["sweeps"]["slope_deg"];
    assert_eq!(slope["values"], serde_json::json!([0.0, 20.0]));
    assert_eq!(
        slope["rungs"].as_object().unwrap().keys().collect::<Vec<_>>(),
        ["doggo", "paper", "sine", "stepping", "tuned"]
    );
    let sine = slope["rungs"]["sine"]["speed_m_per_s"].as_array().unwrap();
    assert!(sine[0].as_f64().unwrap() > sine[1].as_f64().unwrap() + 0.1, "uphill is slower: {sine:?}");
    assert_eq!(sine[0], comparison["rungs"]["sine"]["speed_iqm"], "the sweep's level ground is the evaluation's");
    for other in ["mass_factor", "delay_s", "push_m_per_s"] {
        assert_ne!(comparison["sweeps"][other]["rungs"]["sine"]["speed_m_per_s"][0], sine[0], "{other}");
    }
    assert_eq!(comparison["claims"].as_array().unwrap().len(), 14);
    for (rung, path) in comparison["trajectories"].as_object().unwrap() {
        let text = fs::read_to_string(undisturbed.join(path.as_str().unwrap())).unwrap();
        let trajectory: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(trajectory["name"], Value::from(rung.as_str()));
    }
    assert_eq!(comparison["trajectories"].as_object().unwrap().len(), 7);
    let uphill = comparison["uphill_trajectories"].as_object().unwrap();
    assert_eq!(uphill.keys().collect::<Vec<_>>(), ["doggo", "paper", "sine", "stepping", "tuned"]);
    for path in uphill.values() {
        let recorded = fs::read_to_string(undisturbed.join(path.as_str().unwrap())).unwrap();
        let recorded: Value = serde_json::from_str(&recorded).unwrap();
        assert_eq!(recorded["slope_deg"], 20.0, "{path}");
    }

    // A learned rung's folder is a run directory; a search leaves its gait.
    let files = common::names(&undisturbed.join("doggo-2"));
    let expected = [
        "checkpoints",
        "config.toml",
        "events.out.tfevents.canter",
        "lock",
        "measured.json",
        "metrics.jsonl",
        "policy.safetensors",
        "trajectories",
    ];
    assert_eq!(files, expected);
    let tuned: Value =
        serde_json::from_str(&fs::read_to_string(undisturbed.join("tuned-1/tuned.json")).unwrap()).unwrap();
    assert_eq!(tuned["action"].as_array().unwrap().len(), 17);
    assert_eq!(tuned["legs"].as_array().unwrap().len(), 4);
}

#[test]
fn a_search_keeps_its_budget_and_goes_on_after_a_stop_like_one_without() {
    let resolved = Rung::Tuned.resolved(&tiny(), 1).unwrap();
    let settings = SearchSettings {
        budget_env_steps: 3000,
        num_episodes: 1,
        episode_s: 0.4,
        settle_s: 0.1,
        choice_episode_s: 0.5,
        physics_dt_s: 0.005,
    };
    let search = Search { task: &resolved.task, settings: &settings, seed: 1 };
    let workers = common::workers(1);
    for objective in Objective::ALL {
        let mut undisturbed = search.start(objective);
        search.run(&mut undisturbed, &workers, &AtomicBool::new(false), &mut |_| {});
        // 300 steps for the choice: 5 finalists in 1 episode of 50 steps; 12 candidates of 40 steps a generation.
        // A candidate that falls early takes less.
        assert!((2000..=5 * 480 + 250).contains(&undisturbed.env_steps), "{}", undisturbed.env_steps);
        assert_eq!(undisturbed.cma_es.generation, 5);
        let mut state = search.start(objective);
        while state.chosen.is_none() {
            let stop = AtomicBool::new(false);
            search.run(&mut state, &workers, &stop, &mut |_| stop.store(true, Ordering::Relaxed));
            // As it is saved and read again.
            state = serde_json::from_str(&serde_json::to_string(&state).unwrap()).unwrap();
        }
        assert_eq!(state, undisturbed);
        let chosen = state.chosen.unwrap();
        assert!(chosen.action.iter().all(|value| value.abs() <= 1.0) && chosen.score.num_episodes == 1);
        let other = Search { seed: 2, ..search };
        let mut of_another_seed = other.start(objective);
        other.run(&mut of_another_seed, &workers, &AtomicBool::new(false), &mut |_| {});
        assert_ne!(of_another_seed.chosen.unwrap().action, chosen.action);
    }
}

#[test]
fn other_settings_and_other_folders_are_refused() {
    let folder = TemporaryFolder::new();
    let path = folder.join("comparison");
    let settings = CompareSettings { rungs: vec![Rung::Sine, Rung::Stepping], ..tiny() };
    drop(CompareFolder::open(Some(&path), &settings).unwrap());
    let refusal = |settings: &CompareSettings| CompareFolder::open(Some(&path), settings).unwrap_err().to_string();
    let other_budget = CompareSettings { budget_env_steps: 500, ..settings.clone() };
    let message = refusal(&other_budget);
    assert!(
        message.ends_with(
            "this folder holds results of other settings (`budget_env_steps` is 400 there, 500 here); choose \
             another with --out"
        ),
        "{message}"
    );
    let other_rungs = CompareSettings { rungs: vec![Rung::Sine, Rung::Stepping, Rung::Doggo], ..settings.clone() };
    assert!(refusal(&other_rungs).contains("`configurations` differs"), "{}", refusal(&other_rungs));
    let held = CompareFolder::open(Some(&path), &settings).unwrap();
    assert!(refusal(&settings).contains("another canter is writing"), "{}", refusal(&settings));
    drop(held);
    fs::write(folder.join("file"), "").unwrap();
    let error = CompareFolder::open(Some(folder.path()), &settings).unwrap_err();
    assert!(matches!(error, JobsError::NotEmpty(_)), "{error}");
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let folder = TemporaryFolder::new();
    let settings = CompareSettings { rungs: vec![Rung::Sine, Rung::Stepping, Rung::Doggo], ..tiny() };
    let bytes = |name: &str, num_threads: usize| {
        assert!(run_in(&folder.join(name), &settings, num_threads, None));
        fs::read(folder.join(name).join("compare.json")).unwrap()
    };
    assert!(bytes("one", 1) == bytes("three", 3));
}

/// A change of a file.
type Damage = fn(&mut Value);

#[test]
fn what_a_job_left_and_cannot_be_is_named() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    let settings = CompareSettings { rungs: vec![Rung::Sine, Rung::Stepping], ..tiny() };
    assert!(run_in(&run, &settings, 1, None));
    let path = run.join("sine/measured.json");
    let good: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let refusal = |change: Damage| {
        let mut changed = good.clone();
        change(&mut changed);
        fs::write(&path, changed.to_string()).unwrap();
        let folder = CompareFolder::open(Some(&run), &settings).unwrap();
        compare(&folder, 1, &AtomicBool::new(false), &|_| {}).unwrap_err().to_string()
    };
    let cases: [(Damage, &str); 4] = [
        (
            |file| file["sweeps"]["push_m_per_s"] = Value::from(Vec::<Value>::new()),
            "the sweep `push_m_per_s` has 0 points for 1 values",
        ),
        (
            |file| file["sweeps"]["slope_deg"][1]["speeds_m_per_s"] = Value::from(Vec::<f64>::new()),
            "the sweep `slope_deg` has 0 speeds and 2 falls of 0 episodes",
        ),
        (|file| file["run"]["falls"] = Value::from(9), "`run` has 2 speeds and 9 falls of 2 episodes"),
        (|file| file["run"]["speed_m_per_s"] = Value::from(1e300), "it holds a number that is beyond all measure"),
    ];
    for (change, what) in cases {
        let message = refusal(change);
        assert_eq!(message, format!("sine: {}: {what}; remove it, and its job begins again", path.display()));
    }
}

#[test]
fn a_search_goes_on_only_from_what_one_can_have_left() {
    let resolved = Rung::Tuned.resolved(&tiny(), 1).unwrap();
    let settings = tiny().search();
    let search = Search { task: &resolved.task, settings: &settings, seed: 1 };
    let good = serde_json::to_value(search.start(Objective::Speed)).unwrap();
    let refusal = |change: &dyn Fn(&mut Value)| {
        let mut changed = good.clone();
        change(&mut changed);
        search.check(&serde_json::from_value(changed).unwrap(), Objective::Speed).err()
    };
    assert_eq!(refusal(&|_| {}), None);
    let dimensions = "its distribution is none over 17 dimensions";
    assert_eq!(refusal(&|state| state["cma_es"]["mean"] = Value::from(vec![0.0; 3])).unwrap(), dimensions);
    assert_eq!(refusal(&|state| state["cma_es"]["covariance"] = Value::from(vec![1.0; 17])).unwrap(), dimensions);
    assert_eq!(refusal(&|state| state["cma_es"]["sigma"] = Value::from(-0.1)).unwrap(), dimensions);
    assert_eq!(refusal(&|state| state["cma_es"]["generation"] = Value::from(u32::MAX)).unwrap(), dimensions);
    let objective = refusal(&|state| state["objective"] = Value::from("return")).unwrap();
    assert_eq!(objective, "it searches for `return`, not for `speed`");
    let measure = "it holds a number that is beyond all measure";
    assert_eq!(refusal(&|state| state["env_steps"] = Value::from(u64::MAX)).unwrap(), measure);
    assert_eq!(refusal(&|state| state["cma_es"]["p_c"][0] = Value::from(1e300)).unwrap(), measure);
    let candidate = serde_json::json!({
        "action": [0.5], "score": { "num_episodes": 1, "falls": 0, "speed_m_per_s": 0.5, "episode_return": 3.0 },
    });
    let candidates = refusal(&|state| state["chosen"] = candidate.clone()).unwrap();
    assert_eq!(candidates, "it has candidates that are no actions of 17 components that were tried");
}
