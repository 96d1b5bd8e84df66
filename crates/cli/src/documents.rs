//! Holds the code in the repository's pages against the program: what a reader types must be understood.
//!
//! A block of `sh` is made of commands. Those of canter are given to the program's own parser, those of `cargo xtask`
//! are checked by its own tests; every other one has to stand in [`NOT_CHECKED`], unless a test runs the page.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use clap::error::ErrorKind;

use crate::args::Cli;
use crate::markdown::{Block, blocks, links, spans};

/// Pages whose blocks a test runs, and which one.
const RUN: [(&str, &str); 3] = [
    ("docs/start.md", "xtask/src/start.rs, in `cargo xtask site --check`"),
    ("docs/python.md", "python/tests, in `cargo xtask python`"),
    ("docs/robots.md", "examples/4_bring_your_robot.sh"),
];

/// Page, how a command in it begins, and why nothing holds it against a program.
const NOT_CHECKED: [(&str, &str, &str); 11] = [
    ("CONTRIBUTING.md", "bench/run --quick", "every benchmark; run by hand before a release"),
    ("bench/README.md", "bench/run", "hours; `bench/run --quick` is run by hand before a release"),
    ("docs/cluster.md", "apt-get install", "Debian's; `cargo xtask test --full` installs the same packages"),
    ("docs/cluster.md", "cargo build --release --package canter --features mpi", "`cargo xtask test --full` builds it"),
    ("docs/cluster.md", "RUN=", "the script for Slurm: no Slurm is at hand"),
    ("docs/cluster.md", "if [", "the script for Slurm"),
    ("docs/cluster.md", "WHAT=(", "the script for Slurm"),
    ("docs/cluster.md", "srun", "the script for Slurm; what canter gets stands in `WHAT`"),
    ("docs/doggo-model.md", "cargo run --release -p canter-bench --bin model_sensitivity", "minutes; cargo builds it"),
    ("firmware/cortex-m4f/README.md", "arm-none-eabi-gcc", "crates/export/tests/agreement.rs does the same"),
    ("firmware/cortex-m4f/README.md", "qemu-system-arm", "crates/export/tests/agreement.rs does the same"),
];

/// Code between words that begins like a command of canter and is none.
const NO_COMMANDS: [&str; 1] = ["canter 1 motors M control_dt_s S"];

/// Words of a shell that stand before or between commands.
const KEYWORDS: [&str; 6] = ["then", "else", "fi", "do", "done", "sudo"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The pages of the documentation site, by their path from the root. `cargo xtask site` holds that all of `docs/` is there.
fn pages() -> Vec<(String, String)> {
    const SUMMARY: &str = "docs/SUMMARY.md";
    let summary = fs::read_to_string(root().join(SUMMARY)).unwrap();
    let page = |link: &str| {
        let path = link.strip_prefix("../").map_or_else(|| format!("docs/{link}"), str::to_owned);
        let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|error| panic!("{SUMMARY}: {path}: {error}"));
        (path, text)
    };
    let pages: Vec<_> = links(&summary).into_iter().map(|link| page(&summary[link])).collect();
    assert!(pages.len() > 30, "only {} pages were found", pages.len());
    pages
}

/// The commands of a block, with their lines: words as a shell would see them, without variables being replaced.
fn commands(block: &Block<'_>) -> Vec<(usize, Vec<String>)> {
    let mut commands = Vec::new();
    let mut line = String::new();
    let mut here_document: Option<String> = None;
    let mut start = block.line + 1;
    for (index, text) in block.lines.iter().enumerate() {
        if let Some(end) = &here_document {
            if text.trim() == end {
                here_document = None;
                start = block.line + index + 2;
            }
            continue;
        }
        if let Some(begun) = text.strip_suffix('\\') {
            line += begun;
            continue;
        }
        line += text;
        if let Some((_, end)) = line.split_once("<<") {
            here_document = Some(end.trim().trim_matches(['\'', '"', '-']).to_owned());
        }
        commands.extend(split(&line).into_iter().map(|words| (start, words)));
        line.clear();
        start = block.line + index + 2;
    }
    commands
}

/// One line's simple commands, without redirections, comments and keywords.
fn split(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![Vec::new()];
    let (mut word, mut quote): (Option<String>, Option<char>) = (None, None);
    let mut is_redirected = false;
    for character in line.chars().chain(['\n']) {
        match (quote, character) {
            (Some(open), _) if character == open => quote = None,
            (None, '\'' | '"') => {
                quote = Some(character);
                word.get_or_insert_default();
            }
            (None, '#') if word.is_none() => break,
            (None, ' ' | '\n' | '|' | '&' | ';' | '>' | '<') => {
                if let Some(word) = word.take()
                    && !std::mem::take(&mut is_redirected)
                    && !(commands.last().is_some_and(Vec::is_empty) && KEYWORDS.contains(&word.as_str()))
                {
                    commands.last_mut().unwrap().push(word);
                }
                match character {
                    '|' | '&' | ';' => commands.push(Vec::new()),
                    '>' | '<' => is_redirected = true,
                    _ => {}
                }
            }
            _ => word.get_or_insert_default().push(character),
        }
    }
    commands.retain(|command| !command.is_empty());
    commands
}

