//! Physics that makes no sense: the episode ends, is counted, and can be stepped through again.

mod common;

use std::fs;

use canter_train::blow_up::BlowUp;
use canter_train::checkpoint::{Checkpoint, CheckpointError};
use canter_train::run_directory::{RunDirectory, RunError, read_blow_up};
use canter_train::tensors::{TensorError, TensorFile};
use canter_train::trainer::{IterationReport, Trainer};
use common::{TemporaryFolder, tiny, trained, workers};

/// The environment that blows up.
const ENVIRONMENT: usize = 2;

/// The report of an iteration at whose start one environment has a velocity that no joint has.
fn blown_up() -> (Trainer, IterationReport) {
    let mut trainer = trained(&[], 2);
    let file = TensorFile::from_bytes(&Checkpoint::of(&trainer).to_bytes()).unwrap();
    let shape = file.shape("environments.state").unwrap().to_vec();
    let mut states = file.get::<f64>("environments.state", &shape).unwrap();
    let task = &trainer.resolved().task;
    // Number and level of the next episode, phase, env steps, return, stuck time, place, level and key; then action,
    // commands, time, positions.
    let delay = task.robot.settings.command_delay_steps as usize;
    let num_positions = task.robot.model.standing_position().len();
    let first_velocity = 9 + task.num_actions() + (delay + 1) * 2 * task.robot.legs.len() + 1 + num_positions;
    states[ENVIRONMENT * shape[1] + first_velocity + 8] = 1e9;
    let mut poisoned = file.clone();
    poisoned.push("environments.state", &shape, &states);
    Checkpoint::from_bytes(&poisoned.to_bytes()).unwrap().restore(&mut trainer).unwrap();
    let report = trainer.iterate(&workers(2)).unwrap();
    (trainer, report)
}

#[test]
fn a_blow_up_is_counted_and_its_dump_replays_to_the_same_end() {
    let (trainer, report) = blown_up();
    assert_eq!(report.accidents, [0, 0, 0, 1]);
    let [blow_up] = &report.blow_ups[..] else { panic!("{:?}", report.blow_ups) };
    assert_eq!((blow_up.environment, blow_up.iteration), (ENVIRONMENT as u64, 3));
    // The learner has seen nothing of it.
    assert!(report.update.is_ok() && report.speed_m_per_s.abs() < 3.0 && report.power_w < 1e3, "{report:?}");

    let back = BlowUp::from_bytes(&blow_up.to_bytes()).unwrap();
    assert_eq!(back, *blow_up);
    let steps = back.replay(&trainer.resolved().task).unwrap();
    let (last, before) = steps.split_last().unwrap();
    assert_eq!(last.accident, Some("unstable"));
    assert!(before.iter().all(|step| step.accident.is_none()));
}

#[test]
fn a_dump_belongs_to_its_run() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    let resolved = tiny(&[]);
    let directory = RunDirectory::create(Some(&run), "tiny", &resolved.config).unwrap();
    let (_, report) = blown_up();
    let path = directory.write_blow_up(&report.blow_ups[0]).unwrap().unwrap();
    assert_eq!(path, run.join("dumps/00000003-2.safetensors"));
    let (back, read) = read_blow_up(&path).unwrap();
    assert_eq!((&back, &read.config), (&report.blow_ups[0], &resolved.config));

    // Other actions than those of the configuration, other robot files, damage.
    let other = tiny(&[("policy.modulation", "leg-amplitude")]);
    assert!(matches!(back.replay(&other.task), Err(CheckpointError::Mismatch(_))));
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    assert!(matches!(read_blow_up(&path), Err(RunError::Dump { source: CheckpointError::Tensors(_), .. })));
    let checkpoint = Checkpoint::of(&trained(&[], 1)).to_bytes();
    assert!(matches!(BlowUp::from_bytes(&checkpoint), Err(CheckpointError::Metadata(_))));
    assert!(matches!(BlowUp::from_bytes(b""), Err(CheckpointError::Tensors(TensorError::Container(_)))));
}

#[test]
fn the_first_dumps_are_kept_and_no_more_are_written() {
    let folder = TemporaryFolder::new();
    let directory = RunDirectory::create(Some(&folder.join("run")), "tiny", &tiny(&[]).config).unwrap();
    let (_, report) = blown_up();
    for iteration in 0..20 {
        let mut blow_up = report.blow_ups[0].clone();
        blow_up.iteration = iteration;
        assert!(directory.write_blow_up(&blow_up).unwrap().is_some());
    }
    assert!(directory.write_blow_up(&report.blow_ups[0]).unwrap().is_none());
    assert_eq!(common::names(&folder.join("run/dumps")).len(), 20);
}
