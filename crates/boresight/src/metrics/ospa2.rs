//! OSPA(2): the distance between two sets of tracks over a window, which also feels labels and fragments.
//!
//! Source: M. Beard, B.-T. Vo, B.-N. Vo, *OSPA(2): using the OSPA metric to evaluate multi-target tracking performance*,
//! ICCAIS 2017. Two tracks are as far apart as the q-mean over the frames in which either exists of min(d, c), or c where
//! only one exists; the sets of tracks are compared by OSPA with these distances.
//! Symbols: c cutoff, px; p order over tracks; q order over time; window w frames.
//! Limits: weights over time are equal.

use super::near::{each_near_pair, rows_of_tracks, shared_frames};
use super::pairs::PairIndex;
use super::set::SetOptions;
use crate::associate::assignment::matching::{Matcher, WeightedPair};
use crate::{Result, TrackTable};

/// OSPA(2) of two tables over frames `from..to`, px; 0 if neither has a track there. `time_order` is q.
/// # Errors
/// Options out of range.
pub fn ospa2(
    truth: &TrackTable,
    result: &TrackTable,
    from: usize,
    to: usize,
    options: &SetOptions,
    time_order: f64,
) -> Result<f64> {
    options.validate("ospa2")?;
    let (c, p, q) = (options.cutoff_px, options.order, time_order);
    let frames = from..to.min(truth.n_frames().max(result.n_frames()));
    let (n_t, n_r) = (rows_of_tracks(truth, frames.clone()), rows_of_tracks(result, frames.clone()));
    let mut index = PairIndex::default();
    let mut sum = Vec::<f64>::new();
    // First the pairs that are ever nearer than c, then for these the frames they share.
    each_near_pair(truth, result, frames.clone(), c, |n| {
        let i = index.number(n.truth, n.result) as usize;
        if i == sum.len() {
            sum.push(0.0);
        }
        // The gain over "only one exists": d instead of c, in a frame that would count for both.
        sum[i] += c.powf(q) - n.distance_px.powf(q);
    });
    let shared = shared_frames(truth, result, frames, &index);
    let (n, m) = (n_t.iter().filter(|n| **n > 0).count(), n_r.iter().filter(|n| **n > 0).count());
    let most = n.max(m);
    if most == 0 {
        return Ok(0.0);
    }
    let mut pairs: Vec<(WeightedPair, f64)> = Vec::new();
    for (k, &(t, r)) in index.pairs().iter().enumerate() {
        let frames = f64::from(n_t[t as usize] + n_r[r as usize] - shared[k]);
        let d = (c.powf(q) - sum[k] / frames).max(0.0).powf(p / q);
        pairs.push((WeightedPair { row: t, column: r, weight: c.powf(p) - d }, d));
    }
    pairs.retain(|x| x.0.weight > 0.0);
    pairs.sort_by_key(|x| (x.0.row, x.0.column));
    let only: Vec<WeightedPair> = pairs.iter().map(|x| x.0).collect();
    let mut taken = Vec::new();
    Matcher::default().solve_any(truth.n_tracks(), result.n_tracks(), &only, &mut taken);
    let matched: f64 = taken.iter().map(|&k| pairs[k as usize].1).sum();
    let rest = (most - taken.len()) as f64 * c.powf(p);
    Ok(((matched + rest) / most as f64).powf(1.0 / p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    fn table(rows: &[(u32, i64, f64)]) -> TrackTable {
        let row = |&(frame, id, x): &_| TrackRow { frame, id, bbox: [x, 0.0, 0.0, 0.0], ..TrackRow::default() };
        TrackTable::from_rows("t", PixelOrigin::Centre0, rows.iter().map(row)).unwrap()
    }

    #[test]
    fn a_track_cut_in_two_costs_more_than_one_with_a_small_error() {
        let o = SetOptions { cutoff_px: 10.0, order: 1.0, ..SetOptions::default() };
        let truth = table(&[(0, 1, 0.0), (1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)]);
        let whole = table(&[(0, 1, 1.0), (1, 1, 1.0), (2, 1, 1.0), (3, 1, 1.0)]);
        let cut = table(&[(0, 1, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 2, 1.0)]);
        assert!((ospa2(&truth, &whole, 0, 4, &o, 1.0).unwrap() - 1.0).abs() < 1e-12);
        // One half is matched at (1 + 1 + 10 + 10) / 4 = 5.5, the other is 10 away: mean 7.75.
        assert!((ospa2(&truth, &cut, 0, 4, &o, 1.0).unwrap() - 7.75).abs() < 1e-12);
    }

    #[test]
    fn it_is_a_metric_between_two_tables_either_way_round() {
        let o = SetOptions { cutoff_px: 5.0, ..SetOptions::default() };
        let a = table(&[(0, 1, 0.0), (1, 1, 2.0), (1, 2, 9.0)]);
        let b = table(&[(0, 7, 1.0), (2, 8, 9.0)]);
        assert_eq!(ospa2(&a, &a, 0, 3, &o, 2.0).unwrap(), 0.0);
        let (ab, ba) = (ospa2(&a, &b, 0, 3, &o, 2.0).unwrap(), ospa2(&b, &a, 0, 3, &o, 2.0).unwrap());
        assert!((ab - ba).abs() < 1e-12 && ab > 0.0);
    }
}
