//! Starting tracks from the detections that no track took.
//!
//! Source: `docs/theory/track-management.md`: each left-over of the scan before, in order, with the nearest left-over
//! of this scan that a target can have reached. With a known spread of velocities the second point corrects a one-point
//! start instead, and its likelihood under that start says how much likelier a target is than clutter.
//! Limits: at most `max_tracks` tracks; at most 4096 candidates are looked at for each left-over.

use super::super::association_cost::Look;
use super::super::config::TrackerConfig;
use super::super::confirm::confirmation_gate::Proof;
use super::super::initiation::{BirthConfig, from_one_point, from_two_points};
use super::super::single_track::{Outcome, Track};
use super::super::tracker::{BATCH, Tracker};
use super::gate::{MOST_LOOKED_AT, Noise, normalised_square};
use crate::Scan;
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::Vector2;

/// A detection that no track took, kept for the next scan.
#[derive(Clone, Copy, Debug)]
pub(in crate::track) struct LeftOver {
    position: Vector2<f64>,
    noise: Noise,
}

/// Mean and variance of a new target's velocity (px/s, px²/s²), if anything is known of it.
pub(in crate::track) type VelocityPrior = Option<(Vector2<f64>, Vector2<f64>)>;

impl BirthConfig {
    /// What is known of a new target's velocity.
    pub(in crate::track) fn velocity_prior(&self) -> VelocityPrior {
        match self {
            Self::OnePoint(c) => Some((Vector2::zeros(), Vector2::repeat(c.velocity_std_px_per_s.powi(2)))),
            Self::TwoPoint(c) => c.velocity_std_px_per_s.map(|std| (Vector2::zeros(), Vector2::repeat(std * std))),
            Self::VelocityBounds(c) => {
                let (low, high) = (Vector2::from(c.min_px_per_s), Vector2::from(c.max_px_per_s));
                // A uniform density over the box.
                Some((0.5 * (low + high), (high - low).map(|w| w * w / 12.0)))
            }
        }
    }
}

impl Tracker {
    /// Starts tracks from what is left over, and keeps the rest for the next scan.
    pub(in crate::track) fn start(&mut self, scan: &Scan) {
        let prior = self.config.birth.velocity_prior();
        if let BirthConfig::OnePoint(_) = self.config.birth {
            for j in 0..scan.detections.len() {
                if !self.used[j] && self.has_room() && self.config.proof.may_start(scan.detections[j].score) {
                    self.begin(scan, j, None, prior, 0.0);
                }
            }
            return;
        }
        let dt_s = scan.time.seconds_since(self.left_over_time);
        let left_over = std::mem::take(&mut self.left_over);
        if dt_s > 0.0 {
            let far = self.config.max_speed_px_per_s * dt_s;
            for (k, first) in left_over.iter().enumerate() {
                if !self.has_room() {
                    break;
                }
                if k % BATCH == 0 {
                    let batch = left_over[k..].iter().take(BATCH).map(|l| l.position);
                    let grid = self.table.grid();
                    std::hint::black_box(batch.fold(0, |sum, p| sum ^ grid.touch(p.x, p.y, far, far)));
                }
                if let Some(j) = self.partner(scan, first, dt_s) {
                    self.used[j] = true;
                    self.begin(scan, j, Some(first), prior, dt_s);
                }
            }
        }
        self.left_over = left_over;
        self.left_over.clear();
        for (j, d) in scan.detections.iter().enumerate() {
            if !self.used[j] && self.config.proof.may_start(d.score) {
                self.left_over.push(LeftOver { position: d.position, noise: self.table.noise(j as u32) });
            }
        }
        self.left_over_time = scan.time;
    }

    fn has_room(&self) -> bool {
        self.tracks.len() < self.config.max_tracks as usize
    }

    /// P_D l / λ of a second point when nothing is known of the velocity: uniform over what the speed lets it reach.
    fn uniform_ratio(&self, dt_s: f64, clutter: f64) -> f64 {
        let area_px2 = std::f64::consts::PI * (self.config.max_speed_px_per_s * dt_s).powi(2);
        self.config.detection_probability / (area_px2 * clutter).max(1e-200)
    }

