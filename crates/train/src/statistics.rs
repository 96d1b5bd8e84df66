//! Means and their uncertainty.

use canter_learn::random::{Purpose, stream};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// Resamples of a bootstrap: enough for two digits of a 95 % interval.
const NUM_RESAMPLES: u64 = 2000;

/// Seed of the resampling; part of every published interval.
const BOOTSTRAP_SEED: u64 = 0;

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of a whole population; 0 of fewer than two values.
///
/// ```text
/// s = sqrt(sum (x - mean)^2 / n)
/// ```
///
/// Source: textbook definition.
pub fn population_std(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let mean = mean(values);
    (values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / values.len() as f64).sqrt()
}

/// Interquartile mean: the mean of the middle half of the sorted values, the two at its edges weighted by their share.
///
/// ```text
/// IQM = sum_i w_i x_(i) / (n / 2),  w_i = length of [i, i + 1) within [n / 4, 3 n / 4)
/// ```
///
/// Source: Agarwal et al. 2021, section 4.3; fractional weights as in the 25 % trimmed mean.
pub fn interquartile_mean(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let weighted = sorted.iter().enumerate().map(|(i, value)| {
        let (low, high) = ((i as f64).max(n / 4.0), (i as f64 + 1.0).min(3.0 * n / 4.0));
        (high - low).max(0.0) * value
    });
    weighted.sum::<f64>() / (n / 2.0)
}

/// The interval that holds `statistic` of resamples of all `groups` in 95 % of the cases.
///
/// Each group is resampled on its own, with replacement; `statistic` sees the resampled groups in their order.
///
/// ```text
/// [q_0.025, q_0.975] of statistic(resample of each group)
/// ```
///
/// Source: Efron and Tibshirani 1993, section 13.3 (percentile interval); stratified as in Agarwal et al. 2021.
pub fn bootstrap_interval(groups: &[&[f64]], statistic: impl Fn(&[Vec<f64>]) -> f64) -> [f64; 2] {
    interval_over(|rng| {
        let resampled: Vec<Vec<f64>> = groups.iter().map(|group| resample(group, rng)).collect();
        statistic(&resampled)
    })
}

/// Like [`bootstrap_interval`], for groups of runs of episodes: runs are resampled, then the episodes of each drawn run.
///
/// A group of a single run has no spread over runs to show: only its episodes are resampled.
///
/// ```text
/// [q_0.025, q_0.975] of statistic(resample of the runs, and of the episodes within each, of each group)
/// ```
///
/// Source: Davison and Hinkley 1997, section 3.8 (hierarchical data, resampled with replacement at both levels).
pub fn nested_bootstrap_interval(groups: &[&[Vec<f64>]], statistic: impl Fn(&[Vec<Vec<f64>>]) -> f64) -> [f64; 2] {
    interval_over(|rng| {
        let resampled: Vec<Vec<Vec<f64>>> = groups
            .iter()
            .map(|runs| (0..runs.len()).map(|_| resample(&runs[draw(rng, runs.len())], rng)).collect())
            .collect();
        statistic(&resampled)
    })
}

/// The interval that holds 95 % of what `resampled_statistic` gives over the resamples' streams.
fn interval_over(resampled_statistic: impl Fn(&mut ChaCha8Rng) -> f64) -> [f64; 2] {
    let mut values: Vec<f64> = (0..NUM_RESAMPLES)
        .map(|number| resampled_statistic(&mut stream(BOOTSTRAP_SEED, Purpose::Bootstrap, 0, number)))
        .collect();
    values.sort_by(f64::total_cmp);
    [quantile(&values, 0.025), quantile(&values, 0.975)]
}

/// As many values as there are, drawn with replacement.
fn resample(values: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    (0..values.len()).map(|_| values[draw(rng, values.len())]).collect()
}

/// A number below `bound`, each equally likely to within 2^-32.
fn draw(rng: &mut ChaCha8Rng, bound: usize) -> usize {
    ((u64::from(rng.next_u32()) * bound as u64) >> 32) as usize
}

/// Probability that a run of one kind is better than a run of another, both drawn at random; a tie counts half.
///
/// ```text
/// P(X > Y) = 1 / (N M) sum_i sum_j S(x_i, y_j),  S = 1 if x_i > y_j, 1/2 if equal, 0 otherwise
/// ```
///
/// Source: Agarwal et al. 2021, section 4.3: the Mann-Whitney statistic. NaN if either has no run.
pub fn probability_of_improvement(x: &[f64], y: &[f64]) -> f64 {
    let wins = x.iter().flat_map(|x| y.iter().map(move |y| 0.5 * (f64::from(x > y) + f64::from(x >= y))));
    wins.sum::<f64>() / (x.len() * y.len()) as f64
}

/// Quantile of sorted values by linear interpolation.
///
/// ```text
/// x_(k) + (h - k) (x_(k+1) - x_(k)),  h = q (n - 1),  k = floor(h)
/// ```
///
/// Source: Hyndman and Fan 1996, definition 7.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = q * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interquartile_mean_by_hand() {
        // n = 8: the middle four.
        assert_eq!(interquartile_mean(&[100.0, 1.0, 4.0, 3.0, 2.0, 5.0, -50.0, 6.0]), 3.5);
        // n = 5: [1.25, 3.75): 0.75 x_1 + x_2 + 0.75 x_3, over 2.5.
        let expected = (0.75 * 2.0 + 3.0 + 0.75 * 10.0) / 2.5;
        assert!((interquartile_mean(&[10.0, 1.0, 2.0, 3.0, 99.0]) - expected).abs() < 1e-12);
        assert_eq!(interquartile_mean(&[7.0]), 7.0);
    }

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn spread_by_hand() {
        assert_eq!(population_std(&[1.0, 3.0]), 1.0);
        assert_eq!(population_std(&[5.0]), 0.0);
    }

    #[test]
    fn the_interval_covers_the_mean_and_shrinks_with_the_sample() {
        let values: Vec<f64> = (0..400).map(|i| f64::from(i % 20)).collect();
        let interval = |sample: &[f64]| bootstrap_interval(&[sample], |groups| mean(&groups[0]));
        let [low, high] = interval(&values);
        assert!(low < 9.5 && 9.5 < high);
        // Standard error of the mean of 400 draws: 5.766 / 20 = 0.288; 95 % is +-1.96 of it.
        assert!((high - low - 2.0 * 1.96 * 0.288).abs() < 0.1, "{low} {high}");
        let [few_low, few_high] = interval(&values[..20]);
        assert!(few_high - few_low > 3.0 * (high - low));
        assert_eq!(interval(&values), [low, high]);
    }
}
