//! Charts with axes, lines, bands and labels at the lines' ends.

use crate::palette::Tone;
use crate::svg::{Anchor, Drawing, text_width_em};

/// Size of a panel: two stand side by side on a desktop, one fills a phone.
pub const PANEL: (f64, f64) = (360.0, 232.0);

/// One em of bold figure text [px], with a little to spare: typefaces differ.
pub const KEY_EM: f64 = 13.4;

/// Share of an axis that stays free beyond the outermost value.
const FREE_SHARE: f64 = 0.04;

/// Share of its numbers' size that an axis spans at least, far from where double precision ends.
const LEAST_SPAN: f64 = 1e-9;

/// Numbers below this size are drawn as if they had it.
const LEAST_SIZE: f64 = 1e-3;

/// Least distance of two labels at the lines' ends.
const LABEL_SPACING: f64 = 13.0;

/// A drawing with its size and what it shows, in words.
#[derive(Clone, Debug)]
pub struct Panel {
    /// SVG elements.
    pub body: String,
    /// Width and height.
    pub size: (f64, f64),
    /// For readers who do not see it.
    pub alt: String,
}

/// What an axis spans, and its name with the unit.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Lowest and highest value.
    pub range: (f64, f64),
    /// Name and unit.
    pub label: String,
    /// Marked values with their text; round ones where empty.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// An axis over these values, with a little room at both ends.
    pub fn over(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values);
        let room = FREE_SHARE * (high - low);
        Self { range: (low - room, high + room), label: label.to_owned(), ticks: Vec::new() }
    }

    /// An axis over these values and zero, without room beyond zero.
    pub fn from_zero(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let mut values = values.filter(|value| value.is_finite() && *value != 0.0).peekable();
        // Nothing but zeros has no extent of its own.
        let (low, high) = if values.peek().is_none() { (0.0, 1.0) } else { extent(values.chain([0.0])) };
        let room = FREE_SHARE * (high - low);
        let range = (if low < 0.0 { low - room } else { low }, if high > 0.0 { high + room } else { high });
        Self { range, label: label.to_owned(), ticks: Vec::new() }
    }

    /// An axis with these ends.
    pub fn exactly(label: &str, range: (f64, f64)) -> Self {
        Self { range: told_apart(range), label: label.to_owned(), ticks: Vec::new() }
    }

    fn marks(&self) -> Vec<(f64, String)> {
        if self.ticks.is_empty() { round_ticks(self.range, 6.0) } else { self.ticks.clone() }
    }
}

/// The ends of an axis, moved apart where nothing between them could be told apart.
fn told_apart((low, high): (f64, f64)) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    if high - low > LEAST_SPAN * size.max(LEAST_SIZE) {
        return (low, high);
    }
    let room = 0.5 * size.max(1.0);
    (low - room, high + room)
}

/// Lowest and highest of the finite values, told apart.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low.is_finite() { told_apart((low, high)) } else { (0.0, 1.0) }
}

/// 1, 2 or 5 times a power of ten that cuts `span` into about `num` parts.
fn round_step(span: f64, num: f64) -> f64 {
    let rough = span / num;
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * power >= rough * 0.999).unwrap_or(10.0);
    factor * power
}

/// Round values within a range, about `num` of them, with their text.
pub fn round_ticks((low, high): (f64, f64), num: f64) -> Vec<(f64, String)> {
    let step = round_step(high - low, num);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let (first, last) = ((low / step - 1e-6).ceil() as i64, (high / step + 1e-6).floor() as i64);
    (first..=last).map(|i| (i as f64 * step, quantity(i as f64 * step, decimals))).collect()
}

/// A number for people: typographic minus, thousands as k and millions as M.
pub fn quantity(value: f64, decimals: usize) -> String {
    let (value, unit) = match value.abs() {
        size if size >= 999_999.5 => (value / 1e6, "M"),
        size if size >= 9_999.5 => (value / 1e3, "k"),
        _ => (value, ""),
    };
    let text = if unit.is_empty() { format!("{value:.decimals$}") } else { crate::svg::coordinate(value) };
    let is_zero = text.trim_start_matches('-').chars().all(|digit| matches!(digit, '0' | '.'));
    let text = if is_zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "\u{2212}") };
    text + unit
}

/// A name in the right margin.
struct Label {
    /// Height that it would like [px].
    at: f64,
    tone: Tone,
    text: String,
    /// A point that a thin line leads to.
    leads_to: Option<(f64, f64)>,
}

/// A chart in the making.
pub struct Chart {
    drawing: Drawing,
    size: (f64, f64),
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x: (f64, f64),
    y: (f64, f64),
    labels: Vec<Label>,
    alt: String,
}

