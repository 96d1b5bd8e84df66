//! The paper's claims held against our numbers, and a few claims of our own.
//!
//! A claim holds if the whole 95 % interval is on its side, does not hold if the whole interval is on the other, and is
//! open (`None`) if the interval lies across, or if what it needs was not measured. Each sentence is made of the numbers.

use serde::Serialize;

use super::measured::RunReport;
use super::protocol::{Quantity, Rung, UPHILL_DEG};
use super::results::{Comparison, RungReport, Sample};
use crate::footfall::Footfall;
use crate::statistics::mean;

/// Points of a return curve that count as its start.
const START_POINTS: usize = 3;

/// Share of a return curve that counts as its end.
const END_SHARE: f64 = 0.1;

/// Share of its own final return at which a training counts as converged; the paper says only "reaches the maximum".
const CONVERGED_SHARE: f64 = 0.9;

/// Points over which a return curve is averaged before it is asked when it got somewhere.
const SMOOTHING_POINTS: usize = 5;

/// Share of its speed on level ground that a gait must keep uphill for "maintained the stability of the speed".
const KEPT_SPEED_SHARE: f64 = 0.9;

/// Least speed that counts as climbing [m/s].
const CLIMBING_SPEED_M_PER_S: f64 = 0.1;

/// How much less synchronous than in its prior the diagonal legs may be for the gait still to be that gait.
const SYNCHRONY_LOSS: f64 = 0.1;

/// A claim and what we found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// What is claimed.
    pub claim: String,
    /// Where.
    pub source: &'static str,
    /// The paper's figure.
    pub paper: String,
    /// Ours, with its interval where there is one.
    pub ours: String,
    /// Whether it holds; none if these numbers cannot tell.
    pub holds: Option<bool>,
    /// What the numbers say, in a sentence.
    pub sentence: String,
}

/// Where a claim of our own stands.
const BEYOND: &str = "beyond the paper";

/// All claims, those of the paper first.
pub fn claims(comparison: &Comparison) -> Vec<Claim> {
    let mut claims = vec![
        faster_than_default(comparison, Rung::Paper, 1.5, ("abstract", "1.5")),
        converges_faster(comparison),
        twice_the_return(comparison),
        good_start(comparison),
        steadier_speed(comparison),
        smaller_yaw_and_sway(comparison),
        no_contact(comparison),
        holds_uphill(comparison),
    ];
    claims.extend([Rung::Paper, Rung::Doggo].map(|rung| still_that_gait(comparison, rung)));
    claims.push(faster_than_default(comparison, Rung::Doggo, 2.5, (BEYOND, "-")));
    claims.push(faster_than_tuned(comparison));
    claims.push(faster_than_without(comparison));
    claims.push(climbs(comparison));
    claims
}

/// Whether a quantity is at least `threshold`, as far as its interval tells.
fn at_least([low, high]: [f64; 2], threshold: f64) -> Option<bool> {
    match (low >= threshold, high < threshold) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

/// Whether a quantity is below `threshold`, as far as its interval tells.
fn below([low, high]: [f64; 2], threshold: f64) -> Option<bool> {
    match (high < threshold, low >= threshold) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

/// The end of every sentence.
fn verdict(holds: Option<bool>) -> &'static str {
    match holds {
        Some(true) => "so the claim holds here",
        Some(false) => "so the claim does not hold here",
        None => "so these runs cannot tell",
    }
}

fn with_interval((value, [low, high]): (f64, [f64; 2]), digits: usize) -> String {
    let shown = |value: f64| fixed(value, digits);
    format!("{} [{}, {}]", shown(value), shown(low), shown(high))
}

/// A number with this many digits behind the point; never -0.
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    if text.chars().any(|character| character.is_ascii_digit() && character != '0') {
        text
    } else {
        text.trim_start_matches('-').to_owned()
    }
}

