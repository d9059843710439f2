//! Many small things alike all over the frame: particles under a microscope, seeds, stars; the spot detector at their size.
//!
//! Source: our own. Particles that move each their own way leave nothing that moves as one, so the camera's motion is not known; a
//! wood or a street is known to stand. Size: the half-height boxes of isolated blobs; a spot with its soft edge is about 2.45 times as wide.

use super::digits::round;
use super::looks;
use super::scene::{Camera, Scene};
use super::spot_size;
use super::spread::spread;
use super::stretch;
use super::value_step::value_step;
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::vision::config::DetectorConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::vision::threshold::{Polarity, SpotConfig, ThresholdConfig};
use crate::{Config, Frame, Result, SourceInfo};
use statrs::distribution::{ContinuousCDF as _, Normal};

/// Least blobs a frame, beyond those of the other sign.
const LEAST: f64 = 60.0;
/// Frames looked at.
const LOOKS: usize = 4;
/// Largest ratio of the upper to the lower quartile of their widths.
const MOST_SPREAD: f64 = 1.6;
/// Least ratio of their number to that of blobs of the other sign.
const MOST_SIDED: f64 = 4.0;
/// Score of a blob that counts here: dim ones give the size as well.
const SCORE: f64 = 3.0;
/// Width at half height of a particle where no blob was seen, px: a point through optics that suit their pixels.
const ASSUMED_WIDTH_PX: f64 = 3.0;
/// Widest blob taken for a particle, px.
const WIDEST_PX: u32 = 40;

/// Most detections a frame.
const MOST_DETECTIONS: u32 = 20_000;
/// Side of the smoothing box, applied twice, in units of the width at half height; half of the diameter at most.
const SMOOTH_PER_WIDTH: f64 = 0.66;

/// Expected false detections for each blob seen: the tracks' existence weighs them, and a dim particle is worth ten.
pub(super) const FALSE_SHARE: f64 = 0.1;
/// The same where sizes are compared by what they find.
const FALSE_SHARE_COUNTED: f64 = 0.001;
/// Least and largest threshold, standard deviations.
const THRESHOLDS: [f64; 2] = [2.0, 5.0];

/// What was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particles {
    /// Brighter or darker than their surroundings.
    pub polarity: Polarity,
    /// Blobs a frame.
    pub per_frame: f64,
    /// Median width at half height, px.
    pub width_px: f64,
    /// Step of the pixels' values, counts: the least response.
    pub step: f64,
}

impl Particles {
    /// Largest speed that is followed, px/s: half of the width with the soft edge from frame to frame.
    pub fn most_px_per_s(&self, interval_s: f64) -> f64 {
        0.5 * spot_size::whole_px(self.width_px) / interval_s
    }
}

/// Blobs in the frames, and what they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counted {
    /// What was seen.
    pub seen: Particles,
    /// Whether they are of one size and sign, many, and all over the frame.
    fills: bool,
}

impl Counted {
    /// What was seen, if the frames are full of it.
    pub fn particles(self) -> Option<Particles> {
        self.fills.then_some(self.seen)
    }
}

/// Particles, if the frames are full of them; what was counted for that is left in `counted`.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(
    frames: &[Frame],
    scene: &Scene,
    info: &SourceInfo,
    n_threads: usize,
    counted: &mut Option<Counted>,
) -> Result<Option<Particles>> {
    // What stands before a fixed camera is scenery.
    if scene.camera == Camera::Fixed && scene.regions < LEAST {
        return Ok(None);
    }
    Ok(counted.insert(count(frames, info, n_threads)?).particles())
}

