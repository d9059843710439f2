//! What a first pass over the detections tells of the noise and the motion of the targets, written into the tracker's configuration.
//!
//! Source: our own; the estimate is in [`fit`]. The tracker runs with what was assumed; the detections of the tracks that it confirmed are the
//! series whose innovations are made as probable as possible.
//! Errors that last from scan to scan ([`correlated`]) are told from motion and added to the covariances that are stated.
//! Where the caller allows it, targets whose velocity is forgotten ([`forgetful`]) get the model of such a motion.
//! Limits: a filter that is not of constant velocity at first keeps what is assumed, since what one model calls noise another calls motion; detections that several tracks share tell nothing, nor does a position that is the one before; with fewer than [`LEAST_STEPS`] of the others all stays as assumed.

mod correlated;
pub(super) mod fit;
pub(super) mod follow;
mod forgetful;
mod forgotten;
pub(super) mod given;
mod persistence;

use super::digits::round;
use super::first_scans::first;
use super::quantile::{WITHIN_ONE, quantile};
use crate::io::LengthUnit;
use crate::tempo::Tempo;
use crate::track::{FilterConfig, TrackerParameters};
use crate::{Config, Result, Scan};
use fit::{MOST_STEPS, Noise, Step, fit};
use follow::{Followed, follow};
use forgetful::forgetful;
use given::{assumed, put};
use std::collections::BTreeMap;

/// Fewer detections of confirmed tracks than this tell no noise: the innovations of these in two axes tell a variance to a quarter of itself, √(2 / 36), and the prior
/// holds what they do not tell.
const LEAST_STEPS: usize = 20;
/// How long targets are one detection when they pass each other, s of video.
const MERGED_S: f64 = 1.0;

/// The motions that targets may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motions {
    /// Constant velocity, changed by a white acceleration.
    Driven,
    /// That, or a velocity that is forgotten: points, whose places are what is measured of them. Boxes and regions wander about their target.
    DrivenOrForgetful,
}

