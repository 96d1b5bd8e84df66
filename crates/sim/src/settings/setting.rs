//! What a type must do to be a setting, and the types that are.

use super::limits::Limits;
use super::problems::{ProblemKind, Problems};
use super::shape::{Choice, Shape};
use super::tree::{Item, Value, join_path};
use super::write::{Output, quote};

/// A type that can be read from TOML, described, and written as TOML.
///
/// Implemented here for numbers, `bool`, `String`, `Option` and `Vec`; by the macros for structs and enums.
pub trait Setting: Sized {
    /// The number type that limits of this setting have; `()` where there are none.
    type Limit;

    /// The value of `node`, or `None` after at least one problem was reported.
    fn read(node: &Node<'_>, limits: &Limits<Self::Limit>, problems: &mut Problems) -> Option<Self>;

    /// What to write for this value.
    fn write(&self) -> Output;

    /// What may be written for this type.
    fn shape(limits: &Limits<Self::Limit>) -> Shape;

    /// The value when the key is missing; `None` where that is an error.
    fn absent() -> Option<Self> {
        None
    }
}

/// A value and its dotted key path: what [`Setting::read`] reads.
#[derive(Debug)]
pub struct Node<'a> {
    pub(super) item: &'a Item,
    pub(super) path: String,
    /// Whether the table's `kind` was already used to select its type, see `tagged!`.
    has_tag: bool,
}

impl<'a> Node<'a> {
    pub(super) fn new(item: &'a Item, path: String) -> Self {
        Self { item, path, has_tag: false }
    }

    /// Whether this is a table; if so, keys that are not in `known` are reported.
    pub fn check_keys(&self, known: &[&str], problems: &mut Problems) -> Option<()> {
        let Value::Table(entries) = &self.item.value else {
            problems.report(self, ProblemKind::WrongType, "expected a table");
            return None;
        };
        for (key, item) in entries {
            let is_tag = self.has_tag && key == "kind";
            if !is_tag && !known.contains(&key.as_str()) {
                let message = match nearest(key, known) {
                    Some(name) => format!("did you mean \"{name}\"?"),
                    None if known.is_empty() => "there are no keys here".to_owned(),
                    None => format!("the keys here are {}", quoted_list(known)),
                };
                problems.report_unknown(self, key, item, message);
            }
        }
        Some(())
    }

    /// The value of `key` in this table, or `None` after at least one problem was reported.
    pub fn field<T: Setting>(&self, key: &str, limits: &Limits<T::Limit>, problems: &mut Problems) -> Option<T> {
        match self.item.get(key) {
            Some(item) => T::read(&Node::new(item, join_path(&self.path, key)), limits, problems),
            None => {
                let absent = T::absent();
                if absent.is_none() {
                    let message = format!("expected {}", T::shape(limits).expected());
                    problems.report_missing(self, key, message);
                }
                absent
            }
        }
    }

    /// The string of this node, which must be one of `choices`.
    pub fn choice(&self, choices: &[Choice], problems: &mut Problems) -> Option<&'a str> {
        let names: Vec<&str> = choices.iter().map(|choice| choice.name).collect();
        let mut message = format!("expected one of {}", quoted_list(&names));
        match &self.item.value {
            Value::String(text) if names.contains(&text.as_str()) => return Some(text),
            Value::String(text) => {
                if let Some(name) = nearest(text, &names) {
                    message += &format!("; did you mean \"{name}\"?");
                }
                problems.report(self, ProblemKind::UnknownChoice, message);
            }
            _ => problems.report(self, ProblemKind::WrongType, message),
        }
        None
    }

    /// The `kind` of this table, which must be one of `choices`, and the table that remains to be read.
    pub fn tag(&self, choices: &[Choice], problems: &mut Problems) -> Option<(&'a str, Self)> {
        let Value::Table(entries) = &self.item.value else {
            problems.report(self, ProblemKind::WrongType, "expected a table");
            return None;
        };
        let Some(kind) = entries.get("kind") else {
            let names: Vec<&str> = choices.iter().map(|choice| choice.name).collect();
            problems.report_missing(self, "kind", format!("expected one of {}", quoted_list(&names)));
            return None;
        };
        let kind = Node::new(kind, join_path(&self.path, "kind")).choice(choices, problems)?;
        let table = Self { item: self.item, path: self.path.clone(), has_tag: true };
        Some((kind, table))
    }

    /// Reports that this is not what `shape` expects.
    fn refuse(&self, kind: ProblemKind, shape: &Shape, problems: &mut Problems) {
        problems.report(self, kind, format!("expected {}", shape.expected()));
    }
}

/// `"a", "b", "c"`
pub(super) fn quoted_list(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| quote(name)).collect();
    quoted.join(", ")
}

