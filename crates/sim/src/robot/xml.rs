//! The text of a model's file, made fit for a strict parser, or refused.

/// Deepest nesting of elements: MuJoCo and [`super::screen`] walk them by recursion. A deep robot has 20.
const MAX_DEPTH: usize = 64;

/// Most attributes of an element: the parser compares each with all others. MuJoCo knows 40 at most.
const MAX_ATTRIBUTES: usize = 256;

/// Most elements of a file, and of a model when all that it includes and repeats is written out: ten times what robots
/// with hundreds of parts have. MuJoCo's time grows faster than their number.
pub(super) const MAX_ELEMENTS: u64 = 20_000;

/// Where a text is wrong, and how.
#[derive(Debug, PartialEq)]
pub(super) struct Fault {
    /// Line, from 1; `None` for the whole file.
    pub line: Option<usize>,
    /// What is wrong, and what was expected.
    pub message: String,
}

/// The text with its comments turned into blanks, every other byte at its place.
///
/// MuJoCo takes comments with `--` inside, which XML forbids and many models have.
///
/// # Errors
/// What would cost the parser much time or memory, and document types: their entities can stand for any amount of text.
pub(super) fn without_comments(text: &str) -> Result<String, Fault> {
    let mut plain = String::with_capacity(text.len());
    let (mut depth, mut num_elements) = (0_usize, 0_u64);
    while let Some(start) = text[plain.len()..].find('<') {
        let begin = plain.len() + start;
        plain.push_str(&text[plain.len()..begin]);
        let rest = &text[begin..];
        let fault = |message: String| Fault { line: Some(Lines::new(text).at(begin)), message };
        let up_to = |end: &str| rest.find(end).map(|at| at + end.len());
        let length = if let Some(comment) = rest.strip_prefix("<!--") {
            // The end may not overlap the beginning: `<!-->` is open.
            comment.find("-->").map(|at| "<!--".len() + at + "-->".len())
        } else if rest.starts_with("<![CDATA[") {
            up_to("]]>")
        } else if rest.starts_with("<?") {
            up_to("?>")
        } else if rest.starts_with("<!") {
            return Err(fault("document types and entities are refused; write out what they stand for".to_owned()));
        } else {
            let tag = Tag::new(rest);
            if let Some(tag) = &tag {
                if tag.num_attributes > MAX_ATTRIBUTES {
                    return Err(fault(format!("expected at most {MAX_ATTRIBUTES} attributes in one element")));
                }
                depth = if tag.is_end { depth.saturating_sub(1) } else { depth + usize::from(tag.is_open) };
                num_elements += u64::from(!tag.is_end);
            }
            tag.map(|tag| tag.length)
        };
        let Some(length) = length else {
            return Err(fault("not well-formed XML: this tag or comment has no end".to_owned()));
        };
        if depth > MAX_DEPTH {
            return Err(fault(format!("expected at most {MAX_DEPTH} elements inside each other")));
        }
        if num_elements > MAX_ELEMENTS {
            return Err(fault(format!("expected at most {MAX_ELEMENTS} elements")));
        }
        if rest.starts_with("<!--") {
            plain.extend(rest[..length].bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }));
        } else {
            plain.push_str(&rest[..length]);
        }
    }
    plain.push_str(&text[plain.len()..]);
    Ok(plain)
}

/// A tag, `<...>`, as far as it matters here.
struct Tag {
    /// Bytes from `<` to `>`.
    length: usize,
    num_attributes: usize,
    /// `</name>`.
    is_end: bool,
    /// `<name>`, which an end tag has to follow.
    is_open: bool,
}

impl Tag {
    /// The tag that `text` begins with; `None` if it has no end.
    fn new(text: &str) -> Option<Self> {
        let bytes = text.as_bytes();
        let (mut quote, mut num_attributes) = (None, 0);
        for (i, &byte) in bytes.iter().enumerate().skip(1) {
            match (quote, byte) {
                (_, b'<') => return None,
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => num_attributes += 1,
                (None, b'>') => {
                    let is_end = bytes[1] == b'/';
                    return Some(Self { length: i + 1, num_attributes, is_end, is_open: bytes[i - 1] != b'/' });
                }
                (Some(open), _) if open == byte => quote = None,
                _ => {}
            }
        }
        None
    }
}

/// Line numbers of places in a text that are asked for in their order: each costs the way from the one before.
pub(super) struct Lines<'a> {
    text: &'a str,
    byte: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { text, byte: 0, line: 1 }
    }

    /// The line of a byte at or after the one before.
    pub fn at(&mut self, byte: usize) -> usize {
        let passed = self.text.as_bytes().get(self.byte..byte).unwrap_or_default();
        self.line += passed.iter().filter(|&&byte| byte == b'\n').count();
        self.byte = self.byte.max(byte);
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_become_blanks_and_nothing_else_does() {
        let text = "<?xml?>\n<a><!-- -- ü\n--><b x='<!--'/></a>";
        assert_eq!(without_comments(text), Err(Fault { line: Some(3), message: NO_END.to_owned() }));
        let text = "<?xml?>\n<a><!-- -- ü\n--><b x='&lt;!--'/><![CDATA[<!-- ]]><c y=\"-->\"/></a>";
        let blanks = " ".repeat("<!-- -- ü".len());
        let expected = format!("<?xml?>\n<a>{blanks}\n   <b x='&lt;!--'/><![CDATA[<!-- ]]><c y=\"-->\"/></a>");
        assert_eq!(without_comments(text), Ok(expected));
    }

    const NO_END: &str = "not well-formed XML: this tag or comment has no end";

    #[test]
    fn what_has_no_end_is_refused() {
        for text in ["<a>\n<!-->", "<a>\n<b", "<a>\n<b x='>", "<a>\n<![CDATA[ ]]", "<a>\n<? >", "<a>\n<b <c>", "\n<"] {
            assert_eq!(without_comments(text), Err(Fault { line: Some(2), message: NO_END.to_owned() }), "{text}");
        }
    }

    #[test]
    fn what_costs_too_much_is_refused() {
        let refused = |text: &str| without_comments(text).unwrap_err().message;
        assert!(without_comments(&"<a>".repeat(64)).is_ok());
        assert_eq!(refused(&"<a>".repeat(65)), "expected at most 64 elements inside each other");
        assert!(without_comments(&"<a></a><b/>".repeat(10_000)).is_ok());
        assert_eq!(refused(&"<a/>".repeat(20_001)), "expected at most 20000 elements");
        assert_eq!(refused(&format!("<a{}/>", " b=''".repeat(257))), "expected at most 256 attributes in one element");
        assert!(refused("<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>").starts_with("document types"));
    }

    #[test]
    fn lines_count_from_one() {
        let mut lines = Lines::new("a\nb\n\nc");
        assert_eq!([0, 1, 2, 2, 5, 100].map(|byte| lines.at(byte)), [1, 1, 2, 2, 4, 4]);
    }
}
