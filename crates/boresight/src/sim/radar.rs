//! Simulated radars: plots in range and azimuth (or position) of any truth, with misses, clutter, bias, silence and delay.
//!
//! Source: the usual plot model (Y. Bar-Shalom, P. K. Willett, X. Tian, *Tracking and Data Fusion*, 2011, ch. 1): each target in
//! the field is detected with P_D, measured with Gaussian noise and a constant bias; clutter is Poisson in number and uniform over
//! the field's area. Azimuth from +x towards +y. Range and azimuth become positions without the bias of the conversion
//! ([`boresight_filters::converted`]).
//! A radar is fed the truth frame by frame ([`Radar::see`]) and gives its scans in between: positions at its own times are cubic
//! Hermite interpolations of the frames' positions and velocities. So it can look at a scene, a table of tracks or real trajectories.
//! Symbols: px (or m, whatever the truth has), s, rad inside, degrees in the configuration. Randomness: stream (Radar, scan number),
//! keyed by the radar's number. Limits: one instant a scan (no rotation of the antenna); walls and occluders do not shade;
//! a target is seen from its second frame on.

use super::radar_config::{Measures, RadarConfig};
use super::random::{Purpose, Seed};
use crate::{Detection, FrameIndex, Result, Scan, Timestamp, TrackId, TrackState};
use boresight_filters::converted::{Polar, converted};
use nalgebra::{Matrix2, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

/// What is known of a plot beside its detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotTruth {
    /// Measured range, px, and azimuth, rad (of the position, where that is measured).
    pub polar: [f64; 2],
    /// The target it came from; none for clutter.
    pub target: Option<TrackId>,
}

/// One scan of a radar.
#[derive(Clone, Debug, PartialEq)]
pub struct RadarScan {
    /// Number, time (the radar's clock) and plots, clutter among them, in random order.
    pub scan: Scan,
    /// Where each plot came from.
    pub plots: Vec<PlotTruth>,
    /// When the report arrives (the radar's clock).
    pub arrival: Timestamp,
}

/// A radar at work.
#[derive(Clone, Debug)]
pub struct Radar {
    config: RadarConfig,
    seed: Seed,
    number: u64,
    next: u64,
    last: Option<(f64, Vec<TrackState>)>,
}

impl Radar {
    /// Starts the radar; `number` tells radars of one scene apart.
    /// # Errors
    /// [`crate::ErrorKind::Config`] that names a wrong parameter.
    pub fn new(config: &RadarConfig, seed: Seed, number: u64) -> Result<Self> {
        config.validate("radar")?;
        Ok(Self { config: config.clone(), seed, number, next: 0, last: None })
    }

    /// Takes the truth at the next time (s, growing) and returns the scans since the one before.
    /// # Errors
    /// Noise that the conversion refuses (a range of 0 is never measured).
    pub fn see(&mut self, time_s: f64, truth: &[TrackState]) -> Result<Vec<RadarScan>> {
        let mut scans = Vec::new();
        let before = self.last.take();
        loop {
            let t = self.config.first_scan_s + self.next as f64 * self.config.scan_period_s;
            // Equal times that differ by rounding alone are one time.
            if t > time_s + 1e-9 {
                break;
            }
            let number = self.next;
            self.next += 1;
            if self.config.silent_s.iter().any(|[a, b]| (*a..=*b).contains(&t)) {
                continue;
            }
            let targets: Vec<(TrackId, Vector2<f64>)> = match &before {
                _ if (t - time_s).abs() <= 1e-9 => truth.iter().map(|s| (s.id, place(s))).collect(),
                Some((t0, old)) => between(*t0, old, time_s, truth, t),
                None => continue,
            };
            scans.push(self.scan(number, t, &targets)?);
        }
        self.last = Some((time_s, truth.to_vec()));
        Ok(scans)
    }

