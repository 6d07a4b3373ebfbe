//! Ctrl-C: the first asks the render to stop, the second ends the program at once.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Exit code of an interrupted render, as shells report SIGINT.
pub(super) const EXIT_CODE: u8 = 130;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C, or the signal to terminate, is a request to stop.
pub(super) fn listen() -> Result<()> {
    // A process can set its handler once.
    static LISTENING: OnceLock<Result<()>> = OnceLock::new();
    let handler = || {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(EXIT_CODE));
        }
    };
    LISTENING
        .get_or_init(|| {
            ctrlc::set_handler(handler).map_err(|error| {
                Error::io(Path::new("signal handler"), &std::io::Error::other(error))
            })
        })
        .clone()
}

/// Whether a stop was requested.
pub(super) fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
