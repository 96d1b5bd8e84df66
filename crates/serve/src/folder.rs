//! The folder with the runs: what is in it, and which of its files may be read.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::Serialize;

use crate::error::ServeError;

/// How deep runs may lie: a sweep's are two folders below it, and people sort theirs into folders.
const MAX_DEPTH: usize = 6;

/// Of more runs the oldest are left out.
const MAX_RUNS: usize = 1000;

/// So much of what is left out is said.
const MAX_LEFT_OUT: usize = 20;

/// What a training writes, and so tells how old a run is.
const WRITTEN: [&str; 3] = ["config.toml", "metrics.jsonl", "eval.json"];

/// More folders are not looked into.
const MAX_FOLDERS: usize = 20_000;

/// The folder that is served.
#[derive(Debug)]
pub struct Folder {
    /// As the user gave it.
    name: String,
    /// Absolute and without links: no file outside is read.
    root: PathBuf,
}

/// A folder below it whose files may be read: a run directory, a comparison, a sweep.
#[derive(Debug)]
pub struct Place {
    /// Path below the folder, with `/` between names; `.` for the folder itself.
    pub id: String,
    /// Absolute.
    path: PathBuf,
    /// Of the served folder.
    root: PathBuf,
}

/// A comparison or a sweep.
#[derive(Debug, Serialize)]
pub struct Report {
    /// As a run's.
    pub id: String,
    /// `comparison` or `sweep`.
    pub kind: &'static str,
}

/// All that is in the folder.
#[derive(Debug, Default)]
pub struct Found {
    /// Run directories.
    pub runs: Vec<Place>,
    /// Comparisons and sweeps that have a page.
    pub reports: Vec<Report>,
    /// What is not listed, and why.
    pub left_out: Vec<String>,
}

/// Why something is not shown.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// No run has this name.
    #[error("there is no run `{0}` here")]
    NoRun(String),
    /// A name that leads out of the folder.
    #[error("`{0}` is outside the folder that is served")]
    Outside(String),
    /// Not there, or not readable.
    #[error("{0}: {1}")]
    File(String, io::Error),
    /// Larger than what is read.
    #[error("{0} is too large to be shown: {1} bytes")]
    TooLarge(String, u64),
    /// No JSON where there should be.
    #[error("{0}: {1}")]
    NotJson(String, String),
}

impl Refusal {
    /// HTTP's status.
    pub fn status(&self) -> u16 {
        match self {
            Self::NoRun(_) => 404,
            Self::Outside(_) => 403,
            Self::File(_, error) if error.kind() == io::ErrorKind::NotFound => 404,
            Self::File(..) => 500,
            Self::TooLarge(..) => 413,
            Self::NotJson(..) => 422,
        }
    }
}

impl Folder {
    /// # Errors
    /// If it is not there, or no folder.
    pub fn open(path: &Path) -> Result<Self, ServeError> {
        let root = path.canonicalize().map_err(|source| ServeError::Folder { path: path.to_owned(), source })?;
        if !root.is_dir() {
            return Err(ServeError::NotAFolder(path.to_owned()));
        }
        Ok(Self { name: path.display().to_string(), root })
    }

    /// As the user gave it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The run of this name.
    ///
    /// # Errors
    /// If there is none below the folder.
    pub fn run(&self, id: &str) -> Result<Place, Refusal> {
        let place = self.place(id)?;
        if is_run(&place.path) { Ok(place) } else { Err(Refusal::NoRun(id.to_owned())) }
    }

    /// The folder of this name, whatever is in it.
    ///
    /// # Errors
    /// If there is none below the folder.
    pub fn place(&self, id: &str) -> Result<Place, Refusal> {
        if id.is_empty() {
            return Err(Refusal::NoRun(String::new()));
        }
        if id != "." && !leads_down(id) {
            return Err(Refusal::Outside(id.to_owned()));
        }
        let path = self.root.join(id).canonicalize().map_err(|_| Refusal::NoRun(id.to_owned()))?;
        if !path.starts_with(&self.root) {
            return Err(Refusal::Outside(id.to_owned()));
        }
        Ok(Place { id: id.to_owned(), path, root: self.root.clone() })
    }

