//! Training on several ranks: the same bytes as in one process, whatever the number of ranks and threads.
//!
//! The ranks are threads here; `crates/cli/tests/mpi.rs` does it with real ones.

mod common;
#[path = "common/ranks.rs"]
mod threads;

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use canter_learn::communicator::{Alone, Communicator};
use canter_train::checkpoint::Checkpoint;
use canter_train::policy_file::PolicyFile;
use canter_train::ranks::{self, RanksError};
use canter_train::run::{self, Ending, TrainError};
use canter_train::run_directory::{RunDirectory, read_config};
use canter_train::tensors::TensorFile;
use canter_train::trainer::{IterationReport, Trainer};
use common::{TemporaryFolder, tiny, workers};
use threads::on_ranks;

/// 5 environments, minibatches of one shard and of several, and whatever an environment tells beside its samples.
const CHANGES: [(&str, &str); 7] = [
    ("training.num_environments", "5"),
    ("training.horizon", "128"),
    ("training.max_env_steps", "3200"),
    ("training.checkpoint_env_steps", "640"),
    ("ppo.minibatch_size", "640"),
    ("task.variation.share", "0.5"),
    ("task.variation.curriculum", "true"),
];

fn without_times(report: IterationReport) -> IterationReport {
    IterationReport { collect_s: 0.0, update_s: 0.0, ..report }
}

/// Reports, policy and checkpoint after 3 iterations.
fn trained(
    communicator: Arc<dyn Communicator>,
    num_threads: usize,
    changes: &[(&str, &str)],
) -> (Vec<IterationReport>, Vec<u8>, Vec<u8>) {
    let workers = workers(num_threads);
    let mut trainer = ranks::trainer(tiny(changes), communicator).unwrap();
    let reports = (0..3).map(|_| without_times(trainer.iterate(&workers).unwrap())).collect();
    (reports, PolicyFile::of(&trainer).to_bytes(), Checkpoint::of(&trainer).to_bytes())
}

#[test]
fn every_rank_of_any_number_has_the_bytes_of_a_single_process() {
    let one_shard = [&CHANGES[..], &[("ppo.minibatch_size", "64")]].concat();
    let (few, many) = (&CHANGES[..], &one_shard[..]);
    for changes in [few, many] {
        let expected = trained(Arc::new(Alone), 2, changes);
        assert!(expected.0.iter().any(|report| !report.episodes.is_empty() && report.difficulty.is_some()));
        for (num_ranks, num_threads) in [(1, 1), (2, 1), (3, 2), (5, 1)] {
            for (rank, actual) in
                on_ranks(num_ranks, |communicator| trained(communicator, num_threads, changes)).into_iter().enumerate()
            {
                assert_eq!(actual.0, expected.0, "reports of rank {rank} of {num_ranks}");
                assert!(actual.1 == expected.1, "policy of rank {rank} of {num_ranks}");
                assert!(actual.2 == expected.2, "checkpoint of rank {rank} of {num_ranks}");
            }
        }
    }
}

/// What `canter train`, or `canter resume` where the run has begun, does on each rank.
fn run_on(num_ranks: usize, path: &Path, stop_after: Option<u64>) -> Ending {
    let endings = on_ranks(num_ranks, |communicator| {
        let stop = AtomicBool::new(false);
        if communicator.rank() > 0 {
            let mut trainer = ranks::follow(&communicator).unwrap();
            // The request to stop comes to the last rank only.
            let is_last = communicator.rank() + 1 == num_ranks;
            stop.store(is_last && stop_after == Some(trainer.progress().iterations + 1), Ordering::Relaxed);
            return run::follow(&mut trainer, &workers(1), &stop).unwrap();
        }
        let is_new = !path.exists();
        let resolved = if is_new { tiny(&CHANGES) } else { read_config(path).unwrap() };
        let directory =
            if is_new { RunDirectory::create(Some(path), "tiny", &resolved.config) } else { RunDirectory::open(path) };
        let directory = directory.unwrap();
        let mut trainer = ranks::trainer(resolved.clone(), communicator.clone()).unwrap();
        let (checkpoint, skipped) = run::pick_up_checkpoint(&mut trainer, &directory).unwrap();
        assert_eq!(skipped, Vec::<String>::new());
        ranks::lead(&*communicator, Some((&resolved, checkpoint.as_ref()))).unwrap();
        stop.store(num_ranks == 1 && stop_after.is_some(), Ordering::Relaxed);
        run::train(&mut trainer, &directory, &workers(2), &stop, &mut |_| {}).unwrap()
    });
    assert!(endings.iter().all(|ending| *ending == endings[0]), "{endings:?}");
    endings[0]
}

