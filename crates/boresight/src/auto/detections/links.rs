//! Which detections of a table follow each other from scan to scan, told by their boxes alone, and what these links say of the detector
//! and of the targets.
//!
//! A link joins two detections of neighbouring scans whose boxes overlap most of all, seen from both. False detections come and go; those
//! of a target are linked on both sides. Limits: targets that move by more than half their box from scan to scan are not linked.

use crate::auto::quantile::quantile;
use crate::track::association_cost::iou;
use crate::{Detection, Scan};

/// Least overlap of two linked boxes, intersection over union: that of a box and itself moved by 0.54 of its side.
const MIN_OVERLAP: f64 = 0.3;
/// Time over which a box's errors are one error: a detector's box wanders with the pose and the light, not from frame to frame, s.
const WANDER_S: f64 = 0.15;
/// Time over which a target's own manoeuvre shows, s.
const MANOEUVRE_S: f64 = 0.5;
/// Longest step that is linked, scan intervals: over a gap two boxes may be two targets'.
const MAX_INTERVALS: f64 = 1.5;
/// Pairs of boxes compared at most, a guard of time; what comes after is not looked at.
const MAX_COMPARED: usize = 20_000_000;
/// Detections at most that are followed for motion: the deviation of a 95 % point is then below half a percent.
const MAX_FOLLOWED: usize = 50_000;

/// Links from every looked-at scan to the next: the place there of each detection, or none.
pub(super) struct Links<'a> {
    scans: &'a [Scan],
    interval_s: f64,
    next: Vec<Vec<Option<u32>>>,
}

/// What the links of a table say, in units of a box height h.
pub(super) struct Motion {
    /// Deviation of a detection's centre beyond its stated covariance, h.
    pub(super) extra_noise: f64,
    /// Power density of a target's white acceleration, h²/s³.
    pub(super) density_per_s3: f64,
    /// Deviation of a target's velocity per axis, px/s.
    pub(super) speed_std_px_per_s: f64,
    /// Speed that one step in a thousand exceeds, px/s.
    pub(super) fastest_px_per_s: f64,
    /// Share of linked detections that go on in the next scan.
    pub(super) p_detection: f64,
    /// Steps that were measured.
    pub(super) n_steps: usize,
}

impl<'a> Links<'a> {
    /// Links the boxes of scans that lie `interval_s` apart, but for gaps.
    pub(super) fn of(scans: &'a [Scan], interval_s: f64) -> Self {
        let mut next = Vec::new();
        let mut compared = 0;
        for pair in scans.windows(2) {
            let (a, b) = (&pair[0].detections, &pair[1].detections);
            compared += a.len().saturating_mul(b.len());
            if compared > MAX_COMPARED {
                break;
            }
            if pair[1].time.seconds_since(pair[0].time) > MAX_INTERVALS * interval_s {
                next.push(vec![None; a.len()]);
                continue;
            }
            let best = |of: &Detection, among: &[Detection]| {
                let overlaps = among.iter().map(|d| iou(&of.extent, &d.extent));
                let best = overlaps.enumerate().max_by(|x, y| x.1.total_cmp(&y.1).then(y.0.cmp(&x.0)));
                best.filter(|b| b.1 >= MIN_OVERLAP).map(|b| b.0)
            };
            let forward = a.iter().map(|d| best(d, b));
            let mutual = forward.enumerate().map(|(i, j)| j.filter(|&j| best(&b[j], a) == Some(i)).map(|j| j as u32));
            next.push(mutual.collect());
        }
        Self { scans, interval_s, next }
    }

    /// Score of each detection that has a scan before and behind it, and whether it is linked to both.
    pub(super) fn supported(&self) -> Vec<(f32, bool)> {
        let mut out = Vec::new();
        for t in 1..self.next.len() {
            let mut before = vec![false; self.scans[t].detections.len()];
            self.next[t - 1].iter().flatten().for_each(|&j| before[j as usize] = true);
            let here = self.scans[t].detections.iter().zip(&self.next[t]).zip(before);
            out.extend(here.map(|((d, next), before)| (d.score, before && next.is_some())));
        }
        out
    }

    /// The detection `lag` scans on along the links.
    fn follow(&self, scan: usize, detection: usize, lag: usize) -> Option<usize> {
        (scan..scan + lag).try_fold(detection, |at, t| self.next.get(t)?[at].map(|j| j as usize))
    }

