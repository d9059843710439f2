//! A table of tracks: which track stood where in which frame; what evaluation reads and what the formats convert.
//!
//! Coordinates stay as the file holds them (a subtraction would change the last bits of an overlap and so break ties
//! differently from the official kits); [`PixelOrigin`] says how to get to boresight's own pixel coordinates.
//! Columns that hold one value throughout take no memory: a million rows of boxes fit into 36 MB.

use super::column::Column;
use super::row::{PixelOrigin, TrackRow};
use super::state::StateColumns;
use crate::Extent;
use crate::length_unit::LengthUnit;
use std::ops::Range;

/// Tracks as a table, its rows in the order of their frames.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackTable {
    /// Where the table comes from, for messages.
    pub label: String,
    /// What the coordinates count from.
    pub origin: PixelOrigin,
    /// What they are counted in.
    pub unit: LengthUnit,
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
    /// Names of the classes 1, 2 .. where the table names them; empty where it has numbers.
    pub class_names: Vec<String>,
    /// Visible share.
    pub visibility: Column<f64>,
    /// Truncation.
    pub truncation: Column<f64>,
    /// Occlusion.
    pub occlusion: Column<i32>,
    /// Regions in which unmatched results do not count (KITTI's DontCare): frame and box.
    pub ignore: Vec<(u32, [f64; 4])>,
    /// Width and height of the frames, px, where they are known; no file of tracks tells them.
    pub size_px: Option<[u32; 2]>,
    /// Times, status, velocities and covariances, where the table has them.
    pub states: StateColumns,
    /// Further columns by name, as text, one value a row; read only where asked for.
    pub extra: Vec<(String, Vec<String>)>,
    pub(super) starts: Vec<u32>,
}

impl TrackTable {
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
            unit: self.unit,
            is_points: self.is_points,
            boxes: rows.iter().map(|&r| self.boxes[r as usize]).collect(),
            tracks: rows.iter().map(|&r| new_of[self.tracks[r as usize] as usize]).collect(),
            ids,
            score: self.score.clone(),
            class: self.class.clone(),
            class_names: self.class_names.clone(),
            visibility: self.visibility.clone(),
            truncation: self.truncation.clone(),
            occlusion: self.occlusion.clone(),
            ignore: self.ignore.clone(),
            size_px: self.size_px,
            states: self.states.clone(),
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
        out.states.reorder(&rows);
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