/// The blobs of the polarity of which there are more of one size all over the frame, else of which there are more; what they are.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn count(frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<Counted> {
    let step = value_step(frames);
    let none = Particles { polarity: Polarity::Bright, per_frame: 0.0, width_px: ASSUMED_WIDTH_PX, step };
    let (mut best, mut most, mut counts) = (None::<Particles>, none, [0.0; 2]);
    for (polarity, count) in [Polarity::Bright, Polarity::Dark].into_iter().zip(&mut counts) {
        let isolated =
            IsolatedConfig { polarity, min_score: SCORE, max_side_px: WIDEST_PX, ..IsolatedConfig::default() };
        let mut config = DetectorConfig { threshold: ThresholdConfig::Isolated(isolated), ..DetectorConfig::default() };
        config.cluster.min_area_px = Some(3);
        let scans = looks::scans(&config, spread(frames, LOOKS), info, n_threads)?;
        let (mut n, mut looks, mut widths, mut quarters) = (0usize, 0usize, Vec::new(), [0usize; 4]);
        for scan in &scans {
            looks += 1;
            n += scan.detections.len();
            for d in &scan.detections {
                widths.push((d.extent.width_px * d.extent.height_px).sqrt());
                let right = 2.0 * d.position.x > info.width as f64;
                let low = 2.0 * d.position.y > info.height as f64;
                quarters[usize::from(right) + 2 * usize::from(low)] += 1;
            }
        }
        widths.sort_by(f64::total_cmp);
        let per_frame = n as f64 / looks.max(1) as f64;
        let everywhere = quarters.iter().all(|q| 10 * q >= n);
        *count = per_frame;
        let at = |share: f64| widths.get((share * widths.len() as f64) as usize).copied().unwrap_or(0.0);
        let width_px = at(0.5);
        let alike = at(0.75) <= MOST_SPREAD * at(0.25);
        let seen = Particles { polarity, per_frame, width_px, step };
        if everywhere && alike && per_frame >= LEAST && best.is_none_or(|b| per_frame > b.per_frame) {
            best = Some(seen);
        }
        if per_frame > most.per_frame {
            most = seen;
        }
    }
    // Texture, and what a codec makes of noise, is as often dark as bright.
    let other = counts[0].min(counts[1]);
    let best = best.filter(|b| b.per_frame >= MOST_SIDED * other && b.per_frame - other >= LEAST);
    Ok(Counted { seen: best.unwrap_or(most), fills: best.is_some() })
}

/// Threshold in standard deviations of the smoothed noise at which this share of a frame's detections is expected to be noise: one independent look for
/// each disc of the spot's size.
fn threshold(particles: &Particles, size_px: f64, false_share: f64, info: &SourceInfo) -> f64 {
    let looks = (info.width * info.height) as f64 / (0.25 * std::f64::consts::PI * size_px * size_px);
    let tail = (false_share * particles.per_frame / looks).clamp(1e-12, 0.5);
    Normal::standard().inverse_cdf(1.0 - tail).clamp(THRESHOLDS[0], THRESHOLDS[1])
}

/// The detector for spots of this diameter.
fn spot_config(particles: &Particles, size_px: f64, false_share: f64, info: &SourceInfo) -> SpotConfig {
    SpotConfig {
        size_px: round(size_px),
        k: round(threshold(particles, size_px, false_share, info)),
        polarity: particles.polarity,
        min_contrast: round(particles.step),
        surround: 1.0,
        smooth_px: Some(round((SMOOTH_PER_WIDTH * particles.width_px).min(0.5 * size_px).max(1.0))),
    }
}

/// The same as a whole.
fn detector(spot: SpotConfig) -> DetectorConfig {
    DetectorConfig {
        threshold: ThresholdConfig::Spot(spot),
        max_detections: Some(MOST_DETECTIONS),
        ..DetectorConfig::default()
    }
}