    fn scan(&self, number: u64, t: f64, targets: &[(TrackId, Vector2<f64>)]) -> Result<RadarScan> {
        // Radars of one scene draw from streams 2⁴⁰ scans apart.
        let mut rng = self.seed.stream(Purpose::Radar, 1 + number + (self.number << 40));
        let origin = Vector2::from(self.config.position_px);
        let mut found: Vec<(f64, Detection, PlotTruth)> = Vec::new();
        for (id, at) in targets {
            // All draws are made for every target: one that is missed changes nothing for the others.
            let u: f64 = rng.random();
            let noise = [StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng)];
            let d = at - origin;
            if u < self.config.detection_probability && self.in_field(d) {
                let (detection, polar) = self.plot(d, noise)?;
                found.push((rng.random(), detection, PlotTruth { polar, target: Some(*id) }));
            } else {
                let _: f64 = rng.random();
            }
        }
        for _ in 0..self.n_clutter(&mut rng) {
            let (u, v): (f64, f64) = (rng.random(), rng.random());
            let [near, far] = self.config.range_px;
            let [from, to] = self.config.sector_deg.map(f64::to_radians);
            // Uniform over the area, not over the range.
            let r = (near * near + u * (far * far - near * near)).sqrt().max(1e-6 * far);
            let a = from + v * (to - from);
            let noise = [StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng)];
            let (detection, polar) = self.plot(r * Vector2::new(a.cos(), a.sin()), noise)?;
            found.push((rng.random(), detection, PlotTruth { polar, target: None }));
        }
        // In random order: the place in the list says nothing of the target.
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let clock = t + self.config.clock_ahead_s;
        let (detections, plots) = found.into_iter().map(|(_, d, p)| (d, p)).unzip();
        let time = Timestamp::from_secs_f64(clock);
        Ok(RadarScan {
            scan: Scan::at(FrameIndex(number), time).with_detections(detections),
            plots,
            arrival: Timestamp::from_secs_f64(clock + self.config.delay_s),
        })
    }

    fn n_clutter(&self, rng: &mut ChaCha8Rng) -> usize {
        Poisson::new(self.config.clutter_per_scan).map_or(0, |p| p.sample(rng) as usize)
    }

    fn in_field(&self, d: Vector2<f64>) -> bool {
        let [near, far] = self.config.range_px;
        let [from, to] = self.config.sector_deg;
        let turned = (d.y.atan2(d.x).to_degrees() - from).rem_euclid(360.0);
        (near..=far).contains(&d.norm()) && d.norm() > 0.0 && turned <= to - from
    }

    /// Measures a target at `d` from the radar.
    fn plot(&self, d: Vector2<f64>, noise: [f64; 2]) -> Result<(Detection, [f64; 2])> {
        let origin = Vector2::from(self.config.position_px);
        let (position, cov, polar) = match &self.config.measures {
            Measures::Position(e) => {
                let z = d + Vector2::from(e.bias_px) + e.std_px * Vector2::from(noise);
                (origin + z, Matrix2::identity() * e.std_px * e.std_px, [z.norm(), z.y.atan2(z.x)])
            }
            Measures::RangeAzimuth(e) => {
                let sigma = e.azimuth_std_deg.to_radians();
                let range = (d.norm() + e.range_bias_px + e.range_std_px * noise[0]).abs().max(1e-9);
                let azimuth_rad = d.y.atan2(d.x) + e.azimuth_bias_deg.to_radians() + sigma * noise[1];
                let polar = Polar { range, azimuth_rad, range_std: e.range_std_px, azimuth_std_rad: sigma };
                let m = converted(&polar, &origin)?;
                (m.position, m.cov, [range, azimuth_rad])
            }
        };
        Ok((Detection::at(position, cov), polar))
    }
}

fn place(s: &TrackState) -> Vector2<f64> {
    Vector2::new(s.kinematics.mean[0], s.kinematics.mean[2])
}

