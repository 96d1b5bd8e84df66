//! The ranks that mpirun has started, over MPI.
//!
//! Which MPI sums up in which order is up to MPI; bytes that are gathered and added here are in ours.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use ::mpi::Threading;
use ::mpi::datatype::PartitionMut;
use ::mpi::environment::{Universe, initialize_with_threading};
use ::mpi::topology::SimpleCommunicator;
use ::mpi::traits::{Communicator as _, CommunicatorCollectives as _};
use canter_learn::communicator::Communicator;

/// Most bytes that one call gathers: MPI counts them with 31 bits.
const MAX_BYTES: usize = 1 << 30;

/// Exit code of a Rust program that panics.
const PANICKED: i32 = 101;

/// Why there is no world.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// MPI was entered before.
    #[error("MPI can be entered only once")]
    Entered,
    /// Calls from one thread at a time are too many for this MPI.
    #[error("this MPI takes calls from the main thread only; canter needs one built with MPI_THREAD_SERIALIZED")]
    Threads,
}

/// All ranks that mpirun has started.
#[derive(Debug)]
pub struct World {
    num_ranks: usize,
    rank: usize,
    /// None once it was left. Held during every call: MPI is called from different threads, but by one at a time.
    universe: Mutex<Option<Entered>>,
    received_bytes: AtomicU64,
    exchange_ns: AtomicU64,
}

/// What has to be dropped to leave MPI.
struct Entered {
    _universe: Universe,
}

impl std::fmt::Debug for Entered {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Entered")
    }
}

impl World {
    /// Enters MPI.
    ///
    /// # Errors
    /// It was entered before, or cannot be called from several threads.
    pub fn enter() -> Result<Self, WorldError> {
        let (universe, threading) = initialize_with_threading(Threading::Serialized).ok_or(WorldError::Entered)?;
        if threading < Threading::Serialized {
            return Err(WorldError::Threads);
        }
        let world = SimpleCommunicator::world();
        Ok(Self {
            num_ranks: world.size() as usize,
            rank: world.rank() as usize,
            universe: Mutex::new(Some(Entered { _universe: universe })),
            received_bytes: AtomicU64::new(0),
            exchange_ns: AtomicU64::new(0),
        })
    }

    fn universe(&self) -> MutexGuard<'_, Option<Entered>> {
        self.universe.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until all ranks leave. Afterwards this is an ordinary process.
    pub fn leave(&self) {
        *self.universe() = None;
    }

    /// Ends all ranks at once, unless this one has left them. For a rank for which the others would wait in vain.
    pub fn abort(&self, exit_code: i32) {
        // A thread that panics may hold the lock. Nobody leaves while another thread still works.
        if self.universe.try_lock().is_ok_and(|universe| universe.is_none()) {
            return;
        }
        SimpleCommunicator::world().abort(exit_code);
    }

    /// From now on a panic on any thread of this rank ends all ranks, which would wait for it in vain. `tell` is called after
    /// the panic's own message.
    pub fn abort_on_panic(self: &Arc<Self>, tell: impl Fn() + Send + Sync + 'static) {
        let (world, own_message) = (self.clone(), std::panic::take_hook());
        std::panic::set_hook(Box::new(move |panic| {
            own_message(panic);
            tell();
            world.abort(PANICKED);
        }));
    }

    /// Bytes that came from other ranks.
    pub fn received_bytes(&self) -> u64 {
        self.received_bytes.load(Ordering::Relaxed)
    }

    /// Time of giving and getting, waiting for the slowest rank included [s].
    pub fn exchange_s(&self) -> f64 {
        self.exchange_ns.load(Ordering::Relaxed) as f64 * 1e-9
    }
}

impl Communicator for World {
    fn num_ranks(&self) -> usize {
        self.num_ranks
    }

    fn rank(&self) -> usize {
        self.rank
    }

    fn all_gather(&self, own: &[u8], lengths: &[usize], all: &mut [u8]) {
        let begin = Instant::now();
        let universe = self.universe();
        assert!(universe.is_some(), "this rank has left the others");
        in_rounds(MAX_BYTES, (own, lengths), all, gather);
        self.received_bytes.fetch_add((all.len() - own.len()) as u64, Ordering::Relaxed);
        self.exchange_ns.fetch_add(begin.elapsed().as_nanos() as u64, Ordering::Relaxed);
    }
}

/// Gathers what fits into one call of MPI.
fn gather(own: &[u8], lengths: &[usize], all: &mut [u8]) {
    if all.is_empty() {
        return;
    }
    // An empty slice may point to address 1, which Open MPI takes for MPI_IN_PLACE.
    static NOTHING: [u8; 1] = [0];
    let own = if own.is_empty() { &NOTHING[..0] } else { own };
    let counts: Vec<i32> = lengths.iter().map(|&length| length as i32).collect();
    let starts = counts.iter().scan(0, |next, &count| {
        let start = *next;
        *next += count;
        Some(start)
    });
    let starts: Vec<i32> = starts.collect();
    SimpleCommunicator::world().all_gather_varcount_into(own, &mut PartitionMut::new(all, counts, starts));
}

/// Calls `gather` as often as it takes with at most `max_bytes`, all ranks taken together.
fn in_rounds(
    max_bytes: usize,
    (own, lengths): (&[u8], &[usize]),
    all: &mut [u8],
    gather: impl Fn(&[u8], &[usize], &mut [u8]),
) {
    if all.len() <= max_bytes {
        return gather(own, lengths, all);
    }
    let piece_bytes = max_bytes / lengths.len();
    let longest = lengths.iter().copied().max().unwrap_or(0);
    let mut pieces = Vec::new();
    for done in (0..longest).step_by(piece_bytes) {
        let piece_of = |length: usize| length.saturating_sub(done).min(piece_bytes);
        let piece_lengths: Vec<usize> = lengths.iter().map(|&length| piece_of(length)).collect();
        pieces.resize(piece_lengths.iter().sum(), 0);
        gather(&own[done.min(own.len())..][..piece_of(own.len())], &piece_lengths, &mut pieces);
        let (mut start, mut rest) = (0, &pieces[..]);
        for (length, piece_length) in lengths.iter().zip(piece_lengths) {
            let (piece, others) = rest.split_at(piece_length);
            if piece_length > 0 {
                all[start + done..][..piece_length].copy_from_slice(piece);
            }
            rest = others;
            start += length;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn more_than_one_call_takes_is_gathered_in_rounds() {
        let (own, other, third) = (b"abcdefg", b"ABCDEFGHIJK", b"");
        let lengths = [own.len(), other.len(), third.len()];
        for max_bytes in [3, 4, 6, 12, 17, 18, 100] {
            let done = Cell::new(0);
            let gather = |piece: &[u8], lengths: &[usize], all: &mut [u8]| {
                assert!(all.len() <= max_bytes, "{} in a call for {max_bytes}", all.len());
                let of_other = &other[done.get()..][..lengths[1]];
                done.set(done.get() + lengths[1]);
                all.copy_from_slice(&[piece, of_other].concat());
            };
            let mut all = [0; 18];
            in_rounds(max_bytes, (own, &lengths), &mut all, gather);
            assert_eq!(&all, b"abcdefgABCDEFGHIJK", "{max_bytes}");
        }
    }
}
