//! `cargo xtask`: the tasks of this repository that cargo has no command for.

mod browser;
mod builds;
mod debian;
mod equations;
mod files;
mod full;
mod layering;
mod link_check;
mod markdown;
mod models;
mod mujoco;
mod portable;
mod python;
mod release;
mod robots;
mod site;
mod source;
mod start;
mod web;

use std::env;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const HELP: &str = "\
The tasks of this repository that cargo has no command for.

Usage: cargo xtask <TASK>

Tasks:
  canter ARGS...       build the program `canter` and run it with ARGS; `cargo canter ARGS...` is the same
  setup                fetch the physics engine MuJoCo into .mujoco/ (26 MB, once); canter and test do it when needed
  test [--full]        run every test and documentation example; --full adds those that need Python packages or
                       Debian's (OpenGL, ffmpeg, a font, Chromium, compilers, QEMU, MPI), and installs them, and mounts
                       a full disk; --only-full runs these alone
  web                  build the page of `canter serve`, which needs Node and npm; `canter serve` here does it when needed
  wheel                build the Python package with the program and MuJoCo's library in it
  python [--sb3]       build that, install it into a new Python environment and run its tests there; --sb3 adds those
                       with Stable-Baselines3 (4 GB)
  reliability          the whole of what docs/reliability.md promises: 200 killed runs, a million inputs for each parser,
                       10,000 mutated models, half an hour of faults; some two hours, as root
  release              make target/release-archives/: the program with MuJoCo's library, manual pages and licences, and the
                       wheel; the same commit and tools give the same bytes; needs Git, Node and npm; --allow-changes takes a tree that differs from it;
                       --check makes an archive of the ordinary build and tries it far from here
  layering             check which crate uses which, which may print, and that gait uses no std
  equations [--check]  write docs/equations.md from the doc comments; --check fails when the file is out of date
  models               fetch two robots of other people's into target/models/ (51 MB, once), for docs/robots.md
  site [--check]       build the documentation site into target/site; --check follows its links and runs the newcomer's
                       page, docs/start.md, with trainings made short; --full runs that page to the letter
  robots [--check]     write the robots in robots/ that are made from a few numbers
  no-std               prove by a build that gait needs no standard library
";

/// What ends a task: the exit code, and what the person should read.
pub enum Failure {
    /// The command line makes no sense.
    Usage(String),
    /// The task could not be done, or what it checks is wrong.
    Task(String),
    /// A program that this one called has failed, and has said why.
    Called(u8),
}

fn main() -> ExitCode {
    let mut arguments = env::args_os().skip(1);
    let task = arguments.next();
    let arguments: Vec<OsString> = arguments.collect();
    match run(task, &arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => {
            eprintln!("error: {message}\n\n{HELP}");
            ExitCode::from(2)
        }
        Err(Failure::Task(message)) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
        Err(Failure::Called(code)) => ExitCode::from(code),
    }
}

