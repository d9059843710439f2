//! CSV with named columns: boresight's own tracks.csv, trackpy, TrackMate, btrack, ultrack, and whatever names its columns.
//!
//! The header decides: each column has a meaning by its name (upper or lower case), the rest is kept as text where asked.
//! TrackMate writes three more header lines and leaves TRACK_ID empty for spots outside of tracks: both are passed over.
//! Frames count from 0, the centre of the top-left pixel is (0, 0). Rows have a centre, and a box if width and height are
//! there; or a box by its left and top with width and height, or with right and bottom. As in tables of detections, `left_px`
//! is the box's edge, any other left the number of its first pixel. Lines that begin with # are passed over.
//! Limits: comma, semicolon or tab; no quoted separators inside of used columns.

use super::lines::{BadRows, Fields, ReadOptions, each_line, number, separator};
use crate::tracks::RowState;
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackRow, TrackStatus, TrackTable, TrackTableBuilder};
use std::path::Path;

/// What a column means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    Frame,
    Id,
    X,
    Y,
    Left,
    Top,
    Right,
    Bottom,
    Width,
    Height,
    Score,
    Class,
    Visibility,
    Truncation,
    Occlusion,
    Status,
    Other,
}

/// The names of each meaning, best first: `ID` is a track's number in btrack but a spot's in TrackMate.
const NAMES: [(Meaning, &[&str]); 16] = [
    (Meaning::Frame, &["frame", "t", "frame_index"]),
    (Meaning::Id, &["track_id", "particle", "trackid", "id", "track"]),
    (Meaning::X, &["x_px", "position_x", "x", "cx"]),
    (Meaning::Y, &["y_px", "position_y", "y", "cy"]),
    (Meaning::Left, &["left_px", "bb_left", "left", "xmin", "x_min", "x1"]),
    (Meaning::Top, &["top_px", "bb_top", "top", "ymin", "y_min", "y1"]),
    (Meaning::Right, &["bb_right", "right", "xmax", "x_max", "x2"]),
    (Meaning::Bottom, &["bb_bottom", "bottom", "ymax", "y_max", "y2"]),
    (Meaning::Width, &["width_px", "bb_width", "width", "w"]),
    (Meaning::Height, &["height_px", "bb_height", "height", "h"]),
    (Meaning::Score, &["score", "confidence", "conf", "quality"]),
    (Meaning::Class, &["class", "class_id"]),
    (Meaning::Visibility, &["visibility"]),
    (Meaning::Truncation, &["truncation"]),
    (Meaning::Occlusion, &["occlusion"]),
    (Meaning::Status, &["status"]),
];

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

/// The cells of a row's state as they come.
#[derive(Default)]
struct State {
    row: RowState,
    velocity: [Option<f64>; 2],
    cov: [Option<f64>; 10],
}

const VELOCITY: [&str; 2] = ["vx_px_per_s", "vy_px_per_s"];
const COV: [&str; 10] = [
    "var_x_px2",
    "cov_x_vx_px2_per_s",
    "cov_x_y_px2",
    "cov_x_vy_px2_per_s",
    "var_vx_px2_per_s2",
    "cov_vx_y_px2_per_s",
    "cov_vx_vy_px2_per_s2",
    "var_y_px2",
    "cov_y_vy_px2_per_s",
    "var_vy_px2_per_s2",
];

impl State {
    fn take(&mut self, name: &str, text: &[u8]) {
        let word = || std::str::from_utf8(text).ok();
        match name {
            "time_s" => self.row.time = word().and_then(crate::io::tables::parse_seconds),
            "status" => {
                self.row.status = match text {
                    b"tentative" => Some(TrackStatus::Tentative),
                    b"confirmed" => Some(TrackStatus::Confirmed),
                    b"coasting" => Some(TrackStatus::Coasting),
                    _ => None,
                }
            }
            "detection" => self.row.detection = word().and_then(|t| t.parse().ok()),
            _ => {
                if let Some(k) = VELOCITY.iter().position(|n| *n == name) {
                    self.velocity[k] = number(text);
                } else if let Some(k) = COV.iter().position(|n| *n == name) {
                    self.cov[k] = number(text);
                }
            }
        }
    }

