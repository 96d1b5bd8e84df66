//! The commit that the program is built from, as `canter --version` says it. No time of the build, no path, no host:
//! equal commits give equal programs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the program is made of, from the repository's root. Changes elsewhere, in pages or tests, are none of the program.
const SOURCES: [&str; 13] = [
    "crates/*/src",
    "crates/*/Cargo.toml",
    "crates/*/build.rs",
    "crates/*/build",
    "crates/*/templates",
    "crates/*/web/src",
    "crates/*/web/build.mjs",
    "crates/*/web/package.json",
    "crates/*/web/package-lock.json",
    "presets",
    "robots",
    "Cargo.toml",
    "Cargo.lock",
];

/// As long as a person can say it and Git finds it.
const NUM_DIGITS: usize = 7;

/// A commit, and what it was found in.
#[derive(Debug)]
pub struct Stamp {
    /// `b0ff85c 2026-11-25`, `b0ff85c+changes 2026-11-25`, without the date where Git's program is missing, or empty.
    pub commit: String,
    /// Files and folders that change when the commit or the sources do.
    pub depends_on: Vec<PathBuf>,
}

/// The stamp for the repository at `root`: what was given, or what Git's program says, or what Git's files say; empty
/// outside of a repository.
pub fn of(root: &Path, given: Option<&str>, git: &str) -> Stamp {
    if let Some(given) = given.map(str::trim).filter(|given| !given.is_empty()) {
        return Stamp { commit: given.lines().next().unwrap_or_default().to_owned(), depends_on: Vec::new() };
    }
    // A repository around this folder is somebody else's: only what lies at the root counts.
    let Some(folder) = git_folder(root) else { return Stamp { commit: String::new(), depends_on: Vec::new() } };
    let commit = ask_git(root, git).or_else(|| read_commit(&folder).map(|hash| short(&hash))).unwrap_or_default();
    let depends_on = [places_of_head(&folder), places_of_sources(root)].concat();
    Stamp { commit, depends_on }
}

/// The folder with HEAD: `.git`, or what the file `.git` of a worktree names.
fn git_folder(root: &Path) -> Option<PathBuf> {
    let git = root.join(".git");
    if git.is_dir() {
        return Some(git);
    }
    let file = fs::read_to_string(&git).ok()?;
    Some(root.join(file.strip_prefix("gitdir:")?.trim()))
}

/// Where references lie: with the repository, also for a worktree.
fn common_folder(folder: &Path) -> PathBuf {
    match fs::read_to_string(folder.join("commondir")) {
        Ok(common) => folder.join(common.trim()),
        Err(_) => folder.to_path_buf(),
    }
}

fn ask_git(root: &Path, git: &str) -> Option<String> {
    let ask = |arguments: &[&str]| {
        let mut git = Command::new(git);
        // A hook's environment names another repository.
        git.env_remove("GIT_DIR").env_remove("GIT_WORK_TREE").env_remove("GIT_INDEX_FILE");
        // Looking must not write the index.
        git.arg("--no-optional-locks").arg("-C").arg(root).args(arguments);
        let output = git.output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let shown = ask(&["show", "--no-patch", "--no-show-signature", "--format=%H %cs", "HEAD"])?;
    let (hash, date) = shown.split_once(' ')?;
    let pathspecs = SOURCES.map(|source| format!(":(glob){source}/**"));
    let files = SOURCES.map(|source| format!(":(glob){source}"));
    let mut status = vec!["status", "--porcelain", "--untracked-files=all", "--"];
    status.extend(pathspecs.iter().chain(&files).map(String::as_str));
    let changes = if ask(&status)?.is_empty() { "" } else { "+changes" };
    Some(format!("{}{changes} {date}", short(hash)))
}

/// HEAD's commit, from Git's files alone.
fn read_commit(folder: &Path) -> Option<String> {
    let head = fs::read_to_string(folder.join("HEAD")).ok()?;
    let Some(reference) = head.trim().strip_prefix("ref: ") else { return a_hash(head.trim()) };
    let common = common_folder(folder);
    if let Ok(loose) = fs::read_to_string(common.join(reference)) {
        return a_hash(loose.trim());
    }
    let packed = fs::read_to_string(common.join("packed-refs")).ok()?;
    packed
        .lines()
        .find_map(|line| line.split_once(' ').filter(|(_, name)| *name == reference))
        .and_then(|(hash, _)| a_hash(hash))
}

fn a_hash(text: &str) -> Option<String> {
    (text.len() >= 40 && text.bytes().all(|byte| byte.is_ascii_hexdigit())).then(|| text.to_owned())
}

fn short(hash: &str) -> String {
    hash.chars().take(NUM_DIGITS).collect()
}

/// What changes when HEAD moves. Cargo takes a file that is not there for changed at every build, so only what is there.
fn places_of_head(folder: &Path) -> Vec<PathBuf> {
    let common = common_folder(folder);
    let mut places =
        vec![folder.join("HEAD"), folder.join("logs/HEAD"), common.join("packed-refs"), common.join("reftable")];
    let head = fs::read_to_string(folder.join("HEAD")).unwrap_or_default();
    if let Some(reference) = head.trim().strip_prefix("ref: ") {
        let loose = common.join(reference);
        // The next commit makes the file of a packed reference.
        if !loose.is_file() && !folder.join("logs/HEAD").is_file() {
            places.extend(loose.parent().map(Path::to_path_buf));
        }
        places.push(loose);
    }
    places.retain(|place| place.exists());
    places
}

/// [`SOURCES`] that are there.
fn places_of_sources(root: &Path) -> Vec<PathBuf> {
    let mut places = Vec::new();
    for source in SOURCES {
        match source.split_once("/*/") {
            None => places.push(root.join(source)),
            Some((folder, rest)) => {
                let entries = fs::read_dir(root.join(folder)).into_iter().flatten().flatten();
                places.extend(entries.map(|entry| entry.path().join(rest)));
            }
        }
    }
    places.retain(|place| place.exists());
    places.sort();
    places
}
