//! Gaps of tables of tracks: frames that a table leaves out because nothing was tracked in them, and rows that a track lacks.
//!
//! Times of frames that no row tells lie evenly between their neighbours'.

use super::smooth::{SmoothConfig, predict};
use crate::{FrameIndex, Result, Timestamp, TrackFrame, TrackState, TrackStatus};

/// One track's row with its frame.
pub(super) type FramedState = (FrameIndex, Timestamp, TrackState);

/// Puts empty frames where a table of `rate_hz` frames/s leaves some out; gaps longer than `max_gap_s` stay, since nothing
/// is filled there.
pub fn with_empty_frames(
    frames: impl IntoIterator<Item = TrackFrame>,
    max_gap_s: f64,
    rate_hz: f64,
) -> Vec<TrackFrame> {
    let mut out: Vec<TrackFrame> = Vec::new();
    for frame in frames {
        if let Some(last) = out.last() {
            let (from, time) = (last.index.0, last.time);
            let n = frame.index.0.saturating_sub(from);
            let step_s = frame.time.seconds_since(time) / n.max(1) as f64;
            for k in (1..n).filter(|_| n as f64 <= max_gap_s * rate_hz + 1.0) {
                let time = Timestamp::from_ns(time.ns + (step_s * k as f64 * 1e9).round() as i64);
                out.push(TrackFrame { index: FrameIndex(from + k), time, tracks: Vec::new() });
            }
        }
        out.push(frame);
    }
    out
}

/// Puts predicted rows into the frames between a track's rows in which it has none; returns how many. `frames` tell the
/// times of the table's frames, ascending.
/// # Errors
/// A prediction that fails.
pub(super) fn fill(rows: &mut Vec<FramedState>, frames: &[TrackFrame], config: &SmoothConfig) -> Result<usize> {
    let mut filled: Vec<FramedState> = Vec::with_capacity(rows.len());
    let mut n = 0;
    for (index, time, state) in rows.drain(..) {
        let (from, after) = match filled.last() {
            Some((from, after, _)) => (*from, *after),
            None => (index, time),
        };
        for missing in from.0 + 1..index.0 {
            let known = frames.binary_search_by_key(&missing, |f| f.index.0).ok().map(|at| frames[at].time);
            // A frame without any track: its time lies between its neighbours'.
            let share = (missing - from.0) as f64 / (index.0 - from.0) as f64;
            let between = || Timestamp::from_secs_f64(after.as_secs_f64() + share * time.seconds_since(after));
            let at = known.unwrap_or_else(between);
            let Some((_, last, before)) = filled.last() else { break };
            let kinematics = predict(&before.kinematics, at.seconds_since(*last), config)?;
            let row = TrackState { kinematics, status: TrackStatus::Coasting, detection: None, ..before.clone() };
            filled.push((FrameIndex(missing), at, row));
            n += 1;
        }
        filled.push((index, time, state));
    }
    *rows = filled;
    Ok(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extent, TrackId};
    use boresight_filters::Gaussian;
    use nalgebra::{Matrix4, Vector4};

    fn frame(index: u64, time_s: f64) -> TrackFrame {
        TrackFrame { index: FrameIndex(index), time: Timestamp::from_secs_f64(time_s), tracks: Vec::new() }
    }

    #[test]
    fn frames_left_out_come_back_evenly_but_not_in_a_gap_beyond_the_longest() {
        // At 10 frames/s a gap of 0.3 s may span 4 steps: 0 to 4 is filled, 4 to 9 is not.
        let table = [frame(0, 0.0), frame(4, 0.4), frame(9, 0.9)];
        let out = with_empty_frames(table, 0.3, 10.0);
        assert_eq!(out.iter().map(|f| f.index.0).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 9]);
        assert_eq!(out[1].time.ns, 100_000_000);
        assert_eq!(out[3].time.ns, 300_000_000);
    }

    #[test]
    fn a_filled_row_is_predicted_and_coasts_at_the_time_that_the_table_knows() {
        let row = |index: u64, time_s: f64, x: f64| {
            let state = TrackState {
                id: TrackId(1),
                status: TrackStatus::Confirmed,
                kinematics: Gaussian { mean: Vector4::new(x, 2.0, 0.0, 0.0), cov: Matrix4::identity() },
                extent: Extent::default(),
                detection: Some(3),
                innovation: None,
                score: 1.0,
            };
            (FrameIndex(index), Timestamp::from_secs_f64(time_s), state)
        };
        let mut rows = vec![row(0, 0.0, 5.0), row(3, 3.0, 11.0)];
        // Frame 1 is in the table, late by half a second; frame 2 is not.
        let n = fill(&mut rows, &[frame(0, 0.0), frame(1, 1.5), frame(3, 3.0)], &SmoothConfig::default()).unwrap();
        assert_eq!((n, rows.len()), (2, 4));
        assert_eq!(rows[1].1, Timestamp::from_secs_f64(1.5));
        assert_eq!(rows[1].2.kinematics.mean[0], 8.0);
        assert_eq!((rows[1].2.status, rows[1].2.detection), (TrackStatus::Coasting, None));
        // The table does not know frame 2: two thirds of the way from the row before the gap to the one after it.
        assert_eq!((rows[2].1, rows[2].2.kinematics.mean[0]), (Timestamp::from_secs_f64(2.0), 9.0));
        assert_eq!(rows[3].2.detection, Some(3));
    }
}
