//! The main way: train, stop, resume, evaluate.

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use common::{Finished, TemporaryFolder, canter_in, names, train_args};
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn a_training_ends_with_a_verdict_and_its_files() {
    let folder = TemporaryFolder::new();
    let stdout = folder.canter(&train_args(&["--out", "run"])).succeeded();
    let mut lines = stdout.lines();
    assert_eq!(lines.next(), Some("Training doggo on doggo's gait `sine`: 512 env steps, seed 3, 2 threads, into run"));
    assert!(lines.next().unwrap().starts_with("Trained 512 env steps in "), "{stdout}");
    let eval = json(&fs::read_to_string(folder.join("run/eval.json")).unwrap());
    let number = |pointer: &str| {
        let value = eval.pointer(pointer).unwrap_or_else(|| panic!("{pointer} is missing: {eval:#}"));
        value.as_f64().unwrap_or_else(|| panic!("{pointer} is no number: {eval:#}"))
    };
    let (ratio, default_gait) = (number("/speed_ratio"), eval["default_gait"].as_str().unwrap());
    let verdict = format!(
        "Learned gait: {:.2} m/s, {ratio:.2} (95 % interval {:.2} to {:.2}) times as fast as the default gait \
         `{default_gait}` ({:.2} m/s), ",
        number("/policy/speed_m_per_s"),
        number("/speed_ratio_ci/0"),
        number("/speed_ratio_ci/1"),
        number("/default_speed_m_per_s")
    );
    assert!(stdout.lines().any(|line| line.starts_with(&verdict)), "{verdict}\n{stdout}");
    assert!(stdout.contains("\nPolicy:   run/policy.safetensors\n"), "{stdout}");
    let run = folder.join("run");
    let files = [
        "checkpoints",
        "config.toml",
        "eval.json",
        "events.out.tfevents.canter",
        "figures",
        "lock",
        "metrics.jsonl",
        "policy.safetensors",
        "report.html",
        "run.json",
        "tables",
        "trajectories",
    ];
    assert_eq!(names(&run), files);
    assert_eq!(names(&run.join("trajectories")), ["learned.json", "sine.json", "stepping.json"]);
    let learned = json(&fs::read_to_string(run.join("trajectories/learned.json")).unwrap());
    assert_eq!((&learned["label"], &learned["robot"]), (&Value::from("learned gait"), &Value::from("doggo")));
    assert_eq!(names(&run.join("checkpoints")), ["00000000.safetensors", "00000004.safetensors"]);
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains(&format!("{:.2} <small>m/s</small>", number("/policy/speed_m_per_s"))), "{page}");
    let said = folder.canter(&["report", "run"]).succeeded();
    assert!(said.ends_with("Report:   run/report.html\n"), "{said}");
    assert_eq!(fs::read_to_string(run.join("report.html")).unwrap(), page);
    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let env_steps: Vec<_> = metrics.lines().map(|line| json(line)["env_steps"].as_u64().unwrap()).collect();
    assert_eq!(env_steps, [128, 256, 384, 512]);
    let run_json = json(&fs::read_to_string(run.join("run.json")).unwrap());
    assert_eq!((&run_json["threads"], &run_json["env_steps"]), (&Value::from(2), &Value::from(512)));
    let commit = env!("CANTER_STAMP").split(' ').next().filter(|commit| !commit.is_empty());
    assert_eq!(run_json.get("commit").and_then(Value::as_str), commit);
    assert!(run_json["train_s"].as_f64().unwrap() > 0.0);
    // The resolved configuration is complete: it is a preset itself.
    let resolved = folder.canter(&["config", "run/config.toml"]).succeeded();
    assert_eq!(resolved.trim_end(), fs::read_to_string(run.join("config.toml")).unwrap().trim_end());

    // The same numbers again, as `eval` prints them.
    let again = folder.canter(&["eval", "run", "--json"]).succeeded();
    assert_eq!(json(&again), eval);
    assert_eq!(json(&folder.canter(&["eval", "run", "--json", "--threads", "1"]).succeeded()), eval);
    assert!(number("/prior/speed_m_per_s") > 0.2);
    assert!(number("/policy/falls") >= 0.0 && number("/policy/cost_of_transport") > 0.0);
    let table = folder.canter(&["eval", "run"]).succeeded();
    assert!(table.starts_with(&verdict) && stdout.contains(table.trim_end()), "{table}");

    // Other ground, starts and numbers of episodes give other numbers, and say so.
    for (option, value, pointer) in [
        ("--slope", "5", "/protocol/slope_deg"),
        ("--slope", "-5", "/protocol/slope_deg"),
        ("--friction", "0.2", "/protocol/friction"),
        ("--seed", "9", "/protocol/seed"),
        ("--episodes", "3", "/protocol/num_episodes"),
    ] {
        let other = json(&folder.canter(&["eval", "run", "--json", option, value]).succeeded());
        assert_eq!(other.pointer(pointer).unwrap().as_f64(), value.parse().ok(), "{option}");
        for gait in ["policy", "prior"] {
            assert_ne!(other[gait]["speed_m_per_s"], eval[gait]["speed_m_per_s"], "{gait} {option} {value}");
        }
    }
    assert_eq!(names(&run), files);

    // A run that has ended has nothing left to train, and loses nothing.
    let policy = fs::read(run.join("policy.safetensors")).unwrap();
    let stdout = folder.canter(&["resume", "run"]).succeeded();
    assert!(stdout.contains("\nNothing was left to train. Now judging.\n") && !stdout.contains("NaN"), "{stdout}");
    assert!(fs::read(run.join("policy.safetensors")).unwrap() == policy);
    assert_eq!(fs::read_to_string(run.join("metrics.jsonl")).unwrap(), metrics);
    assert_eq!(json(&fs::read_to_string(run.join("run.json")).unwrap()), run_json);
}

