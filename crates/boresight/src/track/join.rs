//! Stitching of a whole table of tracks: fragments get one id, gaps may be filled and the whole smoothed.
//!
//! Method: each track's ends go to [`super::stitch`]; where two are joined, rows of the earlier one from the later one's first on
//! (it coasted on while its successor had begun) are dropped. With smoothing each row becomes the estimate given the whole
//! track (Rauch-Tung-Striebel, [`super::smooth`]) and the scans of a gap get rows of their own. Across a
//! seam the start of the later fragment is fused with what the earlier one predicts there; the later fragment's own rows
//! keep what its own data say.
//! Departures: the process noise is one constant-velocity model, whatever filter made the table.
//! Limits: a table without velocities (all are 0) is filtered anew before, its positions taken as measurements.

use super::smooth::{SmoothConfig, filter_track, predict, smooth_track};
use super::stitch::{Fragment, StitchConfig, stitch};
use crate::{Error, ErrorKind, Result, Timestamp, TrackFrame, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;
use std::collections::BTreeMap;

/// What was done to a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Joined {
    /// Tracks before.
    pub before: usize,
    /// Tracks after.
    pub after: usize,
    /// Rows put into gaps.
    pub filled: usize,
    /// Rows dropped because the successor had begun.
    pub dropped: usize,
    /// Whether positions were filtered anew, since the table had no velocities.
    pub filtered: bool,
}

/// One track's row: the scan it stands in and the state.
type Row = (usize, TrackState);

/// Joins the fragments of a table in place, and smooths it if `smooth`; scans ascend in time.
/// # Errors
/// A configuration value outside its range; scans out of order; an id twice in a scan; a covariance that no filter makes.
pub fn join(scans: &mut [TrackFrame], config: &StitchConfig, smooth: bool) -> Result<Joined> {
    config.validate("stitch")?;
    let model = SmoothConfig {
        acceleration: config.acceleration,
        forgetting: config.forgetting.clone(),
        ..SmoothConfig::default()
    };
    let mut tracks = by_track(scans)?;
    let mut done = Joined { before: tracks.len(), ..Joined::default() };
    let still = |s: &TrackState| s.kinematics.mean[1] == 0.0 && s.kinematics.mean[3] == 0.0;
    done.filtered = !tracks.is_empty() && tracks.values().flatten().all(|r| still(&r.1));
    if done.filtered {
        for rows in tracks.values_mut() {
            let spread = config.max_speed_px_per_s / 3.0;
            each_belief(rows, None, scans, |times, beliefs| filter_track(times, beliefs, spread, &model))?;
        }
    }
    let fragments: Vec<Fragment> = tracks.iter().filter_map(|(id, rows)| fragment(*id, rows, scans)).collect();
    let chains = chains(&fragments, &stitch(&fragments, config)?);
    let mut out: BTreeMap<u64, Vec<Row>> = BTreeMap::new();
    for (id, members) in chains {
        let parts = members.iter().filter_map(|m| tracks.remove(m)).collect();
        out.insert(id, chain(id, parts, scans, smooth.then_some(&model), &mut done)?);
    }
    // Tracks that were never confirmed are no fragments; they stay as they are.
    out.append(&mut tracks);
    done.after = out.len();
    for scan in scans.iter_mut() {
        scan.tracks.clear();
    }
    for (k, state) in out.into_values().flatten() {
        scans[k].tracks.push(state);
    }
    Ok(done)
}

fn by_track(scans: &[TrackFrame]) -> Result<BTreeMap<u64, Vec<Row>>> {
    let mut tracks: BTreeMap<u64, Vec<Row>> = BTreeMap::new();
    for (k, scan) in scans.iter().enumerate() {
        let damaged = |what: String| Error::new(ErrorKind::Damaged, what).at(format!("frame {}", scan.index.0));
        if k > 0 && scan.time < scans[k - 1].time {
            return Err(damaged("time runs back".to_string()).hint("sort the table by time"));
        }
        for state in &scan.tracks {
            let rows = tracks.entry(state.id.0).or_default();
            if rows.last().is_some_and(|r| r.0 == k) {
                return Err(damaged(format!("track {} stands twice in a frame", state.id.0)));
            }
            if !state.kinematics.mean.iter().chain(state.kinematics.cov.iter()).all(|v| v.is_finite()) {
                return Err(damaged(format!("track {} has a state that is not finite", state.id.0)));
            }
            rows.push((k, state.clone()));
        }
    }
    Ok(tracks)
}

/// The two ends of a track: its first row, and its last with a detection; nothing of a track that was never confirmed.
fn fragment(id: u64, rows: &[Row], scans: &[TrackFrame]) -> Option<Fragment> {
    let confirmed = rows.iter().any(|r| r.1.status != TrackStatus::Tentative);
    let first = rows.first().filter(|_| confirmed)?;
    let last = rows.iter().rev().find(|r| r.1.status != TrackStatus::Coasting).unwrap_or(first);
    Some(Fragment {
        id: TrackId(id),
        begin: scans[first.0].time,
        first: first.1.kinematics,
        end: scans[last.0].time,
        last: last.1.kinematics,
    })
}

