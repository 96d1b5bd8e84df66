//! What a run leaves: policy files, checkpoints and the run directory; whole, damaged, or somebody else's.

mod common;

use std::fs;
use std::path::Path;

use canter_train::checkpoint::Checkpoint;
use canter_train::config::{open_preset, resolve};
use canter_train::policy_file::{PolicyError, PolicyFile};
use canter_train::run::Ending;
use canter_train::run_directory::{RunDirectory, RunError, read_config, read_policy};
use canter_train::tensors::{TensorError, TensorFile};
use canter_train::trainer::Trainer;
use common::{TemporaryFolder, draws};
use serde_json::{Value, json};

/// The bytes of a short training's policy.
fn policy_bytes() -> Vec<u8> {
    PolicyFile::of(&common::trained(&[], 2)).to_bytes()
}

/// The file with its metadata changed.
fn with_metadata(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    rewritten(bytes, change, |_, _| {})
}

/// The file with its metadata and the numbers of its arrays changed.
fn rewritten(bytes: &[u8], change: impl FnOnce(&mut Value), change_array: impl Fn(&str, &mut [f32])) -> Vec<u8> {
    let file = TensorFile::from_bytes(bytes).unwrap();
    let mut metadata: Value = serde_json::from_str(file.metadata()).unwrap();
    change(&mut metadata);
    let mut changed = TensorFile::new(metadata.to_string());
    for name in ARRAYS {
        let shape = file.shape(name).unwrap().to_vec();
        let mut values = file.get::<f32>(name, &shape).unwrap();
        change_array(name, &mut values);
        changed.push(name, &shape, &values);
    }
    changed.to_bytes()
}

/// Every array of a policy file.
const ARRAYS: [&str; 10] = [
    "actor.0.bias",
    "actor.0.weight",
    "actor.1.bias",
    "actor.1.weight",
    "actor.2.bias",
    "actor.2.weight",
    "normaliser.inverse_std",
    "normaliser.mean",
    "test.action",
    "test.observation",
];

#[test]
fn a_policy_reads_back_equal_and_acts_the_same() {
    let trainer = common::trained(&[], 2);
    let policy = PolicyFile::of(&trainer);
    let bytes = policy.to_bytes();
    let back = PolicyFile::from_bytes(&bytes).unwrap();
    assert_eq!(back, policy);
    assert!(back.to_bytes() == bytes);
    back.check(&trainer.resolved().task).unwrap();
    assert_eq!((back.card.provenance.iterations, back.card.provenance.env_steps), (2, 256));
    let act = |policy: &PolicyFile| {
        let policy = policy.policy();
        let shape = policy.network.shape();
        let mut observation: Vec<f32> = (0..shape.input).map(|i| i as f32 * 0.01).collect();
        let mut action = vec![0.0; shape.output];
        policy.act(&mut observation, &mut vec![0.0; policy.network.workspace_len()], &mut action);
        action
    };
    assert_eq!(act(&back), act(&policy));
    // Nothing is rewritten without a reason: the helper below leaves an untouched file as it is.
    assert!(with_metadata(&bytes, |_| {}) == bytes);
}

#[test]
fn only_a_residual_policy_has_a_bound_and_it_is_held_to_it() {
    let residual = [("policy.modulation", "residual"), ("policy.ranges.residual_rad", "0.125")];
    let policy = PolicyFile::of(&common::trained(&residual, 1));
    let back = PolicyFile::from_bytes(&policy.to_bytes()).unwrap();
    assert_eq!((&back, back.card.action.residual_bound_rad), (&policy, Some(0.125)));
    back.check(&common::tiny(&residual).task).unwrap();
    let other = [residual[0], ("policy.ranges.residual_rad", "0.25")];
    let message = back.check(&common::tiny(&other).task).unwrap_err().to_string();
    assert!(message.starts_with("it was trained for the action law"), "{message}");
    // The others' files are as they were before there was a residual.
    let bytes = policy_bytes();
    let metadata: Value = serde_json::from_str(TensorFile::from_bytes(&bytes).unwrap().metadata()).unwrap();
    assert!(metadata["action"].is_object() && metadata["action"].get("residual_bound_rad").is_none());
    let changed = [("policy.ranges.residual_rad", "0.25")];
    PolicyFile::from_bytes(&bytes).unwrap().check(&common::tiny(&changed).task).unwrap();
}

