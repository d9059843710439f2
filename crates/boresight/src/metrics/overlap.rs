//! Similarity of truth and result in each frame: intersection over union, or nearness of the centres.
//!
//! Source: the arithmetic (order of operations) is that of TrackEval's box and point similarity, so that ties fall as there.
//! Only pairs above 0 are kept. They are found by sorting one side by its left edge; a frame of 1000 boxes looks at a few
//! thousand pairs instead of a million.
//! Symbols: IoU = area(A ∩ B) / area(A ∪ B) in 0..=1; centre similarity = max(0, 1 − d / d₀), d in px.
//! Limits: boxes with an area of 0 or less overlap nothing.

use crate::TrackTable;

/// How alike a truth box and a result box are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Similarity {
    /// Intersection over union of the boxes.
    Iou,
    /// 1 − d / `zero_distance_px` of the centres, at least 0: with a threshold of 0.5, a match is at most half of it away.
    Centre {
        /// Distance at which the similarity is 0, px.
        zero_distance_px: f64,
    },
}

/// A pair of a frame that is alike to some degree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Truth row, from 0 in the frame.
    pub row: u32,
    /// Result row, from 0 in the frame.
    pub col: u32,
    /// Similarity, above 0, at most 1.
    pub similarity: f64,
}

/// Finds the overlaps of a frame; keeps its memory.
#[derive(Debug, Default)]
pub struct OverlapFinder {
    order: Vec<(f64, u32)>,
    boxes: Vec<[f64; 4]>,
    area: Vec<f64>,
}

const EPS: f64 = f64::EPSILON;

/// Left, top, right, bottom as TrackEval makes them of left, top, width, height.
fn corners(b: &[f64; 4]) -> [f64; 4] {
    [b[0], b[1], b[0] + b[2], b[1] + b[3]]
}

fn centre(b: &[f64; 4]) -> [f64; 2] {
    [b[0] + b[2] * 0.5, b[1] + b[3] * 0.5]
}

/// Intersection over union of two boxes (left, top, width, height), 0..=1.
#[cfg(test)]
fn iou(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let (a, b) = (corners(a), corners(b));
    iou_of_corners(&a, area(&a), &b, area(&b))
}

fn area(c: &[f64; 4]) -> f64 {
    (c[2] - c[0]) * (c[3] - c[1])
}

#[inline]
fn iou_of_corners(a: &[f64; 4], area_a: f64, b: &[f64; 4], area_b: f64) -> f64 {
    let w = (a[2].min(b[2]) - a[0].max(b[0])).max(0.0);
    let h = (a[3].min(b[3]) - a[1].max(b[1])).max(0.0);
    let intersection = w * h;
    let union = area_a + area_b - intersection;
    if intersection <= 0.0 || area_a <= EPS || area_b <= EPS || union <= EPS { 0.0 } else { intersection / union }
}

impl OverlapFinder {
    /// Appends the overlaps of a frame to `out`, by row and within a row by column.
    pub fn frame(&mut self, similarity: Similarity, truth: &[[f64; 4]], result: &[[f64; 4]], out: &mut Vec<Overlap>) {
        match similarity {
            Similarity::Iou => self.ious(truth, result, out),
            Similarity::Centre { zero_distance_px } => self.centres(zero_distance_px, truth, result, out),
        }
    }

    fn ious(&mut self, truth: &[[f64; 4]], result: &[[f64; 4]], out: &mut Vec<Overlap>) {
        if truth.is_empty() || result.is_empty() {
            return;
        }
        self.sort_by_left(result.iter().map(|b| b[0]));
        self.boxes.clear();
        self.area.clear();
        let mut widest = 0.0_f64;
        for &(_, j) in &self.order {
            let c = corners(&result[j as usize]);
            widest = widest.max(c[2] - c[0]);
            self.area.push(area(&c));
            self.boxes.push(c);
        }
        // Rounding of left + width may reach one step further than the widest box.
        let reach = widest * (1.0 + 4.0 * EPS);
        for (row, b) in truth.iter().enumerate() {
            let a = corners(b);
            let area_a = area(&a);
            if area_a <= EPS {
                continue;
            }
            let begin = self.order.partition_point(|&(left, _)| left < a[0] - reach);
            let from = out.len();
            for k in begin..self.order.len() {
                let c = &self.boxes[k];
                if c[0] >= a[2] {
                    break;
                }
                let similarity = iou_of_corners(&a, area_a, c, self.area[k]);
                if similarity > 0.0 {
                    out.push(Overlap { row: row as u32, col: self.order[k].1, similarity });
                }
            }
            out[from..].sort_unstable_by_key(|o| o.col);
        }
    }

