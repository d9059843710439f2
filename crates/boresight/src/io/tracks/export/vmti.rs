//! MISB ST 0903 VMTI (moving target indicators) in an MPEG transport stream: a local set of ST 0601 for each frame, the targets within.
//!
//! Source: MISB ST 0903.6, *Video Moving Target Indicator Metadata* (local set, VTarget pack, VTracker); ST 0601, *UAS Datalink Local Set*
//! (items 1, 2, 65, 74, 1); ST 0107 (BER lengths and object identifiers, unsigned numbers of as few bytes as they need).
//! Pixels count from 1, rows and columns alike, and are whole; a pixel's number is its column plus (row - 1) times the frame's width.
//! Times are microseconds as if the sequence's own zero were 1970-01-01. Limits: the first 500 targets of a frame by id.

use super::mpeg_ts::{CLOCK_HZ, MpegTs};
use super::paths::{Paths, centre, dropped, reach};
use super::times::FrameTimes;
use crate::tracks::Column;
use crate::{Error, ErrorKind, Result, TrackStatus, TrackTable};
use std::io::Write;

/// Key of the local set of ST 0601.
const UAS_KEY: [u8; 16] = [0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01, 0x03, 0x01, 0x01, 0, 0, 0];
/// Versions of ST 0601 and ST 0903 that are followed.
const UAS_VERSION: u8 = 19;
const VMTI_VERSION: u8 = 6;
/// Most targets told in a frame: each takes at most 80 bytes.
const MOST_TARGETS: usize = 500;
/// Largest width and height, px.
const MOST_PX: u64 = (1 << 24) - 1;
/// Detection status: active and moving; active and coasting.
const MOVING: u8 = 1;
const COASTING: u8 = 4;

/// A number in as few bytes as it needs.
fn uint(value: u64) -> Vec<u8> {
    let bytes = value.to_be_bytes();
    bytes[bytes.iter().position(|b| *b != 0).unwrap_or(7)..].to_vec()
}

/// The length of a value, in BER.
fn length(n: usize) -> Vec<u8> {
    if n < 128 {
        return vec![n as u8];
    }
    let bytes = uint(n as u64);
    [&[0x80 | bytes.len() as u8][..], &bytes].concat()
}

/// A number in groups of seven bits, all but the last with the high bit set.
fn object_id(value: u64) -> Vec<u8> {
    let groups = (64 - value.leading_zeros() as usize).div_ceil(7).max(1);
    (0..groups).rev().map(|k| (value >> (7 * k)) as u8 & 0x7f | if k > 0 { 0x80 } else { 0 }).collect()
}

fn item(out: &mut Vec<u8>, tag: u8, value: &[u8]) {
    out.push(tag);
    out.extend(length(value.len()));
    out.extend(value);
}

/// What is the same for all frames.
struct Scene<'a> {
    table: &'a TrackTable,
    /// Width and height of a frame, px.
    size: [u64; 2],
    has_scores: bool,
    /// For each track its number, and the times of its first and last detection, µs.
    tracks: Vec<(u64, [u64; 2])>,
}

