//! A settings file: parsed, overridden, then read as a settings struct.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::de::{DeTable, DeValue};

use super::limits::Limits;
use super::problems::{Place, Problem, ProblemKind, Problems};
use super::setting::{Node, Setting};
use super::tree::{Converter, Item, MAX_DEPTH, Source, Tree, parse_path};
use super::write::quote;
use crate::file;

/// A settings file of more bytes is a mistake: the largest preset has a few kilobytes.
pub(crate) const MAX_FILE_BYTES: usize = 1 << 20;

/// A parsed TOML file, whose values can be overridden before it is read as a settings struct.
#[derive(Debug, Clone)]
pub struct Document {
    tree: Arc<Tree>,
    /// The file, if it was read from one.
    path: Option<PathBuf>,
    /// What is wrong with the overrides; reported with what is wrong with the values.
    bad_overrides: Vec<Problem>,
}

impl Document {
    /// The file at `path`.
    ///
    /// # Errors
    ///
    /// As [`Document::parse`], or the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, Problems> {
        let name = path.display().to_string();
        match file::read(path, MAX_FILE_BYTES as u64) {
            Ok(bytes) => Ok(Self { path: Some(path.to_owned()), ..Self::parse(&name, &bytes)? }),
            Err(error) => Err(whole_file(&name, ProblemKind::Unreadable, error.to_string())),
        }
    }

    /// The document that `bytes` hold; `name` is what positions print as the file.
    ///
    /// # Errors
    ///
    /// The bytes are too many, not UTF-8 or not TOML, or a value is nested too deep or too long.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, Problems> {
        if bytes.len() > MAX_FILE_BYTES {
            let message = format!("expected at most {MAX_FILE_BYTES} bytes");
            return Err(whole_file(name, ProblemKind::FileTooLarge, message));
        }
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let message = format!("the byte at offset {} belongs to no character", error.valid_up_to());
                return Err(whole_file(name, ProblemKind::NotUtf8, message));
            }
        };
        let source = Source { name: name.to_owned(), text: text.to_owned(), is_file: true };
        let mut converter = Converter::new(&source, 0, Vec::new());
        let root = match DeTable::parse(text) {
            Ok(table) => converter.item(DeValue::Table(table.into_inner()), 0..0),
            Err(error) => {
                converter.syntax_problem(&error);
                Item::empty_table(0)
            }
        };
        let file_problems = converter.problems;
        let document =
            Self { tree: Arc::new(Tree { sources: vec![source], root }), path: None, bad_overrides: Vec::new() };
        let mut problems = document.problems();
        file_problems.into_iter().for_each(|problem| problems.push(problem));
        problems.finish(document)
    }

    /// Replaces the value at the dotted path `key`, e.g. `legs[2].foot`, by `value`: TOML, or a bare word for a string.
    ///
    /// What is wrong with either is reported by the next [`Document::read`], together with what is wrong with the file.
    pub fn set(&mut self, key: &str, value: &str) {
        let tree = Arc::make_mut(&mut self.tree);
        let source = Source {
            name: format!("--set {key}={value}"),
            text: if is_bare_word(value) { quote(value) } else { value.to_owned() },
            is_file: false,
        };
        let source_index = tree.sources.len();
        let steps = parse_path(key).filter(|steps| steps.len() <= MAX_DEPTH);
        let mut converter = Converter::new(&source, source_index, steps.clone().unwrap_or_default());
        match (steps, DeValue::parse(&source.text)) {
            (None, _) => {
                let message = "expected a key like ppo.gamma or legs[2].foot";
                converter.problem(0, ProblemKind::BadOverride, message);
            }
            (_, Err(error)) => converter.syntax_problem(&error),
            (Some(steps), Ok(value)) => {
                let span = value.span();
                let item = converter.item(value.into_inner(), span);
                match tree.root.slot(&steps, source_index) {
                    Ok(slot) => *slot = item,
                    Err(message) => converter.problem(0, ProblemKind::BadOverride, message),
                }
            }
        }
        self.bad_overrides.append(&mut converter.problems);
        tree.sources.push(source);
    }

    /// Replaces the value at the dotted path `key` by a string, whatever characters it has.
    pub fn set_string(&mut self, key: &str, value: &str) {
        self.set(key, &quote(value));
    }

    /// Whether the document has a value at the dotted path `key`, known or not.
    pub fn has(&self, key: &str) -> bool {
        self.tree.nearest(key).1
    }

    /// The folder that a relative path at `key` counts from: that of the file it was written in. None for a value of an
    /// override or of a document that is no file: the working directory.
    pub fn folder_of(&self, key: &str) -> Option<&Path> {
        let (item, _) = self.tree.nearest(key);
        let is_in_file = self.tree.place(item.value_start()).position.is_some();
        self.path.as_deref().filter(|_| is_in_file)?.parent()
    }

    /// The settings in this document.
    ///
    /// # Errors
    ///
    /// Everything that is wrong: unknown and missing keys, wrong types, values out of range, bad overrides.
    pub fn read<T: Setting>(&self) -> Result<T, Problems> {
        self.read_checked(|_, _| {})
    }

    /// The settings in this document, if `check` finds nothing wrong either; it sees only settings that are each valid.
    ///
    /// # Errors
    ///
    /// As [`Document::read`], and whatever `check` adds with [`Problems::at`].
    pub fn read_checked<T: Setting>(&self, check: impl FnOnce(&T, &mut Problems)) -> Result<T, Problems> {
        let mut problems = self.problems();
        for problem in &self.bad_overrides {
            problems.push(problem.clone());
        }
        let root = Node::new(&self.tree.root, String::new());
        match T::read(&root, &Limits::none(), &mut problems) {
            Some(settings) => {
                check(&settings, &mut problems);
                problems.finish(settings)
            }
            None => Err(problems),
        }
    }

    /// No problems yet: for checks that come after reading, e.g. against a compiled model.
    pub fn problems(&self) -> Problems {
        Problems::new(Arc::clone(&self.tree))
    }
}

/// Whether the right side of an override is a string without its quotes: `trot`, `robots/doggo/robot.toml`.
fn is_bare_word(value: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || "_-./".contains(c);
    value.starts_with(|c: char| c.is_alphabetic() || "_./".contains(c))
        && value.chars().all(is_word)
        && DeValue::parse(value).is_err()
}

/// The problem of a file that cannot be parsed at all.
fn whole_file(name: &str, kind: ProblemKind, message: String) -> Problems {
    let tree = Tree { sources: Vec::new(), root: Item::empty_table(0) };
    let mut problems = Problems::new(Arc::new(tree));
    problems.push(Problem {
        place: Place { source: name.to_owned(), position: None },
        key: String::new(),
        found: String::new(),
        kind,
        message,
    });
    problems
}