/// The members of each chain in the order of time.
fn chains(fragments: &[Fragment], ids: &[TrackId]) -> BTreeMap<u64, Vec<u64>> {
    let mut order: Vec<usize> = (0..fragments.len()).collect();
    order.sort_by_key(|i| (fragments[*i].begin, *i));
    let mut out: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    for i in order {
        out.entry(ids[i].0).or_default().push(fragments[i].id.0);
    }
    out
}

/// Lets `change` work on the times and beliefs of rows and one belief behind them; the boxes go with them.
fn each_belief(
    rows: &mut [Row],
    behind: Option<&Row>,
    scans: &[TrackFrame],
    change: impl FnOnce(&[Timestamp], &mut [Gaussian<4>]) -> Result<()>,
) -> Result<()> {
    let all = || rows.iter().chain(behind);
    let times: Vec<Timestamp> = all().map(|r| scans[r.0].time).collect();
    let mut beliefs: Vec<Gaussian<4>> = all().map(|r| r.1.kinematics).collect();
    change(&times, &mut beliefs)?;
    for ((_, state), belief) in rows.iter_mut().zip(beliefs) {
        moved_to(state, belief);
    }
    Ok(())
}

/// Gives a state new kinematics; its box goes with it.
fn moved_to(state: &mut TrackState, kinematics: Gaussian<4>) {
    state.extent.left_px += kinematics.mean[0] - state.kinematics.mean[0];
    state.extent.top_px += kinematics.mean[2] - state.kinematics.mean[2];
    state.kinematics = kinematics;
}

/// One chain of fragments as one track.
fn chain(
    id: u64,
    mut parts: Vec<Vec<Row>>,
    scans: &[TrackFrame],
    model: Option<&SmoothConfig>,
    done: &mut Joined,
) -> Result<Vec<Row>> {
    // From the last fragment to the first, so that each smooths towards what follows it.
    let mut rows: Vec<Row> = Vec::new();
    while let Some(mut part) = parts.pop() {
        if let Some((begin, _)) = rows.first() {
            let n = part.len();
            part.retain(|r| r.0 < *begin);
            done.dropped += n - part.len();
        }
        if let Some(model) = model {
            if let Some((begin, _)) = rows.first() {
                fill(&mut part, *begin, scans, model, done)?;
            }
            if let (Some(last), Some(next)) = (part.last(), rows.first_mut()) {
                let dt_s = scans[next.0].time.seconds_since(scans[last.0].time);
                let ahead = predict(&last.1.kinematics, dt_s, model)?;
                let both = fused(&ahead, &next.1.kinematics)?;
                moved_to(&mut next.1, both);
            }
            each_belief(&mut part, rows.first(), scans, |times, beliefs| {
                smooth_track(times, beliefs, model).map(|_| ())
            })?;
        }
        part.append(&mut rows);
        rows = part;
    }
    for (_, state) in &mut rows {
        state.id = TrackId(id);
    }
    Ok(rows)
}

/// Rows for the scans between the end of a fragment and the beginning of the next: predicted, coasting.
fn fill(
    part: &mut Vec<Row>,
    begin: usize,
    scans: &[TrackFrame],
    model: &SmoothConfig,
    done: &mut Joined,
) -> Result<()> {
    let Some((last, state)) = part.last().cloned() else { return Ok(()) };
    for k in last + 1..begin {
        let dt_s = scans[k].time.seconds_since(scans[last].time);
        let mut between = state.clone();
        moved_to(&mut between, predict(&state.kinematics, dt_s, model)?);
        between.status = TrackStatus::Coasting;
        between.detection = None;
        between.innovation = None;
        part.push((k, between));
        done.filled += 1;
    }
    Ok(())
}

