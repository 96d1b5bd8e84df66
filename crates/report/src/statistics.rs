//! The statistics that the writers leave to the reader: curves over seeds, shares over an episode.

/// Resamples of a bootstrap: enough for two digits of a 95 % interval.
const NUM_RESAMPLES: usize = 2000;

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

/// The interval that holds the interquartile mean of resamples in 95 % of the cases.
///
/// ```text
/// [q_0.025, q_0.975] of IQM(resample)
/// ```
///
/// Source: Efron and Tibshirani 1993, section 13.3 (percentile interval). The draws are fixed: same values, same interval.
pub fn interquartile_mean_interval(values: &[f64]) -> [f64; 2] {
    if let [only] = *values {
        return [only; 2];
    }
    let mut state = 0;
    let mut draw = || ((u128::from(split_mix(&mut state)) * values.len() as u128) >> 64) as usize;
    let mut resample = vec![0.0; values.len()];
    let mut means: Vec<f64> = (0..NUM_RESAMPLES)
        .map(|_| {
            resample.fill_with(|| values[draw()]);
            interquartile_mean(&resample)
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [quantile(&means, 0.025), quantile(&means, 0.975)]
}

/// Next number of a splitmix64 generator: 64 uniform bits.
///
/// ```text
/// s <- s + 0x9e3779b97f4a7c15;  z = (s ^ s >> 30) a;  z = (z ^ z >> 27) b;  z ^ z >> 31
/// ```
///
/// Source: Steele, Lea and Flood 2014, figure 13.
fn split_mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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

/// Centred moving average over `width` values; windows at the ends are cut short.
///
/// # Shapes
/// - `values`: (T) -> (T)
pub fn moving_average(values: &[f64], width: usize) -> Vec<f64> {
    let half = width.max(1) / 2;
    (0..values.len()).map(|i| mean(&values[i.saturating_sub(half)..(i + half + 1).min(values.len())])).collect()
}

/// Value at `x` of a line through points of growing x; the end's value outside of them.
pub fn interpolate(points: &[[f64; 2]], x: f64) -> f64 {
    let after = points.partition_point(|point| point[0] < x);
    match (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after)) {
        (Some(&[x0, y0]), Some(&[x1, y1])) => y0 + (x - x0) / (x1 - x0) * (y1 - y0),
        (Some(&[_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interquartile_mean_by_hand() {
        assert_eq!(interquartile_mean(&[100.0, 1.0, 4.0, 3.0, 2.0, 5.0, -50.0, 6.0]), 3.5);
        // n = 5: [1.25, 3.75): 0.75 x_1 + x_2 + 0.75 x_3, over 2.5.
        let expected = (0.75 * 2.0 + 3.0 + 0.75 * 10.0) / 2.5;
        assert!((interquartile_mean(&[10.0, 1.0, 2.0, 3.0, 99.0]) - expected).abs() < 1e-12);
    }

    #[test]
    fn the_interval_is_the_values_of_one_seed_and_covers_those_of_many() {
        assert_eq!(interquartile_mean_interval(&[3.0]), [3.0, 3.0]);
        let values: Vec<f64> = (0..40).map(f64::from).collect();
        let [low, high] = interquartile_mean_interval(&values);
        assert!(low < 19.5 && 19.5 < high && high - low < 20.0, "{low} {high}");
        assert_eq!(interquartile_mean_interval(&values), [low, high]);
    }

    #[test]
    fn generator_matches_the_published_sequence() {
        let mut state = 0;
        assert_eq!(split_mix(&mut state), 0xe220_a839_7b1d_cdaf);
        assert_eq!(split_mix(&mut state), 0x6e78_9e6a_a1b9_65f4);
    }

    #[test]
    fn averages_and_interpolation_by_hand() {
        assert_eq!(moving_average(&[1.0, 2.0, 6.0], 3), [1.5, 3.0, 4.0]);
        assert_eq!(interpolate(&[[0.0, 1.0], [2.0, 5.0]], 0.5), 2.0);
        assert_eq!(interpolate(&[[0.0, 1.0], [2.0, 5.0]], -1.0), 1.0);
        assert_eq!(interpolate(&[[0.0, 1.0], [2.0, 5.0]], 9.0), 5.0);
        assert_eq!(population_std(&[1.0, 3.0]), 1.0);
    }
}
