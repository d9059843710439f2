//! Isolated blobs of any size: closed contours over many levels that stand clear of their surroundings.
//!
//! Source: our own; the idea of nested level sets is that of component trees (Matas et al., *Robust wide-baseline stereo from
//! maximally stable extremal regions*, 2002; Salembier et al., *Antiextensive connected operators*, 1998), the comparison
//! with a guarded ring that of cell-averaging CFAR.
//! How: from each local maximum that can be a target's peak (`peaks`, `bars`) a cluster is grown down through some tens of levels L, the set I >= L around it (`grow`). A
//! cluster of fitting size that does not touch the border is compared with the ring around its box: a plane is fitted to the ring (b at the blob, residual deviation s,
//! 99 % point q of the residuals). Clear height h = mean inside - b - q; score = h / (noise + step + s). A bright spot in an
//! even sky scores tens, a branch in a tree hardly above one, whatever their contrasts. Of nested clusters the best score
//! counts; the cluster at half the height between b and the peak gives box, centroid and covariance.
//! Dark targets: the same on I <= L. Where both are looked for, a thing and its rim of the other sign are one (`rims`).
//! Symbols: I value (counts); L level (counts); noise standard deviation of a pixel (counts), where it grows with I that at the frame's mean; step smallest difference of two
//! pixel values (counts, 0 for floats).
//! Limits: a target that touches the frame's border, or another as bright as itself within its ring, is not isolated. Of blobs near the least score some are lost whose
//! ring is quieter than the cells of 8 x 8 px around them (`bars`). Cost: one pass over the pixels for the cells and
//! one over those cells that a peak can be in, then what each peak grows.

use super::bars::{Bar, Bars, SideClass};
use super::blob::Blob;
use super::cells::Cells;
use super::config::IsolatedConfig;
use super::grow::{Growth, Step};
use super::levels;
use super::measure::detection;
use super::nested::{Candidate, Clearest, Nested};
use super::peaks::{self, Peak};
use super::rims::Rims;
use super::ring::{Cluster, Ring};
use super::steps::Steps;
use crate::vision::config::DetectorConfig;
use crate::vision::pixel::Pixel;
use crate::vision::strongest::Strongest;
use crate::vision::target_finder::{PixelNoise, TargetFinder, TypedFrame};
use crate::vision::threshold::{Polarity, Side};
use crate::{Detection, Image, Result};

/// Least share of its box that a cluster fills: a thin diagonal fills little.
const MIN_FILL: f64 = 0.15;

/// Sides that differ by so much are not called elongated, px: a speck of 1 x 3 is none.
const SIDE_GRACE: f64 = 2.0;

/// Pixels up to which a cluster is grown to the end of its level: a cell's, whose bar is an estimate that the ring of a small cluster may prove too high.
const SMALL: u32 = 64;

/// Share of a score that the bars of a peak's cells surely tell, 1/√2: the slope of a ground that spreads a cell's values as much as their noise does makes √2 of their spread, and a ring's plane takes it out.
const SURE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Finds isolated blobs; keeps its memory between frames.
#[derive(Debug)]
pub struct IsolatedDetector {
    isolated: IsolatedConfig,
    cells: Cells,
    bars: Bars,
    steps: Steps,
    growth: Growth,
    ring: Ring,
    levels: Vec<f64>,
    samples: Vec<f32>,
    noise: PixelNoise,
    maxima: Vec<u8>,
    peaks: Vec<Peak>,
    candidates: Vec<Candidate>,
    nested: Nested,
    strongest: Strongest,
    rims: Rims,
}

impl IsolatedDetector {
    /// Builds the detector for a checked configuration.
    pub fn new(config: &IsolatedConfig) -> Self {
        Self {
            isolated: config.clone(),
            cells: Cells::default(),
            bars: Bars::default(),
            steps: Steps::default(),
            growth: Growth::default(),
            ring: Ring::default(),
            levels: Vec::new(),
            samples: Vec::new(),
            noise: PixelNoise::default(),
            maxima: Vec::new(),
            peaks: Vec::new(),
            candidates: Vec::new(),
            nested: Nested::default(),
            strongest: Strongest::default(),
            rims: Rims::default(),
        }
    }

