//! Smooths a whole table of tracks: each row given all rows of its track; rows for frames that a track lacks, if asked for.
//!
//! The steps of a track: its positions are filtered first if they have no velocities, its gaps are filled by prediction, and
//! the whole is smoothed ([`super::smooth`]). Boxes keep their size and move with their centres.

use super::gaps::{FramedState, fill};
use super::smooth::{SmoothConfig, filter_track, smooth_track};
use crate::{Extent, FrameIndex, Result, Timestamp, TrackFrame, TrackState};
use boresight_filters::Gaussian;
use std::collections::BTreeMap;

/// A smoothed table, and what was done to it.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SmoothedTable {
    /// The frames with at least one track.
    pub frames: Vec<TrackFrame>,
    /// Number of tracks.
    pub n_tracks: usize,
    /// Number of rows, those filled in among them.
    pub n_rows: usize,
    /// Number of rows filled in.
    pub n_filled: usize,
    /// Number of rows that do not follow from the one before of their track, and begin a part that is smoothed by itself.
    pub n_cut: usize,
    /// Median over the rows of the standard deviation of a position before smoothing, mean of both axes, px.
    pub median_std_before_px: f64,
    /// The same afterwards, px.
    pub median_std_after_px: f64,
}

/// Smooths the tracks of a table, frames ascending. With `speed_std_px_per_s` the rows are taken as positions only and
/// filtered first, from a first velocity of that standard deviation (px/s). With `fill_gaps` a track gets a row in each
/// frame between its first and its last.
/// # Errors
/// A track, named, whose times do not ascend or whose covariances cannot be factored.
pub fn smooth_table(
    frames: &[TrackFrame],
    config: &SmoothConfig,
    speed_std_px_per_s: Option<f64>,
    fill_gaps: bool,
) -> Result<SmoothedTable> {
    let mut tracks: BTreeMap<u64, Vec<FramedState>> = BTreeMap::new();
    for frame in frames {
        for track in &frame.tracks {
            tracks.entry(track.id.0).or_default().push((frame.index, frame.time, track.clone()));
        }
    }
    let mut out = SmoothedTable { n_tracks: tracks.len(), ..SmoothedTable::default() };
    let mut stds = [Vec::new(), Vec::new()];
    let mut smoothed: BTreeMap<FrameIndex, TrackFrame> = BTreeMap::new();
    for (id, rows) in &mut tracks {
        // The filter's noise follows from the box with which the track began.
        let config = &config.of_height(rows.first().map_or(0.0, |r| r.2.extent.height_px));
        let mut n_cut = 0;
        let mut one = || -> Result<usize> {
            if let Some(std) = speed_std_px_per_s {
                each_belief(rows, |times, beliefs| filter_track(times, beliefs, std, config))?;
            }
            let n_filled = if fill_gaps { fill(rows, frames, config)? } else { 0 };
            stds[0].extend(rows.iter().map(|r| position_std_px(&r.2)));
            let mut n_parts = 0;
            each_belief(rows, |times, beliefs| {
                n_parts = smooth_track(times, beliefs, config)?;
                Ok(())
            })?;
            n_cut = n_parts.saturating_sub(1);
            stds[1].extend(rows.iter().map(|r| position_std_px(&r.2)));
            Ok(n_filled)
        };
        out.n_filled += one().map_err(|e| e.at(format!("track {id}")))?;
        out.n_cut += n_cut;
        out.n_rows += rows.len();
        for (index, time, state) in rows.drain(..) {
            let frame = smoothed.entry(index).or_insert(TrackFrame { index, time, tracks: Vec::new() });
            frame.tracks.push(state);
        }
    }
    [out.median_std_before_px, out.median_std_after_px] = stds.map(median);
    out.frames = smoothed.into_values().collect();
    Ok(out)
}

