//! How the light of pieces falls off from their middles: of a spot as a Gaussian's, of a cell or a disc with an edge.
//!
//! Source: our own. A profile h exp(-(r/s)^p) is brighter than v over an area as (ln h/v)^(2/p): for p = 2 the logarithm of the light of a piece, cut out at a level T, is spread evenly between ln T and
//! ln h, and its mean lies at the part p / (p + 2) of the way, whatever h, s and T are. So p is told by the mean, beside the logarithm that one in twenty exceeds, which noise moves less than the
//! largest. Of a Gaussian of the deviation s the area is 2 π s² ln(h/T). The mean of 5 x 5 before makes the profile of a narrow spot flatter: by as much as it does of a Gaussian of that width.
//! Symbols: l logarithm of a pixel in units of T; m mean of l beside its upper end (1/2 for a Gaussian).
//! Limits: spots that touch are one piece, with a mean of little more (0.54 for 0.51 in crowds); texture counts as flat. What of another piece lies in a piece's box counts with it.

use super::quantile::quantile;
use super::scene::grey_of;
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::spatial::{SpatialConfig, SpatialFilter, WindowConfig};
use crate::vision::threshold::{BackgroundGrid, LocalConfig, Polarity};
use crate::{Detection, Frame, Image, Result, Scan};

/// Part of a piece's pixels up to the logarithm that counts as its upper end.
const UPPER: f64 = 0.95;
/// Least height of a piece that tells its profile, in units of the level it was cut out at.
const LEAST_HEIGHT: f64 = 1.5;
/// Samples of a Gaussian along an axis, to each side, and how far they reach, deviations.
const SAMPLES: (usize, f64) = (60, 4.0);
/// Least deviation of a spot, px: a point through a pixel has more.
const LEAST_DEVIATION_PX: f64 = 0.3;
/// Halvings of the interval in which a deviation is looked for: to a thousandth.
const BISECTIONS: usize = 12;

/// Usual profile of pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Profile {
    /// Exponent: 2 for Gaussians, larger for what has an edge.
    pub exponent: f64,
    /// Width at half height of a Gaussian as large, px.
    pub width_px: f64,
}

/// What the pieces of frames are like that were cut out at this level after a mean over a square; none where none stands out enough.
/// # Errors
/// A window that is no filter.
pub(super) fn of(
    frames: &[&Frame],
    scans: &[Scan],
    window: &WindowConfig,
    level: &LocalConfig,
) -> Result<Option<Profile>> {
    let mut filter = SpatialFilter::new(SpatialConfig::Mean(*window))?;
    let (mut smooth, mut grid) = (Image::default(), BackgroundGrid::new(level.cell_px as usize));
    let sign = if level.polarity == Polarity::Dark { -1.0 } else { 1.0 };
    let [mut means, mut variances, mut heights, mut logs] = [const { Vec::new() }; 4];
    for (frame, scan) in frames.iter().zip(scans) {
        filter.apply(&grey_of(&frame.pixels), &mut smooth);
        grid.refresh(&smooth);
        for d in &scan.detections {
            let (median, deviation) = grid.at(d.position.x, d.position.y);
            let t = sign * (level.k * deviation).max(level.min_contrast);
            logs.clear();
            logs.extend(pixels(&smooth, d).map(|v| ((f64::from(v) - median) / t).ln()).filter(|l| *l > 0.0));
            logs.sort_by(f64::total_cmp);
            let Some(&height) = logs.last().filter(|l| **l > LEAST_HEIGHT.ln()) else { continue };
            means.push(mean_beside_upper(&logs));
            variances.push(logs.len() as f64 / (std::f64::consts::TAU * height));
            heights.push(height);
        }
    }
    if means.is_empty() {
        return Ok(None);
    }
    let [mean, s2, height] = [means, variances, heights].map(|mut v| quantile(&mut v, 0.5));
    let side = window.size as f64;
    let deviation = deviation_of(s2, side, height);
    let (mut expected, _) = of_gaussian(deviation, side, height);
    expected.sort_by(f64::total_cmp);
    let mean = mean + 0.5 - mean_beside_upper(&expected);
    Ok(Some(Profile { exponent: 2.0 * mean / (1.0 - mean), width_px: WIDTH_PER_DEVIATION * deviation }))
}

/// The pixels in the box of a piece.
fn pixels<'i>(image: &'i Image<f32>, d: &Detection) -> impl Iterator<Item = f32> + 'i {
    let span = |from: f64, side: f64, size: usize| {
        let first = (from + 0.5).round().clamp(0.0, size as f64);
        first as usize..(first + side.round()).min(size as f64) as usize
    };
    let columns = span(d.extent.left_px, d.extent.width_px, image.width());
    span(d.extent.top_px, d.extent.height_px, image.height())
        .flat_map(move |y| image.row(y)[columns.clone()].iter().copied())
}