    /// Appends the isolated blobs of `image` to `out`, the clearest first.
    fn run<T: Pixel>(&mut self, image: &Image<T>, config: &DetectorConfig, out: &mut Vec<Detection>) {
        let noise = self.noise.of(image, &config.noise);
        let typical = variance_at(noise, if noise.1 > 0.0 { mean(image) } else { 0.0 }).sqrt();
        self.cells.read(image);
        let first = out.len();
        if self.isolated.polarity.has(Side::Bright) {
            self.side(image, config, Side::Bright, (typical, noise), out);
        }
        let first_dark = out.len();
        if self.isolated.polarity.has(Side::Dark) {
            self.side(image, config, Side::Dark, (typical, noise), out);
        }
        // One side's are in that order already.
        if self.isolated.polarity == Polarity::Both {
            self.rims.leave_out((first, first_dark), out);
            self.strongest.sort(out);
        }
    }

    fn side<T: Pixel>(
        &mut self,
        image: &Image<T>,
        config: &DetectorConfig,
        side: Side,
        (noise, by_level): (f64, (f64, f64)),
        out: &mut Vec<Detection>,
    ) {
        self.candidates.clear();
        let (bright, n_levels) = (side == Side::Bright, self.isolated.levels as usize);
        let most = |dark: bool| self.cells.highest(dark).fold(f32::NEG_INFINITY, f32::max);
        levels::choose(image, side, n_levels, noise, f64::from(most(!bright)), &mut self.samples, &mut self.levels);
        let Some(&lowest) = self.levels.first() else { return };
        self.steps.take::<T>(&self.levels, side, most(false));
        let sign = if bright { 1.0 } else { -1.0 };
        let bar = Bar {
            sign,
            unit: noise + f64::from(T::STEP),
            min_score: self.isolated.min_score,
            max_side: self.isolated.max_side_px,
        };
        self.bars.take(&self.cells, &bar);
        peaks::find(image, &self.cells, &self.bars, &bar, sign * lowest, &mut self.maxima, &mut self.peaks);
        self.growth.frame(image.width(), image.height(), self.levels.len(), bar.max_side);
        self.ring.forget();
        let peaks = std::mem::take(&mut self.peaks);
        for peak in &peaks {
            self.grow(image, config, &bar, peak);
        }
        self.peaks = peaks;
        self.nested.best_of((image.width(), image.height()), &mut self.candidates, |best, shape| {
            out.extend(detection(image, config, side, best, shape, by_level));
        });
    }

    /// Follows one peak down through the levels and notes every cluster that stands clear.
    fn grow<T: Pixel>(&mut self, image: &Image<T>, config: &DetectorConfig, bar: &Bar, peak: &Peak) {
        let Some(pixel) = image.row(peak.y as usize).get(peak.x as usize) else { return };
        let mut class = SideClass::of(1);
        let wanted = |bar: &Bar, class, is_to_beat| {
            self.bars.need(&self.cells, bar, (peak.cell, peak.highest), class, is_to_beat)
        };
        let Some(mut need) = wanted(bar, class, false) else { return };
        let (min_area, max_area) = config.cluster.area_limits();
        self.growth.start(peak.x, peak.y, self.steps.of(*pixel), self.steps.above(need.ground));
        let mut noted = false;
        // Once the clearest one so far has its shape, the next ones are to beat it.
        let (mut bar, mut is_to_beat, mut clearest) = (*bar, false, None::<Clearest>);
        loop {
            let small = if is_to_beat { 0 } else { SMALL };
            let step = self.growth.step(image, &self.steps, small, need.mean);
            if step == Step::End {
                return;
            }
            let Some((blob, mean, highest)) = self.growth.cluster() else { continue };
            let level = bar.sign * self.steps.level(self.growth.reached());
            if step == Step::Same {
                if let Some(last) = self.candidates.last_mut().filter(|_| noted) {
                    last.until = level;
                    clearest = Some(Clearest::of(clearest, last));
                }
                continue;
            }
            noted = false;
            if blob.area > max_area {
                return;
            }
            if blob.area >= min_area && self.fits(&blob) {
                let cluster = Cluster { blob, level, mean };
                if let Some(ground) = self.ring.ground(image, bar.sign, &cluster, bar.unit, bar.min_score)
                    && let Some(score) = ground.score(mean, bar.unit).filter(|s| *s >= bar.min_score)
                {
                    let background = ground.level;
                    let next = Candidate { blob, level, until: level, background, peak: highest, score };
                    self.candidates.push(next);
                    clearest = Some(Clearest::of(clearest, &next));
                    noted = true;
                }
            }
            let (w, h) = blob.sides();
            let grown = SideClass::of(w.max(h));
            let mut changed = grown != class;
            if let Some(c) = clearest.filter(|c| SURE * c.score > bar.min_score && c.has_its_shape(level)) {
                (bar.min_score, is_to_beat, changed) = (SURE * c.score, true, true);
            }
            if changed {
                let Some(more) = wanted(&bar, grown, is_to_beat) else { return };
                (class, need) = (grown, more);
            }
            if !(level > need.ground && (noted || mean >= need.mean)) {
                return;
            }
        }
    }

