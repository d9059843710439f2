//! Detections with times of their own within a scan: a track is compared with each where it is at that time, updated there, and taken on to the scan's time.
//!
//! Source: our own. A radar's antenna sees its plots one after the other; with one time for all of them a target of speed v keeps an error of up to v times half a turn.
//! Method: the scan's time is no earlier than any of its detections, so all steps go forward: the filter stays where the scan before left it, copies of it are predicted to
//! the detections in reach, it goes itself to the detection that it takes, and on to the scan. Exact for every filter and model whose steps compose (a step over a + b is
//! one over a and one over b). Soft associations update once, at the time of the likeliest detection; the others are carried there by the track's own motion, and the
//! variance of its velocity times the squared time between is added to their noise.
//! Symbols: age of a detection, the scan's time less its own. Limits: a detection older than the scan before counts at that scan's time; noise given as a standard deviation of
//! the acceleration (`acceleration-std-*`) counts a part of a step as a step, so it is less than over the whole; merged measurements are not shared out in such scans.
//! Cost: a copy of the filter and a prediction for each detection in the rectangle of a gate; with boxed filters that is memory taken.

use super::super::filter::TrackedFilter;
use super::super::scan_table::{Cov2, MOST_LOOKED_AT, Predicted};
use super::super::single_track::Track;
use super::context::Context;
use super::gate::{keep_nearest, pair};
use super::predict::predicted_of;
use crate::associate::{Gates, Share};
use crate::{Result, Timestamp};
use boresight_filters::Filter;
use nalgebra::Vector2;

/// Nanoseconds as seconds.
#[inline]
pub(in crate::track) fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

/// The time from the scan before to what was seen `age_ns` before this one, and from there to this one, s.
fn parts_s(context: &Context<'_>, age_ns: u64) -> [f64; 2] {
    let after_s = seconds(age_ns).min(context.dt_s);
    [context.dt_s - after_s, after_s]
}

/// Appends what gating needs of each track at the scan's time to `predicted`; the filters stay where they are.
/// # Errors
/// A filter that cannot predict over that time.
pub(in crate::track) fn look_ahead(
    context: &Context<'_>,
    tracks: &mut [Track],
    survival: f64,
    predicted: &mut Vec<Predicted>,
) -> Result<()> {
    for t in tracks {
        let mut ahead = t.filter.clone();
        ahead.predict(context.dt_s)?;
        context.config.confirmation.predict_existence(&mut t.history, survival);
        predicted.push(seen(context, &ahead, t, 0));
    }
    Ok(())
}

/// Takes a track's filter on by `dt_s`; one that refuses stays.
pub(super) fn advance(track: &mut Track, dt_s: f64) {
    let _refused = track.filter.predict(dt_s);
}

/// What gating needs of a track whose filter stands `age_ns` before the scan.
fn seen(context: &Context<'_>, filter: &TrackedFilter, track: &Track, age_ns: u64) -> Predicted {
    let then = Timestamp::from_ns(context.now().ns.saturating_sub_unsigned(age_ns));
    predicted_of(filter, track.last_seen(), track.last_place, then, context.config)
}

/// What gating needs of a track `age_ns` before the scan; its filter stands at the scan before.
fn predicted_at(context: &Context<'_>, track: &Track, age_ns: u64) -> Option<Predicted> {
    let mut filter = track.filter.clone();
    filter.predict(parts_s(context, age_ns)[0]).ok()?;
    Some(seen(context, &filter, track, age_ns))
}

/// As [`super::gate::gate_row`], each detection against the track at the detection's own time; `at_scan` is the track at the scan's.
pub(in crate::track) fn gate_row_by_time(
    context: &Context<'_>,
    track: &Track,
    at_scan: &Predicted,
    likelihood: bool,
    free: impl Fn(u32) -> bool,
    extra_cost: impl Fn(&Predicted, u32) -> f64,
    gates: &mut Gates,
) {
    let Context { table, gate, .. } = *context;
    // The gates at both ends of the step, and all between them.
    let begin = seen(context, &track.filter, track, (context.dt_s * 1e9) as u64);
    let ((x0, y0), (x1, y1)) = (table.half_sides(&begin, gate), table.half_sides(at_scan, gate));
    let half_x = x0.max(x1) + 0.5 * (at_scan.x - begin.x).abs();
    let half_y = y0.max(y1) + 0.5 * (at_scan.y - begin.y).abs();
    let (x, y) = (0.5 * (begin.x + at_scan.x), 0.5 * (begin.y + at_scan.y));
    let mut latest: Option<(u64, Predicted)> = None;
    let (mut looked_at, mut gated) = (0, 0);
    table.grid().near(x, y, half_x, half_y, |p| {
        looked_at += 1;
        if (p.x - x).abs() <= half_x && (p.y - y).abs() <= half_y && free(p.index) {
            let age_ns = context.age_ns(p.index);
            let at = match latest {
                Some((of, at)) if of == age_ns => Some(at),
                _ => predicted_at(context, track, age_ns),
            };
            if let Some(at) = at {
                latest = Some((age_ns, at));
                let (z, r) = table.measured(p.index, Vector2::new(p.x, p.y), &at);
                let off = [z.x - at.x, z.y - at.y];
                if let Some(pair) = pair(&at, off, &r, p.index, gate, likelihood, &extra_cost) {
                    gates.push(pair);
                    gated += 1;
                }
            }
        }
        looked_at < MOST_LOOKED_AT
    });
    keep_nearest(gates, gated, context.config.max_gated as usize);
}

