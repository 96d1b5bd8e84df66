//! What is wrong with a robot, or looks wrong: loading, masses, limits, and whether it stands.
//!
//! Loading refuses what cannot be; a checkup also finds what can be and hardly is meant. Every finding has a name, a
//! place and a remedy. Whether the robot walks is for the caller to try: gaits are measured elsewhere.

mod model;
mod origin;
mod standing;

use std::path::Path;

use super::{Loaded, ModelProblems, Robot, RobotError, load_model};
use crate::file;
use crate::settings::{Document, MAX_FILE_BYTES, Problems};
pub use origin::Origin;
use origin::Origins;
pub use standing::Standing;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The robot cannot be used so.
    Error,
    /// It can, but its numbers will hardly be those of the real robot.
    Warning,
}

impl Severity {
    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

/// Something that is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// The kind of fault, for example `placeholder-inertia`; `docs/robots.md` lists them.
    pub fault: &'static str,
    /// Where it is written.
    pub origin: Origin,
    /// What is wrong.
    pub message: String,
    /// What to do; empty if the message says it.
    pub remedy: String,
}

/// What a checkup has found.
pub struct Checkup {
    /// Everything that is wrong, errors first, each kind in the order of the files.
    pub findings: Vec<Finding>,
    /// The robot, if it can be loaded.
    pub robot: Option<Robot>,
    /// How it stands, if it can be loaded.
    pub standing: Option<Standing>,
    settings: Option<Document>,
    origins: Origins,
}

impl Checkup {
    /// Where a key of `robot.toml` is written.
    pub fn origin_of(&self, key: &str) -> Origin {
        let Some(document) = &self.settings else { return self.origins.model() };
        let mut problems = document.problems();
        problems.at(key, "");
        of_settings(&problems).next().map_or_else(|| self.origins.model(), |(origin, _)| origin)
    }

    /// Adds what somebody else has found, in its place.
    pub fn add(&mut self, finding: Finding) {
        self.findings.push(finding);
        self.findings.sort_by(|a, b| (a.severity, &a.origin).cmp(&(b.severity, &b.origin)));
    }
}

/// Each problem's place and words.
fn of_settings(problems: &Problems) -> impl Iterator<Item = (Origin, String)> + use<> {
    let list: Vec<_> = problems.iter().cloned().collect();
    list.into_iter().map(|problem| {
        let line = problem.place.position.map(|(line, _)| line);
        let text = problem.to_string();
        let words = text.strip_prefix(&format!("{}: ", problem.place)).unwrap_or(&text).to_owned();
        (Origin { file: problem.place.source, line }, words)
    })
}

/// Looks through a robot, given by its name or by the path of its `robot.toml`; or through a model's file alone.
pub fn checkup(name_or_path: &str) -> Checkup {
    let is_model =
        super::screen::MODEL_EXTENSIONS.iter().any(|extension| name_or_path.ends_with(&format!(".{extension}")));
    let mut checkup =
        Checkup { findings: Vec::new(), robot: None, standing: None, settings: None, origins: Origins::default() };
    if is_model {
        check_model_file(Path::new(name_or_path), &mut checkup);
    } else {
        match Robot::load_with_sources(name_or_path) {
            Ok(loaded) => check_loaded(loaded, &mut checkup),
            Err(error) => {
                report_error(&error, name_or_path, &mut checkup);
                // The model may tell more.
                if let (RobotError::Settings(_), Some(path)) = (&error, model_of(name_or_path)) {
                    check_model_file(&path, &mut checkup);
                }
            }
        }
    }
    checkup.findings.sort_by(|a, b| (a.severity, &a.origin).cmp(&(b.severity, &b.origin)));
    checkup
}

/// The model that a `robot.toml` names, however wrong the rest of it is.
fn model_of(path: &str) -> Option<std::path::PathBuf> {
    let bytes = file::read(Path::new(path), MAX_FILE_BYTES as u64).ok()?;
    let value: toml::Table = String::from_utf8(bytes).ok()?.parse().ok()?;
    Some(Path::new(path).with_file_name(value.get("model")?.as_str()?))
}

fn check_loaded(loaded: Loaded, checkup: &mut Checkup) {
    let Loaded { robot, document, files, texts } = loaded;
    checkup.origins = match texts {
        Some((shown, text)) => Origins::of_text(shown, text),
        None => Origins::of_files(&files, shown),
    };
    checkup.settings = Some(document);
    let anatomy = robot.model.anatomy();
    let mut findings = model::check(&anatomy, &checkup.origins);
    findings.extend(model::check_robot(&robot, &anatomy, checkup));
    let (standing, found) = standing::check(&robot, &anatomy, checkup);
    findings.extend(found);
    checkup.findings = findings;
    checkup.standing = Some(standing);
    checkup.robot = Some(robot);
}

fn check_model_file(path: &Path, checkup: &mut Checkup) {
    match load_model(path) {
        Ok((model, files)) => {
            checkup.origins = Origins::of_files(&files, shown);
            let anatomy = model.anatomy();
            checkup.findings.extend(model::check(&anatomy, &checkup.origins));
            checkup.findings.extend(model::check_bare(&anatomy, &checkup.origins));
        }
        Err(error) => report_error(&error, &path.display().to_string(), checkup),
    }
}

/// A file's path as the user may know it: from the working directory if it is there.
fn shown(path: &Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    path.strip_prefix(&here).unwrap_or(path).display().to_string()
}

/// Every problem of a robot that cannot be loaded.
fn report_error(error: &RobotError, path: &str, checkup: &mut Checkup) {
    let mut add = |origin: Origin, message: String| {
        let remedy = String::new();
        checkup.findings.push(Finding { severity: Severity::Error, fault: "cannot-load", origin, message, remedy });
    };
    match error {
        RobotError::Settings(problems) => {
            of_settings(problems).for_each(|(origin, message)| add(origin, message));
        }
        RobotError::Files(problems) => {
            ModelProblems::iter(problems).for_each(|(file, line, message)| {
                add(Origin { file: file.to_owned(), line }, message.to_owned());
            });
        }
        RobotError::Model { path, message } => {
            // "... line 12": MuJoCo's way to say where.
            let after = message.rsplit_once("line ").map(|(_, rest)| rest);
            let number = |rest: &str| rest.split(|c: char| !c.is_ascii_digit()).next().and_then(|n| n.parse().ok());
            let line = after.and_then(number);
            add(Origin { file: path.clone(), line }, format!("MuJoCo cannot load this model: {message}"));
        }
        RobotError::Unknown { .. } | RobotError::Unreadable { .. } => {
            add(Origin { file: path.to_owned(), line: None }, error.to_string());
        }
    }
}