#[test]
fn a_bare_gait_is_measured_alone() {
    let folder = TemporaryFolder::new();
    let args = ["eval", "--robot", "doggo", "--prior", "stepping", "--episodes", "2", "--json"];
    let eval = json(&folder.canter(&args).succeeded());
    assert!(eval.get("policy").is_none(), "{eval:#}");
    assert!(eval["prior"]["speed_m_per_s"].as_f64().unwrap() > 0.2);
    assert_eq!((&eval["prior_name"], &eval["prior"]["falls"]), (&Value::from("stepping"), &Value::from(0)));
    let table = folder.canter(&args[..7]).succeeded();
    let speed = eval["prior"]["speed_m_per_s"].as_f64().unwrap();
    assert!(table.starts_with(&format!("stepping: {speed:.2} m/s, no fall in 2 episodes.\n")), "{table}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn runs_are_numbered_and_the_same_seed_gives_the_same_bytes() {
    let folder = TemporaryFolder::new();
    for (n, threads) in [("1", "1"), ("2", "3")] {
        let mut args = train_args(&[]);
        let place = args.iter().position(|arg| *arg == "--threads").unwrap();
        args[place + 1] = threads;
        let stdout = folder.canter(&args).succeeded();
        assert!(stdout.contains(&format!("into runs/doggo-3-{n}\n")), "{stdout}");
    }
    let read = |n: u32, name: &str| fs::read(folder.join(&format!("runs/doggo-3-{n}/{name}"))).unwrap();
    for name in [
        "policy.safetensors",
        "checkpoints/00000004.safetensors",
        "eval.json",
        "config.toml",
        "trajectories/learned.json",
        "trajectories/sine.json",
    ] {
        assert!(read(1, name) == read(2, name), "{name}");
    }
}

#[test]
fn a_run_can_be_used_from_another_folder_with_an_empty_environment() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args(&["--out", "run"])).succeeded();
    let mut command = canter_in(Path::new("/"), &[]);
    command.env_clear().arg("eval").arg(folder.join("run")).arg("--json");
    let eval = json(&Finished::of(&command.output().unwrap()).succeeded());
    assert_eq!(eval, json(&fs::read_to_string(folder.join("run/eval.json")).unwrap()));

    // A robot of one's own is found again from anywhere, though its path was relative.
    fs::create_dir(folder.join("robot")).unwrap();
    for name in ["robot.toml", "doggo.xml"] {
        let original = common::in_repository("robots/doggo").join(name);
        fs::copy(original, folder.join("robot").join(name)).unwrap();
    }
    folder.canter(&train_args(&["--out", "own", "--set", "robot=robot/robot.toml"])).succeeded();
    let mut command = canter_in(Path::new("/"), &["eval", "--json"]);
    let eval = json(&Finished::of(&command.arg(folder.join("own")).output().unwrap()).succeeded());
    assert_eq!(eval, json(&fs::read_to_string(folder.join("own/eval.json")).unwrap()));
    // The policy of the robot of another name is refused.
    let settings = fs::read_to_string(folder.join("robot/robot.toml")).unwrap();
    fs::write(folder.join("robot/robot.toml"), settings.replacen("name = \"doggo\"", "name = \"puppy\"", 1)).unwrap();
    let complaint = folder.canter(&["eval", "own"]).failed_with(1);
    assert_eq!(
        complaint,
        "error: own/policy.safetensors: this policy cannot be used: it was trained for the robot \"doggo\", not for \"puppy\"\n"
    );
    let complaint = folder.canter(&["resume", "own"]).failed_with(1);
    assert!(complaint.contains("the robot's files have changed since"), "{complaint}");
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = TemporaryFolder::new();
    for args in [&["config", "doggo"][..], &["robots", "doggo"], &["--help"], &["eval", "--help"]] {
        let mut child = canter_in(folder.path(), args).spawn().unwrap();
        // Like `| head -0`: the pipe is closed before or while canter writes.
        drop(child.stdout.take());
        let finished = Finished::of(&child.wait_with_output().unwrap());
        assert_eq!((finished.code, finished.stderr.as_str()), (Some(0), ""), "{args:?}");
    }
    let program = env!("CARGO_BIN_EXE_canter");
    let script = format!("'{program}' config doggo | head -1; '{program}' config doggo >&-; echo $?");
    let output = Command::new("/bin/sh").args(["-c", &script]).output().unwrap();
    let finished = Finished::of(&output);
    assert_eq!(finished.stderr, "");
    let lines: Vec<_> = finished.stdout.lines().collect();
    assert_eq!((lines.len(), lines[1]), (2, "0"), "{lines:?}");
}

