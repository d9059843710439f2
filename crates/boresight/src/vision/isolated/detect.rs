//! Isolated blobs of any size: closed contours over many levels that stand clear of their surroundings.
//!
//! Source: our own; the idea of nested level sets is that of component trees (Matas et al., *Robust wide-baseline stereo from
//! maximally stable extremal regions*, 2002; Salembier et al., *Antiextensive connected operators*, 1998), the comparison
//! with a guarded ring that of cell-averaging CFAR.
//! How: at each of some tens of levels L the set I >= L falls into clusters. A cluster of fitting size that does not touch the
//! border is compared with the ring around its box: a plane is fitted to the ring (b at the blob, residual deviation s,
//! 99 % point q of the residuals). Clear height h = mean inside - b - q; score = h / (noise + step + s). A bright spot in an
//! even sky scores tens, a branch in a tree hardly above one, whatever their contrasts. Of nested clusters the best score
//! counts; the cluster at half the height between b and the peak gives box, centroid and covariance.
//! Dark targets: the same on I <= L.
//! Symbols: I value (counts); L level (counts); noise standard deviation of a pixel (counts); step smallest difference of two
//! pixel values (counts, 0 for floats).
//! Limits: a target that touches the frame's border, or another as bright as itself within its ring, is not isolated. Cost: one
//! sweep over the rows a level, about 2 ms for 320 x 256 with all levels and textured ground.

use super::config::IsolatedConfig;
use super::highest::Highest;
use super::levels;
use super::near::Near;
use super::ring::{Candidate, Known, Ring};
use super::sums::Sums;
use super::sweep::{self, Sweep};
use crate::vision::centroid::{Surroundings, centroid};
use crate::vision::config::{DetectorConfig, NoiseConfig};
use crate::vision::noise_level::noise_level;
use crate::vision::pixel::Pixel;
use crate::vision::region::Region;
use crate::vision::strongest::Strongest;
use crate::vision::target_finder::{TargetFinder, TypedFrame};
use crate::vision::threshold::band::words;
use crate::vision::threshold::{Polarity, Side};
use crate::{Detection, Image, Result};

/// Finds isolated blobs; keeps its memory between frames.
#[derive(Debug)]
pub struct IsolatedDetector {
    isolated: IsolatedConfig,
    highest: Highest,
    sweep: Sweep,
    ring: Ring,
    sums: Sums,
    near: Near,
    levels: Vec<f64>,
    samples: Vec<f32>,
    bits: Vec<u64>,
    candidates: Vec<Candidate>,
    taken: Vec<bool>,
    strongest: Strongest,
}

impl IsolatedDetector {
    /// Builds the detector for a checked configuration.
    pub fn new(config: &IsolatedConfig) -> Self {
        Self {
            isolated: config.clone(),
            highest: Highest::default(),
            sweep: Sweep::default(),
            ring: Ring::default(),
            sums: Sums::default(),
            near: Near::default(),
            levels: Vec::new(),
            samples: Vec::new(),
            bits: Vec::new(),
            candidates: Vec::new(),
            taken: Vec::new(),
            strongest: Strongest::default(),
        }
    }

    /// Appends the isolated blobs of `image` to `out`, the clearest first.
    fn run<T: Pixel>(&mut self, image: &Image<T>, config: &DetectorConfig, out: &mut Vec<Detection>) {
        let estimated = noise_level(image, &mut self.samples);
        let noise = match &config.noise {
            NoiseConfig::Given(g) => g.read_counts,
            NoiseConfig::Estimated => estimated,
        };
        self.bits.resize(words(image.width()), 0);
        self.sums.read(image);
        for side in [Side::Bright, Side::Dark] {
            if self.isolated.polarity.has(side) {
                self.side(image, config, side, noise, out);
            }
        }
        // One side's are in that order already.
        if self.isolated.polarity == Polarity::Both {
            self.strongest.sort(out);
        }
    }

