//! The page: one HTML file that needs nothing else.

use std::fmt::Write;

use crate::figures::recorded::Recorded;
use crate::figures::{Figure, Flow, inline};
use crate::palette::{dark_css, light_css};
use crate::replay;
use crate::svg::{escape, prose};
use crate::tables::Table;

/// A figure that stands large at the top.
pub struct BigNumber {
    /// The number.
    pub value: String,
    /// Behind it, smaller.
    pub unit: String,
    /// Below it.
    pub meaning: String,
}

/// A part of a page.
pub enum Part {
    /// A paragraph.
    Text(String),
    /// A list of names with what they are.
    Names(Vec<(String, String)>),
    /// A figure, by its name.
    Figure(&'static str),
    /// A table, by its name.
    Table(&'static str),
}

/// A section with its heading.
pub struct Section {
    /// Anchor.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Below the heading.
    pub parts: Vec<Part>,
}

/// All that a page shows. Texts are plain: escaping is the page's.
pub struct Page<'a> {
    /// In the browser's title bar.
    pub title: String,
    /// Above the verdict: what was looked at.
    pub subject: String,
    /// The verdict in one sentence.
    pub verdict: String,
    /// The verdict in numbers.
    pub numbers: Vec<BigNumber>,
    /// What a reader has to know before believing it.
    pub notes: Vec<String>,
    /// In reading order; figures and tables that are not there are passed over.
    pub sections: Vec<Section>,
    /// All figures.
    pub figures: &'a [Figure],
    /// All tables.
    pub tables: &'a [Table],
    /// What the replay shows.
    pub recorded: &'a [Recorded<'a>],
    /// How it was measured; a paragraph a line.
    pub protocol: String,
}

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The page's bytes.
pub fn html(page: &Page<'_>) -> String {
    let mut body = String::new();
    let _ = write!(
        body,
        "<p class=\"over\">{}</p>\n<h1>{}</h1>\n<dl class=\"numbers\">",
        escape(&page.subject),
        escape(&page.verdict)
    );
    for number in &page.numbers {
        let _ = write!(
            body,
            "<div><dd>{} <small>{}</small></dd><dt>{}</dt></div>",
            escape(&number.value),
            escape(&number.unit),
            escape(&number.meaning)
        );
    }
    body.push_str("</dl>\n");
    for note in &page.notes {
        let _ = writeln!(body, "<p class=\"note\">{}</p>", escape(note));
    }
    let sections: Vec<(&Section, String)> = page
        .sections
        .iter()
        .map(|section| (section, section_html(section, page)))
        .filter(|(_, html)| !html.is_empty())
        .collect();
    body.push_str("<nav aria-label=\"sections\">");
    let own = [("replay", "Replay"), ("protocol", "How it was measured")];
    let own = own.into_iter().filter(|(id, _)| *id != "replay" || !page.recorded.is_empty());
    for (id, title) in sections.iter().map(|(section, _)| (section.id, section.title)).chain(own) {
        let _ = write!(body, "<a href=\"#{id}\">{title}</a> ");
    }
    body.push_str("</nav>\n");
    for (section, html) in &sections {
        let _ = write!(body, "<section id=\"{}\">\n<h2>{}</h2>\n{html}</section>\n", section.id, section.title);
    }
    if !page.recorded.is_empty() {
        body.push_str(&replay_html(page.recorded));
    }
    let _ = write!(
        body,
        "<section id=\"protocol\">\n<h2>How it was measured</h2>\n{}</section>\n\
         <footer>Made by canter from recorded data. The figures are in <code>figures/</code>, the tables with all digits \
         in <code>tables/</code>, beside this page.</footer>\n",
        page.protocol
            .split('\n')
            .filter(|line| !line.trim().is_empty())
            .map(|line| format!("<p class=\"lead\">{}</p>\n", escape(line)))
            .collect::<String>()
    );
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
         script-src 'unsafe-inline'; img-src data:\">\n\
         <link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>\n{}\n@media screen and (prefers-color-scheme:dark){{{}}}\n{STYLE}</style>\n\
         </head>\n<body>\n<main>\n{body}</main>\n{}</body>\n</html>\n",
        escape(&page.title),
        light_css(),
        dark_css(),
        if page.recorded.is_empty() { String::new() } else { format!("<script>\n{SCRIPT}</script>\n") },
    )
}

