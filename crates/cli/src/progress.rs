//! The progress line of a training; nothing unless standard error is a terminal.

use canter_train::config::RunConfig;
use canter_train::trainer::{IterationReport, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Finished episodes over which the return is averaged.
const RETURN_WINDOW: usize = 50;

/// Shows how far a training has come, how fast the robot walks, and how long it will take.
pub struct ProgressLine {
    bar: ProgressBar,
    recent_returns: Vec<f64>,
}

impl ProgressLine {
    /// A line for a training that has already come some way.
    pub fn new(config: &RunConfig, progress: Progress) -> Self {
        let target = ProgressDrawTarget::stderr_with_hz(5);
        let bar = ProgressBar::with_draw_target(Some(config.training.max_env_steps), target);
        let template = "{bar:24} {percent:>3}%  {msg}  {per_sec} left {eta}";
        let style = ProgressStyle::with_template(template).expect("a valid template");
        bar.set_style(style.progress_chars("=> ").with_key("per_sec", per_second));
        bar.set_position(progress.env_steps);
        bar.reset_eta();
        Self { bar, recent_returns: Vec::new() }
    }

    /// Shows an iteration.
    pub fn show(&mut self, report: &IterationReport) {
        self.recent_returns.extend(report.episodes.iter().map(|episode| episode.episode_return));
        let surplus = self.recent_returns.len().saturating_sub(RETURN_WINDOW);
        self.recent_returns.drain(..surplus);
        let mean_return = if self.recent_returns.is_empty() {
            "return -".to_owned()
        } else {
            let mean = self.recent_returns.iter().sum::<f64>() / self.recent_returns.len() as f64;
            format!("return {mean:.1}")
        };
        self.bar.set_message(format!("{:.2} m/s exploring, {mean_return},", report.speed_m_per_s));
        self.bar.set_position(report.progress.env_steps);
    }

    /// Leaves the line as it is.
    pub fn finish(self) {
        self.bar.abandon();
    }
}

fn per_second(state: &indicatif::ProgressState, writer: &mut dyn std::fmt::Write) {
    let _ = write!(writer, "{:.0} steps/s,", state.per_sec());
}