impl Chart {
    /// Title, grid and axes. `labels` are those that will stand at the lines' ends: they decide the margin.
    pub fn new(title: &str, size: (f64, f64), x: &Axis, y: &Axis, labels: &[&str]) -> Self {
        let ticks = y.marks();
        let widest_tick = ticks.iter().map(|(_, text)| text_width_em(text)).fold(0.0, f64::max);
        let widest_label = labels.iter().map(|label| text_width_em(label)).fold(0.0, f64::max);
        let margin = if widest_label > 0.0 { (widest_label * KEY_EM + 10.0).min(size.0 * 0.38) } else { 14.0 };
        let mut chart = Self {
            drawing: Drawing::default(),
            size,
            left: 12.0 + widest_tick * 11.0,
            right: size.0 - margin,
            top: if title.is_empty() { 24.0 } else { 40.0 },
            bottom: size.1 - 36.0,
            x: x.range,
            y: y.range,
            labels: Vec::new(),
            alt: if title.is_empty() { format!("{} against {}", y.label, x.label) } else { title.to_owned() },
        };
        if !title.is_empty() {
            chart.drawing.text("ttl", (0.0, 13.0), Anchor::Start, title);
        }
        let y_label = chart.top - 10.0;
        chart.drawing.text("mut", (0.0, y_label), Anchor::Start, &y.label);
        for (value, text) in ticks {
            let at = chart.y_at(value);
            chart.drawing.line("grid", (chart.left, at), (chart.right, at));
            chart.drawing.text("mut", (chart.left - 6.0, at + 3.8), Anchor::End, &text);
        }
        chart.drawing.line("axis", (chart.left, chart.bottom), (chart.right, chart.bottom));
        let mut free_from = f64::NEG_INFINITY;
        for (value, text) in x.marks() {
            let at = chart.x_at(value);
            chart.drawing.line("axis", (at, chart.bottom), (at, chart.bottom + 4.0));
            let half = text_width_em(&text) * 5.5;
            if at - half > free_from {
                chart.drawing.text("mut", (at, chart.bottom + 15.0), Anchor::Middle, &text);
                free_from = at + half + 4.0;
            }
        }
        let middle = 0.5 * (chart.left + chart.right);
        chart.drawing.text("mut", (middle, chart.bottom + 30.0), Anchor::Middle, &x.label);
        chart
    }

    /// Across [px].
    pub fn x_at(&self, value: f64) -> f64 {
        self.left + (value - self.x.0) / (self.x.1 - self.x.0) * (self.right - self.left)
    }

    /// Down [px].
    pub fn y_at(&self, value: f64) -> f64 {
        self.bottom - (value - self.y.0) / (self.y.1 - self.y.0) * (self.bottom - self.top)
    }

    /// A point of the chart's own coordinates.
    pub fn at(&self, point: [f64; 2]) -> (f64, f64) {
        (self.x_at(point[0]), self.y_at(point[1]))
    }

    /// For what charts do not have.
    pub fn drawing(&mut self) -> &mut Drawing {
        &mut self.drawing
    }

    /// Left, right, top and bottom of the field between the axes.
    pub fn field(&self) -> (f64, f64, f64, f64) {
        (self.left, self.right, self.top, self.bottom)
    }

    /// A line through points; a missing value interrupts it.
    pub fn line(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let mut piece = Vec::new();
        for point in points {
            if point[1].is_finite() {
                piece.push(self.at(point));
            } else {
                self.drawing.polyline(class, &piece);
                piece.clear();
            }
        }
        self.drawing.polyline(class, &piece);
    }

    /// The area between two lines: (x, low, high).
    pub fn band(&mut self, tone: Tone, edges: &[[f64; 3]]) {
        let upper = edges.iter().map(|edge| self.at([edge[0], edge[2]]));
        let lower = edges.iter().rev().map(|edge| self.at([edge[0], edge[1]]));
        let outline: Vec<_> = upper.chain(lower).collect();
        self.drawing.polygon(&format!("band {}", tone.fill()), &outline);
    }

    /// A level across the whole chart, with its name in the right margin.
    pub fn level(&mut self, value: f64, tone: Tone, text: &str) {
        let at = self.y_at(value);
        self.drawing.line(&format!("rule {}", tone.stroke()), (self.left, at), (self.right, at));
        self.label(value, tone, text);
    }

    /// A name in the right margin, at the height of `value`.
    pub fn label(&mut self, value: f64, tone: Tone, text: &str) {
        if value.is_finite() {
            let at = self.y_at(value);
            self.labels.push(Label { at, tone, text: text.to_owned(), leads_to: None });
        }
    }