/// The row of a claim for which something was not measured.
fn not_measured(claim: String, (source, paper): (&'static str, &str), what: &str) -> Claim {
    let sentence = format!("Not measured: {what}.");
    Claim { claim, source, paper: paper.to_owned(), ours: "-".to_owned(), holds: None, sentence }
}

fn runs(comparison: &Comparison, rung: Rung) -> Option<&[RunReport]> {
    comparison.rungs.get(&rung).map(|report| &report.seeds[..])
}

/// The runs of `paper` and of `direct`, its control experiment.
fn paper_and_control(comparison: &Comparison) -> Option<(&[RunReport], &[RunReport])> {
    Some((runs(comparison, Rung::Paper)?, runs(comparison, Rung::Direct)?))
}

const NO_CONTROL: &str = "the comparison ran without `paper` or `direct`";

fn faster_than_default(
    comparison: &Comparison,
    rung: Rung,
    factor: f64,
    (source, paper): (&'static str, &str),
) -> Claim {
    let claim = match rung {
        Rung::Paper => "50 % faster than the default trot".to_owned(),
        _ => format!("`{}` is at least {factor} times as fast as the default gait", rung.name()),
    };
    let Some(report) = comparison.rungs.get(&rung) else {
        return not_measured(claim, (source, paper), &format!("the comparison ran without `{}`", rung.name()));
    };
    let default = &comparison.rungs[&comparison.default_rung];
    let Some(ratio) = report.ratio_to_default else {
        return not_measured(claim, (source, paper), "the default gait does not move forward");
    };
    let holds = at_least(ratio.ci, factor);
    let tuned = comparison.rungs.get(&Rung::Tuned).map_or_else(String::new, |tuned| {
        format!("; the tuned gait, without learning, walks {:.2} m/s", tuned.speed_iqm)
    });
    // Its own prior may be slower than the default gait: the paper's ratio is against the gait that it learned on.
    let priors: Option<Vec<f64>> = report.seeds.iter().map(|run| run.prior_speed_m_per_s).collect();
    let prior =
        priors.map_or_else(String::new, |priors| format!("; the gait that it learned on {:.2} m/s", mean(&priors)));
    let falls = falls(report);
    let sentence = format!(
        "`{}` walks {:.2} m/s with {falls}, the faster default gait `{}` {:.2} m/s{prior}{tuned}, {}.",
        rung.name(),
        report.speed_iqm,
        comparison.default_rung.name(),
        default.speed_iqm,
        verdict(holds)
    );
    let ours = with_interval((ratio.iqm, ratio.ci), 2);
    Claim { claim, source, paper: paper.to_owned(), ours, holds, sentence }
}

fn falls(report: &RungReport) -> String {
    let falls: u64 = report.seeds.iter().map(|run| run.falls).sum();
    let episodes: usize = report.seeds.iter().map(|run| run.num_episodes).sum();
    match falls {
        0 => format!("no fall in {episodes} episodes"),
        1 => format!("1 fall in {episodes} episodes"),
        _ => format!("{falls} falls in {episodes} episodes"),
    }
}

fn faster_than_tuned(comparison: &Comparison) -> Claim {
    let claim = "`doggo` is at least 1.2 times as fast as the tuned gait".to_owned();
    let (Some(doggo), Some(tuned)) = (comparison.rungs.get(&Rung::Doggo), comparison.rungs.get(&Rung::Tuned)) else {
        return not_measured(claim, (BEYOND, "-"), "the comparison ran without `doggo` or `tuned`");
    };
    if tuned.speed_iqm <= 0.0 {
        return not_measured(claim, (BEYOND, "-"), "the tuned gait does not move forward");
    }
    let ratio = Sample::speeds(&doggo.seeds).against(&Sample::speeds(&tuned.seeds), |own, other| own / other);
    let holds = at_least(ratio.1, 1.2);
    let probability = doggo.probability_faster_than_tuned.unwrap_or(f64::NAN);
    let sentence = format!(
        "`doggo` walks {:.2} m/s with {}, the best constant parameters {:.2} m/s with {}; a run of `doggo` is the faster one \
         with probability {probability:.2}: {}.",
        doggo.speed_iqm,
        falls(doggo),
        tuned.speed_iqm,
        falls(tuned),
        verdict(holds)
    );
    Claim { claim, source: BEYOND, paper: "-".to_owned(), ours: with_interval(ratio, 2), holds, sentence }
}

fn faster_than_without(comparison: &Comparison) -> Claim {
    let claim = "`doggo` is faster than learning without the prior at its best".to_owned();
    let rung = |rung| comparison.rungs.get(&rung);
    let (Some(doggo), Some(free)) = (rung(Rung::Doggo), rung(Rung::DirectBest)) else {
        return not_measured(claim, (BEYOND, "-"), "the comparison ran without `doggo` or `direct-best`");
    };
    let difference = Sample::speeds(&doggo.seeds).against(&Sample::speeds(&free.seeds), |own, other| own - other);
    let holds = at_least(difference.1, 0.0);
    let synchrony = |rung| footfall(comparison, rung).map_or(0.0, |footfall| 100.0 * footfall.diagonal_synchrony);
    let sentence = format!(
        "`doggo` walks {:.2} m/s with {}, `direct-best`, whose motor angles are free and which has no gait to keep, {:.2} m/s \
         with {}; diagonal legs agree {:.0} % and {:.0} % of the time, {}.",
        doggo.speed_iqm,
        falls(doggo),
        free.speed_iqm,
        falls(free),
        synchrony(Rung::Doggo),
        synchrony(Rung::DirectBest),
        verdict(holds)
    );
    let ours = format!("{} m/s more", with_interval(difference, 2));
    Claim { claim, source: BEYOND, paper: "-".to_owned(), ours, holds, sentence }
}

/// Return at the start of a training: the mean of its first points.
fn start_return(curve: &[(u64, f64)]) -> f64 {
    mean_return(&curve[..START_POINTS.min(curve.len())])
}

/// Return at the end of a training: the mean of its last points.
fn final_return(curve: &[(u64, f64)]) -> f64 {
    let count = ((END_SHARE * curve.len() as f64).ceil() as usize).max(START_POINTS).min(curve.len());
    mean_return(&curve[curve.len() - count..])
}

fn mean_return(points: &[(u64, f64)]) -> f64 {
    mean(&points.iter().map(|(_, value)| *value).collect::<Vec<_>>())
}

/// Env steps after which the mean return of the last points first reached `level`.
fn steps_until(curve: &[(u64, f64)], level: f64) -> Option<f64> {
    let smoothed = |end: usize| mean_return(&curve[(end + 1).saturating_sub(SMOOTHING_POINTS)..=end]);
    let place = (0..curve.len()).find(|&end| smoothed(end) >= level)?;
    Some(curve[place].0 as f64)
}

/// Env steps until a training had most of its own final return; none if that is not above 0, where a share of it has no
/// meaning, or if the smoothed curve never gets there.
fn convergence_steps(run: &RunReport) -> Option<f64> {
    let end = final_return(&run.return_curve);
    if end > 0.0 { steps_until(&run.return_curve, CONVERGED_SHARE * end) } else { None }
}

/// Whether every run has a curve to speak of.
fn has_curves(runs: &[RunReport]) -> bool {
    runs.iter().all(|run| run.return_curve.len() >= START_POINTS)
}

const NO_CURVES: &str = "too few episodes ended during training";

fn converges_faster(comparison: &Comparison) -> Claim {
    let claim = "converges faster than without the prior".to_owned();
    let origin = ("abstract, fig. 5", "faster");
    let Some((paper, direct)) = paper_and_control(comparison) else { return not_measured(claim, origin, NO_CONTROL) };
    if !has_curves(paper) || !has_curves(direct) {
        return not_measured(claim, origin, NO_CURVES);
    }
    let steps = |runs: &[RunReport]| -> Option<Sample> {
        let all: Option<Vec<f64>> = runs.iter().map(convergence_steps).collect();
        let all = all?;
        let mut next = all.into_iter();
        Some(Sample::of(runs, |_| next.next().expect("one a run")))
    };
    let control_final = Sample::of(direct, |run| final_return(&run.return_curve)).estimate();
    let overtaking: Option<Vec<f64>> = paper.iter().map(|run| steps_until(&run.return_curve, control_final)).collect();
    let overtaking = overtaking.map_or_else(
        || "not every run of `paper` reaches the return that `direct` ends with".to_owned(),
        |steps| format!("`paper` has the return that `direct` ends with after {:.0} env steps", mean(&steps)),
    );
    let (Some(with_prior), Some(without)) = (steps(paper), steps(direct)) else {
        let sentence = format!(
            "The return of a run never settled above 0, so 90 % of it has no meaning; {overtaking}, {}.",
            verdict(None)
        );
        return Claim {
            claim,
            source: origin.0,
            paper: origin.1.to_owned(),
            ours: "-".to_owned(),
            holds: None,
            sentence,
        };
    };
    let ratio = without.against(&with_prior, |without, with_prior| without / with_prior);
    let holds = match at_least(ratio.1, 1.0) {
        // The same number of steps is not faster.
        Some(true) if ratio.1[0] <= 1.0 => None,
        other => other,
    };
    let sentence = format!(
        "`paper` has 90 % of its own final return after {:.0} env steps, `direct` after {:.0}, {:.2} times as many; \
         {overtaking}, {}.",
        with_prior.estimate(),
        without.estimate(),
        ratio.0,
        verdict(holds)
    );
    let ours = format!("{} times", with_interval(ratio, 2));
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds, sentence }
}

fn twice_the_return(comparison: &Comparison) -> Claim {
    let claim = "twice the return of learning without the prior".to_owned();
    let origin = ("section V.B, fig. 5", "2");
    let Some((paper, direct)) = paper_and_control(comparison) else { return not_measured(claim, origin, NO_CONTROL) };
    if !has_curves(paper) || !has_curves(direct) {
        return not_measured(claim, origin, NO_CURVES);
    }
    let end = |runs: &[RunReport]| Sample::of(runs, |run| final_return(&run.return_curve));
    let (with_prior, without) = (end(paper), end(direct));
    // A difference, because a ratio means nothing where a return may be negative.
    let surplus = with_prior.against(&without, |with_prior, without| with_prior - 2.0 * without.max(0.0));
    let holds = at_least(surplus.1, 0.0);
    let ours = format!(
        "{} against {}",
        with_interval((with_prior.estimate(), with_prior.interval()), 1),
        with_interval((without.estimate(), without.interval()), 1)
    );
    let ratio = if without.estimate() > 0.0 {
        format!("{:.1} times as much", with_prior.estimate() / without.estimate())
    } else {
        "which is not above 0".to_owned()
    };
    let sentence = format!(
        "At the end of training `paper` has a return of {:.1} an episode, `direct` {:.1} ({ratio}), {}.",
        with_prior.estimate(),
        without.estimate(),
        verdict(holds)
    );
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds, sentence }
}

