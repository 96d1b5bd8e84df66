//! The program `canter`: parse, call, print.

mod args;
mod commands;
mod comparison;
mod error;
#[cfg(test)]
#[path = "../../train/tests/common/fuzz.rs"]
mod fuzz;
mod interrupt;
mod output;
mod progress;
mod verdict;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Cli, Command, RobotCommand};

fn main() -> ExitCode {
    canter_sim::mujoco::set_fatal_handler(|message| output::complain(&format!("{}MuJoCo: {message}", output::ERROR)));
    canter_sim::robot::set_model_guard(commands::compile_model::model_guard);
    let result = match Cli::parse().command {
        Command::Train(args) => commands::train::train(&args),
        Command::Resume(args) => commands::train::resume(&args),
        Command::Replay(args) => commands::replay::replay(&args),
        Command::Eval(args) => commands::eval::eval(&args),
        Command::Robustness(args) => commands::robustness::robustness(&args),
        Command::Compare(args) => commands::compare::compare(&args),
        Command::Sweep(args) => commands::sweep::sweep(&args),
        Command::Report(args) => commands::report::report(&args),
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
    };
    // MuJoCo's warnings are ours to pass on.
    let mut messages = canter_sim::mujoco::take_messages();
    messages.dedup();
    for message in messages {
        output::complain(&format!("MuJoCo: {message}"));
    }
    match result {
        Ok(code) => code,
        Err(error) => {
            output::complain(&format!("{}{error}", output::ERROR));
            ExitCode::from(error::FAILURE)
        }
    }
}
