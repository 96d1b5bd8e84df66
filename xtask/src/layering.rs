//! Checks the direction of dependencies, who prints, and that `gait` stays bare. `ARCHITECTURE.md` says why.

use std::fs;
use std::path::{Path, PathBuf};

use crate::Failure;
use crate::source::{code_only, lines_with, read, rust_files, without_tests};

/// Which of our packages another one of them may use.
enum Ours {
    These(&'static [&'static str]),
    Any,
}

struct Rule {
    /// From the repository's root.
    folder: &'static str,
    package: &'static str,
    may_use: Ours,
    may_print: bool,
}

/// Along the arrows, each package and what it may use. A new crate gets its line here and in `ARCHITECTURE.md`.
const RULES: [Rule; 11] = [
    Rule { folder: "crates/gait", package: "canter-gait", may_use: Ours::These(&[]), may_print: false },
    Rule { folder: "crates/sim", package: "canter-sim", may_use: Ours::These(&["canter-gait"]), may_print: false },
    Rule { folder: "crates/learn", package: "canter-learn", may_use: Ours::These(&["canter-gait"]), may_print: false },
    Rule {
        folder: "crates/train",
        package: "canter-train",
        may_use: Ours::These(&["canter-gait", "canter-sim", "canter-learn"]),
        may_print: false,
    },
    Rule { folder: "crates/report", package: "canter-report", may_use: Ours::These(&[]), may_print: false },
    Rule { folder: "crates/serve", package: "canter-serve", may_use: Ours::These(&[]), may_print: false },
    Rule {
        folder: "crates/export",
        package: "canter-export",
        may_use: Ours::These(&["canter-train", "canter-sim", "canter-gait"]),
        may_print: false,
    },
    Rule { folder: "crates/cli", package: "canter", may_use: Ours::Any, may_print: true },
    Rule {
        folder: "python",
        package: "canter-python",
        may_use: Ours::These(&["canter-train", "canter-sim", "canter-learn"]),
        may_print: true,
    },
    Rule { folder: "bench", package: "canter-bench", may_use: Ours::Any, may_print: true },
    Rule { folder: "xtask", package: "xtask", may_use: Ours::These(&[]), may_print: true },
];

/// The physics engine, behind `sim` alone.
const PHYSICS: &str = "mujoco-rs";

const PRINTING: [&str; 4] = ["println!", "print!", "eprintln!", "eprint!"];

/// Checks every package and every source file, and reports all that is wrong at once.
pub fn check(root: &Path) -> Result<(), Failure> {
    let renamed = renamed_dependencies(&read(&root.join("Cargo.toml"))?);
    let mut wrong = Vec::new();
    let mut packages = 0;
    for folder in package_folders(root) {
        let manifest = read(&root.join(&folder).join("Cargo.toml"))?;
        let Some(rule) = RULES.iter().find(|rule| Path::new(rule.folder) == folder) else {
            wrong.push(format!(
                "{}: the layering has no rule for this package; add one to RULES in xtask/src/layering.rs and to ARCHITECTURE.md",
                folder.display()
            ));
            continue;
        };
        packages += 1;
        wrong.extend(check_manifest(rule, &manifest, &renamed));
        for path in rust_files(&root.join(&folder).join("src")) {
            let shown = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            wrong.extend(check_source(rule, &shown, &read(&path)?));
        }
    }
    if wrong.is_empty() {
        println!("layering: {packages} packages obey");
        return Ok(());
    }
    Err(Failure::Task(format!("the layering is broken in {} places:\n  {}", wrong.len(), wrong.join("\n  "))))
}

/// The folders with a package of the workspace, from the repository's root.
fn package_folders(root: &Path) -> Vec<PathBuf> {
    let crates = fs::read_dir(root.join("crates")).into_iter().flatten().flatten();
    let mut folders: Vec<PathBuf> = crates.map(|entry| Path::new("crates").join(entry.file_name())).collect();
    folders.extend(["bench", "python", "xtask"].map(PathBuf::from));
    folders.retain(|folder| root.join(folder).join("Cargo.toml").is_file());
    folders.sort();
    folders
}