/// Two independent beliefs of the same state as one.
fn fused(a: &Gaussian<4>, b: &Gaussian<4>) -> Result<Gaussian<4>> {
    // x = a + P_a (P_a + P_b)⁻¹ (b − a): the same as adding informations, without inverting either.
    let Some(sum) = (a.cov + b.cov).cholesky() else {
        return Err(Error::new(ErrorKind::Numeric, "the covariances at a seam are not positive definite"));
    };
    let cov = a.cov * sum.solve(&b.cov);
    Ok(Gaussian { mean: a.mean + a.cov * sum.solve(&(b.mean - a.mean)), cov: 0.5 * (cov + cov.transpose()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use crate::FrameIndex;
    use crate::track::AccelerationNoise;
    use nalgebra::{Matrix4, Vector4};

    /// One target at 1 px a scan (10 scans a second), seen under id 1 until scan 20 and under id 2 from scan 26, with noise.
    fn table(noise_px: f64) -> Vec<TrackFrame> {
        let noise = |k: usize, salt: usize| noise_px * (((k * 7919 + salt * 104_729) % 1000) as f64 / 500.0 - 1.0);
        (0..50)
            .map(|k| {
                let mut scan = TrackFrame {
                    index: FrameIndex(k as u64),
                    time: Timestamp::from_secs_f64(0.1 * k as f64),
                    ..TrackFrame::default()
                };
                if k <= 20 || k >= 26 {
                    let mean = Vector4::new(k as f64 + noise(k, 1), 0.0, 5.0 + noise(k, 2), 0.0);
                    let cov = Matrix4::from_diagonal(&Vector4::new(0.3, 100.0, 0.3, 100.0));
                    let extent =
                        Extent { left_px: mean[0] - 2.0, top_px: mean[2] - 2.0, width_px: 4.0, height_px: 4.0 };
                    scan.tracks.push(TrackState {
                        id: TrackId(if k <= 20 { 1 } else { 2 }),
                        status: TrackStatus::Confirmed,
                        kinematics: Gaussian { mean, cov },
                        extent,
                        detection: Some(0),
                        innovation: None,
                        score: 1.0,
                    });
                }
                scan
            })
            .collect()
    }

    fn rms(scans: &[TrackFrame]) -> f64 {
        let errors: Vec<f64> = scans
            .iter()
            .enumerate()
            .flat_map(|(k, s)| s.tracks.iter().map(move |t| (k, t)))
            .map(|(k, t)| (t.kinematics.mean[0] - k as f64).powi(2) + (t.kinematics.mean[2] - 5.0).powi(2))
            .collect();
        (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
    }

    fn config() -> StitchConfig {
        StitchConfig {
            acceleration: AccelerationNoise::Discrete(1.0),
            max_speed_px_per_s: 30.0,
            ..StitchConfig::default()
        }
    }

    #[test]
    fn two_fragments_become_one_track_with_the_gap_filled_and_less_noise() {
        let raw = table(1.0);
        let mut joined = raw.clone();
        let done = join(&mut joined, &config(), true).unwrap();
        assert_eq!(done, Joined { before: 2, after: 1, filled: 5, dropped: 0, filtered: true });
        assert!(joined.iter().all(|s| s.tracks.len() == 1 && s.tracks[0].id == TrackId(1)));
        let gap: Vec<_> = joined[21..26].iter().map(|s| s.tracks[0].status).collect();
        assert_eq!(gap, [TrackStatus::Coasting; 5]);
        assert!(rms(&joined) < 0.5 * rms(&raw), "{} against {}", rms(&joined), rms(&raw));
        for s in &joined {
            let t = &s.tracks[0];
            assert!((t.extent.left_px + 2.0 - t.kinematics.mean[0]).abs() < 1e-9, "the box goes with the estimate");
        }
        // The middle of a smoothed track is surer than its end.
        let var = |k: usize| joined[k].tracks[0].kinematics.cov[(0, 0)];
        assert!(var(10) < 0.5 * var(49) && var(23) < 1.0, "{} {} {}", var(10), var(23), var(49));
    }

    #[test]
    fn without_smoothing_only_ids_change() {
        let mut scans = table(0.0);
        join(&mut scans, &config(), false).unwrap();
        let before = scans.clone();
        // Now the table has velocities: joining it again changes nothing.
        let done = join(&mut scans, &config(), false).unwrap();
        assert_eq!((done.before, done.after, done.filled, done.filtered), (1, 1, 0, false));
        assert_eq!(scans, before);
    }

    #[test]
    fn a_coasting_tail_gives_way_to_the_successor() {
        let mut scans = table(0.0);
        for k in 21..30 {
            let mut tail = scans[20].tracks[0].clone();
            let mean = Vector4::new(k as f64, 0.0, 5.0, 0.0);
            let cov = tail.kinematics.cov;
            moved_to(&mut tail, Gaussian { mean, cov });
            tail.status = TrackStatus::Coasting;
            scans[k].tracks.insert(0, tail);
        }
        let done = join(&mut scans, &config(), false).unwrap();
        assert_eq!((done.after, done.dropped), (1, 4));
        assert!(scans.iter().all(|s| s.tracks.len() == 1));
    }

    #[test]
    fn a_track_twice_in_a_frame_is_refused() {
        let mut scans = table(0.0);
        let double = scans[3].tracks[0].clone();
        scans[3].tracks.push(double);
        assert!(join(&mut scans, &config(), true).unwrap_err().to_string().contains("frame 3"));
    }

    #[test]
    fn time_that_runs_back_is_refused_and_time_that_stands_still_is_not() {
        let mut scans = table(0.0);
        scans[7].time = scans[6].time;
        assert_eq!(by_track(&scans).unwrap().len(), 2);
        scans[7].time = Timestamp::from_ns(scans[6].time.ns - 1);
        let refused = join(&mut scans, &config(), true).unwrap_err().to_string();
        assert!(refused.contains("frame 7") && refused.contains("time runs back"), "{refused}");
    }
}
