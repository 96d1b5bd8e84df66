//! Looks through the files of a user's model before MuJoCo opens them.
//!
//! MuJoCo opens every path that a model names and compiles every size that it asks for. Here a model may use what lies in
//! its robot's folder and nothing else, and what it asks for has to be sane. What only shows when it is compiled is for
//! the guard ([`super::set_model_guard`]) to stop.

use std::collections::HashSet;
use std::fmt;
use std::io;
use std::path::{Component, Path, PathBuf};

use roxmltree::{Attribute, Document, Node, ParsingOptions};

use super::Fingerprint;
use super::xml::{Fault, Lines, MAX_ELEMENTS, without_comments};
use crate::file;

/// Most bytes of a model's file.
pub(super) const MAX_MODEL_BYTES: u64 = 16 << 20;
/// Most bytes of a mesh, a texture or any other file that a model uses.
const MAX_ASSET_BYTES: u64 = 64 << 20;
/// Most bytes of all of them.
const MAX_ALL_BYTES: u64 = 256 << 20;
/// Most places where a model names a file, includes among them.
const MAX_REFERENCES: usize = 1000;
/// Longest way from a model's file to another by includes.
const MAX_INCLUDES: usize = 16;
/// Most folders that `<compiler>` elements name: every file is looked for in each.
const MAX_ASSET_FOLDERS: usize = 16;
/// Problems beyond this many are not kept.
const MAX_PROBLEMS: usize = 50;
/// At most this many characters of a value are shown.
const MAX_SHOWN_CHARS: usize = 60;

/// Names of a model's files end in one of these: MuJoCo reads others in other ways.
pub(super) const MODEL_EXTENSIONS: [&str; 3] = ["xml", "mjcf", "urdf"];

/// Element (`*`: any), attribute and the greatest value that it may have; of several numbers, their product.
/// Each costs memory or time in proportion. What real robots have is a tenth at most.
const LIMITS: [(&str, &str, f64); 34] = [
    // Bytes and numbers of each simulation's own memory.
    ("size", "memory", 1e9),
    ("size", "nstack", 1e8),
    ("size", "njmax", 1e5),
    ("size", "nconmax", 1e5),
    ("size", "nuserdata", 1e6),
    ("size", "nkey", 1e4),
    ("size", "nuser_body", 1e3),
    ("size", "nuser_jnt", 1e3),
    ("size", "nuser_geom", 1e3),
    ("size", "nuser_site", 1e3),
    ("size", "nuser_cam", 1e3),
    ("size", "nuser_tendon", 1e3),
    ("size", "nuser_actuator", 1e3),
    ("size", "nuser_sensor", 1e3),
    ("numeric", "size", 1e5),
    ("user", "dim", 1e4),
    ("contact", "num", 1e3),
    ("*", "nsample", 1e4),
    ("*", "actdim", 1e3),
    // Work of each physics step.
    ("option", "iterations", 1e4),
    ("option", "ls_iterations", 1e4),
    ("option", "noslip_iterations", 1e4),
    ("option", "ccd_iterations", 1e4),
    ("option", "sdf_iterations", 1e3),
    ("option", "sdf_initpoints", 1e3),
    // Grids and pictures.
    ("hfield", "nrow", 2048.0),
    ("hfield", "ncol", 2048.0),
    ("texture", "width", 8192.0),
    ("texture", "height", 8192.0),
    ("mesh", "params", 1e4),
    ("skin", "subgrid", 100.0),
    ("flexcomp", "cellcount", 1e4),
    ("camera", "resolution", 1e8),
    ("quality", "shadowsize", 16384.0),
];

/// Elements that stand for as many as the product of an attribute's numbers says.
const MULTIPLIERS: [(&str, &str); 3] = [("replicate", "count"), ("composite", "count"), ("flexcomp", "count")];

/// One fault of a model's files.
#[derive(Clone, Debug, PartialEq, Eq)]
struct ModelProblem {
    file: String,
    line: Option<usize>,
    message: String,
}

impl fmt::Display for ModelProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file, self.message),
            None => write!(f, "{}: {}", self.file, self.message),
        }
    }
}