fn section_html(section: &Section, page: &Page<'_>) -> String {
    let mut html = String::new();
    let mut has_content = false;
    for part in &section.parts {
        match part {
            Part::Text(text) => {
                let _ = writeln!(html, "<p class=\"lead\">{}</p>", prose(text));
            }
            Part::Names(names) => {
                html.push_str("<dl class=\"names\">");
                for (name, text) in names {
                    let _ = write!(html, "<dt>{}</dt><dd>{}</dd>", escape(name), prose(text));
                }
                html.push_str("</dl>\n");
            }
            Part::Figure(name) => {
                if let Some(figure) = page.figures.iter().find(|figure| figure.name == *name) {
                    html.push_str(&figure_html(figure));
                    has_content = true;
                }
            }
            Part::Table(name) => {
                if let Some(table) = page.tables.iter().find(|table| table.name == *name) {
                    html.push_str(&table.html());
                    has_content = true;
                }
            }
        }
    }
    if has_content { html } else { String::new() }
}

fn figure_html(figure: &Figure) -> String {
    let mut html = format!("<figure id=\"fig-{}\">\n<h3>{}</h3>\n", figure.name, escape(&figure.title));
    for group in &figure.groups {
        html.push_str("<div class=\"group\">");
        if let Some((heading, tone)) = &group.heading {
            let class = tone.map_or(String::new(), |tone| format!(" class=\"{}\"", tone.text()));
            let _ = write!(html, "<p{class}>{}</p>", escape(heading));
        }
        let class = match group.flow {
            Flow::Strip => "strip",
            Flow::Pairs if group.panels.len() == 1 => "pairs one",
            Flow::Pairs => "pairs",
        };
        let _ = write!(html, "<div class=\"{class}\">");
        for panel in &group.panels {
            html.push_str(&inline(panel));
        }
        html.push_str("</div></div>\n");
    }
    let _ = write!(html, "<figcaption>{}</figcaption>\n</figure>\n", escape(&figure.caption));
    html
}

fn replay_html(recorded: &[Recorded<'_>]) -> String {
    let mut html = String::from(
        "<section id=\"replay\">\n<h2>Replay</h2>\n<p class=\"lead\">The recorded episodes side by side, at the same \
         clock, each seen from its robot\u{2019}s right. A large foot is on the ground. Marks on the ground \
         count the way along the robot\u{2019}s heading; beside the name stands how far it has come forward. Key k: play or \
         pause.</p>\n<div class=\"replay-bar\">\
         <button type=\"button\" id=\"replay-play\" aria-pressed=\"false\">Play</button>\
         <input type=\"range\" id=\"replay-scrub\" min=\"0\" max=\"1\" step=\"0.01\" value=\"0\" aria-label=\"time [s]\">\
         <span id=\"replay-clock\">0.00 s</span><fieldset aria-label=\"speed\">",
    );
    for (value, name, checked) in [("1", "1\u{00d7}", " checked"), ("0.25", "0.25\u{00d7}", "")] {
        let _ = write!(
            html,
            "<label><input type=\"radio\" name=\"replay-speed\" value=\"{value}\"{checked}>{name}</label>"
        );
    }
    let mut slopes_deg: Vec<f64> = recorded.iter().map(|(_, trajectory)| trajectory.slope_deg).collect();
    slopes_deg.dedup();
    if slopes_deg.len() > 1 {
        html.push_str("</fieldset><fieldset aria-label=\"ground\">");
        for (i, slope_deg) in slopes_deg.into_iter().enumerate() {
            let name = if slope_deg == 0.0 { "level".to_owned() } else { format!("{slope_deg}\u{b0} uphill") };
            let checked = if i == 0 { " checked" } else { "" };
            let _ = write!(
                html,
                "<label><input type=\"radio\" name=\"replay-ground\" value=\"{slope_deg}\"{checked}>{name}</label>"
            );
        }
    }
    let _ = write!(
        html,
        "</fieldset></div>\n<div id=\"replay-stage\"></div>\n<noscript><p class=\"note\">The replay needs \
         JavaScript; the film strips above show the same.</p></noscript>\n\
         <script type=\"application/json\" id=\"replay-data\">{}</script>\n</section>\n",
        replay::data(recorded)
    );
    html
}
