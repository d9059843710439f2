//! The size that spots are looked for at: the smallest that finds as many of them.
//!
//! Source: our own. A filter as wide as the whole spot finds the faintest ones; one no wider than half of its height tells neighbours apart that the wide one joins, and their light moves
//! its positions far less, but noise passes it more easily. Which of the two loses more is counted in pairs of frames, with a threshold at which hardly any noise is among them: how many
//! are found, and found again in the next frame. A size at which a larger share of them is not, more than chance explains, finds what is none.
//! Where the values' step hides the noise, as where a codec has flattened the ground, no threshold says how much of it is among them, and the wide filter stays.
//! Limits: things with parts of their own, rings and discs, fall apart under a narrow filter; where most of them do, the wide one stays.

use super::looks;
use super::near::Near;
use super::noise_shown::shows_noise;
use super::spread::spread;
use crate::vision::DetectorConfig;
use crate::vision::threshold::spot::DIAMETER_PER_WIDTH;
use crate::{Frame, Result, Scan, SourceInfo};

/// Spots that are looked at, and the fewest and most pairs of frames for that: of 2000 a share of one in forty that is not found again is known to a seventh.
const SPOTS: f64 = 2000.0;
const PAIRS: (f64, f64) = (2.0, 6.0);
/// Smaller diameters that are tried, in units of the spots' width at half height: without most of the soft edge, and the width itself.
const SMALLER: [f64; 2] = [1.5, 1.0];
/// Least and largest diameter, px.
const LEAST_PX: f64 = 3.0;
const MOST_PX: f64 = 99.0;
/// Share of the spots that a smaller size may lose.
const LOST: f64 = 0.02;
/// Share of the spots that may fall apart into several.
const FALL_APART: f64 = 0.5;
/// Deviations by which more may be not found again than with the whole size.
const BY_CHANCE: f64 = 3.0;

/// The diameter of spots with their soft edge, px.
pub(super) fn whole_px(width_px: f64) -> f64 {
    (DIAMETER_PER_WIDTH * width_px).clamp(LEAST_PX, MOST_PX)
}

/// The diameter to look for, px, where so many blobs a frame of this width at half height are seen; `at` is what is looked for at a diameter.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn find(
    width_px: f64,
    per_frame: f64,
    frames: &[Frame],
    info: &SourceInfo,
    n_threads: usize,
    at: impl Fn(f64) -> DetectorConfig,
) -> Result<f64> {
    let firsts: Vec<usize> = (0..frames.len().saturating_sub(1)).collect();
    let n_pairs = (SPOTS / per_frame.max(1.0)).ceil().clamp(PAIRS.0, PAIRS.1) as usize;
    let pairs: Vec<&Frame> = spread(&firsts, n_pairs).flat_map(|&k| [&frames[k], &frames[k + 1]]).collect();
    let whole_px = whole_px(width_px);
    if !pairs.iter().all(|frame| shows_noise(frame)) || pairs.is_empty() {
        return Ok(whole_px);
    }
    let scans = |size_px: f64| looks::scans(&at(size_px), pairs.iter().copied(), info, n_threads);
    let wide = scans(whole_px)?;
    let of_wide = Again::of(&wide, 0.5 * whole_px);
    let mut found = vec![(whole_px, of_wide)];
    for size_px in SMALLER.map(|diameter| (diameter * width_px).max(LEAST_PX)).into_iter().filter(|s| *s < whole_px) {
        let narrow = scans(size_px)?;
        if falls_apart(&wide, &narrow, 0.5 * whole_px) > FALL_APART {
            break;
        }
        let again = Again::of(&narrow, 0.5 * whole_px);
        if !again.is_less_sure_than(&of_wide) {
            found.push((size_px, again));
        }
    }
    let most = found.iter().map(|(_, again)| again.n_again).max().unwrap_or(0);
    let is_enough = |again: &Again| again.n_again > 0 && again.n_again as f64 >= (1.0 - LOST) * most as f64;
    let enough = found.iter().rev().find(|(_, again)| is_enough(again));
    Ok(enough.map_or(whole_px, |(size_px, _)| *size_px))
}

/// How many detections were found again in the next frame, each the other's nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Again {
    n: usize,
    n_again: usize,
}

impl Again {
    /// Of pairs of scans: each the other's nearest, no farther than `far_px`.
    fn of(pairs: &[Scan], far_px: f64) -> Self {
        let (mut n, mut n_again) = (0, 0);
        for pair in pairs.chunks_exact(2) {
            let (first, next) = (Near::of(&pair[0]), Near::of(&pair[1]));
            n += first.len();
            for i in 0..first.len() {
                let there = next.nearest(first.get(i), far_px);
                let back = there.and_then(|(j, _)| first.nearest(next.get(j), far_px));
                n_again += usize::from(back.is_some_and(|(k, _)| k == i));
            }
        }
        Self { n, n_again }
    }