fn check_manifest(rule: &Rule, manifest: &str, renamed: &[(String, String)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for mut dependency in dependencies(manifest) {
        if let Some((_, package)) = renamed.iter().find(|(name, _)| *name == dependency.package) {
            dependency.package.clone_from(package);
        }
        let package = dependency.package.as_str();
        let place = format!("{}/Cargo.toml, line {}", rule.folder, dependency.line);
        let ours = RULES.iter().any(|rule| rule.package == package);
        match &rule.may_use {
            Ours::These(allowed) if ours && !allowed.contains(&package) => {
                let allowed = if allowed.is_empty() {
                    "none of our packages".to_owned()
                } else {
                    format!("only {}", allowed.join(", "))
                };
                wrong.push(format!("{place}: {} uses {package}, but may use {allowed}", rule.package));
            }
            Ours::These(_) if package == PHYSICS && rule.package != "canter-sim" => {
                wrong.push(format!(
                    "{place}: only canter-sim may use {PHYSICS}; ask sim for what {} needs",
                    rule.package
                ));
            }
            Ours::Any if package == PHYSICS && rule.folder != "bench" => {
                wrong.push(format!(
                    "{place}: only canter-sim may use {PHYSICS}; ask sim for what {} needs",
                    rule.package
                ));
            }
            _ => {}
        }
        if rule.package == "canter-gait" && !ours && package != "libm" && !dependency.for_tests {
            wrong.push(format!("{place}: canter-gait runs on the robot and may use only libm, not {package}"));
        }
        if rule.package == "xtask" && !ours {
            wrong.push(format!("{place}: xtask must build at once and uses only std, not {package}"));
        }
    }
    wrong
}

fn check_source(rule: &Rule, path: &str, source: &str) -> Vec<String> {
    // A module of tests in its own file: `#[cfg(test)] mod tests;`.
    if path.ends_with("/tests.rs") || path.contains("/tests/") {
        return Vec::new();
    }
    let code = without_tests(&code_only(source));
    let mut wrong = Vec::new();
    if !rule.may_print {
        for printing in PRINTING {
            wrong.extend(lines_with(&code, printing).map(|line| {
                format!("{path}:{line}: `{printing}`: only crates/cli prints; return the value or an event instead")
            }));
        }
    }
    if rule.package == "canter-gait" {
        if path == "crates/gait/src/lib.rs" && !code.contains("#![no_std]") {
            wrong.push(format!("{path}: `#![no_std]` is missing; gait runs on the robot"));
        }
        for (word, instead) in [
            ("std::", "use `core::` or libm"),
            ("extern crate std", "only tests may have it, under #[cfg(test)]"),
            ("extern crate alloc", "borrow slices and a workspace from the caller"),
            ("alloc::", "borrow slices and a workspace from the caller"),
        ] {
            wrong.extend(lines_with(&code, word).map(|line| format!("{path}:{line}: `{word}` in gait: {instead}")));
        }
    }
    wrong
}

/// One entry in a manifest's tables of dependencies.
#[derive(Debug, PartialEq)]
struct Dependency {
    /// The package's name, not the name it may be given here.
    package: String,
    /// Of `[dev-dependencies]`.
    for_tests: bool,
    /// In the manifest, from 1.
    line: usize,
}

/// Reads the tables of dependencies, those for one platform too.
fn dependencies(manifest: &str) -> Vec<Dependency> {
    let mut found: Vec<Dependency> = Vec::new();
    for entry in entries(manifest) {
        let mut table = entry.table.clone();
        if table.first().is_some_and(|name| name == "target") {
            table.drain(..table.len().min(2));
        }
        let [kind, rest @ ..] = table.as_slice() else { continue };
        if !["dependencies", "dev-dependencies", "build-dependencies"].contains(&kind.as_str()) {
            continue;
        }
        // `[dependencies] name = ...` and `name.key = ...`, or `[dependencies.name] key = ...`.
        let Some(name) = rest.first().or(entry.key.first()) else { continue };
        let key = if rest.is_empty() { entry.key.get(1) } else { entry.key.first() };
        let package = match key.map(String::as_str) {
            Some("package") => Some(entry.value.trim().trim_matches(['"', '\'']).to_owned()),
            Some(_) => None,
            None => value_of(&entry.value, "package"),
        };
        let for_tests = kind == "dev-dependencies";
        match (found.iter_mut().find(|known| known.package == *name && known.for_tests == for_tests), package) {
            (Some(known), Some(package)) => known.package = package,
            (Some(_), None) => {}
            (None, package) => {
                found.push(Dependency {
                    package: package.unwrap_or_else(|| name.clone()),
                    for_tests,
                    line: entry.line,
                });
            }
        }
    }
    found
}

/// The entries of `[workspace.dependencies]` that stand for a package of another name: (name, package).
fn renamed_dependencies(manifest: &str) -> Vec<(String, String)> {
    entries(manifest)
        .into_iter()
        .filter(|entry| entry.table == ["workspace", "dependencies"])
        .filter_map(|entry| Some((entry.key.first()?.clone(), value_of(&entry.value, "package")?)))
        .collect()
}

/// One `key = value` of a TOML file.
struct Entry {
    table: Vec<String>,
    key: Vec<String>,
    value: String,
    line: usize,
}

/// The entries of a TOML file, as far as manifests need it. Table names without an entry count as one with an empty key.
fn entries(toml: &str) -> Vec<Entry> {
    let mut table = Vec::new();
    let mut found = Vec::new();
    let mut lines = toml.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        let mut text = without_comment(line).trim().to_owned();
        if let Some(name) = text.strip_prefix('[') {
            table = split_name(name.trim_start_matches('[').trim_end_matches(']'));
            found.push(Entry { table: table.clone(), key: Vec::new(), value: String::new(), line: i + 1 });
            continue;
        }
        // An array or an inline table may go on over several lines.
        while depth(&text) > 0 {
            let Some((_, next)) = lines.next() else { break };
            text.push(' ');
            text.push_str(without_comment(next).trim());
        }
        if let Some((key, value)) = text.split_once('=') {
            found.push(Entry { table: table.clone(), key: split_name(key), value: value.to_owned(), line: i + 1 });
        }
    }
    found
}