/// What is wrong with the files of a model, each with its file and line. At most 50 problems are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelProblems {
    list: Vec<ModelProblem>,
    has_more: bool,
}

impl ModelProblems {
    /// Each problem's file, line and words.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Option<usize>, &str)> {
        self.list.iter().map(|problem| (problem.file.as_str(), problem.line, problem.message.as_str()))
    }
}

impl fmt::Display for ModelProblems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<_> = self.list.iter().map(ModelProblem::to_string).collect();
        write!(f, "{}", lines.join("\n"))?;
        match lines.len() {
            _ if self.has_more => write!(f, "\nmore than {MAX_PROBLEMS} problems"),
            0 | 1 => Ok(()),
            number => write!(f, "\n{number} problems"),
        }
    }
}

impl std::error::Error for ModelProblems {}

/// Screens the model at `path` and everything that it uses, all in the folder `root`, and adds the files to the
/// `fingerprint`: the model's own first, then each when it is met. Returns them in this order, each once.
///
/// # Errors
/// Everything that is wrong, as far as the files could be read.
pub(super) fn screen(root: &Path, path: &Path, fingerprint: &mut Fingerprint) -> Result<Vec<PathBuf>, ModelProblems> {
    let mut screen = Screen {
        shown_root: root,
        root: PathBuf::new(),
        model_folder: PathBuf::new(),
        asset_folders: vec![String::new()],
        strips_paths: Vec::new(),
        references: Vec::new(),
        num_references: 0,
        assets: HashSet::new(),
        num_bytes: 0,
        files: Vec::new(),
        is_too_large: false,
        fingerprint,
        problems: ModelProblems::default(),
    };
    screen.model(path);
    if screen.problems.list.is_empty() { Ok(screen.files) } else { Err(screen.problems) }
}

/// A place where a model names a file.
#[derive(Clone, Debug)]
struct Reference {
    /// The way of includes to the file in which this stands, the model's first file first.
    chain: Vec<PathBuf>,
    line: usize,
    element: String,
    attribute: String,
    value: String,
    /// Whether MuJoCo does not look at it unless told to.
    is_optional: bool,
}

impl Reference {
    /// Whether MuJoCo reads the file as a model.
    fn is_model(&self) -> bool {
        self.is_include() || self.element == "model"
    }

    fn is_include(&self) -> bool {
        self.element == "include"
    }
}

struct Screen<'a> {
    /// The robot's folder as it was typed.
    shown_root: &'a Path,
    /// The same without links.
    root: PathBuf,
    /// Folder of the model's first file, without links.
    model_folder: PathBuf,
    /// What `<compiler>` elements call the folders of meshes and textures, and no folder.
    asset_folders: Vec<String>,
    /// What they say about paths being cut down to the file's name; the format's default first.
    strips_paths: Vec<bool>,
    /// Files other than includes, to be looked at when all folders are known.
    references: Vec<Reference>,
    num_references: usize,
    /// Files that are no models and are in the fingerprint already.
    assets: HashSet<PathBuf>,
    num_bytes: u64,
    /// Every file that was read.
    files: Vec<PathBuf>,
    /// Whether too many elements have been reported.
    is_too_large: bool,
    fingerprint: &'a mut Fingerprint,
    problems: ModelProblems,
}