/// A file cut anywhere is an error; one with a changed byte is an error or, where the byte means nothing, equal.
fn assert_robust<T: PartialEq + std::fmt::Debug, E: std::error::Error>(
    bytes: &[u8],
    read: impl Fn(&[u8]) -> Result<T, E>,
) {
    let original = read(bytes).unwrap();
    let header_end = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let mut draw = draws(1);
    for cut in (0..header_end.min(600)).chain((0..1000).map(|_| draw(bytes.len()))).chain([bytes.len() - 1]) {
        assert!(read(&bytes[..cut]).is_err(), "cut at {cut} of {}", bytes.len());
    }
    let mut longer = bytes.to_vec();
    longer.push(0);
    assert!(read(&longer).is_err());
    let mut damaged = bytes.to_vec();
    for trial in 0..4000 {
        // A third of the changes hits the header, which is a small part of the file.
        let place = if trial % 3 == 0 { draw(header_end) } else { draw(bytes.len()) };
        let flipped_bit = 1 << draw(8);
        damaged[place] ^= flipped_bit;
        if let Ok(read) = read(&damaged) {
            assert!(read == original, "bit {flipped_bit:#x} of byte {place}: accepted, but not equal");
        }
        damaged[place] = bytes[place];
    }
}

#[test]
fn no_damage_to_a_policy_goes_unnoticed() {
    assert_robust(&policy_bytes(), PolicyFile::from_bytes);
}

#[test]
fn no_damage_to_a_checkpoint_goes_unnoticed() {
    let bytes = Checkpoint::of(&common::trained(&[], 2)).to_bytes();
    assert_robust(&bytes, |bytes| Checkpoint::from_bytes(bytes).map(|checkpoint| checkpoint.to_bytes()));
}

#[test]
fn many_damages_at_once_never_panic() {
    let mut draw = draws(2);
    for bytes in [policy_bytes(), Checkpoint::of(&common::trained(&[], 1)).to_bytes()] {
        for _ in 0..1000 {
            let mut damaged = bytes.clone();
            for _ in 0..=draw(8) {
                let place = if draw(2) == 0 { draw(200) } else { draw(damaged.len()) };
                damaged[place] = draw(256) as u8;
            }
            let _ = PolicyFile::from_bytes(&damaged);
            let _ = Checkpoint::from_bytes(&damaged);
        }
    }
    for bytes in [&b""[..], b"{}", &[0xff; 64], &[0; 64]] {
        assert!(PolicyFile::from_bytes(bytes).is_err());
        assert!(Checkpoint::from_bytes(bytes).is_err());
    }
}

#[test]
fn the_metadata_is_one_string_with_sorted_keys_and_says_nothing_of_the_machine() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    assert_eq!(common::run_in(&run, &[], 3, None), Ending::Finished);
    let bytes = fs::read(run.join("policy.safetensors")).unwrap();
    let header_len = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&bytes[8..8 + header_len]).unwrap();
    let entries = header["__metadata__"].as_object().unwrap();
    assert_eq!(entries.len(), 1);
    let text = entries["canter"].as_str().unwrap();
    let metadata: Value = serde_json::from_str(text).unwrap();
    // A `Value` sorts its keys.
    assert_eq!(metadata.to_string(), text);
    let mut keys = Vec::new();
    collect_keys(&metadata, &mut keys);
    for suspicious in ["time", "date", "path", "thread", "host", "user"] {
        assert!(keys.iter().all(|key| !key.contains(suspicious)), "{keys:?}");
    }
    assert!(!text.contains(folder.path().to_str().unwrap()), "{text}");
    assert!(!text.contains("/"), "{text}");
    let mut names: Vec<_> = header.as_object().unwrap().keys().map(String::as_str).collect();
    names.retain(|name| ARRAYS.contains(name));
    assert_eq!(names, ARRAYS);
}