    fn side<T: Pixel>(
        &mut self,
        image: &Image<T>,
        config: &DetectorConfig,
        side: Side,
        noise: f64,
        out: &mut Vec<Detection>,
    ) {
        let isolated = &self.isolated;
        self.highest.read(image, if side == Side::Bright { 1.0 } else { -1.0 });
        let high = f64::from(self.highest.most());
        levels::choose(image, side, isolated.levels as usize, noise, high, &mut self.samples, &mut self.levels);
        self.candidates.clear();
        let (min_area, max_area) = config.cluster.area_limits();
        let around = Known { sums: &self.sums, highest: Some(&self.highest) };
        for &level in &self.levels {
            self.sweep.run(image, &self.highest, side, level, &mut self.bits);
            for blob in self.sweep.blobs() {
                let (w, h) = (blob.right - blob.left + 1, blob.bottom - blob.top + 1);
                let (short, long) = (f64::from(w.min(h)), f64::from(w.max(h)));
                let inside = blob.left > 0
                    && blob.top > 0
                    && blob.right as usize + 1 < image.width()
                    && blob.bottom as usize + 1 < image.height();
                // Two pixels of grace, so that a 1 x 3 speck is not called elongated; a thin diagonal fills little of its box.
                if !inside
                    || !(min_area..=max_area).contains(&blob.area)
                    || w.max(h) > isolated.max_side_px
                    || long > isolated.max_elongation * short + 2.0
                    || f64::from(blob.area) < 0.15 * f64::from(w) * f64::from(h)
                {
                    continue;
                }
                if let Some(c) = self.ring.judge(image, &around, side, level, &blob, noise, isolated.min_score)
                    && c.score >= isolated.min_score
                {
                    self.candidates.push(Candidate { number: self.candidates.len(), ..c });
                }
            }
        }
        // Best first; ties by place, so that the order never depends on anything else.
        self.candidates.sort_unstable_by(|a, b| {
            let place = |c: &Candidate| (c.blob.top, c.blob.seed, c.number);
            b.score.total_cmp(&a.score).then(place(a).cmp(&place(b)))
        });
        let candidates = std::mem::take(&mut self.candidates);
        let mut taken = std::mem::take(&mut self.taken);
        taken.clear();
        taken.resize(candidates.len(), false);
        self.near.fill(image.width(), image.height(), candidates.iter().map(|c| &c.blob));
        for i in 0..candidates.len() {
            if taken[i] {
                continue;
            }
            let best = &candidates[i];
            let half = best.background + 0.5 * (best.peak - best.background);
            let mut shape = best;
            // Those before it were better, and did not take it.
            for j in self.near.of(&best.blob).iter().map(|&j| j as usize).filter(|&j| j >= i) {
                let other = &candidates[j];
                if !taken[j] && best.blob.overlaps(&other.blob) {
                    taken[j] = true;
                    if (other.level - half).abs() < (shape.level - half).abs() && other.blob.holds(&best.blob) {
                        shape = other;
                    }
                }
            }
            if let Some(d) = detection(image, config, side, best, shape, noise) {
                out.push(d);
            }
        }
        self.candidates = candidates;
        self.taken = taken;
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

/// Measures the blob: its box and centroid from the cluster `shape`, its score from `best`.
fn detection<T: Pixel>(
    image: &Image<T>,
    config: &DetectorConfig,
    side: Side,
    best: &Candidate,
    shape: &Candidate,
    noise: f64,
) -> Option<Detection> {
    let region = moments(image, side, shape)?;
    let around = Surroundings {
        background: best.background,
        sign: if side == Side::Bright { 1.0 } else { -1.0 },
        variance: noise * noise,
        gain: 0.0,
        level: Some(shape.level),
        ground: Some(best.background),
    };
    let c = centroid(&region, image, config.centroid.method, &around);
    Some(Detection {
        position: c.position,
        cov: c.cov,
        extent: region.extent(),
        area_px: region.area,
        peak: if side == Side::Bright { region.max } else { region.min },
        sum: c.sum,
        score: best.score as f32,
        class: None,
        velocity: None,
        fit: None,
    })
}

/// The moments of a cluster: the pixels beyond its level inside its box.
fn moments<T: Pixel>(image: &Image<T>, side: Side, shape: &Candidate) -> Option<Region> {
    let (low, high) = sweep::band::<T>(side, shape.level)?;
    let blob = &shape.blob;
    let set = |p: &T| *p >= low && *p <= high;
    let mut region: Option<Region> = None;
    for y in blob.top..=blob.bottom {
        let row = image.row(y as usize);
        let mut x = blob.left;
        while x <= blob.right {
            let rest = row.get(x as usize..=blob.right as usize)?;
            let Some(skip) = rest.iter().position(set) else { break };
            let length = rest.iter().skip(skip).position(|p| !set(p)).unwrap_or(rest.len() - skip);
            let start = x + skip as u32;
            let part = Region::of_run(0, y, start, start + length as u32 - 1, row);
            match &mut region {
                Some(r) => r.absorb(&part),
                None => region = Some(part),
            }
            x = start + length as u32;
        }
    }
    region
}

#[cfg(test)]
mod tests {
    use super::*;
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