impl Screen<'_> {
    /// Screens the whole model.
    fn model(&mut self, path: &Path) {
        let real = without_links(self.shown_root).and_then(|root| {
            self.root = root;
            self.model_folder = without_links(path.parent().unwrap_or(path))?;
            path.canonicalize()
        });
        match real {
            Err(error) => self.problem(path, None, format!("cannot be read: {error}")),
            Ok(real) if !real.starts_with(&self.root) => {
                let message =
                    format!("this model is outside the robot's folder {}; copy it there", self.root.display());
                self.problem(path, None, message);
            }
            Ok(_) => {
                let file_name = path.file_name().unwrap_or_default();
                self.file(&[self.model_folder.join(file_name)]);
                let mut number = 0;
                while let Some(reference) = self.references.get(number).cloned() {
                    self.reference(&reference);
                    number += 1;
                }
            }
        }
    }

    /// Screens the last file of a way of includes; returns how many elements it stands for.
    fn file(&mut self, chain: &[PathBuf]) -> u64 {
        let path = chain.last().cloned().unwrap_or_default();
        match self.text(&path) {
            Err(Fault { line, message }) => {
                self.problem(&path, line, message);
                0
            }
            Ok(text) => {
                let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
                match Document::parse_with_options(&text, options) {
                    Err(error) => {
                        let line = Some(error.pos().row as usize);
                        self.problem(&path, line, format!("not well-formed XML: {error}"));
                        0
                    }
                    Ok(document) => {
                        let root = document.root_element();
                        // In URDF alone MuJoCo cuts paths down to the file's name if not told otherwise.
                        self.strips_paths(root.tag_name().name().eq_ignore_ascii_case("robot"));
                        self.element(root, chain, &mut Lines::new(&text))
                    }
                }
            }
        }
    }

    /// The text of a model's file, fit for the parser.
    fn text(&mut self, path: &Path) -> Result<String, Fault> {
        let whole_file = |message| Fault { line: None, message };
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !MODEL_EXTENSIONS.contains(&extension.as_str()) {
            let names = MODEL_EXTENSIONS.join(", .");
            return Err(whole_file(format!("expected the name of a model's file to end in one of .{names}")));
        }
        let bytes = self.read(path, MAX_MODEL_BYTES).map_err(whole_file)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let offset = error.utf8_error().valid_up_to();
            whole_file(format!("not UTF-8: the byte at offset {offset} belongs to no character"))
        })?;
        without_comments(&text)
    }

    /// Screens an element and all in it; returns how many elements it stands for.
    fn element(&mut self, node: Node<'_, '_>, chain: &[PathBuf], lines: &mut Lines<'_>) -> u64 {
        // MuJoCo does not tell `<Include>` from `<include>`.
        let element = node.tag_name().name().to_ascii_lowercase();
        let line = lines.at(node.range().start);
        let mut size = 1_u64;
        for attribute in node.attributes() {
            self.check_numbers(chain, line, &element, attribute);
            if element == "compiler" {
                self.compiler_attribute(chain, line, attribute);
            }
            if names_file(&element, attribute) {
                let reference = Reference {
                    chain: chain.to_vec(),
                    line,
                    element: element.clone(),
                    attribute: attribute.name().to_owned(),
                    value: attribute.value().to_owned(),
                    is_optional: node.ancestors().any(|ancestor| ancestor.has_tag_name("visual")),
                };
                size = size.saturating_add(self.add_reference(reference));
            }
        }
        for child in node.children().filter(Node::is_element) {
            size = size.saturating_add(self.element(child, chain, lines));
        }
        for (name, attribute) in MULTIPLIERS {
            if let Some(number) = node.attribute(attribute).filter(|_| element == name).and_then(product) {
                size = size.saturating_mul(number.max(1.0) as u64);
            }
        }
        if size > MAX_ELEMENTS && !self.is_too_large {
            self.is_too_large = true;
            let message = format!("<{element}> stands for {size} elements; expected at most {MAX_ELEMENTS}");
            self.problem_in(chain, line, message);
        }
        size
    }

    fn check_numbers(&mut self, chain: &[PathBuf], line: usize, element: &str, attribute: Attribute<'_, '_>) {
        let is_meant = |(of_element, name, _): &&(&str, &str, f64)| {
            *name == attribute.name() && (*of_element == "*" || *of_element == element)
        };
        if has_nan(attribute.value()) {
            let message = format!("<{element} {}={}> is not a number", attribute.name(), shown(attribute.value()));
            self.problem_in(chain, line, message);
        }
        if let Some((_, name, greatest)) = LIMITS.iter().find(is_meant)
            && product(attribute.value()).is_some_and(|value| value > *greatest)
        {
            let value = shown(attribute.value());
            let message = format!("<{element} {name}={value}> is out of range: expected at most {greatest}");
            self.problem_in(chain, line, message);
        }
    }

    fn compiler_attribute(&mut self, chain: &[PathBuf], line: usize, attribute: Attribute<'_, '_>) {
        match attribute.name() {
            "meshdir" | "texturedir" | "assetdir" => {
                let folder = with_slashes(attribute.value());
                if !self.asset_folders.contains(&folder) {
                    self.asset_folders.push(folder);
                }
                if self.asset_folders.len() == MAX_ASSET_FOLDERS + 1 {
                    self.asset_folders.pop();
                    let message = format!("expected at most {MAX_ASSET_FOLDERS} folders of meshes and textures");
                    self.problem_in(chain, line, message);
                }
            }
            "strippath" => self.strips_paths(attribute.value() == "true"),
            _ => {}
        }
    }

    fn strips_paths(&mut self, strips: bool) {
        if !self.strips_paths.contains(&strips) {
            self.strips_paths.push(strips);
        }
    }

    /// Follows an include at once, and keeps any other reference for later; returns how many elements it stands for.
    fn add_reference(&mut self, reference: Reference) -> u64 {
        self.num_references += 1;
        if self.num_references == MAX_REFERENCES + 1 {
            let message = format!("expected at most {MAX_REFERENCES} names of files");
            self.problem_in(&reference.chain, reference.line, message);
        }
        if self.num_references > MAX_REFERENCES {
            return 0;
        }
        if reference.is_include() {
            return self.reference(&reference);
        }
        self.references.push(reference);
        0
    }

    /// Screens what a model names; returns how many elements it stands for, if it is a model too.
    fn reference(&mut self, reference: &Reference) -> u64 {
        match self.try_reference(reference) {
            Ok(size) => size,
            Err(message) => {
                let Reference { element, attribute, .. } = reference;
                let value = shown(&reference.value);
                let message = format!("<{element} {attribute}={value}>: {message}");
                self.problem_in(&reference.chain, reference.line, message);
                0
            }
        }
    }

    fn try_reference(&mut self, reference: &Reference) -> Result<u64, String> {
        let mut size = 0_u64;
        for path in self.resolve(reference)? {
            let real = path.canonicalize().unwrap_or_default();
            let is_real = |other: &PathBuf| other.canonicalize().is_ok_and(|other| other == real);
            if !reference.is_model() {
                if self.assets.insert(real) {
                    self.read(&path, MAX_ASSET_BYTES)?;
                }
            } else if reference.chain.iter().any(is_real) {
                return Err(
                    "this file includes itself, by this way or by others; remove one of the includes".to_owned()
                );
            } else if reference.chain.len() > MAX_INCLUDES {
                return Err(format!("expected at most {MAX_INCLUDES} includes inside each other"));
            } else {
                let chain = [&reference.chain[..], &[path]].concat();
                size = size.saturating_add(self.file(&chain));
            }
        }
        Ok(size)
    }

    /// Every file that MuJoCo might open for a reference.
    ///
    /// Which it opens depends on its version, the element and what else is there; none may be outside the robot's folder.
    fn resolve(&self, reference: &Reference) -> Result<Vec<PathBuf>, String> {
        let outside = "is outside the robot's folder; copy it there and name it by its way from the model's file";
        let name = with_slashes(&reference.value);
        let file_name = name.rsplit('/').next().unwrap_or_default();
        let own_folder = reference.chain.last().and_then(|file| file.parent()).unwrap_or(&self.root);
        let asset_folders = if reference.is_include() { &self.asset_folders[..1] } else { &self.asset_folders[..] };
        let (mut found, mut seen, mut may_be_outside) = (Vec::new(), Vec::new(), name.contains("://"));
        for &strips in &self.strips_paths {
            let name = if strips && !reference.is_model() { file_name } else { &name };
            for folder in [&self.model_folder, own_folder] {
                for asset_folder in asset_folders {
                    let path = folder.join(asset_folder).join(name);
                    // MuJoCo goes back from `link/..` to where the link is, the system from where it leads.
                    for path in [without_parents(&path), path] {
                        let Ok(real) = path.canonicalize() else {
                            may_be_outside |= !without_parents(&path).starts_with(&self.root);
                            continue;
                        };
                        if !real.starts_with(&self.root) {
                            return Err(format!("{} {outside}", real.display()));
                        }
                        if !seen.contains(&real) {
                            seen.push(real);
                            found.push(path);
                        }
                    }
                }
            }
        }
        if !found.is_empty() || reference.is_optional {
            Ok(found)
        } else if may_be_outside {
            Err(format!("this file {outside}"))
        } else {
            let expected = "expected it beside the model's file or in the folder that <compiler> names";
            Err(format!("there is no such file; {expected}"))
        }
    }

    /// The bytes of a file, which are in the fingerprint then.
    fn read(&mut self, path: &Path, max_bytes: u64) -> Result<Vec<u8>, String> {
        let bytes = file::read(path, max_bytes).map_err(|error| format!("cannot be read: {error}"))?;
        let num_bytes = bytes.len() as u64;
        self.num_bytes += num_bytes;
        if num_bytes > max_bytes {
            return Err(format!("too large: expected at most {} MiB", max_bytes >> 20));
        }
        if self.num_bytes > MAX_ALL_BYTES {
            return Err(format!(
                "too large: expected all files of the model to have at most {} MiB",
                MAX_ALL_BYTES >> 20
            ));
        }
        self.fingerprint.add(&bytes);
        if !self.files.iter().any(|file| file == path) {
            self.files.push(path.to_owned());
        }
        Ok(bytes)
    }

    /// Adds a problem with a line of the last file of a way of includes.
    fn problem_in(&mut self, chain: &[PathBuf], line: usize, message: String) {
        let path = chain.last().cloned().unwrap_or_default();
        self.problem(&path, Some(line), message);
    }

    fn problem(&mut self, path: &Path, line: Option<usize>, message: String) {
        self.problems.has_more |= self.problems.list.len() == MAX_PROBLEMS;
        if !self.problems.has_more {
            let shown = path.strip_prefix(&self.root).map_or(path.to_owned(), |inside| self.shown_root.join(inside));
            self.problems.list.push(ModelProblem { file: shown.display().to_string(), line, message });
        }
    }
}

