//! The progress line of a training, a comparison or a film; nothing unless standard error is a terminal.

use std::time::{Duration, Instant};

use canter_train::config::TrainingSettings;
use canter_train::jobs::progress::JobsProgress;
use canter_train::trainer::{IterationReport, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Finished episodes over which the return is averaged.
const RETURN_WINDOW: usize = 50;

/// Ticks of the bar: finer than anyone can see.
const TICKS: u64 = 1000;

/// Shows how far a training has come, how fast the robot walks, and how long it will take.
pub struct ProgressLine {
    bar: ProgressBar,
    settings: TrainingSettings,
    begin: Instant,
    begin_progress: Progress,
    recent_returns: Vec<f64>,
}

impl ProgressLine {
    /// A line for a training that may have come some way already.
    pub fn new(settings: &TrainingSettings, progress: Progress) -> Self {
        Self {
            bar: bar(),
            settings: settings.clone(),
            begin: Instant::now(),
            begin_progress: progress,
            recent_returns: Vec::new(),
        }
    }

    /// Shows an iteration.
    pub fn show(&mut self, report: &IterationReport) {
        self.recent_returns.extend(report.episodes.iter().map(|episode| episode.episode_return));
        let surplus = self.recent_returns.len().saturating_sub(RETURN_WINDOW);
        self.recent_returns.drain(..surplus);
        let mean_return = match self.recent_returns.len() {
            0 => "-".to_owned(),
            count => format!("{:.1}", self.recent_returns.iter().sum::<f64>() / count as f64),
        };
        let elapsed = self.begin.elapsed();
        let steps_per_s = (report.progress.env_steps - self.begin_progress.env_steps) as f64 / elapsed.as_secs_f64();
        let share = self.share(report.progress);
        self.bar.set_message(format!(
            "{:.2} m/s exploring, return {mean_return}, {steps_per_s:.0} steps/s, {} s left",
            report.speed_m_per_s,
            self.time_left(share, elapsed).as_secs()
        ));
        self.bar.set_position((share * TICKS as f64) as u64);
    }

    /// Share of the training that is done: whatever ends it first, env steps or episodes.
    fn share(&self, progress: Progress) -> f64 {
        let by_steps = progress.env_steps as f64 / self.settings.max_env_steps as f64;
        let by_episodes = self.settings.max_episodes.map_or(0.0, |max| progress.episodes as f64 / max as f64);
        by_steps.max(by_episodes).min(1.0)
    }

    /// Time left if it goes on as since the begin of this line.
    fn time_left(&self, share: f64, elapsed: Duration) -> Duration {
        let done = share - self.share(self.begin_progress);
        if done > 0.0 { elapsed.mul_f64((1.0 - share) / done) } else { Duration::ZERO }
    }

    /// Leaves the line as it is.
    pub fn finish(self) {
        self.bar.abandon();
    }
}

/// Shows how far a comparison has come and how long it will take.
pub struct JobsLine {
    bar: ProgressBar,
    begin: Instant,
}

impl JobsLine {
    /// A line for a comparison that begins or goes on now.
    pub fn new() -> Self {
        Self { bar: bar(), begin: Instant::now() }
    }

    /// Shows how far it has come; called from every thread.
    pub fn show(&self, progress: JobsProgress) {
        let elapsed_s = self.begin.elapsed().as_secs_f64();
        let steps_per_s = progress.env_steps.saturating_sub(progress.skipped_env_steps) as f64 / elapsed_s;
        let left = progress.num_env_steps.saturating_sub(progress.env_steps) as f64;
        self.bar.set_position((progress.env_steps as f64 / progress.num_env_steps.max(1) as f64 * TICKS as f64) as u64);
        let time_left = if steps_per_s > 0.0 { minutes(left / steps_per_s) } else { "-".to_owned() };
        self.bar.set_message(format!(
            "{} of {} jobs, {steps_per_s:.0} steps/s, {time_left} left",
            progress.jobs, progress.num_jobs
        ));
    }

    /// Leaves the line as it is.
    pub fn finish(self) {
        self.bar.abandon();
    }
}

/// Shows how many pictures of a film there are.
pub struct FilmLine {
    bar: ProgressBar,
    begin: Instant,
    num_frames: usize,
}

impl FilmLine {
    /// A line for a film that begins now.
    pub fn new(num_frames: usize) -> Self {
        Self { bar: bar(), begin: Instant::now(), num_frames }
    }

    /// Shows how many pictures there are so far.
    pub fn show(&self, frames: usize) {
        let share = frames as f64 / self.num_frames as f64;
        let time_left = minutes(self.begin.elapsed().as_secs_f64() * (1.0 - share) / share);
        self.bar.set_position((share * TICKS as f64) as u64);
        self.bar.set_message(format!("{frames} of {} pictures, {time_left} left", self.num_frames));
    }

    /// Leaves the line as it is.
    pub fn finish(self) {
        self.bar.abandon();
    }
}

/// A time as a person says it.
fn minutes(time_s: f64) -> String {
    if time_s < 90.0 { format!("{time_s:.0} s") } else { format!("{:.0} min", time_s / 60.0) }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(TICKS), ProgressDrawTarget::stderr_with_hz(5));
    let style = ProgressStyle::with_template("{bar:24} {percent:>3}%  {msg}").expect("a valid template");
    bar.set_style(style.progress_chars("=> "));
    bar
}