    fn centres(&mut self, zero: f64, truth: &[[f64; 4]], result: &[[f64; 4]], out: &mut Vec<Overlap>) {
        self.sort_by_left(result.iter().map(|b| centre(b)[0]));
        for (row, b) in truth.iter().enumerate() {
            let a = centre(b);
            let begin = self.order.partition_point(|&(x, _)| x < a[0] - zero);
            let from = out.len();
            for &(x, col) in &self.order[begin..] {
                if x > a[0] + zero {
                    break;
                }
                let c = centre(&result[col as usize]);
                let (dx, dy) = (a[0] - c[0], a[1] - c[1]);
                let similarity = 1.0 - (dx * dx + dy * dy).sqrt() / zero;
                if similarity > 0.0 {
                    out.push(Overlap { row: row as u32, col, similarity });
                }
            }
            out[from..].sort_unstable_by_key(|o| o.col);
        }
    }

    fn sort_by_left(&mut self, lefts: impl Iterator<Item = f64>) {
        self.order.clear();
        self.order.extend(lefts.enumerate().map(|(j, x)| (x, j as u32)));
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
}

/// The boxes of a frame's rows.
pub fn frame_boxes(table: &TrackTable, frame: usize) -> &[[f64; 4]] {
    &table.boxes[table.rows(frame)]
}

/// The tracks of a frame's rows.
pub fn frame_tracks(table: &TrackTable, frame: usize) -> &[u32] {
    &table.tracks[table.rows(frame)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sorting_finds_the_same_overlaps_as_trying_all_pairs(
            a in proptest::collection::vec(proptest::array::uniform4(-20_i32..40), 0..12),
            b in proptest::collection::vec(proptest::array::uniform4(-20_i32..40), 0..12),
        ) {
            let real = |v: &Vec<[i32; 4]>| v.iter().map(|q| q.map(|x| f64::from(x) * 0.7)).collect::<Vec<_>>();
            let (a, b) = (real(&a), real(&b));
            let mut out = Vec::new();
            OverlapFinder::default().frame(Similarity::Iou, &a, &b, &mut out);
            let mut all = Vec::new();
            for (i, p) in a.iter().enumerate() {
                for (j, q) in b.iter().enumerate() {
                    if iou(p, q) > 0.0 {
                        all.push(Overlap { row: i as u32, col: j as u32, similarity: iou(p, q) });
                    }
                }
            }
            prop_assert_eq!(out, all);
        }
    }

    #[test]
    fn half_overlapping_unit_boxes_have_an_iou_of_a_third() {
        assert!((iou(&[0.0, 0.0, 2.0, 1.0], &[1.0, 0.0, 2.0, 1.0]) - 1.0 / 3.0).abs() < 1e-15);
        assert_eq!(iou(&[0.0, 0.0, 0.0, 1.0], &[0.0, 0.0, 2.0, 1.0]), 0.0);
    }

    #[test]
    fn centres_half_the_zero_distance_apart_are_half_alike() {
        let mut out = Vec::new();
        let s = Similarity::Centre { zero_distance_px: 10.0 };
        OverlapFinder::default().frame(
            s,
            &[[0.0, 0.0, 2.0, 2.0]],
            &[[3.0, 4.0, 2.0, 2.0], [50.0, 0.0, 1.0, 1.0]],
            &mut out,
        );
        assert_eq!(out, [Overlap { row: 0, col: 0, similarity: 0.5 }]);
    }
}
