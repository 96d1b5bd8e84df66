//! Ctrl-C and SIGTERM: the first asks the training to stop, the second ends the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{CliError, STOPPED};
use crate::output::complain;

/// A flag that the first signal sets.
///
/// # Errors
/// The system's, if signals cannot be listened to.
pub fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(STOPPED));
        }
        complain("\nstopping after this iteration; once more stops at once, back to the last checkpoint");
    })?;
    Ok(stop)
}