/// The mean of sorted logarithms beside their upper end, 1/2 where they are spread evenly.
fn mean_beside_upper(logs: &[f64]) -> f64 {
    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
    // Each stands for the middle of its share.
    let at = (UPPER * logs.len() as f64 - 0.5).max(0.0);
    let (low, high) = (logs[at as usize], logs[(at as usize + 1).min(logs.len() - 1)]);
    mean * UPPER / (low + (high - low) * at.fract())
}

/// Logarithms beside the level of a Gaussian of this deviation (px) after a mean over a square of this side (px), its height so many e-folds above the level; and the area that each stands for, px².
fn of_gaussian(deviation: f64, side: f64, height: f64) -> (Vec<f64>, f64) {
    use statrs::function::erf::erf;
    let (n, reach) = SAMPLES;
    let step = deviation.hypot(side / 12f64.sqrt()) * reach / n as f64;
    let scale = 1.0 / (deviation * std::f64::consts::SQRT_2);
    let along = |k: usize| {
        let x = step * k as f64;
        erf((x + 0.5 * side) * scale) - erf((x - 0.5 * side) * scale)
    };
    let fall: Vec<f64> = (0..=n).map(|k| (along(k) / along(0)).ln()).collect();
    let mut logs = Vec::new();
    for (i, a) in fall.iter().enumerate() {
        for (j, b) in fall.iter().enumerate() {
            let l = height + a + b;
            if l > 0.0 {
                // The axes belong to two quadrants each.
                logs.extend(std::iter::repeat_n(l, (1 + usize::from(i > 0)) * (1 + usize::from(j > 0))));
            }
        }
    }
    (logs, step * step)
}

