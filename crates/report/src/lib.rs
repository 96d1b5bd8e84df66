//! Run directories and comparisons to tables, figures and one self-contained HTML page.
//!
//! This crate reads files and nothing else: it uses no other crate of canter and never simulates. The same files give
//! the same bytes; nothing of what it writes holds a time or a path.

#![forbid(unsafe_code)]

mod chart;
mod compare;
mod error;
mod figures;
mod motion;
mod page;
mod palette;
#[cfg(feature = "png")]
mod png;
mod read;
mod replay;
mod runs;
mod statistics;
mod svg;
mod sweep;
mod tables;
mod write;

use std::path::{Path, PathBuf};

pub use error::ReportError;

/// What a report has left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// `report.html`.
    pub page: PathBuf,
    /// Figures in `figures/`.
    pub num_figures: usize,
    /// Tables in `tables/`.
    pub num_tables: usize,
    /// What is not on the page, and why; the page says so too.
    pub left_out: Vec<String>,
}

/// Whether figures are written as PNG files too: a feature of the build.
pub const WRITES_PNG: bool = cfg!(feature = "png");

/// Whether a folder holds a comparison; else it is taken for a run directory.
pub fn is_comparison(folder: &Path) -> bool {
    folder.join("compare.json").is_file()
}

/// Reports on one or several run directories of one robot: `report.html`, `figures/` and `tables/` in `out`.
///
/// # Errors
/// A file that is missing or wrong, runs that were not measured alike, or a folder that cannot be written.
pub fn report_run(run_dirs: &[PathBuf], out: &Path) -> Result<Written, ReportError> {
    runs::report(run_dirs, out)
}

/// Reports on a comparison: `report.html`, `figures/` and `tables/` in its folder.
///
/// # Errors
/// A file that is missing or wrong, or a folder that cannot be written.
pub fn report_compare(dir: &Path) -> Result<Written, ReportError> {
    compare::report(dir)
}

/// Whether a folder holds a sweep.
pub fn is_sweep(folder: &Path) -> bool {
    folder.join("sweep.json").is_file()
}

/// Reports on a sweep: `report.html`, `figures/` and `tables/` in its folder.
///
/// # Errors
/// A file that is missing or wrong, or a folder that cannot be written.
pub fn report_sweep(dir: &Path) -> Result<Written, ReportError> {
    sweep::report(dir)
}

/// "no fall in 20 episodes".
fn falls(falls: u64, episodes: u64) -> String {
    let episodes = tables::grouped(episodes);
    match falls {
        0 => format!("no fall in {episodes} episodes"),
        1 => format!("1 fall in {episodes} episodes"),
        falls => format!("{falls} falls in {episodes} episodes"),
    }
}

/// The figures from recorded episodes; none of them where nothing was recorded.
fn recorded_figures(recorded: &[figures::recorded::Recorded<'_>]) -> Vec<figures::Figure> {
    if recorded.is_empty() {
        return Vec::new();
    }
    [
        figures::recorded::film_strip,
        figures::recorded::footfall,
        figures::recorded::foot_paths,
        figures::recorded::speed_steps,
        figures::recorded::torque,
        figures::recorded::leg_space,
    ]
    .iter()
    .map(|draw| draw(recorded))
    .collect()
}
