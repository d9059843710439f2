//! The array of napari's layer of tracks: N x 4 doubles, `[track, frame, y, x]` (px), by track and frame, as NumPy's `.npy`.
//!
//! Source: napari, *Using the tracks layer* (`viewer.add_tracks`); NumPy, *NEP 1: a simple file format*, version 1.0.

use super::paths::{Paths, centre, dropped};
use crate::{Error, ErrorKind, Result, TrackTable};
use std::io::Write;

/// Writes the array; the names of what it cannot hold are returned.
/// # Errors
/// A track that stands twice in a frame; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let paths = Paths::new(table)?;
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 4), }}", table.n_rows());
    // With magic, version, length and the end of line a multiple of 64 bytes.
    while !(header.len() + 11).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for (t, rows) in paths.rows.iter().enumerate() {
        for &r in rows {
            let [x, y, ..] = centre(table, r);
            let row = [table.ids[t] as f64, f64::from(paths.frames[r]), y, x];
            bytes.extend(row.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    out.write_all(&bytes).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let mut lost = dropped(table, &[]);
    if !table.is_points {
        lost.insert(0, "width, height".to_string());
    }
    Ok(lost)
}
