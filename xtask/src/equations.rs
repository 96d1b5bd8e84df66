//! Writes `docs/equations.md`: every equation in the code, with its formula and its source.
//!
//! An equation is a function or method whose doc comment has a line that begins with `Source:`. Its formula is the first
//! block fenced with ```` ```text ```` in that comment; its source is the paragraph that `Source:` begins.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::Failure;
use crate::source::{code_only, is_name, read, rust_files, without_tests};

/// The crates with equations, along the way of the data.
const CRATES: [&str; 6] = ["gait", "sim", "learn", "train", "export", "report"];

const INDEX: &str = "docs/equations.md";

const HEAD: &str = "\
# Equations

Every equation in the code, in the order of the data: the function that computes it, the formula, and where it is from.
The doc comments are the original; `cargo xtask equations` makes this page from them.
";

#[derive(Debug, PartialEq)]
struct Equation {
    /// `function` or `Type::method`.
    name: String,
    formula: Vec<String>,
    source: String,
}

/// Writes the index.
pub fn write(root: &Path) -> Result<(), Failure> {
    let (page, number) = index(root)?;
    let path = root.join(INDEX);
    fs::write(&path, page).map_err(|error| Failure::Task(format!("cannot write {}: {error}", path.display())))?;
    println!("equations: wrote {number} to {INDEX}");
    Ok(())
}

/// Compares the index with the code.
pub fn check(root: &Path) -> Result<(), Failure> {
    let (page, number) = index(root)?;
    let there = fs::read_to_string(root.join(INDEX)).unwrap_or_default();
    if there == page {
        println!("equations: {number}, {INDEX} is up to date");
        return Ok(());
    }
    let line = 1 + page.lines().zip(there.lines()).take_while(|(new, old)| new == old).count();
    Err(Failure::Task(format!(
        "{INDEX} is out of date from line {line} on; `cargo xtask equations` writes it anew\n  in the file: {}\n  in the code: {}",
        there.lines().nth(line - 1).unwrap_or("(nothing)"),
        page.lines().nth(line - 1).unwrap_or("(nothing)"),
    )))
}

/// The page, and how many equations it has.
fn index(root: &Path) -> Result<(String, usize), Failure> {
    let (mut page, mut number, mut wrong) = (HEAD.to_owned(), 0, Vec::new());
    for name in CRATES {
        let mut rows = String::new();
        for path in rust_files(&root.join("crates").join(name).join("src")) {
            let shown = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            for found in equations(&read(&path)?) {
                match found {
                    Ok(equation) => {
                        number += 1;
                        rows.push_str(&row(&equation, &shown));
                    }
                    Err(problem) => wrong.push(format!("{shown}:{problem}")),
                }
            }
        }
        if !rows.is_empty() {
            // Writing to a string cannot fail.
            let _ = write!(page, "\n## {name}\n\n| function | formula | source |\n| --- | --- | --- |\n{rows}");
        }
    }
    if wrong.is_empty() { Ok((page, number)) } else { Err(Failure::Task(wrong.join("\n"))) }
}

fn row(equation: &Equation, path: &str) -> String {
    let formula: Vec<String> = equation.formula.iter().map(|line| code_span(line)).collect();
    format!(
        "| [`{}`](../{path}) | {} | {} |\n",
        equation.name,
        formula.join("<br>"),
        equation.source.replace('|', "\\|")
    )
}

/// A line as code inside a table's cell.
fn code_span(line: &str) -> String {
    let line = line.replace('|', "\\|");
    if line.contains('`') { format!("`` {line} ``") } else { format!("`{line}`") }
}

/// Every equation of a file, in order; a doc comment that has a source but no formula is an error, with its line.
fn equations(source: &str) -> Vec<Result<Equation, String>> {
    let code = without_tests(&code_only(source));
    let owners = owners(&code);
    let mut found = Vec::new();
    let mut comment: Vec<&str> = Vec::new();
    let mut open_brackets = 0;
    for (i, (line, code)) in source.lines().zip(code.lines()).enumerate() {
        let (line, code) = (line.trim_start(), code.trim());
        if code.is_empty() {
            if let Some(text) = line.strip_prefix("///") {
                comment.push(text.strip_prefix(' ').unwrap_or(text).trim_end());
            }
            continue;
        }
        // Attributes stand between a comment and its function.
        if code.starts_with("#[") || open_brackets > 0 {
            open_brackets += code.matches('[').count();
            open_brackets = open_brackets.saturating_sub(code.matches(']').count());
            continue;
        }
        if let Some(function) = function_name(code)
            && comment.iter().any(|line| line.contains(" Source: "))
        {
            found.push(Err(format!("{}: `{function}`: `Source:` has to begin a line of the comment", i + 1)));
        } else if let Some(function) = function_name(code)
            && let Some(source) = source_of(&comment)
        {
            let name = match &owners[i] {
                Some(owner) => format!("{owner}::{function}"),
                None => function.to_owned(),
            };
            found.push(match formula_of(&comment) {
                Some(formula) => Ok(Equation { name, formula, source }),
                None => Err(format!("{}: `{name}` has a `Source:` but no formula: write it in a ```text block", i + 1)),
            });
        }
        comment.clear();
    }
    found
}

