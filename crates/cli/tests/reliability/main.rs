//! What `docs/reliability.md` promises of whole runs, tested on the real program: killed, out of room, under faults for
//! a long time.
//!
//! How much is done is in environment variables, so that the same tests serve a change (seconds) and a release (an hour);
//! `cargo xtask reliability` sets them.

#[path = "../common/mod.rs"]
mod common;
mod disk;
mod killed;
mod soak;

use std::hash::{BuildHasher, Hasher, RandomState};

/// A number from the environment, or what a change is tested with.
fn amount(variable: &str, short: u64) -> u64 {
    std::env::var(variable)
        .map_or(short, |text| text.parse().unwrap_or_else(|_| panic!("{variable}={text}: no number")))
}

/// A random number below `bound`, another one in every run of the test.
fn random_below(bound: u64) -> u64 {
    RandomState::new().build_hasher().finish() % bound
}