/// Writes detector and tracker.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn configure(
    particles: &Particles,
    frames: &[Frame],
    info: &SourceInfo,
    n_threads: usize,
    interval_s: f64,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<()> {
    let whole_px = spot_size::whole_px(particles.width_px);
    let at = |size_px: f64| detector(spot_config(particles, size_px, FALSE_SHARE_COUNTED, info));
    let size_px = spot_size::find(particles.width_px, particles.per_frame, frames, info, n_threads, at)?;
    let spot = spot_config(particles, size_px, FALSE_SHARE, info);
    let dark = particles.polarity == Polarity::Dark;
    reasons.push(format!(
        "Some {:.0} {} blobs a frame all over it, {:.1} px wide at half their height, nothing that moves as one: particles. So spots of {} px are \
         detected, one for each peak{}.",
        particles.per_frame,
        if dark { "dark" } else { "bright" },
        particles.width_px,
        spot.size_px,
        if size_px < whole_px {
            format!(": as many are found again in the next frame as with their soft edge, {whole_px:.1} px, and neighbours draw each other less")
        } else {
            String::new()
        },
    ));
    config.detector = detector(spot);
    config.detector.camera = CameraConfig::Fixed;
    let tracker = &mut config.tracker;
    *tracker = stretch::tracker(Tempo::of(interval_s));
    let step_px = 0.1 * whole_px;
    tracker.acceleration_density_px2_per_s3 = round(step_px * step_px / interval_s.powi(3));
    tracker.max_speed_px_per_s = round(particles.most_px_per_s(interval_s));
    tracker.coast_s = round(3.0 * interval_s);
    tracker.coast_scans = 3;
    tracker.field_px = Some([info.width as f64, info.height as f64]);
    reasons.push(format!(
        "None goes farther than half its width with the soft edge ({:.1} px) from frame to frame.",
        0.5 * whole_px
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::choose;
    use super::super::in_memory::described;
    use super::*;
    use crate::{FrameIndex, Image, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIZE: usize = 240;

    /// Twelve frames of things at these places that diffuse by so many pixels a frame, as bright at the distance r px as `light` says of each.
    fn frames_of(mut at: Vec<[f64; 2]>, step_px: f64, light: impl Fn(usize, f64) -> f64) -> Vec<Frame> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let frame = |k: u64| {
            at.iter_mut().flatten().for_each(|v| *v += step_px * rng.sample::<f64, _>(StandardNormal));
            let value = |i: usize| {
                let far = |p: &[f64; 2]| ((i % SIZE) as f64 - p[0]).hypot((i / SIZE) as f64 - p[1]);
                200.0 + at.iter().enumerate().map(|(i, p)| light(i, far(p))).sum::<f64>()
            };
            let values = (0..SIZE * SIZE).map(|i| (value(i) + 14.0 * rng.sample::<f64, _>(StandardNormal)) as u16);
            let pixels = Pixels::Gray16(Image::from_vec(SIZE, SIZE, values.collect()).unwrap());
            Frame { index: FrameIndex(k), time: Timestamp::from_secs_f64(0.1 * k as f64), pixels }
        };
        (0..12).map(frame).collect()
    }

    /// What is chosen for thirty things that diffuse by a pixel a frame.
    fn chosen(light: impl Fn(f64) -> f64) -> ThresholdConfig {
        let at = (0..30).map(|i| [24.0 + 38.0 * f64::from(i % 6), 24.0 + 48.0 * f64::from(i / 6)]).collect();
        let (frames, info) = described(frames_of(at, 1.0, |_, r| light(r)));
        choose(&frames, &info, &Config::default()).unwrap().config.detector.threshold
    }

    #[test]
    fn bright_spots_are_no_cells_and_discs_are() {
        // A foot of eight pixels and more at five deviations of the smoothed noise, 3.5 at half height.
        let spots = chosen(|r| 500.0 * (-r * r / 4.5).exp());
        assert!(matches!(spots, ThresholdConfig::Spot(_)), "{spots:?}");
        let discs = chosen(|r| 200.0 / (1.0 + (2.0 * (r - 7.0)).exp()));
        assert!(matches!(discs, ThresholdConfig::Local(_)), "{discs:?}");
    }

    #[test]
    fn many_spots_before_a_camera_that_stands_are_particles() {
        // Of unlike brightness: the brightest ones are edges that stand.
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let at: Vec<[f64; 2]> = (0..110).map(|_| [(); 2].map(|()| SIZE as f64 * rng.random::<f64>())).collect();
        let heights: Vec<f64> = at.iter().map(|_| 200.0 * (0.9 * rng.sample::<f64, _>(StandardNormal)).exp()).collect();
        let frames = frames_of(at, 0.3, |i, r| heights[i] * (-r * r / 5.0).exp());
        let (frames, info) = described(frames);
        let scene = super::super::scene::look(&frames, &info).unwrap();
        assert!(scene.camera == Camera::Fixed && scene.regions < LEAST, "{:?} {}", scene.camera, scene.regions);
        let chosen = choose(&frames, &info, &Config::default()).unwrap().config.detector.threshold;
        assert!(matches!(chosen, ThresholdConfig::Spot(_)), "{chosen:?}");
    }
}
