//! Tables: rounded with their units on the page, in full in CSV files.

use std::fmt::Write;

use crate::chart::quantity;
use crate::palette::Tone;
use crate::svg::{escape, prose};

/// What stands in a cell.
#[derive(Clone, Debug)]
pub enum Cell {
    /// Words.
    Text(String),
    /// The name of a gait, in its colour.
    Gait(String, Tone),
    /// A number with its decimals on the page.
    Number(f64, usize),
    /// A number with its 95 % interval, and decimals.
    Interval(f64, [f64; 2], usize),
    /// A whole number.
    Count(u64),
    /// Whether a claim holds; none: open.
    Holds(Option<bool>),
    /// No value.
    Missing,
}

impl From<(Option<f64>, usize)> for Cell {
    fn from((value, decimals): (Option<f64>, usize)) -> Self {
        value.map_or(Self::Missing, |value| Self::Number(value, decimals))
    }
}

/// A column: its name in the file, its head on the page, its unit.
pub type Column = (&'static str, &'static str, &'static str);

/// One table.
#[derive(Clone, Debug)]
pub struct Table {
    /// Name of its file, and its anchor on the page.
    pub name: &'static str,
    /// Left to right.
    pub columns: Vec<Column>,
    /// Top to bottom, a cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

/// Every name that a table may have.
pub const NAMES: [&str; 6] = ["points", "gaits", "seeds", "claims", "sweeps", "learning"];

impl Table {
    /// For a page, in a box of its own that scrolls.
    pub fn html(&self) -> String {
        let mut html = format!(
            "<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"table: {0}\"><table class=\"{0}\">\n<thead><tr>",
            self.name
        );
        for (i, (_, head, unit)) in self.columns.iter().enumerate() {
            let class = if self.is_of_numbers(i) { " class=\"n\"" } else { "" };
            let unit = if unit.is_empty() { String::new() } else { format!(" <small>{unit}</small>") };
            let _ = write!(html, "<th scope=\"col\"{class}>{head}{unit}</th>");
        }
        html.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            html.push_str("<tr>");
            for cell in row {
                html.push_str(&cell.html());
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table></div>\n");
        html
    }

    fn is_of_numbers(&self, column: usize) -> bool {
        self.rows.iter().any(|row| matches!(row[column], Cell::Number(..) | Cell::Interval(..) | Cell::Count(_)))
    }

    /// RFC 4180, with a head of names; an interval takes three columns.
    pub fn csv(&self) -> String {
        let mut csv = String::new();
        let has_interval = |column: usize| self.rows.iter().any(|row| matches!(row[column], Cell::Interval(..)));
        let names: Vec<String> = self
            .columns
            .iter()
            .enumerate()
            .flat_map(|(i, (name, _, _))| {
                let mut names = vec![(*name).to_owned()];
                if has_interval(i) {
                    names.extend([format!("{name}_low"), format!("{name}_high")]);
                }
                names
            })
            .collect();
        let _ = write!(csv, "{}\r\n", names.join(","));
        for row in &self.rows {
            let mut cells = Vec::new();
            for (i, cell) in row.iter().enumerate() {
                match cell {
                    Cell::Text(text) | Cell::Gait(text, _) => cells.push(quoted(text)),
                    Cell::Number(value, _) => cells.push(value.to_string()),
                    Cell::Interval(value, _, _) => cells.push(value.to_string()),
                    Cell::Count(count) => cells.push(count.to_string()),
                    Cell::Holds(holds) => cells.push(verdict(*holds).to_owned()),
                    Cell::Missing => cells.push(String::new()),
                }
                match cell {
                    Cell::Interval(_, ends, _) => cells.extend(ends.map(|end| end.to_string())),
                    _ if has_interval(i) => cells.extend([String::new(), String::new()]),
                    _ => {}
                }
            }
            let _ = write!(csv, "{}\r\n", cells.join(","));
        }
        csv
    }
}

impl Cell {
    fn html(&self) -> String {
        match self {
            Self::Text(text) => format!("<td>{}</td>", prose(text)),
            Self::Gait(name, tone) => format!(
                "<th scope=\"row\"><svg class=\"chip\" viewBox=\"0 0 10 10\" aria-hidden=\"true\"><circle class=\"{}\" \
                 cx=\"5\" cy=\"5\" r=\"5\"/></svg>{}</th>",
                tone.fill(),
                escape(name)
            ),
            Self::Number(value, decimals) => format!("<td class=\"n\">{}</td>", quantity(*value, *decimals)),
            Self::Interval(value, [low, high], decimals) => format!(
                "<td class=\"n\">{} <small>{} to {}</small></td>",
                quantity(*value, *decimals),
                quantity(*low, *decimals),
                quantity(*high, *decimals)
            ),
            Self::Count(count) => format!("<td class=\"n\">{}</td>", grouped(*count)),
            Self::Holds(holds) => {
                let (class, sign) = match holds {
                    Some(true) => ("yes", "\u{2713}"),
                    Some(false) => ("no", "\u{2717}"),
                    None => ("open", "?"),
                };
                format!("<td class=\"holds {class}\"><span aria-hidden=\"true\">{sign}</span> {}</td>", verdict(*holds))
            }
            Self::Missing => "<td class=\"n\">\u{2013}</td>".to_owned(),
        }
    }
}

fn verdict(holds: Option<bool>) -> &'static str {
    match holds {
        Some(true) => "holds",
        Some(false) => "does not hold",
        None => "open",
    }
}

/// A whole number with thin spaces between its thousands.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let first = digits.len() % 3;
    let mut grouped = digits[..first].to_owned();
    for group in digits.as_bytes()[first..].chunks(3) {
        if !grouped.is_empty() {
            grouped.push('\u{202f}');
        }
        grouped.extend(group.iter().map(|&digit| char::from(digit)));
    }
    grouped
}

fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\r', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_rounded_numbers_on_the_page_and_full_ones_in_the_file() {
        let table = Table {
            name: "gaits",
            columns: vec![("gait", "gait", ""), ("speed_m_per_s", "speed", "m/s"), ("falls", "falls", "")],
            rows: vec![
                vec![Cell::Text("a, \"b\" <i>".into()), Cell::Interval(0.525_608_8, [0.5, 0.55], 2), Cell::Count(1200)],
                vec![Cell::Text("c".into()), Cell::Missing, Cell::Count(0)],
            ],
        };
        let html = table.html();
        assert!(
            html.contains("<td>a, &quot;b&quot; &lt;i&gt;</td><td class=\"n\">0.53 <small>0.50 to 0.55</small></td>")
        );
        assert!(html.contains("<td class=\"n\">1\u{202f}200</td>"), "{html}");
        assert_eq!(
            table.csv(),
            "gait,speed_m_per_s,speed_m_per_s_low,speed_m_per_s_high,falls\r\n\"a, \"\"b\"\" <i>\",0.5256088,0.5,0.55,1200\r\nc,,,,0\r\n"
        );
    }

    #[test]
    fn thousands_are_grouped() {
        assert_eq!(
            [0, 12, 999, 1000, 1_234_567].map(grouped),
            ["0", "12", "999", "1\u{202f}000", "1\u{202f}234\u{202f}567"]
        );
    }
}
