//! Random numbers that follow from an episode's key and what they are for: nothing has to be remembered between them.

/// What a number is for; each has its own numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    CrossSlope = 1,
    Roughness,
    Friction,
    Mass,
    Strength,
    Gain,
    Delay,
    CentreOfMass,
    Noise,
    Push,
    Height,
    Step,
    Patch,
}

/// A number in [0, 1) with 53 random bits.
///
/// ```text
/// u = mix(mix(key) + purpose 2^56 + counter) / 2^64
/// ```
///
/// Source: the finaliser of SplitMix64, Steele et al. 2014, as a hash.
pub(crate) fn uniform(key: u64, purpose: Purpose, counter: u64) -> f64 {
    const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
    let place = ((purpose as u64) << 56).wrapping_add(counter);
    (mix(mix(key.wrapping_add(GOLDEN_GAMMA)).wrapping_add(place.wrapping_mul(GOLDEN_GAMMA))) >> 11) as f64 * UNIT
}

/// A number in [-1, 1).
pub(crate) fn either_way(key: u64, purpose: Purpose, counter: u64) -> f64 {
    2.0 * uniform(key, purpose, counter) - 1.0
}

/// 2^64 over the golden ratio, odd.
const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread_evenly_and_differ_by_key_purpose_and_counter() {
        let column = |number: fn(u64) -> f64| (0..1000).map(number).collect::<Vec<f64>>();
        let columns = [
            column(|i| uniform(i, Purpose::Mass, 0)),
            column(|i| uniform(7, Purpose::Mass, i)),
            column(|i| uniform(i, Purpose::Friction, 0)),
        ];
        for column in &columns {
            let mean = column.iter().sum::<f64>() / 1000.0;
            let variance = column.iter().map(|u| (u - mean) * (u - mean)).sum::<f64>() / 1000.0;
            // 1/2 and 1/12, within four standard errors.
            assert!((mean - 0.5).abs() < 0.037 && (variance - 1.0 / 12.0).abs() < 0.01, "{mean} {variance}");
            assert!(column.iter().all(|u| (0.0..1.0).contains(u)));
        }
        let product: f64 = columns[0].iter().zip(&columns[2]).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum::<f64>() / 1000.0;
        assert!(product.abs() < 0.011, "two purposes of the same keys go together: {product}");
        assert_eq!(uniform(3, Purpose::Push, 5), uniform(3, Purpose::Push, 5));
    }
}