/// The deviation of the Gaussian that is so large after a mean over a square of this side (px), its height so many e-folds above the level: of one that nothing smoothed the area is 2 π s² `height`.
fn deviation_of(s2: f64, side: f64, height: f64) -> f64 {
    let area = std::f64::consts::TAU * s2 * height;
    let (mut low, mut high) = (LEAST_DEVIATION_PX, s2.sqrt().max(LEAST_DEVIATION_PX));
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let (logs, each) = of_gaussian(middle, side, height);
        if logs.len() as f64 * each < area { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::super::in_memory::described;
    use super::super::{cells, choose};
    use super::*;
    use crate::track::Report;
    use crate::vision::threshold::ThresholdConfig;
    use crate::{Config, FrameIndex, Pixels, SourceInfo, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIDE: usize = 300;

    /// What the frames are full of: forty things (no farther apart than 28 px, or they have no room) as bright at the distance r px as `light` says, in deviations of the noise, times one to two, farther apart than `apart_px`.
    fn pieces(apart_px: f64, light: impl Fn(f64) -> f64) -> Option<cells::Pieces> {
        let (frames, info) = frames(40, 2, 0.0, apart_px, light);
        cells::look(&frames, &info, 1).unwrap()
    }

    /// So many frames of so many such things, which diffuse by `step_px` a frame.
    fn frames(
        n: usize,
        n_frames: u64,
        step_px: f64,
        apart_px: f64,
        light: impl Fn(f64) -> f64,
    ) -> (Vec<Frame>, SourceInfo) {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut at: Vec<[f64; 3]> = Vec::new();
        while at.len() < n {
            let [x, y] = [(); 2].map(|()| 15.0 + (SIDE as f64 - 30.0) * rng.random::<f64>());
            if at.iter().all(|p| (p[0] - x).hypot(p[1] - y) > apart_px) {
                at.push([x, y, 1.0 + rng.random::<f64>()]);
            }
        }
        let mut frame = |k: u64| {
            at.iter_mut().flat_map(|p| &mut p[..2]).for_each(|v| *v += step_px * rng.sample::<f64, _>(StandardNormal));
            let value = |i: usize| {
                let far = |p: &[f64; 3]| p[2] * light(((i % SIDE) as f64 - p[0]).hypot((i / SIDE) as f64 - p[1]));
                at.iter().map(far).sum::<f64>() + rng.sample::<f64, _>(StandardNormal)
            };
            let values = (0..SIDE * SIDE).map(value).map(|v| (500.0 + 20.0 * v) as u16).collect();
            let pixels = Pixels::Gray16(Image::from_vec(SIDE, SIDE, values).unwrap());
            Frame { index: FrameIndex(k), time: Timestamp::from_secs_f64(0.1 * k as f64), pixels }
        };
        described((0..n_frames).map(&mut frame).collect())
    }

    #[test]
    fn gaussians_of_any_width_and_height_are_spots_of_that_width() {
        for (deviation, height) in [(1.3f64, 8.0), (1.3, 30.0), (2.0, 6.0), (3.0, 6.0), (3.0, 40.0), (5.0, 10.0)] {
            let seen = pieces(f64::min(9.0 * deviation, 28.0), |r| height * (-0.5 * (r / deviation).powi(2)).exp());
            let Some(cells::Pieces::Spots(spots) | cells::Pieces::FewSpots(spots)) = seen else {
                panic!("{deviation} {height}: {seen:?}")
            };
            let ratio = spots.width_px / (WIDTH_PER_DEVIATION * deviation);
            assert!((0.93..1.07).contains(&ratio), "{deviation} {height}: {ratio}");
        }
    }

    #[test]
    fn faint_spots_that_touch_are_spots() {
        let seen = pieces(3.0, |r| 9.0 * (-0.5 * (r / 2.0).powi(2)).exp());
        assert!(matches!(seen, Some(cells::Pieces::Spots(_))), "{seen:?}");
    }

    #[test]
    fn a_few_wide_spots_are_found_though_nothing_stands_clear_and_reported_as_they_move() {
        for (polarity, height) in [(Polarity::Bright, 10.0), (Polarity::Dark, -10.0)] {
            let light = |r: f64| height * (-0.5 * (r / 2.6f64).powi(2)).exp();
            let (frames, info) = frames(3, 24, 0.5, 40.0, light);
            let choice = choose(&frames, &info, &Config::default()).unwrap();
            assert!(choice.is_evident() && choice.gain.is_finite(), "later frames may show more");
            let chosen = choice.config;
            let ThresholdConfig::Spot(spot) = &chosen.detector.threshold else { panic!("{:?}", chosen.detector) };
            assert!(spot.polarity == polarity && spot.size_px > 5.5, "{spot:?}");
            assert_eq!(chosen.tracker.report, Report::Moving);
        }
    }

    #[test]
    fn where_the_step_of_the_values_hides_the_noise_pieces_are_no_spots() {
        let light = |r: f64| 300.0 * (-0.5 * (r / 2.0f64).powi(2)).exp();
        let (mut frames, info) = frames(40, 2, 0.0, 20.0, light);
        let is_spots = |frames: &[Frame]| {
            let seen = cells::look(frames, &info, 1).unwrap();
            matches!(seen, Some(cells::Pieces::Spots(_) | cells::Pieces::FewSpots(_)))
        };
        assert!(is_spots(&frames));
        // A tenth of a step, the ground (500) in the middle of one.
        for frame in &mut frames {
            let Pixels::Gray16(image) = &mut frame.pixels else { continue };
            image.as_mut_slice().iter_mut().for_each(|v| *v /= 200);
        }
        assert!(!is_spots(&frames));
    }

    #[test]
    fn what_has_an_edge_is_none() {
        for (radius, height) in [(6.0, 5.0), (6.0, 20.0), (10.0, 8.0)] {
            let disc = pieces(2.8 * radius, |r| height / (1.0 + (2.0 * (r - radius)).exp()));
            assert!(matches!(disc, Some(cells::Pieces::Cells(_))), "{radius} {height}: {disc:?}");
        }
        let ring = pieces(28.0, |r| 12.0 * (-0.5 * ((r - 7.0) / 1.5).powi(2)).exp());
        assert!(matches!(ring, Some(cells::Pieces::Cells(_)) | None), "{ring:?}");
    }

    #[test]
    fn the_mean_logarithm_tells_the_exponent() {
        // Of h exp(-(r/s)^p) the logarithm lies below l over the share 1 - (1 - l)^(2/p) of the area.
        for p in [1.5f64, 2.0, 3.0, 5.0] {
            let n = 4000;
            let logs: Vec<f64> =
                (0..n).map(|k| 1.0 - (1.0 - (f64::from(k) + 0.5) / f64::from(n)).powf(p / 2.0)).collect();
            let whole = logs.iter().sum::<f64>() / f64::from(n);
            assert!((2.0 * whole / (1.0 - whole) - p).abs() < 0.01, "{p}: {whole}");
        }
        // The same whatever their number, if they are spread evenly.
        for n in [20, 28, 200] {
            let even: Vec<f64> = (0..n).map(|k| (f64::from(k) + 0.5) / f64::from(n)).collect();
            assert!((mean_beside_upper(&even) - 0.5).abs() < 1e-9, "{n}");
        }
    }

    #[test]
    fn a_wide_gaussian_is_itself_after_the_mean_and_a_narrow_one_is_flatter() {
        let mean = |deviation: f64| {
            let (mut logs, each) = of_gaussian(deviation, 5.0, 2.0);
            logs.sort_by(f64::total_cmp);
            (mean_beside_upper(&logs), logs.len() as f64 * each)
        };
        let (m, area) = mean(20.0);
        assert!(
            (m - 0.5).abs() < 0.01 && (area / (2.0 * std::f64::consts::TAU * 400.0) - 1.0).abs() < 0.02,
            "{m} {area}"
        );
        assert!(mean(1.2).0 > 0.52);
        for deviation in [0.8, 2.0, 6.0] {
            let s2 = mean(deviation).1 / (2.0 * std::f64::consts::TAU);
            assert!((deviation_of(s2, 5.0, 2.0) / deviation - 1.0).abs() < 0.02);
        }
    }
}
