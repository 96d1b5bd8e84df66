//! What may be written for a setting: for messages, comments and help.

use super::limits::Limits;
use super::setting::{Setting, quoted_list};

/// What may be written for a type.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// `number`, `integer`, `boolean`, `string`, `choice`, `table`, or `array of` one of these in plural.
    pub type_name: String,
    /// Limits in words, e.g. `from 0 to 1`; empty where there are none.
    pub range: String,
    /// Whether the key may be missing.
    pub is_optional: bool,
    /// The strings of a choice, or the values that `kind` has in a tagged table.
    pub choices: Vec<Choice>,
    /// The keys of a table.
    pub fields: Vec<Field>,
}

/// One of a closed list of strings.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// What is written.
    pub name: &'static str,
    /// The doc comment.
    pub doc: String,
    /// The further keys of a tagged table of this kind.
    pub fields: Vec<Field>,
}

/// A key of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The key.
    pub key: &'static str,
    /// The doc comment.
    pub doc: String,
    /// What may be written for it.
    pub shape: Shape,
}

impl Shape {
    /// The shape of a single value.
    pub fn scalar(type_name: &str, range: String) -> Self {
        Self { type_name: type_name.to_owned(), range, is_optional: false, choices: Vec::new(), fields: Vec::new() }
    }

    /// The shape of one of `choices`.
    pub fn choice(choices: Vec<Choice>) -> Self {
        Self { choices, ..Self::scalar("choice", String::new()) }
    }

    /// The shape of a table with the keys `fields`.
    pub fn table(fields: Vec<Field>) -> Self {
        Self { fields, ..Self::scalar("table", String::new()) }
    }

    /// The shape of a table whose `kind` is one of `choices`.
    pub fn tagged_table(choices: Vec<Choice>) -> Self {
        Self { choices, ..Self::scalar("table", String::new()) }
    }

    /// The shape of an array of such values.
    pub fn array(self) -> Self {
        let plural = match self.type_name.strip_prefix("array") {
            Some(rest) => format!("arrays{rest}"),
            None => format!("{}s", self.type_name),
        };
        Self { type_name: format!("array of {plural}"), ..self }
    }

    /// What a message says was expected, e.g. `a number from 0 to 1`.
    pub fn expected(&self) -> String {
        let article = if self.type_name.starts_with(['a', 'i']) { "an" } else { "a" };
        let names: Vec<&str> = self.choices.iter().map(|choice| choice.name).collect();
        match self.type_name.as_str() {
            "choice" => format!("one of {}", quoted_list(&names)),
            type_name if self.range.is_empty() => format!("{article} {type_name}"),
            type_name => format!("{article} {type_name} {}", self.range),
        }
    }

    /// Whether this is one or more tables, with a `kind`.
    pub(super) fn is_tagged(&self) -> bool {
        self.type_name.contains("table") && !self.choices.is_empty()
    }
}

impl Choice {
    /// The choice `name` without further keys.
    pub fn new(name: &'static str, doc: &str) -> Self {
        Self::with_fields(name, doc, Vec::new())
    }

    /// The choice `name` of a tagged table with the further keys `fields`.
    pub fn with_fields(name: &'static str, doc: &str, fields: Vec<Field>) -> Self {
        Self { name, doc: trim_lines(doc), fields }
    }
}

impl Field {
    /// The key `key` for settings of type `T`.
    pub fn new<T: Setting>(key: &'static str, doc: &str, limits: &Limits<T::Limit>) -> Self {
        Self { key, doc: trim_lines(doc), shape: T::shape(limits) }
    }

    /// The key `kind` of a table of shape `tagged`.
    pub(super) fn kind(tagged: &Shape) -> Self {
        Self { key: "kind", doc: String::new(), shape: Shape::choice(tagged.choices.clone()) }
    }

    /// The doc comment, then a line for each choice.
    pub(super) fn full_doc(&self) -> String {
        let mut lines: Vec<String> = Vec::new();
        if !self.doc.is_empty() {
            lines.push(self.doc.clone());
        }
        if !self.shape.is_tagged() {
            for choice in &self.shape.choices {
                let line = format!("- \"{}\": {}", choice.name, choice.doc);
                lines.push(line.trim_end_matches(": ").to_owned());
            }
        }
        lines.join("\n")
    }
}

/// A doc comment without the space that begins each line.
fn trim_lines(doc: &str) -> String {
    let lines: Vec<&str> = doc.lines().map(str::trim).collect();
    lines.join("\n").trim().to_owned()
}

/// One setting as help prints it.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Dotted key path, with `[]` for array elements: `legs[].foot`.
    pub key: String,
    /// The type, e.g. `optional number`.
    pub type_name: String,
    /// Limits or choices, e.g. `from 0 to 1`; empty where there are none.
    pub range: String,
    /// The doc comment, then a line for each choice.
    pub doc: String,
    /// The `kind` of table that has this key, e.g. `prior.kind = "sine"`; empty where every table has it.
    pub when: String,
}

/// Every setting of `T`, in declared order.
pub fn describe<T: Setting>() -> Vec<Description> {
    let mut descriptions = Vec::new();
    describe_table(&T::shape(&Limits::none()), "", "", &mut descriptions);
    descriptions
}

/// Adds the settings of a table whose keys begin with `prefix` and that is only there `when`.
fn describe_table(shape: &Shape, prefix: &str, when: &str, descriptions: &mut Vec<Description>) {
    if shape.is_tagged() {
        describe_field(&Field::kind(shape), prefix, when, descriptions);
        for choice in &shape.choices {
            let when = format!("{prefix}kind = \"{}\"", choice.name);
            for field in &choice.fields {
                describe_field(field, prefix, &when, descriptions);
            }
        }
    }
    for field in &shape.fields {
        describe_field(field, prefix, when, descriptions);
    }
}

fn describe_field(field: &Field, prefix: &str, when: &str, descriptions: &mut Vec<Description>) {
    let shape = &field.shape;
    let optional = if shape.is_optional { "optional " } else { "" };
    let names: Vec<&str> = shape.choices.iter().map(|choice| choice.name).collect();
    let range = if shape.is_tagged() { String::new() } else { quoted_list(&names) + &shape.range };
    descriptions.push(Description {
        key: format!("{prefix}{}", field.key),
        type_name: format!("{optional}{}", shape.type_name),
        range,
        doc: field.full_doc(),
        when: when.to_owned(),
    });
    let brackets = if shape.type_name.starts_with("array") { "[]" } else { "" };
    let prefix = format!("{prefix}{}{brackets}.", field.key);
    describe_table(shape, &prefix, when, descriptions);
}
