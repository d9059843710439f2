//! A table of tracks: which track stood where in which frame; what evaluation reads and what the formats convert.
//!
//! Coordinates stay as the file holds them (a subtraction would change the last bits of an overlap and so break ties
//! differently from the official kits); [`PixelOrigin`] says how to get to boresight's own pixel coordinates.
//! Columns that hold one value throughout take no memory: a million rows of boxes fit into 36 MB.

use crate::{Error, ErrorKind, Extent, Result};
use std::collections::HashMap;
use std::ops::Range;

/// What a table's coordinates count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PixelOrigin {
    /// The centre of the top-left pixel is (0, 0); a box begins at its pixels' outer edge (boresight).
    #[default]
    Centre0,
    /// The first pixel has number 0; a box that begins in it has `left = 0` (KITTI).
    Pixel0,
    /// The first pixel has number 1; a box that begins in it has `left = 1` (MOTChallenge).
    Pixel1,
}

impl PixelOrigin {
    /// What must be taken from a box's left or top to get boresight's edge, px.
    pub fn edge_shift_px(self) -> f64 {
        match self {
            Self::Centre0 => 0.0,
            Self::Pixel0 => 0.5,
            Self::Pixel1 => 1.5,
        }
    }

    /// What must be taken from a point's coordinate to get boresight's, px.
    pub fn point_shift_px(self) -> f64 {
        match self {
            Self::Centre0 | Self::Pixel0 => 0.0,
            Self::Pixel1 => 1.0,
        }
    }
}

/// A column of values that takes no memory while all of them are equal.
#[derive(Clone, Debug, PartialEq)]
pub enum Column<T> {
    /// Every row holds this value.
    Constant(T),
    /// One value a row.
    Values(Vec<T>),
}

impl<T: Copy + PartialEq> Column<T> {
    /// The value of a row.
    pub fn get(&self, row: usize) -> T {
        match self {
            Self::Constant(v) => *v,
            Self::Values(v) => v[row],
        }
    }

    /// Adds a row's value; `n_before` is the number of rows already there.
    pub fn push(&mut self, value: T, n_before: usize) {
        match self {
            Self::Constant(v) if n_before == 0 => *v = value,
            Self::Constant(v) if *v == value => {}
            Self::Constant(v) => {
                let mut all = vec![*v; n_before];
                all.push(value);
                *self = Self::Values(all);
            }
            Self::Values(all) => all.push(value),
        }
    }

    fn reorder(&mut self, order: &[u32]) {
        if let Self::Values(v) = self {
            *v = order.iter().map(|&i| v[i as usize]).collect();
        }
    }

    fn keep(&mut self, rows: &[u32]) {
        self.reorder(rows);
    }
}

/// One row of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackRow {
    /// Frame, from 0.
    pub frame: u32,
    /// The track's number in the file.
    pub id: i64,
    /// Left, top, width, height in the table's own coordinates, px. A point has no width and height.
    pub bbox: [f64; 4],
    /// Confidence, or in a truth of MOTChallenge whether the row counts (0 = ignored).
    pub score: f64,
    /// Class number; 1 where the format has none (MOTChallenge's pedestrian).
    pub class: i32,
    /// Visible share 0..=1; 1 where unknown.
    pub visibility: f64,
    /// How far the box leaves the image (KITTI's truncation), 0 where unknown.
    pub truncation: f64,
    /// How far it is hidden (KITTI's occlusion 0..=3), 0 where unknown.
    pub occlusion: i32,
}

impl Default for TrackRow {
    fn default() -> Self {
        Self { frame: 0, id: 0, bbox: [0.0; 4], score: 1.0, class: 1, visibility: 1.0, truncation: 0.0, occlusion: 0 }
    }
}

/// Tracks as a table, its rows in the order of their frames.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackTable {
    /// Where the table comes from, for messages.
    pub label: String,
    /// What the coordinates count from.
    pub origin: PixelOrigin,
    /// Whether rows are points (no width, no height) rather than boxes.
    pub is_points: bool,
    /// Left, top, width, height of each row, px.
    pub boxes: Vec<[f64; 4]>,
    /// Each row's track, an index into [`TrackTable::ids`].
    pub tracks: Vec<u32>,
    /// The tracks' numbers in the file, ascending.
    pub ids: Vec<i64>,
    /// Confidence, or whether a truth row counts.
    pub score: Column<f64>,
    /// Class number.
    pub class: Column<i32>,
    /// Visible share.
    pub visibility: Column<f64>,
    /// Truncation.
    pub truncation: Column<f64>,
    /// Occlusion.
    pub occlusion: Column<i32>,
    /// Regions in which unmatched results do not count (KITTI's DontCare): frame and box.
    pub ignore: Vec<(u32, [f64; 4])>,
    /// Further columns by name, as text, one value a row; read only where asked for.
    pub extra: Vec<(String, Vec<String>)>,
    starts: Vec<u32>,
}

