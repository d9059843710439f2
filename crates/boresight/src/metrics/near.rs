//! Centres of rows, and the pairs of a truth's and a result's rows that are nearer than a cutoff, frame by frame.
//!
//! Method: a frame's result rows are sorted by x once, so that each truth row looks only at its neighbours in x.
//! Symbols: d distance of the centres, px.

use super::pairs::PairIndex;
use crate::TrackTable;
use std::ops::Range;

/// Centre of a row in boresight's coordinates, px; a point itself.
pub(crate) fn centre(table: &TrackTable, row: usize) -> [f64; 2] {
    let e = table.extent(row);
    [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0]
}

/// A truth row and a result row of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NearPair {
    pub frame: usize,
    /// Track of the truth row.
    pub truth: u32,
    /// Track of the result row.
    pub result: u32,
    /// Distance of the centres, px.
    pub distance_px: f64,
}

/// Calls `each` for every pair nearer than `cutoff_px`: by frame, by truth row, by x of the result row.
pub(super) fn each_near_pair(
    truth: &TrackTable,
    result: &TrackTable,
    frames: Range<usize>,
    cutoff_px: f64,
    mut each: impl FnMut(NearPair),
) {
    let mut by_x: Vec<([f64; 2], u32)> = Vec::new();
    for frame in frames.start..frames.end.min(truth.n_frames()).min(result.n_frames()) {
        by_x.clear();
        by_x.extend(result.rows(frame).map(|r| (centre(result, r), result.tracks[r])));
        by_x.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        for row in truth.rows(frame) {
            let a = centre(truth, row);
            let begin = by_x.partition_point(|n| n.0[0] <= a[0] - cutoff_px);
            for (b, track) in by_x[begin..].iter().take_while(|n| n.0[0] < a[0] + cutoff_px) {
                let distance_px = (a[0] - b[0]).hypot(a[1] - b[1]);
                if distance_px < cutoff_px {
                    each(NearPair { frame, truth: truth.tracks[row], result: *track, distance_px });
                }
            }
        }
    }
}

/// Number of rows of each track in the frames.
pub(super) fn rows_of_tracks(table: &TrackTable, frames: Range<usize>) -> Vec<u32> {
    let mut n = vec![0; table.n_tracks()];
    for frame in frames {
        table.rows(frame).for_each(|r| n[table.tracks[r] as usize] += 1);
    }
    n
}

/// In how many of the frames both tracks of each pair have a row.
pub(super) fn shared_frames(
    truth: &TrackTable,
    result: &TrackTable,
    frames: Range<usize>,
    index: &PairIndex,
) -> Vec<u32> {
    let mut partners: Vec<Vec<(u32, u32)>> = vec![Vec::new(); truth.n_tracks()];
    for (k, &(t, r)) in index.pairs().iter().enumerate() {
        partners[t as usize].push((r, k as u32));
    }
    let mut here = vec![false; result.n_tracks()];
    let mut shared = vec![0; index.pairs().len()];
    for frame in frames.start..frames.end.min(truth.n_frames()).min(result.n_frames()) {
        result.rows(frame).for_each(|r| here[result.tracks[r] as usize] = true);
        for r in truth.rows(frame) {
            for &(p, k) in &partners[truth.tracks[r] as usize] {
                shared[k as usize] += u32::from(here[p as usize]);
            }
        }
        result.rows(frame).for_each(|r| here[result.tracks[r] as usize] = false);
    }
    shared
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, f64, f64)]) -> TrackTable {
        let row = |&(frame, id, x, y): &_| TrackRow { frame, id, bbox: [x, y, 0.0, 0.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn the_pairs_are_those_of_a_double_loop_and_the_cutoff_itself_is_too_far() {
        let place = |k: u32| (f64::from(k * 7 % 13), f64::from(k * 5 % 11));
        let rows: Vec<_> = (0..60).map(|k| (k / 12, i64::from(k % 12), place(k).0, place(k).1)).collect();
        let others: Vec<_> = (0..60).map(|k| (k / 12, i64::from(k % 12), place(k + 3).0, place(k + 5).1)).collect();
        let (t, r) = (table(&rows), table(&others));
        // 3-4-5 triangles on the grid of whole pixels put pairs at exactly 5 px.
        let mut found = Vec::new();
        each_near_pair(&t, &r, 1..4, 5.0, |n| found.push((n.frame as u32, n.truth, n.result)));
        let mut all = Vec::new();
        for a in &rows {
            for b in &others {
                if a.0 == b.0 && (1..4).contains(&a.0) && (a.2 - b.2).powi(2) + (a.3 - b.3).powi(2) < 25.0 {
                    all.push((a.0, a.1 as u32, b.1 as u32));
                }
            }
        }
        assert!(found.is_sorted_by_key(|f| (f.0, f.1)));
        found.sort_unstable();
        assert!(all.len() > 50);
        assert_eq!(found, all);
    }

    #[test]
    fn shared_frames_count_those_where_both_tracks_stand() {
        let t = table(&[(0, 1, 0.0, 0.0), (1, 1, 0.0, 0.0), (2, 1, 0.0, 0.0), (2, 2, 9.0, 0.0)]);
        let r = table(&[(0, 7, 0.0, 0.0), (2, 7, 0.0, 0.0), (3, 7, 0.0, 0.0)]);
        let mut index = PairIndex::default();
        index.number(0, 0);
        index.number(1, 0);
        assert_eq!(shared_frames(&t, &r, 0..4, &index), [2, 1]);
        assert_eq!(shared_frames(&t, &r, 1..2, &index), [0, 0]);
    }
}
