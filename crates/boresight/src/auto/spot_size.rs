//! The size that spots are looked for at: the smallest that finds as many of them.
//!
//! Source: our own. A filter as wide as the whole spot finds the faintest ones; one no wider than half of its height tells neighbours apart that the wide one joins, and their light moves
//! its positions far less, but noise passes it more easily. Which of the two loses more is counted in some of the frames, with a threshold at which hardly any noise is among them.
//! Limits: things with parts of their own, rings and discs, fall apart under a narrow filter; where most of them do, the wide one stays.

use super::looks;
use super::near::Near;
use super::particles::{MOST_DETECTIONS, Particles};
use super::spread::spread;
use crate::vision::DetectorConfig;
use crate::vision::threshold::spot::DIAMETER_PER_WIDTH;
use crate::vision::threshold::{SpotConfig, ThresholdConfig};
use crate::{Frame, Result, Scan, SourceInfo};

/// Frames looked at.
const LOOKS: usize = 4;
/// Diameters in units of the spots' width at half height that are tried: with the soft edge, less it, and the width itself.
const DIAMETERS: [f64; 3] = [DIAMETER_PER_WIDTH, 1.5, 1.0];
/// Share of the spots that a smaller size may lose.
const LOST: f64 = 0.02;
/// Share of the spots that may fall apart into several.
const FALL_APART: f64 = 0.5;

/// The diameter to look for, px; `at` is what is looked for at a diameter.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn find(
    particles: &Particles,
    frames: &[Frame],
    info: &SourceInfo,
    n_threads: usize,
    at: impl Fn(f64) -> SpotConfig,
) -> Result<f64> {
    let (mut found, mut wide) = (Vec::new(), Vec::new());
    for diameter in DIAMETERS {
        let size_px = (diameter * particles.width_px).clamp(3.0, 99.0);
        let own = scans(at(size_px), frames, info, n_threads)?;
        if !wide.is_empty() && falls_apart(&wide, &own, 0.5 * DIAMETER_PER_WIDTH * particles.width_px) > FALL_APART {
            break;
        }
        found.push((size_px, n_detections(&own) as f64));
        if wide.is_empty() {
            wide = own;
        }
    }
    let most = found.iter().map(|f| f.1).fold(0.0, f64::max);
    let enough = found.iter().rev().find(|f| f.1 >= (1.0 - LOST) * most);
    Ok(enough.or(found.first()).map_or(DIAMETER_PER_WIDTH * particles.width_px, |f| f.0))
}

fn scans(spot: SpotConfig, frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<Vec<Scan>> {
    let config = DetectorConfig {
        threshold: ThresholdConfig::Spot(spot),
        max_detections: Some(MOST_DETECTIONS),
        ..DetectorConfig::default()
    };
    looks::scans(&config, spread(frames, LOOKS), info, n_threads)
}

fn n_detections(scans: &[Scan]) -> usize {
    scans.iter().map(|s| s.detections.len()).sum()
}

/// Share of what a wide filter finds in which a narrow one finds more than one.
fn falls_apart(wide: &[Scan], narrow: &[Scan], radius_px: f64) -> f64 {
    let mut n = 0;
    for (wide, narrow) in wide.iter().zip(narrow) {
        let near = Near::of(narrow);
        for d in &wide.detections {
            let mut inside = 0;
            near.within(d, radius_px, |_, _| inside += 1);
            n += usize::from(inside > 1);
        }
    }
    n as f64 / n_detections(wide).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::threshold::Polarity;
    use crate::{FrameIndex, Image, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// The diameter for things of `width_px` at half height, `places` of them in 300 x 300 pixels at random, as bright at r px as `light` says in deviations of the noise.
    fn found(width_px: f64, places: usize, light: impl Fn(f64) -> f64) -> f64 {
        const SIZE: usize = 300;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut frame = |k: u64| {
            let mut image = Image::filled(SIZE, SIZE, 0.0f32);
            image.as_mut_slice().iter_mut().for_each(|v| *v = 500.0 + 10.0 * rng.sample::<f32, _>(StandardNormal));
            for _ in 0..places {
                let at = [(); 2].map(|()| SIZE as f64 * rng.random::<f64>());
                for (x, y) in (-20..=20).flat_map(|y| (-20..=20).map(move |x| (x, y))) {
                    let [x, y] = [at[0] as i64 + x, at[1] as i64 + y];
                    if (0..SIZE as i64).contains(&x) && (0..SIZE as i64).contains(&y) {
                        let far = (x as f64 - at[0]).hypot(y as f64 - at[1]);
                        image.row_mut(y as usize)[x as usize] += (10.0 * light(far)) as f32;
                    }
                }
            }
            let pixels = Pixels::GrayF32(image);
            Frame { index: FrameIndex(k), time: Timestamp::from_secs_f64(0.1 * k as f64), pixels }
        };
        let frames: Vec<Frame> = (0..4).map(&mut frame).collect();
        let (frames, info) = super::super::in_memory::described(frames);
        let seen = Particles { polarity: Polarity::Bright, per_frame: places as f64, width_px, step: 0.0 };
        let at = |size_px: f64| SpotConfig {
            size_px,
            k: 4.5,
            min_contrast: 0.0,
            surround: 1.0,
            smooth_px: Some((0.66 * width_px).min(0.5 * size_px)),
            ..SpotConfig::default()
        };
        find(&seen, &frames, &info, 1, at).unwrap() / width_px
    }

    #[test]
    fn clear_spots_are_looked_for_at_their_width_and_faint_ones_as_a_whole() {
        let spot = |height: f64| move |r: f64| height * (-r * r / (2.0 * 1.7 * 1.7)).exp();
        assert_eq!(found(4.0, 250, spot(20.0)), 1.0, "crowded");
        assert_eq!(found(4.0, 60, spot(20.0)), 1.0);
        assert_eq!(found(4.0, 60, spot(3.5)), DIAMETER_PER_WIDTH, "faint");
    }

    #[test]
    fn what_falls_apart_is_looked_for_as_a_whole() {
        // A ring 6 px in radius, as the optics show what lies out of focus: 14 px wide at half height, its parts no wider than 3: a filter of 14 px finds several.
        let ring = |r: f64| 12.0 * (-(r - 6.0) * (r - 6.0) / 2.0).exp();
        assert!(found(14.0, 60, ring) > 1.0);
    }
}
