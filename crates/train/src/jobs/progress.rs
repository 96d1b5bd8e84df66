//! How far jobs have come.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// How far jobs have come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobsProgress {
    /// Jobs that are done.
    pub jobs: usize,
    /// Jobs in all.
    pub num_jobs: usize,
    /// Env steps that are done; an episode that fell counts as a whole one.
    pub env_steps: u64,
    /// Env steps in all.
    pub num_env_steps: u64,
    /// Those that were done before this start.
    pub skipped_env_steps: u64,
}

/// Counts what all threads have done.
pub(crate) struct Meter<'a> {
    jobs: AtomicUsize,
    env_steps: AtomicU64,
    skipped: AtomicU64,
    num_jobs: usize,
    num_env_steps: u64,
    observe: &'a (dyn Fn(JobsProgress) + Sync),
}

impl<'a> Meter<'a> {
    pub fn new(num_jobs: usize, num_env_steps: u64, observe: &'a (dyn Fn(JobsProgress) + Sync)) -> Self {
        let (jobs, env_steps, skipped) = (AtomicUsize::new(0), AtomicU64::new(0), AtomicU64::new(0));
        Self { jobs, env_steps, skipped, num_jobs, num_env_steps, observe }
    }

    /// Counts env steps that were just done.
    pub fn add(&self, env_steps: u64) {
        self.env_steps.fetch_add(env_steps, Ordering::Relaxed);
        self.show();
    }

    /// Counts env steps that were done before this start.
    pub fn skip(&self, env_steps: u64) {
        self.skipped.fetch_add(env_steps, Ordering::Relaxed);
        self.env_steps.fetch_add(env_steps, Ordering::Relaxed);
    }

    /// Counts a job.
    pub fn finish_job(&self) {
        self.jobs.fetch_add(1, Ordering::Relaxed);
        self.show();
    }

    fn show(&self) {
        (self.observe)(JobsProgress {
            jobs: self.jobs.load(Ordering::Relaxed),
            num_jobs: self.num_jobs,
            env_steps: self.env_steps.load(Ordering::Relaxed).min(self.num_env_steps),
            num_env_steps: self.num_env_steps,
            skipped_env_steps: self.skipped.load(Ordering::Relaxed),
        });
    }
}