/// Runs the tracker over `scans` as configured and replaces the assumed noise by what its tracks show; `area_px2` is the field's,
/// `unit` what positions are in.
/// # Errors
/// Scans that the tracker refuses.
pub fn learn(
    scans: &[Scan],
    area_px2: f64,
    unit: LengthUnit,
    motions: Motions,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<()> {
    if !config.tracker.filter.is_constant_velocity() {
        reasons.push("The filter is not of constant velocity: noise and motion stay as assumed.".to_string());
        return Ok(());
    }
    let scans = first(scans);
    let tracks = follow(scans, &config.tracker)?;
    let n_steps: usize = tracks.values().map(|t| t.steps.len()).sum();
    if n_steps < LEAST_STEPS {
        reasons.push(format!(
            "{n_steps} detections of confirmed tracks in the first pass: noise and motion stay as assumed."
        ));
        return Ok(());
    }
    let every = n_steps.div_ceil(MOST_STEPS);
    let tempo = Tempo::of_scans(scans);
    let least_density = tempo.density(fit::LEAST);
    // The deviation by the point of the magnitudes: the tails, where a target came apart, do not count.
    let size_std = quantile(&mut size_wander(&tracks, tempo.stretched(MERGED_S)), WITHIN_ONE);
    let series: Vec<Vec<Step>> = tracks.into_values().step_by(every).map(|t| t.steps).collect();
    let t = &mut config.tracker;
    let before = assumed(&TrackerParameters::of(t));
    let speed_std = t.max_speed_px_per_s / 3.0;
    let mut found = fit(&series, before, least_density, speed_std, area_px2);
    let mut motion = None;
    // A filter that was named has the model that it was named with.
    if motions == Motions::DrivenOrForgetful && t.filter == FilterConfig::default() {
        let assume = persistence::Assumed { noise: before, least_density, speed_std, area_px2 };
        if let Some((noise, forgets)) = forgetful(&series, scans, assume, &found, t)? {
            found = Noise { density: found.density, density_per_height2: found.density_per_height2, ..noise };
            t.filter.model = forgets.model();
            motion = Some(forgets);
        }
    }
    t.merged_measurements.edge_std_px = round(size_std);
    put(&found, least_density, t);
    // The motion of a camera that moves is known with errors that last as well.
    let rests = |s: &Scan| s.camera_motion.is_none_or(|m| m.now_from_before.is_identity());
    let may_last = unit == LengthUnit::Pixel && motion.is_none() && scans.iter().all(rests);
    let lasts = if may_last { correlated::find(&series, &found, speed_std, area_px2) } else { None };
    t.correlated_error_px = lasts.map_or(0.0, |c| round(c.position_px));
    // Points have no boxes.
    let part = |value: f64, of: &str| if value > 0.0 { format!(" and {value:.4}{of}") } else { String::new() };
    let px = unit.sign();
    let moves = match motion {
        Some(p) => format!(
            "velocities of {:.3} {px}/s that are forgotten in {:.3} s (diffusion {:.3} {px}²/s an axis)",
            p.speed_std_px_per_s,
            p.memory_s,
            p.diffusion_px2_per_s()
        ),
        None => format!(
            "acceleration density {:.3} {px}²/s³{}",
            t.acceleration_density_px2_per_s3,
            part(t.acceleration_density_per_height2_per_s3, " heights²/s³")
        ),
    };
    reasons.push(format!(
        "Learnt from {n_steps} detections of {} tracks in {} scans: noise {:.2} times the stated variances, {:.3} {px}{} beyond them, {moves}.",
        series.len(),
        scans.len(),
        t.detection_covariance_scale,
        t.extra_noise_px,
        part(t.extra_noise_per_height, " of a box height"),
    ));
    if let Some(c) = lasts {
        reasons.push(format!(
            "Of that noise {:.3} px last for {:.2} to {:.2} s, which no innovation shows: covariances are stated with {:.3} px more.",
            c.std_px, c.memories_s[0], c.memories_s[1], c.position_px
        ));
    }
    Ok(())
}

/// How far widths and heights change within that time, s, over √2: px. The place of a member of a merged measurement is an edge and half of its own
/// size from before, and both are only known as well as that.
fn size_wander(tracks: &BTreeMap<u64, Followed>, merged_s: f64) -> Vec<f64> {
    let mut out = Vec::new();
    for t in tracks.values() {
        let mut now_s = 0.0;
        let times: Vec<f64> = t.steps.iter().map(|s| (now_s += s.dt_s, now_s).1).collect();
        let mut from = 0;
        for (to, time) in times.iter().enumerate() {
            while from < to && time - times[from + 1] >= merged_s {
                from += 1;
            }
            if time - times[from] >= merged_s {
                let change = t.sizes.iter().map(|s| (s[to] - s[from]).abs() / std::f64::consts::SQRT_2);
                out.extend(change);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{ModelConfig, TrackerConfig};
    use crate::{Detection, FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// The deviation learnt of a target at rest that is stated to be known to 0.1 px, one picture in five new with an error of `std`, the copies off by `digits`.
    fn learnt(std: f64, digits: f64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut at = [0.0; 2];
        let scans: Vec<Scan> = (0..600_u64)
            .map(|k| {
                if k % 5 == 0 {
                    at = [40.0, 30.0].map(|v| v + std * rng.sample::<f64, _>(StandardNormal));
                }
                let copied = at.map(|v| v + digits * rng.random_range(-1.0..1.0));
                let d = Detection::at(copied.into(), nalgebra::Matrix2::identity() * 0.01);
                let time = Timestamp::from_secs_f64(k as f64 * 0.04);
                Scan { detections: vec![d], ..Scan::at(FrameIndex(k), time) }
            })
            .collect();
        let mut config = Config::default();
        learn(&scans, 1e4, LengthUnit::Pixel, Motions::Driven, &mut config, &mut Vec::new()).unwrap();
        let t = &config.tracker;
        (0.01 * t.detection_covariance_scale + t.extra_noise_px.powi(2)).sqrt()
    }

    #[test]
    fn positions_that_are_copied_from_frame_to_frame_are_measured_once() {
        for (std, digits) in [(0.3, 0.0), (0.3, 5e-4), (0.1, 5e-4)] {
            let found = learnt(std, digits);
            assert!((found / std).ln().abs() < 0.3, "{found} px, {std} is the truth");
        }
    }

    #[test]
    fn errors_that_last_are_in_the_configuration_and_white_ones_are_not() {
        let learnt = |std: f64| {
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let mut errors = [[0.0; 2]; 12];
            // Memories of ten frames.
            let kept = f64::exp(-0.1);
            let scans: Vec<Scan> = (0..200_u64)
                .map(|k| {
                    errors
                        .iter_mut()
                        .flatten()
                        .for_each(|e| *e = kept * *e + std * (1.0 - kept * kept).sqrt() * normal());
                    let place =
                        |i: usize| [100.0 + 150.0 * (i % 4) as f64 + 0.5 * k as f64, 100.0 + 150.0 * (i / 4) as f64];
                    let seen = |(i, e): (usize, &[f64; 2])| [0, 1].map(|a| place(i)[a] + e[a] + 0.1 * normal());
                    let positions: Vec<[f64; 2]> = errors.iter().enumerate().map(seen).collect();
                    let at = |p: [f64; 2]| Detection::at(p.into(), nalgebra::Matrix2::identity() * 0.01);
                    let time = Timestamp::from_secs_f64(k as f64 * 0.04);
                    Scan { detections: positions.into_iter().map(at).collect(), ..Scan::at(FrameIndex(k), time) }
                })
                .collect();
            let (mut config, mut reasons) = (Config::default(), Vec::new());
            learn(&scans, 6e5, LengthUnit::Pixel, Motions::Driven, &mut config, &mut reasons).unwrap();
            (config.tracker.correlated_error_px, reasons.iter().any(|r| r.contains("no innovation shows")))
        };
        let (lasting, said) = learnt(0.06);
        assert!((0.03..0.08).contains(&lasting) && said, "{lasting}");
        assert_eq!(learnt(0.0), (0.0, false));
    }

    /// What is learnt of so many far from each other with steps of `step_px` an axis, and of others that go 6 px in each of 150 scans.
    fn learnt_of(n: usize, step_px: f64, n_going: usize, motions: Motions) -> TrackerConfig {
        let mut rng = ChaCha8Rng::seed_from_u64(31);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let mut at: Vec<[f64; 2]> =
            (0..n).map(|i| [100.0 + 200.0 * (i % 4) as f64, 100.0 + 200.0 * (i / 4) as f64]).collect();
        let scans: Vec<Scan> = (0..150_u64)
            .map(|k| {
                at.iter_mut().flatten().for_each(|v| *v += step_px * normal());
                let going = (0..n_going).map(|i| [6.0 * k as f64, 40.0 + 120.0 * i as f64]);
                let seen: Vec<[f64; 2]> = at.iter().copied().chain(going).collect();
                let seen = seen.iter().map(|p| p.map(|v| v + 0.1 * normal()));
                let detections = seen.map(|p| Detection::at(p.into(), nalgebra::Matrix2::identity() * 0.01)).collect();
                let time = Timestamp::from_secs_f64(k as f64 * 0.04);
                Scan { detections, ..Scan::at(FrameIndex(k), time) }
            })
            .collect();
        let mut config = Config::default();
        config.tracker.acceleration_density_px2_per_s3 = 100.0;
        config.tracker.max_speed_px_per_s = 150.0;
        let area_px2 = 1000.0 * 200.0 * (n / 4) as f64;
        learn(&scans, area_px2, LengthUnit::Pixel, motions, &mut config, &mut Vec::new()).unwrap();
        config.tracker
    }

    #[test]
    fn particles_that_diffuse_are_followed_again_until_what_is_learnt_stays() {
        // What is assumed at first loses one step in three.
        let tracker = learnt_of(12, 1.2, 0, Motions::DrivenOrForgetful);
        let ModelConfig::OrnsteinUhlenbeck(c) = &tracker.filter.model else { panic!("{:?}", tracker.filter) };
        let grows = 2.0 * c.speed_std_px_per_s.powi(2) * c.memory_s;
        assert!((grows / 36.0).ln().abs() < 0.1, "1.2² px² in 0.04 s: {grows} px²/s");
        let std = (0.01 * tracker.detection_covariance_scale + tracker.extra_noise_px.powi(2)).sqrt();
        assert!(std < 0.25, "0.1 px is the truth: {std}");
        assert!(learnt_of(12, 1.2, 0, Motions::Driven).filter.is_constant_velocity());
    }

    #[test]
    fn before_many_at_rest_those_that_go_are_followed() {
        let forgets =
            |n, n_going| !learnt_of(n, 0.0, n_going, Motions::DrivenOrForgetful).filter.is_constant_velocity();
        assert!(forgets(12, 0), "what rests has no velocity");
        assert!(!forgets(12, 3), "of what goes 6 px a scan nothing would be followed");
        assert!(!forgets(600, 1), "nor of one before hundreds at rest");
    }
}
