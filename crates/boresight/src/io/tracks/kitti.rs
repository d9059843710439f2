//! KITTI tracking labels: frame, id, type, truncated, occluded, alpha, x1, y1, x2, y2, size, location, rotation, score.
//!
//! Source: A. Geiger, P. Lenz, R. Urtasun, *Are we ready for autonomous driving? The KITTI vision benchmark suite*, CVPR
//! 2012, and the readme of its tracking kit. Separated by blanks; frames and pixels count from 0. Rows of type DontCare are
//! regions in which nothing counts; rows with a negative id are none.
//! Limits: the box in the image is used; the box in space is kept as text for conversion.

use super::lines::{BadRows, Fields, ReadOptions, each_line};
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackRow, TrackTable, TrackTableBuilder};
use std::io::Write;
use std::path::Path;

/// Names of the classes and their numbers in a table.
pub const CLASSES: [(&str, i32); 8] =
    [("Car", 1), ("Van", 2), ("Truck", 3), ("Pedestrian", 4), ("Person", 5), ("Cyclist", 6), ("Tram", 7), ("Misc", 8)];

const EXTRA: [&str; 8] =
    ["alpha_rad", "height_m", "width_m", "length_m", "location_x_m", "location_y_m", "location_z_m", "rotation_y_rad"];

/// What the labels say where these are not known.
const UNKNOWN: [&str; 8] = ["-10", "-1", "-1", "-1", "-1000", "-1000", "-1000", "-10"];

fn class_number(name: &[u8]) -> Option<i32> {
    let name = std::str::from_utf8(name).ok()?;
    // The kit writes the sitting person as Person_sitting or Person.
    let name = if name.eq_ignore_ascii_case("person_sitting") { "person" } else { name };
    CLASSES.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)).map(|c| c.1)
}

/// Reads labels or results.
/// # Errors
/// A missing file; a malformed row unless such rows are skipped.
pub fn read(path: &Path, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
    let mut table = TrackTableBuilder::new(path.display().to_string(), PixelOrigin::Pixel0);
    let mut bad = BadRows::default();
    if options.keep_extra {
        EXTRA.iter().for_each(|n| table.add_extra(*n));
    }
    each_line(path, |number, line| {
        let mut extra = Vec::new();
        let pushed = row(line, options.keep_extra, &mut extra).and_then(|r| match r {
            Row::Track(r) => {
                table.push(&r)?;
                extra.iter().enumerate().for_each(|(k, v)| table.push_extra(k, v));
                Ok(())
            }
            Row::Ignore(frame, bbox) => {
                table.push_ignore(frame, bbox);
                Ok(())
            }
            Row::Nothing => Ok(()),
        });
        pushed.or_else(|e| bad.note(options, e.at(format!("{} line {number}", path.display()))))
    })?;
    let mut table = table.finish(0)?;
    // Columns that say "unknown" throughout are no loss to another format; the writer puts them back.
    table.extra.retain(|(name, values)| {
        let unknown = EXTRA.iter().position(|n| n == name).map(|k| UNKNOWN[k]);
        values.iter().any(|v| !v.is_empty() && Some(v.as_str()) != unknown)
    });
    Ok((table, bad))
}

enum Row {
    Track(TrackRow),
    Ignore(u32, [f64; 4]),
    Nothing,
}

fn row(line: &[u8], keep: bool, extra: &mut Vec<String>) -> Result<Row> {
    let mut f = Fields::new(line, None);
    let frame = f.integer("a frame number")?;
    let frame = u32::try_from(frame).map_err(|_| {
        Error::new(ErrorKind::Damaged, format!("frame {frame}: expected a number from 0")).at("column 1")
    })?;
    let id = f.integer("a track id")?;
    let name = f.field().unwrap_or(b"");
    let truncation = f.number("a truncation")?;
    let occlusion = f.number("an occlusion")? as i32;
    let text = |v: f64| v.to_string();
    let alpha = f.number("an angle alpha")?;
    let mut c = [0.0; 4];
    for (v, what) in c.iter_mut().zip(["a left edge", "a top edge", "a right edge", "a bottom edge"]) {
        *v = f.number(what)?;
    }
    let bbox = [c[0], c[1], c[2] - c[0], c[3] - c[1]];
    if name.eq_ignore_ascii_case(b"dontcare") {
        return Ok(Row::Ignore(frame, bbox));
    }
    let Some(class) = class_number(name) else {
        let found = String::from_utf8_lossy(name).into_owned();
        return Err(Error::new(
            ErrorKind::Damaged,
            format!("expected a KITTI type (Car, Pedestrian ..), found \"{found}\""),
        )
        .at("column 3"));
    };
    if keep {
        extra.push(text(alpha));
    }
    for what in &EXTRA[1..] {
        let v = f.optional(what)?;
        if keep {
            extra.push(v.map_or(String::new(), text));
        }
    }
    let score = f.optional("a score")?.unwrap_or(1.0);
    if id < 0 {
        extra.clear();
        return Ok(Row::Nothing);
    }
    Ok(Row::Track(TrackRow { frame, id, bbox, score, class, visibility: 1.0, truncation, occlusion }))
}

/// Writes labels; the names of what the format cannot hold are returned.
/// # Errors
/// What the writer fails with.
pub fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").because(e);
    let mut table = std::borrow::Cow::Borrowed(table);
    if table.origin != PixelOrigin::Pixel0 {
        table.to_mut().set_origin(PixelOrigin::Pixel0);
    }
    let places: Vec<Option<usize>> = EXTRA.iter().map(|n| table.extra.iter().position(|e| e.0 == *n)).collect();
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
            let name = CLASSES.iter().find(|c| c.1 == class).map_or("Misc", |c| c.0);
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
    let extra = table.extra.iter().map(|e| e.0.clone()).filter(|n| !EXTRA.contains(&n.as_str()));
    Ok(extra.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_file_is_read_with_its_dont_care_regions() {
        let f = tempfile::NamedTempFile::new().unwrap();
        let text = "0 -1 DontCare -1 -1 -10 5 6 15 26 -1 -1 -1 -1 -1 -1 -1\n\
0 2 Van 1 2 0.5 10 20 30 60 1.5 1.6 3.7 1 2 3 0.1\n1 2 Van 0 0 0.5 11 20 30 60 1.5 1.6 3.7 1 2 3 0.1 0.9\n";
        std::fs::write(f.path(), text).unwrap();
        let (t, _) = read(f.path(), ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!(t.ignore, [(0, [5.0, 6.0, 10.0, 20.0])]);
        assert_eq!(
            (t.boxes[0], t.class.get(0), t.occlusion.get(0), t.score.get(1)),
            ([10.0, 20.0, 20.0, 40.0], 2, 2, 0.9)
        );
        let mut out = Vec::new();
        assert!(write(&t, &mut out).unwrap().is_empty());
        std::fs::write(f.path(), &out).unwrap();
        let (u, _) = read(f.path(), ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!(t, u);
    }

    #[test]
    fn an_unknown_type_is_named() {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), "0 1 Bus 0 0 0 1 2 3 4\n").unwrap();
        let e = read(f.path(), ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 1: column 3: expected a KITTI type (Car, Pedestrian ..), found \"Bus\""), "{e}");
    }
}