/// What canter gets, if the command calls it, by whatever path and launcher.
fn arguments_of_canter(words: &[String]) -> Option<&[String]> {
    let words = match words {
        [mpirun, _n, _number, rest @ ..] if mpirun == "mpirun" => rest,
        _ => words,
    };
    match words {
        [cargo, alias, rest @ ..] if cargo == "cargo" && alias == "canter" => Some(rest),
        [program, rest @ ..] if program == "canter" || program.ends_with("/canter") => Some(rest),
        _ => None,
    }
}

fn parse(words: &[String]) -> Result<Cli, clap::Error> {
    Cli::try_parse_from([OsStr::new("canter")].into_iter().chain(words.iter().map(OsStr::new)))
}

/// The first line of what the parser has to say, or nothing if it is content.
fn complaint(words: &[String], is_allowed: impl Fn(ErrorKind) -> bool) -> Option<String> {
    let error = parse(words).err().filter(|error| !is_allowed(error.kind()))?;
    Some(error.to_string().lines().next().unwrap_or_default().to_owned())
}

fn asks_for_text(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::DisplayHelp | ErrorKind::DisplayVersion)
}

/// Words like RUN and F stand for something; a mention need not be complete.
fn is_fine_in_a_mention(kind: ErrorKind) -> bool {
    asks_for_text(kind)
        || matches!(
            kind,
            ErrorKind::MissingRequiredArgument
                | ErrorKind::MissingSubcommand
                | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
                | ErrorKind::InvalidValue
                | ErrorKind::ValueValidation
        )
}

#[test]
fn commands_in_blocks_are_understood() {
    let mut wrong = Vec::new();
    let mut num_parsed = 0;
    let mut used = [false; NOT_CHECKED.len()];
    for (page, text) in pages() {
        for block in blocks(&text).iter().filter(|block| block.language.split(' ').next() == Some("sh")) {
            for (line, words) in commands(block) {
                let typed = words.join(" ");
                let excuse = NOT_CHECKED.iter().position(|(of, start, _)| *of == page && typed.starts_with(start));
                if let Some(excuse) = excuse {
                    used[excuse] = true;
                } else if let Some(arguments) = arguments_of_canter(&words) {
                    num_parsed += 1;
                    wrong.extend(
                        complaint(arguments, asks_for_text).map(|what| format!("{page}:{line}: `{typed}`: {what}")),
                    );
                } else if !typed.starts_with("cargo xtask ") && !RUN.iter().any(|(run, _)| *run == page) {
                    wrong.push(format!("{page}:{line}: `{typed}`: no test knows it; see NOT_CHECKED in {}", file!()));
                }
            }
        }
    }
    wrong.extend(
        NOT_CHECKED
            .iter()
            .zip(used)
            .filter(|(_, used)| !used)
            .map(|((page, start, _), _)| format!("{page} has no `{start}` any more; see NOT_CHECKED in {}", file!())),
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(num_parsed > 30, "only {num_parsed} commands of canter were found");
}

#[test]
fn commands_between_words_have_the_names_that_they_are_given() {
    let mut wrong = Vec::new();
    let mut num_parsed = 0;
    for (page, text) in pages() {
        for (line, code) in spans(&text) {
            for words in split(&code) {
                let arguments = arguments_of_canter(&words).filter(|arguments| !arguments.is_empty());
                let Some(arguments) = arguments.filter(|_| !NO_COMMANDS.contains(&code.as_str())) else { continue };
                num_parsed += 1;
                wrong.extend(
                    complaint(arguments, is_fine_in_a_mention).map(|what| format!("{page}:{line}: `{code}`: {what}")),
                );
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(num_parsed > 30, "only {num_parsed} commands of canter were found");
}

#[test]
fn blocks_of_data_parse_and_other_languages_have_a_test() {
    let mut wrong = Vec::new();
    for (page, text) in pages() {
        for block in blocks(&text) {
            let content = block.lines.join("\n");
            let problem = match block.language.split(' ').next().unwrap_or_default() {
                "toml" => toml::from_str::<toml::Table>(&content).err().map(|error| error.to_string()),
                "json" => serde_json::from_str::<serde_json::Value>(&content).err().map(|error| error.to_string()),
                // `sh` above; `text` is what a program prints or a formula.
                "sh" | "text" => None,
                "python" if RUN.iter().any(|(run, _)| *run == page) => None,
                other => Some(format!("no test reads `{other}`; add one to {}", file!())),
            };
            wrong.extend(problem.map(|problem| format!("{page}:{}: {problem}", block.line)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn lines_are_split_as_a_shell_would() {
    let words = |line| split(line).into_iter().map(|words| words.join("|")).collect::<Vec<_>>();
    assert_eq!(words("a 'b c' --d=\"e f\" # g"), ["a|b c|--d=e f"]);
    assert_eq!(words("a > b && sudo c | d"), ["a", "c", "d"]);
    let block = Block { line: 7, language: "sh", lines: vec!["a \\", "  b", "cat > f <<'C'", "no command", "C", "d"] };
    let lines: Vec<_> = commands(&block).into_iter().map(|(line, words)| (line, words.join(" "))).collect();
    assert_eq!(lines, [(8, "a b".to_owned()), (10, "cat".to_owned()), (13, "d".to_owned())]);
}