    fn row(self) -> RowState {
        let Self { mut row, velocity: [vx, vy], cov: c } = self;
        row.velocity = vx.zip(vy).map(|(x, y)| [x, y]);
        row.cov = c.iter().all(Option::is_some).then(|| c.map(Option::unwrap_or_default));
        if let ([Some(xx), _, Some(xy), _, _, _, _, Some(yy), ..], None) = (c, row.cov) {
            row.position_cov = Some([xx, xy, yy]);
        }
        row
    }
}

struct Header {
    meanings: Vec<Meaning>,
    names: Vec<String>,
    trackmate: bool,
    /// From a left or top of the table to the box's edge, px.
    edge_shift_px: f64,
}

fn header(line: &[u8], comma: Option<u8>) -> Result<Header> {
    let mut names = Vec::new();
    let mut fields = Fields::new(line, comma);
    while let Some(f) = fields.field() {
        names.push(String::from_utf8_lossy(f).trim_matches('"').to_string());
    }
    let lower: Vec<String> = names.iter().map(|n| n.to_ascii_lowercase()).collect();
    let mut meanings = vec![Meaning::Other; names.len()];
    for (meaning, known) in NAMES {
        if let Some(k) = known.iter().find_map(|n| lower.iter().position(|l| l == n))
            && meanings[k] == Meaning::Other
        {
            meanings[k] = meaning;
        }
    }
    let has = |m| meanings.contains(&m);
    let place = has(Meaning::X) && has(Meaning::Y) || has(Meaning::Left) && has(Meaning::Top);
    if !(has(Meaning::Frame) && has(Meaning::Id) && place) {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("columns {}: expected a frame, a track number and a position among them", names.join(", ")),
        )
        .at("line 1")
        .hint("for instance: frame,track_id,x,y or frame,track_id,left,top,width,height"));
    }
    let trackmate = lower.iter().any(|n| n == "position_x");
    let edges = meanings.iter().zip(&lower).any(|(m, name)| *m == Meaning::Left && name == "left_px");
    Ok(Header { meanings, names, trackmate, edge_shift_px: if edges { 0.0 } else { -0.5 } })
}

/// Whether a first line is a header of this kind.
pub fn is_header(line: &[u8]) -> bool {
    header(line, separator(line)).is_ok()
}

/// Reads a table; `tentative` keeps rows whose status is tentative.
/// # Errors
/// A missing file, a header without frame, id and position, a malformed row unless such rows are skipped.
pub fn read(path: &Path, options: ReadOptions, tentative: bool) -> Result<(TrackTable, BadRows)> {
    let mut table = TrackTableBuilder::new(path.display().to_string(), PixelOrigin::Centre0);
    let (mut bad, mut head, mut comma, mut boxes) = (BadRows::default(), None::<Header>, None, false);
    let mut kept: Vec<usize> = Vec::new();
    each_line(path, |line_number, line| {
        let Some(head) = &head else {
            comma = separator(line);
            let h = header(line, comma).map_err(|e| e.at(path.display()))?;
            if options.keep_extra {
                kept =
                    (0..h.names.len()).filter(|&k| matches!(h.meanings[k], Meaning::Other | Meaning::Status)).collect();
                kept.iter().for_each(|&k| table.add_extra(h.names[k].as_str()));
            }
            let has = |m| h.meanings.contains(&m);
            boxes = has(Meaning::Width) && has(Meaning::Height)
                || has(Meaning::Left) && has(Meaning::Top) && has(Meaning::Right) && has(Meaning::Bottom);
            head = Some(h);
            return Ok(());
        };
        let (mut extra, mut state) = (Vec::new(), State::default());
        let fields = Fields::new(line, comma);
        match row(head, fields, line_number, tentative, &kept, (&mut extra, &mut state, &mut table)) {
            Ok(None) => Ok(()),
            Ok(Some(r)) => match table.push_with_state(&r, &state.row()) {
                Ok(()) => {
                    extra.iter().enumerate().for_each(|(k, v)| table.push_extra(k, v));
                    Ok(())
                }
                Err(e) => bad.note(options, e.at(format!("{} line {line_number}", path.display()))),
            },
            Err(e) => bad.note(options, e.at(format!("{} line {line_number}", path.display()))),
        }
    })?;
    if head.is_none() {
        return Err(Error::new(ErrorKind::Damaged, "is empty: expected a header with column names").at(path.display()));
    }
    if !boxes {
        table.points();
    }
    let mut t = table.finish(0)?;
    if boxes && t.boxes.iter().all(|b| b[2] == 0.0 && b[3] == 0.0) {
        t.is_points = true;
    }
    Ok((t, bad))
}

