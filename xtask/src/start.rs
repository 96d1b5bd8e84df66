//! Runs the newcomer's page, `docs/start.md`, as a newcomer would: block by block, in a fresh folder, and holds what it
//! prints against what the page says.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::files::{copy, make, remove};
use crate::markdown::{Block, blocks};
use crate::source::read;
use crate::{Failure, builds, debian, python};

const PAGE: &str = "docs/start.md";

/// What makes a line short: what the command is, and what is typed behind it. The rest is run to the letter.
const SHORTER: [(&str, &str); 3] = [
    ("cargo canter train", "--set training.max_env_steps=60000 --set evaluation.num_episodes=4"),
    ("cargo canter film", "--seconds 1"),
    // What was trained for so short may not be fit for a robot.
    ("cargo canter export", "--allow-unsafe"),
];

/// A line of the page's output that stands for any lines.
const ANYTHING: &str = "...";

/// Runs every block of `sh`; `is_full` runs them to the letter, else trainings and films are made short.
///
/// # Errors
/// The first command that fails, or that prints something else than the page says.
pub fn run(root: &Path, is_full: bool) -> Result<(), Failure> {
    debian::ensure(&debian::FILMS)?;
    let begin = Instant::now();
    let page = read(&root.join(PAGE))?;
    let blocks = blocks(&page);
    let (folder, wheel_folder) = (fresh(root, "start")?, fresh(root, "start-wheel")?);
    let mut num_run = 0;
    for (index, block) in blocks.iter().enumerate() {
        let place = match block.language {
            "sh" => &folder,
            "sh wheel" => {
                let wheel = python::wheel(root)?;
                let name = wheel.file_name().unwrap_or_default();
                copy(&wheel, &wheel_folder.join(name))?;
                &wheel_folder
            }
            _ => continue,
        };
        let printed = run_block(root, block, place, is_full)?;
        num_run += 1;
        if let Some(expected) = blocks.get(index + 1).filter(|next| next.language == "text") {
            hold(expected, &printed)?;
        }
    }
    let how = if is_full { "to the letter" } else { "with trainings and films made short" };
    println!("start: {num_run} blocks of {PAGE} run, {how} ({:.0} s)", begin.elapsed().as_secs_f64());
    Ok(())
}

/// A folder with nothing in it.
fn fresh(root: &Path, name: &str) -> Result<PathBuf, Failure> {
    // Inside of the checkout, wherever cargo builds: `cargo canter` is known nowhere else.
    let folder = root.join("target").join(name);
    remove(&folder)?;
    make(&folder)?;
    Ok(folder)
}

/// Runs a block as one script that ends with the first command that fails, and gives what it printed.
fn run_block(root: &Path, block: &Block<'_>, folder: &Path, is_full: bool) -> Result<String, Failure> {
    let script = if is_full { block.lines.join("\n") } else { shorter(block) };
    let place = format!("{PAGE}:{}", block.line);
    let mut bash = Command::new("bash");
    bash.args(["-euo", "pipefail", "-c", &script]).current_dir(folder);
    // What was built is used again, wherever a relative folder counted from.
    bash.env("CARGO_TARGET_DIR", builds::target_dir(root));
    let output = bash.output().map_err(|error| Failure::Task(format!("cannot run bash: {error}")))?;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.success() {
        return Ok(printed);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(Failure::Task(format!("{place}: this block fails\n{script}\n\n{printed}{}", said.trim_end())))
}

/// The block with what [`SHORTER`] says behind its lines.
fn shorter(block: &Block<'_>) -> String {
    let lines = block.lines.iter().map(|line| match SHORTER.iter().find(|(command, _)| line.starts_with(command)) {
        Some((_, more)) => format!("{line} {more}"),
        None => (*line).to_owned(),
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Fails where what was printed does not have the form of the page's block.
fn hold(expected: &Block<'_>, printed: &str) -> Result<(), Failure> {
    let mut lines = printed.lines().map(form).filter(|line| !line.is_empty());
    let mut may_skip = false;
    for (index, line) in expected.lines.iter().enumerate() {
        if *line == ANYTHING {
            may_skip = true;
            continue;
        }
        let wanted = form(line);
        if wanted.is_empty() {
            continue;
        }
        let found = if may_skip { lines.find(|line| *line == wanted) } else { lines.next() };
        may_skip = false;
        if found.as_ref() != Some(&wanted) {
            let found = found.unwrap_or_else(|| "nothing of this form".to_owned());
            let at = expected.line + index + 1;
            return Err(Failure::Task(format!(
                "{PAGE}:{at}: the page says\n  {line}\nbut the command printed (# is a number)\n  {found}"
            )));
        }
    }
    match lines.next().filter(|_| !may_skip) {
        Some(line) => Err(Failure::Task(format!(
            "{PAGE}:{}: the command printed one more line than the page says\n  {line}",
            expected.line
        ))),
        None => Ok(()),
    }
}

/// A line without what differs between trainings: numbers become `#`, blanks count once, and falls have no causes.
fn form(line: &str) -> String {
    let line = line.replace("no fall in ", "0 falls in ").replace(" fall in ", " falls in ");
    let mut form = String::new();
    let mut characters = line.split_whitespace().collect::<Vec<_>>().join(" ").chars().collect::<Vec<_>>().into_iter();
    let mut next = characters.next();
    while let Some(character) = next {
        next = characters.next();
        let begins = form.is_empty() || form.ends_with([' ', '(', '-', ',']);
        if character.is_ascii_digit() || (character == '-' && begins && next.is_some_and(|next| next.is_ascii_digit()))
        {
            while next.is_some_and(|next| next.is_ascii_digit() || next == '.') {
                next = characters.next();
            }
            form.push('#');
        } else {
            form.push(character);
        }
    }
    match form.split_once(" episodes (") {
        Some((before, _)) => format!("{before} episodes."),
        None => form,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(lines: &[&'static str]) -> Block<'static> {
        Block { line: 1, language: "text", lines: lines.to_vec() }
    }

    #[test]
    fn numbers_differ_and_words_do_not() {
        let expected = text(&["a  1.25 m/s", ANYTHING, "z -3 falls"]);
        assert!(hold(&expected, "a -17 m/s\n\nb\nz 4.0 falls\n").is_ok());
        assert!(hold(&expected, "a 1.25 m\nz 4 falls\n").is_err());
        assert!(hold(&expected, "a 1.25 m/s\nb\n").is_err());
        assert!(hold(&expected, "a 1.25 m/s\nz 4 falls\nmore\n").is_err());
    }

    #[test]
    fn a_training_may_fall() {
        let page = form("`sine` (0.51 m/s), no fall in 20 episodes.");
        assert_eq!(page, form("`sine` (0.51 m/s), 3 falls in 4 episodes (2 rollover, 1 too_low)."));
        assert_eq!(page, form("`sine` (0.51 m/s), 1 fall in 4 episodes (1 rollover)."));
    }

    #[test]
    fn trainings_are_made_short() {
        let block = text(&["cargo canter train --out x", "cargo canter eval x"]);
        let script = shorter(&block);
        assert!(script.starts_with("cargo canter train --out x --set training.max_env_steps="), "{script}");
        assert!(script.ends_with("\ncargo canter eval x"), "{script}");
    }
}