/// Whether MuJoCo takes the attribute for the name of a file. Other programs' elements in a URDF have such attributes too.
fn names_file(element: &str, attribute: Attribute<'_, '_>) -> bool {
    let name = attribute.name();
    let is_urdf = name == "filename";
    name.starts_with("file") && (!is_urdf || element == "mesh") && !attribute.value().trim().is_empty()
}

/// Whether all words are numbers and one of them is NaN, which MuJoCo takes for a value that is not given.
fn has_nan(text: &str) -> bool {
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    let has_nan = numbers.clone().any(|number| number.is_ok_and(f64::is_nan));
    has_nan && numbers.all(|number| number.is_ok())
}

/// The product of an attribute's numbers without their signs, none counted as less than 1; `None` if one is no number.
fn product(text: &str) -> Option<f64> {
    text.split_whitespace().map(|word| number(word).map(|number| number.abs().max(1.0))).product()
}

/// A number; those of bytes may end in K, M, G, T, P or E.
fn number(word: &str) -> Option<f64> {
    word.parse().ok().or_else(|| {
        let unit = word.chars().last()?;
        let power = "KMGTPE".find(unit.to_ascii_uppercase())? + 1;
        let number: f64 = word[..word.len() - unit.len_utf8()].parse().ok()?;
        Some(number * 1024_f64.powi(power as i32))
    })
}

