//! The verdict as a person reads it.

use canter_train::evaluate::{GaitReport, Verdict};

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
    lines.push(format!(
        "{:<24}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>11}{:>7}",
        "", "speed", "drift", "turn", "bounce", "power", "cost of", "displaced", "falls"
    ));
    lines.push(format!(
        "{:<24}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>11}{:>7}",
        "", "m/s", "m", "deg", "mm", "W", "transp.", "m/s", ""
    ));
    if let Some(policy) = &verdict.policy {
        lines.push(row("learned", policy));
    }
    if !verdict.default_gaits.contains_key(&verdict.prior_name) {
        lines.push(row(&format!("{} (prior)", verdict.prior_name), &verdict.prior));
    }
    for (name, report) in &verdict.default_gaits {
        let is_prior = *name == verdict.prior_name;
        let role = if is_prior { "prior, default" } else { "default" };
        lines.push(row(&format!("{name} ({role})"), report));
    }
    lines.push(String::new());
    let ground = match (protocol.slope_deg, protocol.friction) {
        (0.0, None) => "level ground".to_owned(),
        (slope, None) => format!("a slope of {slope} degrees"),
        (0.0, Some(friction)) => format!("level ground of friction {friction}"),
        (slope, Some(friction)) => format!("a slope of {slope} degrees and friction {friction}"),
    };
    lines.push(format!(
        "{} episodes of {} s a gait on {ground}, same starts (seed {}); speed counts forward, from {} s on.",
        protocol.num_episodes, protocol.episode_s, protocol.seed, protocol.settle_s
    ));
    lines.join("\n")
}

/// The one sentence that matters.
fn sentence(verdict: &Verdict) -> String {
    let Some(policy) = &verdict.policy else {
        return format!("{}: {:.2} m/s, {}.", verdict.prior_name, verdict.prior.speed_m_per_s, falls(&verdict.prior));
    };
    let default = format!("the default gait `{}` ({:.2} m/s)", verdict.default_gait, verdict.default_speed_m_per_s);
    match (verdict.speed_ratio, verdict.speed_ratio_ci) {
        (Some(ratio), Some(interval)) => format!(
            "Learned gait: {:.2} m/s, {} times as fast as {default}, {}.",
            policy.speed_m_per_s,
            with_interval(ratio, interval),
            falls(policy)
        ),
        _ => format!(
            "Learned gait: {:.2} m/s; {default} does not move forward here, so there is no ratio; {}.",
            policy.speed_m_per_s,
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
        1 => format!("1 fall in {episodes} episodes"),
        falls => format!("{falls} falls in {episodes} episodes"),
    }
}

fn row(name: &str, report: &GaitReport) -> String {
    let cost_of_transport = report.cost_of_transport.map_or("-".to_owned(), |cost| format!("{cost:.2}"));
    format!(
        "{name:<24}{:>9.3}{:>9.2}{:>9.1}{:>9.1}{:>9.1}{cost_of_transport:>9}{:>11.3}{:>7}",
        report.speed_m_per_s,
        report.drift_m,
        report.heading_deg,
        report.height_std_m * 1e3,
        report.power_w,
        report.displacement_speed_m_per_s,
        report.falls
    )
}
