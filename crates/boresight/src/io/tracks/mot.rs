//! MOTChallenge tables: frame, id, left, top, width, height, confidence, class, visibility (or x, y, z), counted from 1.
//!
//! Source: A. Milan et al., *MOT16: a benchmark for multi-object tracking*, arXiv 1603.00831, and the files themselves.
//! In a truth, column 7 says whether the row counts; of nine columns, the last two are class and visible share (MOT16 and
//! later); of ten, the last three are a place in the world, or -1 (MOT15, results). In a result, column 7 is the confidence.
//! Limits: frames and pixels count from 1 in the file; [`PixelOrigin::Pixel1`] and frames from 0 in the table.

use super::lines::{BadRows, Fields, ReadOptions, each_line, separator};
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackRow, TrackTable, TrackTableBuilder};
use std::io::Write;
use std::path::Path;

/// Names of the columns that hold a place in the world.
pub const WORLD: [&str; 3] = ["world_x_m", "world_y_m", "world_z_m"];

/// Reads a table; rows may stand in any order.
/// # Errors
/// A missing file; a malformed row (file, line, column, what was expected) unless such rows are skipped.
pub fn read(path: &Path, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
    let mut table = TrackTableBuilder::new(path.display().to_string(), PixelOrigin::Pixel1);
    let mut bad = BadRows::default();
    let mut comma = None;
    if let Ok(meta) = std::fs::metadata(path) {
        // About 40 bytes a row; a wrong guess only costs a move.
        table.reserve((meta.len() / 48).min(1 << 24) as usize);
    }
    if options.keep_extra {
        WORLD.iter().for_each(|n| table.add_extra(*n));
    }
    each_line(path, |number, line| {
        if number == 1 || comma.is_none() {
            comma = separator(line);
        }
        let pushed = row(Fields::new(line, comma), options.frames_from_zero).and_then(|(r, world)| {
            table.push(&r)?;
            if options.keep_extra {
                world.iter().enumerate().for_each(|(k, v)| table.push_extra(k, &v.to_string()));
            }
            Ok(())
        });
        pushed.or_else(|e| bad.note(options, e.at(format!("{} line {number}", path.display()))))
    })?;
    let mut table = table.finish(0)?;
    if table.extra.iter().all(|(_, values)| values.iter().all(|v| v == "-1")) {
        table.extra.clear();
    }
    Ok((table, bad))
}

fn row(mut f: Fields<'_>, from_zero: bool) -> Result<(TrackRow, [f64; 3])> {
    let frame = f.integer("a frame number")? + i64::from(from_zero);
    if !(1..=100_000_000).contains(&frame) {
        let e = Error::new(ErrorKind::Damaged, format!("frame {frame}: expected a number from 1 to 100 000 000"));
        return Err(if frame == 0 {
            e.at("column 1").hint("MOTChallenge counts frames from 1; are these counted from 0?")
        } else {
            e.at("column 1")
        });
    }
    let id = f.integer("a track id")?;
    let mut bbox = [0.0; 4];
    for (v, what) in bbox.iter_mut().zip(["a left edge", "a top edge", "a width", "a height"]) {
        *v = f.number(what)?;
    }
    if bbox[2] < 0.0 || bbox[3] < 0.0 {
        let what = format!("expected a size of at least 0 px, found {} x {}", bbox[2], bbox[3]);
        return Err(Error::new(ErrorKind::Damaged, what).at("columns 5 and 6").hint("are these right and bottom?"));
    }
    let score = f.optional("a confidence")?.unwrap_or(1.0);
    let eighth = f.optional("a class or a place x")?;
    let ninth = f.optional("a visible share or a place y")?;
    // A tenth column tells that these are places in the world, or -1, and no class.
    let tenth = f.optional("a place z")?;
    let world = tenth.map_or([-1.0; 3], |z| [eighth.unwrap_or(-1.0), ninth.unwrap_or(-1.0), z]);
    let class = eighth.filter(|c| tenth.is_none() && (1.0..=1e6).contains(c) && c.fract() == 0.0);
    let row = TrackRow {
        frame: (frame - 1) as u32,
        id,
        bbox,
        score,
        class: class.map_or(1, |c| c as i32),
        visibility: ninth.filter(|v| (0.0..=1.0).contains(v) && class.is_some()).unwrap_or(1.0),
        ..TrackRow::default()
    };
    Ok((row, world))
}

/// Writes a table as a truth (`truth`: class and visibility in columns 8 and 9) or as a result (places in the world, or -1).
/// # Errors
/// What the writer fails with.
pub fn write(table: &TrackTable, truth: bool, out: &mut impl Write) -> Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), text).unwrap();
        f
    }

    #[test]
    fn what_is_written_is_read_back() {
        let f = file("2,5,10.25,20,30,40.5,0,8,0.25\n1,7,1,1,3,3,1,1,1\n");
        let (t, _) = read(f.path(), ReadOptions::default()).unwrap();
        assert_eq!(
            (t.ids.as_slice(), t.n_frames(), t.class.get(1), t.visibility.get(1)),
            ([5, 7].as_slice(), 2, 8, 0.25)
        );
        let mut out = Vec::new();
        write(&t, true, &mut out).unwrap();
        let again = file(std::str::from_utf8(&out).unwrap());
        let (mut u, _) = read(again.path(), ReadOptions::default()).unwrap();
        u.label = t.label.clone();
        assert_eq!(t, u);
    }

    #[test]
    fn a_malformed_row_is_named_by_line_and_column_or_counted() {
        let f = file("1,1,1,1,5,5,1\n1,2,1,x,5,5,1\n");
        let e = read(f.path(), ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 2: column 4: expected a top edge, found \"x\""), "{e}");
        let (t, bad) = read(f.path(), ReadOptions { skip_bad_rows: true, ..ReadOptions::default() }).unwrap();
        assert_eq!((t.n_rows(), bad.count), (1, 1));
    }

    #[test]
    fn frame_zero_is_refused_with_the_likely_cause() {
        let f = file("0,1,1,1,5,5,1\n");
        assert!(read(f.path(), ReadOptions::default()).unwrap_err().to_string().contains("column 1"));
    }

    #[test]
    fn world_coordinates_of_mot15_are_no_class() {
        let text = "1,1,1,1,5,5,1,3,14.2,0\n1,2,1,1,5,5,1,-1,-1,-1\n";
        let f = file(text);
        let (t, _) = read(f.path(), ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        let mut out = Vec::new();
        write(&t, false, &mut out).unwrap();
        assert_eq!(std::str::from_utf8(&out).unwrap(), text);
        assert_eq!((t.class.get(0), t.class.get(1), t.visibility.get(0)), (1, 1, 1.0));
    }
}
