//! Wrong input: one clear message, the right exit code, and nothing left behind.

mod common;

use std::fs;

use common::{TemporaryFolder, in_repository, names, train_args};

/// Runs canter in an empty folder, which must stay empty; expects exit code 1 and exactly this message.
#[track_caller]
fn assert_refused(args: &[&str], message: &str) {
    assert_refused_in(&TemporaryFolder::new(), args, message);
}

/// Runs canter in a folder, in which nothing may be added; expects exit code 1 and exactly this message.
#[track_caller]
fn assert_refused_in(folder: &TemporaryFolder, args: &[&str], message: &str) {
    let before = names(folder.path());
    let complaint = folder.canter(args).failed_with(1);
    assert_eq!(complaint, format!("error: {message}\n"));
    assert_eq!(names(folder.path()), before);
}

/// Runs canter in an empty folder, which must stay empty; expects exit code 2 and the parser's words to begin like this.
#[track_caller]
fn assert_wrong_usage(args: &[&str], start: &str) {
    let folder = TemporaryFolder::new();
    let complaint = folder.canter(args).failed_with(2);
    assert!(complaint.starts_with(start), "{complaint}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
}

#[test]
fn a_report_needs_what_it_reports_on() {
    let folder = TemporaryFolder::new();
    let said = |args: &[&str]| folder.canter(args).failed_with(1);
    for name in ["a", "b", "compare"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    fs::write(folder.join("compare/compare.json"), "{}").unwrap();
    assert_eq!(
        said(&["report", "a"]),
        "error: cannot report: a/eval.json: there is no such file; it comes from `canter train`; `canter resume RUN` \
         writes it again\n"
    );
    assert_eq!(
        said(&["report", "a", "b"]),
        "error: several runs need a folder for their report; give one with --out DIR\n"
    );
    let alone = "error: compare holds a comparison or a sweep, which is reported alone and into its own folder; leave out other \
                 folders and --out\n";
    assert_eq!(said(&["report", "a", "compare", "--out", "x"]), alone);
    assert_eq!(said(&["report", "compare", "--out", "x"]), alone);
    assert!(said(&["report", "compare"]).starts_with("error: cannot report: compare/compare.json: missing field"));
    assert_eq!(names(folder.path()), ["a", "b", "compare"]);
}

#[test]
fn a_dashboard_needs_a_folder_and_a_port() {
    let folder = TemporaryFolder::new();
    fs::write(folder.join("file"), "").unwrap();
    let said = |args: &[&str]| folder.canter(args).failed_with(1);
    assert!(said(&["serve", "missing"]).starts_with("error: missing: "));
    assert_eq!(said(&["serve", "file"]), "error: file is no folder; name the one that holds your runs\n");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let message = said(&["serve", ".", "--port", &port]);
    assert!(message.ends_with("Choose another port with --port, or any free one with --port 0\n"), "{message}");
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn unknown_presets() {
    let message = "no preset is called `doggoo`: there are `doggo`, `paper`, `minitaur`, `q8bot`, `quad12`, `hexapod`, `octopod`, `doggo-robust`, `minitaur-robust`, `q8bot-robust`, `quad12-robust`, `hexapod-robust`, `octopod-robust`; a configuration of your own is given by the path \
                   of its .toml file";
    assert_refused(&["train", "doggoo"], message);
    assert_refused(&["config", "doggoo"], message);
    let message = "own.toml: cannot be read: No such file or directory (os error 2)";
    assert_refused(&["train", "own.toml"], message);
    assert_refused(&["config", "own.toml"], message);
}

#[test]
fn wrong_values() {
    for (value, message) in [
        ("ppo.gama=0.9", "ppo.gama = 0.9 is not a known key: did you mean \"gamma\"?"),
        ("trainig.horizon=64", "trainig = (a table) is not a known key: did you mean \"training\"?"),
        ("ppo.gamma=high", "ppo.gamma = \"high\" has the wrong type: expected a number from 0 to 1"),
        ("ppo.gamma=2", "ppo.gamma = 2 is out of range: expected a number from 0 to 1"),
        (
            "policy.ranges.residual_rad=-0.1",
            "policy.ranges.residual_rad = -0.1 is out of range: expected a number from 0 to 2",
        ),
        ("seed=1.5", "seed = 1.5 has the wrong type: expected an integer"),
        (
            "policy.modulation=modulat",
            "policy.modulation = \"modulat\" is not a known choice: expected one of \"amplitude\", \"leg-amplitude\", \
             \"modulate\", \"residual\", \"direct\"; did you mean \"modulate\"?",
        ),
        (
            "policy.prior=canter",
            "policy.prior = \"canter\" is refused: doggo has no gait called `canter`: set it to one of `stepping`, `sine`, \
             `sine-literal`, `walk`, `pace`, `bound`, `pronk`, `gallop`",
        ),
        (
            "evaluation.settle_s=10",
            "evaluation.settle_s = 10 is refused: must leave 1 s of evaluation.episode_s to measure",
        ),
    ] {
        let expected = format!("--set {value}: {message}");
        assert_refused(&["train", "--set", value, "--out", "run"], &expected);
        assert_refused(&["config", "doggo", "--set", value], &expected);
    }
    let message = "--set training.max_env_steps=0: training.max_env_steps = 0 is out of range: expected an integer from 1 to \
                   100000000000";
    assert_refused(&["train", "--steps", "0"], message);
}

#[test]
fn several_wrong_values_at_once() {
    let args = ["train", "--set", "ppo.gamma=2", "--set", "ppo.gama=0.9", "--set", "network.actor_hidden=0"];
    let message = "--set network.actor_hidden=0: network.actor_hidden = 0 is out of range: expected an integer from 1 to 1024\n\
                   --set ppo.gama=0.9: ppo.gama = 0.9 is not a known key: did you mean \"gamma\"?\n\
                   --set ppo.gamma=2: ppo.gamma = 2 is out of range: expected a number from 0 to 1\n\
                   3 problems";
    assert_refused(&args, message);
}

#[test]
fn a_wrong_file_is_reported_with_lines() {
    let folder = TemporaryFolder::new();
    let preset = fs::read_to_string(in_repository("presets/paper.toml")).unwrap();
    let line_of = |start: &str| preset.lines().position(|line| line.starts_with(start)).unwrap() + 1;
    let wrong = preset.replace("gamma = 0.99", "gamma = -1").replace("seed = 1", "sed = 1");
    fs::write(folder.join("own.toml"), wrong).unwrap();
    let message = format!(
        "own.toml:1:1: seed is missing: expected an integer\n\
         own.toml:{}:1: sed = 1 is not a known key: did you mean \"seed\"?\n\
         own.toml:{}:9: gamma = -1 is out of range: expected a number from 0 to 1\n\
         3 problems",
        line_of("seed = 1"),
        line_of("gamma = 0.99")
    )
    .replace("gamma = -1 is", "ppo.gamma = -1 is");
    assert_refused_in(&folder, &["train", "own.toml"], &message);
    fs::write(folder.join("own.toml"), "robot = \"doggo\nseed = 1\n").unwrap();
    let complaint = folder.canter(&["train", "own.toml"]).failed_with(1);
    assert!(complaint.starts_with("error: own.toml:1:") && complaint.contains("not valid TOML: "), "{complaint}");
    assert_eq!(names(folder.path()), ["own.toml"]);
}

#[test]
fn wrong_usage() {
    assert_wrong_usage(
        &["train", "--set", "gamma"],
        "error: invalid value 'gamma' for '--set <KEY=VALUE>': expected KEY=VALUE, for example ppo.gamma=0.98\n",
    );
    let not_a_number = "invalid digit found in string\n";
    for (args, option) in [
        (["train", "--seed", "-1"], "--seed <N>"),
        (["train", "--steps", "-1"], "--steps <N>"),
        (["eval", "--episodes", "-1"], "--episodes <N>"),
        (["eval", "--seed", "-1"], "--seed <N>"),
    ] {
        assert_wrong_usage(&args, &format!("error: invalid value '-1' for '{option}': {not_a_number}"));
    }
    assert_wrong_usage(
        &["train", "--threads", "0"],
        "error: invalid value '0' for '--threads <N>': 0 is not in 1..=1024\n",
    );
    assert_wrong_usage(&["eval"], "error: the following required arguments were not provided:\n  <RUN>\n");
    assert_wrong_usage(
        &["eval", "run", "--robot", "doggo", "--prior", "sine"],
        "error: the argument '[RUN]' cannot be used with:\n",
    );
    assert_wrong_usage(&["eval", "--prior", "sine"], "error: the following required arguments were not provided:\n");
    assert_wrong_usage(
        &["trian"],
        "error: unrecognized subcommand 'trian'\n\n  tip: a similar subcommand exists: 'train'\n",
    );
}

/// A copy of Doggo's files in `folder/robot`, changed by `change_settings` and `change_model`.
fn copy_of_doggo(
    change_settings: impl Fn(String) -> String,
    change_model: impl Fn(String) -> String,
) -> TemporaryFolder {
    let folder = TemporaryFolder::new();
    let read = |name: &str| fs::read_to_string(in_repository("robots/doggo").join(name)).unwrap();
    fs::create_dir(folder.join("robot")).unwrap();
    fs::write(folder.join("robot/robot.toml"), change_settings(read("robot.toml"))).unwrap();
    fs::write(folder.join("robot/doggo.xml"), change_model(read("doggo.xml"))).unwrap();
    folder
}

const OWN_ROBOT: [&str; 3] = ["train", "--set", "robot=robot/robot.toml"];

#[test]
fn robots_that_are_not_there() {
    let message = "no robot is called `nobot`: there are doggo, minitaur, q8bot, quad12, hexapod, octopod; a robot of your own is given by the path of its file, like nobot/robot.toml";
    assert_refused(&["train", "--set", "robot=nobot"], message);
    assert_refused(&["eval", "--robot", "nobot", "--prior", "sine"], message);
    assert_refused(&["robots", "nobot"], message);
    let message = "robot/robot.toml: cannot be read: No such file or directory (os error 2)";
    assert_refused(&OWN_ROBOT, message);
    assert_refused(&["robots", "robot/robot.toml"], message);
}

#[test]
fn models_that_are_missing_or_broken() {
    let folder = copy_of_doggo(|text| text, |text| text);
    fs::remove_file(folder.join("robot/doggo.xml")).unwrap();
    let message = "robot/doggo.xml: cannot be read: No such file or directory (os error 2)";
    assert_refused_in(&folder, &OWN_ROBOT, message);

    for (good, bad, start, words) in [
        ("</mujoco>", "", "error: robot/doggo.xml:1: not well-formed XML: ", "never closed"),
        (
            "<worldbody>",
            "<worldbody><geom type=\"blob\"/>",
            "error: robot/doggo.xml: MuJoCo cannot load this model: ",
            "invalid keyword: 'blob'",
        ),
    ] {
        let folder = copy_of_doggo(|text| text, |text| text.replacen(good, bad, 1));
        let complaint = folder.canter(&OWN_ROBOT).failed_with(1);
        assert!(complaint.starts_with(start) && complaint.contains(words), "{complaint}");
        // Not even MuJoCo's own log file.
        assert_eq!(names(folder.path()), ["robot"]);
        assert_eq!(names(&folder.join("robot")), ["doggo.xml", "robot.toml"]);
    }
}

#[test]
fn a_robot_that_does_not_fit_its_model() {
    let change = |text: String| {
        text.replace("foot = \"front_left_foot\"", "foot = \"paw\"")
            .replace("body = \"chassis\"", "body = \"trunk\"")
            .replace("\"back_right_knee_b\"", "\"elbow\"")
    };
    let folder = copy_of_doggo(change, |text| text);
    let text = fs::read_to_string(folder.join("robot/robot.toml")).unwrap();
    let place = |value: &str| {
        let (i, line) = text.lines().enumerate().find(|(_, line)| line.contains(value)).unwrap();
        format!("robot/robot.toml:{}:{}", i + 1, line.find(value).unwrap() + 1)
    };
    let message = format!(
        "{}: body = \"trunk\" is refused: the model has no body called `trunk`\n\
         {}: legs[0].foot = \"paw\" is refused: the model has no geom called `paw`\n\
         {}: legs[2].knees[1] = \"elbow\" is refused: the model has no joint called `elbow`\n\
         3 problems",
        place("\"trunk\""),
        place("\"paw\""),
        place("\"elbow\""),
    );
    assert_refused_in(&folder, &OWN_ROBOT, &message);
    assert_refused_in(&folder, &["robots", "robot/robot.toml"], &message);
    assert_refused_in(&folder, &["eval", "--robot", "robot/robot.toml", "--prior", "sine"], &message);
}

#[test]
fn run_directories_that_cannot_be_read() {
    for command in ["eval", "resume", "film"] {
        assert_refused(&[command, "nowhere"], "nowhere: no run directory: it has no config.toml");
        let folder = TemporaryFolder::new();
        fs::create_dir(folder.join("empty")).unwrap();
        assert_refused_in(&folder, &[command, "empty"], "empty: no run directory: it has no config.toml");
        assert_eq!(names(&folder.join("empty")), Vec::<String>::new());
        fs::write(folder.join("file"), "").unwrap();
        assert_refused_in(&folder, &[command, "file"], "file: no run directory: it has no config.toml");
        fs::create_dir(folder.join("binary")).unwrap();
        fs::write(folder.join("binary/config.toml"), b"robot = \"\xff\"").unwrap();
        let message = "binary/config.toml: not UTF-8: the byte at offset 9 belongs to no character";
        assert_refused_in(&folder, &[command, "binary"], message);
    }
}

#[test]
fn a_robot_where_a_configuration_belongs() {
    let puppy = copy_of_doggo(|text| text, |text| text);
    let path = puppy.join("robot/robot.toml").display().to_string();
    let message = format!(
        "{path}: this file describes a robot; train on it with `--set robot={path}` and name one of its gaits with \
         `--set policy.prior=NAME`"
    );
    assert_refused(&["train", &path], &message);
}

#[test]
fn runs_without_policy_or_checkpoint() {
    let folder = TemporaryFolder::new();
    fs::create_dir(folder.join("run")).unwrap();
    let config = folder.canter(&["config", "doggo"]).succeeded();
    fs::write(folder.join("run/config.toml"), config).unwrap();
    let message = "run: no policy yet, the training has not ended; `canter resume run` goes on with it";
    assert_refused_in(&folder, &["eval", "run"], message);
    assert_refused_in(&folder, &["film", "run"], message);
    // Something was done here, and somebody has removed what it could go on from.
    fs::write(folder.join("run/metrics.jsonl"), "").unwrap();
    assert_refused_in(&folder, &["resume", "run"], "run/checkpoints: no checkpoint to go on from: there is none");
}

#[test]
fn policies_of_other_runs() {
    let folder = TemporaryFolder::new();
    folder.canter(&train_args(&["--out", "sine"])).succeeded();
    folder.canter(&train_args(&["--out", "stepping", "--set", "policy.prior=stepping"])).succeeded();
    fs::copy(folder.join("stepping/policy.safetensors"), folder.join("sine/policy.safetensors")).unwrap();
    let start = "sine/policy.safetensors: this policy cannot be used: ";
    let message = format!("{start}it was trained for the gait \"stepping\", not for \"sine\"");
    assert_refused_in(&folder, &["eval", "sine"], &message);

    // The same run with a robot of another name: a copy of Doggo's files.
    let puppy = copy_of_doggo(|text| text.replacen("name = \"doggo\"", "name = \"puppy\"", 1), |text| text);
    let robot = format!("robot = \"{}\"", puppy.join("robot/robot.toml").display());
    let config = fs::read_to_string(folder.join("stepping/config.toml")).unwrap();
    fs::write(folder.join("stepping/config.toml"), config.replace("robot = \"doggo\"", &robot)).unwrap();
    let message = "stepping/policy.safetensors: this policy cannot be used: it was trained for the robot \"doggo\", not for \
                   \"puppy\"";
    assert_refused_in(&folder, &["eval", "stepping"], message);

    fs::write(folder.join("sine/policy.safetensors"), b"damaged").unwrap();
    let complaint = folder.canter(&["eval", "sine"]).failed_with(1);
    assert!(complaint.starts_with(&format!("error: {start}this is no safetensors file: ")), "{complaint}");
}

#[test]
fn evaluations_that_cannot_be() {
    let message = "--set policy.prior=\"canter\": policy.prior = \"canter\" is refused: doggo has no gait called `canter`: set \
                   it to one of `stepping`, `sine`, `sine-literal`, `walk`, `pace`, `bound`, `pronk`, `gallop`";
    assert_refused(&["eval", "--robot", "doggo", "--prior", "canter"], message);
    for (option, value, message) in [
        ("--episodes", "0", "evaluation.num_episodes = 0 is out of range: expected an integer from 2 to 10000"),
        ("--slope", "-90", "task.slope_deg = -90.0 is out of range: expected a number from -45 to 45"),
        ("--friction", "-1", "task.friction = -1.0 is out of range: expected a number from 0 to 10"),
    ] {
        let (key_and_value, _) = message.split_once(" is out").unwrap();
        let message = format!("--set {}: {message}", key_and_value.replace(" = ", "="));
        assert_refused(&["eval", "--robot", "doggo", "--prior", "sine", option, value], &message);
    }
}

#[test]
fn films_that_cannot_be() {
    assert_refused(&["film", "run", "--out", "film.avi"], "film.avi: the name of a film ends in .gif or .mp4");
    assert_refused(&["film", "run", "--out", "film"], "film: the name of a film ends in .gif or .mp4");
    for (option, value, words) in [
        (
            "--size <WxH>",
            "961x360",
            "expected two even numbers with an x between them, from 320x120 to 3840x2160, for example 960x360\n",
        ),
        ("--seconds <S>", "-1", "expected a number from 0.1 to 60\n"),
        ("--fps <N>", "60", "60 is not in 1..=50\n"),
    ] {
        let (name, _) = option.split_once(' ').unwrap();
        let start = format!("error: invalid value '{value}' for '{option}': {words}");
        assert_wrong_usage(&["film", "run", name, value], &start);
    }
}

#[test]
#[cfg(not(feature = "view"))]
fn a_build_without_the_viewer_says_how_to_get_it() {
    let message = "this canter was built without its viewer. Build it with `cargo build --release --package canter \
                   --features view` and then run `target/release/canter view run`; or write a film with `canter film run`";
    assert_refused(&["view", "run"], message);
}

#[test]
fn a_folder_that_is_not_empty_is_not_touched() {
    let folder = TemporaryFolder::new();
    fs::create_dir(folder.join("run")).unwrap();
    fs::write(folder.join("run/precious.txt"), "mine").unwrap();
    let message = "run: this folder is not empty; choose another with --out, or go on with `canter resume run`";
    assert_refused_in(&folder, &train_args(&["--out", "run"]), message);
    assert_eq!(names(&folder.join("run")), ["precious.txt"]);
    let message = "run/precious.txt/run: Not a directory (os error 20)";
    assert_refused_in(&folder, &train_args(&["--out", "run/precious.txt/run"]), message);
    assert_eq!(fs::read_to_string(folder.join("run/precious.txt")).unwrap(), "mine");
}

#[test]
fn gaits_need_names_that_files_can_have() {
    for (name, reason) in [
        ("../trot", "files are named after gaits: use letters, digits, `-` and `_` only"),
        ("", "files are named after gaits: use letters, digits, `-` and `_` only"),
        ("learned", "this name is what training makes of a gait"),
        ("stepping", "another gait has this name"),
    ] {
        let value = format!("{name:?}");
        let change = |text: String| text.replace("\"sine-literal\"", &value);
        let folder = copy_of_doggo(change, |text| text);
        let text = fs::read_to_string(folder.join("robot/robot.toml")).unwrap();
        let line =
            text.lines().collect::<Vec<_>>().iter().rposition(|line| **line == format!("name = {value}")).unwrap() + 1;
        let message = format!("robot/robot.toml:{line}:8: gaits[2].name = {value} is refused: {reason}");
        assert_refused_in(&folder, &OWN_ROBOT, &message);
    }
}

#[test]
fn tables_that_are_no_gait() {
    let folder = TemporaryFolder::new();
    let fit =
        |table: &str| ["gait", "fit", "--table", table, "--robot", "doggo", "--frequency", "2"].map(str::to_owned);
    let refused = |args: &[String], message: &str| {
        assert_refused_in(&folder, &args.iter().map(String::as_str).collect::<Vec<_>>(), message);
    };
    let table = folder.canter(&["gait", "table", "--robot", "doggo", "--prior", "sine", "--rows", "8"]).succeeded();
    fs::write(folder.join("good.csv"), &table).unwrap();
    fs::write(folder.join("cut.csv"), table.lines().next().unwrap()).unwrap();
    fs::write(folder.join("words.csv"), table.replacen("0.", "x.", 1)).unwrap();
    fs::write(folder.join("other.csv"), table.replacen("front_left_swing", "swing", 1)).unwrap();
    let still = format!("{}\n{}", table.lines().next().unwrap(), "0,0,0,0,0,0,0,0\n".repeat(8));
    fs::write(folder.join("still.csv"), still).unwrap();
    refused(
        &fit("none.csv"),
        "none.csv: this table cannot be used: cannot be read: No such file or directory (os error 2)",
    );
    refused(&fit("cut.csv"), "cut.csv: this table cannot be used: expected at least 4 lines of numbers, found 0");
    refused(
        &fit("other.csv"),
        "other.csv: this table cannot be used: it has no column for the actuator `front_left_swing`",
    );
    refused(
        &fit("still.csv"),
        "still.csv: no gait can be fitted to this table: no leg moves in it: there is no gait to be found",
    );
    let complaint = folder.canter(&fit("words.csv").iter().map(String::as_str).collect::<Vec<_>>()).failed_with(1);
    assert!(complaint.starts_with("error: words.csv: this table cannot be used: line 2: `"), "{complaint}");
    let mut never = fit("good.csv");
    never[7] = "0".to_owned();
    refused(
        &never,
        "good.csv: no gait can be fitted to this table: a stride frequency of 0 Hz is not from 0.01 to 20 Hz",
    );
    assert_refused(
        &["gait", "table", "--robot", "hexapod", "--prior", "trot"],
        "hexapod has no gait called `trot`: there are tripod, ripple, wave",
    );
}