    fn fits(&self, blob: &Blob) -> bool {
        let (w, h) = blob.sides();
        let (short, long) = (f64::from(w.min(h)), f64::from(w.max(h)));
        long <= self.isolated.max_elongation * short + SIDE_GRACE
            && f64::from(blob.area) >= MIN_FILL * f64::from(w) * f64::from(h)
    }
}

impl<T: Pixel> TargetFinder<T> for IsolatedDetector {
    fn remembers(&self) -> bool {
        false
    }

    fn find(&mut self, frame: &TypedFrame<T>, config: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        self.run(frame.image, config, out);
        Ok(())
    }
}

/// Variance of a pixel's noise at a level, counts²: that at 0 with its growth.
fn variance_at((at_0, gain): (f64, f64), level: f64) -> f64 {
    (at_0 + gain * level).max(0.0)
}

/// Mean of every eighth row.
fn mean<T: Pixel>(image: &Image<T>) -> f64 {
    let values = || (0..image.height()).step_by(8).flat_map(|y| image.row(y)).map(|p| f64::from(p.value_f32()));
    let (n, sum) = values().filter(|v| v.is_finite()).fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    if n > 0.0 { sum / n } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::noise_level::noise_level;
    use crate::vision::threshold::ThresholdConfig;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A sky with a gradient and noise over a wood of strong random texture; spots are (x, y, height, sigma).
    fn scene(seed: u64, spots: &[(f64, f64, f64, f64)]) -> Image<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut image = Image::filled(160, 120, 0f32);
        for y in 0..120 {
            for x in 0..160 {
                let mut v = 60.0 - 0.3 * y as f64 + 4.0 * (rng.random::<f64>() - 0.5);
                if y > 80 {
                    v = 120.0 + 100.0 * rng.random::<f64>();
                }
                for &(sx, sy, height, sigma) in spots {
                    let r2 = (x as f64 - sx).powi(2) + (y as f64 - sy).powi(2);
                    v += height * (-0.5 * r2 / (sigma * sigma)).exp();
                }
                image.as_mut_slice()[y * 160 + x] = v as f32;
            }
        }
        image
    }

    fn find<T: Pixel>(image: &Image<T>, isolated: IsolatedConfig) -> Vec<Detection> {
        let mut config =
            DetectorConfig { threshold: ThresholdConfig::Isolated(isolated.clone()), ..Default::default() };
        config.cluster.min_area_px = Some(3);
        let mut found = Vec::new();
        IsolatedDetector::new(&isolated).run(image, &config, &mut found);
        found
    }

    fn cast<T: Copy>(image: &Image<f32>, f: impl Fn(f32) -> T) -> Image<T> {
        Image::from_vec(image.width(), image.height(), image.as_slice().iter().map(|&v| f(v)).collect()).unwrap()
    }

    #[test]
    fn a_given_noise_that_grows_with_the_light_is_in_the_covariance() {
        // Spots of 2000 counts over 100, read noise of 2 counts and 3 counts² more for each count: squared errors over stated variances are 2 in the mean if all of it counts. With the
        // read noise alone it would be some thousand times as much.
        use crate::vision::config::{GivenNoise, NoiseConfig};
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let isolated = IsolatedConfig::default();
        let mut config =
            DetectorConfig { threshold: ThresholdConfig::Isolated(isolated.clone()), ..Default::default() };
        config.noise = NoiseConfig::Given(GivenNoise { read_counts: 2.0, gain: 3.0, offset_counts: 0.0 });
        config.cluster.min_area_px = Some(3);
        let mut detector = IsolatedDetector::new(&isolated);
        let (mut n, mut sum) = (0, 0.0);
        for _ in 0..300 {
            let at = nalgebra::Vector2::new(24.0 + rng.random::<f64>(), 24.0 + rng.random::<f64>());
            let mut image = Image::filled(48, 48, 0f32);
            for y in 0..48 {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let r2 = (x as f64 - at.x).powi(2) + (y as f64 - at.y).powi(2);
                    let mean = 100.0 + 2000.0 * (-0.5 * r2 / 9.0).exp();
                    let z: f64 = rng.sample(rand_distr::StandardNormal);
                    *p = (mean + (4.0 + 3.0 * mean).sqrt() * z) as f32;
                }
            }
            let mut found = Vec::new();
            detector.run(&image, &config, &mut found);
            if let Some(d) = found.iter().find(|d| (d.position - at).norm() < 3.0) {
                let e = d.position - at;
                sum += e.dot(&d.cov.cholesky().unwrap().solve(&e));
                n += 1;
            }
        }
        let mean = sum / f64::from(n);
        assert!(n > 250 && (1.0..3.0).contains(&mean), "{mean} of {n}");
    }

    #[test]
    fn a_spot_in_the_sky_scores_above_all_of_a_textured_wood() {
        for seed in 0..5 {
            let image = cast(&scene(seed, &[(50.3, 40.7, 40.0, 1.5), (110.0, 30.0, 60.0, 6.0)]), |v| v.round() as u8);
            let found = find(&image, IsolatedConfig::default());
            assert!(found.len() >= 2, "seed {seed}: {}", found.len());
            for (x, y, sigma) in [(50.3, 40.7, 1.5), (110.0, 30.0, 6.0)] {
                let near = found.iter().take(2).any(|d| (d.position.x - x).hypot(d.position.y - y) < 0.2 * sigma);
                assert!(near, "seed {seed}: {:?}", found.iter().map(|d| (d.position, d.score)).collect::<Vec<_>>());
            }
            assert!(found.get(2).is_none_or(|third| third.score < 0.6 * found[1].score), "seed {seed}");
        }
    }

    #[test]
    fn dark_targets_are_bright_ones_of_the_negative() {
        let image = scene(3, &[(50.3, 40.7, 40.0, 1.5)]);
        let bright = find(&cast(&image, |v| v.round() as u8), IsolatedConfig::default());
        let dark = IsolatedConfig { polarity: Polarity::Dark, ..Default::default() };
        let negative = find(&cast(&image, |v| 255 - v.round() as u8), dark);
        assert!((bright[0].position - negative[0].position).norm() < 1e-9);
        assert!((bright[0].score - negative[0].score).abs() < 1e-3);
    }

    #[test]
    fn an_offset_and_a_gain_of_the_sensor_change_nothing() {
        // A float image has no step, so the score has no unit of its own.
        let image = scene(4, &[(50.3, 40.7, 40.0, 1.5)]);
        let a = find(&image, IsolatedConfig::default());
        let b = find(&cast(&image, |v| v * 64.0 + 4096.0), IsolatedConfig::default());
        assert!((a[0].position - b[0].position).norm() < 0.02);
        assert!((a[0].score / b[0].score - 1.0).abs() < 0.05, "{} {}", a[0].score, b[0].score);
    }

    #[test]
    fn one_hot_pixel_does_not_hide_a_dim_target() {
        let mut image = cast(&scene(5, &[(50.3, 40.7, 40.0, 1.5)]), |v| v.round() as u16);
        image.as_mut_slice()[10 * 160 + 130] = 60_000;
        let found = find(&image, IsolatedConfig::default());
        assert!(found.iter().any(|d| (d.position.x - 50.3).hypot(d.position.y - 40.7) < 0.5));
    }

    /// Every cluster at every level by flooding the whole frame, judged by the same ring, with none left out before.
    fn brute(image: &Image<u8>, isolated: &IsolatedConfig) -> Vec<(Candidate, [u32; 4])> {
        let noise = noise_level(image, &mut Vec::new());
        let high = image.as_slice().iter().copied().max().unwrap_or(0);
        let (mut levels, mut samples) = (Vec::new(), Vec::new());
        let n = isolated.levels as usize;
        levels::choose(image, Side::Bright, n, noise, f64::from(high), &mut samples, &mut levels);
        let (w, h) = (image.width(), image.height());
        let detector = IsolatedDetector::new(isolated);
        let mut all = Vec::new();
        for &level in levels.iter().rev() {
            let mut seen = vec![false; w * h];
            for start in 0..w * h {
                let (mut stack, mut pixels) = (vec![start], Vec::new());
                while let Some(at) = stack.pop() {
                    if seen[at] || f64::from(image.as_slice()[at]) < level {
                        continue;
                    }
                    seen[at] = true;
                    pixels.push(at);
                    let (x, y) = (at % w, at / w);
                    for ny in y.saturating_sub(1)..(y + 2).min(h) {
                        stack.extend((x.saturating_sub(1)..(x + 2).min(w)).map(|nx| ny * w + nx));
                    }
                }
                let mut blob = Blob::none();
                pixels.iter().for_each(|p| blob.add((p % w) as u32, (p / w) as u32));
                let (bw, bh) = if pixels.is_empty() { continue } else { blob.sides() };
                let [left, top, right, bottom] = blob.bounds();
                let inside = left > 0 && top > 0 && right as usize + 1 < w && bottom as usize + 1 < h;
                if !inside || blob.area < 3 || bw.max(bh) > isolated.max_side_px || !detector.fits(&blob) {
                    continue;
                }
                let values = || pixels.iter().map(|p| f64::from(image.as_slice()[*p]));
                let (mean, peak) = (values().sum::<f64>() / pixels.len() as f64, values().fold(0.0, f64::max));
                let unit = noise + 1.0;
                let cluster = Cluster { blob, level, mean };
                let ground = Ring::default().ground(image, 1.0, &cluster, unit, f64::MIN);
                if let Some((g, score)) = ground.and_then(|g| Some((g, g.score(mean, unit)?)))
                    && score >= isolated.min_score
                {
                    all.push(Candidate { blob, level, until: level, background: g.level, peak, score });
                }
            }
        }
        let mut found = Vec::new();
        Nested::default().best_of((w, h), &mut all, |best, (shape, _)| found.push((*best, shape.bounds())));
        found
    }

    #[test]
    fn all_that_stands_clear_is_what_flooding_the_whole_frame_finds() {
        let isolated = IsolatedConfig::default();
        let (mut sure, mut weak, mut missed) = (0, 0, 0);
        for seed in 0..16 {
            let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
            let spots: Vec<_> = (0..14)
                .map(|i| {
                    let place = (rng.random_range(12.0..148.0), rng.random_range(10.0..110.0));
                    (place.0, place.1, rng.random_range(10.0..90.0), [0.8, 1.5, 3.0, 6.0][i % 4])
                })
                .collect();
            let image = cast(&scene(seed, &spots), |v| v.round().clamp(0.0, 255.0) as u8);
            let found = find(&image, isolated.clone());
            let all = brute(&image, &isolated);
            for (best, _) in &all {
                let same = found.iter().any(|d| (f64::from(d.score) / best.score - 1.0).abs() < 1e-5);
                if best.score >= 1.5 * isolated.min_score {
                    assert!(same, "seed {seed}: {best:?}");
                    sure += 1;
                } else {
                    weak += 1;
                    missed += usize::from(!same);
                }
            }
            assert!(found.len() <= all.len(), "seed {seed}");
        }
        assert!(sure >= 40, "{sure}");
        assert!(missed * 10 <= weak, "{missed} of {weak} near the least score are missed");
    }

    #[test]
    fn even_tiny_and_hopeless_images_give_nothing() {
        for (w, h) in [(0, 0), (1, 1), (1, 50), (50, 1), (3, 3), (65, 64)] {
            assert!(find(&Image::filled(w, h, 7u8), IsolatedConfig::default()).is_empty());
            assert!(find(&Image::filled(w, h, f32::NAN), IsolatedConfig::default()).is_empty());
        }
        let mut corner = Image::filled(40, 40, 10u8);
        corner.row_mut(0)[..3].fill(200);
        corner.row_mut(1)[..3].fill(200);
        assert!(find(&corner, IsolatedConfig::default()).is_empty());
    }
}
