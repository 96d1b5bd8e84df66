//! `canter export`: what is written, and what is refused.

mod common;

use std::fs;
use std::path::Path;

use canter_train::policy_file::PolicyFile;
use canter_train::tensors::TensorFile;
use common::{TINY, TemporaryFolder};

/// A run in `run` whose policy is near the gait that it was learned from.
fn run_in(folder: &TemporaryFolder) {
    let mut train = vec!["train", "--out", "run"];
    train.extend(TINY);
    train.extend(["--set", "policy.authority=0.1", "--set", "evaluation.episode_s=4.0"]);
    folder.canter(&train).succeeded();
}

/// Gives a policy another last layer's biases, and vectors that prove it.
fn doctor(path: &Path, biases: &[f32]) {
    let file = TensorFile::from_bytes(&fs::read(path).unwrap()).unwrap();
    let mut doctored = file.clone();
    let shape = file.shape("actor.2.bias").unwrap().to_vec();
    doctored.push("actor.2.bias", &shape, biases);
    // A file whose vectors are of other actions is refused as damaged.
    let parameters: Vec<f32> = (0..3)
        .flat_map(|layer| ["weight", "bias"].map(|part| format!("actor.{layer}.{part}")))
        .flat_map(|name| doctored.get::<f32>(&name, doctored.shape(&name).unwrap()).unwrap())
        .collect();
    let whole = |name: &str| doctored.get::<f32>(name, doctored.shape(name).unwrap()).unwrap();
    let before = PolicyFile::from_bytes(&fs::read(path).unwrap()).unwrap();
    let (mean, inverse_std, observations) =
        (whole("normaliser.mean"), whole("normaliser.inverse_std"), whole("test.observation"));
    let mut policy = before.policy();
    policy.normaliser = canter_gait::Normaliser { mean: &mean, inverse_std: &inverse_std };
    policy.network = canter_gait::Network::new(policy.network.shape(), &parameters).unwrap();
    let mut actions = vec![0.0; doctored.shape("test.action").unwrap().iter().product()];
    let mut hidden = vec![0.0; policy.network.workspace_len()];
    for (action, observation) in
        actions.chunks_exact_mut(policy.network.shape().output).zip(observations.chunks_exact(mean.len()))
    {
        policy.act(&mut observation.to_vec(), &mut hidden, action);
    }
    let shape = doctored.shape("test.action").unwrap().to_vec();
    doctored.push("test.action", &shape, &actions);
    let bytes = doctored.to_bytes();
    PolicyFile::from_bytes(&bytes).unwrap();
    fs::write(path, bytes).unwrap();
}

#[test]
fn every_format_is_written_with_its_certificate() {
    let folder = TemporaryFolder::new();
    run_in(&folder);
    let formats = [
        ("c", &["canter_policy.h", "canter_policy.c", "canter_sketch.ino"][..]),
        ("onnx", &["policy.onnx", "start.onnx", "run_policy.py"]),
        ("rust", &["Cargo.toml", "src/lib.rs", "src/data.rs", "gait/src/controller.rs"]),
        ("table", &["gait.csv", "spread.csv", "gait.toml"]),
        ("gait", &["gait.toml", "firmware.txt", "firmware-certificate.json"]),
    ];
    for (format, files) in formats {
        let out = format!("out-{format}");
        let finished = folder.canter(&["export", "run", "--format", format, "--out", &out, "--allow-unsafe"]);
        assert_eq!(finished.code, Some(0), "{finished:?}");
        for file in files.iter().chain(&["certificate.json", "certificate.txt"]) {
            assert!(folder.join(&out).join(file).is_file(), "{format}: {file}: {finished:?}");
        }
        let certificate = fs::read_to_string(folder.join(&out).join("certificate.json")).unwrap();
        let certificate: serde_json::Value = serde_json::from_str(&certificate).unwrap();
        assert_eq!(certificate["format"], format);
        assert!(certificate["exported"]["speed_m_per_s"].as_f64().unwrap() > 0.1, "{certificate}");
    }
    // What was measured stands beside the policy in the report.
    let table = fs::read_to_string(folder.join("run/tables/gaits.csv")).unwrap();
    for label in ["exported table", "exported gait", "exported firmware"] {
        assert!(table.contains(label), "{table}");
    }
    let commands = fs::read_to_string(folder.join("out-gait/firmware.txt")).unwrap();
    let letters: Vec<&str> = commands.lines().map(|line| &line[..1]).collect();
    assert_eq!(letters, ["S", "f", "l", "h", "u", "d", "p", "s", "T", "g"]);

    // The table is a gait of the robot's: canter reads back what it wrote.
    let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/doggo");
    let settings = fs::read_to_string(robot.join("robot.toml")).unwrap();
    let own = folder.join("out-table");
    fs::copy(robot.join("doggo.xml"), own.join("doggo.xml")).unwrap();
    let gait = fs::read_to_string(own.join("gait.toml")).unwrap();
    fs::write(own.join("robot.toml"), format!("{settings}\n{gait}")).unwrap();
    let args = ["eval", "--robot", "out-table/robot.toml", "--prior", "exported", "--episodes", "2"];
    assert!(folder.canter(&args).succeeded().contains("exported"));
}