/// A track taken to the time of a detection, and the others that it shares carried there.
pub(in crate::track) struct Carried {
    /// The track at that time, before the update.
    pub predicted: Predicted,
    after_s: f64,
    others: Vec<(u32, Vector2<f64>, Cov2)>,
}

impl Carried {
    /// Takes a track to its detection `j`.
    pub fn sure(context: &Context<'_>, track: &mut Track, j: u32) -> Self {
        Self::new(context, track, &[], j)
    }

    /// Takes a track to detection `best`, and the others of `shares` with it.
    pub fn new(context: &Context<'_>, track: &mut Track, shares: &[Share], best: u32) -> Self {
        let age_ns = context.age_ns(best);
        let others = shares.iter().map(|s| s.detection).filter(|j| context.age_ns(*j) != age_ns);
        let others = others.filter_map(|j| carried(context, track, j, age_ns)).collect();
        let [before_s, after_s] = parts_s(context, age_ns);
        advance(track, before_s);
        Self { predicted: seen(context, &track.filter, track, age_ns), after_s, others }
    }

    /// Where detection `j` counts at that time (px), and with which noise.
    pub fn place(&self, context: &Context<'_>, j: u32) -> (Vector2<f64>, Cov2) {
        let other = self.others.iter().find(|o| o.0 == j);
        other.map_or_else(|| context.measured(j, &self.predicted), |o| (o.1, o.2))
    }

    /// Takes the track on to the scan.
    pub fn to_scan(&self, track: &mut Track) {
        advance(track, self.after_s);
    }
}

/// Detection `j` as it would lie `age_ns` before the scan, if it is the track's; its filter stands at the scan before.
fn carried(context: &Context<'_>, track: &Track, j: u32, age_ns: u64) -> Option<(u32, Vector2<f64>, Cov2)> {
    let own_ns = context.age_ns(j);
    let (own, then) = (predicted_at(context, track, own_ns)?, predicted_at(context, track, age_ns)?);
    let (position, mut noise) = context.measured(j, &own);
    let (position, velocity) = (position + Vector2::new(then.x - own.x, then.y - own.y), track.filter.kinematics().cov);
    let between2 = (seconds(own_ns) - seconds(age_ns)).powi(2);
    noise.xx += between2 * velocity[(1, 1)];
    noise.xy += between2 * velocity[(1, 3)];
    noise.yy += between2 * velocity[(3, 3)];
    Some((j, position, noise))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::scan_table::ScanTable;
    use crate::track::step::initiate::from_initial_tracks;
    use crate::track::{InitialTrackConfig, TrackerConfig};
    use crate::{Detection, Scan};
    use nalgebra::Matrix2;

    #[test]
    fn another_detection_is_carried_by_the_tracks_motion_and_as_unsure_as_that_is() {
        // Seen 0.5 s before the scan, carried 1.5 s back: by −1.5 (2, −1); R = 0.25, the velocity's variance 3² over 1.5².
        let initial = InitialTrackConfig {
            velocity_px_per_s: [2.0, -1.0],
            velocity_std_px_per_s: 3.0,
            ..InitialTrackConfig::default()
        };
        let config = TrackerConfig { initial_tracks: vec![initial], extra_noise_px: 0.0, ..TrackerConfig::default() };
        let mut tracks = Vec::new();
        from_initial_tracks(&config, Timestamp::default(), &mut tracks, &mut 1).unwrap();
        let d = Detection::at(Vector2::new(4.0, 1.0), Matrix2::identity() * 0.25).with_age_ns(500_000_000);
        let scan = Scan { time: Timestamp::from_secs_f64(2.0), detections: vec![d], ..Scan::default() };
        let mut table = ScanTable::default();
        table.read(&scan, 1.0, 0.0, 0.0).unwrap();
        let context = Context { scan: &scan, table: &table, config: &config, gate: 9.0, dt_s: 2.0 };
        let (j, position, noise) = carried(&context, &tracks[0], 0, 2_000_000_000).unwrap();
        assert!(j == 0 && (position - Vector2::new(1.0, 2.5)).norm() < 1e-12, "{position}");
        assert!((noise.matrix() - Matrix2::identity() * 20.5).norm() < 1e-12, "{noise:?}");
    }
}
