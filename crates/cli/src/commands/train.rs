//! `canter train` and `canter resume`.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use canter_sim::mujoco;
use canter_train::config::{open_preset, resolve};
use canter_train::executor::Workers;
use canter_train::policy_file::PolicyFile;
use canter_train::run::{self, Ending, Observed, metrics};
use canter_train::run_directory::{RunDirectory, policy_path, read_config};
use canter_train::trainer::Trainer;
use serde_json::json;

use crate::args::{ResumeArgs, TrainArgs};
use crate::commands::report::report_finished;
use crate::commands::workers;
use crate::error::{CliError, STOPPED};
use crate::interrupt::{Interrupt, STOPPING_TRAINING};
use crate::output::{complain, event, program, say, set_log_format};
use crate::progress::ProgressLine;
use crate::verdict::describe;

/// Dumps of blow-ups that a training tells of; the others lie beside them.
const MAX_DUMPS_TOLD: usize = 3;

/// `canter train`.
pub fn train(args: &TrainArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
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
    let resolved = resolve(&document)?;
    let workers = workers(args.workers.threads)?;
    let stem = Path::new(&args.preset).file_stem().map_or_else(|| "run".into(), |stem| stem.to_string_lossy());
    let directory = RunDirectory::create(args.out.as_deref(), &stem, &resolved.config)?;
    say(&format!(
        "Training {} on {}'s gait `{}`: {} env steps, seed {}, {} threads, into {}",
        args.preset,
        resolved.task.robot.settings.name,
        resolved.config.policy.prior,
        resolved.config.training.max_env_steps,
        resolved.config.seed,
        workers.num_threads(),
        directory.path().display()
    ));
    go_on(Trainer::new(resolved), &directory, &workers)
}

/// `canter resume`.
pub fn resume(args: &ResumeArgs) -> Result<ExitCode, CliError> {
    set_log_format(args.log_format);
    let directory = RunDirectory::open(&args.run)?;
    let resolved = read_config(&args.run)?;
    let workers = workers(args.workers.threads)?;
    let mut trainer = Trainer::new(resolved);
    for reason in run::pick_up(&mut trainer, &directory)? {
        complain(&format!("skipping a damaged checkpoint: {reason}"));
    }
    say(&format!(
        "Going on after {} env steps of {}, {} threads, in {}",
        trainer.progress().env_steps,
        trainer.resolved().config.training.max_env_steps,
        workers.num_threads(),
        directory.path().display()
    ));
    go_on(trainer, &directory, &workers)
}

/// Trains to the end and judges the result.
fn go_on(mut trainer: Trainer, directory: &RunDirectory, workers: &Workers) -> Result<ExitCode, CliError> {
    let interrupt = Interrupt::listen(STOPPING_TRAINING)?;
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
        directory.write_json(
            "run.json",
            &json!({
                "canter": env!("CARGO_PKG_VERSION"),
                "mujoco": mujoco::version(),
                "threads": workers.num_threads(),
                "env_steps": env_steps - steps_before,
                "train_s": train_s,
                "collect_s": collect_s,
                "update_s": update_s,
            }),
        )?;
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