/// Waits until the run has written `lines` lines of metrics.
fn wait_for_metrics(run: &Path, lines: usize, child: &mut std::process::Child) {
    let num_lines = || fs::File::open(run.join("metrics.jsonl")).map_or(0, |file| BufReader::new(file).lines().count());
    while num_lines() < lines {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was stopped");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

/// A learning rate that does not depend on the length of the training, which is shortened below.
const CONSTANT_RATE: &str = "ppo.final_learning_rate=6e-4";

/// Starts a training of a thousand iterations, sends the signal after a few, and waits for the end.
fn interrupted(folder: &TemporaryFolder, run: &str, signal: &str) -> Finished {
    let args = train_args(&["--out", run, "--set", "training.max_env_steps=128000", "--set", CONSTANT_RATE]);
    let mut child = canter_in(folder.path(), &without_steps(&args)).stdin(Stdio::null()).spawn().unwrap();
    wait_for_metrics(&folder.join(run), 3, &mut child);
    let status = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(status.success());
    Finished::of(&child.wait_with_output().unwrap())
}

/// The arguments without `--steps N`.
fn without_steps<'a>(args: &[&'a str]) -> Vec<&'a str> {
    let place = args.iter().position(|arg| *arg == "--steps").unwrap();
    [&args[..place], &args[place + 2..]].concat()
}

