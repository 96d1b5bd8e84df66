//! Printing. A reader that goes away (`canter config | head`) is no error.

use std::io::Write;

/// How this program was called: what a printed command has to begin with.
pub fn program() -> String {
    // Set by `cargo canter`.
    std::env::var("CANTER_COMMAND").unwrap_or_else(|_| "canter".to_owned())
}

/// Prints a line to standard output.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stdout().lock(), "{text}");
}

/// Prints a line to standard error.
pub fn complain(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
