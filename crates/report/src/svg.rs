//! A drawing in SVG: few elements, colours by class, numbers with two decimals. `docs/adr` says why there is no crate.

use std::fmt::Write;

/// Text as it may stand in XML and HTML, in elements and in quoted attributes. Control characters, which XML has no way
/// to write, become a replacement character.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' => escaped.push(' '),
            character if character.is_control() || matches!(character, '\u{fffe}' | '\u{ffff}') => {
                escaped.push('\u{fffd}');
            }
            character => escaped.push(character),
        }
    }
    escaped
}

/// Text for an HTML element, names in backticks set as code. A backtick without a partner stays what it is.
pub fn prose(text: &str) -> String {
    let pieces: Vec<&str> = text.split('`').collect();
    let paired = pieces.len() - (pieces.len() + 1) % 2;
    let mut html = String::new();
    for (i, piece) in pieces.iter().enumerate() {
        match (i % 2, i < paired) {
            (1, true) => html += &format!("<code>{}</code>", escape(piece)),
            (_, true) => html += &escape(piece),
            (_, false) => html += &format!("`{}", escape(piece)),
        }
    }
    html
}

/// A coordinate: at most two decimals, no trailing zeros, no minus before zero.
pub fn coordinate(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Width of a text in the figures' typeface [em], from the mean widths of a grotesque; good to a tenth.
pub fn text_width_em(text: &str) -> f64 {
    text.chars()
        .map(|character| match character {
            'i' | 'j' | 'l' | 't' | 'f' | 'r' | '.' | ',' | ':' | ' ' | '|' | '(' | ')' | '[' | ']' => 0.32,
            'm' | 'w' | 'M' | 'W' | '%' | '\u{00d7}' => 0.83,
            character if character.is_ascii_uppercase() => 0.68,
            character if character.is_ascii() => 0.55,
            _ => 0.75,
        })
        .sum()
}

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The point is at its left end.
    Start,
    /// The point is at its middle.
    Middle,
    /// The point is at its right end.
    End,
}

/// The content of a drawing.
#[derive(Clone, Debug, Default)]
pub struct Drawing {
    body: String,
}

impl Drawing {
    /// The elements so far.
    pub fn into_body(self) -> String {
        self.body
    }

    /// A straight line.
    pub fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(coordinate);
        let _ = write!(self.body, r#"<path class="{class}" d="M{x1} {y1}L{x2} {y2}"/>"#);
    }

    /// Straight lines from point to point; nothing for fewer than two.
    pub fn polyline(&mut self, class: &str, points: &[(f64, f64)]) {
        if points.len() > 1 {
            let _ = write!(self.body, r#"<path class="{class}" d="{}"/>"#, path(points));
        }
    }

    /// A closed, filled shape.
    pub fn polygon(&mut self, class: &str, points: &[(f64, f64)]) {
        if points.len() > 2 {
            let _ = write!(self.body, r#"<path class="{class}" d="{}Z"/>"#, path(points));
        }
    }

    /// An upright rectangle from its upper left corner, with rounded corners.
    pub fn rectangle(&mut self, class: &str, corner: (f64, f64), size: (f64, f64), radius: f64) {
        let [x, y, width, height] = [corner.0, corner.1, size.0.max(0.0), size.1.max(0.0)].map(coordinate);
        let rounded = if radius > 0.0 { format!(r#" rx="{}""#, coordinate(radius)) } else { String::new() };
        let _ =
            write!(self.body, r#"<rect class="{class}" x="{x}" y="{y}" width="{width}" height="{height}"{rounded}/>"#);
    }

    /// A filled circle; `tip` is what a pointer over it is told.
    pub fn dot(&mut self, class: &str, centre: (f64, f64), radius: f64, tip: Option<&str>) {
        let [x, y, r] = [centre.0, centre.1, radius].map(coordinate);
        let _ = match tip {
            None => write!(self.body, r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"/>"#),
            Some(tip) => write!(
                self.body,
                r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"><title>{}</title></circle>"#,
                escape(tip)
            ),
        };
    }

    /// A line of text.
    pub fn text(&mut self, class: &str, at: (f64, f64), anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => r#" text-anchor="middle""#,
            Anchor::End => r#" text-anchor="end""#,
        };
        let [x, y] = [at.0, at.1].map(coordinate);
        let _ = write!(self.body, r#"<text class="{class}" x="{x}" y="{y}"{anchor}>{}</text>"#, escape(text));
    }
}

fn path(points: &[(f64, f64)]) -> String {
    let mut path = String::new();
    for (i, point) in points.iter().enumerate() {
        let command = if i == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{command}{} {}", coordinate(point.0), coordinate(point.1));
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_backticks_become_code_and_stay_harmless() {
        assert_eq!(prose("`a<b` and `c`."), "<code>a&lt;b</code> and <code>c</code>.");
        assert_eq!(prose("one ` alone"), "one ` alone");
        assert_eq!(prose("`a` and ` alone"), "<code>a</code> and ` alone");
        assert_eq!(prose("plain"), "plain");
    }

    #[test]
    fn text_cannot_leave_its_element() {
        assert_eq!(escape("</text><script>'&\""), "&lt;/text&gt;&lt;script&gt;&#39;&amp;&quot;");
        assert_eq!(escape("a\u{0}b\nc"), "a\u{fffd}b c");
    }

    #[test]
    fn coordinates_are_short() {
        let texts = [1.0, 0.125, -0.001, 10.5, 100.0].map(coordinate);
        assert_eq!(texts, ["1", "0.12", "0", "10.5", "100"]);
    }

    #[test]
    fn a_line_needs_two_points() {
        let mut drawing = Drawing::default();
        drawing.polyline("a", &[(1.0, 2.0)]);
        drawing.polyline("a", &[(1.0, 2.0), (3.0, 4.5)]);
        assert_eq!(drawing.into_body(), r#"<path class="a" d="M1 2L3 4.5"/>"#);
    }
}
