//! Tables with named columns: boresight's own, trackpy, TrackMate, btrack, ultrack, and whatever names its columns.
//!
//! Frames count from 0, the centre of the top-left pixel is (0, 0). `left_px` is a box's edge; any other left is the number of
//! its first pixel. TrackMate writes up to three more lines of names and units below its header, and leaves TRACK_ID empty for
//! spots outside of tracks.

use crate::io::tables::columns::{Field, Layout};
use crate::length_unit::LengthUnit;

/// The programs whose tables of points are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// boresight's names: frame, track_id, x_px, y_px, width_px, height_px, score.
    Plain,
    /// trackpy: frame, particle, x, y.
    Trackpy,
    /// TrackMate's spot table: TRACK_ID, QUALITY, POSITION_X, POSITION_Y, FRAME.
    TrackMate,
    /// btrack: ID, t, y, x.
    Btrack,
    /// ultrack: track_id, t, y, x.
    Ultrack,
}

/// Lines of names and units that TrackMate writes below its header.
pub(crate) const TRACKMATE_LINES: u8 = 3;

/// Whether a header is TrackMate's.
pub(crate) fn is_trackmate(header: &[String]) -> bool {
    header.iter().any(|name| name.eq_ignore_ascii_case("POSITION_X"))
}

/// The unit in a cell of TrackMate's line of units, if it is not the pixel.
pub(crate) fn trackmate_unit(cell: &str) -> Option<String> {
    let unit = cell.strip_prefix('(')?.strip_suffix(')')?;
    (!["pixel", "pixels", "px"].contains(&unit)).then(|| unit.to_string())
}

/// The unit that the column of positions names: `x_px`, `x_m`, `X (m)`; `None` where it names none of these.
pub(crate) fn unit(header: &[String], layout: &Layout) -> Option<LengthUnit> {
    let name = [Field::X, Field::Left].into_iter().find_map(|f| header.get(layout.column(f)?))?;
    let word = name.rsplit(|c: char| !c.is_ascii_alphanumeric()).find(|w| !w.is_empty())?;
    match word {
        "px" => Some(LengthUnit::Pixel),
        "m" => Some(LengthUnit::Metre),
        _ => None,
    }
}

/// From a left or top of a table to the box's edge, px.
pub(crate) fn edge_shift_px(header: &[String], layout: &Layout) -> f64 {
    let edges = layout
        .column(Field::Left)
        .and_then(|at| header.get(at))
        .is_some_and(|h| h.eq_ignore_ascii_case("left_px") || h == "left_m");
    if edges { 0.0 } else { -0.5 }
}
