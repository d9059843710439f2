//! Several sources at once: each runs as one alone does, on a thread of its own, with its tracker, its board and its outputs; none waits for another.

use crate::board::Board;
use crate::output::LiveOutput;
use crate::run::{RunOptions, run};
use crate::source::Connect;
use boresight::{Error, ErrorKind, Result};
use std::sync::Arc;

/// One of the sources, with all that belongs to it alone.
pub struct OneRun {
    /// How it is connected.
    pub connect: Box<dyn Connect>,
    /// What decides over its run.
    pub options: RunOptions,
    /// Its board.
    pub board: Arc<Board>,
    /// Its outputs.
    pub outputs: Vec<Box<dyn LiveOutput>>,
}

/// Runs each of them until all have ended, or `stop` says so. One that fails ends alone, which is said at once.
/// # Errors
/// That of the first of them, in their order, that failed.
pub fn run_all(mut runs: Vec<OneRun>, stop: &(dyn Fn() -> bool + Sync)) -> Result<()> {
    if runs.len() == 1
        && let Some(mut only) = runs.pop()
    {
        return run(only.connect, &only.options, &only.board, &mut only.outputs, &|| stop());
    }
    let no_thread = |e| Error::new(ErrorKind::NotFound, "no thread can be started").because(e);
    let broken = || Error::new(ErrorKind::Numeric, "a run broke off, which is our own mistake");
    std::thread::scope(|scope| {
        let threads: Vec<_> = runs
            .into_iter()
            .map(|mut one| {
                let work = move || {
                    let outcome = run(one.connect, &one.options, &one.board, &mut one.outputs, &|| stop());
                    if let Err(e) = &outcome {
                        let (name, why) = (&one.board.source, e.to_string());
                        let why = why.lines().next().unwrap_or_default();
                        one.board.say(&format!("warning: {name}: {why}; the other sources go on"));
                    }
                    outcome
                };
                std::thread::Builder::new().name("live-run".into()).spawn_scoped(scope, work).map_err(no_thread)
            })
            .collect();
        let outcomes = threads.into_iter().map(|thread| thread?.join().unwrap_or_else(|_| Err(broken())));
        // All are waited for, then the first error counts.
        outcomes.collect::<Vec<_>>().into_iter().collect()
    })
}
