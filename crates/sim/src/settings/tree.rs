//! TOML values that know where they were written.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::de::{DeArray, DeInteger, DeTable, DeValue};

use super::problems::{MAX_PROBLEMS, Place, Problem, ProblemKind};
use super::write::quote;

/// Deepest nesting of tables and arrays; bounds the recursion of everything that walks the tree.
pub(super) const MAX_DEPTH: usize = 32;
/// Longest string and longest key.
const MAX_STRING_CHARS: usize = 4096;
/// A problem shows at most this many characters of a value.
const MAX_FOUND_CHARS: usize = 60;

/// A text that values were written in: the file, or the right side of one override.
#[derive(Debug, Clone)]
pub(super) struct Source {
    pub name: String,
    pub text: String,
    pub is_file: bool,
}

impl Source {
    /// The place of byte `start`.
    pub fn place(&self, start: usize) -> Place {
        let before = self.text.get(..start).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        let column = before[line_start..].chars().count() + 1;
        Place { source: self.name.clone(), position: self.is_file.then_some((line, column)) }
    }
}

/// A value and where it was written.
#[derive(Debug, Clone)]
pub(super) struct Item {
    /// Index into [`Tree::sources`].
    source: usize,
    /// First byte of the key, or of the value in an array.
    key_byte: usize,
    /// Bytes of the value, or of its header for a `[table]`.
    span: Range<usize>,
    pub value: Value,
}

/// A byte of a source.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    source: usize,
    byte: usize,
}

#[derive(Debug, Clone)]
pub(super) enum Value {
    Boolean(bool),
    Integer(i128),
    Float(f64),
    String(String),
    /// What no setting can be: a date, or a value that was refused.
    Other,
    Array(Vec<Item>),
    Table(BTreeMap<String, Item>),
}

impl Item {
    /// A table without keys, at the start of a source.
    pub fn empty_table(source: usize) -> Self {
        Self { source, key_byte: 0, span: 0..0, value: Value::Table(BTreeMap::new()) }
    }

    /// Where the value begins.
    pub fn value_start(&self) -> Start {
        Start { source: self.source, byte: self.span.start }
    }

    /// Where the key begins.
    pub fn key_start(&self) -> Start {
        Start { source: self.source, byte: self.key_byte }
    }

    /// The value of `key`, if this is a table that has it.
    pub fn get(&self, key: &str) -> Option<&Self> {
        match &self.value {
            Value::Table(entries) => entries.get(key),
            _ => None,
        }
    }

    /// The place at `steps` below this one, for an override to fill; missing tables on the way are added.
    ///
    /// # Errors
    ///
    /// A message when the steps lead into something that is no table or array, or past an array's end.
    pub fn slot(&mut self, steps: &[Step], source: usize) -> Result<&mut Self, String> {
        let mut item = self;
        for step in steps {
            item = match (step, &mut item.value) {
                (Step::Key(key), Value::Table(entries)) => {
                    entries.entry(key.clone()).or_insert_with(|| Self::empty_table(source))
                }
                (Step::Index(index), Value::Array(items)) => {
                    let num_items = items.len();
                    items
                        .get_mut(*index)
                        .ok_or_else(|| format!("index {index} is past the end of {num_items} elements"))?
                }
                (Step::Key(key), _) => return Err(format!("there is no table to hold \"{key}\"")),
                (Step::Index(index), _) => {
                    return Err(format!("there is no array to hold [{index}]"));
                }
            };
        }
        Ok(item)
    }
}

/// One step of a dotted key path.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Step {
    Key(String),
    Index(usize),
}

/// The steps of a path like `legs[2].foot`, or `None` if it is none.
pub(super) fn parse_path(path: &str) -> Option<Vec<Step>> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (key, indices) = part.split_at(part.find('[').unwrap_or(part.len()));
        if !is_bare_key(key) || !(indices.is_empty() || indices.ends_with(']')) {
            return None;
        }
        steps.push(Step::Key(key.to_owned()));
        for index in indices.split_terminator(']') {
            steps.push(Step::Index(index.strip_prefix('[')?.parse().ok()?));
        }
    }
    Some(steps)
}

/// Whether TOML allows this key without quotes.
pub(super) fn is_bare_key(key: &str) -> bool {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    !key.is_empty() && key.chars().all(is_bare)
}

/// The dotted path of `key` in the table at `path`.
pub(super) fn join_path(path: &str, key: &str) -> String {
    let key = if is_bare_key(key) { key.to_owned() } else { quote(key) };
    if path.is_empty() { key } else { format!("{path}.{key}") }
}

/// The dotted path of `steps`.
fn format_path(steps: &[Step]) -> String {
    steps.iter().fold(String::new(), |path, step| match step {
        Step::Key(key) => join_path(&path, key),
        Step::Index(index) => format!("{path}[{index}]"),
    })
}

/// The values of a file and its overrides.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    /// The file, then the overrides.
    pub sources: Vec<Source>,
    pub root: Item,
}

impl Tree {
    /// The place of `start`.
    pub fn place(&self, start: Start) -> Place {
        self.sources[start.source].place(start.byte)
    }

