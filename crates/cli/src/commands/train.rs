//! `canter train` and `canter resume`.

use std::path::Path;
use std::process::ExitCode;
use std::thread::available_parallelism;
use std::time::Instant;

use canter_sim::mujoco;
use canter_train::checkpoint::Checkpoint;
use canter_train::config::{open_preset, resolve};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::ranks;
use canter_train::run::{self, Ending, Observed, TrainError, metrics};
use canter_train::run_directory::{RunDirectory, policy_path, read_config};
use canter_train::trainer::Trainer;
use serde_json::Value;

use crate::args::{ResumeArgs, TrainArgs};
use crate::commands::report::report_finished;
use crate::commands::workers;
use crate::error::{CliError, STOPPED};
use crate::interrupt::{Interrupt, STOPPING_TRAINING};
use crate::output::{complain, event, program, say, set_log_format};
use crate::progress::ProgressLine;
use crate::ranks::Ranks;
use crate::verdict::describe;
use crate::version;

/// Dumps of blow-ups that a training tells of; the others lie beside them.
const MAX_DUMPS_TOLD: usize = 3;

/// A training that can begin or go on, on rank 0.
struct Prepared {
    trainer: Trainer,
    directory: RunDirectory,
    workers: Workers,
    /// Where it goes on from.
    checkpoint: Option<Checkpoint>,
}

/// `canter train`.
pub fn train(args: &TrainArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let ranks = Ranks::enter()?;
    let threads = ranks.threads(args.workers.threads);
    if ranks.is_follower() { follow(&ranks, threads) } else { lead(&ranks, begin(args, &ranks, threads)) }
}

/// `canter resume`.
pub fn resume(args: &ResumeArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let ranks = Ranks::enter()?;
    let threads = ranks.threads(args.workers.threads);
    if ranks.is_follower() { follow(&ranks, threads) } else { lead(&ranks, pick_up(args, &ranks, threads)) }
}

/// Makes the folder of a new training.
fn begin(args: &TrainArgs, ranks: &Ranks, threads: Option<u16>) -> Result<Prepared, CliError> {
    let mut document = open_preset(&args.preset)?;
    for (key, value) in &args.overrides {
        document.set(key, value);
    }
    if let Some(seed) = args.seed {
        document.set("seed", &seed.to_string());
    }
    if let Some(authority) = args.authority {
        document.set("policy.authority", &authority.to_string());
    }
    if let Some(steps) = args.steps {
        document.set("training.max_env_steps", &steps.to_string());
    }
    let trainer = ranks::trainer(resolve(&document)?, ranks.communicator.clone())?;
    let resolved = trainer.resolved();
    let workers = workers(threads)?;
    let stem = Path::new(&args.preset).file_stem().map_or_else(|| "run".into(), |stem| stem.to_string_lossy());
    let directory = RunDirectory::create(args.out.as_deref(), &stem, &resolved.config)?;
    say(&format!(
        "Training {} on {}'s gait `{}`: {} env steps, seed {}, {}, into {}",
        args.preset,
        resolved.task.robot.settings.name,
        resolved.config.policy.prior,
        resolved.config.training.max_env_steps,
        resolved.config.seed,
        ranks.describe(workers.num_threads()),
        directory.path().display()
    ));
    Ok(Prepared { trainer, directory, workers, checkpoint: None })
}

/// Opens the folder of a training that goes on.
fn pick_up(args: &ResumeArgs, ranks: &Ranks, threads: Option<u16>) -> Result<Prepared, CliError> {
    let directory = RunDirectory::open(&args.run)?;
    let resolved = read_config(&args.run)?;
    let workers = workers(threads)?;
    let mut trainer = ranks::trainer(resolved, ranks.communicator.clone())?;
    let (checkpoint, skipped) = run::pick_up_checkpoint(&mut trainer, &directory)?;
    for reason in skipped {
        complain(&format!("skipping a damaged checkpoint: {reason}"));
    }
    say(&format!(
        "Going on after {} env steps of {}, {}, in {}",
        trainer.progress().env_steps,
        trainer.resolved().config.training.max_env_steps,
        ranks.describe(workers.num_threads()),
        directory.path().display()
    ));
    Ok(Prepared { trainer, directory, workers, checkpoint })
}

/// Trains what rank 0 trains and says nothing: whatever ends all ranks, rank 0 says.
fn follow(ranks: &Ranks, threads: Option<u16>) -> Result<ExitCode, CliError> {
    let workers = workers(threads)?;
    if let Some(mut trainer) = ranks::follow(&ranks.communicator) {
        let interrupt = Interrupt::listen(ranks.stopping(STOPPING_TRAINING))?;
        let ending = run::follow(&mut trainer, &workers, &interrupt.stop);
        if let Err(error) = ending
            && !error.is_on_every_rank()
        {
            return Err(error.into());
        }
    }
    ranks.leave();
    Ok(ExitCode::SUCCESS)
}