/// The characters of `text` that are outside quotation marks, with their places.
fn unquoted(text: &str) -> impl Iterator<Item = (usize, char)> + '_ {
    let mut quote = None;
    text.char_indices().filter(move |&(_, character)| match quote {
        Some(open) => {
            if character == open {
                quote = None;
            }
            false
        }
        None => {
            if character == '"' || character == '\'' {
                quote = Some(character);
            }
            quote.is_none()
        }
    })
}

fn without_comment(line: &str) -> &str {
    let comment = unquoted(line).find(|&(_, character)| character == '#');
    comment.map_or(line, |(at, _)| &line[..at])
}

fn depth(text: &str) -> i32 {
    unquoted(text)
        .map(|(_, character)| match character {
            '[' | '{' => 1,
            ']' | '}' => -1,
            _ => 0,
        })
        .sum()
}

/// Splits a dotted name, whose parts may be quoted.
fn split_name(name: &str) -> Vec<String> {
    let mut parts = Vec::new();
    let mut start = 0;
    for (at, _) in unquoted(name).filter(|&(_, character)| character == '.') {
        parts.push(&name[start..at]);
        start = at + 1;
    }
    parts.push(&name[start..]);
    parts.into_iter().map(|part| part.trim().trim_matches(['"', '\'']).to_owned()).collect()
}

