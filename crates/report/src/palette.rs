//! Colours: one tone a gait, the same in every figure and table, told apart by colour-blind readers, in light and dark.

use std::fmt::Write;

/// The colour of a gait.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tone(usize);

/// Colours after Okabe and Ito 2008, moved in lightness for contrast: line on light, text on light, both on dark, dashes.
const TONES: [(&str, &str, &str, &str); 10] = [
    ("#6b7280", "#4b5563", "#a8b0bd", "none"),
    ("#a08a5b", "#75643d", "#cdb98f", "6 3"),
    ("#e09f00", "#8f6400", "#f2b73a", "none"),
    ("#cc79a7", "#a0487a", "#eda3c9", "2 3"),
    ("#d55e00", "#b04e00", "#ff9256", "7 2 2 2"),
    ("#009e73", "#00704f", "#3fcaa0", "none"),
    ("#0072b2", "#00629c", "#5db5f0", "none"),
    ("#7a5cc0", "#6547ad", "#b8a0f5", "5 2"),
    ("#2a9fc4", "#14718f", "#74d0ec", "3 2"),
    ("#7f8c00", "#5f6900", "#c3d04e", "9 3"),
];

/// The rungs of a comparison, from the gaits as they were to what was learned, each with its tone.
const RUNGS: [(&str, usize); 7] =
    [("sine", 0), ("stepping", 1), ("tuned", 2), ("direct", 3), ("direct-best", 4), ("paper", 5), ("doggo", 6)];

/// Tones for learned gaits of runs, in their order.
const RUNS: [usize; 7] = [6, 5, 4, 7, 3, 8, 9];

/// Tones for gaits that no list here names.
const OTHERS: [usize; 4] = [7, 8, 9, 3];

impl Tone {
    /// Of a rung or a bare gait by its name; `position` picks one where the name is not known.
    pub fn of_gait(name: &str, position: usize) -> Self {
        let known = RUNGS.iter().find(|(rung, _)| *rung == name);
        Self(known.map_or(OTHERS[position % OTHERS.len()], |(_, tone)| *tone))
    }

    /// Of the learned gait of run number `run`.
    pub fn of_run(run: usize) -> Self {
        Self(RUNS[run % RUNS.len()])
    }

    /// Class of a line or an outline.
    pub fn stroke(self) -> String {
        format!("s{}", self.0)
    }

    /// Class of a line with the tone's dashes, so that it can be told without its colour.
    pub fn dashed(self) -> String {
        format!("s{0} d{0}", self.0)
    }

    /// Class of an area.
    pub fn fill(self) -> String {
        format!("f{}", self.0)
    }

    /// Class of a text.
    pub fn text(self) -> String {
        format!("t{}", self.0)
    }

    /// For the replay's script.
    pub fn number(self) -> usize {
        self.0
    }
}

/// Where a rung stands in the order of the tables: default, tuned, learned; unknown ones last, by name.
pub fn rung_order(name: &str) -> usize {
    RUNGS.iter().position(|(rung, _)| *rung == name).unwrap_or(RUNGS.len())
}

/// What figures look like but for their colours.
const SHAPES: &str = "\
text{font-family:ui-sans-serif,system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;\
font-size:11px}\
.ttl{font-size:12px;font-weight:600}.key{font-size:11px;font-weight:600}.sml{font-size:10px}\
.axis,.grid,.rule,.line,.thin,.thick,.faint,.whisk,.limb,.far{fill:none;stroke-linecap:round;stroke-linejoin:round}\
.axis{stroke-width:1}.grid{stroke-width:1}.rule{stroke-width:1.2;stroke-dasharray:4 4}\
.line{stroke-width:1.8}.thin{stroke-width:1.2}.thick{stroke-width:5;stroke-opacity:.3}\
.faint{stroke-width:1;stroke-opacity:.38}.whisk{stroke-width:1.1;stroke-opacity:.55}\
.band{fill-opacity:.15;stroke:none}.limb{stroke-width:2.2}.far{stroke-width:1.8;stroke-opacity:.42}\
.seed{fill-opacity:.55}.box{fill-opacity:.2;stroke-width:1.6;stroke-linejoin:round}.bar{fill-opacity:.75}.fall{fill-opacity:.3}";

/// The style sheet of figures on a light ground, without variables: many programs that read SVG know none.
pub fn light_css() -> String {
    let mut css = SHAPES.to_owned();
    css.push_str(
        ".bg{fill:#fff}.ink,.ttl{fill:#1b1f24}.mut{fill:#5c6570}.axis{stroke:#8b949e}.grid{stroke:#e4e7eb}\
         .rule{stroke:#5c6570}.ground{fill:none;stroke:#8b949e;stroke-width:1.2}.alarm{fill:#c0392b}\
         .rule-solid{stroke:#1b1f24}.cell{fill:#f1f3f5}",
    );
    for (i, (line, text, _, dashes)) in TONES.iter().enumerate() {
        let _ = write!(css, ".s{i}{{stroke:{line}}}.f{i}{{fill:{line}}}.t{i}{{fill:{text};color:{text}}}");
        let _ = write!(css, ".d{i}{{stroke-dasharray:{dashes}}}");
    }
    css
}

/// What changes on a dark ground.
pub fn dark_css() -> String {
    let mut css =
        ".bg{fill:#14171b}.ink,.ttl{fill:#e8eaed}.mut{fill:#9aa4af}.axis{stroke:#6b7480}.grid{stroke:#2a3037}\
                   .rule{stroke:#9aa4af}.ground{stroke:#6b7480}.alarm{fill:#ff7b6b}.band{fill-opacity:.2}\
                   .rule-solid{stroke:#e8eaed}.cell{fill:#1f242a}"
            .to_owned();
    for (i, (_, _, dark, _)) in TONES.iter().enumerate() {
        let _ = write!(css, ".s{i}{{stroke:{dark}}}.f{i}{{fill:{dark}}}.t{i}{{fill:{dark};color:{dark}}}");
    }
    css
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rungs_have_tones_of_their_own() {
        let mut tones: Vec<Tone> = RUNGS.iter().map(|(name, _)| Tone::of_gait(name, 0)).collect();
        tones.sort();
        tones.dedup();
        assert_eq!(tones.len(), RUNGS.len());
        assert_eq!(Tone::of_run(0), Tone::of_gait("doggo", 0));
    }

    #[test]
    fn every_tone_is_in_both_style_sheets() {
        for i in 0..TONES.len() {
            for css in [light_css(), dark_css()] {
                assert!(css.contains(&format!(".s{i}{{")) && css.contains(&format!(".t{i}{{")), "{i}");
            }
        }
    }
}