#[test]
fn a_policy_that_breaks_a_limit_is_refused_by_its_name() {
    let folder = TemporaryFolder::new();
    run_in(&folder);
    // The run's own number stays what it was: what differs is the policy.
    let path = folder.join("run/policy.safetensors");
    let config = folder.join("run/config.toml");
    let text = fs::read_to_string(&config).unwrap();
    fs::write(&config, text.replace("authority = 0.1", "authority = 1.0")).unwrap();
    let bytes = fs::read(&path).unwrap();
    let file = TensorFile::from_bytes(&bytes).unwrap();
    let card = file.metadata().replace("\"authority\":0.1", "\"authority\":1.0");
    assert_ne!(card, file.metadata());
    let mut free = TensorFile::new(card);
    for name in file.names() {
        let shape = file.shape(name).unwrap();
        free.push(name, shape, &file.get::<f32>(name, shape).unwrap());
    }
    fs::write(&path, free.to_bytes()).unwrap();
    // Slow, without swing, with the greatest extension about the longest leg: half as long again as a leg can be.
    let leg = [-9.0, 9.0, 0.0, 9.0];
    doctor(&path, &[&[-9.0][..], &leg, &leg, &leg, &leg].concat());
    let message = folder.canter(&["export", "run", "--format", "c"]).failed_with(1);
    assert!(message.contains("time at a leg-space limit"), "{message}");
    assert!(message.contains("falls"), "{message}");
    assert!(!folder.join("run/export").exists() && !message.contains("earlier export"), "{message}");
    let finished = folder.canter(&["export", "run", "--format", "c", "--allow-unsafe"]);
    assert_eq!(finished.code, Some(0));
    assert!(finished.stderr.contains("not safe"), "{}", finished.stderr);
    assert!(folder.join("run/export/c/canter_policy.c").is_file());
    // The certificate of another export must not be taken for this one's.
    let message = folder.canter(&["export", "run", "--format", "c"]).failed_with(1);
    assert!(message.contains("what lies in run/export/c is an earlier export"), "{message}");
    // What was measured before is not thrown away because it cannot be read.
    fs::write(folder.join("run/export.json"), "{").unwrap();
    let message = folder.canter(&["export", "run", "--format", "c", "--allow-unsafe"]).failed_with(1);
    assert!(message.contains("run/export.json is no list of measured exports"), "{message}");
    assert_eq!(fs::read_to_string(folder.join("run/export.json")).unwrap(), "{");
}

#[test]
fn the_commands_of_an_earlier_gait_do_not_stay() {
    let folder = TemporaryFolder::new();
    let mut train = vec!["train", "q8bot", "--out", "run"];
    train.extend(TINY);
    train.extend(["--set", "policy.authority=0.1", "--set", "evaluation.episode_s=4.0"]);
    folder.canter(&train).succeeded();
    let commands = ["firmware.txt", "firmware-certificate.json", "firmware-certificate.txt"];
    fs::create_dir(folder.join("out")).unwrap();
    for name in commands {
        fs::write(folder.join("out").join(name), "earlier").unwrap();
    }
    let finished = folder.canter(&["export", "run", "--format", "gait", "--out", "out", "--allow-unsafe"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    assert!(folder.join("out/gait.toml").is_file());
    // No firmware of q8bot's is known.
    for name in commands {
        assert!(!folder.join("out").join(name).exists(), "{name}");
    }
}