/// The text of `key = "text"` in an inline table.
fn value_of(table: &str, key: &str) -> Option<String> {
    let inside = table.trim().strip_prefix('{')?.strip_suffix('}')?;
    let mut commas: Vec<usize> =
        unquoted(inside).filter(|&(_, character)| character == ',').map(|(at, _)| at).collect();
    commas.push(inside.len());
    let mut start = 0;
    for comma in commas {
        if let Some((name, value)) = inside[start..comma].split_once('=')
            && name.trim() == key
        {
            return Some(value.trim().trim_matches(['"', '\'']).to_owned());
        }
        start = (comma + 1).min(inside.len());
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(package: &str) -> &'static Rule {
        RULES.iter().find(|rule| rule.package == package).unwrap()
    }

    fn complaints(package: &str, manifest: &str) -> Vec<String> {
        check_manifest(rule(package), manifest, &[])
    }

    #[test]
    fn every_way_to_write_a_dependency_is_read() {
        let manifest = "\
[package]
name = \"x\" # libm = \"1\"
[dependencies]
libm.workspace = true
serde = { version = \"1\", features = [
    \"derive\", # a comment
    \"rc\",
] }
physics = { package = \"mujoco-rs\", version = \"7\" }
[dependencies.toml]
version = \"1\"
[dependencies.short]
package = \"a-long-name\"
[dev-dependencies]
libm = \"0.2\"
[target.'cfg(unix)'.build-dependencies]
\"cc\" = \"1\"
[features]
rayon = []
";
        let found: Vec<_> = dependencies(manifest)
            .into_iter()
            .map(|dependency| (dependency.package, dependency.for_tests, dependency.line))
            .collect();
        let expected = [
            ("libm", false, 4),
            ("serde", false, 5),
            ("mujoco-rs", false, 9),
            ("toml", false, 10),
            ("a-long-name", false, 12),
            ("libm", true, 15),
            ("cc", false, 17),
        ];
        assert_eq!(found, expected.map(|(package, for_tests, line)| (package.to_owned(), for_tests, line)));
    }

    #[test]
    fn arrows_that_are_allowed_pass() {
        for (package, manifest) in [
            ("canter-gait", "[dependencies]\nlibm.workspace = true\n[dev-dependencies]\nserde_json.workspace = true"),
            ("canter-sim", "[dependencies]\ncanter-gait.workspace = true\nmujoco-rs.workspace = true"),
            ("canter-learn", "[dependencies]\ncanter-gait.workspace = true\ngemm.workspace = true"),
            ("canter-train", "[dependencies]\ncanter-gait.workspace = true\ncanter-sim = {}\ncanter-learn = {}"),
            ("canter-export", "[dependencies]\ncanter-train.workspace = true\ncanter-gait.workspace = true"),
            ("canter", "[dependencies]\ncanter-train.workspace = true\ncanter-report.workspace = true"),
            ("canter-bench", "[dependencies]\ncanter-learn.workspace = true\nmujoco-rs.workspace = true"),
        ] {
            assert_eq!(complaints(package, manifest), [""; 0], "{package}");
        }
    }

    #[test]
    fn arrows_that_are_forbidden_are_named() {
        for (package, dependency, says) in [
            ("canter-gait", "serde", "may use only libm, not serde"),
            ("canter-gait", "canter-learn", "may use none of our packages"),
            ("canter-sim", "canter-learn", "may use only canter-gait"),
            ("canter-learn", "canter-sim", "may use only canter-gait"),
            ("canter-train", "canter-report", "may use only canter-gait, canter-sim, canter-learn"),
            ("canter-train", "mujoco-rs", "only canter-sim may use mujoco-rs"),
            ("canter", "mujoco-rs", "only canter-sim may use mujoco-rs"),
            ("canter-report", "canter-gait", "may use none of our packages"),
            ("canter-export", "canter-report", "may use only canter-train, canter-sim, canter-gait"),
            ("xtask", "clap", "uses only std, not clap"),
        ] {
            let found = complaints(package, &format!("[dependencies]\n{dependency}.workspace = true\n"));
            assert_eq!(found.len(), 1, "{package} -> {dependency}: {found:?}");
            assert!(found[0].contains(says) && found[0].contains("Cargo.toml, line 2"), "{}", found[0]);
        }
        // Tests of one of our crates turn no arrow round either.
        assert_eq!(complaints("canter-gait", "[dev-dependencies]\ncanter-sim.workspace = true").len(), 1);
    }

    #[test]
    fn a_rename_in_the_workspace_hides_nothing() {
        let renamed =
            renamed_dependencies("[workspace.dependencies]\nphysics = { package = \"mujoco-rs\", version = \"7\" }\n");
        let found = check_manifest(rule("canter-train"), "[dependencies]\nphysics.workspace = true\n", &renamed);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn only_the_program_prints() {
        let source = "/// println!(\"x\")\nfn f() {\n    println!(\"x\");\n    eprint!(\"print!\");\n}\n#[cfg(test)]\nmod tests {\n    fn g() { print!(); }\n}\n";
        let found = check_source(rule("canter-learn"), "crates/learn/src/lib.rs", source);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("crates/learn/src/lib.rs:3: `println!`"), "{}", found[0]);
        assert!(found[1].starts_with("crates/learn/src/lib.rs:4: `eprint!`"), "{}", found[1]);
        assert_eq!(check_source(rule("canter"), "crates/cli/src/main.rs", source), [""; 0]);
    }

    #[test]
    fn gait_stays_bare() {
        let check = |path: &str, source: &str| check_source(rule("canter-gait"), path, source).len();
        let good = "#![no_std]\n#[cfg(test)]\nextern crate std;\nfn f() { core::mem::drop(1); }\n";
        assert_eq!(check("crates/gait/src/lib.rs", good), 0);
        assert_eq!(check("crates/gait/src/lib.rs", "// #![no_std]\n"), 1);
        assert_eq!(check("crates/gait/src/leg.rs", "use std::vec::Vec;"), 1);
        assert_eq!(check("crates/gait/src/leg.rs", "extern crate alloc;"), 1);
    }
}