/// Tells the other ranks what is trained, and trains.
fn lead(ranks: &Ranks, prepared: Result<Prepared, CliError>) -> Result<ExitCode, CliError> {
    let start = prepared.as_ref().ok().map(|prepared| (prepared.trainer.resolved(), prepared.checkpoint.as_ref()));
    let ready = ranks::lead(&*ranks.communicator, start);
    if prepared.is_err() || ready.is_err() {
        // Every rank knows that there is nothing to do.
        ranks.leave();
    }
    let prepared = prepared?;
    ready?;
    let num_threads = prepared.workers.num_threads();
    let num_cores = available_parallelism().map_or(num_threads, usize::from);
    if ranks.communicator.num_ranks() > 1 && num_threads > num_cores {
        complain(&format!(
            "each rank has {num_threads} threads, but mpirun lets rank 0 run on {num_cores} of the machine's cores only; \
             `mpirun --bind-to none` lets it run on all"
        ));
    }
    go_on(ranks, prepared)
}

/// Trains to the end and judges the result.
fn go_on(ranks: &Ranks, Prepared { mut trainer, directory, workers, .. }: Prepared) -> Result<ExitCode, CliError> {
    let (directory, workers) = (&directory, &workers);
    let interrupt = Interrupt::listen(ranks.stopping(STOPPING_TRAINING))?;
    let start = Instant::now();
    let steps_before = trainer.progress().env_steps;
    let mut line = ProgressLine::new(&trainer.resolved().config.training, trainer.progress());
    let (mut collect_s, mut update_s) = (0.0, 0.0);
    let mut num_dumps = 0;
    let ending = run::train(&mut trainer, directory, workers, &interrupt.stop, &mut |Observed { report, dumps }| {
        collect_s += report.collect_s;
        update_s += report.update_s;
        event("iteration", || metrics(report));
        if let Err(divergence) = &report.update {
            complain(&format!("{divergence}. The update was undone; the training goes on with half the learning rate"));
        }
        for dump in dumps {
            num_dumps += 1;
            if num_dumps <= MAX_DUMPS_TOLD {
                let dump = dump.display();
                complain(&format!(
                    "the physics made no sense in an environment, whose episode was ended; look at it with \
                     `{} replay {dump}`",
                    program()
                ));
            }
        }
        line.show(report);
    });
    line.finish();
    if ending.as_ref().err().is_none_or(TrainError::is_on_every_rank) {
        ranks.leave();
    }
    let ending = ending?;
    interrupt.everything_is_saved();
    let train_s = start.elapsed().as_secs_f64();
    let env_steps = trainer.progress().env_steps;
    let run = directory.path().display();
    if ending == Ending::Stopped {
        say(&format!("Stopped after {env_steps} env steps, saved. Go on with:  {} resume {run}", program()));
        return Ok(ExitCode::from(STOPPED));
    }
    if env_steps == steps_before {
        say("Nothing was left to train. Now judging.");
    } else {
        let mut card = ranks.card();
        for (key, value) in [
            ("canter", Value::from(env!("CARGO_PKG_VERSION"))),
            ("mujoco", mujoco::version().into()),
            ("threads", workers.num_threads().into()),
            ("env_steps", (env_steps - steps_before).into()),
            ("train_s", train_s.into()),
            ("collect_s", collect_s.into()),
            ("update_s", update_s.into()),
        ] {
            card.insert(key.to_owned(), value);
        }
        if let Some(commit) = version::commit() {
            card.insert("commit".to_owned(), commit.into());
        }
        directory.write_json("run.json", &Value::Object(card))?;
        say(&format!(
            "Trained {} env steps in {train_s:.0} s: {:.0} steps/s, {:.0} % of the time updating. Now judging.",
            env_steps - steps_before,
            (env_steps - steps_before) as f64 / train_s,
            100.0 * update_s / (collect_s + update_s)
        ));
    }
    let policy = PolicyFile::of(&trainer);
    let (verdict, json) = run::judge_trained(directory.path(), trainer.resolved(), &policy, workers)?;
    event("verdict", || json);
    say(&format!("\n{}\n", describe(&verdict)));
    report_finished(directory.path());
    say(&format!("Policy:   {}", policy_path(directory.path()).display()));
    say(&format!("Numbers:  {run}/eval.json, metrics.jsonl, config.toml, trajectories/"));
    say(&format!("Uphill:   {} eval {run} --slope 5", program()));
    Ok(ExitCode::SUCCESS)
}