fn row(
    head: &Header,
    mut fields: Fields<'_>,
    line: u64,
    tentative: bool,
    kept: &[usize],
    (extra, state, table): (&mut Vec<String>, &mut State, &mut TrackTableBuilder),
) -> Result<Option<TrackRow>> {
    let mut r = TrackRow::default();
    let (mut x, mut y, mut left, mut top, mut right, mut bottom) = (None, None, None, None, None, None);
    for (k, &meaning) in head.meanings.iter().enumerate() {
        match meaning {
            Meaning::Frame | Meaning::Id => {
                let mut peek = fields;
                let text = peek.field().unwrap_or(b"");
                if head.trackmate && number(text).is_none() && (line <= 4 || matches!(text, b"" | b"None" | b"null")) {
                    return Ok(None);
                }
                if meaning == Meaning::Id {
                    r.id = fields.integer("a track number")?;
                } else {
                    let f = fields.integer("a frame number")?;
                    r.frame = u32::try_from(f).map_err(|_| {
                        Error::new(ErrorKind::Damaged, format!("frame {f}: expected a number from 0"))
                            .at(&head.names[k])
                    })?;
                }
            }
            Meaning::X => x = Some(fields.number("a position x")?),
            Meaning::Y => y = Some(fields.number("a position y")?),
            Meaning::Left => left = Some(fields.number("a left edge")?),
            Meaning::Top => top = Some(fields.number("a top edge")?),
            Meaning::Right => right = Some(fields.number("a right edge")?),
            Meaning::Bottom => bottom = Some(fields.number("a bottom edge")?),
            Meaning::Width => r.bbox[2] = fields.optional("a width")?.unwrap_or(0.0),
            Meaning::Height => r.bbox[3] = fields.optional("a height")?.unwrap_or(0.0),
            Meaning::Score => r.score = fields.optional("a score")?.unwrap_or(1.0),
            Meaning::Class => match fields.field().unwrap_or(b"") {
                b"" => {}
                text => match number(text) {
                    Some(class) => r.class = class as i32,
                    None => {
                        let name = String::from_utf8_lossy(text);
                        r.class = table.class_number(name.trim_matches('"')).ok_or_else(|| {
                            Error::new(ErrorKind::Damaged, "more than 1000 names of classes").at(&head.names[k])
                        })?;
                    }
                },
            },
            Meaning::Visibility => r.visibility = fields.optional("a visible share")?.unwrap_or(1.0),
            Meaning::Truncation => r.truncation = fields.optional("a truncation")?.unwrap_or(0.0),
            Meaning::Occlusion => r.occlusion = fields.optional("an occlusion")?.unwrap_or(0.0) as i32,
            Meaning::Status | Meaning::Other => {
                let text = fields.field().unwrap_or(b"");
                if meaning == Meaning::Status && !tentative && text == b"tentative" {
                    return Ok(None);
                }
                state.take(&head.names[k], text);
                if kept.contains(&k) {
                    extra.push(String::from_utf8_lossy(text).into_owned());
                }
            }
        }
    }
    nothing_behind(fields)?;
    for (k, first, last, centre, what) in [(0, left, right, x, "right edge"), (1, top, bottom, y, "bottom edge")] {
        if let (Some(first), Some(last)) = (first, last) {
            if last < first {
                let what = format!("expected a {what} of at least {first}, found {last}");
                return Err(Error::new(ErrorKind::Damaged, what));
            }
            r.bbox[k + 2] = last - first;
        }
        let edge = first.map(|f| f + head.edge_shift_px);
        r.bbox[k] = edge.or(centre.map(|c| c - r.bbox[k + 2] / 2.0)).unwrap_or(0.0);
    }
    Ok(Some(r))
}

