//! Just enough reading of Rust files: what is code, what is test code, and which files there are.

use std::fs;
use std::path::{Path, PathBuf};

use crate::Failure;

/// Reads a file, or says which one cannot be read.
pub fn read(path: &Path) -> Result<String, Failure> {
    fs::read_to_string(path).map_err(|error| Failure::Task(format!("cannot read {}: {error}", path.display())))
}

/// Every `.rs` file under `folder`, sorted by path. A folder that is not there has none.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// `source` with every comment, string and character blanked out and nothing moved: same lines, same columns.
pub fn code_only(source: &str) -> String {
    let bytes = source.as_bytes();
    let mut code = bytes.to_vec();
    let mut i = 0;
    while i < bytes.len() {
        let end = match bytes[i] {
            b'/' if bytes[i..].starts_with(b"//") => end_of_line(bytes, i),
            b'/' if bytes[i..].starts_with(b"/*") => end_of_block_comment(bytes, i),
            b'"' => end_of_string(bytes, i + 1),
            b'r' => end_of_raw_string(bytes, i).unwrap_or(i),
            b'\'' => end_of_character(source, i).unwrap_or(i),
            _ => i,
        };
        if end == i {
            i += 1;
            continue;
        }
        for byte in code[i..end].iter_mut().filter(|byte| **byte != b'\n') {
            *byte = b' ';
        }
        i = end;
    }
    // Blanked pieces begin and end with ASCII characters, so what is left is whole characters.
    String::from_utf8(code).expect("only whole characters are blanked")
}

fn end_of_line(bytes: &[u8], start: usize) -> usize {
    bytes[start..].iter().position(|&byte| byte == b'\n').map_or(bytes.len(), |length| start + length)
}

fn end_of_block_comment(bytes: &[u8], start: usize) -> usize {
    let (mut depth, mut i) = (0, start);
    while i < bytes.len() {
        if bytes[i..].starts_with(b"/*") {
            depth += 1;
            i += 2;
        } else if bytes[i..].starts_with(b"*/") {
            depth -= 1;
            i += 2;
            if depth == 0 {
                return i;
            }
        } else {
            i += 1;
        }
    }
    bytes.len()
}

fn end_of_string(bytes: &[u8], mut i: usize) -> usize {
    while i < bytes.len() {
        match bytes[i] {
            b'\\' => i += 2,
            b'"' => return i + 1,
            _ => i += 1,
        }
    }
    bytes.len()
}

/// The end of the `r"..."` or `r#"..."#` at `start`, if there is one (an `r` may as well be part of a name).
fn end_of_raw_string(bytes: &[u8], start: usize) -> Option<usize> {
    let before = &bytes[..start];
    let before = before.strip_suffix(b"b").or(before.strip_suffix(b"c")).unwrap_or(before);
    if before.last().is_some_and(|&byte| is_name(byte)) {
        return None;
    }
    let hashes = bytes[start + 1..].iter().take_while(|&&byte| byte == b'#').count();
    let open = start + 1 + hashes;
    if bytes.get(open) != Some(&b'"') {
        return None;
    }
    let closing = [b"\"".as_slice(), &vec![b'#'; hashes]].concat();
    let length = bytes[open + 1..].windows(closing.len()).position(|window| window == closing);
    Some(length.map_or(bytes.len(), |length| open + 1 + length + closing.len()))
}

/// The end of the character literal at `start`; `None` for a lifetime or a label.
fn end_of_character(source: &str, start: usize) -> Option<usize> {
    let rest = &source[start + 1..];
    let first = rest.chars().next()?;
    if first == '\\' {
        // The escaped character itself may be a quote.
        let escape = rest.char_indices().nth(2)?.0;
        return rest[escape..].find('\'').map(|length| start + 1 + escape + length + 1);
    }
    let after = first.len_utf8();
    rest[after..].starts_with('\'').then_some(start + 1 + after + 1)
}