fn collect_keys(value: &Value, keys: &mut Vec<String>) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                keys.push(key.clone());
                collect_keys(value, keys);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| collect_keys(value, keys)),
        _ => {}
    }
}

#[test]
fn doctored_metadata_gives_the_right_error() {
    let trainer = common::trained(&[], 1);
    let bytes = PolicyFile::of(&trainer).to_bytes();
    let task = &trainer.resolved().task;
    let read = |change: &dyn Fn(&mut Value)| PolicyFile::from_bytes(&with_metadata(&bytes, change));
    let error = read(&|metadata| metadata["format_version"] = json!(1)).unwrap_err();
    assert!(matches!(error, PolicyError::Version { found: 1 }), "{error}");
    assert_eq!(error.to_string(), "it has format version 1, this canter reads version 3");
    let error = read(&|metadata| metadata["format_version"] = json!("one")).unwrap_err();
    assert!(matches!(error, PolicyError::Version { found: 0 }), "{error}");
    let error = read(&|metadata| metadata["gait"]["legs"] = json!("four")).unwrap_err();
    assert!(matches!(error, PolicyError::Metadata(_)), "{error}");
    let error = read(&|metadata| {
        metadata.as_object_mut().unwrap().remove("robot");
    })
    .unwrap_err();
    assert_eq!(error.to_string(), "its metadata cannot be read: missing field `robot`");

    let check = |change: &dyn Fn(&mut Value)| {
        let error = read(change).unwrap().check(task).unwrap_err();
        assert!(matches!(error, PolicyError::Mismatch { .. }), "{error}");
        error.to_string()
    };
    let message = check(&|metadata| metadata["robot"]["name"] = json!("minitaur"));
    assert_eq!(message, "it was trained for the robot \"minitaur\", not for \"doggo\"");
    let message = check(&|metadata| metadata["robot"]["fingerprint"] = json!("00"));
    assert!(message.starts_with("it was trained for another version of the robot's files"), "{message}");
    let message = check(&|metadata| metadata["robot"]["legs"][2]["upper_link_m"] = json!(0.1));
    assert!(message.starts_with("it was trained for another version of the robot's files"), "{message}");
    let message = check(&|metadata| {
        metadata["gait"]["name"] = json!("gallop");
        metadata["gait"]["legs"][1]["phase_offset"] = json!(0.1);
    });
    assert_eq!(message, "it was trained for the gait \"gallop\", not for \"sine\"");
    let message = check(&|metadata| metadata["gait"]["stride_frequency_hz"] = json!(3.0));
    assert!(message.starts_with("it was trained for another version of the gait \"sine\", not"), "{message}");
    let message = check(&|metadata| metadata["gait"]["legs"][0]["phase_offset"] = json!(0.25));
    assert!(message.starts_with("it was trained for another version of the gait \"sine\", not"), "{message}");
    let message = check(&|metadata| metadata["action"]["authority"] = json!(0.5));
    assert!(message.starts_with("it was trained for the action law "), "{message}");
    let message = check(&|metadata| metadata["observation"] = json!(["phase"]));
    assert!(message.starts_with("it was trained for the observation [\"phase\"], not for [\"motor_angles\", "));
}

