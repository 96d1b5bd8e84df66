//! Where in a model's files something is written.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use crate::file;
use crate::robot::screen::{MAX_MODEL_BYTES, MODEL_EXTENSIONS};
use crate::robot::xml::{Lines, without_comments};

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    /// The file.
    pub file: String,
    /// The line, from 1; none for the whole file.
    pub line: Option<usize>,
}

/// An element of a model's file.
struct Element {
    file: usize,
    line: usize,
    tag: String,
    attributes: Vec<(String, String)>,
    parent: Option<usize>,
}

impl Element {
    fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }
}

/// The elements of all files of a model.
#[derive(Default)]
pub(super) struct Origins {
    files: Vec<String>,
    elements: Vec<Element>,
}

impl Origins {
    /// The elements of these files, those that are models; what cannot be read is left out.
    pub fn of_files(files: &[PathBuf], shown: impl Fn(&Path) -> String) -> Self {
        let mut origins = Self::default();
        for path in files {
            let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if !MODEL_EXTENSIONS.contains(&extension.as_str()) {
                continue;
            }
            let bytes = file::read(path, MAX_MODEL_BYTES).unwrap_or_default();
            origins.add(shown(path), &String::from_utf8_lossy(&bytes));
        }
        origins
    }

    /// The elements of one text.
    pub fn of_text(shown: String, text: &str) -> Self {
        let mut origins = Self::default();
        origins.add(shown, text);
        origins
    }

    fn add(&mut self, shown: String, text: &str) {
        let file = self.files.len();
        self.files.push(shown);
        let Ok(plain) = without_comments(text) else { return };
        if let Ok(document) = Document::parse(&plain) {
            self.add_element(document.root_element(), (file, None), &mut Lines::new(&plain));
        }
    }

    fn add_element(&mut self, node: Node<'_, '_>, (file, parent): (usize, Option<usize>), lines: &mut Lines<'_>) {
        let number = self.elements.len();
        self.elements.push(Element {
            file,
            line: lines.at(node.range().start),
            tag: node.tag_name().name().to_ascii_lowercase(),
            attributes: node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect(),
            parent,
        });
        for child in node.children().filter(Node::is_element) {
            self.add_element(child, (file, Some(number)), lines);
        }
    }

    fn place(&self, element: usize) -> Origin {
        let element = &self.elements[element];
        Origin { file: self.files[element.file].clone(), line: Some(element.line) }
    }

    /// The model's first file.
    pub fn model(&self) -> Origin {
        Origin { file: self.files.first().cloned().unwrap_or_default(), line: None }
    }

    /// The element of this name with one of these tags; `actuator` stands for all that can be in one.
    fn find(&self, tags: &[&str], name: &str) -> Option<usize> {
        let is_meant = |element: &Element| {
            let parent = element.parent.map(|parent| self.elements[parent].tag.as_str());
            let has_tag =
                tags.contains(&element.tag.as_str()) || (parent == Some("actuator") && tags.contains(&"actuator"));
            has_tag && element.attribute("name") == Some(name) && parent != Some("default")
        };
        self.elements.iter().position(is_meant)
    }

    /// Where the element of this name is; else the model's file.
    pub fn of(&self, tags: &[&str], name: &str) -> Origin {
        self.find(tags, name).map_or_else(|| self.model(), |element| self.place(element))
    }

    /// Where a body's inertia is written; else the body.
    pub fn of_inertia(&self, body: &str) -> Origin {
        let Some(body) = self.find(&["body", "link"], body) else { return self.model() };
        let is_inertia = |element: &Element| {
            let parent = element.parent;
            // In a URDF it is one deeper.
            let is_deeper = parent.is_some_and(|parent| self.elements[parent].parent == Some(body));
            (element.tag == "inertial" && parent == Some(body) && element.attribute("mass").is_some())
                || (element.tag == "inertia" && is_deeper)
        };
        self.place(self.elements.iter().position(is_inertia).unwrap_or(body))
    }

    /// Where one of these attributes of the named element is written: itself, or the default class that gives it; else the
    /// element.
    pub fn of_attribute(&self, (tags, name): (&[&str], &str), attributes: &[&str]) -> Origin {
        let Some(element) = self.find(tags, name) else { return self.model() };
        let has = |element: usize| attributes.iter().any(|name| self.elements[element].attribute(name).is_some());
        if has(element) {
            return self.place(element);
        }
        let above = |element: usize| std::iter::successors(Some(element), |&e| self.elements[e].parent);
        let own = self.elements[element].attribute("class");
        let class = own.or_else(|| above(element).skip(1).find_map(|e| self.elements[e].attribute("childclass")));
        let is_default = |e: &usize| self.elements[*e].tag == "default";
        let mut class = (0..self.elements.len()).filter(is_default).find(|&e| match class {
            Some(class) => self.elements[e].attribute("class") == Some(class),
            None => self.elements[e].parent.is_some_and(|parent| self.elements[parent].tag == "mujoco"),
        });
        while let Some(default) = class {
            let tag = &self.elements[element].tag;
            let gives = |&e: &usize| self.elements[e].parent == Some(default) && self.elements[e].tag == *tag && has(e);
            if let Some(found) = (0..self.elements.len()).find(gives) {
                return self.place(found);
            }
            class = self.elements[default].parent.filter(is_default);
        }
        self.place(element)
    }

    /// Where the first element of this tag is; else the model's file.
    pub fn of_tag(&self, tag: &str) -> Origin {
        let found = self.elements.iter().position(|element| element.tag == tag);
        found.map_or_else(|| self.model(), |element| self.place(element))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "<mujoco>\n<default>\n<joint damping='1'/>\n<default class='leg'>\n<position kp='9'/>\n</default>\n\
                        </default>\n<worldbody>\n<body name='a' childclass='leg'>\n<inertial mass='1'/>\n<joint name='j'/>\n\
                        </body>\n</worldbody>\n<actuator>\n<position name='p' class='leg'/>\n</actuator>\n</mujoco>";

    #[test]
    fn values_are_found_where_they_are_written() {
        let origins = Origins::of_text("x.xml".to_owned(), TEXT);
        let line = |origin: Origin| origin.line;
        assert_eq!(line(origins.of(&["actuator"], "p")), Some(15));
        assert_eq!(line(origins.of_attribute((&["actuator"], "p"), &["kp"])), Some(5));
        // By the class of the body, then by what that class is in.
        assert_eq!(line(origins.of_attribute((&["joint"], "j"), &["damping"])), Some(3));
        assert_eq!(line(origins.of_attribute((&["joint"], "j"), &["range"])), Some(11));
        assert_eq!(line(origins.of_inertia("a")), Some(10));
        assert_eq!(line(origins.of(&["body"], "nobody")), None);
    }
}