/// Whether the byte can be part of a Rust name.
pub fn is_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80
}

/// What [`code_only`] gave, with every item under `#[cfg(test)]` or `#[cfg(all(test, ...))]` blanked out too.
pub fn without_tests(code: &str) -> String {
    if code.contains("#![cfg(test)]") {
        return blank(code);
    }
    let mut shown = String::with_capacity(code.len());
    let mut rest = code;
    while let Some(start) =
        ["#[cfg(test)]", "#[cfg(all(test,"].iter().filter_map(|attribute| rest.find(attribute)).min()
    {
        let end = start + end_of_item(&rest[start..]);
        shown.push_str(&rest[..start]);
        shown.push_str(&blank(&rest[start..end]));
        rest = &rest[end..];
    }
    shown.push_str(rest);
    shown
}

fn blank(text: &str) -> String {
    text.chars().map(|character| if character == '\n' { '\n' } else { ' ' }).collect()
}

/// The length of the item that begins `code`: up to its first `;` or the end of its first block `{}`, attributes before
/// it and brackets inside its signature counted in.
fn end_of_item(code: &str) -> usize {
    let (mut brackets, mut braces) = (0, 0);
    for (i, byte) in code.bytes().enumerate() {
        match byte {
            b'(' | b'[' => brackets += 1,
            b')' | b']' => brackets -= 1,
            b'{' => braces += 1,
            b'}' => {
                braces -= 1;
                if braces <= 0 {
                    return i + 1;
                }
            }
            b';' if brackets == 0 && braces == 0 => return i + 1,
            _ => {}
        }
    }
    code.len()
}

/// The lines, counted from 1, in which `word` stands by itself: no name goes on before it.
pub fn lines_with<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    code.lines().enumerate().filter(move |(_, line)| has_word(line, word)).map(|(i, _)| i + 1)
}

fn has_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| !line.as_bytes()[..at].last().is_some_and(|&byte| is_name(byte)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_strings_and_characters_are_blanked() {
        for (source, expected) in [
            ("a // b\nc", "a     \nc"),
            ("a /* b /* c */ d */ e", "a                   e"),
            (r#"a("b \" c") d"#, "a(        ) d"),
            (r##"a(r#"b " c"#) d"##, "a(          ) d"),
            (r#"a(br"\") d"#, "a(b    ) d"),
            (r"f('\'', '\\', '\u{e9}', 'é', '{')", "f(    ,     ,         ,     ,    )"),
            ("fn f<'a>(x: &'a str) {}", "fn f<'a>(x: &'a str) {}"),
            ("r#type + bar", "r#type + bar"),
        ] {
            assert_eq!(code_only(source), expected);
        }
    }

    #[test]
    fn test_items_are_blanked() {
        let code = "a();\n#[cfg(test)]\n#[rustfmt::skip]\nmod tests {\n    fn f() { b(); }\n}\nc();\n";
        assert_eq!(without_tests(code).split_whitespace().collect::<Vec<_>>(), ["a();", "c();"]);
        assert_eq!(without_tests(code).lines().count(), code.lines().count());
        assert_eq!(without_tests("#[cfg(test)] extern crate std; d();").trim(), "d();");
        assert_eq!(without_tests("#[cfg(test)] fn f(x: [u8; 2]) { e(); } d();").trim(), "d();");
        assert_eq!(without_tests("#[cfg(not(test))] d();"), "#[cfg(not(test))] d();");
        assert_eq!(without_tests("#![cfg(test)]\nd();").trim(), "");
    }

    #[test]
    fn words_are_whole() {
        let code = "println!();\neprintln!();\nx.my_println!()\nstd::println!();";
        assert_eq!(lines_with(code, "println!").collect::<Vec<_>>(), [1, 4]);
        assert_eq!(lines_with("xstd::a\nstd::b", "std::").collect::<Vec<_>>(), [2]);
    }
}
