//! The dashboard's page, `crates/serve/web`: built with Node and npm, and then into the program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use crate::Failure;
use crate::full::finish;

/// What the page is made of, below `crates/serve/web`.
const SOURCES: [&str; 5] = ["src", "build.mjs", "package.json", "package-lock.json", "tsconfig.json"];

/// The oldest Node that builds the page.
const OLDEST_NODE: u32 = 18;

/// Whether npm can be called, with a Node that is new enough.
pub fn has_npm() -> bool {
    let ask = |program| Command::new(program).arg("--version").output().ok().filter(|output| output.status.success());
    let node = ask("node").map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
    // v18.20.8
    let major = node.trim_start_matches('v').split('.').next().and_then(|major| major.parse::<u32>().ok());
    ask("npm").is_some() && major.is_some_and(|major| major >= OLDEST_NODE)
}

/// Builds the page if it is missing or older than what it is made of. Where there is no npm, nothing is built: the program
/// works without its page, and says how to get it.
///
/// # Errors
/// What npm says.
pub fn ensure_where_npm_is(root: &Path) -> Result<(), Failure> {
    if !has_npm() {
        eprintln!("without Node {OLDEST_NODE} and npm the program has no page for `canter serve`, and says so there");
        return Ok(());
    }
    let web = folder(root);
    let built = modified(&web.join("dist").join("index.html"));
    let newest = SOURCES.iter().filter_map(|source| newest(&web.join(source))).max();
    if built.is_some() && built >= newest { Ok(()) } else { build(root) }
}

/// The same, for who wants the program in any case: a page that cannot be built is said, and no more.
pub fn try_to_ensure(root: &Path) {
    if let Err(Failure::Task(message)) = ensure_where_npm_is(root) {
        eprintln!("warning: {message}\nThe program starts with the page that was built last, if there is one.");
    }
}

/// Builds the page.
///
/// # Errors
/// If npm is missing, or says why it failed.
pub fn build(root: &Path) -> Result<(), Failure> {
    if !has_npm() {
        return Err(Failure::Task(
            "the dashboard's page needs Node 18 or newer and npm (Debian 12 and newer: `sudo apt-get install -y nodejs npm`)"
                .to_owned(),
        ));
    }
    eprintln!("Building the dashboard's page with npm ...");
    npm(root, &["ci", "--no-audit", "--no-fund"], "npm could not fetch the page's libraries; check the network")?;
    npm(root, &["run", "build"], "the page could not be built")
}

/// Checks the page's types and runs its unit tests.
///
/// # Errors
/// What npm says.
pub fn test(root: &Path) -> Result<(), Failure> {
    npm(root, &["run", "check"], "the page's types are wrong")?;
    npm(root, &["test"], "the page's tests fail")
}

/// The page's script, once it is built.
pub fn script(root: &Path) -> PathBuf {
    folder(root).join("dist").join("assets").join("app.js")
}

/// The file with the licences of the libraries in the page, once it is built.
pub fn licences(root: &Path) -> PathBuf {
    folder(root).join("dist").join("assets").join("licences.txt")
}

fn npm(root: &Path, arguments: &[&str], problem: &str) -> Result<(), Failure> {
    let mut npm = Command::new("npm");
    npm.args(arguments).current_dir(folder(root));
    finish(npm, problem).map(drop)
}

fn folder(root: &Path) -> PathBuf {
    root.join("crates").join("serve").join("web")
}

/// When the newest file in there was written.
fn newest(path: &Path) -> Option<SystemTime> {
    if path.is_dir() {
        fs::read_dir(path).ok()?.flatten().filter_map(|entry| newest(&entry.path())).max()
    } else {
        modified(path)
    }
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|data| data.modified()).ok()
}
