//! How good are the detections alone: recall, precision, false alarms per frame, megapixel and hour, bias and scatter.
//!
//! Source: the usual definitions; matching frame by frame as in CLEAR without memory: pairs from the threshold on, greatest
//! sum of similarities. The operating curve repeats this for rows of at least each score; the average precision is the
//! area under precision over recall, each precision raised to the best at the same or a higher recall (PASCAL VOC 2010).
//! Symbols: bias mean of (result − truth) of the centres, px; scatter standard deviation about the bias, px.

use super::MatchOptions;
use super::overlap::{OverlapFinder, frame_boxes};
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::{Result, TrackTable};
use serde::Serialize;

/// Detection measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DetectionScores {
    /// Matched pairs.
    pub tp: u64,
    /// Misses.
    pub fn_: u64,
    /// False alarms.
    pub fp: u64,
    /// Frames.
    pub frames: u64,
    /// Mean of result − truth, px.
    pub bias_px: [f64; 2],
    /// Standard deviation about the bias, px.
    pub scatter_px: [f64; 2],
}

impl DetectionScores {
    /// Share of the truths found.
    pub fn recall(&self) -> f64 {
        self.tp as f64 / ((self.tp + self.fn_) as f64).max(1.0)
    }
    /// Share of the results that are true.
    pub fn precision(&self) -> f64 {
        self.tp as f64 / ((self.tp + self.fp) as f64).max(1.0)
    }
    /// False alarms per frame.
    pub fn fp_per_frame(&self) -> f64 {
        self.fp as f64 / (self.frames as f64).max(1.0)
    }
    /// False alarms per megapixel looked at, for frames of this size.
    pub fn fp_per_megapixel(&self, width_px: f64, height_px: f64) -> f64 {
        self.fp_per_frame() / (width_px * height_px * 1e-6)
    }
    /// False alarms per hour at this frame rate.
    pub fn fp_per_hour(&self, rate_hz: f64) -> f64 {
        self.fp_per_frame() * rate_hz * 3600.0
    }
}

/// One point of the operating curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OperatingPoint {
    /// Rows of at least this score count.
    pub score: f64,
    /// Recall.
    pub recall: f64,
    /// Precision.
    pub precision: f64,
    /// False alarms per frame.
    pub fp_per_frame: f64,
}

/// Matches frame by frame and calls `each(truth row, result row)`.
pub fn match_rows(truth: &TrackTable, result: &TrackTable, options: &MatchOptions, mut each: impl FnMut(usize, usize)) {
    let (mut finder, mut matcher) = (OverlapFinder::default(), Matcher::default());
    let (mut overlaps, mut pairs, mut taken) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..truth.n_frames().min(result.n_frames()) {
        overlaps.clear();
        finder.frame(options.similarity, frame_boxes(truth, frame), frame_boxes(result, frame), &mut overlaps);
        pairs.clear();
        let good = overlaps.iter().filter(|o| o.similarity >= options.threshold - f64::EPSILON);
        pairs.extend(good.map(|o| WeightedPair { row: o.row, column: o.col, weight: o.similarity }));
        let (t, r) = (truth.rows(frame), result.rows(frame));
        matcher.solve_any(t.len(), r.len(), &pairs, &mut taken);
        for &k in &taken {
            each(t.start + pairs[k as usize].row as usize, r.start + pairs[k as usize].column as usize);
        }
    }
}

/// Computes the detection measures.
pub fn detection(truth: &TrackTable, result: &TrackTable, options: &MatchOptions) -> DetectionScores {
    let (mut n, mut sum, mut sum2) = (0_u64, [0.0; 2], [0.0; 2]);
    match_rows(truth, result, options, |t, r| {
        let (a, b) = (&truth.boxes[t], &result.boxes[r]);
        n += 1;
        for k in 0..2 {
            let d = (b[k] + b[k + 2] / 2.0) - (a[k] + a[k + 2] / 2.0);
            sum[k] += d;
            sum2[k] += d * d;
        }
    });
    let count = (n as f64).max(1.0);
    let bias = sum.map(|s| s / count);
    DetectionScores {
        tp: n,
        fn_: truth.n_rows() as u64 - n,
        fp: result.n_rows() as u64 - n,
        frames: truth.n_frames().max(result.n_frames()) as u64,
        bias_px: bias,
        scatter_px: std::array::from_fn(|k| (sum2[k] / count - bias[k] * bias[k]).max(0.0).sqrt()),
    }
}

/// The operating curve over the score at up to `n_points` levels, from strict to lax, and its average precision.
/// # Errors
/// None at present; a score column that is constant gives one point.
pub fn operating_curve(
    truth: &TrackTable,
    result: &TrackTable,
    options: &MatchOptions,
    n_points: usize,
) -> Result<(Vec<OperatingPoint>, f64)> {
    let mut scores: Vec<f64> = (0..result.n_rows()).map(|r| result.score.get(r)).collect();
    scores.sort_by(|a, b| b.total_cmp(a));
    scores.dedup();
    let n = n_points.max(1).min(scores.len());
    let mut curve = Vec::with_capacity(n);
    for k in 0..n {
        let level = scores[((k + 1) * scores.len() / n).saturating_sub(1)];
        let kept = result.filtered(|_, r| result.score.get(r) >= level);
        let d = detection(truth, &kept, options);
        curve.push(OperatingPoint {
            score: level,
            recall: d.recall(),
            precision: d.precision(),
            fp_per_frame: d.fp_per_frame(),
        });
    }
    let (mut area, mut best, mut right) = (0.0, 0.0_f64, curve.last().map_or(0.0, |p: &OperatingPoint| p.recall));
    for (k, p) in curve.iter().enumerate().rev() {
        best = best.max(p.precision);
        let left = if k == 0 { 0.0 } else { curve[k - 1].recall };
        area += (right - left).max(0.0) * best;
        right = left.min(right);
    }
    Ok((curve, area))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, f64, f64)]) -> TrackTable {
        let mut id = 0;
        let row = |&(frame, x, score): &(u32, f64, f64)| {
            id += 1;
            TrackRow { frame, id, bbox: [x, 0.0, 10.0, 10.0], score, ..TrackRow::default() }
        };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn a_shift_shows_as_bias_without_scatter() {
        let truth = table(&[(0, 0.0, 1.0), (1, 50.0, 1.0)]);
        let result = table(&[(0, 2.0, 0.9), (1, 52.0, 0.8), (1, 300.0, 0.7)]);
        let d = detection(&truth, &result, &MatchOptions::default());
        assert_eq!((d.tp, d.fn_, d.fp, d.bias_px, d.scatter_px), (2, 0, 1, [2.0, 0.0], [0.0, 0.0]));
        assert_eq!((d.fp_per_frame(), d.fp_per_hour(10.0), d.fp_per_megapixel(1000.0, 500.0)), (0.5, 18000.0, 1.0));
    }

    #[test]
    fn the_curve_goes_from_strict_to_lax_and_its_area_is_one_for_a_perfect_order() {
        let truth = table(&[(0, 0.0, 1.0), (1, 50.0, 1.0)]);
        let result = table(&[(0, 2.0, 0.9), (1, 52.0, 0.8), (1, 300.0, 0.7)]);
        let (c, ap) = operating_curve(&truth, &result, &MatchOptions::default(), 10).unwrap();
        assert_eq!(c.iter().map(|p| p.recall).collect::<Vec<_>>(), [0.5, 1.0, 1.0]);
        assert_eq!((c[2].precision, ap), (2.0 / 3.0, 1.0));
    }
}