#[test]
fn a_policy_of_numbers_that_cannot_be_is_refused() {
    let bytes = policy_bytes();
    let refusal = |change: &dyn Fn(&mut Value)| PolicyFile::from_bytes(&with_metadata(&bytes, change)).unwrap_err();
    // Too large for single precision: it would be infinite, and null when it is written again.
    let error = refusal(&|metadata| metadata["gait"]["legs"][0]["phase_offset"] = json!(1e39));
    assert!(matches!(error, PolicyError::Number), "{error}");
    // Version 2, but for what 32 bits hold of it.
    let error = refusal(&|metadata| metadata["format_version"] = json!((1_u64 << 32) + 2));
    assert_eq!(error.to_string(), "it has format version 4294967298, this canter reads version 3");
    // Sizes whose product has more than 64 bits.
    for (shape, found) in [([0, 1 << 40], "[0, 1099511627776]"), ([1 << 62, 0], "[4611686018427387904, 0]")] {
        let file = TensorFile::from_bytes(&bytes).unwrap();
        let mut changed = file.clone();
        changed.push::<f32>("actor.0.weight", &shape, &[]);
        let error = PolicyFile::from_bytes(&changed.to_bytes()).unwrap_err().to_string();
        assert_eq!(error, format!("the array `actor.0.weight` is {found}, expected two sizes from 1 to 65536"));
    }
}

#[test]
fn a_checkpoint_that_counts_more_than_can_be_is_refused() {
    let bytes = Checkpoint::of(&common::trained(&[], 1)).to_bytes();
    let file = TensorFile::from_bytes(&bytes).unwrap();
    for key in ["iterations", "env_steps", "episodes", "gradient_steps", "observations"] {
        let mut metadata: Value = serde_json::from_str(file.metadata()).unwrap();
        metadata[key] = json!(u64::MAX);
        let mut changed = TensorFile::new(metadata.to_string());
        for name in ["parameters", "adam.first_moment", "adam.second_moment"] {
            let shape = file.shape(name).unwrap().to_vec();
            changed.push(name, &shape, &file.get::<f32>(name, &shape).unwrap());
        }
        let error = Checkpoint::from_bytes(&changed.to_bytes()).unwrap_err();
        assert_eq!(error.to_string(), "it counts more than any training comes to", "{key}");
    }
    // Each environment's own counts: the next episode, and the env steps of the present one.
    for (name, place) in [("environments.state", 0), ("environments.episode", 1)] {
        for wrong in [1e300, -1.0, 0.5] {
            let shape = file.shape(name).unwrap().to_vec();
            let mut values = file.get::<f64>(name, &shape).unwrap();
            values[shape[1] + place] = wrong;
            let mut changed = file.clone();
            changed.push(name, &shape, &values);
            let checkpoint = Checkpoint::from_bytes(&changed.to_bytes()).unwrap();
            let error = checkpoint.restore(&mut Trainer::new(common::tiny(&[]))).unwrap_err().to_string();
            assert_eq!(error, "it counts episodes or env steps that no environment comes to", "{name}: {wrong}");
        }
    }
}

#[test]
fn sizes_that_memory_cannot_hold_are_refused() {
    let refusal = |changes: &[(&str, &str)]| {
        let mut document = open_preset("doggo").unwrap();
        changes.iter().for_each(|(key, value)| document.set(key, value));
        resolve(&document).map(drop).map_err(|error| error.to_string())
    };
    let rollout = [("training.num_environments", "4096"), ("training.horizon", "100000")];
    let message = refusal(&rollout).unwrap_err();
    assert!(message.ends_with("num_environments times horizon may be 4194304 at most: one rollout"), "{message}");
    refusal(&[("training.num_environments", "4096"), ("training.horizon", "1024")]).unwrap();
    let episode = [("evaluation.episode_s", "1000.0"), ("task.control_dt_s", "0.001"), ("task.physics_dt_s", "0.001")];
    let fine = [("evaluation.physics_dt_s", "0.001")];
    let message = refusal(&[&episode[..], &fine].concat()).unwrap_err();
    assert!(message.ends_with("such an episode has 1000000 env steps; at most 100000 can be recorded"), "{message}");
    refusal(&[("evaluation.episode_s", "1000.0")]).unwrap();
}