    /// Whether a larger share was not found again, by more than chance.
    fn is_less_sure_than(&self, other: &Self) -> bool {
        let [lost, lost_of_other] = [self, other].map(|a| (a.n - a.n_again) as f64);
        let ratio = self.n as f64 / other.n.max(1) as f64;
        let expected = ratio * lost_of_other;
        lost > expected + BY_CHANCE * (expected * (1.0 + ratio)).sqrt()
    }
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
    n as f64 / wide.iter().map(|s| s.detections.len()).sum::<usize>().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::threshold::{SpotConfig, ThresholdConfig};
    use crate::{FrameIndex, Image, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// The diameter for things of `width_px` at half height, `n` of them in 300 x 300 pixels at random, as bright at r px as `light` says in deviations of the noise.
    fn found(width_px: f64, n: usize, light: impl Fn(f64) -> f64) -> f64 {
        found_in(4, width_px, n, light)
    }

    /// The same in so many frames.
    fn found_in(n_frames: usize, width_px: f64, n: usize, light: impl Fn(f64) -> f64) -> f64 {
        const SIZE: usize = 300;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let places: Vec<[f64; 2]> = (0..n).map(|_| [(); 2].map(|()| SIZE as f64 * rng.random::<f64>())).collect();
        // They stand.
        let mut frame = |k: u64| {
            let mut image = Image::filled(SIZE, SIZE, 0.0f32);
            image.as_mut_slice().iter_mut().for_each(|v| *v = 500.0 + 10.0 * rng.sample::<f32, _>(StandardNormal));
            for at in &places {
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
        let (mut frames, info) = super::super::in_memory::described(frames);
        frames.truncate(n_frames);
        let spot = |size_px: f64| SpotConfig {
            size_px,
            k: 4.5,
            min_contrast: 0.0,
            surround: 1.0,
            smooth_px: Some((0.66 * width_px).min(0.5 * size_px)),
            ..SpotConfig::default()
        };
        let at = |size_px: f64| DetectorConfig {
            threshold: ThresholdConfig::Spot(spot(size_px)),
            ..DetectorConfig::default()
        };
        find(width_px, n as f64, &frames, &info, 1, at).unwrap() / width_px
    }

    #[test]
    fn clear_spots_are_looked_for_at_their_width_and_faint_ones_as_a_whole() {
        let spot = |height: f64| move |r: f64| height * (-r * r / (2.0 * 1.7 * 1.7)).exp();
        assert_eq!(found(4.0, 250, spot(20.0)), 1.0, "crowded");
        assert_eq!(found(4.0, 60, spot(20.0)), 1.0);
        assert_eq!(found(4.0, 60, spot(3.5)), DIAMETER_PER_WIDTH, "faint");
    }

    #[test]
    fn in_less_than_two_frames_nothing_is_found_again_and_the_whole_size_stays() {
        let spot = |r: f64| 20.0 * (-r * r / (2.0 * 1.7 * 1.7)).exp();
        assert_eq!([0, 1, 2].map(|n| found_in(n, 4.0, 60, spot)), [DIAMETER_PER_WIDTH, DIAMETER_PER_WIDTH, 1.0]);
    }

    #[test]
    fn what_falls_apart_is_looked_for_as_a_whole() {
        // A ring 6 px in radius, as the optics show what lies out of focus: 14 px wide at half height, its parts no wider than 3: a filter of 14 px finds several.
        let ring = |r: f64| 12.0 * (-(r - 6.0) * (r - 6.0) / 2.0).exp();
        assert!(found(14.0, 60, ring) > 1.0);
    }

    #[test]
    fn a_size_is_less_sure_where_more_is_not_found_again_than_chance_explains() {
        let again = |n: usize, lost: usize| Again { n, n_again: n - lost };
        // As many in proportion, 75: 3 deviations are 36.
        let (wide, chance) = (again(1000, 50), 3.0 * (75.0f64 * 2.5).sqrt());
        assert!(!again(1500, 75 + chance as usize).is_less_sure_than(&wide));
        assert!(again(1500, 76 + chance as usize).is_less_sure_than(&wide));
        assert!(!again(0, 0).is_less_sure_than(&again(0, 0)));
        // Two that move, one that is gone, one that is nearest to another's.
        let scan = |places: &[[f64; 2]]| {
            let of = |p: &[f64; 2]| crate::Detection::at((*p).into(), nalgebra::Matrix2::identity());
            Scan::default().with_detections(places.iter().map(of).collect())
        };
        let pair =
            [scan(&[[10.0, 10.0], [30.0, 10.0], [50.0, 10.0], [33.5, 10.0]]), scan(&[[11.0, 10.0], [31.0, 10.0]])];
        assert_eq!(Again::of(&pair, 4.0), again(4, 2));
    }
}