/// Writes the stream; the names of what it cannot hold are returned.
/// # Errors
/// A track that stands twice in a frame; a time before 0; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let paths = Paths::new(table)?;
    let times = FrameTimes::new(table);
    let us = |frame: usize| {
        u64::try_from(times.ns(frame).div_euclid(1000))
            .map_err(|_| Error::new(ErrorKind::Unsupported, "a time before 0, which VMTI cannot hold").at(&table.label))
    };
    let renumbered = table.ids.first().is_some_and(|id| *id < 1);
    let mut tracks = Vec::with_capacity(table.n_tracks());
    for (t, rows) in paths.rows.iter().enumerate() {
        let id = if renumbered { t as u64 + 1 } else { table.ids[t] as u64 };
        let seen = |r: &&usize| table.state(**r).status != Some(TrackStatus::Coasting);
        let first = rows.iter().find(seen).or(rows.first()).map_or(0, |r| paths.frames[*r] as usize);
        let last = rows.iter().rev().find(seen).or(rows.last()).map_or(0, |r| paths.frames[*r] as usize);
        tracks.push((id, [us(first)?, us(last)?]));
    }
    let fits = |r: usize| (0.0..=1.0).contains(&table.score.get(r));
    let has_scores = table.score != Column::Constant(1.0) && (0..table.n_rows()).all(fits);
    let known = table.size_px.map(|s| s.map(u64::from));
    let size = known.unwrap_or_else(|| reach(table)).map(|s| s.clamp(1, MOST_PX));
    let scene = Scene { table, size, has_scores, tracks };
    let mut stream = MpegTs::new();
    let is_outside = |r: usize| {
        let at = centre(table, r);
        (0..2).any(|k| !(-0.5..size[k] as f64 - 0.5).contains(&at[k]))
    };
    let outside = (0..table.n_rows()).filter(|r| is_outside(*r)).count();
    let mut beyond = 0;
    let mut first = None;
    for frame in times.frames_to_tell(table) {
        let time = us(frame)?;
        let from = *first.get_or_insert(time);
        beyond += table.rows(frame).len().saturating_sub(MOST_TARGETS);
        let ticks = i128::from(time.saturating_sub(from)) * i128::from(CLOCK_HZ) / 1_000_000;
        stream.push(ticks as u64, &scene.frame(frame, time));
    }
    out.write_all(&stream.finish()).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let mut lost = vec!["positions between pixels (they are rounded)".to_string()];
    lost.extend(dropped(table, &["time_s", "status", if has_scores { "score" } else { "" }]));
    let also = [
        (known.is_none(), "the size of the frames (what holds all rows stands for it)"),
        (renumbered, "ids below 1 (tracks are numbered anew)"),
        (
            (0..table.n_rows()).any(|r| table.state(r).status == Some(TrackStatus::Tentative)),
            "that tracks are tentative (they are written as the others)",
        ),
    ];
    lost.extend(also.into_iter().filter(|a| a.0).map(|a| a.1.to_string()));
    lost.extend((outside > 0).then(|| format!("how far {outside} rows lie outside of the frame")));
    lost.extend((beyond > 0).then(|| format!("{beyond} rows beyond {MOST_TARGETS} in a frame")));
    lost.extend(times.lost());
    Ok(lost)
}

