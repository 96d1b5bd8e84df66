//! No file can hurt: each of our parsers gets damaged files, see `common/fuzz.rs`.
//!
//! Policies and checkpoints have a checksum, behind which no blind damage gets. Their content is damaged too, and written
//! again with a checksum that fits.

mod common;
#[path = "common/fuzz.rs"]
mod fuzz;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canter_gait::{Network, NetworkShape, Normaliser, Policy};
use canter_sim::robot::RobotSettings;
use canter_sim::settings::{Document, Problems, Setting, write_commented, write_plain};
use canter_sim::{Env, Robot, Task};
use canter_train::blow_up::BlowUp;
use canter_train::checkpoint::Checkpoint;
use canter_train::compare::measured::{Measured, RunReport, SweepPoint};
use canter_train::compare::protocol::{CompareSettings, Quantity, Rung, Sweep};
use canter_train::compare::results::Comparison;
use canter_train::config::{RunConfig, open_preset, resolve};
use canter_train::policy_file::PolicyFile;
use canter_train::run_directory::RunDirectory;
use canter_train::search::cma_es::StrategyParameters;
use canter_train::search::tuned::{Objective, Search, SearchState};
use canter_train::tensors::TensorFile;
use canter_train::trainer::Trainer;
use common::{TemporaryFolder, workers};
use fuzz::{JSON, NUMBERS, Random, TENSORS, TOML, damage, fuzz as fuzz_with, fuzz_bytes};
use safetensors::{Dtype, SafeTensors};
use serde_json::Value;

/// A file of the repository.
fn repository_file(path: &str) -> Vec<u8> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    fs::read(root.join(path)).unwrap()
}

