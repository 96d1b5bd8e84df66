//! The figures: panels that a page lets flow, and that a file shows in a grid.

pub mod comparison;
pub mod recorded;
pub mod rows;
pub mod run;

use std::fmt::Write;

use crate::chart::Panel;
use crate::palette::{Tone, light_css};
use crate::svg::{Anchor, Drawing, coordinate};

/// Space between panels of a file.
const GAP: f64 = 24.0;

/// A gait on a page.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Name in the files.
    pub key: String,
    /// Name for people.
    pub label: String,
    /// Its colour.
    pub tone: Tone,
}

/// How the panels of a group flow on a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Two in a row, one on a phone.
    Pairs,
    /// Many in a row, half as many on a phone.
    Strip,
}

/// Panels that belong together.
#[derive(Clone, Debug)]
pub struct Group {
    /// What they share, with the gait's tone if it is a gait.
    pub heading: Option<(String, Option<Tone>)>,
    /// On a page.
    pub flow: Flow,
    /// In a file.
    pub columns: usize,
    /// In reading order.
    pub panels: Vec<Panel>,
}

impl Group {
    /// Panels in pairs, without a heading.
    pub fn pairs(panels: Vec<Panel>) -> Self {
        Self { heading: None, flow: Flow::Pairs, columns: 2, panels }
    }
}

/// One figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files, and its anchor on the page.
    pub name: &'static str,
    /// Above it.
    pub title: String,
    /// Below it: what is drawn, over how many seeds and episodes, what a band is.
    pub caption: String,
    /// From top to bottom.
    pub groups: Vec<Group>,
}

/// Every name that a figure may have; files of the other figures are left from an earlier report.
pub const NAMES: [&str; 19] = [
    "dial",
    "ladder",
    "learning",
    "return",
    "film-strip",
    "footfall",
    "foot-paths",
    "speed-per-step",
    "uphill",
    "slope",
    "friction",
    "mass",
    "delay",
    "push",
    "other-sweeps",
    "energy",
    "torque",
    "leg-space",
    "falls",
];

/// A panel as an element of a page.
pub fn inline(panel: &Panel) -> String {
    format!(
        r#"<svg viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>"#,
        coordinate(panel.size.0),
        coordinate(panel.size.1),
        crate::svg::escape(&panel.alt),
        panel.body
    )
}

/// A figure as a file of its own, on a light ground.
pub fn standalone(figure: &Figure) -> String {
    let mut body = String::new();
    let (mut top, mut width): (f64, f64) = (GAP, 0.0);
    for group in &figure.groups {
        if let Some((heading, tone)) = &group.heading {
            let mut drawing = Drawing::default();
            let class = tone.map_or_else(|| "ttl".to_owned(), |tone| format!("ttl {}", tone.text()));
            drawing.text(&class, (GAP, top + 10.0), Anchor::Start, heading);
            body.push_str(&drawing.into_body());
            top += 22.0;
        }
        for row in group.panels.chunks(group.columns.max(1)) {
            let mut left = GAP;
            for panel in row {
                let _ = write!(
                    body,
                    r#"<g transform="translate({} {})">{}</g>"#,
                    coordinate(left),
                    coordinate(top),
                    panel.body
                );
                left += panel.size.0 + if group.flow == Flow::Strip { 4.0 } else { GAP };
            }
            width = width.max(left);
            top += row.iter().map(|panel| panel.size.1).fold(0.0, f64::max) + 0.5 * GAP;
        }
        top += 0.25 * GAP;
    }
    let (width, height) = (coordinate(width.max(2.0 * GAP)), coordinate(top + 0.25 * GAP));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         role=\"img\"><title>{}</title><style>{}</style><rect class=\"bg\" width=\"{width}\" height=\"{height}\"/>{body}</svg>\n",
        crate::svg::escape(&figure.title),
        light_css(),
    )
}