fn good_start(comparison: &Comparison) -> Claim {
    let claim = "a good return right from the start".to_owned();
    let origin = ("section V.B, fig. 5", "good");
    let Some((paper, direct)) = paper_and_control(comparison) else { return not_measured(claim, origin, NO_CONTROL) };
    if !has_curves(paper) || !has_curves(direct) {
        return not_measured(claim, origin, NO_CURVES);
    }
    let start = |runs: &[RunReport]| Sample::of(runs, |run| start_return(&run.return_curve));
    let (with_prior, without) = (start(paper), start(direct));
    let difference = with_prior.against(&without, |with_prior, without| with_prior - without);
    let holds = at_least(difference.1, 0.0);
    let end = Sample::of(paper, |run| final_return(&run.return_curve)).estimate();
    let sentence = format!(
        "In its first iterations `paper` has a return of {:.1} an episode, of {end:.1} in the end; `direct` begins with {:.1}, {}.",
        with_prior.estimate(),
        without.estimate(),
        verdict(holds)
    );
    let ours = format!(
        "{} against {}",
        with_interval((with_prior.estimate(), with_prior.interval()), 1),
        with_interval((without.estimate(), without.interval()), 1)
    );
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds, sentence }
}

fn steadier_speed(comparison: &Comparison) -> Claim {
    let claim = "a steadier speed than without the prior".to_owned();
    let origin = ("section V.C, fig. 6", "steadier");
    let Some((paper, direct)) = paper_and_control(comparison) else { return not_measured(claim, origin, NO_CONTROL) };
    let spread = |runs: &[RunReport]| Sample::of(runs, |run| 1e3 * run.speed_per_step_std_m);
    let (with_prior, without) = (spread(paper), spread(direct));
    let difference = with_prior.against(&without, |with_prior, without| with_prior - without);
    let holds = below(difference.1, 0.0);
    let speed = |rung: Rung| comparison.rungs[&rung].speed_iqm;
    let sentence = format!(
        "The way of one control step varies by {:.2} mm with `paper` at {:.2} m/s, by {:.2} mm with `direct` at {:.2} m/s, {}.",
        with_prior.estimate(),
        speed(Rung::Paper),
        without.estimate(),
        speed(Rung::Direct),
        verdict(holds)
    );
    let ours = format!(
        "{} mm against {} mm",
        with_interval((with_prior.estimate(), with_prior.interval()), 2),
        with_interval((without.estimate(), without.interval()), 2)
    );
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds, sentence }
}

