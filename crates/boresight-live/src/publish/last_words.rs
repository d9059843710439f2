//! The end of a wire: how long it waits for what the thread still has to say.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Waits until the thread has ended, this long at most; one that has not is left to itself.
pub(super) fn wait_for(thread: &mut Option<JoinHandle<()>>, at_most: Duration) {
    let until = Instant::now() + at_most;
    while thread.as_ref().is_some_and(|t| !t.is_finished()) && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(5));
    }
    *thread = None;
}
