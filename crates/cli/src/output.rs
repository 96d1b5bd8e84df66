//! Printing. A reader that goes away (`canter config | head`) is no error.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::ValueEnum;
use serde_json::{Value, json};

/// How a command tells what it does: in sentences for a person, or as one JSON object a line for a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    // Doc comments here would double the length of every help that has the option.
    Text,
    Json,
}

/// Whether everything that is printed is JSON.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// Chooses the form of everything that is printed from now on.
pub fn set_log_format(format: LogFormat) {
    IS_JSON.store(format == LogFormat::Json, Ordering::Relaxed);
}

fn is_json() -> bool {
    IS_JSON.load(Ordering::Relaxed)
}

/// Prints what happened as JSON with `event` for its kind; nothing for a person, who is told in other words.
pub fn event(kind: &str, content: impl FnOnce() -> Value) {
    if is_json() {
        let _ = writeln!(std::io::stdout().lock(), "{}", json!({ "event": kind, kind: content() }));
    }
}

/// How this program was called: what a printed command has to begin with.
pub fn program() -> String {
    // Set by `cargo canter`.
    std::env::var("CANTER_COMMAND").unwrap_or_else(|_| "canter".to_owned())
}

/// Prints a line to standard output.
pub fn say(text: &str) {
    if is_json() {
        event("message", || text.trim().into());
    } else {
        let _ = writeln!(std::io::stdout().lock(), "{}", harmless(text));
    }
}

/// Prints a line to standard error.
pub fn complain(text: &str) {
    if is_json() {
        let text = text.trim();
        // What ends the program begins with this word.
        let (kind, text) = text.strip_prefix(ERROR).map_or(("warning", text), |text| ("error", text));
        let _ = writeln!(std::io::stderr().lock(), "{}", json!({ "event": kind, kind: text }));
    } else {
        let _ = writeln!(std::io::stderr().lock(), "{}", harmless(text));
    }
}

/// The text without what would command a terminal: a message may quote a file that somebody else has made.
fn harmless(text: &str) -> String {
    let is_harmless = |character: char| !character.is_control() || "\n\t".contains(character);
    let mut harmless = String::with_capacity(text.len());
    for character in text.chars() {
        if is_harmless(character) {
            harmless.push(character);
        } else {
            harmless.extend(character.escape_default());
        }
    }
    harmless
}

/// What the message that ends the program begins with.
pub const ERROR: &str = "error: ";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_shown_instead() {
        assert_eq!(harmless("a\tb\n\u{1b}[2Jc\u{7}é"), "a\tb\n\\u{1b}[2Jc\\u{7}é");
    }
}