fn smaller_yaw_and_sway(comparison: &Comparison) -> Claim {
    let claim = "smaller yaw and sway than without the prior".to_owned();
    let origin = ("section V.A, fig. 4", "smaller");
    let Some((paper, direct)) = paper_and_control(comparison) else { return not_measured(claim, origin, NO_CONTROL) };
    type Value = fn(&RunReport) -> f64;
    let parts: [(&str, &str, Value); 3] = [
        ("turns by", "deg", |run| run.heading_deg),
        ("drifts by", "m", |run| run.drift_m),
        ("bounces by", "mm", |run| 1e3 * run.height_std_m),
    ];
    let mut holds = Some(true);
    let (mut clauses, mut figures) = (Vec::new(), Vec::new());
    for (verb, unit, value) in parts {
        let (with_prior, without) = (Sample::of(paper, value), Sample::of(direct, value));
        let difference = with_prior.against(&without, |with_prior, without| with_prior - without);
        // All three have to be smaller: one that is not decides, one that is open leaves it open.
        holds = match (holds, below(difference.1, 0.0)) {
            (Some(false), _) | (_, Some(false)) => Some(false),
            (None, _) | (_, None) => None,
            _ => Some(true),
        };
        clauses.push(format!("{verb} {:.2} {unit} ({:.2})", with_prior.estimate(), without.estimate()));
        figures.push(format!("{:.2} against {:.2} {unit}", with_prior.estimate(), without.estimate()));
    }
    let sentence = format!(
        "`paper` {} in an episode, in brackets `direct`, which walks {:.2} m/s; all three have to be smaller, {}.",
        clauses.join(", "),
        comparison.rungs[&Rung::Direct].speed_iqm,
        verdict(holds)
    );
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours: figures.join(", "), holds, sentence }
}