    /// The value of `item` as it was written, shortened.
    pub fn found(&self, item: &Item) -> String {
        match item.value {
            Value::Table(_) => return "(a table)".to_owned(),
            Value::Array(_) => return "(an array)".to_owned(),
            _ => {}
        }
        let text = self.sources[item.source].text.get(item.span.clone()).unwrap_or("");
        let shown: String = text.chars().take_while(|c| !c.is_control()).take(MAX_FOUND_CHARS).collect();
        if shown == text { shown } else { shown + "..." }
    }

    /// The deepest value on the way to the dotted path `key`, and whether it is that of `key` itself.
    pub fn nearest(&self, key: &str) -> (&Item, bool) {
        let mut item = &self.root;
        for step in parse_path(key).unwrap_or_default() {
            let next = match (&item.value, step) {
                (Value::Table(entries), Step::Key(key)) => entries.get(&key),
                (Value::Array(items), Step::Index(index)) => items.get(index),
                _ => None,
            };
            match next {
                Some(next) => item = next,
                None => return (item, false),
            }
        }
        (item, !key.is_empty())
    }
}

/// Turns the values of one source into [`Item`]s and collects what no setting may be.
pub(super) struct Converter<'a> {
    source: &'a Source,
    source_index: usize,
    /// The way from the root to the value at hand; formatted only for a problem.
    path: Vec<Step>,
    /// What was refused.
    pub problems: Vec<Problem>,
}

impl<'a> Converter<'a> {
    /// For values written in `source`, which is or will be number `source_index` of the tree, below `path`.
    pub fn new(source: &'a Source, source_index: usize, path: Vec<Step>) -> Self {
        Self { source, source_index, path, problems: Vec::new() }
    }

    /// Adds a problem with the value at hand, at byte `start`.
    pub fn problem(&mut self, start: usize, kind: ProblemKind, message: impl Into<String>) {
        // One more than is kept, so that `Problems` knows that there are more.
        if self.problems.len() <= MAX_PROBLEMS {
            self.problems.push(Problem {
                place: self.source.place(start),
                key: format_path(&self.path),
                found: String::new(),
                kind,
                message: message.into(),
            });
        }
    }

    /// Adds the parser's problem.
    pub fn syntax_problem(&mut self, error: &toml::de::Error) {
        let start = error.span().map_or(0, |span| span.start);
        self.problem(start, ProblemKind::Syntax, error.message().replace('\n', " "));
    }

    /// The item of `value`; what is refused becomes [`Value::Other`].
    pub fn item(&mut self, value: DeValue<'_>, span: Range<usize>) -> Item {
        let start = span.start;
        let value = match value {
            DeValue::Boolean(value) => Value::Boolean(value),
            DeValue::Integer(integer) => self.integer(&integer, start),
            DeValue::Float(float) => float.as_str().parse().map_or(Value::Other, Value::Float),
            DeValue::String(text) => self.string(&text, start),
            DeValue::Datetime(_) => Value::Other,
            DeValue::Array(_) | DeValue::Table(_) if self.path.len() >= MAX_DEPTH => {
                let message = format!("expected at most {MAX_DEPTH} tables and arrays inside each other");
                self.problem(start, ProblemKind::TooDeep, message);
                Value::Other
            }
            DeValue::Array(values) => self.array(values),
            DeValue::Table(entries) => self.table(entries),
        };
        Item { source: self.source_index, key_byte: start, span, value }
    }

    fn integer(&mut self, integer: &DeInteger<'_>, start: usize) -> Value {
        match i128::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(value) => Value::Integer(value),
            Err(_) => {
                self.problem(start, ProblemKind::TooLong, "expected an integer of 64 bits");
                Value::Other
            }
        }
    }

    fn string(&mut self, text: &str, start: usize) -> Value {
        if text.chars().count() > MAX_STRING_CHARS {
            let message = format!("expected at most {MAX_STRING_CHARS} characters");
            self.problem(start, ProblemKind::TooLong, message);
        }
        Value::String(text.to_owned())
    }

    fn array(&mut self, values: DeArray<'_>) -> Value {
        let mut items = Vec::with_capacity(values.len());
        for (index, value) in values.into_iter().enumerate() {
            self.path.push(Step::Index(index));
            let span = value.span();
            items.push(self.item(value.into_inner(), span));
            self.path.pop();
        }
        Value::Array(items)
    }

    fn table(&mut self, entries: DeTable<'_>) -> Value {
        let mut items = BTreeMap::new();
        for (key, value) in entries {
            let key_byte = key.span().start;
            let key = key.into_inner().into_owned();
            if key.chars().count() > MAX_STRING_CHARS {
                let message = format!("expected keys of at most {MAX_STRING_CHARS} characters");
                self.problem(key_byte, ProblemKind::TooLong, message);
                continue;
            }
            self.path.push(Step::Key(key.clone()));
            let span = value.span();
            let mut item = self.item(value.into_inner(), span);
            item.key_byte = key_byte;
            items.insert(key, item);
            self.path.pop();
        }
        Value::Table(items)
    }
}