/// The name of the function that a line of code begins.
fn function_name(code: &str) -> Option<&str> {
    let (before, after) = code.split_once("fn ")?;
    let qualifier = |word: &str| ["const", "unsafe", "async", "extern"].contains(&word) || word.starts_with("pub");
    let is_function = before.is_empty() || before.ends_with(' ') && before.split_whitespace().all(qualifier);
    let length = after.bytes().take_while(|&byte| is_name(byte)).count();
    (is_function && length > 0).then(|| &after[..length])
}

/// For each line of code, the type or trait whose `impl` or `trait` block it begins in.
fn owners(code: &str) -> Vec<Option<String>> {
    let mut lines = vec![None];
    let mut blocks: Vec<Option<String>> = Vec::new();
    let mut head = String::new();
    for character in code.chars() {
        match character {
            '{' => {
                blocks.push(owner(&head));
                head.clear();
            }
            '}' => {
                blocks.pop();
                head.clear();
            }
            ';' => head.clear(),
            '\n' => {
                lines.push(blocks.iter().rev().flatten().next().cloned());
                head.push(' ');
            }
            other => head.push(other),
        }
    }
    lines
}

/// `Type` of `impl<T> Trait for Type<T> where ...` and of `trait Type: Other`; `None` if the block is neither.
fn owner(head: &str) -> Option<String> {
    let head = head.rsplit(']').next()?.trim();
    let mut words =
        head.split(|character: char| character.is_whitespace() || character == '<').filter(|word| !word.is_empty());
    let keyword = words.find(|word| !word.starts_with("pub") && *word != "unsafe")?;
    if keyword != "impl" && keyword != "trait" {
        return None;
    }
    let rest = &head[head.find(keyword)? + keyword.len()..];
    let rest = rest.split(" where ").next()?;
    let rest = without_generics(rest);
    let name = rest.rsplit(" for ").next()?.split(':').next_back().filter(|_| keyword == "impl");
    let name = name.or_else(|| rest.split(':').next())?.trim();
    Some(name.trim_start_matches(['&', ' ']).to_owned()).filter(|name| !name.is_empty())
}

fn without_generics(text: &str) -> String {
    let mut depth = 0;
    // The arrow of `Fn(f32) -> f32` closes nothing.
    text.replace("->", "")
        .chars()
        .filter(|character| {
            if *character == '<' {
                depth += 1;
            }
            let outside = depth == 0;
            if *character == '>' {
                depth -= 1;
            }
            outside
        })
        .collect()
}

/// The paragraph that `Source:` begins, without that word.
fn source_of(comment: &[&str]) -> Option<String> {
    let (mut fenced, mut parts) = (false, Vec::new());
    for line in comment.iter().map(|line| line.trim()) {
        if line.starts_with("```") {
            fenced = !fenced;
        } else if fenced {
            continue;
        } else if parts.is_empty() {
            parts.extend(line.strip_prefix("Source:").map(str::trim));
            continue;
        }
        if !parts.is_empty() {
            if line.is_empty() || line.starts_with("```") || line.starts_with("# ") {
                break;
            }
            parts.push(line);
        }
    }
    (!parts.is_empty()).then(|| without_doc_links(parts.join(" ").trim()))
}

/// Rustdoc's links to code, ``[`name`]``, mean nothing outside rustdoc: keeps the name.
fn without_doc_links(text: &str) -> String {
    let mut pieces = text.split("[`");
    let mut shown = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        match piece.split_once("`]") {
            // A path in brackets behind the name is rustdoc's too; a file's is a reader's.
            Some((name, rest)) if rest.starts_with("(crate::") => {
                let rest = rest.split_once(')').map_or("", |(_, rest)| rest);
                shown.extend(["`", name, "`", rest]);
            }
            Some((name, rest)) if !rest.starts_with('(') => shown.extend(["`", name, "`", rest]),
            _ => shown.extend(["[`", piece]),
        }
    }
    shown
}

