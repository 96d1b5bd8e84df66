//! The threads: everything that runs side by side runs here.

use std::sync::atomic::{AtomicUsize, Ordering};

use canter_learn::executor::Executor;
use rayon::ThreadPool;
use rayon::prelude::*;

/// A pool of worker threads.
#[derive(Debug)]
pub struct Workers {
    pool: ThreadPool,
}

impl Workers {
    /// `num_threads` workers; as many as the machine has cores for `None`.
    ///
    /// # Errors
    /// The system's, if it cannot start the threads.
    pub fn new(num_threads: Option<usize>) -> std::io::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(num_threads.unwrap_or(0))
            .thread_name(|index| format!("worker-{index}"))
            .build()
            .map_err(std::io::Error::other)?;
        Ok(Self { pool })
    }

    /// Number of threads.
    pub fn num_threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs `work` with the pool as rayon's pool.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }
}

/// Does jobs `0..count`, in their order as threads come free, on `num_threads` threads; each job has a worker of its own.
///
/// # Errors
/// The system's, if it cannot start the threads; no job has then begun.
pub fn side_by_side(num_threads: usize, count: usize, work: &(dyn Fn(usize, &Workers) + Sync)) -> std::io::Result<()> {
    let workers =
        (0..num_threads.min(count)).map(|_| Workers::new(Some(1))).collect::<std::io::Result<Vec<Workers>>>()?;
    let next = AtomicUsize::new(0);
    let next = &next;
    std::thread::scope(|scope| {
        for worker in &workers {
            scope.spawn(move || {
                while let Some(job) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|job| *job < count) {
                    work(job, worker);
                }
            });
        }
    });
    Ok(())
}

impl Executor for Workers {
    fn for_each(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        self.pool.install(|| (0..count).into_par_iter().with_max_len(1).for_each(work));
    }
}
