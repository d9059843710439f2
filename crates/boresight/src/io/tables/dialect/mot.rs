//! MOTChallenge: frame, id, left, top, width, height, confidence, class, visibility (or x, y, z), counted from 1.
//!
//! Source: L. Leal-Taixé et al., *MOTChallenge 2015*, arXiv 1504.01942; A. Milan et al., *MOT16*, arXiv 1603.00831; the files.
//! In a truth, column 7 says whether the row counts; of nine columns, the last two are class and visible share (MOT16 and
//! later); of ten, the last three are a place in the world, or -1 (MOT15, results). In a result, column 7 is the confidence.
//! A box that starts at the top-left pixel has left = top = 1; in boresight that pixel's left edge is -0.5. So left and top
//! shift by 1.5 px, sizes do not change.

use crate::io::tables::columns::{Field, Layout};
use crate::io::tables::row::Row;
use crate::{Error, ErrorKind, Extent, PixelOrigin, Result, TrackTable};
use std::io::Write;

/// Fewest columns of a row: up to the height.
pub(crate) const LEAST_COLUMNS: usize = 6;

/// Names of the columns that hold a place in the world.
pub(crate) const WORLD: [&str; 3] = ["world_x_m", "world_y_m", "world_z_m"];

/// From a pixel's edge counted from the centre of pixel 0 to the box coordinate counted from pixel 1.
const SHIFT_PX: f64 = 1.5;

/// Returns left, top, width, height as MOTChallenge counts them, px.
pub fn mot_box_of_extent(extent: &Extent) -> [f64; 4] {
    [extent.left_px + SHIFT_PX, extent.top_px + SHIFT_PX, extent.width_px, extent.height_px]
}

/// The columns that every row has, and the confidence.
pub(crate) fn layout() -> Layout {
    use Field::{Frame, Height, Id, Left, Score, Top, Width};
    Layout::fixed([Frame, Id, Left, Top, Width, Height, Score].into_iter().zip(0..))
}

/// What stands behind the confidence.
pub(crate) struct Behind {
    /// Class number, from 1.
    pub class: Option<i32>,
    /// Visible share, 0..=1.
    pub visibility: Option<f64>,
    /// Place in the world, m; -1 where unknown.
    pub world: [f64; 3],
}

/// Reads columns 8 to 10.
/// # Errors
/// Something else than numbers.
pub(crate) fn behind(row: &Row<'_>) -> Result<Behind> {
    let eighth = row.number_at(7, "a class or a place x")?;
    let ninth = row.number_at(8, "a visible share or a place y")?;
    // A tenth column tells that these are places in the world, or -1, and no class.
    let tenth = row.number_at(9, "a place z")?;
    let world = tenth.map_or([-1.0; 3], |z| [eighth.unwrap_or(-1.0), ninth.unwrap_or(-1.0), z]);
    let class = eighth.filter(|c| tenth.is_none() && (1.0..=1e6).contains(c) && c.fract() == 0.0);
    let visibility = ninth.filter(|v| (0.0..=1.0).contains(v) && class.is_some());
    Ok(Behind { class: class.map(|c| c as i32), visibility, world })
}

/// Writes a table as a truth (`truth`: class and visibility in columns 8 and 9) or as a result (places in the world, or -1).
/// # Errors
/// What the writer fails with.
pub(crate) fn write(table: &TrackTable, truth: bool, out: &mut impl Write) -> Result<()> {
    let mut table = std::borrow::Cow::Borrowed(table);
    if table.origin != PixelOrigin::Pixel1 {
        table.to_mut().set_origin(PixelOrigin::Pixel1);
    }
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").because(e);
    let world = WORLD.map(|n| table.extra.iter().find(|e| e.0 == n).map(|e| &e.1));
    for frame in 0..table.n_frames() {
        for r in table.rows(frame) {
            let [l, t, w, h] = table.boxes[r];
            let id = table.ids[table.tracks[r] as usize];
            write!(out, "{},{id},{l},{t},{w},{h},{}", frame + 1, table.score.get(r)).map_err(failed)?;
            if truth {
                writeln!(out, ",{},{}", table.class.get(r), table.visibility.get(r)).map_err(failed)?;
            } else {
                let [x, y, z] = world.map(|w| w.and_then(|w| w.get(r)).filter(|v| !v.is_empty()).map_or("-1", |v| v));
                writeln!(out, ",{x},{y},{z}").map_err(failed)?;
            }
        }
    }
    Ok(())
}
