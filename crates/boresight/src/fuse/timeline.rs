//! A sensor's track over time, asked for its state at any time.
//!
//! Between and after its points the track is predicted with constant velocity from the last point before (white acceleration of
//! power density q, px²/s³), so that nothing of the future is used and gaps widen the covariance honestly. For registration,
//! where both sides of a point may be used, [`Timeline::between`] interpolates (cubic Hermite of positions and velocities).
//! Times are seconds, not [`crate::Timestamp`], because a registration shifts a clock by any real number of seconds. Equal nanoseconds
//! give equal seconds; different ones stay different within 48 days of the zero (at 1.7e9 s, since 1970, from 0.24 µs apart).
//! Units: s, px, px/s (or m). Limits: points must be in order of time.

use crate::{Extent, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;
use boresight_filters::model::{ConstantVelocity, Model};
use nalgebra::{Vector2, Vector4};
use std::collections::BTreeMap;

/// A track's beliefs `[x, vx, y, vy]` over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The sensor's number of the track.
    pub id: TrackId,
    /// Time (s) and belief, in order of time.
    pub points: Vec<(f64, Gaussian<4>)>,
    /// Width and height of its last box.
    pub size: [f64; 2],
}

/// Gathers the confirmed and coasting states of frames into tracks, in the order of their numbers.
pub fn timelines<'a>(frames: impl Iterator<Item = (f64, &'a [TrackState])>) -> Vec<Timeline> {
    let mut all: BTreeMap<TrackId, Timeline> = BTreeMap::new();
    for (time_s, tracks) in frames {
        for t in tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let line = all.entry(t.id).or_insert_with(|| Timeline { id: t.id, points: Vec::new(), size: [0.0; 2] });
            if line.points.last().is_none_or(|(last, _)| *last < time_s) {
                line.points.push((time_s, t.kinematics));
                line.size = [t.extent.width_px, t.extent.height_px];
            }
        }
    }
    all.into_values().collect()
}

impl Timeline {
    /// The belief at `time_s`, predicted from the last point at or before it; none before the first point or after a gap of
    /// more than `max_gap_s`.
    pub fn at(&self, time_s: f64, density: f64, max_gap_s: f64) -> Option<Gaussian<4>> {
        let after = self.points.partition_point(|(t, _)| *t <= time_s);
        let (t, belief) = self.points.get(after.checked_sub(1)?)?;
        let dt = time_s - t;
        if dt <= max_gap_s { predict(belief, dt, density) } else { None }
    }

    /// Position and velocity at `time_s` between two points at most `max_gap_s` apart.
    pub fn between(&self, time_s: f64, max_gap_s: f64) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let after = self.points.partition_point(|(t, _)| *t <= time_s);
        let (t0, a) = self.points.get(after.checked_sub(1)?)?;
        let (p0, v0) = halves(&a.mean);
        if time_s == *t0 {
            return Some((p0, v0));
        }
        let (t1, b) = self.points.get(after)?;
        let (p1, v1) = halves(&b.mean);
        let h = t1 - t0;
        if h > max_gap_s {
            return None;
        }
        let s = (time_s - t0) / h;
        let (s2, s3) = (s * s, s * s * s);
        let p = p0 * (2.0 * s3 - 3.0 * s2 + 1.0)
            + v0 * (h * (s3 - 2.0 * s2 + s))
            + p1 * (3.0 * s2 - 2.0 * s3)
            + v1 * (h * (s3 - s2));
        let v = (p1 - p0) * (6.0 * (s - s2) / h) + v0 * (3.0 * s2 - 4.0 * s + 1.0) + v1 * (3.0 * s2 - 2.0 * s);
        Some((p, v))
    }
}

/// Position and velocity of a state.
pub fn halves(x: &Vector4<f64>) -> (Vector2<f64>, Vector2<f64>) {
    (Vector2::new(x[0], x[2]), Vector2::new(x[1], x[3]))
}

/// A box of the given size about a state.
pub(super) fn extent_about(x: &Vector4<f64>, size: [f64; 2]) -> Extent {
    Extent { left_px: x[0] - size[0] / 2.0, top_px: x[2] - size[1] / 2.0, width_px: size[0], height_px: size[1] }
}

/// Constant-velocity prediction by the filters' own model.
fn predict(b: &Gaussian<4>, dt_s: f64, density: f64) -> Option<Gaussian<4>> {
    let model = ConstantVelocity::continuous(density).ok()?;
    let phi = model.transition(dt_s, &b.mean);
    Some(Gaussian { mean: phi * b.mean, cov: phi * b.cov * phi.transpose() + model.process_noise(dt_s) })
}
