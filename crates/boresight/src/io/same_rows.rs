//! A table gives the same rows however it is read: as detections, as states of tracks, as a table of tracks.

use super::tables::columns::{Field, names_of};
use super::tables::{TableOptions, read_detections, read_tracks};
use super::tracks::{Format, ReadOptions, read, write};
use crate::{PixelOrigin, TrackRow, TrackTable};
use proptest::prelude::*;
use std::path::Path;

/// Frame, identity, centre, size and score of a row.
type Row = (u64, i64, [f64; 2], [f64; 2], f32);

/// The rows of a table of tracks by frame and identity.
fn rows_of(t: &TrackTable) -> Vec<Row> {
    let mut out = Vec::new();
    for frame in 0..t.n_frames() {
        for r in t.rows(frame) {
            let e = t.extent(r);
            let centre = [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0];
            let id = t.ids[t.tracks[r] as usize];
            out.push((frame as u64, id, centre, [e.width_px, e.height_px], t.score.get(r) as f32));
        }
    }
    out.sort_by_key(|r| (r.0, r.1));
    out
}

/// Reads a file in all three ways; checks that they agree, and returns the rows.
fn read_all_ways(path: &Path) -> Vec<Row> {
    let options = TableOptions { box_px: 0.0, ..TableOptions::default() };
    let table = rows_of(&read(path, None, ReadOptions::default(), true).unwrap().table);
    let mut states = Vec::new();
    for frame in read_tracks(path, &options).unwrap().frames {
        for t in &frame.tracks {
            let (m, e) = (&t.kinematics.mean, &t.extent);
            states.push((frame.index.0, t.id.0 as i64, [m[0], m[2]], [e.width_px, e.height_px], t.score));
        }
    }
    states.sort_by_key(|r| (r.0, r.1));
    let mut detections = Vec::new();
    for scan in read_detections(path, &options).unwrap().scans {
        for d in &scan.detections {
            let e = &d.extent;
            detections.push((scan.index.0, [d.position.x, d.position.y], [e.width_px, e.height_px], d.score));
        }
    }
    assert_same(&table, &states);
    assert_eq!(detections.len(), table.len());
    for (frame, centre, size, score) in detections {
        let same = |r: &&Row| r.0 == frame && near(r.2, centre) && near(r.3, size) && r.4 == score;
        assert!(table.iter().any(|r| same(&r)), "no row as the detection in frame {frame} at {centre:?}");
    }
    table
}

/// A centre made of an edge and half a size may differ in the last bits.
fn near(a: [f64; 2], b: [f64; 2]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9)
}

fn assert_same(a: &[Row], b: &[Row]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a.0, a.1, a.4) == (b.0, b.1, b.4) && near(a.2, b.2) && near(a.3, b.3), "{a:?} {b:?}");
    }
}

/// How a table with named columns is written.
#[derive(Clone, Debug)]
struct Style {
    separator: char,
    quoted: bool,
    crlf: bool,
    bom: bool,
    comments: bool,
    /// Centre and size, left and size, or left and right.
    place: usize,
    /// Which synonym each column goes by, and where the columns begin.
    synonyms: usize,
    turn: usize,
}

fn style() -> impl Strategy<Value = Style> {
    (prop::sample::select(vec![',', ';', '\t', ' ']), any::<[bool; 4]>(), 0..3_usize, 0..1000_usize, 0..7_usize)
        .prop_map(|(separator, [quoted, crlf, bom, comments], place, synonyms, turn)| Style {
            separator,
            quoted: quoted && separator != ' ',
            crlf,
            bom,
            comments,
            place,
            synonyms,
            turn,
        })
}

/// One row as generated: frame, identity, left and top (quarters of a pixel), width and height, score in eighths.
type Made = (u32, i64, i32, i32, u16, u16, u8);

fn made() -> impl Strategy<Value = Vec<Made>> {
    let row = (0..40_u32, 0..9_i64, -400..4000_i32, -400..4000_i32, 1..400_u16, 1..400_u16, 0..9_u8);
    prop::collection::vec(row, 1..30).prop_map(|mut rows| {
        rows.sort_by_key(|r| (r.0, r.1));
        rows.dedup_by_key(|r| (r.0, r.1));
        rows
    })
}

