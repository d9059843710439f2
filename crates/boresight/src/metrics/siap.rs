//! SIAP: completeness, ambiguity, spuriousness, accuracy and continuity of an air picture.
//!
//! Source: P. Votruba et al., *Single integrated air picture (SIAP) metrics implementation*, SIAP SE TF TR 2001-001, as
//! Stone Soup computes it. All follows from associations: a track is said to be of a truth from one frame to another.
//! Symbols: J truths, JT truths associated, N tracks, NA tracks associated, each summed over the frames; C = JT / J;
//! A = NA / JT (1 is best); S = (N − NA) / N; PA, VA mean position and velocity errors of the associations;
//! R = Σ (tracks needed − 1) / Σ time tracked, 1/s; LS = Σ longest association / Σ lifetime of the truths.
//! Limits: the count of tracks needed is Stone Soup's greedy one, with its end where an association ends in the frame it
//! is met.

use super::overlap::frame_boxes;
use crate::TrackTable;
use serde::Serialize;

/// A track is of a truth from frame `first` to frame `last`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Association {
    /// The truth, an index into its table's ids.
    pub truth: u32,
    /// The track, an index into its table's ids.
    pub track: u32,
    /// First frame.
    pub first: u32,
    /// Last frame.
    pub last: u32,
}

/// The SIAP measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Siap {
    /// Share of the truths that are tracked, 0..=1.
    pub completeness: f64,
    /// Tracks per tracked truth; 1 is best.
    pub ambiguity: f64,
    /// Share of the tracks that belong to no truth, 0..=1.
    pub spuriousness: f64,
    /// Mean position error of the associations, px.
    pub position_accuracy: f64,
    /// Mean velocity error of the associations, px/s; 0 where velocities are not known.
    pub velocity_accuracy: f64,
    /// Track number changes per second tracked, 1/s.
    pub rate_of_track_number_change: f64,
    /// Longest association as a share of the truth's life, over all truths.
    pub longest_track_segment: f64,
}

/// Associates every track in every frame with the nearest truth at most `max_distance_px` away; runs of frames with the
/// same truth become associations. `point` says which point of a box counts.
pub fn nearest_associations(
    truth: &TrackTable,
    result: &TrackTable,
    max_distance_px: f64,
    point: fn(&[f64; 4]) -> [f64; 2],
) -> Vec<Association> {
    let mut open: Vec<Option<Association>> = vec![None; result.n_tracks()];
    let mut out = Vec::new();
    for frame in 0..truth.n_frames().min(result.n_frames()) {
        let truths = truth.rows(frame);
        for r in result.rows(frame) {
            let p = point(&result.boxes[r]);
            let mut best: Option<(f64, u32)> = None;
            for (k, b) in frame_boxes(truth, frame).iter().enumerate() {
                let q = point(b);
                let d = (p[0] - q[0]).hypot(p[1] - q[1]);
                if d <= max_distance_px && best.is_none_or(|(least, _)| d < least) {
                    best = Some((d, truth.tracks[truths.start + k]));
                }
            }
            let Some((_, t)) = best else { continue };
            let (track, frame) = (result.tracks[r], frame as u32);
            match &mut open[track as usize] {
                Some(a) if a.last + 1 == frame && a.truth == t => a.last = frame,
                slot => {
                    out.extend(slot.take());
                    *slot = Some(Association { truth: t, track, first: frame, last: frame });
                }
            }
        }
    }
    out.extend(open.into_iter().flatten());
    out.sort_unstable_by_key(|a| (a.first, a.last, a.truth, a.track));
    out
}

fn quotient(a: f64, b: f64, if_none: f64) -> f64 {
    if b == 0.0 { if_none } else { a / b }
}

/// Computes the SIAP measures from associations. `dt_s` is the time between frames, s; `errors(truth row, result row)`
/// gives the position and the velocity error of an association in one frame.
pub fn siap(
    truth: &TrackTable,
    result: &TrackTable,
    associations: &[Association],
    dt_s: f64,
    errors: impl Fn(usize, usize) -> (f64, f64),
) -> Siap {
    let n_frames = truth.n_frames().max(result.n_frames());
    let mut begins: Vec<Vec<u32>> = vec![Vec::new(); n_frames];
    for (k, a) in associations.iter().enumerate() {
        if let Some(b) = begins.get_mut(a.first as usize) {
            b.push(k as u32);
        }
    }
    let (mut jt, mut na, mut pa, mut va) = (0_u64, 0_u64, 0.0, 0.0);
    let mut active: Vec<u32> = Vec::new();
    let mut truth_row = vec![usize::MAX; truth.n_tracks()];
    let mut track_row = vec![usize::MAX; result.n_tracks()];
    let (mut truth_seen, mut track_seen) = (vec![u32::MAX; truth.n_tracks()], vec![u32::MAX; result.n_tracks()]);
    for frame in 0..n_frames {
        active.retain(|&k| associations[k as usize].last as usize >= frame);
        active.append(&mut begins[frame]);
        for r in truth.rows(frame) {
            truth_row[truth.tracks[r] as usize] = r;
        }
        for r in result.rows(frame) {
            track_row[result.tracks[r] as usize] = r;
        }
        for &k in &active {
            let a = associations[k as usize];
            jt += u64::from(std::mem::replace(&mut truth_seen[a.truth as usize], frame as u32) != frame as u32);
            na += u64::from(std::mem::replace(&mut track_seen[a.track as usize], frame as u32) != frame as u32);
            let (t, r) = (truth_row[a.truth as usize], track_row[a.track as usize]);
            if t != usize::MAX && r != usize::MAX {
                let (p, v) = errors(t, r);
                pa += p;
                va += v;
            }
        }
        for r in truth.rows(frame) {
            truth_row[truth.tracks[r] as usize] = usize::MAX;
        }
        for r in result.rows(frame) {
            track_row[result.tracks[r] as usize] = usize::MAX;
        }
    }
    let c = continuity(truth, associations, dt_s);
    let (j, n) = (truth.n_rows() as f64, result.n_rows() as f64);
    let (jt, na) = (jt as f64, na as f64);
    Siap {
        completeness: quotient(jt, j, 0.0),
        ambiguity: quotient(na, jt, 1.0),
        spuriousness: quotient(n - na, n, 0.0),
        position_accuracy: quotient(pa, na, 0.0),
        velocity_accuracy: quotient(va, na, 0.0),
        rate_of_track_number_change: quotient(c.changes, c.tracked_s, 0.0),
        longest_track_segment: quotient(c.longest_s, c.lifetime_s, 0.0),
    }
}