/// The name of `known` that `wrong` may have been meant to be.
fn nearest<'k>(wrong: &str, known: &[&'k str]) -> Option<&'k str> {
    /// Jaro-Winkler similarity from which two names count as near; 1 is equal.
    const NEAR: f64 = 0.8;
    known
        .iter()
        .map(|name| (strsim::jaro_winkler(wrong, name), *name))
        .filter(|(similarity, _)| *similarity >= NEAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

macro_rules! float_setting {
    ($type:ident) => {
        impl Setting for $type {
            type Limit = $type;

            fn read(node: &Node<'_>, limits: &Limits<$type>, problems: &mut Problems) -> Option<Self> {
                let value = match node.item.value {
                    Value::Float(value) => value as $type,
                    Value::Integer(value) => value as $type,
                    _ => {
                        node.refuse(ProblemKind::WrongType, &Self::shape(limits), problems);
                        return None;
                    }
                };
                if !value.is_finite() {
                    node.refuse(ProblemKind::NotFinite, &Self::shape(limits), problems);
                    return None;
                }
                if !limits.contains(value) {
                    node.refuse(ProblemKind::OutOfRange, &Self::shape(limits), problems);
                    return None;
                }
                Some(value)
            }

            fn write(&self) -> Output {
                // `Debug` prints the shortest digits that read back as the same value, and always a point or exponent.
                Output::Text(format!("{self:?}").to_lowercase())
            }

            fn shape(limits: &Limits<$type>) -> Shape {
                Shape::scalar("number", limits.text())
            }
        }
    };
}
float_setting!(f32);
float_setting!(f64);

macro_rules! integer_setting {
    ($type:ident) => {
        impl Setting for $type {
            type Limit = $type;

            fn read(node: &Node<'_>, limits: &Limits<$type>, problems: &mut Problems) -> Option<Self> {
                let Value::Integer(value) = node.item.value else {
                    node.refuse(ProblemKind::WrongType, &Self::shape(limits), problems);
                    return None;
                };
                match $type::try_from(value) {
                    Ok(value) if limits.contains(value) => Some(value),
                    _ => {
                        let limits = limits.closed($type::MIN, $type::MAX);
                        node.refuse(ProblemKind::OutOfRange, &Self::shape(&limits), problems);
                        None
                    }
                }
            }

            fn write(&self) -> Output {
                Output::Text(self.to_string())
            }

            fn shape(limits: &Limits<$type>) -> Shape {
                Shape::scalar("integer", limits.text())
            }
        }
    };
}
integer_setting!(u32);
integer_setting!(u64);
integer_setting!(usize);
integer_setting!(i64);

impl Setting for bool {
    type Limit = ();

    fn read(node: &Node<'_>, limits: &Limits<()>, problems: &mut Problems) -> Option<Self> {
        match node.item.value {
            Value::Boolean(value) => Some(value),
            _ => {
                node.refuse(ProblemKind::WrongType, &Self::shape(limits), problems);
                None
            }
        }
    }

    fn write(&self) -> Output {
        Output::Text(self.to_string())
    }

    fn shape(_: &Limits<()>) -> Shape {
        Shape::scalar("boolean", String::new())
    }
}

impl Setting for String {
    type Limit = ();

    fn read(node: &Node<'_>, limits: &Limits<()>, problems: &mut Problems) -> Option<Self> {
        match &node.item.value {
            Value::String(text) => Some(text.clone()),
            _ => {
                node.refuse(ProblemKind::WrongType, &Self::shape(limits), problems);
                None
            }
        }
    }

    fn write(&self) -> Output {
        Output::Text(quote(self))
    }

    fn shape(_: &Limits<()>) -> Shape {
        Shape::scalar("string", String::new())
    }
}

impl<T: Setting> Setting for Option<T> {
    type Limit = T::Limit;

    fn read(node: &Node<'_>, limits: &Limits<T::Limit>, problems: &mut Problems) -> Option<Self> {
        T::read(node, limits, problems).map(Some)
    }

    fn write(&self) -> Output {
        self.as_ref().map_or(Output::Absent, T::write)
    }

    fn shape(limits: &Limits<T::Limit>) -> Shape {
        Shape { is_optional: true, ..T::shape(limits) }
    }

    fn absent() -> Option<Self> {
        Some(None)
    }
}

impl<T: Setting> Setting for Vec<T> {
    type Limit = T::Limit;

    fn read(node: &Node<'_>, limits: &Limits<T::Limit>, problems: &mut Problems) -> Option<Self> {
        let Value::Array(items) = &node.item.value else {
            node.refuse(ProblemKind::WrongType, &Self::shape(limits), problems);
            return None;
        };
        // Every element is read before the first bad one makes the whole `None`, so that all problems are reported.
        let mut elements = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let element = Node::new(item, format!("{}[{index}]", node.path));
            elements.push(T::read(&element, limits, problems));
        }
        elements.into_iter().collect()
    }

    fn write(&self) -> Output {
        Output::Array(self.iter().map(T::write).collect())
    }

    fn shape(limits: &Limits<T::Limit>) -> Shape {
        T::shape(limits).array()
    }
}
