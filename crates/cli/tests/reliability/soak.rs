//! Hours of training in one process, with faults all the time: memory, open files and threads must not grow.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use canter_sim::Robot;
use canter_train::checkpoint::Checkpoint;
use canter_train::config::{Resolved, open_preset, resolve};
use canter_train::evaluate::judge;
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::run::{Ending, pick_up, train};
use canter_train::run_directory::{RunDirectory, read_config};
use canter_train::tensors::TensorFile;
use canter_train::trainer::Trainer;

use crate::amount;
use crate::common::{TemporaryFolder, in_repository};

/// Growth that is allowed after the first cycles: the allocator keeps what it once had [bytes].
const MAX_GROWTH: u64 = 16 << 20;

/// Cycles before the growth counts.
const WARM_UP_CYCLES: u64 = 5;

/// What a process holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Held {
    resident: u64,
    files: usize,
    threads: usize,
}

impl Held {
    fn now() -> Self {
        let count = |folder: &str| Path::new(folder).read_dir().unwrap().count();
        let status = fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        let resident = line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() << 10;
        Self { resident, files: count("/proc/self/fd"), threads: count("/proc/self/task") }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn nothing_leaks_while_faults_are_injected() {
    let folder = TemporaryFolder::new();
    let resolved = tiny();
    let (begin, length) = (Instant::now(), Duration::from_secs(amount("CANTER_SOAK_S", 10)));
    let end = begin + length;
    let (mut cycles, mut start, mut most) = (0, None, Held::now());
    // A leak grows evenly; an allocator that keeps what it once had comes to rest.
    let mut by_tenths = Vec::new();
    while Instant::now() < end || cycles <= WARM_UP_CYCLES {
        cycle(&folder, &resolved);
        cycles += 1;
        most = Held::now();
        if cycles <= WARM_UP_CYCLES {
            start = Some(most);
        }
        if begin.elapsed() >= length * (by_tenths.len() as u32 + 1) / 10 {
            by_tenths.push(most.resident >> 10);
        }
    }
    let start = start.unwrap();
    println!("{cycles} cycles: {start:?} after the first {WARM_UP_CYCLES}, {most:?} at the end");
    println!("resident after each tenth of the time [KiB]: {by_tenths:?}");
    // Other tests of this binary run beside this one unless it is run alone, as `cargo xtask reliability` does.
    if std::env::var_os("CANTER_SOAK_S").is_some() {
        assert_eq!((most.files, most.threads), (start.files, start.threads));
        assert!(most.resident < start.resident + MAX_GROWTH, "{start:?} became {most:?}");
    }
}

/// A training that meets every fault that can be injected, from its start to its verdict.
fn cycle(folder: &TemporaryFolder, resolved: &Resolved) {
    let workers = Workers::new(Some(2)).unwrap();
    let run = folder.join("run");
    let directory = RunDirectory::create(Some(&run), "soak", &resolved.config).unwrap();
    let mut trainer = Trainer::new(resolved.clone());
    for _ in 0..3 {
        trainer.iterate(&workers).unwrap();
    }
    directory.write_checkpoint(&Checkpoint::of(&trainer)).unwrap();

    // The physics blows up in one environment.
    poisoned(&Checkpoint::of(&trainer)).restore(&mut trainer).unwrap();
    let report = trainer.iterate(&workers).unwrap();
    assert_eq!((report.blow_ups.len(), report.accidents.iter().sum::<u64>() > 0), (1, true));
    let dump = directory.write_blow_up(&report.blow_ups[0]).unwrap().unwrap();
    assert!(!report.blow_ups[0].replay(&resolved.task).unwrap().is_empty());
    fs::write(dump, b"damaged").unwrap();

    // Files are damaged, robots are broken, another process has the run.
    let bytes = PolicyFile::of(&trainer).to_bytes();
    for len in [0, 8, bytes.len() / 2, bytes.len() - 1] {
        assert!(PolicyFile::from_bytes(&bytes[..len]).is_err());
        assert!(Checkpoint::from_bytes(&bytes[..len]).is_err());
    }
    assert!(RunDirectory::open(&run).is_err());
    let robot = folder.join("robot.toml");
    fs::copy(in_repository("robots/doggo/robot.toml"), &robot).unwrap();
    fs::write(folder.join("doggo.xml"), "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>").unwrap();
    assert!(Robot::load(robot.to_str().unwrap()).is_err());
    drop(directory);
    fs::write(run.join("checkpoints/00000009.safetensors"), b"damaged").unwrap();

    // The run goes on to its end.
    let directory = RunDirectory::open(&run).unwrap();
    let mut trainer = Trainer::new(read_config(&run).unwrap());
    assert_eq!(pick_up(&mut trainer, &directory).unwrap().len(), 1);
    assert_eq!(trainer.progress().iterations, 3);
    let ending = train(&mut trainer, &directory, &workers, &AtomicBool::new(false), &mut |_| {}).unwrap();
    assert_eq!(ending, Ending::Finished);
    let policy = PolicyFile::of(&trainer);
    let _ = judge(&resolved.task, "sine", Some(&policy.policy()), &resolved.config.evaluation, &workers);

    // The folder vanishes under the run.
    fs::remove_dir_all(&run).unwrap();
    assert!(directory.write_policy(&policy).is_err());
}

/// The checkpoint with a velocity in its second environment that no joint has.
fn poisoned(checkpoint: &Checkpoint) -> Checkpoint {
    let file = TensorFile::from_bytes(&checkpoint.to_bytes()).unwrap();
    let shape = file.shape("environments.state").unwrap().to_vec();
    let mut states = file.get::<f64>("environments.state", &shape).unwrap();
    // MuJoCo's state begins with the time and the positions, and has velocities in its middle.
    states[2 * shape[1] - shape[1] / 2] = 1e9;
    let mut changed = file.clone();
    changed.push("environments.state", &shape, &states);
    Checkpoint::from_bytes(&changed.to_bytes()).unwrap()
}

/// 8 environments on level ground, 8 iterations.
fn tiny() -> Resolved {
    let mut document = open_preset("doggo").unwrap();
    for (key, value) in [
        ("task.variation.share", "0.0"),
        ("network.actor_hidden", "16"),
        ("network.critic_hidden", "16"),
        ("ppo.minibatch_size", "64"),
        ("training.num_environments", "8"),
        ("training.horizon", "16"),
        ("training.max_env_steps", "1024"),
        ("training.checkpoint_env_steps", "256"),
        ("evaluation.num_episodes", "2"),
        ("evaluation.episode_s", "2.0"),
    ] {
        document.set(key, value);
    }
    resolve(&document).unwrap()
}