#[test]
fn a_run_goes_on_although_its_metrics_are_damaged() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, Some(3));
    let path = run.join("metrics.jsonl");
    let mut metrics = fs::read(&path).unwrap();
    // A byte of the second line that belongs to no character.
    let second = metrics.iter().position(|&byte| byte == b'\n').unwrap() + 10;
    metrics[second] = 0xff;
    fs::write(&path, metrics).unwrap();
    assert_eq!(common::resume_in(&run, 2, None), Ending::Finished);
    let iterations: Vec<_> = common::metrics_without_times(&run).iter().map(|line| line["iteration"].clone()).collect();
    assert_eq!(iterations, [1, 3, 4, 5]);
}

#[test]
fn a_policy_is_refused_by_a_task_that_differs_in_what_matters_and_only_there() {
    const LOPSIDED: (&str, &str) = ("policy.symmetric", "false");
    let policy = PolicyFile::of(&common::trained(&[LOPSIDED], 1));
    let refusal = |changes: &[(&str, &str)]| {
        policy.check(&common::tiny(&[&[LOPSIDED], changes].concat()).task).map_err(|e| e.to_string())
    };
    refusal(&[("task.slope_deg", "5.0"), ("reward.energy", "0.5"), ("training.horizon", "64")]).unwrap();
    for (key, value, what) in [
        ("policy.prior", "stepping", "the gait"),
        ("policy.modulation", "amplitude", "the action law"),
        ("policy.authority", "0.5", "the action law"),
        ("policy.ranges.swing_offset_rad", "[-0.1, 0.1]", "the action law"),
        ("policy.observation", "[\"motor_angles\"]", "the observation"),
        ("policy.symmetric", "true", "policy.symmetric = false, not for true"),
        ("task.control_dt_s", "0.02", "a time between commands"),
    ] {
        // `control_dt_s` belongs to the robot as the controller sees it.
        let message = refusal(&[(key, value)]).unwrap_err();
        assert!(message.starts_with(&format!("it was trained for {what}")), "{key}: {message}");
    }
}

#[test]
fn a_network_that_does_not_reproduce_its_test_vector_is_refused() {
    let bytes = policy_bytes();
    for damaged in ARRAYS {
        let bytes = rewritten(
            &bytes,
            |_| {},
            |name, values| {
                if name == damaged {
                    values[0] += 0.01;
                }
            },
        );
        // The arrays are whole and fit each other: only the test vector can tell.
        let error = PolicyFile::from_bytes(&bytes).unwrap_err();
        assert!(matches!(error, PolicyError::TestVector), "{damaged}: {error}");
    }
}

/// Name, shape and values.
type NamedArray = (&'static str, Vec<usize>, Vec<f32>);

#[test]
fn arrays_that_are_missing_or_do_not_fit_are_named() {
    let bytes = policy_bytes();
    let file = TensorFile::from_bytes(&bytes).unwrap();
    let rebuilt = |change: &dyn Fn(&mut Vec<NamedArray>)| {
        let array = |&name: &&'static str| {
            let shape = file.shape(name).unwrap().to_vec();
            let values = file.get::<f32>(name, &shape).unwrap();
            (name, shape, values)
        };
        let mut arrays: Vec<NamedArray> = ARRAYS.iter().map(array).collect();
        change(&mut arrays);
        let mut rebuilt = TensorFile::new(file.metadata().to_owned());
        for (name, shape, values) in arrays {
            rebuilt.push(name, &shape, &values);
        }
        PolicyFile::from_bytes(&rebuilt.to_bytes()).unwrap_err()
    };
    for missing in ARRAYS {
        let error = rebuilt(&|arrays| arrays.retain(|(name, ..)| *name != missing));
        assert_eq!(error.to_string(), format!("the array `{missing}` is missing"));
    }
    let place = |wanted: &str| ARRAYS.iter().position(|name| *name == wanted).unwrap();
    let error = rebuilt(&|arrays| arrays[place("actor.1.weight")].1 = vec![16 * 16]);
    assert_eq!(error.to_string(), "the array `actor.1.weight` is F32[256], expected F32[16, 16]");
    let error = rebuilt(&|arrays| arrays[place("normaliser.mean")].2[3] = f32::INFINITY);
    assert!(matches!(&error, PolicyError::Tensors(TensorError::NotFinite(name)) if name == "normaliser.mean"));
}