    /// Measures noise and motion on detections of at least this score; nothing if too few are linked.
    ///
    /// With noise σ in each centre and a white acceleration of density q, the second difference over a time T has the
    /// variance 6 σ² + 2 q T³ / 3: two lags give both. The shorter is that over which a box's own errors change, the longer
    /// that over which a manoeuvre shows. Deviations are 95 % points, so that a wrong link in twenty counts little.
    pub(super) fn motion(&self, min_score: f32) -> Option<Motion> {
        let interval_s = self.interval_s;
        let scans_in = |seconds: f64| (seconds / interval_s).round().clamp(1.0, 1000.0) as usize;
        let near_lag = scans_in(WANDER_S);
        let far_lag = scans_in(MANOEUVRE_S).max(near_lag + 1);
        let (mut near, mut far, mut speeds) = (Vec::new(), Vec::new(), Vec::new());
        let (mut n_before, mut n_through, mut stated2) = (0usize, 0usize, 0.0);
        let n_detections: usize = self.scans.iter().map(|s| s.detections.len()).sum();
        for t in (0..self.next.len()).step_by(n_detections.div_ceil(MAX_FOLLOWED).max(1)) {
            for (i, d) in self.scans[t].detections.iter().enumerate().filter(|(_, d)| d.score >= min_score) {
                let height = d.extent.height_px;
                if !(height > 0.0 && height.is_finite()) {
                    continue;
                }
                let Some(j) = self.follow(t, i, 1) else { continue };
                let (here, then) = (&self.scans[t], &self.scans[t + 1]);
                let step = then.detections[j].position - d.position;
                speeds.push(step.norm() / then.time.seconds_since(here.time));
                stated2 += 0.5 * d.cov.trace() / (height * height);
                if t + 1 < self.next.len() {
                    n_before += 1;
                    n_through += usize::from(self.follow(t + 1, j, 1).is_some());
                }
                for (lag, out) in [(near_lag, &mut near), (far_lag, &mut far)] {
                    let ends = self.follow(t, i, lag).and_then(|j| Some((j, self.follow(t + lag, j, lag)?)));
                    if let Some((j, k)) = ends {
                        let (b, c) = (&self.scans[t + lag].detections[j], &self.scans[t + 2 * lag].detections[k]);
                        let bend = (d.position - b.position * 2.0 + c.position) / height;
                        out.extend([bend.x.abs(), bend.y.abs()]);
                    }
                }
            }
        }
        if near.len() < 100 || far.len() < 20 {
            return None;
        }
        let growth = |lag: usize| 2.0 / 3.0 * (lag as f64 * interval_s).powi(3);
        let (v1, v2) = (deviation(&mut near).powi(2), deviation(&mut far).powi(2));
        let (g1, g2) = (growth(near_lag), growth(far_lag));
        // A 95 % point of n normal numbers is known to 0.95/√n of itself: a smaller growth than twice that, squared, is not seen.
        let unseen = 4.0 * 0.95 / (far.len() as f64).sqrt() * v2 / g2;
        let density = ((v2 - v1) / (g2 - g1)).max(unseen);
        // Errors of `near_lag` scans are one error, where the filter takes each for a new one: this white noise averages as slowly.
        let noise2 = near_lag as f64 * (v1 - density * g1).max(0.0) / 6.0;
        Some(Motion {
            extra_noise: (noise2 - stated2 / speeds.len() as f64).max(0.0).sqrt(),
            density_per_s3: density,
            // The 95 % point of a length of two normal coordinates is 2.448 deviations; the median would only tell of what stands.
            speed_std_px_per_s: quantile(&mut speeds, 0.95) / 2.448,
            fastest_px_per_s: quantile(&mut speeds, 0.999),
            p_detection: n_through as f64 / n_before.max(1) as f64,
            n_steps: speeds.len(),
        })
    }
}

/// Deviation of numbers of mean 0 of which one in twenty may be anything: their 95 % point over a normal one's.
fn deviation(magnitudes: &mut [f64]) -> f64 {
    quantile(magnitudes, 0.95) / 1.96
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extent, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn noise_acceleration_speed_and_gaps_of_a_simulated_table_are_found() {
        let (dt, height, sigma, a) = (1.0 / 25.0, 80.0, 2.0, 60.0);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = move || rng.sample::<f64, _>(StandardNormal);
        // Eight targets far from each other; each detection is there with probability 0.95 and moves by the law that is looked for.
        let mut targets: Vec<(Vector2<f64>, Vector2<f64>)> = (0..8)
            .map(|i| (Vector2::new(1000.0 * i as f64, 0.0), Vector2::new(40.0 * normal(), 40.0 * normal())))
            .collect();
        let mut drop = ChaCha8Rng::seed_from_u64(4);
        let scans: Vec<Scan> = (0..600)
            .map(|k| {
                let mut scan =
                    Scan { index: FrameIndex(k), time: Timestamp { ns: k as i64 * 40_000_000 }, ..Scan::default() };
                for (place, speed) in &mut targets {
                    let push = Vector2::new(a * normal(), a * normal());
                    *place += *speed * dt + push * (0.5 * dt * dt);
                    *speed = *speed * 0.99 + push * dt;
                    let seen = *place + Vector2::new(sigma * normal(), sigma * normal());
                    if drop.random::<f64>() < 0.95 {
                        let d = Detection::at(seen, Matrix2::identity());
                        scan.detections.push(d.with_extent(Extent::around(seen, 30.0, height)));
                    }
                }
                scan
            })
            .collect();
        let m = Links::of(&scans, dt).motion(f32::NEG_INFINITY).unwrap();
        // What the detections state themselves, 1 px, is no extra noise. Errors are taken to last `WANDER_S`: as if new in every scan,
        // they weigh as the noise whose mean over so many scans has their variance.
        let lag = (WANDER_S / dt).round();
        let noise = (m.extra_noise * height).hypot(1.0);
        assert!((noise / (sigma * lag.sqrt()) - 1.0).abs() < 0.1, "{noise}");
        // An acceleration new in every scan lasts for one.
        let acceleration = (m.density_per_s3 / dt).sqrt() * height;
        assert!((acceleration / a - 1.0).abs() < 0.25, "{acceleration}");
        assert!((m.p_detection - 0.95).abs() < 0.01, "{}", m.p_detection);
        assert!(m.fastest_px_per_s > m.speed_std_px_per_s && m.n_steps > 3000);
    }

    #[test]
    fn no_link_leaps_over_a_gap() {
        let boxed = |k: i64| Scan {
            time: Timestamp::from_ns(k * 40_000_000),
            detections: vec![Detection::at(Vector2::zeros(), Matrix2::identity()).with_extent(Extent::around(
                Vector2::zeros(),
                30.0,
                80.0,
            ))],
            ..Scan::default()
        };
        let scans: Vec<Scan> = [0, 1, 2, 5, 6].map(boxed).into();
        let supported: Vec<bool> = Links::of(&scans, 0.04).supported().iter().map(|s| s.1).collect();
        assert_eq!(supported, [true, false, false]);
    }
}