/// Positions at `t` of the targets that are in both truths.
fn between(t0: f64, old: &[TrackState], t1: f64, new: &[TrackState], t: f64) -> Vec<(TrackId, Vector2<f64>)> {
    let h = t1 - t0;
    let s = (t - t0) / h;
    let (s2, s3) = (s * s, s * s * s);
    let velocity = |k: &TrackState| Vector2::new(k.kinematics.mean[1], k.kinematics.mean[3]);
    new.iter()
        .filter_map(|b| {
            let a = old.iter().find(|a| a.id == b.id)?;
            let p = place(a) * (2.0 * s3 - 3.0 * s2 + 1.0)
                + velocity(a) * (h * (s3 - 2.0 * s2 + s))
                + place(b) * (3.0 * s2 - 2.0 * s3)
                + velocity(b) * (h * (s3 - s2));
            Some((b.id, p))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::radar_config::PolarErrors;
    use super::*;
    use crate::Extent;
    use crate::TrackStatus;
    use boresight_filters::Gaussian;
    use nalgebra::{Matrix4, Vector4};

    fn target(id: u64, t: f64) -> TrackState {
        // A parabola: the cubic between frames is exact.
        let mean = Vector4::new(100.0 + 3.0 * t + 0.1 * t * t, 3.0 + 0.2 * t, 50.0 * id as f64, 0.0);
        TrackState {
            id: TrackId(id),
            status: TrackStatus::Confirmed,
            kinematics: Gaussian { mean, cov: Matrix4::zeros() },
            extent: Extent::default(),
            detection: None,
            innovation: None,
            score: 1.0,
        }
    }

    fn run(config: &RadarConfig, n: u32) -> Vec<RadarScan> {
        let mut radar = Radar::new(config, Seed::new(5), 0).unwrap();
        (0..n)
            .flat_map(|k| radar.see(f64::from(k), &[target(1, f64::from(k)), target(2, f64::from(k))]).unwrap())
            .collect()
    }

    #[test]
    fn errors_misses_and_clutter_are_as_configured() {
        let e = PolarErrors { range_std_px: 2.0, azimuth_std_deg: 0.5, range_bias_px: 5.0, azimuth_bias_deg: -2.0 };
        let config = RadarConfig {
            measures: Measures::RangeAzimuth(e),
            detection_probability: 0.8,
            clutter_per_scan: 4.0,
            scan_period_s: 0.35,
            range_px: [20.0, 90_000.0],
            ..RadarConfig::default()
        };
        let scans = run(&config, 700);
        let n = scans.len() as f64;
        let (mut hits, mut clutter, mut dr, mut da, mut nees) = (0.0, 0.0, Vec::new(), Vec::new(), 0.0);
        for s in &scans {
            for (d, p) in s.scan.detections.iter().zip(&s.plots) {
                let Some(id) = p.target else {
                    clutter += 1.0;
                    continue;
                };
                hits += 1.0;
                let truth = place(&target(id.0, s.scan.time.as_secs_f64()));
                dr.push(p.polar[0] - truth.norm());
                da.push((p.polar[1] - truth.y.atan2(truth.x)).to_degrees());
                // The covariance lies along the biased line of sight: it must cover the way to the biased truth.
                let (r, a) = (truth.norm() + 5.0, truth.y.atan2(truth.x) - 2f64.to_radians());
                let off = d.position - r * Vector2::new(a.cos(), a.sin());
                nees += off.dot(&(d.cov.try_inverse().unwrap() * off));
            }
        }
        let stats = |v: &[f64]| {
            let m = v.iter().sum::<f64>() / v.len() as f64;
            (m, (v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / v.len() as f64).sqrt())
        };
        let ((mr, sr), (ma, sa)) = (stats(&dr), stats(&da));
        // Five standard errors of about 3200 plots, and of 2000 scans.
        assert!((hits / (2.0 * n) - 0.8).abs() < 0.035, "P_D {}", hits / (2.0 * n));
        assert!((clutter / n - 4.0).abs() < 0.23, "clutter {}", clutter / n);
        assert!((mr - 5.0).abs() < 0.18 && (sr - 2.0).abs() < 0.13, "{mr} {sr}");
        assert!((ma + 2.0).abs() < 0.045 && (sa - 0.5).abs() < 0.035, "{ma} {sa}");
        assert!((nees / hits - 2.0).abs() < 0.2, "{}", nees / hits);
    }

    #[test]
    fn scans_come_at_the_radars_own_times_and_silence_is_kept() {
        let config = RadarConfig {
            scan_period_s: 2.5,
            first_scan_s: 1.0,
            silent_s: vec![[5.0, 9.0]],
            clock_ahead_s: 0.25,
            delay_s: 3.0,
            ..RadarConfig::default()
        };
        let scans = run(&config, 20);
        let times: Vec<f64> = scans.iter().map(|s| s.scan.time.as_secs_f64()).collect();
        assert_eq!(times, [1.25, 3.75, 11.25, 13.75, 16.25, 18.75]);
        assert!(scans.iter().all(|s| s.scan.detections.len() == 2 && s.arrival.seconds_since(s.scan.time) == 3.0));
        assert_eq!(scans, run(&config, 20), "the same seed, the same plots");
        assert_ne!(run(&RadarConfig { delay_s: 1.0, ..config.clone() }, 20), scans);
    }

    #[test]
    fn targets_outside_the_field_are_not_seen() {
        let near = RadarConfig { range_px: [0.0, 120.0], sector_deg: [0.0, 60.0], ..RadarConfig::default() };
        for s in run(&near, 6) {
            let t = s.scan.time.as_secs_f64();
            let in_field = [1, 2].map(|id| place(&target(id, t)).norm() <= 120.0).iter().filter(|v| **v).count();
            assert_eq!(s.scan.detections.len(), in_field, "{t}");
        }
        assert!(run(&RadarConfig { sector_deg: [90.0, 180.0], ..near }, 6).iter().all(|s| s.plots.is_empty()));
    }

    #[test]
    fn a_wrong_radar_is_refused_with_its_place() {
        let bad = RadarConfig { sector_deg: [10.0, 380.0], ..RadarConfig::default() };
        assert!(bad.validate("radars[0]").unwrap_err().to_string().contains("radars[0].sector-deg"));
        let bad = RadarConfig { name: "../x".into(), ..RadarConfig::default() };
        assert!(bad.validate("radars[0]").is_err());
    }
}