impl TrackTable {
    /// Builds a table from rows in any order (rows of one frame keep theirs).
    /// # Errors
    /// A number that is not finite; more rows than 2³² − 1.
    pub fn from_rows(
        label: impl Into<String>,
        origin: PixelOrigin,
        rows: impl IntoIterator<Item = TrackRow>,
    ) -> Result<Self> {
        let mut b = TrackTableBuilder::new(label, origin);
        for row in rows {
            b.push(&row)?;
        }
        b.finish(0)
    }

    /// Number of frames (the last one may be beyond the last row).
    pub fn n_frames(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.boxes.len()
    }

    /// Number of tracks.
    pub fn n_tracks(&self) -> usize {
        self.ids.len()
    }

    /// The rows of a frame; none beyond the last frame.
    pub fn rows(&self, frame: usize) -> Range<usize> {
        match (self.starts.get(frame), self.starts.get(frame + 1)) {
            (Some(&a), Some(&b)) => a as usize..b as usize,
            _ => 0..0,
        }
    }

    /// Makes the table at least `n_frames` long.
    pub fn extend_to(&mut self, n_frames: usize) {
        let last = self.starts.last().copied().unwrap_or(0);
        if self.starts.len() < n_frames + 1 {
            self.starts.resize(n_frames + 1, last);
        }
    }

    /// Shifts all frame numbers by `by` (negative: towards 0); frames that would fall below 0 make it fail.
    /// # Errors
    /// Rows below frame 0.
    pub fn shift_frames(&mut self, by: i64) -> Result<()> {
        if by >= 0 {
            let zeros = std::iter::repeat_n(0, by as usize);
            self.starts = zeros.chain(self.starts.iter().copied()).collect();
        } else {
            let n = by.unsigned_abs() as usize;
            if self.starts.get(n).copied().unwrap_or(u32::MAX) != 0 {
                return Err(Error::new(ErrorKind::Config, format!("rows stand before frame {n}")).at(&self.label));
            }
            self.starts.drain(..n);
        }
        for (frame, _) in &mut self.ignore {
            *frame = (i64::from(*frame) + by).clamp(0, i64::from(u32::MAX)) as u32;
        }
        Ok(())
    }

    /// A row's box in boresight's pixel-edge coordinates.
    pub fn extent(&self, row: usize) -> Extent {
        let [l, t, w, h] = self.boxes[row];
        if self.is_points {
            let s = self.origin.point_shift_px();
            return Extent { left_px: l - s, top_px: t - s, width_px: 0.0, height_px: 0.0 };
        }
        let s = self.origin.edge_shift_px();
        Extent { left_px: l - s, top_px: t - s, width_px: w, height_px: h }
    }

    /// Moves the coordinates to another origin.
    pub fn set_origin(&mut self, origin: PixelOrigin) {
        let by = if self.is_points {
            origin.point_shift_px() - self.origin.point_shift_px()
        } else {
            origin.edge_shift_px() - self.origin.edge_shift_px()
        };
        self.origin = origin;
        if by != 0.0 {
            for b in self.boxes.iter_mut().chain(self.ignore.iter_mut().map(|(_, b)| b)) {
                b[0] += by;
                b[1] += by;
            }
        }
    }

    /// A row as a value.
    pub fn row(&self, frame: usize, row: usize) -> TrackRow {
        TrackRow {
            frame: frame as u32,
            id: self.ids[self.tracks[row] as usize],
            bbox: self.boxes[row],
            score: self.score.get(row),
            class: self.class.get(row),
            visibility: self.visibility.get(row),
            truncation: self.truncation.get(row),
            occlusion: self.occlusion.get(row),
        }
    }

