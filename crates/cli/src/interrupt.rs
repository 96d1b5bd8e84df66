//! Ctrl-C and SIGTERM: the first asks the work to stop, the second ends the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{CliError, STOPPED};
use crate::output::complain;

/// What a training says at the first signal.
pub const STOPPING_TRAINING: &str =
    "\nstopping after this iteration; once more stops at once, back to the last checkpoint";

/// What a signal does now.
#[derive(Debug, Default)]
pub struct Interrupt {
    /// Set by the first signal.
    pub stop: AtomicBool,
    /// Set once everything is saved: from then on a signal ends the program at once.
    is_saved: AtomicBool,
}

impl Interrupt {
    /// Listens from now on; the first signal says `notice`, if that is not empty.
    ///
    /// # Errors
    /// The system's, if signals cannot be listened to.
    pub fn listen(notice: &'static str) -> Result<Arc<Self>, CliError> {
        let interrupt = Arc::new(Self::default());
        let shared = interrupt.clone();
        ctrlc::set_handler(move || {
            if shared.is_saved.load(Ordering::Relaxed) || shared.stop.swap(true, Ordering::Relaxed) {
                std::process::exit(i32::from(STOPPED));
            }
            if !notice.is_empty() {
                complain(notice);
            }
        })?;
        Ok(interrupt)
    }

    /// From now on there is nothing to lose.
    pub fn everything_is_saved(&self) {
        self.is_saved.store(true, Ordering::Relaxed);
    }
}
