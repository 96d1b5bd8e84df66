//! Which canter this is.

/// The commit that the program was built from, with its date: `b0ff85c 2026-11-25`; empty where nobody knew it. The build
/// script says it.
const STAMP: &str = env!("CANTER_STAMP");

/// What `canter --version` says behind the name.
pub const VERSION: &str = if STAMP.is_empty() {
    env!("CARGO_PKG_VERSION")
} else {
    concat!(env!("CARGO_PKG_VERSION"), " (", env!("CANTER_STAMP"), ")")
};

/// The commit without its date, if it is known: `b0ff85c`, or `b0ff85c+changes`.
pub fn commit() -> Option<&'static str> {
    STAMP.split(' ').next().filter(|commit| !commit.is_empty())
}
