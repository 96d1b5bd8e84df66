//! The program `canter`: parse, call, print.

mod args;
mod commands;
mod comparison;
#[cfg(test)]
mod documents;
mod error;
#[cfg(test)]
#[path = "../../train/tests/common/fuzz.rs"]
mod fuzz;
mod interrupt;
#[cfg(test)]
#[path = "../../../xtask/src/markdown.rs"]
mod markdown;
mod output;
mod progress;
mod ranks;
mod verdict;
mod version;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Cli, Command, RobotCommand};
use crate::error::CliError;
use crate::ranks::Launch;

fn main() -> ExitCode {
    canter_sim::mujoco::set_fatal_handler(|message| output::complain(&format!("{}MuJoCo: {message}", output::ERROR)));
    canter_sim::robot::set_model_guard(commands::compile_model::model_guard);
    let launch = Launch::of_this_process();
    let is_silent = launch.is_some_and(Launch::is_silent);
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        // Of several copies one says what is wrong. Had another one's exit code a meaning, mpirun might end that one first.
        Err(_) if is_silent => return ExitCode::SUCCESS,
        Err(error) => error.exit(),
    };
    let result = match launch.map_or(Ok(()), |launch| launch.check(&command)) {
        Err(_) if is_silent => return ExitCode::SUCCESS,
        Err(error) => Err(error),
        Ok(()) => run(command),
    };
    let who = match ranks::rank() {
        0 => String::new(),
        rank => format!("rank {rank}: "),
    };
    // MuJoCo's warnings are ours to pass on.
    let mut messages = canter_sim::mujoco::take_messages();
    messages.dedup();
    for message in messages {
        output::complain(&format!("{who}MuJoCo: {message}"));
    }
    match result {
        Ok(code) => code,
        Err(error) => {
            output::complain(&format!("{}{who}{error}", output::ERROR));
            ranks::end_all();
            ExitCode::from(error::FAILURE)
        }
    }
}

/// Does what was typed.
fn run(command: Command) -> Result<ExitCode, CliError> {
    match command {
        Command::Train(args) => commands::train::train(&args),
        Command::Resume(args) => commands::train::resume(&args),
        Command::Replay(args) => commands::replay::replay(&args),
        Command::Eval(args) => commands::eval::eval(&args),
        Command::Robustness(args) => commands::robustness::robustness(&args),
        Command::Compare(args) => commands::compare::compare(&args),
        Command::Sweep(args) => commands::sweep::sweep(&args),
        Command::Report(args) => commands::report::report(&args),
        Command::Serve(args) => commands::serve::serve(&args),
        Command::Export(args) => commands::export::export(&args),
        Command::Run(args) => commands::run::run(&args),
        Command::Film(args) => commands::film::film(&args),
        Command::View(args) => commands::view::view(&args),
        Command::Robots(args) => commands::robots::robots(&args),
        Command::Gait(args) => commands::gait::gait(&args),
        Command::Robot(args) => match args.command {
            RobotCommand::New(args) => commands::robot_new::robot_new(&args),
            RobotCommand::Check(args) => commands::robot_check::robot_check(&args),
        },
        Command::Config(args) => commands::config::config(&args),
        Command::Completions(args) => commands::shell::completions(&args),
        Command::Man(args) => commands::shell::man(&args),
        Command::CompileModel(args) => commands::compile_model::compile_model(&args),
    }
}