/// Lets `change` work on the beliefs of a track, and moves the boxes with them.
fn each_belief(
    rows: &mut [FramedState],
    change: impl FnOnce(&[Timestamp], &mut [Gaussian<4>]) -> Result<()>,
) -> Result<()> {
    let times: Vec<Timestamp> = rows.iter().map(|r| r.1).collect();
    let mut beliefs: Vec<_> = rows.iter().map(|r| r.2.kinematics).collect();
    change(&times, &mut beliefs)?;
    for ((_, _, state), belief) in rows.iter_mut().zip(beliefs) {
        let (width_px, height_px) = (state.extent.width_px, state.extent.height_px);
        let (left_px, top_px) = (belief.mean[0] - width_px / 2.0, belief.mean[2] - height_px / 2.0);
        state.extent = Extent { left_px, top_px, width_px, height_px };
        state.kinematics = belief;
    }
    Ok(())
}

/// Standard deviation of a position, mean of both axes, px.
fn position_std_px(state: &TrackState) -> f64 {
    let p = &state.kinematics.cov;
    (0.5 * (p[(0, 0)] + p[(2, 2)])).sqrt()
}

/// The middle value, the upper of two; NaN without values.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::AccelerationNoise;
    use crate::{TrackId, TrackStatus};
    use nalgebra::{Matrix4, Vector4};

    fn table() -> Vec<TrackFrame> {
        [0u64, 1, 2, 4, 5]
            .map(|k| {
                let state = TrackState {
                    id: TrackId(7),
                    status: TrackStatus::Confirmed,
                    kinematics: Gaussian {
                        mean: Vector4::new(10.0 + 2.0 * k as f64, 2.0, 0.0, 0.0),
                        cov: Matrix4::identity(),
                    },
                    extent: Extent { left_px: 0.0, top_px: 0.0, width_px: 4.0, height_px: 6.0 },
                    detection: None,
                    innovation: None,
                    score: 1.0,
                };
                let time = Timestamp::from_secs_f64(k as f64);
                TrackFrame { index: FrameIndex(k), time, tracks: vec![state] }
            })
            .to_vec()
    }

    #[test]
    fn a_straight_track_stays_where_it_is_and_gets_its_missing_row() {
        let config = SmoothConfig { acceleration: AccelerationNoise::Discrete(0.1), ..SmoothConfig::default() };
        let s = smooth_table(&table(), &config, None, true).unwrap();
        assert_eq!((s.n_tracks, s.n_rows, s.n_filled, s.frames.len()), (1, 6, 1, 6));
        for (k, frame) in s.frames.iter().enumerate() {
            let x = 10.0 + 2.0 * k as f64;
            let state = &frame.tracks[0];
            assert!((state.kinematics.mean[0] - x).abs() < 1e-9);
            assert!((state.extent.left_px - (x - 2.0)).abs() < 1e-9 && (state.extent.top_px + 3.0).abs() < 1e-9);
        }
        assert_eq!(s.frames[3].tracks[0].status, TrackStatus::Coasting);
        assert_eq!(s.median_std_before_px, 1.0);
        assert_eq!(smooth_table(&table(), &config, None, false).unwrap().n_rows, 5);
    }

    #[test]
    fn positions_are_filtered_first_and_grow_surer_by_smoothing() {
        let config = SmoothConfig { acceleration: AccelerationNoise::Discrete(0.01), ..SmoothConfig::default() };
        let s = smooth_table(&table(), &config, Some(100.0), false).unwrap();
        assert!(s.median_std_after_px < 0.8 * s.median_std_before_px, "{s:?}");
        // The last velocity is the slope of the positions, whatever the rows say of it.
        let slow = table().into_iter().map(|mut f| {
            f.tracks[0].kinematics.mean[1] = -7.0;
            f
        });
        let s = smooth_table(&slow.collect::<Vec<_>>(), &config, Some(100.0), false).unwrap();
        assert!((s.frames[4].tracks[0].kinematics.mean[1] - 2.0).abs() < 0.01);
    }

    #[test]
    fn a_fault_names_the_track() {
        let mut rows = table();
        rows[1].time = Timestamp::from_secs_f64(-1.0);
        let e = smooth_table(&rows, &SmoothConfig::default(), None, false).unwrap_err().to_string();
        assert!(e.starts_with("track 7"), "{e}");
        assert!(smooth_table(&[], &SmoothConfig::default(), None, false).unwrap().median_std_before_px.is_nan());
    }
}
