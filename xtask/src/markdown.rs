//! What the repository's pages hold: blocks of code, code between words, links. `crates/cli/src/documents.rs` reads them
//! with this file too.

use std::ops::Range;

/// A block between fences.
#[derive(Debug, PartialEq, Eq)]
pub struct Block<'a> {
    /// The line of its opening fence, from 1.
    pub line: usize,
    /// What stands behind the opening fence: `sh`, `python sb3`, or nothing.
    pub language: &'a str,
    pub lines: Vec<&'a str>,
}

/// The page's blocks, in its order.
pub fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut blocks: Vec<Block<'_>> = Vec::new();
    let mut is_inside = false;
    for (index, line) in page.lines().enumerate() {
        match (line.trim_start().strip_prefix("```"), blocks.last_mut()) {
            (Some(_), _) if is_inside => is_inside = false,
            (Some(language), _) => {
                is_inside = true;
                blocks.push(Block { line: index + 1, language: language.trim(), lines: Vec::new() });
            }
            (None, Some(block)) if is_inside => block.lines.push(line),
            (None, _) => {}
        }
    }
    blocks
}

/// Code between words, with the line that it begins in. A line break inside is a blank.
#[allow(dead_code, reason = "the program's tests need it, the tasks do not")]
pub fn spans(page: &str) -> Vec<(usize, String)> {
    let prose = without_blocks(page);
    let mut spans = Vec::new();
    let mut rest = 0;
    while let Some(start) = prose[rest..].find('`').map(|at| rest + at) {
        let fence = prose[start..].bytes().take_while(|&byte| byte == b'`').count();
        let inside = start + fence;
        let Some(length) = prose[inside..].find(&prose[start..inside]) else { break };
        let line = prose[..start].matches('\n').count() + 1;
        spans.push((line, prose[inside..inside + length].replace('\n', " ")));
        rest = inside + length + fence;
    }
    spans
}

/// Where in the page the targets of its links and pictures stand, `](here)`; not those inside code.
pub fn links(page: &str) -> Vec<Range<usize>> {
    let prose = without_code(page);
    let mut links = Vec::new();
    for (at, _) in prose.match_indices("](") {
        let start = at + 2;
        if let Some(length) = prose[start..].find(')')
            && !prose[start..start + length].contains(char::is_whitespace)
        {
            links.push(start..start + length);
        }
    }
    links
}

/// The page with its blocks blanked out, every other byte where it was.
fn without_blocks(page: &str) -> String {
    let mut is_inside = false;
    let mut prose = String::with_capacity(page.len());
    for line in page.split_inclusive('\n') {
        let is_fence = line.trim_start().starts_with("```");
        if is_fence || is_inside {
            prose.push_str(&line.chars().map(blank).collect::<String>());
        } else {
            prose.push_str(line);
        }
        is_inside ^= is_fence;
    }
    prose
}

/// As many blanks as the character has bytes.
fn blank(character: char) -> String {
    if character == '\n' { "\n".to_owned() } else { " ".repeat(character.len_utf8()) }
}

fn without_code(page: &str) -> String {
    let mut prose = without_blocks(page);
    let mut rest = 0;
    while let Some(start) = prose[rest..].find('`').map(|at| rest + at) {
        let Some(length) = prose[start + 1..].find('`') else { break };
        let end = start + length + 2;
        let blanks: String = prose[start..end].chars().map(blank).collect();
        prose.replace_range(start..end, &blanks);
        rest = end;
    }
    prose
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "\
# A page of `code`
See [a](b.md#c) and ![p](p.svg), not `[x](y)`.
```sh wheel
one [z](w)
```
and `two
words`
";

    #[test]
    fn blocks_have_their_line_and_language() {
        assert_eq!(blocks(PAGE), [Block { line: 3, language: "sh wheel", lines: vec!["one [z](w)"] }]);
    }

    #[test]
    fn code_between_words_may_go_over_a_line() {
        let expected = [(1, "code".to_owned()), (2, "[x](y)".to_owned()), (6, "two words".to_owned())];
        assert_eq!(spans(PAGE), expected);
    }

    #[test]
    fn links_are_found_outside_of_code() {
        let targets: Vec<&str> = links(PAGE).into_iter().map(|link| &PAGE[link]).collect();
        assert_eq!(targets, ["b.md#c", "p.svg"]);
    }
}