    /// Looks for runs and reports. Links are not followed. Of too many runs the newest are listed.
    pub fn list(&self) -> Found {
        let mut found = Found::default();
        let mut runs = Vec::new();
        let mut num_folders = 0;
        let mut to_visit = vec![(self.root.clone(), 0)];
        while let Some((path, depth)) = to_visit.pop() {
            num_folders += 1;
            if num_folders > MAX_FOLDERS {
                found.left_out.push(format!(
                    "what lies in more than {MAX_FOLDERS} folders; name one with fewer: `canter serve FOLDER`"
                ));
                break;
            }
            let Some(id) = self.id_of(&path) else {
                found.left_out.push(format!("{}: its name is no text", path.display()));
                continue;
            };
            if is_run(&path) {
                runs.push((age(&path), Place { id, path, root: self.root.clone() }));
                continue;
            }
            if path.join("report.html").is_file() {
                let has = |name| path.join(name).is_file();
                let kind = if has("compare.json") { Some("comparison") } else { has("sweep.json").then_some("sweep") };
                found.reports.extend(kind.map(|kind| Report { id, kind }));
            }
            match subfolders(&path) {
                Ok(inside) => {
                    found.left_out.extend(inside.links.iter().map(|link| format!("{}: a link", link.display())));
                    if depth == MAX_DEPTH && !inside.folders.is_empty() {
                        found.left_out.push(format!("{}: what lies deeper than {MAX_DEPTH} folders", path.display()));
                    } else {
                        to_visit.extend(inside.folders.into_iter().map(|folder| (folder, depth + 1)));
                    }
                }
                Err(error) => found.left_out.push(format!("{}: {error}", path.display())),
            }
        }
        runs.sort_by_key(|(age, _)| *age);
        if runs.len() > MAX_RUNS {
            found.left_out.push(format!("{} older runs", runs.len() - MAX_RUNS));
        }
        found.runs = runs.into_iter().take(MAX_RUNS).map(|(_, run)| run).collect();
        found.reports.sort_by(|a, b| a.id.cmp(&b.id));
        let num_more = found.left_out.len().saturating_sub(MAX_LEFT_OUT);
        if num_more > 0 {
            found.left_out.truncate(MAX_LEFT_OUT);
            found.left_out.push(format!("and {num_more} more"));
        }
        found
    }

    /// The name by which the page asks for a folder; `None` where it is no UTF-8.
    fn id_of(&self, path: &Path) -> Option<String> {
        let below = path.strip_prefix(&self.root).ok()?;
        let parts: Option<Vec<&str>> = below.iter().map(OsStr::to_str).collect();
        let id = parts?.join("/");
        Some(if id.is_empty() { ".".to_owned() } else { id })
    }
}

impl Place {
    /// A file in it, opened. `name` may have a folder in it, and may come from anywhere.
    ///
    /// # Errors
    /// If it is not there, is no ordinary file, or lies outside the served folder.
    pub fn open(&self, name: &str) -> Result<File, Refusal> {
        let cannot = |error| Refusal::File(name.to_owned(), error);
        let path = self.path.join(name).canonicalize().map_err(cannot)?;
        if !leads_down(name) || !path.starts_with(&self.root) {
            return Err(Refusal::Outside(name.to_owned()));
        }
        // Opening a pipe would wait for its writer.
        if !fs::metadata(&path).map_err(cannot)?.is_file() {
            return Err(cannot(io::Error::new(io::ErrorKind::InvalidInput, "this is no ordinary file")));
        }
        File::open(path).map_err(cannot)
    }

    /// The whole of a file.
    ///
    /// # Errors
    /// As [`Self::open`], and if it is larger than `max_bytes`.
    pub fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, Refusal> {
        let mut bytes = Vec::new();
        let file = self.open(name)?;
        let cannot = |error| Refusal::File(name.to_owned(), error);
        file.take(max_bytes + 1).read_to_end(&mut bytes).map_err(cannot)?;
        let length = bytes.len() as u64;
        if length > max_bytes { Err(Refusal::TooLarge(name.to_owned(), length)) } else { Ok(bytes) }
    }

    /// Time since a training wrote into it last.
    pub fn age(&self) -> Duration {
        age(&self.path)
    }

    /// The names of the recorded gaits, the learned one first.
    pub fn trajectories(&self) -> Vec<String> {
        let folder = self.path.join("trajectories").canonicalize().ok().filter(|folder| folder.starts_with(&self.root));
        let entries = folder.and_then(|folder| fs::read_dir(folder).ok()).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".json").map(str::to_owned)).collect();
        names.sort_by_key(|name| (name != "learned", name.clone()));
        names
    }
}

/// Whether a name is a way down from where it counts.
fn leads_down(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
}

/// What `canter train` makes before its first iteration.
fn is_run(path: &Path) -> bool {
    path.join("config.toml").is_file() && (path.join("lock").is_file() || path.join("metrics.jsonl").is_file())
}

/// Time since the newest of the files that a training writes.
fn age(run: &Path) -> Duration {
    let modified = |name| fs::metadata(run.join(name)).and_then(|data| data.modified()).ok();
    let newest = WRITTEN.into_iter().filter_map(modified).max().unwrap_or(SystemTime::UNIX_EPOCH);
    // Another machine's clock may be ahead.
    SystemTime::now().duration_since(newest).unwrap_or_default()
}

/// What is in a folder: hidden things are passed over.
struct Inside {
    folders: Vec<PathBuf>,
    /// Links to folders.
    links: Vec<PathBuf>,
}

fn subfolders(path: &Path) -> io::Result<Inside> {
    let mut inside = Inside { folders: Vec::new(), links: Vec::new() };
    for entry in fs::read_dir(path)?.flatten() {
        let Ok(kind) = entry.file_type() else { continue };
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        if kind.is_dir() {
            inside.folders.push(entry.path());
        } else if kind.is_symlink() && entry.path().is_dir() {
            inside.links.push(entry.path());
        }
    }
    Ok(inside)
}