#[derive(Default)]
struct Continuity {
    changes: f64,
    tracked_s: f64,
    longest_s: f64,
    lifetime_s: f64,
}

fn continuity(truth: &TrackTable, associations: &[Association], dt_s: f64) -> Continuity {
    let mut frames: Vec<Vec<u32>> = vec![Vec::new(); truth.n_tracks()];
    for frame in 0..truth.n_frames() {
        for r in truth.rows(frame) {
            frames[truth.tracks[r] as usize].push(frame as u32);
        }
    }
    let mut of_truth: Vec<Vec<Association>> = vec![Vec::new(); truth.n_tracks()];
    for a in associations {
        of_truth[a.truth as usize].push(*a);
    }
    let mut c = Continuity::default();
    for (frames, own) in frames.iter().zip(&mut of_truth) {
        let (Some(&born), Some(&dies)) = (frames.first(), frames.last()) else { continue };
        c.lifetime_s += f64::from(dies - born) * dt_s;
        // All the time that one track was on this truth counts together, as Stone Soup joins its time ranges.
        own.sort_unstable_by_key(|a| (a.track, a.first));
        let on_truth =
            own.chunk_by(|a, b| a.track == b.track).map(|all| all.iter().map(|a| a.last - a.first).sum::<u32>());
        c.longest_s += f64::from(on_truth.max().unwrap_or(0)) * dt_s;
        c.tracked_s += f64::from(covered(own, born, dies)) * dt_s;
        let ends: Vec<(u32, u32)> = own
            .chunk_by(|a, b| a.track == b.track)
            .map(|all| (all[0].track, all.iter().map(|a| a.last).max().unwrap_or(0)))
            .collect();
        let end_of = |track: u32| ends.binary_search_by_key(&track, |e| e.0).map_or(0, |k| ends[k].1);
        own.sort_by_key(|a| std::cmp::Reverse(end_of(a.track)));
        let needed = tracks_needed(frames, own);
        c.changes += f64::from(needed.saturating_sub(1));
    }
    c
}

/// Length of the union of the associations within the truth's life, frames.
fn covered(own: &[Association], born: u32, dies: u32) -> u32 {
    let mut spans: Vec<(u32, u32)> = own.iter().map(|a| (a.first.max(born), a.last.min(dies))).collect();
    spans.sort_unstable();
    let (mut sum, mut reached) = (0, born);
    for (first, last) in spans {
        sum += last.saturating_sub(first.max(reached));
        reached = reached.max(last);
    }
    sum
}

/// Greedy: in each frame the association of the track that is on the truth latest; `own` is sorted so.
fn tracks_needed(frames: &[u32], own: &[Association]) -> u32 {
    let (mut n, mut k) = (0, 0);
    while let Some(&now) = frames.get(k) {
        match own.iter().find(|a| a.first <= now && now <= a.last) {
            None => k += 1,
            Some(a) => {
                n += 1;
                match frames[k + 1..].binary_search(&a.last) {
                    Ok(p) => k += p + 2,
                    Err(_) => break,
                }
            }
        }
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    #[test]
    fn one_track_of_two_truths_for_half_the_time() {
        let row = |frame, id, x| TrackRow { frame, id, bbox: [x, 0.0, 0.0, 0.0], ..TrackRow::default() };
        let truth = (0..4).flat_map(|f| [row(f, 1, 0.0), row(f, 2, 100.0)]);
        let truth = TrackTable::from_rows("t", PixelOrigin::Centre0, truth).unwrap();
        let result = TrackTable::from_rows("r", PixelOrigin::Centre0, (0..2).map(|f| row(f, 9, 3.0))).unwrap();
        let a = nearest_associations(&truth, &result, 5.0, |b| [b[0], b[1]]);
        assert_eq!(a, [Association { truth: 0, track: 0, first: 0, last: 1 }]);
        let s = siap(&truth, &result, &a, 0.5, |t, r| ((truth.boxes[t][0] - result.boxes[r][0]).abs(), 0.0));
        assert_eq!((s.completeness, s.ambiguity, s.spuriousness, s.position_accuracy), (0.25, 1.0, 0.0, 3.0));
        assert!((s.longest_track_segment - 1.0 / 6.0).abs() < 1e-15);
    }
}