fn no_contact(comparison: &Comparison) -> Claim {
    let claim = "no contact of body or legs with the ground".to_owned();
    let origin = ("section V.A, fig. 4", "none");
    let Some(paper) = runs(comparison, Rung::Paper) else {
        return not_measured(claim, origin, "the comparison ran without `paper`");
    };
    let contact = |runs: &[RunReport]| Sample::of(runs, |run| run.body_contact_steps);
    let own = contact(paper);
    let is_clean = paper.iter().all(|run| run.body_contact_steps == 0.0);
    let others: Vec<String> = [Rung::Direct, Rung::Doggo, comparison.default_rung]
        .into_iter()
        .filter_map(|rung| Some(format!("{:.1} with `{}`", contact(runs(comparison, rung)?).estimate(), rung.name())))
        .collect();
    let sentence = format!(
        "Anything but the feet touches the ground in {:.1} control steps of an episode with `paper`, {}; one touch is enough, {}.",
        own.estimate(),
        others.join(", "),
        verdict(Some(is_clean))
    );
    let ours = format!("{} steps an episode", with_interval((own.estimate(), own.interval()), 1));
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds: Some(is_clean), sentence }
}

/// Speed, its interval and falls of a rung on a slope.
fn on_slope(comparison: &Comparison, rung: Rung, slope_deg: f64) -> Option<(f64, [f64; 2], f64)> {
    let sweep = comparison.sweeps.get(&Quantity::Slope)?;
    let place = sweep.values.iter().position(|value| *value == slope_deg)?;
    let row = sweep.rungs.get(&rung)?;
    Some((row.speed_m_per_s[place], row.speed_ci[place], row.falls_per_episode[place]))
}

/// What other gaits do on the paper's slope.
fn others_uphill(comparison: &Comparison, rungs: &[Rung]) -> String {
    let others: Vec<String> = rungs
        .iter()
        .filter_map(|rung| {
            let (speed, _, falls) = on_slope(comparison, *rung, UPHILL_DEG)?;
            Some(format!("`{}` {} m/s ({:.0} % fall)", rung.name(), fixed(speed, 2), 100.0 * falls))
        })
        .collect();
    others.join(", ")
}

fn holds_uphill(comparison: &Comparison) -> Claim {
    let claim = "holds its speed on 20 degrees uphill".to_owned();
    let origin = ("section V.D, fig. 7", "same speed");
    let Some((speed, ci, falls)) = on_slope(comparison, Rung::Paper, UPHILL_DEG) else {
        return not_measured(claim, origin, "`paper` was not measured on this slope");
    };
    let level = comparison.rungs[&Rung::Paper].speed_iqm;
    let holds = if level > 0.0 { at_least(ci, KEPT_SPEED_SHARE * level) } else { Some(false) };
    let sentence = format!(
        "`paper` walks {level:.2} m/s on level ground and {} m/s uphill, where it falls in {:.0} % of the episodes; \
         uphill are also {}; it would have to keep 90 % of its speed, {}.",
        fixed(speed, 2),
        100.0 * falls,
        others_uphill(comparison, &[Rung::Sine, Rung::Stepping, Rung::Tuned, Rung::Doggo]),
        verdict(holds)
    );
    let ours = format!("{} of {level:.2} m/s", with_interval((speed, ci), 2));
    Claim { claim, source: origin.0, paper: origin.1.to_owned(), ours, holds, sentence }
}

fn climbs(comparison: &Comparison) -> Claim {
    let claim = "`doggo` climbs 20 degrees without a fall".to_owned();
    let Some((speed, ci, falls)) = on_slope(comparison, Rung::Doggo, UPHILL_DEG) else {
        return not_measured(claim, (BEYOND, "-"), "`doggo` was not measured on this slope");
    };
    let holds = if falls > 0.0 { Some(false) } else { at_least(ci, CLIMBING_SPEED_M_PER_S) };
    let sentence = format!(
        "`doggo` goes {} m/s uphill and falls in {:.0} % of the episodes; beside it {}; it \
         would have to go {CLIMBING_SPEED_M_PER_S} m/s without a fall, {}.",
        fixed(speed, 2),
        100.0 * falls,
        others_uphill(comparison, &[Rung::Sine, Rung::Stepping, Rung::Tuned, Rung::Paper]),
        verdict(holds)
    );
    let ours = format!("{} m/s", with_interval((speed, ci), 2));
    Claim { claim, source: BEYOND, paper: "-".to_owned(), ours, holds, sentence }
}