/// Refuses a row that says more than its header names: 1,5 for 1.5 in a table parted by commas shifts all behind it.
fn nothing_behind(mut fields: Fields<'_>) -> Result<()> {
    while let Some(field) = fields.field() {
        if !field.is_empty() {
            let found: String = String::from_utf8_lossy(field).chars().take(30).collect();
            return Err(Error::new(ErrorKind::Damaged, format!("found \"{found}\" behind the header's last column"))
                .hint("are there decimal commas? part the fields by semicolons and write decimal points"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), text).unwrap();
        read(f.path(), options, false)
    }

    #[test]
    fn the_tables_of_four_programs_give_the_same_points() {
        let trackpy = "frame,particle,x,y,mass\n0,3,1.5,2.5,9\n2,3,4,5,9\n";
        let btrack = "ID,t,y,x\n3.0,0.0,2.5,1.5\n3.0,2.0,5,4\n";
        let ultrack = "track_id,t,z,y,x\n3,0,0,2.5,1.5\n3,2,0,5,4\n";
        let trackmate = "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,FRAME\nLabel,Spot ID,Track ID,Quality,X,Y,Frame\n\
Label,Spot ID,Track ID,Quality,X,Y,Frame\n,,,(quality),(pixel),(pixel),\nID1,1,3,1,1.5,2.5,0\nID2,2,,1,9,9,0\nID3,3,3,1,4,5,2\n";
        for text in [trackpy, btrack, ultrack, trackmate] {
            let (t, _) = read_text(text, ReadOptions::default()).unwrap();
            assert_eq!(t.ids, [3], "{text}");
            assert_eq!(t.boxes, [[1.5, 2.5, 0.0, 0.0], [4.0, 5.0, 0.0, 0.0]], "{text}");
            assert!(t.is_points && t.n_frames() == 3);
        }
    }

    #[test]
    fn boresights_own_table_gives_boxes_around_the_state_and_leaves_tentative_rows() {
        let text = "frame,time_s,track_id,status,x_px,y_px,width_px,height_px\n4,0.1,1,confirmed,10,20,4,6\n4,0.1,2,tentative,0,0,1,1\n";
        let (t, _) = read_text(text, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!((t.boxes.as_slice(), t.n_frames()), ([[8.0, 17.0, 4.0, 6.0]].as_slice(), 5));
        assert_eq!(t.extra[0], ("time_s".to_string(), vec!["0.1".to_string()]));
    }

    #[test]
    fn a_box_is_the_same_by_its_size_its_corners_or_its_centre() {
        for text in [
            "frame,id,left,top,width,height\n0,3,10,20,4,6\n",
            "# corners\nframe,id,x1,y1,x2,y2\n0,3,10,20,14,26\n",
            "frame,id,left_px,top_px,width_px,height_px\n0,3,9.5,19.5,4,6\n",
            "frame,id,x,y,w,h\n# centre\n0,3,11.5,22.5,4,6,\n",
        ] {
            let (t, _) = read_text(text, ReadOptions::default()).unwrap();
            assert_eq!((t.boxes.as_slice(), t.is_points), ([[9.5, 19.5, 4.0, 6.0]].as_slice(), false), "{text}");
        }
    }

    #[test]
    fn a_row_that_says_more_than_its_header_is_refused() {
        let e = read_text("frame,id,x,y\n0,3,1,5,2,5\n", ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 2") && e.contains("decimal commas"), "{e}");
    }

    #[test]
    fn a_header_without_a_position_is_refused_by_name() {
        let e = read_text("frame,track_id,mass\n0,1,2\n", ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("frame, track_id, mass: expected a frame, a track number and a position"), "{e}");
    }
}