    /// Starts one track from a detection, and the left-over before it if there is one.
    fn begin(&mut self, scan: &Scan, detection: usize, first: Option<&LeftOver>, prior: VelocityPrior, dt_s: f64) {
        let d = &scan.detections[detection];
        let n = self.table.noise(detection as u32);
        let config: &TrackerConfig = &self.config;
        let (belief, ratio) = match (first, prior) {
            (Some(first), Some((velocity, variance))) => {
                let start = from_one_point(&first.position, &first.noise.matrix(), velocity, variance);
                let Ok(mut belief) = config.belief(&start, d.extent.height_px) else { return };
                if belief.predict(dt_s).is_err() {
                    return;
                }
                let p = belief.predicted();
                let s = p.cov + n.matrix();
                let density = (-0.5 * normalised_square(&(d.position - p.mean), &s)).exp()
                    / (std::f64::consts::TAU * s.determinant().sqrt());
                let measurement = Measurement { position: d.position, cov: n.matrix() };
                if belief.update(&[Weighted { measurement, weight: 1.0 }]).is_err() {
                    return;
                }
                (
                    belief,
                    config.detection_probability * density / self.clutter.at(d.position.x, d.position.y).max(1e-200),
                )
            }
            (Some(first), None) => {
                let start = from_two_points(&first.position, &first.noise.matrix(), &d.position, &n.matrix(), dt_s);
                let Ok(belief) = config.belief(&start, d.extent.height_px) else { return };
                (belief, self.uniform_ratio(dt_s, self.clutter.at(d.position.x, d.position.y)))
            }
            (None, prior) => {
                let (velocity, variance) = prior.unwrap_or_default();
                let start = from_one_point(&d.position, &n.matrix(), velocity, variance);
                let Ok(belief) = config.belief(&start, d.extent.height_px) else { return };
                (belief, 1.0)
            }
        };
        let n_points = if first.is_some() { 2 } else { 1 };
        let mut track = Track {
            id: self.next_id,
            belief,
            life: config.life.begin(n_points, scan.time.ns, self.clutter.at(d.position.x, d.position.y), ratio),
            look: Look::of(d),
            twin_since_ns: None,
            anchor: [d.position.x, d.position.y, n.xx.max(n.yy).sqrt()],
            proof: Proof::begin([d.position.x, d.position.y], self.table.camera, d.score),
        };
        let outcome = Outcome { hit: true, detection: Some(detection as u32), ..Outcome::default() };
        self.states.push(track.state(&outcome, config, self.table.camera));
        self.tracks.push(track);
        self.next_id += 1;
    }

    /// The nearest left-over detection that a target at `first` can have reached.
    fn partner(&self, scan: &Scan, first: &LeftOver, dt_s: f64) -> Option<usize> {
        let far = self.config.max_speed_px_per_s * dt_s;
        let mut best: Option<(f64, u32)> = None;
        let mut looked_at = 0;
        self.table.grid().near(first.position.x, first.position.y, far, far, |p| {
            looked_at += 1;
            let (dx, dy) = (p.x - first.position.x, p.y - first.position.y);
            let distance2 = dx * dx + dy * dy;
            let nearer = best.is_none_or(|(d, i)| distance2 < d || (distance2 == d && p.index < i));
            let possible = match &self.config.birth {
                BirthConfig::VelocityBounds(b) => [dx, dy]
                    .iter()
                    .enumerate()
                    .all(|(a, d)| (b.min_px_per_s[a]..=b.max_px_per_s[a]).contains(&(d / dt_s))),
                _ => true,
            };
            if distance2 <= far * far && nearer && possible && !self.used[p.index as usize] {
                best = Some((distance2, p.index));
            }
            looked_at < MOST_LOOKED_AT
        });
        debug_assert!(best.is_none_or(|(_, i)| (i as usize) < scan.detections.len()));
        best.map(|(_, i)| i as usize)
    }
}
