//! Random streams: one generator per (seed, purpose, environment, episode), none of them global.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What a stream is drawn for. The numbers are part of every result: never renumber, only append.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// First weights of a network; "environment" is 0 for the actor, 1 for the critic.
    NetworkInit = 0,
    /// An environment's random start of an episode.
    Reset = 1,
    /// The noise on sampled actions; "episode" is the iteration.
    Exploration = 2,
    /// The order of the samples; "environment" is the epoch, "episode" the iteration.
    Shuffle = 3,
    /// Episodes of an evaluation.
    Evaluation = 4,
    /// Candidates of a search over gait parameters.
    Search = 5,
    /// Resampling for confidence intervals.
    Bootstrap = 6,
    /// Random points of a sweep; "episode" is the point.
    Sweep = 7,
}

/// The generator that belongs to these four numbers.
///
/// They are its key, so two streams never overlap and none has to be saved: asking again gives the same stream.
pub fn stream(seed: u64, purpose: Purpose, environment: u64, episode: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (bytes, number) in key.chunks_exact_mut(8).zip([seed, purpose as u64, environment, episode]) {
        bytes.copy_from_slice(&number.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// Puts `items` into a random order, each order equally likely to within 2^-32 per draw.
///
/// ```text
/// for i = n-1 .. 1:  swap(i, j),  j = floor(u (i + 1) / 2^32),  u uniform in 0 .. 2^32
/// ```
///
/// Source: Durstenfeld 1964, Algorithm 235; drawn without rejection.
pub fn shuffle(items: &mut [u32], rng: &mut ChaCha8Rng) {
    for i in (1..items.len()).rev() {
        let j = (u64::from(rng.next_u32()) * (i as u64 + 1)) >> 32;
        items.swap(i, j as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_the_key_selects_another_stream() {
        let first = |seed, purpose, environment, episode| stream(seed, purpose, environment, episode).next_u64();
        let reference = first(1, Purpose::Reset, 2, 3);
        assert_eq!(reference, first(1, Purpose::Reset, 2, 3));
        assert_ne!(reference, first(2, Purpose::Reset, 2, 3));
        assert_ne!(reference, first(1, Purpose::Search, 2, 3));
        assert_ne!(reference, first(1, Purpose::Reset, 3, 3));
        assert_ne!(reference, first(1, Purpose::Reset, 2, 4));
        assert_ne!(reference, first(1, Purpose::Reset, 3, 2));
    }

    #[test]
    fn shuffle_is_a_permutation_and_every_place_is_reached() {
        let mut rng = stream(7, Purpose::Shuffle, 0, 0);
        let mut seen = [[0; 5]; 5];
        for _ in 0..2000 {
            let mut items = [0, 1, 2, 3, 4];
            shuffle(&mut items, &mut rng);
            for (place, &item) in items.iter().enumerate() {
                seen[place][item as usize] += 1;
            }
        }
        // 2000 draws, expected 400 with standard deviation 18
        assert!(seen.iter().flatten().all(|&count| (310..490).contains(&count)), "{seen:?}");
        assert!(seen.iter().all(|row| row.iter().sum::<i32>() == 2000));
    }
}