/// The lines of the first block that ```` ```text ```` opens.
fn formula_of(comment: &[&str]) -> Option<Vec<String>> {
    let start = comment.iter().position(|line| line.trim() == "```text")? + 1;
    let length = comment[start..].iter().position(|line| line.trim() == "```")?;
    let lines: Vec<String> = comment[start..start + length].iter().map(|line| line.trim().to_owned()).collect();
    let lines: Vec<String> = lines.into_iter().filter(|line| !line.is_empty()).collect();
    (!lines.is_empty()).then_some(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
//! A file. Source: none.

/// The clipped objective.
///
/// ```text
/// L = min(r A, clip(r, 1 - e, 1 + e) A)
///   = |x|
/// ```
///
/// Source: Schulman et al. 2017,
/// equation 7. No deviation.
///
/// # Shapes
/// - `ratio`: B
#[must_use]
#[expect(
    clippy::many_single_char_names,
)]
pub const fn clipped_objective(ratio: f32) -> f32 {
    ratio
}

/// No equation: nothing says where it is from.
/// ```text
/// x = 1
/// ```
fn helper() {}

/// Not a function.
/// Source: a data sheet
pub const LIMIT_NM: f32 = 1.0;

impl<'a, T: Fn(f32) -> f32> core::fmt::Display for Leg<'a, T>
where
    T: Copy,
{
    /// ```text
    /// a = b
    /// ```
    /// Source: here
    fn height(&self) {}
}

#[cfg(test)]
mod tests {
    /// ```text
    /// c = d
    /// ```
    /// Source: a test
    fn f() {}
}
"#;

    #[test]
    fn equations_are_functions_with_a_source() {
        let found = equations(FILE);
        let expected = [
            Ok(Equation {
                name: "clipped_objective".to_owned(),
                formula: vec!["L = min(r A, clip(r, 1 - e, 1 + e) A)".to_owned(), "= |x|".to_owned()],
                source: "Schulman et al. 2017, equation 7. No deviation.".to_owned(),
            }),
            Ok(Equation {
                name: "Leg::height".to_owned(),
                formula: vec!["a = b".to_owned()],
                source: "here".to_owned(),
            }),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn rows_survive_bars_and_backticks() {
        let equation = Equation {
            name: "f".to_owned(),
            formula: vec!["|x|".to_owned(), "`y`".to_owned()],
            source: "a|b".to_owned(),
        };
        let expected = "| [`f`](../crates/gait/src/lib.rs) | `\\|x\\|`<br>`` `y` `` | a\\|b |\n";
        assert_eq!(row(&equation, "crates/gait/src/lib.rs"), expected);
    }

    #[test]
    fn links_to_code_become_names() {
        assert_eq!(without_doc_links("a [`b`], [`c`](d) and [e]"), "a `b`, [`c`](d) and [e]");
        assert_eq!(without_doc_links("[`f`](crate::g::f) of"), "`f` of");
    }

    #[test]
    fn a_source_in_the_middle_of_a_line_is_an_error() {
        let found = equations("/// Half. Source: here\nfn half() {}\n");
        assert_eq!(found, [Err("2: `half`: `Source:` has to begin a line of the comment".to_owned())]);
    }

    #[test]
    fn a_source_without_a_formula_is_an_error() {
        let found = equations("/// Half.\n///\n/// Source: here\nfn half() {}\n");
        assert_eq!(found, [Err("4: `half` has a `Source:` but no formula: write it in a ```text block".to_owned())]);
    }

    #[test]
    fn owners_are_types_and_traits() {
        for (head, expected) in [
            ("impl Clock", Some("Clock")),
            ("impl<const N: usize> Clock<N>", Some("Clock")),
            ("#[allow(x)] unsafe impl Send for a::Clock", Some("Clock")),
            ("pub trait VecEnv: Send", Some("VecEnv")),
            ("fn f(x: impl Fn())", None),
            ("pub struct Clock", None),
        ] {
            assert_eq!(owner(head).as_deref(), expected, "{head}");
        }
    }

    #[test]
    fn a_function_is_told_from_other_code() {
        assert_eq!(function_name("pub(crate) const unsafe fn f<T>("), Some("f"));
        assert_eq!(function_name("fn g("), Some("g"));
        assert_eq!(function_name("pub struct S { h: fn (f32) }"), None);
        assert_eq!(function_name("let x = 1;"), None);
    }
}
