//! The verdict as a person reads it.

use canter_train::evaluate::{GaitReport, Verdict};
use canter_train::protocol::ProtocolCard;

/// The verdict's sentence and its table.
pub fn describe(verdict: &Verdict) -> String {
    let protocol = &verdict.protocol;
    let mut lines = vec![sentence(verdict)];
    if let (Some(ratio), Some(interval), true) =
        (verdict.prior_speed_ratio, verdict.prior_speed_ratio_ci, verdict.prior_name != verdict.default_gait)
    {
        lines.push(format!(
            "It is {} times as fast as its own prior, `{}`.",
            with_interval(ratio, interval),
            verdict.prior_name
        ));
    }
    if let (Some(ratio), Some(displaced)) = (verdict.speed_ratio, verdict.displacement_speed_ratio)
        && verdict.policy.is_some()
        && displaced < 0.98 * ratio
    {
        lines.push(format!(
            "Counting displacement in any direction, which does not charge it for turning: {displaced:.2} times."
        ));
    }
    lines.push(String::new());
    let mut rows = Vec::new();
    if let Some(policy) = &verdict.policy {
        rows.push(("learned".to_owned(), policy));
    }
    if !verdict.default_gaits.contains_key(&verdict.prior_name) {
        rows.push((format!("{} (prior)", verdict.prior_name), &verdict.prior));
    }
    for (name, report) in &verdict.default_gaits {
        let role = if *name == verdict.prior_name { "prior, default" } else { "default" };
        rows.push((format!("{name} ({role})"), report));
    }
    lines.push(gait_table(&rows, protocol));
    lines.join("\n")
}

/// A row for each gait, and how they were measured.
pub fn gait_table(rows: &[(String, &GaitReport)], protocol: &ProtocolCard) -> String {
    let mut lines = Vec::new();
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    lines.push(format!("{:width$}  speed  drift  turn  bounce  power  cost of  moved  falls", ""));
    lines.push(format!("{:width$}    m/s      m   deg      mm      W  transp.    m/s", ""));
    lines.extend(rows.iter().map(|(name, report)| row(name, width, report)));
    lines.push(String::new());
    let mut ground = match (protocol.slope_deg, protocol.friction) {
        (0.0, None) => "level ground".to_owned(),
        (slope, None) => format!("a slope of {slope} degrees"),
        (0.0, Some(friction)) => format!("level ground of friction {friction}"),
        (slope, Some(friction)) => format!("a slope of {slope} degrees and friction {friction}"),
    };
    for (key, value) in &protocol.changed {
        ground += &format!(", task.{key} = {value}");
    }
    lines.push(format!(
        "{} episodes of {} s a gait on {ground}, same starts (seed {}); speed counts forward, from {} s on.",
        protocol.num_episodes, protocol.episode_s, protocol.seed, protocol.settle_s
    ));
    lines.join("\n")
}

/// The one sentence that matters.
fn sentence(verdict: &Verdict) -> String {
    let Some(policy) = &verdict.policy else {
        return format!(
            "{}: {} m/s, {}.",
            verdict.prior_name,
            speed(verdict.prior.speed_m_per_s, 2),
            falls(&verdict.prior)
        );
    };
    let default =
        format!("the default gait `{}` ({} m/s)", verdict.default_gait, speed(verdict.default_speed_m_per_s, 2));
    match (verdict.speed_ratio, verdict.speed_ratio_ci) {
        (Some(ratio), Some(interval)) => format!(
            "Learned gait: {} m/s, {} times as fast as {default}, {}.",
            speed(policy.speed_m_per_s, 2),
            with_interval(ratio, interval),
            falls(policy)
        ),
        _ => format!(
            "Learned gait: {} m/s; {default} does not move forward here, so there is no ratio; {}.",
            speed(policy.speed_m_per_s, 2),
            falls(policy)
        ),
    }
}

fn with_interval(ratio: f64, [low, high]: [f64; 2]) -> String {
    format!("{ratio:.2} (95 % interval {low:.2} to {high:.2})")
}

fn falls(report: &GaitReport) -> String {
    let episodes = report.speeds_m_per_s.len();
    match report.falls {
        0 => format!("no fall in {episodes} episodes"),
        count => {
            let causes: Vec<_> =
                report.falls_by_cause.iter().map(|(cause, count)| format!("{count} {cause}")).collect();
            let falls = if count == 1 { "fall" } else { "falls" };
            format!("{count} {falls} in {episodes} episodes ({})", causes.join(", "))
        }
    }
}

fn row(name: &str, width: usize, report: &GaitReport) -> String {
    let cost_of_transport = report.cost_of_transport.map_or("-".to_owned(), |cost| format!("{cost:.2}"));
    format!(
        "{name:width$}{:>7}{:>7.2}{:>6.1}{:>8.1}{:>7.1}{cost_of_transport:>9}{:>7.3}{:>7}",
        speed(report.speed_m_per_s, 3),
        report.drift_m,
        report.heading_deg,
        report.height_std_m * 1e3,
        report.power_w,
        report.displacement_speed_m_per_s,
        report.falls
    )
}

/// A speed that is shown as 0 without a sign.
fn speed(m_per_s: f64, digits: usize) -> String {
    let text = format!("{m_per_s:.digits$}");
    let is_zero = text.bytes().all(|byte| b"-0.".contains(&byte));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}