/// Mean footfalls over the runs of a rung.
fn footfall(comparison: &Comparison, rung: Rung) -> Option<Footfall> {
    Footfall::mean(&runs(comparison, rung)?.iter().filter_map(|run| run.footfall).collect::<Vec<_>>())
}

fn still_that_gait(comparison: &Comparison, rung: Rung) -> Claim {
    let claim = format!("`{}` is still that gait, a trot", rung.name());
    let (Some(own), Some(sine)) = (footfall(comparison, rung), footfall(comparison, Rung::Sine)) else {
        let what = format!("the comparison ran without `{}`, or it fell at once", rung.name());
        return not_measured(claim, (BEYOND, "-"), &what);
    };
    let is_synchronous = own.diagonal_synchrony >= sine.diagonal_synchrony - SYNCHRONY_LOSS;
    let is_diagonal = own.diagonal_synchrony > own.lateral_synchrony.max(own.transverse_synchrony);
    let holds = Some(is_synchronous && is_diagonal);
    let sentence = format!(
        "Diagonal legs agree {:.0} % of the time (legs of one side {:.0} %, front and hind pairs {:.0} %), with a duty factor \
         of {:.2} at {:.1} Hz; the sine gait has {:.0} %, {:.2} and {:.1} Hz, {}.",
        100.0 * own.diagonal_synchrony,
        100.0 * own.lateral_synchrony,
        100.0 * own.transverse_synchrony,
        own.duty_factor,
        own.stride_frequency_hz,
        100.0 * sine.diagonal_synchrony,
        sine.duty_factor,
        sine.stride_frequency_hz,
        verdict(holds)
    );
    let synchronies = Sample::of(&comparison.rungs[&rung].seeds, |run| {
        100.0 * run.footfall.map_or(0.0, |footfall| footfall.diagonal_synchrony)
    });
    let ours = format!("{} % diagonal", with_interval((synchronies.estimate(), synchronies.interval()), 0));
    Claim { claim, source: BEYOND, paper: "-".to_owned(), ours, holds, sentence }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::compare::measured::{Measured, SweepPoint};
    use crate::compare::protocol::{CompareSettings, Sweep};

    /// What a rung of the hand-made comparison does.
    #[derive(Clone, Copy)]
    struct Made {
        speed: f64,
        uphill: f64,
        uphill_falls: u64,
        /// Return at the start and at the end of training.
        returns: [f64; 2],
        /// Point of the curve at which the return jumps from one to the other.
        jump: usize,
        std_m: f64,
        heading_deg: f64,
        contact_steps: f64,
        synchrony: f64,
    }

    const GAIT: Made = Made {
        speed: 0.5,
        uphill: 0.05,
        uphill_falls: 0,
        returns: [10.0, 10.0],
        jump: 0,
        std_m: 0.001,
        heading_deg: 2.0,
        contact_steps: 0.0,
        synchrony: 0.9,
    };

    fn measured(rung: Rung, made: Made, seed: Option<u64>) -> Measured {
        // Seeds differ by 1 % each.
        let scale = 1.0 + 0.01 * seed.unwrap_or(0) as f64;
        let footfall = Footfall {
            duty_factor: 0.6,
            stride_frequency_hz: 2.0,
            diagonal_synchrony: made.synchrony,
            lateral_synchrony: 0.5,
            transverse_synchrony: 0.5,
        };
        let curve = |point: usize| (1000 * (point as u64 + 1), made.returns[usize::from(point >= made.jump)] * scale);
        let run = RunReport {
            seed,
            env_steps: 40_000,
            speed_m_per_s: made.speed * scale,
            prior_speed_m_per_s: (rung == Rung::Paper).then_some(0.25),
            displacement_speed_m_per_s: made.speed,
            falls: 0,
            num_episodes: 3,
            falls_by_cause: BTreeMap::new(),
            episode_return: made.returns[1],
            drift_m: 0.1 * made.heading_deg,
            heading_deg: made.heading_deg * scale,
            height_std_m: 0.001 * made.heading_deg,
            power_w: 20.0,
            cost_of_transport: Some(1.0),
            speed_per_step_std_m: made.std_m * scale,
            body_contact_steps: made.contact_steps,
            footfall: Some(footfall),
            speeds_m_per_s: [0.99, 1.0, 1.01].map(|factor| factor * made.speed * scale).to_vec(),
            return_curve: if seed.is_some() { (0..40).map(curve).collect() } else { Vec::new() },
        };
        let point = |speed: f64, falls| SweepPoint { speeds_m_per_s: vec![speed * scale; 2], falls };
        let slopes = vec![point(made.speed, 0), point(made.uphill, made.uphill_falls)];
        let sweeps = if rung.is_swept() { BTreeMap::from([(Quantity::Slope, slopes)]) } else { BTreeMap::new() };
        Measured { run, sweeps }
    }

    fn comparison(made: &[(Rung, Made)]) -> Comparison {
        let mut settings = CompareSettings::full(40_000, 3);
        settings.sweeps = vec![Sweep { quantity: Quantity::Slope, values: vec![0.0, 20.0] }];
        let of_rung = |&(rung, made): &(Rung, Made)| -> Vec<(Rung, Measured)> {
            match rung {
                Rung::Sine | Rung::Stepping => vec![(rung, measured(rung, made, None))],
                _ => settings.seeds.iter().map(|&seed| (rung, measured(rung, made, Some(seed)))).collect(),
            }
        };
        Comparison::new(&settings, made.iter().flat_map(of_rung).collect()).unwrap()
    }

    fn claim(comparison: &Comparison, start: &str) -> Claim {
        let found = comparison.claims.iter().find(|claim| claim.claim.starts_with(start));
        found.unwrap_or_else(|| panic!("no claim begins with {start}")).clone()
    }

    fn good() -> Vec<(Rung, Made)> {
        let paper = Made { speed: 1.0, uphill: 0.99, returns: [10.0, 50.0], jump: 10, ..GAIT };
        let direct = Made {
            speed: 0.3,
            returns: [-5.0, 20.0],
            jump: 30,
            std_m: 0.004,
            heading_deg: 40.0,
            contact_steps: 50.0,
            synchrony: 0.4,
            ..GAIT
        };
        vec![
            (Rung::Sine, GAIT),
            (Rung::Stepping, Made { speed: 0.4, ..GAIT }),
            (Rung::Tuned, Made { speed: 1.5, ..GAIT }),
            (Rung::Direct, direct),
            (Rung::DirectBest, Made { speed: 1.2, ..direct }),
            (Rung::Paper, paper),
            (Rung::Doggo, Made { speed: 2.0, uphill: 0.5, ..paper }),
        ]
    }

    fn changed(rung: Rung, change: impl Fn(&mut Made)) -> Comparison {
        let mut made = good();
        change(&mut made.iter_mut().find(|(found, _)| *found == rung).unwrap().1);
        comparison(&made)
    }

    #[test]
    fn a_comparison_in_which_everything_is_as_claimed() {
        let comparison = comparison(&good());
        assert_eq!(comparison.default_rung, Rung::Sine);
        let open: Vec<_> = comparison.claims.iter().filter(|claim| claim.holds != Some(true)).collect();
        assert!(open.is_empty(), "{open:#?}");
        assert_eq!(comparison.claims.len(), 14);
        // 1.0 / 0.5, seeds 1.01 to 1.03 times.
        let faster = claim(&comparison, "50 %");
        assert!(faster.ours.starts_with("2.04 ["), "{}", faster.ours);
        assert!(faster.sentence.contains("`paper` walks 1.02 m/s with no fall in 9 episodes"), "{}", faster.sentence);
        assert!(faster.sentence.contains("; the gait that it learned on 0.25 m/s; "), "{}", faster.sentence);
        assert!(faster.sentence.contains("the tuned gait, without learning, walks 1.53 m/s"), "{}", faster.sentence);
        // The mean of 5 points reaches 90 % when all five are after the jump: points 15 and 35 of 1000 env steps each.
        let converges = claim(&comparison, "converges");
        assert!(converges.sentence.contains("after 15000 env steps, `direct` after 35000"), "{}", converges.sentence);
        assert_eq!(claim(&comparison, "`doggo` is at least 1.2").ours.split(' ').next(), Some("1.33"));
    }

    #[test]
    fn what_does_not_hold_is_said() {
        let holds = |comparison: &Comparison, start: &str| claim(comparison, start).holds;
        let slow = changed(Rung::Paper, |paper| paper.speed = 0.6);
        assert_eq!(holds(&slow, "50 %"), Some(false));
        assert!(claim(&slow, "50 %").sentence.ends_with("so the claim does not hold here."));
        let late = changed(Rung::Paper, |paper| paper.jump = 35);
        assert_eq!(holds(&late, "converges"), Some(false));
        let small = changed(Rung::Paper, |paper| paper.returns[1] = 30.0);
        assert_eq!(holds(&small, "twice"), Some(false));
        let bad_start = changed(Rung::Paper, |paper| paper.returns[0] = -20.0);
        assert_eq!(holds(&bad_start, "a good return"), Some(false));
        let unsteady = changed(Rung::Paper, |paper| paper.std_m = 0.01);
        assert_eq!(holds(&unsteady, "a steadier"), Some(false));
        let turning = changed(Rung::Paper, |paper| paper.heading_deg = 90.0);
        assert_eq!(holds(&turning, "smaller yaw"), Some(false));
        let touching = changed(Rung::Paper, |paper| paper.contact_steps = 0.1);
        assert_eq!(holds(&touching, "no contact"), Some(false));
        let sliding = changed(Rung::Paper, |paper| paper.uphill = 0.5);
        assert_eq!(holds(&sliding, "holds its speed"), Some(false));
        let hopping = changed(Rung::Doggo, |doggo| doggo.synchrony = 0.7);
        assert_eq!(
            (holds(&hopping, "`doggo` is still"), holds(&hopping, "`paper` is still")),
            (Some(false), Some(true))
        );
        let free = changed(Rung::DirectBest, |free| free.speed = 2.5);
        assert_eq!(holds(&free, "`doggo` is faster than"), Some(false));
        let falling = changed(Rung::Doggo, |doggo| doggo.uphill_falls = 1);
        assert_eq!(holds(&falling, "`doggo` climbs"), Some(false));
        let equal = changed(Rung::Doggo, |doggo| doggo.speed = 1.5);
        assert_eq!(holds(&equal, "`doggo` is at least 1.2"), Some(false));
    }

    #[test]
    fn what_cannot_be_told_is_open() {
        // Seeds 1.01 to 1.03 times 0.735 over 0.5: the interval lies across 1.5.
        let close = changed(Rung::Paper, |paper| paper.speed = 0.735);
        assert_eq!(claim(&close, "50 %").holds, None);
        assert!(claim(&close, "50 %").sentence.ends_with("so these runs cannot tell."));
        // Without a positive return 90 % of it has no meaning; twice of it is below whatever is positive.
        let hopeless = changed(Rung::Direct, |direct| direct.returns = [-5.0, -1.0]);
        assert_eq!(claim(&hopeless, "converges").holds, None);
        assert_eq!(claim(&hopeless, "twice").holds, Some(true));
        // Less bad is not twice as good.
        let mut both = good();
        both.iter_mut()
            .filter(|(rung, _)| [Rung::Paper, Rung::Direct].contains(rung))
            .for_each(|(_, made)| made.returns[1] = if made.speed == 1.0 { -1.0 } else { -3.0 });
        assert_eq!(claim(&comparison(&both), "twice").holds, Some(false));
        // Without the rungs that it needs a claim is not measured.
        let bare = comparison(&good()[..3]);
        assert!(bare.claims.iter().all(|claim| claim.holds.is_none() && claim.sentence.starts_with("Not measured: ")));
    }

    #[test]
    fn a_rounded_zero_has_no_sign() {
        assert_eq!((fixed(-0.001, 2), fixed(-0.006, 2), fixed(0.0, 1)), ("0.00".into(), "-0.01".into(), "0.0".into()));
    }

    #[test]
    fn statistics_of_the_rungs() {
        let comparison = comparison(&good());
        let doggo = &comparison.rungs[&Rung::Doggo];
        assert!((doggo.speed_iqm - 2.04).abs() < 1e-12);
        assert!(doggo.speed_ci[0] >= 2.02 - 1e-12 && doggo.speed_ci[1] <= 2.06 + 1e-12);
        assert_eq!((doggo.probability_faster_than_default, doggo.probability_faster_than_tuned), (1.0, Some(1.0)));
        let direct = &comparison.rungs[&Rung::Direct];
        assert_eq!((direct.probability_faster_than_default, direct.probability_faster_than_tuned), (0.0, Some(0.0)));
        // A bare gait's interval is over its episodes.
        let sine = &comparison.rungs[&Rung::Sine];
        assert!((sine.speed_iqm - 0.5).abs() < 1e-12 && sine.speed_ci[0] < 0.5 && 0.5 < sine.speed_ci[1]);
        assert_eq!(comparison.rungs[&Rung::Tuned].probability_faster_than_tuned, None);
        assert!(!comparison.sweeps[&Quantity::Slope].rungs.contains_key(&Rung::Direct));
        let median = crate::compare::results::median_run(&doggo.seeds).unwrap();
        assert_eq!(median.seed, Some(2));
    }
}