/// A folder in memory where there is one, so that flushing a file costs nothing.
fn fast_folder(name: &str) -> PathBuf {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = parent.join(format!("canter-fuzz-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Settings that were accepted can be written and read again.
fn assert_written_again<T: Setting + PartialEq + std::fmt::Debug>(settings: &T, random: &mut Random) {
    let text = if random.once_in(2) { write_commented(settings) } else { write_plain(settings) };
    let document = Document::parse("again", text.as_bytes()).unwrap_or_else(|problems| panic!("{problems}\n{text}"));
    assert_eq!(&document.read::<T>().unwrap_or_else(|problems| panic!("{problems}\n{text}")), settings);
}

/// What a configuration that was accepted makes of memory.
fn assert_bounded(config: &RunConfig, task: &Task) {
    let samples = config.training.num_environments * config.training.horizon;
    let numbers = samples * (2 * task.num_observations() + task.num_actions() + 10);
    assert!(numbers * size_of::<f32>() < 4 << 30, "a rollout of {numbers} numbers");
    assert!(config.ppo.minibatch_size <= samples);
    assert!((1..=100).contains(&task.num_observations()) && (1..=100).contains(&task.num_actions()));
    assert!(config.evaluation.episode_s / config.task.control_dt_s < 100_001.0);
    assert!(task.num_substeps >= 1 && task.max_env_steps >= 1);
}

/// What is wrong first, without what the file says itself.
fn reason(problems: &Problems) -> String {
    problems.iter().next().map_or(String::new(), |problem| format!("{}: {}", problem.kind, problem.message))
}

fn read_config(document: &Document, random: &mut Random) -> Result<(), String> {
    let config: RunConfig = document.read().map_err(|problems| reason(&problems))?;
    assert_written_again(&config, random);
    // A robot takes longer to load than a hundred files to read.
    if random.once_in(100) {
        let resolved = resolve(document).map_err(|error| error.to_string())?;
        assert_bounded(&resolved.config, &resolved.task);
    }
    Ok(())
}

#[test]
fn configurations() {
    let presets = ["doggo", "paper"].map(|name| repository_file(&format!("presets/{name}.toml")));
    let plain = write_plain(&common::tiny(&[]).config).into_bytes();
    let valid = [&presets[..], &[plain]].concat();
    fuzz_bytes("configuration", &valid, &TOML, |bytes, random| {
        read_config(&Document::parse("fuzz.toml", bytes).map_err(|problems| reason(&problems))?, random)
    });
}

#[test]
fn overrides() {
    let preset = open_preset("doggo").unwrap();
    let valid = [
        &b"ppo.gamma=0.98\ntraining.horizon=64"[..],
        b"policy.prior=stepping\npolicy.observation=[\"phase\", \"orientation\"]\nseed=7",
        b"task.variation.slope_deg=[0.0, 10.0]\ntask.friction=0.8",
        b"policy.ranges.frequency_factor[1]=1.5\nrobot=doggo",
    ]
    .map(<[u8]>::to_vec);
    fuzz_bytes("overrides", &valid, &TOML, |bytes, random| {
        let mut document = preset.clone();
        for line in String::from_utf8_lossy(bytes).split('\n').take(100) {
            let (key, value) = line.split_once('=').unwrap_or((line, ""));
            if random.once_in(10) { document.set_string(key, value) } else { document.set(key, value) }
        }
        read_config(&document, random)
    });
}

#[test]
fn robots() {
    let folder = fast_folder("robot");
    fs::write(folder.join("doggo.xml"), repository_file("robots/doggo/doggo.xml")).unwrap();
    let path = folder.join("robot.toml");
    let own = repository_file("robots/doggo/robot.toml");
    let settings: RobotSettings = Document::parse("doggo", &own).unwrap().read().unwrap();
    let valid = [own, write_plain(&settings).into_bytes()];
    let config = common::tiny(&[]).config;
    fuzz_bytes("robot", &valid, &TOML, |bytes, random| {
        let document = Document::parse("fuzz.toml", bytes).map_err(|problems| reason(&problems))?;
        let settings: RobotSettings = document.read().map_err(|problems| reason(&problems))?;
        assert_written_again(&settings, random);
        if random.once_in(100) {
            fs::write(&path, bytes).unwrap();
            let robot = Robot::load(path.to_str().unwrap()).map_err(|error| error.to_string())?;
            let mut policy = config.policy.clone();
            policy.symmetric = false;
            policy.prior = robot.gaits.first().map_or(String::new(), |gait| gait.name.clone());
            let task = Task::new(Arc::new(robot), &config.task, &config.reward, &policy, document.problems())
                .map_err(|problems| reason(&problems))?;
            walk(&Arc::new(task), random);
        }
        Ok(())
    });
    fs::remove_dir_all(folder).unwrap();
}

/// A robot that was accepted walks a few steps, whatever becomes of it, and shows nothing but numbers.
fn walk(task: &Arc<Task>, random: &mut Random) {
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut || random.below(1 << 20) as f64 / f64::from(1 << 20), &mut observation);
    for _ in 0..3 {
        assert!(observation.iter().all(|value| value.is_finite()), "{observation:?}");
        let outcome = env.step_prior(&mut observation);
        assert!(outcome.reward.is_finite(), "{outcome:?}");
    }
}

/// A policy that was accepted acts, and reads back equal.
fn use_policy(bytes: &[u8], task: &Task, random: &mut Random) -> Result<(), String> {
    let file = PolicyFile::from_bytes(bytes).map_err(|error| error.to_string())?;
    let policy = file.policy();
    let shape = policy.network.shape();
    let mut observation: Vec<f32> = (0..shape.input).map(|_| random.below(200) as f32 / 10.0 - 10.0).collect();
    let (mut hidden, mut action) = (vec![0.0; policy.network.workspace_len()], vec![f32::NAN; shape.output]);
    policy.act(&mut observation, &mut hidden, &mut action);
    assert!(action.iter().all(|component| (-1.0..=1.0).contains(component)), "{action:?}");
    let again = PolicyFile::from_bytes(&file.to_bytes()).expect("what was accepted can be written and read again");
    assert_eq!(again, file);
    let _ = file.check(task);
    Ok(())
}

/// What makes policies and checkpoints small: networks and observations.
const SMALL: [(&str, &str); 7] = [
    ("network.actor_hidden", "2"),
    ("network.critic_hidden", "2"),
    ("policy.observation", "[\"motor_angles\", \"phase\"]"),
    ("policy.modulation", "amplitude"),
    ("training.num_environments", "1"),
    ("training.horizon", "8"),
    ("ppo.minibatch_size", "8"),
];

#[test]
fn policies() {
    let trainer = common::trained(&SMALL, 1);
    let valid = [PolicyFile::of(&trainer).to_bytes()];
    let tokens = [&JSON[..], &TENSORS].concat();
    let task = trainer.resolved().task.clone();
    fuzz_bytes("policy", &valid, &tokens, |bytes, random| use_policy(bytes, &task, random));
}

#[test]
fn contents_of_policies() {
    let trainer = common::trained(&SMALL, 1);
    let lopsided = common::trained(&[&SMALL[..], &[("policy.symmetric", "false")]].concat(), 1);
    let valid = [&trainer, &lopsided].map(|trainer| PolicyFile::of(trainer).to_bytes());
    let task = trainer.resolved().task.clone();
    let make = |random: &mut Random, base: &[u8], _: &[u8]| {
        let mut content = Content::of(base);
        content.damage(random);
        // Without this no change of the network would get past the proof.
        if random.once_in(2) {
            content.prove_anew();
        }
        content.to_bytes()
    };
    fuzz_with("policy's content", &valid, make, |bytes, random| use_policy(bytes, &task, random));
}

/// A checkpoint that was accepted restores, is the same when it is saved again, and a training goes on from it or says why not.
fn use_checkpoint(bytes: &[u8], trainer: &mut Trainer, random: &mut Random) -> Result<(), String> {
    let checkpoint = Checkpoint::from_bytes(bytes).map_err(|error| error.to_string())?;
    checkpoint.restore(trainer).map_err(|error| error.to_string())?;
    let again = Checkpoint::from_bytes(&Checkpoint::of(trainer).to_bytes()).expect("what was restored can be saved");
    assert_eq!(again.iterations(), checkpoint.iterations());
    if random.once_in(50) {
        let _ = trainer.iterate(&workers(1));
        assert!(trainer.rollout().rewards.iter().all(|reward| reward.is_finite()), "{:?}", trainer.rollout().rewards);
    }
    Ok(())
}

#[test]
fn checkpoints() {
    let mut trainer = common::trained(&SMALL, 1);
    let valid = [Checkpoint::of(&trainer).to_bytes()];
    let tokens = [&JSON[..], &TENSORS].concat();
    fuzz_bytes("checkpoint", &valid, &tokens, |bytes, random| use_checkpoint(bytes, &mut trainer, random));
}

#[test]
fn contents_of_checkpoints() {
    let mut trainer = common::trained(&SMALL, 2);
    let valid = [Checkpoint::of(&trainer).to_bytes()];
    let make = |random: &mut Random, base: &[u8], _: &[u8]| {
        let mut content = Content::of(base);
        content.damage(random);
        content.to_bytes()
    };
    fuzz_with("checkpoint's content", &valid, make, |bytes, random| use_checkpoint(bytes, &mut trainer, random));
}

#[test]
fn contents_of_dumps() {
    let trainer = common::trained(&SMALL, 1);
    let task = &trainer.resolved().task;
    let checkpoint = TensorFile::from_bytes(&Checkpoint::of(&trainer).to_bytes()).unwrap();
    let shape = checkpoint.shape("environments.state").unwrap().to_vec();
    let states = checkpoint.get::<f64>("environments.state", &shape).unwrap();
    let metadata = serde_json::json!({
        "dump_version": 2,
        "environment": 0,
        "iteration": 1,
        "robot_fingerprint": format!("{:016x}", task.robot.fingerprint),
    });
    let mut dump = TensorFile::new(metadata.to_string());
    dump.push("state", &[shape[1] - 2], &states[2..shape[1]]);
    dump.push("actions", &[2 * task.num_actions()], &vec![0.5_f32; 2 * task.num_actions()]);
    let valid = [dump.to_bytes()];
    let read = |bytes: &[u8]| {
        let blow_up = BlowUp::from_bytes(bytes).map_err(|error| error.to_string())?;
        assert_eq!(BlowUp::from_bytes(&blow_up.to_bytes()).unwrap(), blow_up);
        blow_up.replay(task).map(drop).map_err(|error| error.to_string())
    };
    read(&valid[0]).unwrap();
    let make = |random: &mut Random, base: &[u8], _: &[u8]| {
        let mut content = Content::of(base);
        content.damage(random);
        content.to_bytes()
    };
    fuzz_with("dump's content", &valid, make, |bytes, _| read(bytes));
    fuzz_bytes("dump", &valid, &[&JSON[..], &TENSORS].concat(), |bytes, _| read(bytes));
}

/// What a file of tensors holds, in parts that can be changed each alone.
struct Content {
    metadata: String,
    arrays: Vec<(String, Vec<usize>, Numbers)>,
}

/// The numbers of an array.
enum Numbers {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

impl Content {
    fn of(bytes: &[u8]) -> Self {
        let file = TensorFile::from_bytes(bytes).unwrap();
        let tensors = SafeTensors::deserialize(bytes).unwrap();
        let mut arrays = Vec::new();
        for (name, view) in tensors.iter() {
            let shape = view.shape().to_vec();
            // `get` would refuse numbers that are not finite.
            let numbers = match view.dtype() {
                Dtype::F32 => Numbers::Single(
                    view.data().chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect(),
                ),
                Dtype::F64 => Numbers::Double(
                    view.data().chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect(),
                ),
                // The checksum, which is made anew.
                _ => continue,
            };
            arrays.push((name.to_owned(), shape, numbers));
        }
        // The container has them in random order.
        arrays.sort_by(|a, b| a.0.cmp(&b.0));
        Self { metadata: file.metadata().to_owned(), arrays }
    }

    fn damage(&mut self, random: &mut Random) {
        for _ in 0..=random.below(3) {
            if random.once_in(2) {
                self.damage_metadata(random);
            } else {
                self.damage_array(random);
            }
        }
    }

    fn damage_metadata(&mut self, random: &mut Random) {
        let mut bytes = std::mem::take(&mut self.metadata).into_bytes();
        damage(random, &mut bytes, b"{\"a\":[1,2]}", &JSON);
        self.metadata = String::from_utf8_lossy(&bytes).into_owned();
    }

    fn damage_array(&mut self, random: &mut Random) {
        let index = random.below(self.arrays.len());
        match random.below(8) {
            0 => {
                self.arrays.remove(index);
                if self.arrays.is_empty() {
                    self.arrays.push(("x".to_owned(), vec![0], Numbers::Single(Vec::new())));
                }
            }
            1 => {
                let names = ["actor.0.weight", "actor.2.bias", "parameters", "moments.mean", "", "\u{0}", "checksun"];
                self.arrays[index].0 = (*random.one_of(&names)).to_owned();
            }
            2 => self.reshape(index, random),
            _ => {
                let extreme: f64 = random.one_of(&NUMBERS).parse().unwrap_or(f64::NAN);
                match &mut self.arrays[index].2 {
                    Numbers::Single(values) => change(values, extreme as f32, random),
                    Numbers::Double(values) => change(values, extreme, random),
                }
            }
        }
    }

    /// Other sizes, with as many numbers as belong to them.
    fn reshape(&mut self, index: usize, random: &mut Random) {
        const SHAPES: [&[usize]; 10] = [
            &[],
            &[0],
            &[0, 0],
            &[0, 1 << 40],
            &[1 << 62, 0],
            &[1, 1],
            &[2, 0],
            &[1, 1, 1, 1, 1, 1, 1, 1, 1],
            &[70_000, 1],
            &[1, 300],
        ];
        let (_, shape, numbers) = &mut self.arrays[index];
        match random.below(3) {
            0 => shape.reverse(),
            1 => *shape = vec![shape.iter().product()],
            _ => *shape = random.one_of(&SHAPES).to_vec(),
        }
        let len = shape.iter().product();
        match numbers {
            Numbers::Single(values) => values.resize(len, 0.5),
            Numbers::Double(values) => values.resize(len, 0.5),
        }
    }

    /// The numbers of an array of single precision and two dimensions, or of one.
    fn single(&self, name: &str) -> Option<(&[usize], &[f32])> {
        let (_, shape, numbers) = self.arrays.iter().find(|(found, ..)| found == name)?;
        let Numbers::Single(values) = numbers else { return None };
        Some((shape, values))
    }

    /// Makes the test vector that of the network as it is now, where the arrays fit each other.
    fn prove_anew(&mut self) -> Option<()> {
        let [input, hidden] = *self.single("actor.0.weight")?.0 else { return None };
        let [_, output] = *self.single("actor.2.weight")?.0 else { return None };
        let shape = NetworkShape { input, hidden, output };
        if [input, hidden, output].iter().any(|size| !(1..=1000).contains(size)) {
            return None;
        }
        let mut parameters = Vec::new();
        for i in 0..3 {
            parameters.extend_from_slice(self.single(&format!("actor.{i}.weight"))?.1);
            parameters.extend_from_slice(self.single(&format!("actor.{i}.bias"))?.1);
        }
        let mean = self.single("normaliser.mean")?.1.to_vec();
        let inverse_std = self.single("normaliser.inverse_std")?.1.to_vec();
        if [mean.len(), inverse_std.len()] != [input; 2] {
            return None;
        }
        let policy = Policy {
            normaliser: Normaliser { mean: &mean, inverse_std: &inverse_std },
            network: Network::new(shape, &parameters)?,
            mirror: None,
        };
        let (mut observations, mut actions) = (Vec::new(), Vec::new());
        for k in 0..4 {
            let spread = |i: usize| ((7 * i + 3 * k) % 9) as f32 * 0.5 - 2.0;
            let raw: Vec<f32> =
                mean.iter().zip(&inverse_std).enumerate().map(|(i, (mean, scale))| mean + spread(i) / scale).collect();
            let mut action = vec![0.0; output];
            policy.act(&mut raw.clone(), &mut vec![0.0; policy.network.workspace_len()], &mut action);
            observations.extend(raw);
            actions.extend(action);
        }
        self.arrays.retain(|(name, ..)| !name.starts_with("test."));
        self.arrays.push(("test.observation".to_owned(), vec![4, mean.len()], Numbers::Single(observations)));
        self.arrays.push(("test.action".to_owned(), vec![4, output], Numbers::Single(actions)));
        // The mirror would ask for other actions in half of the cases.
        let mut metadata: Value = serde_json::from_str(&self.metadata).ok()?;
        *metadata.get_mut("mirror")? = Value::Null;
        self.metadata = metadata.to_string();
        Some(())
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut file = TensorFile::new(self.metadata.clone());
        for (name, shape, numbers) in &self.arrays {
            match numbers {
                Numbers::Single(values) => file.push(name, shape, values),
                Numbers::Double(values) => file.push(name, shape, values),
            }
        }
        file.to_bytes()
    }
}

/// Changes one number of an array, or all of them.
fn change<T: Copy>(values: &mut [T], to: T, random: &mut Random) {
    if random.once_in(4) {
        values.fill(to);
    } else if !values.is_empty() {
        values[random.below(values.len())] = to;
    }
}

/// Lines of a training, as long as a `metrics.jsonl` of three iterations.
fn metrics() -> Vec<u8> {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[&SMALL[..], &[("training.max_env_steps", "24")]].concat(), 1, None);
    fs::read(run.join("metrics.jsonl")).unwrap()
}

#[test]
fn metrics_and_events_of_a_run_that_goes_on() {
    let folder = fast_folder("run");
    let valid = [metrics()];
    let directory = RunDirectory::create(Some(&folder), "", &common::tiny(&[]).config).unwrap();
    let (metrics_path, events_path) = (folder.join("metrics.jsonl"), folder.join("events.out.tfevents.canter"));
    let line: Value = serde_json::from_slice(valid[0].split(|&byte| byte == b'\n').next().unwrap()).unwrap();
    let mut last = Vec::new();
    fuzz_bytes("metrics and events", &valid, &JSON, |bytes, random| {
        // The damage is in the event file in one of four cases.
        let (metrics, events) = if random.once_in(4) { (&valid[0][..], bytes) } else { (bytes, &last[..]) };
        fs::write(&metrics_path, metrics).unwrap();
        fs::write(&events_path, events).unwrap();
        let iterations = random.below(4) as u64;
        directory.truncate_metrics(iterations).map_err(|error| error.to_string())?;
        let kept = fs::read_to_string(&metrics_path).unwrap();
        for line in kept.lines() {
            let line: Value = serde_json::from_str(line).expect("only whole lines are kept");
            assert!(line["iteration"].as_u64().unwrap() <= iterations);
        }
        let mut events = directory.open_events().map_err(|error| error.to_string())?;
        let reopened = fs::read(&events_path).unwrap();
        events.append(&line).unwrap();
        drop(directory.open_events().unwrap());
        // What was appended without a line of its own is cut off again.
        last = fs::read(&events_path).unwrap();
        assert_eq!(last, reopened);
        Ok(())
    });
    drop(directory);
    fs::remove_dir_all(folder).unwrap();
}

fn compare_settings() -> CompareSettings {
    CompareSettings {
        rungs: vec![Rung::Sine, Rung::Stepping],
        sweeps: vec![
            Sweep { quantity: Quantity::Slope, values: vec![0.0, 20.0] },
            Sweep { quantity: Quantity::Push, values: vec![0.4] },
        ],
        ..CompareSettings::quick(400, 1)
    }
}

fn measured(speed: f64) -> Measured {
    let point = || SweepPoint { speeds_m_per_s: vec![0.9 * speed, speed], falls: 1 };
    Measured {
        run: RunReport {
            seed: None,
            env_steps: 0,
            speed_m_per_s: speed,
            prior_speed_m_per_s: None,
            displacement_speed_m_per_s: speed,
            falls: 1,
            num_episodes: 2,
            falls_by_cause: [("rollover".to_owned(), 1)].into(),
            episode_return: 10.0,
            drift_m: 0.1,
            heading_deg: 3.0,
            height_std_m: 0.01,
            power_w: 20.0,
            cost_of_transport: Some(0.8),
            speed_per_step_std_m: 0.002,
            body_contact_steps: 1.5,
            footfall: None,
            speeds_m_per_s: vec![speed, 1.1 * speed],
            return_curve: vec![(100, 1.0), (200, 2.5)],
        },
        sweeps: [(Quantity::Slope, vec![point(), point()]), (Quantity::Push, vec![point()])].into(),
    }
}

#[test]
fn what_a_job_has_measured() {
    let settings = compare_settings();
    let valid = [measured(0.5), measured(-0.1)].map(|measured| serde_json::to_vec(&measured).unwrap());
    fuzz_bytes("measured.json", &valid, &JSON, |bytes, random| {
        let own: Measured = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        own.check(Rung::Sine, &settings)?;
        let text = serde_json::to_vec(&own).unwrap();
        assert_eq!(serde_json::from_slice::<Measured>(&text).unwrap(), own);
        // Intervals take thousands of resamples.
        if random.once_in(500) {
            let all = vec![(Rung::Sine, own), (Rung::Stepping, measured(0.4))];
            let comparison = Comparison::new(&settings, all).map_err(|error| error.to_string())?;
            for report in comparison.rungs.values() {
                let numbers = [report.speed_iqm, report.return_iqm, report.speed_ci[0], report.speed_ci[1]];
                assert!(numbers.iter().all(|number| number.is_finite()), "{numbers:?}");
            }
        }
        Ok(())
    });
}

#[test]
fn searches_that_go_on() {
    let resolved = common::tiny(&[("policy.modulation", "amplitude"), ("policy.symmetric", "false")]);
    let settings = compare_settings().search();
    let search = Search { task: &resolved.task, settings: &settings, seed: 1 };
    let mut begun = search.start(Objective::Speed);
    let parameters = StrategyParameters::new(resolved.task.num_actions());
    let mut random = Random::new(3);
    let ranked = begun.cma_es.sample(&parameters, &mut || random.below(2001) as f64 / 1000.0 - 1.0);
    begun.cma_es.update(&parameters, &ranked);
    let mut chosen: Value = serde_json::to_value(&begun).unwrap();
    let candidate = serde_json::json!({
        "action": [0.5, -1.0],
        "score": { "num_episodes": 2, "falls": 0, "speed_m_per_s": 0.5, "episode_return": 3.0 },
    });
    chosen["remembered"] = serde_json::json!([candidate]);
    chosen["chosen"] = candidate;
    let valid = [serde_json::to_vec(&begun).unwrap(), chosen.to_string().into_bytes()];
    fuzz_bytes("search.json", &valid, &JSON, |bytes, random| {
        let mut state: SearchState = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        search.check(&state, Objective::Speed)?;
        let text = serde_json::to_vec(&state).unwrap();
        assert_eq!(serde_json::from_slice::<SearchState>(&text).unwrap(), state);
        let ranked = state.cma_es.sample(&parameters, &mut || random.below(2001) as f64 / 1000.0 - 1.0);
        state.cma_es.update(&parameters, &ranked);
        Ok(())
    });
}

#[test]
fn a_file_that_never_ends_is_refused_without_being_read() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    let directory = RunDirectory::create(Some(&run), "", &common::tiny(&[]).config).unwrap();
    fs::create_dir(run.join("checkpoints")).unwrap();
    for name in ["policy.safetensors", "checkpoints/00000001.safetensors", "robot.toml"] {
        // 1 TB that the disk need not hold.
        fs::File::create(run.join(name)).unwrap().set_len(1 << 40).unwrap();
    }
    let message = canter_train::run_directory::read_policy(&run).unwrap_err().to_string();
    assert!(message.ends_with("it has more than 128 MiB, no file of canter does"), "{message}");
    let message = directory.newest_checkpoint().unwrap_err().to_string();
    assert!(message.ends_with("it has more than 128 MiB, no file of canter does"), "{message}");
    let message = Robot::load(run.join("robot.toml").to_str().unwrap()).unwrap_err().to_string();
    assert!(message.ends_with("file too large: expected at most 1048576 bytes"), "{message}");
}
