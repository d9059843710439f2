//! The self-contained HTML report: one file that opens offline, with figures that answer the pointer.
//!
//! While the run goes on a sink collects what the figures need, in bounded memory whatever its length (`collect`); after it, when warnings and
//! times of all stages are known, the page is written from that and the caller's [`Notes`] (`page`). The figures follow the thesis: trajectories
//! (4.6, 4.9), states (4.7, 4.10, 4.11), their errors' bounds (4.13) and innovations with bounds (4.14); without truth the
//! bounds are the filter's own.

mod collect;
mod consistency;
mod contact_sheet;
mod curves;
mod ground;
mod key_frames;
mod map;
mod notes;
mod page;
mod picture;
mod sink;
mod text;
mod trajectories;

pub use contact_sheet::{ContactSheet, SheetMark, SheetPicture, SheetRow};
pub use notes::Notes;
pub use sink::{HtmlReport, ReportSink};
