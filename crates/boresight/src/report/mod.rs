//! The self-contained HTML report: one file that opens offline, with figures that answer the pointer.
//!
//! A sink collects what the figures need while the run goes on, in bounded memory whatever its length (`collect`), and
//! writes the page at the end (`page`). The figures follow the thesis: trajectories (4.6, 4.9), states (4.7, 4.10,
//! 4.11), their errors' bounds (4.13) and innovations with bounds (4.14); without truth the bounds are the filter's own.
//! Settings, warnings and times per stage come from the run through [`ReportNotes`], at any moment before the end.

mod collect;
mod consistency;
mod page;
mod picture;
mod text;

use crate::io::AtomicFile;
use crate::{Error, ErrorKind, Result, Sink, View};
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What the report says besides what it sees: handed in before the end of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Notes {
    /// Title; empty: the input's name.
    pub title: String,
    /// Name of the input.
    pub input: String,
    /// Further lines of the summary: name and value.
    pub facts: Vec<(String, String)>,
    /// The settings chosen, each with its reason, one line each.
    pub settings: Vec<String>,
    /// Warnings, each a whole sentence.
    pub warnings: Vec<String>,
    /// Time spent in each stage, s.
    pub stages: Vec<(String, f64)>,
}

/// A handle on the notes of a report that is being made; clones share them.
#[derive(Clone, Debug, Default)]
pub struct ReportNotes(Arc<Mutex<Notes>>);

impl ReportNotes {
    /// Changes the notes.
    pub fn edit(&self, change: impl FnOnce(&mut Notes)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    fn get(&self) -> Notes {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Writes `report.html`.
pub struct HtmlReport {
    file: AtomicFile,
    notes: ReportNotes,
    seen: collect::Collected,
}

impl HtmlReport {
    /// Begins a report; the file appears when the run ends.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>, notes: Notes) -> Result<Self> {
        let notes = ReportNotes(Arc::new(Mutex::new(notes)));
        Ok(Self { file: AtomicFile::create(path)?, notes, seen: collect::Collected::default() })
    }

    /// The handle through which the run hands in what is known late: warnings, times per stage.
    pub fn notes(&self) -> ReportNotes {
        self.notes.clone()
    }
}

impl Sink for HtmlReport {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.seen.put(view);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self { mut file, notes, seen } = *self;
        let html = page::page(&notes.get(), seen);
        file.write_all(html.as_bytes()).map_err(|e| {
            Error::new(ErrorKind::Output, "cannot be written").at(file.part_path().display()).because(e)
        })?;
        file.finish()
    }
}