#[test]
fn a_damaged_newest_checkpoint_is_skipped_and_named() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, None);
    let checkpoints = run.join("checkpoints");
    let names = common::names(&checkpoints);
    assert_eq!(names, ["00000002.safetensors", "00000004.safetensors", "00000005.safetensors"]);
    let newest = checkpoints.join(&names[2]);
    let whole = fs::read(&newest).unwrap();

    let directory = RunDirectory::open(&run).unwrap();
    assert_eq!(directory.newest_checkpoint().unwrap().0.iterations(), 5);
    let mut flipped = whole.clone();
    // A bit in the middle of the parameters.
    flipped[whole.len() / 2] ^= 1;
    for damaged in [&whole[..whole.len() / 2], b"", &flipped] {
        fs::write(&newest, damaged).unwrap();
        let (checkpoint, skipped) = directory.newest_checkpoint().unwrap();
        assert_eq!(checkpoint.iterations(), 4);
        let [reason] = &skipped[..] else { panic!("{skipped:?}") };
        assert!(reason.starts_with(&format!("{}: ", newest.display())), "{reason}");
    }
    for name in &names[..2] {
        fs::write(checkpoints.join(name), b"nothing").unwrap();
    }
    let message = directory.newest_checkpoint().unwrap_err().to_string();
    assert!(message.starts_with(&format!("{}: no checkpoint to go on from: ", checkpoints.display())), "{message}");
    assert!(names.iter().all(|name| message.contains(name)), "{message}");
    fs::remove_dir_all(&checkpoints).unwrap();
    let message = directory.newest_checkpoint().unwrap_err().to_string();
    assert_eq!(message, format!("{}: no checkpoint to go on from: there is none", checkpoints.display()));
}

#[test]
fn a_run_goes_on_from_the_older_checkpoint_with_the_same_bytes() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, None);
    let policy = fs::read(run.join("policy.safetensors")).unwrap();
    let metrics = common::metrics_without_times(&run);
    fs::remove_file(run.join("policy.safetensors")).unwrap();
    fs::write(run.join("checkpoints/00000005.safetensors"), b"cut").unwrap();
    let directory = RunDirectory::open(&run).unwrap();
    let (checkpoint, skipped) = directory.newest_checkpoint().unwrap();
    assert_eq!((checkpoint.iterations(), skipped.len()), (4, 1));
    drop(directory);
    fs::remove_file(run.join("checkpoints/00000005.safetensors")).unwrap();
    common::resume_in(&run, 2, None);
    assert!(fs::read(run.join("policy.safetensors")).unwrap() == policy);
    assert_eq!(common::metrics_without_times(&run), metrics);
}

#[test]
fn a_checkpoint_of_other_robot_files_is_refused() {
    let trainer = common::trained(&[], 1);
    let bytes = Checkpoint::of(&trainer).to_bytes();
    let own = format!("{:016x}", trainer.resolved().task.robot.fingerprint);
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains(&own));
    let mut resolved = common::tiny(&[]);
    let mut task = canter_sim::Task::clone(&resolved.task);
    let mut robot = canter_sim::Robot::clone(&task.robot);
    robot.fingerprint ^= 1;
    task.robot = robot.into();
    resolved.task = task.into();
    let checkpoint = Checkpoint::from_bytes(&bytes).unwrap();
    let message = checkpoint.restore(&mut Trainer::new(resolved)).unwrap_err().to_string();
    assert_eq!(message, "the robot's files have changed since: put them back, or start a new training");
}