fn text_of(style: &Style, rows: &[Made]) -> String {
    let place = [
        [Field::X, Field::Y, Field::Width, Field::Height],
        [Field::Left, Field::Top, Field::Width, Field::Height],
        [Field::Left, Field::Top, Field::Right, Field::Bottom],
    ][style.place];
    let mut fields = [&[Field::Frame, Field::Id, Field::Score][..], &place].concat();
    let n_fields = fields.len();
    fields.rotate_left(style.turn % n_fields);
    let (end, between) = (if style.crlf { "\r\n" } else { "\n" }, style.separator.to_string());
    let cell = |text: String| if style.quoted { format!("\"{text}\"") } else { text };
    let header: Vec<String> = fields
        .iter()
        .map(|f| {
            // `left_px` means an edge, `t` a time where another column is the frame.
            let names: Vec<_> = names_of(*f).iter().filter(|n| **n != "leftpx" && **n != "toppx").collect();
            cell(names[style.synonyms % names.len()].to_string())
        })
        .collect();
    let mut out = if style.bom { "\u{feff}".to_string() } else { String::new() };
    out += &format!("{}{end}", header.join(&between));
    for &(frame, id, left, top, w, h, score) in rows {
        let (l, t, w, h) = (f64::from(left) / 4.0, f64::from(top) / 4.0, f64::from(w), f64::from(h));
        let value = |f: &Field| match f {
            Field::Frame => frame.to_string(),
            Field::Id => id.to_string(),
            Field::Score => (f64::from(score) / 8.0).to_string(),
            Field::X => (l - 0.5 + w / 2.0).to_string(),
            Field::Y => (t - 0.5 + h / 2.0).to_string(),
            Field::Left => l.to_string(),
            Field::Top => t.to_string(),
            Field::Right => (l + w).to_string(),
            Field::Bottom => (t + h).to_string(),
            Field::Width => w.to_string(),
            _ => h.to_string(),
        };
        let cells: Vec<String> = fields.iter().map(|f| cell(value(f))).collect();
        if style.comments {
            out += &format!("# a remark, not a row{end}{end}");
        }
        out += &format!("{}{end}", cells.join(&between));
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn named_columns_in_every_style_and_by_every_synonym_are_read_alike(style in style(), rows in made()) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv");
        std::fs::write(&path, text_of(&style, &rows)).unwrap();
        let want: Vec<Row> = rows
            .iter()
            .map(|&(frame, id, left, top, w, h, score)| {
                let (w, h) = (f64::from(w), f64::from(h));
                let centre = [f64::from(left) / 4.0 - 0.5 + w / 2.0, f64::from(top) / 4.0 - 0.5 + h / 2.0];
                (u64::from(frame), id, centre, [w, h], f32::from(score) / 8.0)
            })
            .collect();
        assert_same(&read_all_ways(&path), &want);
    }

    #[test]
    fn every_dialect_is_read_alike(rows in made()) {
        let dir = tempfile::tempdir().unwrap();
        let table = TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(|&(frame, id, left, top, w, h, score)| {
            let bbox = [f64::from(left) / 4.0, f64::from(top) / 4.0, f64::from(w), f64::from(h)];
            TrackRow { frame, id, bbox, score: f64::from(score) / 8.0, ..TrackRow::default() }
        })).unwrap();
        for format in Format::ALL.into_iter().filter(|f| *f != Format::Ctc) {
            let mut text = Vec::new();
            let lost = write(&table, format, &mut text).unwrap();
            let path = dir.path().join("t.txt");
            std::fs::write(&path, &text).unwrap();
            let got = read_all_ways(&path);
            let mut want = rows_of(&table);
            for row in &mut want {
                if lost.iter().any(|l| l.contains("width")) {
                    row.3 = [0.0; 2];
                }
                if lost.iter().any(|l| l == "score") {
                    row.4 = 1.0;
                }
            }
            assert_same(&got, &want);
        }
    }
}
