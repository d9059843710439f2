//! OSPA(2): the distance between two sets of tracks over a window, which also feels labels and fragments.
//!
//! Source: M. Beard, B.-T. Vo, B.-N. Vo, *OSPA(2): using the OSPA metric to evaluate multi-target tracking performance*,
//! ICCAIS 2017. Two tracks are as far apart as the q-mean over the frames in which either exists of min(d, c), or c where
//! only one exists; the sets of tracks are compared by OSPA with these distances.
//! Symbols: c cutoff, px; p order over tracks; q order over time; window w frames.
//! Limits: weights over time are equal.

use super::assignment::{Matcher, Pair};
use super::pairs::PairIndex;
use super::set::SetOptions;
use crate::{Result, TrackTable};

fn centre(table: &TrackTable, row: usize) -> [f64; 2] {
    let e = table.extent(row);
    [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0]
}

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
    let (mut n_t, mut n_r) = (vec![0_u32; truth.n_tracks()], vec![0_u32; result.n_tracks()]);
    let mut index = PairIndex::default();
    let (mut both, mut sum) = (Vec::<u32>::new(), Vec::<f64>::new());
    // First the pairs that are ever nearer than c, then for these the frames they share.
    let mut near: Vec<(f64, u32, [f64; 2])> = Vec::new();
    for frame in from..to.min(truth.n_frames().max(result.n_frames())) {
        near.clear();
        near.extend(result.rows(frame).map(|r| (centre(result, r)[0], result.tracks[r], centre(result, r))));
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.iter().for_each(|n| n_r[n.1 as usize] += 1);
        for r in truth.rows(frame) {
            let (t, a) = (truth.tracks[r], centre(truth, r));
            n_t[t as usize] += 1;
            let begin = near.partition_point(|n| n.0 <= a[0] - c);
            for (_, k, b) in near[begin..].iter().take_while(|n| n.0 < a[0] + c) {
                let d = (a[0] - b[0]).hypot(a[1] - b[1]);
                if d < c {
                    let i = index.number(t, *k) as usize;
                    if i == sum.len() {
                        sum.push(0.0);
                        both.push(0);
                    }
                    // The gain over "only one exists": d instead of c, in a frame that would count for both.
                    sum[i] += c.powf(q) - d.powf(q);
                    both[i] += 1;
                }
            }
        }
    }
    let shared = frames_shared(truth, result, from, to, &index);
    let (n, m) = (n_t.iter().filter(|n| **n > 0).count(), n_r.iter().filter(|n| **n > 0).count());
    let most = n.max(m);
    if most == 0 {
        return Ok(0.0);
    }
    let mut pairs: Vec<(Pair, f64)> = Vec::new();
    for (k, &(t, r)) in index.pairs().iter().enumerate() {
        let frames = f64::from(n_t[t as usize] + n_r[r as usize] - shared[k]);
        let d = (c.powf(q) - sum[k] / frames).max(0.0).powf(p / q);
        pairs.push((Pair { row: t, col: r, weight: c.powf(p) - d }, d));
    }
    pairs.retain(|x| x.0.weight > 0.0);
    pairs.sort_by_key(|x| (x.0.row, x.0.col));
    let only: Vec<Pair> = pairs.iter().map(|x| x.0).collect();
    let mut taken = Vec::new();
    Matcher::default().solve_any(truth.n_tracks(), result.n_tracks(), &only, &mut taken);
    let matched: f64 = taken.iter().map(|&k| pairs[k as usize].1).sum();
    let rest = (most - taken.len()) as f64 * c.powf(p);
    Ok(((matched + rest) / most as f64).powf(1.0 / p))
}

/// In how many frames of the window both tracks of each pair exist.
fn frames_shared(truth: &TrackTable, result: &TrackTable, from: usize, to: usize, index: &PairIndex) -> Vec<u32> {
    let mut partners: Vec<Vec<(u32, u32)>> = vec![Vec::new(); truth.n_tracks()];
    for (k, &(t, r)) in index.pairs().iter().enumerate() {
        partners[t as usize].push((r, k as u32));
    }
    let mut here = vec![false; result.n_tracks()];
    let mut shared = vec![0; index.pairs().len()];
    for frame in from..to.min(truth.n_frames().max(result.n_frames())) {
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
