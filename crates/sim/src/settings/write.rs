//! Settings written as TOML.

use super::limits::Limits;
use super::setting::Setting;
use super::shape::{Field, Shape};

/// Widest line of comments and arrays, in characters.
const MAX_COLUMNS: usize = 100;

/// What to write for a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Nothing: an `Option` that is `None`.
    Absent,
    /// A value in TOML.
    Text(String),
    /// An array.
    Array(Vec<Output>),
    /// A table.
    Table {
        /// The value of the key `kind` of a tagged table.
        kind: Option<&'static str>,
        /// The other keys, in declared order.
        entries: Vec<(&'static str, Output)>,
    },
}

impl Output {
    /// A table with these keys.
    pub fn table(entries: Vec<(&'static str, Self)>) -> Self {
        Self::Table { kind: None, entries }
    }

    /// The same table with the key `kind`.
    pub fn with_kind(self, kind: &'static str) -> Self {
        match self {
            Self::Table { entries, .. } => Self::Table { kind: Some(kind), entries },
            other => other,
        }
    }

    /// Whether this is written under a header, `[key]` or `[[key]]`, and so has to come after the plain values.
    fn has_header(&self) -> bool {
        match self {
            Self::Table { .. } => true,
            Self::Array(elements) => {
                !elements.is_empty() && elements.iter().all(|element| matches!(element, Self::Table { .. }))
            }
            _ => false,
        }
    }

    /// The value on one line.
    fn inline(&self) -> String {
        match self {
            Self::Absent => String::new(),
            Self::Text(text) => text.clone(),
            Self::Array(elements) => {
                let elements: Vec<String> = elements.iter().map(Self::inline).collect();
                format!("[{}]", elements.join(", "))
            }
            Self::Table { kind, entries } => {
                let kind = kind.iter().map(|kind| format!("kind = {}", quote(kind)));
                let others = entries
                    .iter()
                    .filter(|(_, value)| *value != Self::Absent)
                    .map(|(key, value)| format!("{key} = {}", value.inline()));
                let entries: Vec<String> = kind.chain(others).collect();
                format!("{{ {} }}", entries.join(", "))
            }
        }
    }
}

/// A complete TOML file of `settings`, each value after its doc comment and its range; reads back as `settings`.
pub fn write_commented<T: Setting>(settings: &T) -> String {
    write(settings, true)
}

/// A complete TOML file of `settings` without comments; reads back as `settings`.
pub fn write_plain<T: Setting>(settings: &T) -> String {
    write(settings, false)
}

fn write<T: Setting>(settings: &T, with_comments: bool) -> String {
    let mut writer = Writer { text: String::new(), with_comments };
    writer.table(&T::shape(&Limits::none()), &settings.write(), "");
    writer.text
}

struct Writer {
    text: String,
    with_comments: bool,
}

impl Writer {
    /// The keys of the table at `path`: first those on a line of their own, then those with a header.
    fn table(&mut self, shape: &Shape, output: &Output, path: &str) {
        let Output::Table { kind, entries } = output else {
            return;
        };
        let mut fields = &shape.fields;
        if let Some(kind) = kind {
            self.line(&Field::kind(shape), &Output::Text(quote(kind)));
            if let Some(choice) = shape.choices.iter().find(|choice| choice.name == *kind) {
                fields = &choice.fields;
            }
        }
        // `fields` and `entries` come from one declaration, so they have the same keys in the same order.
        let pairs = || fields.iter().zip(entries.iter().map(|(_, value)| value));
        for (field, value) in pairs().filter(|(_, value)| !value.has_header()) {
            self.line(field, value);
        }
        for (field, value) in pairs().filter(|(_, value)| value.has_header()) {
            let path = if path.is_empty() { field.key.to_owned() } else { format!("{path}.{}", field.key) };
            self.tables(field, value, &path);
        }
    }

    /// `key = value`
    fn line(&mut self, field: &Field, value: &Output) {
        self.comment(field);
        let key = field.key;
        if *value == Output::Absent {
            if self.with_comments {
                self.text.push_str(&format!("# {key} is optional and not set.\n"));
            }
            return;
        }
        let line = format!("{key} = {}", value.inline());
        match value {
            Output::Array(elements) if line.chars().count() > MAX_COLUMNS => {
                let elements: Vec<String> = elements.iter().map(|element| element.inline() + ",").collect();
                let lines = fill(elements.iter().map(String::as_str), "    ");
                self.text.push_str(&format!("{key} = [\n{lines}]\n"));
            }
            _ => self.text.push_str(&format!("{line}\n")),
        }
    }

    /// One `[path]` or several `[[path]]`, of which the first has the comments.
    fn tables(&mut self, field: &Field, value: &Output, path: &str) {
        let with_comments = self.with_comments;
        self.start_paragraph();
        self.comment(field);
        match value {
            Output::Array(elements) => {
                for (index, element) in elements.iter().enumerate() {
                    if index > 0 {
                        self.start_paragraph();
                    }
                    self.text.push_str(&format!("[[{path}]]\n"));
                    self.table(&field.shape, element, path);
                    self.with_comments = false;
                }
            }
            table => {
                self.text.push_str(&format!("[{path}]\n"));
                self.table(&field.shape, table, path);
            }
        }
        self.with_comments = with_comments;
    }

    fn start_paragraph(&mut self) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
    }

    /// The doc comment, the choices and the range of a field.
    fn comment(&mut self, field: &Field) {
        if !self.with_comments {
            return;
        }
        // Lines of one paragraph are joined and wrapped again; an empty line or a list item begins a new one.
        let mut paragraph = Vec::new();
        let doc = field.full_doc();
        for line in doc.lines() {
            if line.is_empty() || line.starts_with("- ") {
                self.text.push_str(&fill(paragraph.drain(..), "# "));
            }
            if line.is_empty() {
                self.text.push_str("#\n");
            }
            paragraph.extend(line.split_whitespace());
        }
        self.text.push_str(&fill(paragraph.into_iter(), "# "));
        if !field.shape.range.is_empty() {
            self.text.push_str(&format!("# Range: {}.\n", field.shape.range));
        }
    }
}

/// `words` on lines that begin with `indent` and have at most [`MAX_COLUMNS`] characters.
fn fill<'a>(words: impl Iterator<Item = &'a str>, indent: &str) -> String {
    let mut lines = String::new();
    let mut num_columns = 0;
    for word in words {
        let num_chars = word.chars().count();
        if num_columns == 0 {
            lines.push_str(indent);
            num_columns = indent.len() + num_chars;
        } else if num_columns + 1 + num_chars > MAX_COLUMNS {
            lines.push('\n');
            lines.push_str(indent);
            num_columns = indent.len() + num_chars;
        } else {
            lines.push(' ');
            num_columns += 1 + num_chars;
        }
        lines.push_str(word);
    }
    if num_columns > 0 {
        lines.push('\n');
    }
    lines
}

/// `text` as a TOML string.
pub(super) fn quote(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04X}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