    /// Keeps the rows for which `keep(frame, row)` holds; tracks without a row vanish.
    #[must_use]
    pub fn filtered(&self, mut keep: impl FnMut(usize, usize) -> bool) -> Self {
        let mut rows: Vec<u32> = Vec::with_capacity(self.n_rows());
        let mut starts = Vec::with_capacity(self.starts.len());
        starts.push(0);
        for frame in 0..self.n_frames() {
            rows.extend(self.rows(frame).filter(|&r| keep(frame, r)).map(|r| r as u32));
            starts.push(rows.len() as u32);
        }
        let mut new_of = vec![u32::MAX; self.ids.len()];
        for &r in &rows {
            new_of[self.tracks[r as usize] as usize] = 0;
        }
        let mut ids = Vec::new();
        for (t, n) in new_of.iter_mut().enumerate() {
            if *n == 0 {
                *n = ids.len() as u32;
                ids.push(self.ids[t]);
            }
        }
        let mut out = Self {
            label: self.label.clone(),
            origin: self.origin,
            is_points: self.is_points,
            boxes: rows.iter().map(|&r| self.boxes[r as usize]).collect(),
            tracks: rows.iter().map(|&r| new_of[self.tracks[r as usize] as usize]).collect(),
            ids,
            score: self.score.clone(),
            class: self.class.clone(),
            visibility: self.visibility.clone(),
            truncation: self.truncation.clone(),
            occlusion: self.occlusion.clone(),
            ignore: self.ignore.clone(),
            extra: self
                .extra
                .iter()
                .map(|(n, v)| (n.clone(), rows.iter().map(|&r| v[r as usize].clone()).collect()))
                .collect(),
            starts,
        };
        out.score.keep(&rows);
        out.class.keep(&rows);
        out.visibility.keep(&rows);
        out.truncation.keep(&rows);
        out.occlusion.keep(&rows);
        out
    }

    /// Finds a track that stands twice in one frame: the frame and the track's number.
    pub fn twice_in_a_frame(&self) -> Option<(usize, i64)> {
        let mut seen = vec![u32::MAX; self.ids.len()];
        for frame in 0..self.n_frames() {
            for r in self.rows(frame) {
                let t = self.tracks[r] as usize;
                if seen[t] == frame as u32 {
                    return Some((frame, self.ids[t]));
                }
                seen[t] = frame as u32;
            }
        }
        None
    }
}

/// Collects the rows of a [`TrackTable`].
#[derive(Debug)]
pub struct TrackTableBuilder {
    table: TrackTable,
    frames: Vec<u32>,
    of_id: HashMap<i64, u32>,
    last: (i64, u32),
    sorted: bool,
}

impl TrackTableBuilder {
    /// An empty table.
    pub fn new(label: impl Into<String>, origin: PixelOrigin) -> Self {
        let table = TrackTable {
            label: label.into(),
            origin,
            is_points: false,
            boxes: Vec::new(),
            tracks: Vec::new(),
            ids: Vec::new(),
            score: Column::Constant(1.0),
            class: Column::Constant(1),
            visibility: Column::Constant(1.0),
            truncation: Column::Constant(0.0),
            occlusion: Column::Constant(0),
            ignore: Vec::new(),
            extra: Vec::new(),
            starts: vec![0],
        };
        Self { table, frames: Vec::new(), of_id: HashMap::new(), last: (i64::MIN, u32::MAX), sorted: true }
    }

    /// Makes room for rows to come.
    pub fn reserve(&mut self, rows: usize) {
        self.table.boxes.reserve(rows);
        self.table.tracks.reserve(rows);
        self.frames.reserve(rows);
    }

    /// Says that the rows are points.
    pub fn points(&mut self) {
        self.table.is_points = true;
    }

    /// Adds a region that does not count.
    pub fn push_ignore(&mut self, frame: u32, bbox: [f64; 4]) {
        self.table.ignore.push((frame, bbox));
    }

    /// Adds a further column; its values are given with [`TrackTableBuilder::push_extra`].
    pub fn add_extra(&mut self, name: impl Into<String>) {
        self.table.extra.push((name.into(), Vec::new()));
    }

    /// Adds the value of a further column for the row pushed last.
    pub fn push_extra(&mut self, column: usize, value: &str) {
        if let Some((_, values)) = self.table.extra.get_mut(column) {
            values.push(value.to_string());
        }
    }

    /// Number of rows so far.
    pub fn n_rows(&self) -> usize {
        self.frames.len()
    }

    /// Adds a row.
    /// # Errors
    /// A box or score that is not finite; more rows than 2³² − 1.
    pub fn push(&mut self, row: &TrackRow) -> Result<()> {
        if !row.bbox.iter().all(|v| v.is_finite()) {
            return Err(Error::new(ErrorKind::Damaged, "expected finite coordinates"));
        }
        let n = self.frames.len();
        if n >= u32::MAX as usize {
            return Err(Error::new(ErrorKind::Unsupported, "more than 4 294 967 295 rows"));
        }
        self.sorted &= self.frames.last().is_none_or(|&f| f <= row.frame);
        if self.last.0 != row.id || self.last.1 == u32::MAX {
            let next = self.table.ids.len() as u32;
            let t = *self.of_id.entry(row.id).or_insert(next);
            if t == next {
                self.table.ids.push(row.id);
            }
            self.last = (row.id, t);
        }
        self.frames.push(row.frame);
        self.table.tracks.push(self.last.1);
        self.table.boxes.push(row.bbox);
        self.table.score.push(row.score, n);
        self.table.class.push(row.class, n);
        self.table.visibility.push(row.visibility, n);
        self.table.truncation.push(row.truncation, n);
        self.table.occlusion.push(row.occlusion, n);
        Ok(())
    }

