//! KITTI tracking labels: frame, id, type, truncated, occluded, alpha, x1, y1, x2, y2, size, location, rotation, score.
//!
//! Source: A. Geiger, P. Lenz, R. Urtasun, *Are we ready for autonomous driving? The KITTI vision benchmark suite*, CVPR
//! 2012, and the readme of its tracking kit. Separated by blanks; frames and pixels count from 0. Rows of type DontCare are
//! regions in which nothing counts; rows with a negative id are none.
//! Limits: the box in the image is used; the box in space is kept as text for conversion.

use crate::io::tables::columns::{Field, Layout};
use crate::io::tables::row::Row;
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackTable};
use std::io::Write;

/// Names of the classes and their numbers in a table.
pub(crate) const CLASSES: [(&str, i32); 8] =
    [("Car", 1), ("Van", 2), ("Truck", 3), ("Pedestrian", 4), ("Person", 5), ("Cyclist", 6), ("Tram", 7), ("Misc", 8)];

/// The columns beside class, box and score, by their names in a table, and where they stand.
pub(crate) const EXTRA: [(&str, usize); 8] = [
    ("alpha_rad", 5),
    ("height_m", 10),
    ("width_m", 11),
    ("length_m", 12),
    ("location_x_m", 13),
    ("location_y_m", 14),
    ("location_z_m", 15),
    ("rotation_y_rad", 16),
];

/// What the labels say where these are not known.
pub(crate) const UNKNOWN: [&str; 8] = ["-10", "-1", "-1", "-1", "-1000", "-1000", "-1000", "-10"];

/// Where the columns stand.
pub(crate) fn layout() -> Layout {
    Layout::fixed([
        (Field::Frame, 0),
        (Field::Id, 1),
        (Field::Class, 2),
        (Field::Truncation, 3),
        (Field::Occlusion, 4),
        (Field::Left, 6),
        (Field::Top, 7),
        (Field::Right, 8),
        (Field::Bottom, 9),
        (Field::Score, 17),
    ])
}

/// What a row is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    /// A target of this class.
    Class(i32),
    /// A region in which nothing counts.
    DontCare,
}

/// Reads a row's type.
/// # Errors
/// A type that the kit does not know.
pub(crate) fn of(row: &Row<'_>) -> Result<Of> {
    let name = row.word(Field::Class).unwrap_or_default();
    // The kit writes the sitting person as Person_sitting or Person.
    let known = if name.eq_ignore_ascii_case("person_sitting") { "person" } else { &name };
    if known.eq_ignore_ascii_case("dontcare") {
        return Ok(Of::DontCare);
    }
    let class = CLASSES.iter().find(|(n, _)| n.eq_ignore_ascii_case(known));
    class.map(|c| Of::Class(c.1)).ok_or_else(|| unknown(row, &name))
}

fn unknown(row: &Row<'_>, name: &str) -> Error {
    row.wrong(Field::Class, name, "a KITTI type (Car, Pedestrian ..)")
}

/// Writes labels; the names of what the format cannot hold are returned.
/// # Errors
/// What the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").because(e);
    let mut table = std::borrow::Cow::Borrowed(table);
    if table.origin != PixelOrigin::Pixel0 {
        table.to_mut().set_origin(PixelOrigin::Pixel0);
    }
    let places: Vec<Option<usize>> = EXTRA.iter().map(|(n, _)| table.extra.iter().position(|e| e.0 == *n)).collect();
    let mut ignore = table.ignore.clone();
    ignore.sort_by_key(|i| i.0);
    let mut ignored = ignore.iter().peekable();
    for frame in 0..table.n_frames() {
        while let Some((f, b)) = ignored.next_if(|i| i.0 as usize <= frame) {
            writeln!(
                out,
                "{f} -1 DontCare -1 -1 -10 {} {} {} {} -1000 -1000 -1000 -10 -1 -1 -1",
                b[0],
                b[1],
                b[0] + b[2],
                b[1] + b[3]
            )
            .map_err(failed)?;
        }
        for r in table.rows(frame) {
            let b = table.boxes[r];
            let class = table.class.get(r);
            let name = match table.class_name(r) {
                Some(name) => CLASSES.iter().find(|c| c.0.eq_ignore_ascii_case(name)),
                None => CLASSES.iter().find(|c| c.1 == class),
            };
            let name = name.map_or("Misc", |c| c.0);
            let extra = |k: usize| {
                places[k]
                    .and_then(|p| table.extra[p].1.get(r))
                    .filter(|v| !v.is_empty())
                    .map_or(UNKNOWN[k], String::as_str)
            };
            write!(
                out,
                "{frame} {} {name} {} {} {} {} {} {} {}",
                table.ids[table.tracks[r] as usize],
                table.truncation.get(r),
                table.occlusion.get(r),
                extra(0),
                b[0],
                b[1],
                b[0] + b[2],
                b[1] + b[3]
            )
            .map_err(failed)?;
            for k in 1..EXTRA.len() {
                write!(out, " {}", extra(k)).map_err(failed)?;
            }
            writeln!(out, " {}", table.score.get(r)).map_err(failed)?;
        }
    }
    let extra = table.extra.iter().map(|e| e.0.clone()).filter(|n| !EXTRA.iter().any(|e| e.0 == n));
    Ok(extra.collect())
}