#[test]
fn a_run_has_one_writer() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    let config = common::tiny(&[]).config;
    let writer = RunDirectory::create(Some(&run), "tiny", &config).unwrap();
    assert!(matches!(RunDirectory::open(&run), Err(RunError::Locked(path)) if path == run));
    // Readers are welcome.
    assert_eq!(read_config(&run).unwrap().config, config);
    drop(writer);
    RunDirectory::open(&run).unwrap();
}

#[test]
fn a_new_run_needs_an_empty_folder() {
    let folder = TemporaryFolder::new();
    let config = common::tiny(&[]).config;
    let precious = folder.join("run/precious.txt");
    fs::create_dir_all(folder.join("run")).unwrap();
    fs::write(&precious, "mine").unwrap();
    let error = RunDirectory::create(Some(&folder.join("run")), "tiny", &config).unwrap_err();
    assert!(matches!(error, RunError::NotEmpty(_)), "{error}");
    assert_eq!(common::names(&folder.join("run")), ["precious.txt"]);
    assert_eq!(fs::read_to_string(&precious).unwrap(), "mine");
    // An empty folder, and one that is not there yet with its parents, are fine.
    fs::create_dir(folder.join("empty")).unwrap();
    RunDirectory::create(Some(&folder.join("empty")), "tiny", &config).unwrap();
    RunDirectory::create(Some(&folder.join("a/b/c")), "tiny", &config).unwrap();
    assert_eq!(read_config(&folder.join("a/b/c")).unwrap().config, config);
    // A file is in the way.
    let error = RunDirectory::create(Some(&precious), "tiny", &config).unwrap_err();
    assert!(matches!(error, RunError::Io { .. }), "{error}");
}

#[test]
fn left_over_temporary_files_are_cleaned_and_nothing_else() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, Some(2));
    let before = (common::names(&run), common::names(&run.join("checkpoints")));
    assert_eq!(before.0, ["checkpoints", "config.toml", "events.out.tfevents.canter", "lock", "metrics.jsonl"]);
    for name in ["policy.safetensors.tmp", "eval.json.tmp", "checkpoints/00000003.safetensors.tmp"] {
        fs::write(run.join(name), b"half").unwrap();
    }
    fs::write(run.join("notes.txt"), b"of the user").unwrap();
    drop(RunDirectory::open(&run).unwrap());
    assert_eq!(
        common::names(&run),
        ["checkpoints", "config.toml", "events.out.tfevents.canter", "lock", "metrics.jsonl", "notes.txt"]
    );
    assert_eq!(common::names(&run.join("checkpoints")), before.1);
}

#[test]
fn the_oldest_checkpoints_are_removed() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[("training.checkpoint_env_steps", "1")], 2, None);
    let expected = ["00000003.safetensors", "00000004.safetensors", "00000005.safetensors"];
    assert_eq!(common::names(&run.join("checkpoints")), expected);
}

#[test]
fn what_is_no_run_is_named() {
    let folder = TemporaryFolder::new();
    let refusal = |path: &Path| RunDirectory::open(path).unwrap_err().to_string();
    let nowhere = folder.join("nowhere");
    assert_eq!(refusal(&nowhere), format!("{}: no run directory: it has no config.toml", nowhere.display()));
    assert_eq!(refusal(folder.path()), format!("{}: no run directory: it has no config.toml", folder.path().display()));
    assert_eq!(common::names(folder.path()), Vec::<String>::new());
    let run = folder.join("run");
    common::run_in(&run, &[], 2, Some(1));
    let message = read_policy(&run).unwrap_err().to_string();
    assert!(message.contains(": no policy yet, the training has not ended"), "{message}");
    fs::write(run.join("policy.safetensors"), b"damaged").unwrap();
    let message = read_policy(&run).unwrap_err().to_string();
    let start = format!("{}: this policy cannot be used: ", run.join("policy.safetensors").display());
    assert!(message.starts_with(&start), "{message}");
}
