//! Writes a [`TrackTable`] in any format of text, and says what the format cannot hold.

use super::format::Format;
use crate::io::tables::dialect::{kitti, mot, named_write};
use crate::io::tables::lost::{REGIONS, lost};
use crate::{Error, ErrorKind, Result, TrackTable};
use std::io::Write;

/// Writes a table; the names of what the format cannot hold are returned.
/// # Errors
/// The Cell Tracking Challenge's format, which is a folder (`ctc_write::write_folder`); what the writer fails with.
pub fn write(table: &TrackTable, format: Format, out: &mut impl Write) -> Result<Vec<String>> {
    match format {
        Format::Mot | Format::MotTruth => {
            let truth = format == Format::MotTruth;
            let held: &[&str] = if truth { &["score", "class", "visibility"] } else { &["score"] };
            let mut dropped = lost(table, held);
            let names = table.extra.iter().map(|e| e.0.clone());
            dropped.extend(names.filter(|n| truth || !mot::WORLD.contains(&n.as_str())));
            if table.is_points {
                dropped.push("that rows are points (they become boxes without size)".into());
            }
            mot::write(table, truth, out)?;
            Ok(dropped)
        }
        Format::Kitti => {
            let mut dropped = lost(table, &["score", "class", "truncation", "occlusion", REGIONS]);
            if table.is_points {
                dropped.push("that rows are points (they become boxes without size)".into());
            }
            dropped.extend(kitti::write(table, out)?);
            Ok(dropped)
        }
        Format::Named(dialect) => named_write::write(table, dialect, out),
        Format::Ctc => {
            Err(Error::new(ErrorKind::Unsupported, "the Cell Tracking Challenge's format is a folder of label images")
                .at(&table.label)
                .hint("give a folder as the output"))
        }
    }
}