impl Scene<'_> {
    /// The local set of ST 0601 of a frame.
    fn frame(&self, frame: usize, time_us: u64) -> Vec<u8> {
        let n = self.table.rows(frame).len();
        let mut vmti = Vec::new();
        item(&mut vmti, 4, &[VMTI_VERSION]);
        item(&mut vmti, 5, &uint(n as u64));
        item(&mut vmti, 6, &uint(n.min(MOST_TARGETS) as u64));
        item(&mut vmti, 8, &uint(self.size[0]));
        item(&mut vmti, 9, &uint(self.size[1]));
        if n > 0 {
            let mut targets: Vec<(u64, Vec<u8>)> = self.table.rows(frame).map(|r| self.target(r)).collect();
            targets.sort_by_key(|t| t.0);
            let series: Vec<u8> =
                targets.iter().take(MOST_TARGETS).flat_map(|t| [length(t.1.len()), t.1.clone()].concat()).collect();
            item(&mut vmti, 101, &series);
        }
        let mut set = Vec::new();
        item(&mut set, 2, &time_us.to_be_bytes());
        item(&mut set, 65, &[UAS_VERSION]);
        item(&mut set, 74, &vmti);
        // The sum covers everything up to its own length.
        let mut packet = UAS_KEY.to_vec();
        packet.extend(length(set.len() + 4));
        packet.extend(set);
        packet.extend([1, 2]);
        let sum = packet
            .iter()
            .enumerate()
            .fold(0_u16, |s, (k, b)| s.wrapping_add(if k % 2 == 0 { u16::from(*b) << 8 } else { u16::from(*b) }));
        packet.extend(sum.to_be_bytes());
        packet
    }

    /// A target's number and its pack.
    fn target(&self, r: usize) -> (u64, Vec<u8>) {
        let table = self.table;
        let (id, seen) = self.tracks[table.tracks[r] as usize];
        let [x, y, width, height] = centre(table, r);
        // Column and row from 1, kept within the frame.
        let pixel = |x: f64, y: f64| {
            // What is no number becomes 1.
            let within = |v: f64, most: u64| ((v.round() + 1.0).clamp(1.0, most as f64) as u64).max(1);
            [within(x, self.size[0]), within(y, self.size[1])]
        };
        let number = |[column, row]: [u64; 2]| uint(column + (row - 1) * self.size[0]);
        let at = pixel(x, y);
        let mut out = object_id(id);
        item(&mut out, 1, &number(at));
        if !table.is_points {
            let (w, h) = (0.5 * (width - 1.0).max(0.0), 0.5 * (height - 1.0).max(0.0));
            item(&mut out, 2, &number(pixel(x - w, y - h)));
            item(&mut out, 3, &number(pixel(x + w, y + h)));
        }
        if self.has_scores {
            item(&mut out, 5, &[(100.0 * table.score.get(r)).round() as u8]);
        }
        item(&mut out, 19, &uint(at[1]));
        item(&mut out, 20, &uint(at[0]));
        let is_coasting = table.state(r).status == Some(TrackStatus::Coasting);
        item(&mut out, 23, &[if is_coasting { COASTING } else { MOVING }]);
        let mut tracker = Vec::new();
        item(&mut tracker, 3, &seen[0].to_be_bytes());
        item(&mut tracker, 4, &seen[1].max(seen[0]).to_be_bytes());
        item(&mut out, 104, &tracker);
        (id, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    #[test]
    fn numbers_take_the_bytes_that_the_standard_gives_them() {
        // Examples of ST 0107 and ST 0601: lengths of 201 and 3 bytes; object identifiers 144 and 23.
        assert_eq!((length(3), length(201), length(300)), (vec![3], vec![0x81, 201], vec![0x82, 1, 44]));
        assert_eq!((object_id(23), object_id(144)), (vec![23], vec![0x81, 0x10]));
        assert_eq!((uint(0), uint(256)), (vec![0], vec![1, 0]));
    }

    #[test]
    fn pixels_count_from_one_and_what_does_not_fit_is_said() {
        let row = |frame, id| TrackRow { frame, id, bbox: [0.0, 0.0, 2.0, 3.0], score: 0.5, ..TrackRow::default() };
        let mut table = TrackTable::from_rows("t", PixelOrigin::Pixel0, [row(0, -3), row(2, -3)]).unwrap();
        table.size_px = Some([640, 512]);
        let mut out = Vec::new();
        let lost = write(&table, &mut out).unwrap();
        assert_eq!(lost.len(), 3, "{lost:?}");
        assert!(lost[1].starts_with("ids below 1") && lost[2].starts_with("times"), "{lost:?}");
        let scene = Scene { table: &table, size: [640, 512], has_scores: true, tracks: vec![(1, [0, 80_000])] };
        let (_, pack) = scene.target(0);
        // Columns 1 and 2, rows 1 to 3; the centre is rounded to column 2, row 2: 2 + 640; the last pixel is 2 + 2 x 640.
        assert_eq!(pack[..13], [1, 1, 2, 2, 130, 2, 1, 1, 3, 2, 5, 2, 5], "{pack:?}");
        let far = |left: f64| TrackRow { frame: 0, id: 1, bbox: [left, 0.0, 2.0, 3.0], ..TrackRow::default() };
        for (left, words) in [(-30.0, "how far 1 rows"), (1e300, "how far 1 rows")] {
            let table = TrackTable::from_rows("t", PixelOrigin::Pixel0, [far(left)]).unwrap();
            let lost = write(&table, &mut Vec::new()).unwrap();
            assert!(lost.iter().any(|l| l.starts_with(words)), "{left}: {lost:?}");
        }
        let crowd = (1..700).map(|id| row(0, id));
        let crowd = TrackTable::from_rows("t", PixelOrigin::Pixel0, crowd).unwrap();
        let lost = write(&crowd, &mut Vec::new()).unwrap();
        assert!(lost.iter().any(|l| l == "199 rows beyond 500 in a frame"), "{lost:?}");
    }
}