#[test]
fn an_interrupted_training_is_saved_and_ends_like_an_undisturbed_one() {
    let folder = TemporaryFolder::new();
    for (signal, run) in [("-INT", "interrupted"), ("-TERM", "terminated")] {
        let finished = interrupted(&folder, run, signal);
        assert_eq!(finished.code, Some(130), "{finished:?}");
        let way_on = format!(" env steps, saved. Go on with:  canter resume {run}\n");
        assert!(finished.stdout.ends_with(&way_on), "{finished:?}");
        assert_eq!(
            finished.stderr,
            "\nstopping after this iteration; once more stops at once, back to the last checkpoint\n"
        );
        let run = folder.join(run);
        assert_eq!(names(&run), ["checkpoints", "config.toml", "events.out.tfevents.canter", "lock", "metrics.jsonl"]);
        let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
        let newest = names(&run.join("checkpoints")).pop().unwrap();
        assert_eq!(newest, format!("{:08}.safetensors", metrics.lines().count()));
    }
    // Resumed with fewer steps to go than it was stopped with, so that the test is short.
    let run = folder.join("interrupted");
    let done = fs::read_to_string(run.join("metrics.jsonl")).unwrap().lines().count();
    let total = format!("{}", 128 * (done + 3));
    let config = fs::read_to_string(run.join("config.toml")).unwrap();
    let shortened = config.replace("max_env_steps = 128000", &format!("max_env_steps = {total}"));
    assert_ne!(shortened, config);
    fs::write(run.join("config.toml"), shortened).unwrap();
    let stdout = folder.canter(&["resume", "interrupted", "--threads", "1"]).succeeded();
    let start = format!("Going on after {} env steps of {total}, 1 threads, in interrupted\n", 128 * done);
    assert!(stdout.starts_with(&start), "{stdout}");
    assert!(stdout.contains("\nLearned gait: "), "{stdout}");

    let setting = format!("training.max_env_steps={total}");
    let args = train_args(&["--out", "undisturbed", "--set", &setting, "--set", CONSTANT_RATE]);
    folder.canter(&without_steps(&args)).succeeded();
    for name in ["policy.safetensors", "eval.json", "trajectories/learned.json"] {
        let read = |run: &str| fs::read(folder.join(run).join(name)).unwrap();
        assert!(read("interrupted") == read("undisturbed"), "{name}");
    }
}

#[test]
fn a_log_for_programs_is_json_line_by_line() {
    let folder = TemporaryFolder::new();
    let stdout = folder.canter(&train_args(&["--out", "run", "--log-format", "json"])).succeeded();
    let events: Vec<Value> = stdout.lines().map(json).collect();
    let kinds: Vec<&str> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
    assert!(kinds.iter().all(|kind| ["message", "iteration", "verdict"].contains(kind)), "{kinds:?}");
    let metrics = fs::read_to_string(folder.join("run/metrics.jsonl")).unwrap();
    let iterations: Vec<&Value> = events.iter().filter_map(|event| event.get("iteration")).collect();
    assert_eq!(iterations, metrics.lines().map(json).collect::<Vec<_>>().iter().collect::<Vec<_>>());
    let verdict = events.iter().find_map(|event| event.get("verdict")).unwrap();
    assert_eq!(*verdict, json(&fs::read_to_string(folder.join("run/eval.json")).unwrap()));

    let complaint = folder.canter(&["resume", "nothing", "--log-format", "json"]).failed_with(1);
    let complaint = json(&complaint);
    assert_eq!(complaint["event"], "error");
    assert_eq!(complaint["error"], "nothing: no run directory: it has no config.toml");
}

#[test]
fn a_run_that_was_killed_before_it_saved_anything_begins_anew() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args(&["--out", "whole"])).succeeded();
    // Killed before it had written its configuration: only the lock and half a file are there.
    fs::create_dir(folder.join("begun")).unwrap();
    fs::write(folder.join("begun/lock"), "").unwrap();
    fs::write(folder.join("begun/config.toml.tmp"), "robot").unwrap();
    folder.canter(&train_args(&["--out", "begun"])).succeeded();
    // Killed before its first checkpoint.
    fs::create_dir_all(folder.join("resumed/checkpoints")).unwrap();
    fs::copy(folder.join("whole/config.toml"), folder.join("resumed/config.toml")).unwrap();
    fs::write(folder.join("resumed/checkpoints/00000000.safetensors.tmp"), "half").unwrap();
    folder.canter(&["resume", "resumed"]).succeeded();
    for run in ["begun", "resumed"] {
        let read = |run: &str| fs::read(folder.join(run).join("policy.safetensors")).unwrap();
        assert!(read(run) == read("whole"), "{run}");
    }
}

#[test]
fn every_gait_of_a_robot_is_measured_at_once() {
    let folder = TemporaryFolder::new();
    let text = folder.canter(&["eval", "--robot", "octopod", "--episodes", "2"]).succeeded();
    let names: Vec<&str> = text.lines().skip(2).map_while(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, ["alternating", "wave"]);
    assert!(text.contains("alternating (default, stable)"), "{text}");
    let json = folder.canter(&["eval", "--robot", "octopod", "--episodes", "2", "--json"]).succeeded();
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["protocol"]["num_episodes"], 2);
    for gait in ["alternating", "wave"] {
        let report = &json["gaits"][gait];
        assert!(report["falls"] == 0 && report["speed_m_per_s"].as_f64().unwrap() > 0.1, "{report}");
    }
}