    /// A name in the right margin, with a thin line to a point.
    pub fn leader(&mut self, point: [f64; 2], tone: Tone, text: &str) {
        let (x, y) = self.at(point);
        self.labels.push(Label { at: y, tone, text: text.to_owned(), leads_to: Some((x + 6.0, y)) });
    }

    /// Puts the labels where they do not cover each other.
    pub fn finish(mut self) -> Panel {
        let mut labels = std::mem::take(&mut self.labels);
        labels.sort_by(|a, b| a.at.total_cmp(&b.at));
        let wanted: Vec<f64> = labels.iter().map(|label| label.at).collect();
        let room = (self.size.0 - self.right - 8.0) / KEY_EM;
        for (at, label) in spread(&wanted, self.top, self.bottom).into_iter().zip(labels) {
            if let Some(point) = label.leads_to {
                self.drawing.line(&format!("faint {}", label.tone.stroke()), point, (self.right + 4.0, at));
            }
            let class = format!("key {}", label.tone.text());
            self.drawing.text(&class, (self.right + 7.0, at + 3.8), Anchor::Start, &shortened(&label.text, room));
        }
        Panel { body: self.drawing.into_body(), size: self.size, alt: self.alt }
    }
}

/// A text cut to a width, with an ellipsis where something is missing.
pub fn shortened(text: &str, room_em: f64) -> String {
    if text_width_em(text) <= room_em {
        return text.to_owned();
    }
    let mut kept = String::new();
    for character in text.chars() {
        if text_width_em(&kept) + 1.2 > room_em {
            break;
        }
        kept.push(character);
    }
    kept.trim_end().to_owned() + "\u{2026}"
}

/// Moves sorted places apart to the least spacing, as little as possible, within the ends where there is room.
fn spread(wanted: &[f64], low: f64, high: f64) -> Vec<f64> {
    // Groups of labels that touch: sum of (wanted - own offset in the group), and how many.
    let mut groups: Vec<(f64, usize)> = Vec::new();
    let start = |group: &(f64, usize)| {
        let length = (group.1 - 1) as f64 * LABEL_SPACING;
        (group.0 / group.1 as f64).min(high - length).max(low)
    };
    for &place in wanted {
        let mut last = (place, 1);
        while let Some(before) = groups.last() {
            if start(before) + before.1 as f64 * LABEL_SPACING <= start(&last) {
                break;
            }
            last = (before.0 + last.0 - last.1 as f64 * before.1 as f64 * LABEL_SPACING, before.1 + last.1);
            groups.pop();
        }
        groups.push(last);
    }
    let places = |group: &(f64, usize)| {
        let start = start(group);
        (0..group.1).map(move |i| start + i as f64 * LABEL_SPACING).collect::<Vec<_>>()
    };
    groups.iter().flat_map(places).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let texts = |range| round_ticks(range, 5.0).into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(texts((0.0, 1.0)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts((-20.0, 25.0)), ["\u{2212}20", "\u{2212}10", "0", "10", "20"]);
        assert_eq!(texts((0.0, 1e6)), ["0", "200k", "400k", "600k", "800k", "1M"]);
        assert_eq!(Axis::from_zero("", [2.5].into_iter()).range, (0.0, 2.6));
        assert_eq!(Axis::from_zero("", [-1.0, 4.0].into_iter()).range, (-1.2, 4.2));
        assert_eq!(Axis::from_zero("", std::iter::empty()).range, (0.0, 1.04));
    }

    #[test]
    fn labels_keep_their_distance_and_move_little() {
        assert_eq!(spread(&[10.0, 100.0], 0.0, 200.0), [10.0, 100.0]);
        let places = spread(&[50.0, 51.0, 52.0], 0.0, 200.0);
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] >= LABEL_SPACING - 1e-9), "{places:?}");
        assert!((places[1] - 51.0).abs() < 1e-9, "{places:?}");
        let at_the_end = spread(&[199.0, 200.0], 0.0, 200.0);
        assert!(at_the_end[1] <= 200.0, "{at_the_end:?}");
    }

    #[test]
    fn long_names_are_cut() {
        assert_eq!(shortened("sine", 10.0), "sine");
        assert!(shortened(&"x".repeat(100), 10.0).ends_with('\u{2026}'));
    }

    #[test]
    fn quantities_read_well() {
        assert_eq!(quantity(-0.001, 2), "0.00");
        assert_eq!(quantity(-1.5, 1), "\u{2212}1.5");
        assert_eq!(quantity(1_500_000.0, 0), "1.5M");
    }
}
