//! How a run is ended from outside.

use anyhow::Context;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What Ctrl-C and a polite kill do: before a run nothing is written yet, so they end the command at once; a run ends behind its
/// frame and keeps its results; a second signal ends it at once.
pub struct Stop {
    raised: Arc<AtomicBool>,
    running: Arc<AtomicBool>,
}

impl Stop {
    /// Takes the signals.
    /// # Errors
    /// A system that lets no signal be taken.
    pub fn on_signal() -> anyhow::Result<Self> {
        let stop = Self { raised: Arc::default(), running: Arc::default() };
        let (raised, running) = (Arc::clone(&stop.raised), Arc::clone(&stop.running));
        ctrlc::set_handler(move || {
            if raised.swap(true, Ordering::SeqCst) || !running.load(Ordering::SeqCst) {
                std::process::exit(130);
            }
        })
        .context("no handler for Ctrl-C could be set")?;
        Ok(stop)
    }

    /// The run begins: from now on there are results to keep.
    pub fn run_begins(&self) {
        self.running.store(true, Ordering::SeqCst);
    }

    /// Whether the run goes on.
    pub fn go_on(&self) -> ControlFlow<()> {
        if self.raised.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Ends the program at once when standard input ends: whoever started it and held the other end is gone, in whatever way.
pub fn end_with_stdin() {
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        std::process::exit(130);
    });
}