#[test]
fn a_run_goes_on_with_another_number_of_ranks_as_if_it_had_never_stopped() {
    let folder = TemporaryFolder::new();
    let (undisturbed, stopped) = (folder.join("undisturbed"), folder.join("stopped"));
    assert_eq!(run_on(1, &undisturbed, None), Ending::Finished);
    assert_eq!(run_on(3, &stopped, Some(1)), Ending::Stopped);
    assert_eq!(run_on(2, &stopped, Some(2)), Ending::Stopped);
    assert_eq!(run_on(1, &stopped, Some(3)), Ending::Stopped);
    assert_eq!(run_on(5, &stopped, None), Ending::Finished);
    assert_eq!(common::metrics_without_times(&stopped), common::metrics_without_times(&undisturbed));
    for name in ["policy.safetensors", "config.toml", "checkpoints/00000005.safetensors"] {
        assert!(fs::read(stopped.join(name)).unwrap() == fs::read(undisturbed.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn a_blow_up_in_another_ranks_environment_is_known_to_all() {
    let mut start = Trainer::new(tiny(&CHANGES));
    start.iterate(&workers(2)).unwrap();
    let checkpoint = Checkpoint::of(&start);
    let mut file = TensorFile::from_bytes(&checkpoint.to_bytes()).unwrap();
    let shape = file.shape("environments.state").unwrap().to_vec();
    let mut states = file.get::<f64>("environments.state", &shape).unwrap();
    // A velocity in the middle of the last environment's state that no joint has.
    let place = states.len() - shape[1] / 2;
    states[place] = 1e9;
    file.push("environments.state", &shape, &states);
    let poisoned = Checkpoint::from_bytes(&file.to_bytes()).unwrap();
    let reports = on_ranks(3, |communicator| {
        let mut trainer = ranks::trainer(tiny(&CHANGES), communicator).unwrap();
        poisoned.restore(&mut trainer).unwrap();
        without_times(trainer.iterate(&workers(1)).unwrap())
    });
    assert_eq!((reports[0].blow_ups.len(), reports[0].blow_ups[0].environment), (1, 4));
    assert_eq!(reports[0].blow_ups[0].iteration, 2);
    assert!(!reports[0].blow_ups[0].replay(&tiny(&CHANGES).task).unwrap().is_empty());
    assert!(reports[1] == reports[0] && reports[2] == reports[0]);
}

#[test]
fn ranks_that_cannot_do_their_part_are_named_to_all() {
    // Too many.
    let refused = on_ranks(6, |communicator| ranks::trainer(tiny(&CHANGES), communicator).unwrap_err().to_string());
    let message = "6 ranks were started for 5 environments, and each needs one";
    assert!(refused.iter().all(|refusal| refusal.starts_with(message)), "{refused:?}");
    // Rank 0 has nothing to train.
    let answers = on_ranks(3, |communicator| match communicator.rank() {
        0 => ranks::lead(&*communicator, None).is_err(),
        _ => ranks::follow(&communicator).is_some(),
    });
    assert_eq!(answers, [false; 3]);
    // A robot's files that rank 0 sees otherwise.
    let answers = on_ranks(2, |communicator| {
        if communicator.rank() > 0 {
            assert!(ranks::follow(&communicator).is_none());
            return String::new();
        }
        let mut resolved = tiny(&CHANGES);
        (resolved.config.robot, resolved.config.policy.prior) = ("minitaur".to_owned(), "trot".to_owned());
        ranks::lead(&*communicator, Some((&resolved, None))).unwrap_err().to_string()
    });
    assert_eq!(answers[0], "rank 1: the files of minitaur differ from those that rank 0 reads");
}

#[test]
fn ranks_that_compute_other_numbers_stop() {
    let errors = on_ranks(3, |communicator| {
        // Another seed gives rank 2 other first parameters.
        let seed = if communicator.rank() == 2 { "2" } else { "1" };
        let changes = [&CHANGES[..], &[("seed", seed)]].concat();
        let mut trainer = ranks::trainer(tiny(&changes), communicator).unwrap();
        run::follow(&mut trainer, &workers(1), &AtomicBool::new(false)).unwrap_err()
    });
    for error in errors {
        assert!(matches!(error, TrainError::Ranks(RanksError::Differ { rank: 2 })), "{error:?}");
        assert!(error.is_on_every_rank());
    }
}
