//! What may be typed. Doc comments here are the program's help.

mod exporting;
mod learning;
mod measuring;
mod robots;
mod shell;

use clap::{Args, Parser, Subcommand};

pub use exporting::{ExportArgs, ExportFormat, RunArgs};
pub use learning::{CompareArgs, ConfigArgs, ReplayArgs, ResumeArgs, SweepArgs, TrainArgs};
pub use measuring::{EvalArgs, FilmArgs, ReportArgs, RobustnessArgs, ServeArgs, ViewArgs};
pub use robots::{
    CompileModelArgs, FitShape, GaitArgs, GaitCommand, GaitFitArgs, GaitTableArgs, RobotArgs, RobotCheckArgs,
    RobotCommand, RobotNewArgs, RobotsArgs,
};
pub use shell::{CompletionsArgs, ManArgs};

use crate::version::VERSION;

/// Learns a faster version of a legged robot's own gait, in simulation.
///
/// A first run: `canter train` trains Stanford Doggo's trot for a minute and says how much faster it became.
#[derive(Debug, Parser)]
#[command(name = "canter", version = VERSION, arg_required_else_help = true, after_help = EXIT_CODES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 failed, with a message; 2 wrong usage; 130 stopped by Ctrl-C or SIGTERM.\n\
The first signal saves before it stops, a second one falls back to the last checkpoint.";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Train a policy and judge it against the hand-made gait
    Train(TrainArgs),
    /// Go on with a training that was stopped
    Resume(ResumeArgs),
    /// Step through what led to physics that made no sense
    Replay(ReplayArgs),
    /// Measure a trained policy, or a bare gait
    Eval(EvalArgs),
    /// Measure what trained policies keep of their speed on other grounds and with other motors, masses and delays
    Robustness(RobustnessArgs),
    /// Compare learned, tuned and default gaits at equal budgets over several seeds
    Compare(CompareArgs),
    /// Train with other values of the configuration, over several seeds
    Sweep(SweepArgs),
    /// Draw runs, a comparison or a sweep: one HTML page, figures, tables
    Report(ReportArgs),
    /// Watch runs in the browser: live curves, verdicts side by side, the robot in 3D
    Serve(ServeArgs),
    /// Take a learned gait onto the robot: C, ONNX, Rust, a table, gait parameters
    Export(ExportArgs),
    /// Run a learned gait on a robot: readings in, targets out, line by line
    Run(RunArgs),
    /// Film the prior and the learned gait side by side
    Film(FilmArgs),
    /// Watch the learned gait in MuJoCo's viewer
    View(ViewArgs),
    /// List the robots, or explain one
    Robots(RobotsArgs),
    /// Bring a robot of your own: draft its robot.toml, look for faults
    Robot(RobotArgs),
    /// Write a gait as a table, or find the gait that is closest to one
    Gait(GaitArgs),
    /// Print a preset with the meaning of every value
    Config(ConfigArgs),
    /// Print what a shell needs to complete canter's commands and options
    Completions(CompletionsArgs),
    /// Write canter's manual pages
    Man(ManArgs),
    /// Compile a model, within limits of time and memory
    #[command(hide = true)]
    CompileModel(CompileModelArgs),
}

// What is said of a group of options would become the help of the command that has them.
#[derive(Clone, Copy, Debug, Args)]
pub struct WorkerThreads {
    /// Worker threads; as many as there are cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// `KEY=VALUE` in its two parts.
fn key_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("expected KEY=VALUE, for example ppo.gamma=0.98")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// A command line is damaged like a file; `fuzz.rs` says what it must survive.
    #[cfg(unix)]
    #[test]
    fn no_command_line_can_hurt() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        const WORDS: [&str; 26] = [
            "\n",
            "\n\n",
            "\n--\n",
            "-",
            "=",
            "\n--set\n",
            "\n--seed=",
            "\n--threads\n",
            "\n--out\n",
            "\n--steps\n",
            "\n--help",
            "\n-V",
            "\n--json",
            "\n--size\n",
            "\n--seconds\n",
            "\n--fps\n",
            "\n--rungs=",
            "\n--budget\n",
            "\n--slope\n-",
            "x",
            ",",
            "tuned,doggo",
            "train\n",
            "eval\n",
            "film\n",
            "\u{1f415}",
        ];
        let valid = [
            "train\npaper\n--seed\n3\n--set\npolicy.authority=0.5\n--threads\n2\n--steps\n1000\n--out\nruns/x",
            "eval\nruns/doggo-1-1\n--slope\n10\n--friction=0.8\n--episodes\n5\n--json",
            "compare\n--seeds\n3\n--budget\n500000\n--rungs\ntuned,doggo\n--quick",
            "film\nruns/doggo-1-1\n--seconds\n2.5\n--size\n1920x720\n--fps\n50",
            "config\ndoggo\n--set\nppo.gamma=0.9\n--set\ntask.friction=0.8",
            "robot\nnew\n--from\nmodel.xml\n--out\nrex\n--name=rex",
            "robot\ncheck\nrex/robot.toml\n--episodes\n4\n--film\nrex.gif\n--json",
        ];
        crate::fuzz::fuzz_bytes("command line", &valid.map(|line| line.as_bytes().to_vec()), &WORDS, |bytes, _| {
            let words = bytes.split(|&byte| byte == b'\n').map(OsStr::from_bytes);
            let cli = Cli::try_parse_from([OsStr::new("canter")].into_iter().chain(words));
            match cli.map_err(|error| format!("{:?}", error.kind()))?.command {
                Command::Film(args) => {
                    assert!((0.1..=60.0).contains(&args.seconds) && (1..=50).contains(&args.fps));
                    assert!(args.size.iter().all(|&pixels| (120..=3840).contains(&pixels)));
                }
                Command::Train(args) => {
                    assert!(args.workers.threads.is_none_or(|threads| (1..=1024).contains(&threads)));
                }
                _ => {}
            }
            Ok(())
        });
    }

    #[test]
    fn overrides_split_at_the_first_equals_sign() {
        assert_eq!(key_value("a.b = x=y").unwrap(), ("a.b".to_owned(), "x=y".to_owned()));
        assert!(key_value("gamma").is_err());
    }
}