/// A path as MuJoCo takes it apart: `\` counts as `/` on every system.
fn with_slashes(path: &str) -> String {
    path.replace('\\', "/")
}

/// A folder without links; that of a bare file name is the working directory.
fn without_links(folder: &Path) -> io::Result<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    folder.canonicalize()
}

/// The path with each `name/..` left out, whatever is on the disk.
fn without_parents(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir if matches!(plain.components().next_back(), Some(Component::Normal(_))) => {
                plain.pop();
            }
            Component::CurDir => {}
            _ => plain.push(component),
        }
    }
    plain
}

/// A value as messages show it: quoted, on one line, shortened.
fn shown(value: &str) -> String {
    let start: String = value.chars().take(MAX_SHOWN_CHARS).collect();
    let dots = if start.len() < value.len() { "..." } else { "" };
    format!("{start:?}{dots}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Screens files of a folder of its own, the first one as the model.
    fn screened(name: &str, files: &[(&str, &str)]) -> Result<u64, String> {
        let folder = std::env::temp_dir().join(format!("canter-screen-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        for (file, text) in files {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let mut fingerprint = Fingerprint::new();
        let result = screen(&folder, &folder.join(files[0].0), &mut fingerprint);
        let shown = format!("{}/", folder.display());
        fs::remove_dir_all(&folder).unwrap();
        result.map(|_| fingerprint.0).map_err(|problems| problems.to_string().replace(&shown, ""))
    }

    #[test]
    fn files_in_the_robots_folder_are_found_wherever_mujoco_looks() {
        let model = "<mujoco><!-- -- --><compiler meshdir='../meshes' texturedir='..'/><include file='parts/a.xml'/>\
                     <asset><mesh file='a.stl'/><texture fileup='b.png'/><hfield file=''/></asset></mujoco>";
        let include = "<mujoco><include file='b.xml'/><include file='..\\c.xml'/></mujoco>";
        let empty = "<mujoco/>";
        let mut files = vec![
            ("mjcf/model.xml", model),
            ("mjcf/parts/a.xml", include),
            ("mjcf/parts/b.xml", empty),
            ("mjcf/c.xml", empty),
            ("meshes/a.stl", "a"),
            ("b.png", "b"),
        ];
        let whole = screened("found", &files).unwrap();
        assert_eq!(screened("again", &files), Ok(whole));
        for changed in 1..files.len() {
            let text = std::mem::replace(&mut files[changed].1, "<mujoco> </mujoco>");
            assert_ne!(screened("changed", &files), Ok(whole), "{}", files[changed].0);
            files[changed].1 = text;
        }
    }

    #[test]
    fn urdf_has_its_own_way_of_naming_files() {
        let urdf = |file: &str, compiler: &str| {
            format!(
                "<robot name='a'><mujoco><compiler {compiler}/></mujoco><gazebo><plugin filename='lib.so'/></gazebo>\
                 <link name='b'><visual><geometry><mesh filename='package://a/no.dae'/></geometry></visual>\
                 <collision><geometry><mesh filename='{file}'/></geometry></collision></link></robot>"
            )
        };
        let screened = |file, compiler| screened("urdf", &[("a.urdf", &urdf(file, compiler)), ("m/a.stl", "a")]);
        assert!(screened("package://a/b/a.stl", "meshdir='m'").is_ok());
        assert!(screened("/somewhere/else/a.stl", "meshdir='m'").is_ok());
        assert!(screened("m/a.stl", "strippath='false'").is_ok());
        let outside = "is outside the robot's folder; copy it there and name it by its way from the model's file";
        let message = |file| format!("a.urdf:1: <mesh filename=\"{file}\">: this file {outside}");
        assert_eq!(screened("package://a/b.stl", ""), Err(message("package://a/b.stl")));
    }

    #[test]
    fn products_count_every_number_as_one_at_least() {
        for (text, expected) in [
            ("2 3 4", Some(24.0)),
            ("-5 0.5", Some(5.0)),
            ("", Some(1.0)),
            ("2K", Some(2048.0)),
            ("1e9", Some(1e9)),
            ("3 x", None),
            ("K", None),
        ] {
            assert_eq!(product(text), expected, "{text}");
        }
        assert_eq!(product("1e300 1e300"), Some(f64::INFINITY));
    }

    #[test]
    fn parents_are_left_out_as_far_as_there_are_names() {
        for (path, plain) in [("/a/b/../c", "/a/c"), ("a/../../b", "../b"), ("./a/./b", "a/b"), ("/../a", "/../a")] {
            assert_eq!(without_parents(Path::new(path)), Path::new(plain));
        }
    }
}
