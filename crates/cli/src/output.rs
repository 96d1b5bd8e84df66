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
        let _ = writeln!(std::io::stdout().lock(), "{text}");
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
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

/// What the message that ends the program begins with.
pub const ERROR: &str = "error: ";