    /// Sorts the rows by frame and the ids by number; the table is at least `min_frames` long.
    /// # Errors
    /// A frame number above 10⁸, which no sequence reaches and which would eat the memory.
    pub fn finish(mut self, min_frames: usize) -> Result<TrackTable> {
        let n_frames = self.frames.iter().max().map_or(0, |&f| f as usize + 1).max(min_frames);
        if n_frames > 100_000_000 {
            return Err(Error::new(ErrorKind::Damaged, format!("frame number {} is above 100 000 000", n_frames - 1))
                .at(&self.table.label)
                .hint("is the frame column really the frame?"));
        }
        let mut starts = vec![0_u32; n_frames + 1];
        for &f in &self.frames {
            starts[f as usize + 1] += 1;
        }
        for f in 0..n_frames {
            starts[f + 1] += starts[f];
        }
        let t = &mut self.table;
        if !self.sorted {
            let mut next = starts.clone();
            let mut order = vec![0_u32; self.frames.len()];
            for (i, &f) in self.frames.iter().enumerate() {
                order[next[f as usize] as usize] = i as u32;
                next[f as usize] += 1;
            }
            t.boxes = order.iter().map(|&i| t.boxes[i as usize]).collect();
            t.tracks = order.iter().map(|&i| t.tracks[i as usize]).collect();
            t.score.reorder(&order);
            t.class.reorder(&order);
            t.visibility.reorder(&order);
            t.truncation.reorder(&order);
            t.occlusion.reorder(&order);
            for (_, v) in &mut t.extra {
                *v = order.iter().map(|&i| std::mem::take(&mut v[i as usize])).collect();
            }
        }
        let mut by_id: Vec<u32> = (0..t.ids.len() as u32).collect();
        by_id.sort_unstable_by_key(|&i| t.ids[i as usize]);
        let mut rank = vec![0_u32; by_id.len()];
        for (new, &old) in by_id.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        t.ids.sort_unstable();
        for track in &mut t.tracks {
            *track = rank[*track as usize];
        }
        t.starts = starts;
        Ok(self.table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(frame: u32, id: i64, x: f64) -> TrackRow {
        TrackRow { frame, id, bbox: [x, 0.0, 1.0, 1.0], ..TrackRow::default() }
    }

    #[test]
    fn rows_in_any_order_come_out_by_frame_and_ids_ascending() {
        let rows = [row(2, 9, 1.0), row(0, 7, 2.0), row(2, -3, 3.0)];
        let t = TrackTable::from_rows("t", PixelOrigin::Pixel1, rows).unwrap();
        assert_eq!(t.ids, [-3, 7, 9]);
        assert_eq!((t.rows(0), t.rows(1), t.rows(2), t.rows(3)), (0..1, 1..1, 1..3, 0..0));
        assert_eq!(t.boxes.iter().map(|b| b[0]).collect::<Vec<_>>(), [2.0, 1.0, 3.0]);
        assert_eq!(t.tracks, [1, 2, 0]);
    }

    #[test]
    fn a_box_in_the_first_pixel_is_the_same_in_every_origin() {
        for (origin, left) in [(PixelOrigin::Centre0, -0.5), (PixelOrigin::Pixel0, 0.0), (PixelOrigin::Pixel1, 1.0)] {
            let r = TrackRow { bbox: [left, left, 1.0, 1.0], ..row(0, 1, 0.0) };
            let t = TrackTable::from_rows("t", origin, [r]).unwrap();
            assert_eq!(t.extent(0).left_px, -0.5);
        }
    }

    #[test]
    fn a_track_twice_in_a_frame_is_found_and_filtering_drops_empty_tracks() {
        let t =
            TrackTable::from_rows("t", PixelOrigin::Pixel1, [row(0, 1, 0.0), row(1, 4, 0.0), row(1, 4, 9.0)]).unwrap();
        assert_eq!(t.twice_in_a_frame(), Some((1, 4)));
        let f = t.filtered(|frame, _| frame == 1);
        assert_eq!((f.ids.as_slice(), f.n_rows(), f.n_frames()), ([4_i64].as_slice(), 2, 2));
    }
}