fn run(task: Option<OsString>, arguments: &[OsString]) -> Result<(), Failure> {
    let root = repository_root();
    let Some(task) = task else {
        return Err(Failure::Usage("which task?".to_owned()));
    };
    let task = task.to_string_lossy();
    match task.as_ref() {
        "canter" => {
            mujoco::ensure(&root)?;
            if arguments.first().is_some_and(|command| command == "serve") {
                web::try_to_ensure(&root);
            }
            Err(builds::build_and_become_canter(&root, arguments))
        }
        "setup" => {
            flags(&task, arguments, &[])?;
            if mujoco::is_there(&root) {
                println!("MuJoCo {} is in {}", mujoco::VERSION, mujoco::folder(&root).display());
            }
            mujoco::ensure(&root)
        }
        "test" => {
            let [full, only_full] = flags(&task, arguments, &["--full", "--only-full"])?;
            mujoco::ensure(&root)?;
            if !only_full {
                builds::test(&root)?;
            }
            if full || only_full {
                debian::ensure(&[&debian::FILMS[..], &debian::FONTS, &debian::EXPORTS, &debian::RANKS].concat())?;
                builds::test_films(&root)?;
                builds::test_disks(&root)?;
                builds::test_png(&root)?;
                builds::test_ranks(&root)?;
                full::tensorboard(&root)?;
                full::exports(&root)?;
                debian::ensure_npm()?;
                web::ensure_where_npm_is(&root)?;
                web::test(&root)?;
                browser::test(&root)?;
                python::test(&root, false)?;
                release::test(&root)?;
                site::check(&root)?;
                start::run(&root, false)?;
            }
            Ok(())
        }
        "web" => {
            flags(&task, arguments, &[])?;
            debian::ensure_npm()?;
            web::build(&root)
        }
        "wheel" => {
            flags(&task, arguments, &[])?;
            mujoco::ensure(&root)?;
            web::ensure_where_npm_is(&root)?;
            println!("{}", python::wheel(&root)?.display());
            Ok(())
        }
        "python" => {
            let [with_sb3] = flags(&task, arguments, &["--sb3"])?;
            mujoco::ensure(&root)?;
            web::ensure_where_npm_is(&root)?;
            python::test(&root, with_sb3)
        }
        "reliability" => {
            flags(&task, arguments, &[])?;
            mujoco::ensure(&root)?;
            builds::test_reliability(&root)
        }
        "release" => {
            let [allow_changes, check] = flags(&task, arguments, &["--allow-changes", "--check"])?;
            mujoco::ensure(&root)?;
            if check {
                return release::test(&root);
            }
            debian::ensure_npm()?;
            for path in release::archives(&root, allow_changes)? {
                println!("{}", path.display());
            }
            Ok(())
        }
        "layering" => {
            flags(&task, arguments, &[])?;
            layering::check(&root)
        }
        "equations" => {
            let [check] = flags(&task, arguments, &["--check"])?;
            if check { equations::check(&root) } else { equations::write(&root) }
        }
        "robots" => {
            let [check] = flags(&task, arguments, &["--check"])?;
            robots::write(&root, check)
        }
        "site" => {
            let [check, full] = flags(&task, arguments, &["--check", "--full"])?;
            if !(check || full) {
                println!("{}", site::build(&root)?.display());
                return Ok(());
            }
            site::check(&root)?;
            mujoco::ensure(&root)?;
            start::run(&root, full)
        }
        "models" => {
            flags(&task, arguments, &[])?;
            models::ensure(&root)
        }
        "no-std" => {
            flags(&task, arguments, &[])?;
            builds::no_std(&root)
        }
        "help" | "--help" | "-h" => {
            // A reader that closes the pipe early (`| head`) is no error.
            let _ = std::io::stdout().write_all(HELP.as_bytes());
            Ok(())
        }
        other => Err(Failure::Usage(format!("there is no task `{other}`"))),
    }
}

/// Says for each flag in `known` whether it was given.
///
/// # Errors
/// Any other argument is refused, with the flags that there are.
fn flags<const N: usize>(task: &str, arguments: &[OsString], known: &[&str; N]) -> Result<[bool; N], Failure> {
    let unknown = arguments.iter().find(|argument| !known.iter().any(|flag| argument == flag));
    match unknown {
        None => Ok(known.map(|flag| arguments.iter().any(|argument| argument == flag))),
        Some(argument) => {
            let argument = argument.to_string_lossy();
            let takes = if N == 0 { "no arguments".to_owned() } else { format!("only {}", known.join(", ")) };
            Err(Failure::Usage(format!("`{task}` takes {takes}, not `{argument}`")))
        }
    }
}

/// The folder of the workspace's `Cargo.toml`: the parent of this package's folder, which cargo gives when it runs us.
fn repository_root() -> PathBuf {
    let package =
        env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    package.parent().map(Path::to_path_buf).unwrap_or(package)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_name_tasks_and_flags_that_there_are() {
        let root = repository_root();
        let Ok(chapters) = site::chapters(&root) else { panic!("no chapters") };
        let (mut wrong, mut num_found) = (Vec::new(), 0);
        for chapter in &chapters {
            let page = std::fs::read_to_string(root.join(chapter)).unwrap();
            for (at, call) in page.match_indices("cargo xtask ") {
                let typed = page[at + call.len()..].split(['`', '#', '\n', '|', ';']).next().unwrap_or_default();
                let mut words = typed.split_whitespace();
                // `cargo xtask --help` asks for the help itself.
                let Some(task) = words.next().filter(|task| *task != "--help") else { continue };
                num_found += 1;
                let help = help_of(task);
                if help.is_empty() || words.any(|word| word.starts_with("--") && !help.contains(word)) {
                    let line = page[..at].matches('\n').count() + 1;
                    wrong.push(format!("{}:{line}: there is no `cargo xtask {}`", chapter.display(), typed.trim()));
                }
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        assert!(num_found > 20, "only {num_found} calls were found");
    }

    /// What [`HELP`] says of a task.
    fn help_of(task: &str) -> String {
        let is_of = |line: &&str| line.starts_with("   ") || line.split_whitespace().next() == Some(task);
        let lines = HELP.lines().skip_while(|line| line.trim_start().split(' ').next() != Some(task));
        lines.take_while(is_of).collect()
    }

    #[test]
    fn known_flags_are_found_and_others_refused() {
        let given = [OsString::from("--check")];
        assert!(matches!(flags("equations", &given, &["--check"]), Ok([true])));
        assert!(matches!(flags("equations", &[], &["--check"]), Ok([false])));
        let Err(Failure::Usage(message)) = flags("setup", &given, &[]) else { panic!("accepted") };
        assert_eq!(message, "`setup` takes no arguments, not `--check`");
    }
}
