//! Ranks: processes that train together. The learner says what they tell each other, its caller owns the network.
//!
//! Every rank holds the same parameters. It collects with environments of its own, and afterwards knows the samples of
//! all; of each minibatch it computes the gradients of its own shards, and afterwards knows those of all. Adding up is done
//! by everyone, in the shards' order, so all ranks stay equal to the byte, and equal to a single process.

use std::fmt::Debug;
use std::ops::Range;

/// Processes that run the same program side by side. All of them have to call the same methods in the same order.
pub trait Communicator: Debug + Send + Sync {
    /// Number of processes, R.
    fn num_ranks(&self) -> usize;

    /// Which of them this is, below R.
    fn rank(&self) -> usize;

    /// Gives everyone what everyone brings: `all` gets rank 0's bytes, then rank 1's, and so on.
    ///
    /// # Shapes
    /// - `own`: `lengths[rank]` bytes
    /// - `lengths`: `(R)`, the same on all ranks
    /// - `all`: as many bytes as the lengths sum up to
    fn all_gather(&self, own: &[u8], lengths: &[usize], all: &mut [u8]);
}

/// A process that trains alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone;

impl Communicator for Alone {
    fn num_ranks(&self) -> usize {
        1
    }

    fn rank(&self) -> usize {
        0
    }

    fn all_gather(&self, own: &[u8], _lengths: &[usize], all: &mut [u8]) {
        all.copy_from_slice(own);
    }
}

/// Gives everyone what everyone brings, where nobody knows beforehand how much the others bring: one message of each rank.
pub fn exchange(communicator: &dyn Communicator, own: &[u8]) -> Vec<Vec<u8>> {
    let num_ranks = communicator.num_ranks();
    let mut lengths = vec![0; 8 * num_ranks];
    communicator.all_gather(&(own.len() as u64).to_le_bytes(), &vec![8; num_ranks], &mut lengths);
    let mut received = Received::new(&lengths);
    let lengths: Vec<usize> = (0..num_ranks).map(|_| received.u64() as usize).collect();
    let mut all = vec![0; lengths.iter().sum()];
    communicator.all_gather(own, &lengths, &mut all);
    let mut rest = &all[..];
    let mut message = |length| {
        let (message, others) = rest.split_at(length);
        rest = others;
        message.to_vec()
    };
    lengths.into_iter().map(&mut message).collect()
}

/// The part of `0..len` that belongs to this rank; the parts' sizes differ by at most one.
pub fn own_part(communicator: &dyn Communicator, len: usize) -> Range<usize> {
    part(len, communicator.num_ranks(), communicator.rank())
}

/// The `index`-th of `count` parts of `0..len` whose sizes differ by at most one.
pub fn part(len: usize, count: usize, index: usize) -> Range<usize> {
    len * index / count..len * (index + 1) / count
}

/// Bytes for the other ranks: numbers one after the other, exactly as they are.
#[derive(Clone, Debug, Default)]
pub struct Message {
    bytes: Vec<u8>,
}

impl Message {
    /// What was written so far.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Forgets everything, without giving memory back.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Appends these numbers.
    pub fn push_f32s(&mut self, numbers: &[f32]) {
        self.bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }

    /// Appends these numbers.
    pub fn push_f64s(&mut self, numbers: &[f64]) {
        self.bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }

    /// Appends a number.
    pub fn push_u64(&mut self, number: u64) {
        self.bytes.extend(number.to_le_bytes());
    }

    /// Appends bytes, and before them how many they are.
    pub fn push_bytes(&mut self, bytes: &[u8]) {
        self.push_u64(bytes.len() as u64);
        self.bytes.extend(bytes);
    }
}

/// A [`Message`] of some rank, read in the order in which it was written.
///
/// # Panics
/// Every method does if less was written: ranks run the same program, so that is a bug.
#[derive(Clone, Copy, Debug)]
pub struct Received<'a> {
    rest: &'a [u8],
}

impl<'a> Received<'a> {
    /// Reads from the beginning.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    fn take(&mut self, length: usize) -> &'a [u8] {
        let (taken, rest) = self.rest.split_at(length);
        self.rest = rest;
        taken
    }

    /// Reads as many numbers as there is room for.
    pub fn f32s(&mut self, numbers: &mut [f32]) {
        let bytes = self.take(4 * numbers.len());
        for (number, bytes) in numbers.iter_mut().zip(bytes.as_chunks().0) {
            *number = f32::from_le_bytes(*bytes);
        }
    }

    /// Reads as many numbers as there is room for.
    pub fn f64s(&mut self, numbers: &mut [f64]) {
        let bytes = self.take(8 * numbers.len());
        for (number, bytes) in numbers.iter_mut().zip(bytes.as_chunks().0) {
            *number = f64::from_le_bytes(*bytes);
        }
    }

    /// Reads a number.
    pub fn u64(&mut self) -> u64 {
        u64::from_le_bytes(*self.take(8).first_chunk().expect("8 bytes were taken"))
    }

    /// Reads bytes that were written with their number.
    pub fn bytes(&mut self) -> &'a [u8] {
        let length = self.u64() as usize;
        self.take(length)
    }

    /// Whether everything was read.
    pub fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_arrive_as_they_were_sent() {
        let mut message = Message::default();
        message.push_f32s(&[1.5, -0.0, f32::NAN]);
        message.push_bytes(b"abc");
        message.push_f64s(&[0.1]);
        message.push_u64(u64::MAX);
        let all = exchange(&Alone, message.bytes());
        let mut received = Received::new(&all[0]);
        let (mut three, mut one) = ([0.0_f32; 3], [0.0_f64]);
        received.f32s(&mut three);
        assert_eq!(three.map(f32::to_bits), [1.5, -0.0, f32::NAN].map(f32::to_bits));
        assert_eq!(received.bytes(), b"abc");
        received.f64s(&mut one);
        assert_eq!((one, received.is_at_end()), ([0.1], false));
        assert_eq!((received.u64(), received.is_at_end(), all.len()), (u64::MAX, true, 1));
    }

    #[test]
    fn parts_cover_everything_once_and_differ_by_at_most_one() {
        for (len, count) in [(10, 1), (10, 3), (3, 3), (2, 5), (0, 2)] {
            let parts: Vec<Range<usize>> = (0..count).map(|index| part(len, count, index)).collect();
            assert!(parts.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!((parts[0].start, parts[count - 1].end), (0, len));
            let sizes = parts.iter().map(Range::len);
            assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
        }
        assert_eq!(own_part(&Alone, 7), 0..7);
    }
}