#[test]
fn a_gait_becomes_a_table_and_the_table_a_gait_that_can_be_pasted() {
    let folder = TemporaryFolder::new();
    let table =
        folder.canter(&["gait", "table", "--robot", "doggo", "--prior", "stepping", "--rows", "50"]).succeeded();
    let mut lines = table.lines();
    assert!(lines.next().unwrap().starts_with("front_left_swing,front_left_extension,back_left_swing,"), "{table}");
    // Lift-off: atan2(-0.075, 0.17) = -0.41549.
    assert!(lines.next().unwrap().starts_with("-0.41549"), "{table}");
    assert_eq!(lines.count(), 49);
    let out = ["gait", "table", "--robot", "doggo", "--prior", "stepping", "--rows", "50", "--out", "trot.csv"];
    let said = folder.canter(&out).succeeded();
    assert_eq!(said, "Wrote 50 rows of one cycle at 2 Hz into trot.csv\n");
    assert_eq!(fs::read_to_string(folder.join("trot.csv")).unwrap(), table);

    let fit = ["gait", "fit", "--table", "trot.csv", "--robot", "doggo", "--frequency", "2", "--threads", "2"];
    let said = folder.canter(&fit).succeeded();
    let speed = |line: &str| -> f64 {
        let line = said.lines().find_map(|found| found.strip_prefix(line)).unwrap_or_else(|| panic!("{said}"));
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    let (of_table, of_gait) = (speed("# The table: "), speed("# This gait: "));
    assert!(of_table > 0.3 && (of_gait / of_table - 1.0).abs() < 0.02, "{said}");
    let shape = "\nstance_height_m = 0.17\ndown_amplitude_m = 0.04\nup_amplitude_m = 0.06\nflight_fraction = 0.35\nstep_length_m = 0.15\n";
    assert!(said.contains("\nkind = \"stepping\"\n") && said.contains(shape), "{said}");
    // All of it, comments included, is a piece of a robot.toml.
    let robot = common::in_repository("robots/doggo/robot.toml");
    fs::write(folder.join("robot.toml"), fs::read_to_string(robot).unwrap() + "\n" + &said).unwrap();
    fs::copy(common::in_repository("robots/doggo/doggo.xml"), folder.join("doggo.xml")).unwrap();
    let again = ["gait", "table", "--robot", "./robot.toml", "--prior", "fitted", "--rows", "50"];
    let again = folder.canter(&again).succeeded();
    let numbers = |table: &str| -> Vec<f64> {
        table.lines().skip(1).flat_map(|line| line.split(',')).map(|cell| cell.parse().unwrap()).collect()
    };
    let (numbers, expected) = (numbers(&again), numbers(&table));
    assert_eq!(numbers.len(), 50 * 8);
    assert!(numbers.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-4), "{again}\n{table}");
}

#[test]
fn robustness_puts_seeds_together_and_refuses_a_run_twice() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args(&["--out", "runs/mine-3-1"])).succeeded();
    let other_seed: Vec<_> = train_args(&["--out", "runs/mine-4-1"]);
    let other_seed: Vec<_> = other_seed.iter().map(|arg| if *arg == "3" { "4" } else { arg }).collect();
    folder.canter(&other_seed).succeeded();
    let stdout = folder.canter(&["robustness", "runs/mine-3-1", "runs/mine-4-1", "--json"]).succeeded();
    let groups = json(&stdout);
    assert_eq!(groups.as_array().unwrap().len(), 1);
    assert_eq!((&groups[0]["name"], &groups[0]["training_seeds"]), (&Value::from("mine"), &Value::from(vec![3, 4])));
    assert_eq!(groups[0]["conditions"][0]["num_episodes"], 4);
    let twice = folder.canter(&["robustness", "runs/mine-3-1", "runs/mine-4-1", "runs/../runs/mine-3-1/"]);
    assert_eq!(twice.code, Some(1));
    let message = "runs/../runs/mine-3-1/ is the training of runs/mine-3-1 again, seed 3, and would count twice";
    assert!(twice.stderr.contains(message), "{}", twice.stderr);
}
