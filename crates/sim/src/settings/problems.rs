//! What is wrong with a file: every problem, where it is, and what was expected.

use std::fmt;
use std::sync::Arc;

use super::setting::Node;
use super::tree::{Item, Start, Tree, join_path};

/// Problems beyond this many are not kept: they cost time and nobody reads them.
pub(super) const MAX_PROBLEMS: usize = 50;

/// Where a value was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file's name, or the override as typed: `--set ppo.gamma=0.95`.
    pub source: String,
    /// Line and column in the file, both from 1; columns count characters. `None` for an override and a whole file.
    pub position: Option<(usize, usize)>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Some((line, column)) => write!(f, "{}:{line}:{column}", self.source),
            None => write!(f, "{}", self.source),
        }
    }
}

/// What sort of mistake it is. Printed, it is the middle of the sentence that reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ProblemKind {
    /// The file cannot be opened or read.
    #[error("cannot be read")]
    Unreadable,
    /// The file has more bytes than a settings file may have.
    #[error("file too large")]
    FileTooLarge,
    /// The file has bytes that are not UTF-8.
    #[error("not UTF-8")]
    NotUtf8,
    /// The text is not TOML.
    #[error("not valid TOML")]
    Syntax,
    /// A string has more characters, or an integer more digits, than a setting may have.
    #[error("is too long")]
    TooLong,
    /// Tables or arrays are nested deeper than settings may be.
    #[error("is nested too deep")]
    TooDeep,
    /// No setting has this key.
    #[error("is not a known key")]
    UnknownKey,
    /// A setting that must be there is not.
    #[error("is missing")]
    MissingKey,
    /// For example a string where a number belongs.
    #[error("has the wrong type")]
    WrongType,
    /// A number outside its limits.
    #[error("is out of range")]
    OutOfRange,
    /// Infinite or not a number.
    #[error("is not finite")]
    NotFinite,
    /// A string that is none of the choices.
    #[error("is not a known choice")]
    UnknownChoice,
    /// An override whose key leads nowhere.
    #[error("cannot be set")]
    BadOverride,
    /// A value that is fine alone but not with the others; reported with [`Problems::at`].
    #[error("is refused")]
    Refused,
}

/// One mistake in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where it is.
    pub place: Place,
    /// Dotted key path, e.g. `legs[2].foot`; empty for the whole file.
    pub key: String,
    /// The value as written, shortened; empty if there is none to show.
    pub found: String,
    /// What sort of mistake it is.
    pub kind: ProblemKind,
    /// What was expected, or what to do.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.place)?;
        match (self.key.as_str(), self.found.as_str()) {
            ("", _) => {}
            (key, "") => write!(f, "{key} ")?,
            (key, found) => write!(f, "{key} = {found} ")?,
        }
        write!(f, "{}: {}", self.kind, self.message)
    }
}

/// All mistakes of one file and its overrides, sorted by position.
#[derive(Clone)]
pub struct Problems {
    tree: Arc<Tree>,
    list: Vec<Problem>,
    has_more: bool,
}

impl Problems {
    pub(super) fn new(tree: Arc<Tree>) -> Self {
        Self { tree, list: Vec::new(), has_more: false }
    }

    /// Adds a problem with the value at the dotted path `key` (e.g. `legs[2].foot`), for checks that
    /// span several values.
    ///
    /// The position is the value's, or that of the nearest table around it if the file has no such key.
    pub fn at(&mut self, key: &str, message: impl Into<String>) {
        let tree = Arc::clone(&self.tree);
        let (item, is_exact) = tree.nearest(key);
        let shown = is_exact.then_some(item);
        self.add(item.value_start(), shown, key.to_owned(), ProblemKind::Refused, message.into());
    }

    /// Adds a problem with the value of `node`, for a [`Setting::read`](super::Setting::read).
    pub fn report(&mut self, node: &Node<'_>, kind: ProblemKind, message: impl Into<String>) {
        let item = node.item;
        self.add(item.value_start(), Some(item), node.path.clone(), kind, message.into());
    }

    /// Adds the problem that the table `node` has no `key`.
    pub(super) fn report_missing(&mut self, node: &Node<'_>, key: &str, message: String) {
        let path = join_path(&node.path, key);
        self.add(node.item.value_start(), None, path, ProblemKind::MissingKey, message);
    }

    /// Adds the problem that the table `node` must not have `key`, whose value is `item`.
    pub(super) fn report_unknown(&mut self, node: &Node<'_>, key: &str, item: &Item, message: String) {
        let path = join_path(&node.path, key);
        self.add(item.key_start(), Some(item), path, ProblemKind::UnknownKey, message);
    }

    /// Adds a problem at `start`, showing the value of `shown`.
    fn add(&mut self, start: Start, shown: Option<&Item>, key: String, kind: ProblemKind, message: String) {
        // A position costs a walk over the file, so none is looked up for a problem that is not kept.
        self.has_more |= self.list.len() == MAX_PROBLEMS;
        if !self.has_more {
            self.push(Problem {
                place: self.tree.place(start),
                key,
                found: shown.map_or(String::new(), |item| self.tree.found(item)),
                kind,
                message,
            });
        }
    }

    /// Adds a problem.
    pub(super) fn push(&mut self, problem: Problem) {
        self.has_more |= self.list.len() == MAX_PROBLEMS;
        if !self.has_more {
            let sort_key = |problem: &Problem| (problem.place.position.is_none(), problem.place.position);
            let index = self.list.partition_point(|other| sort_key(other) <= sort_key(&problem));
            self.list.insert(index, problem);
        }
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The problems, those of the file by position, then those of the overrides. At most 50 are kept.
    pub fn iter(&self) -> impl Iterator<Item = &Problem> {
        self.list.iter()
    }

    /// `value` if nothing is wrong.
    ///
    /// # Errors
    ///
    /// These problems, if there are any.
    pub fn finish<T>(self, value: T) -> Result<T, Self> {
        if self.is_empty() { Ok(value) } else { Err(self) }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.list.iter().map(Problem::to_string).collect();
        write!(f, "{}", lines.join("\n"))?;
        if self.has_more {
            write!(f, "\nmore than {MAX_PROBLEMS} problems")?;
        } else if lines.len() > 1 {
            write!(f, "\n{} problems", lines.len())?;
        }
        Ok(())
    }
}

/// Like `Display`, so that an `unwrap` in a test or an example shows something readable.
impl fmt::Debug for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl std::error::Error for Problems {}
