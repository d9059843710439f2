//! Writes a [`TrackTable`] in any format, and says what the format cannot hold.

use super::export;
use super::format::Format;
use crate::io::atomic::write_whole;
use crate::io::tables::dialect::{kitti, mot, named_write};
use crate::io::tables::lost::{REGIONS, lost};
use crate::{Error, ErrorKind, Result, TrackTable};
use std::io::Write;
use std::path::Path;

/// Writes a table; the names of what the format cannot hold are returned.
/// # Errors
/// A format that is a folder ([`write_path`]; of the Cell Tracking Challenge `ctc_write::write_folder`); a feature that is not compiled in; what the writer fails with.
pub fn write(table: &TrackTable, format: Format, out: &mut (impl Write + Send)) -> Result<Vec<String>> {
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
        Format::TrackMateXml => export::trackmate_xml::write(table, out),
        Format::Cvat => export::cvat::write(table, out),
        Format::MotZip => export::mot_zip::write(table, out),
        Format::Napari => export::napari::write(table, out),
        Format::Mcap => export::foxglove::write(table, out),
        Format::Vmti => export::vmti::write(table, out),
        #[cfg(feature = "parquet")]
        Format::Parquet => export::parquet::write(table, out),
        #[cfg(not(feature = "parquet"))]
        Format::Parquet => Err(Error::new(ErrorKind::Unsupported, "this build writes no Parquet")
            .at(&table.label)
            .hint("build with the feature: cargo install --path crates/boresight-cli --features parquet")),
        Format::Geff => Err(Error::new(ErrorKind::Unsupported, "GEFF is a folder")
            .at(&table.label)
            .hint("give a folder as the output")),
        Format::Ctc => {
            Err(Error::new(ErrorKind::Unsupported, "the Cell Tracking Challenge's format is a folder of label images")
                .at(&table.label)
                .hint("give a folder as the output"))
        }
    }
}

/// Writes a table to a file or, if the format is one, a folder, which appears whole; the names of what the format cannot hold are returned.
/// Without a path nothing is written, only said.
/// # Errors
/// As [`write()`]; something else under the name.
pub fn write_path(table: &TrackTable, format: Format, path: Option<&Path>) -> Result<Vec<String>> {
    if format == Format::Geff {
        return export::geff::write_folder(table, path);
    }
    let mut bytes = Vec::new();
    let dropped = write(table, format, &mut bytes)?;
    path.map_or(Ok(()), |path| write_whole(path, &bytes))?;
    Ok(dropped)
}
