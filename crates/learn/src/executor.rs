//! Where parallel work runs: the learner says what may run side by side, its caller owns the threads.

use std::sync::{Mutex, PoisonError};

/// Something that runs `count` independent pieces of work.
///
/// Nothing that this crate computes depends on which thread runs a piece or on how many threads there are.
pub trait Executor: Sync {
    /// Calls `work` once with each index below `count`, in any order and on any thread, and returns after the last.
    fn for_each(&self, count: usize, work: &(dyn Fn(usize) + Sync));
}

/// Runs everything on the calling thread.
#[derive(Clone, Copy, Debug, Default)]
pub struct Serial;

impl Executor for Serial {
    fn for_each(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(work);
    }
}

/// Calls `work` once with each item and its index; every item is changed by one call only.
pub fn for_each_mut<T: Send>(executor: &dyn Executor, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    let cells: Vec<Mutex<&mut T>> = items.iter_mut().map(Mutex::new).collect();
    executor.for_each(cells.len(), &|i| work(i, &mut cells[i].lock().unwrap_or_else(PoisonError::into_inner)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_visited_once_with_its_index() {
        let mut items = [10, 20, 30];
        for_each_mut(&Serial, &mut items, |i, item| *item += i);
        assert_eq!(items, [10, 21, 32]);
    }
}
