//! Targets as regions: rows of pixels -> rows of bits -> regions -> centroids, in one pass over the frame
//! (`docs/theory/segmentation.md`).

use super::centroid::{Surroundings, centroid};
use super::config::{CentroidMethod, DetectorConfig, Weight};
use super::cut_off;
use super::necks::Cutter;
use super::pixel::Pixel;
use super::region::Region;
use super::segmenter::{PixelWeight, Regions, Segmenter};
use super::target_finder::{PixelNoise, TargetFinder, TypedFrame};
use super::threshold::BackgroundGrid;
use crate::{Detection, Image, Result};

/// Cells of the background when the segmentation itself does not name a size, px.
const DEFAULT_CELL_PX: u32 = 32;

/// Finds regions by a segmentation.
pub(super) struct RegionFinder<T: Pixel> {
    segmenter: Box<dyn Segmenter<T>>,
    regions: Regions,
    ground: BackgroundGrid,
    noise: PixelNoise,
    cutter: Option<Cutter>,
}

impl<T: Pixel> RegionFinder<T> {
    pub(super) fn new(segmenter: impl Segmenter<T> + 'static, config: &DetectorConfig) -> Self {
        Self {
            ground: BackgroundGrid::new(segmenter.cell_px().unwrap_or(DEFAULT_CELL_PX) as usize),
            segmenter: Box::new(segmenter),
            regions: Regions::new(&config.cluster),
            noise: PixelNoise::default(),
            cutter: Cutter::new(&config.cluster),
        }
    }
}

impl<T: Pixel> TargetFinder<T> for RegionFinder<T> {
    fn remembers(&self) -> bool {
        self.segmenter.remembers()
    }

    fn is_blind(&self) -> bool {
        self.segmenter.is_blind()
    }

    fn prime_s(&self) -> f64 {
        self.segmenter.prime_s()
    }

    fn prime(&mut self, times_s: &[f64], frames: &[&Image<T>]) -> Result<()> {
        self.segmenter.prime(times_s, frames)
    }

    fn find(&mut self, frame: &TypedFrame<T>, config: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        let alike = self.segmenter.weight() == PixelWeight::Alike;
        let above_background = match config.centroid.weight {
            Weight::Intensity => false,
            Weight::AboveBackground => true,
            Weight::Auto => self.segmenter.weight() == PixelWeight::AboveBackground,
        };
        let method = match config.centroid.method {
            CentroidMethod::Mask if alike && config.centroid.weight == Weight::Auto => CentroidMethod::Binary,
            method => method,
        };
        let (variance, gain) = self.noise.of(frame.raw, &config.noise);
        let image = frame.image;
        let knows_ground = above_background || self.segmenter.cell_px().is_some();
        if knows_ground {
            self.ground.refresh(image);
        }
        self.regions.begin(image.width());
        let level = self.segmenter.segment(frame, &self.ground, &mut self.regions)?;
        let first = out.len();
        let (min, max) = config.cluster.area_limits();
        for (clusters, dark) in [(&self.regions.bright, false), (&self.regions.dark, true)] {
            let all = clusters.regions().filter(|r| r.area >= min);
            let mut add = |region: &Region| {
                if !(min..=max).contains(&region.area) {
                    return;
                }
                let n = f64::from(region.area);
                let local = knows_ground.then(|| self.ground.at(region.x / n, region.y / n));
                let ground = local.map(|(median, _)| median);
                // Moving and coloured pixels are not told apart by their sign: the region's mean tells.
                let dark = if alike { ground.is_some_and(|g| region.sum < g * n) } else { dark };
                let sign = if dark { -1.0 } else { 1.0 };
                let around = Surroundings {
                    background: ground.filter(|_| above_background).unwrap_or(0.0),
                    sign: if above_background { sign } else { 1.0 },
                    variance,
                    gain,
                    level: local.and_then(|g| self.segmenter.level_at(g, sign)).or(level),
                    ground,
                };
                out.push(detection(region, image, method, &around, dark));
            };
            match (&mut self.cutter, clusters.mask()) {
                (Some(cutter), Some(mask)) => all.for_each(|r| match cutter.cut(r, mask, image) {
                    [] => add(r),
                    parts => parts.iter().for_each(&mut add),
                }),
                _ => all.for_each(add),
            }
        }
        cut_off::add(&mut out[first..], (image.width(), image.height()));
        Ok(())
    }
}

/// Measures a region: its box, its centroid with covariance, its contrast in standard deviations of its sum.
fn detection<T: Pixel>(
    r: &Region,
    image: &Image<T>,
    method: CentroidMethod,
    around: &Surroundings,
    dark: bool,
) -> Detection {
    let c = centroid(r, image, method, around);
    let noise = (around.variance.max(1e-12) * f64::from(r.area)).sqrt();
    let contrast = around.sign * (r.sum - around.background * f64::from(r.area));
    // Pixels that are no numbers tell nothing: no score is better than one that compares with none.
    let score = Some((contrast / noise) as f32).filter(|s| s.is_finite()).unwrap_or(0.0);
    Detection {
        position: c.position,
        cov: c.cov,
        extent: r.extent(),
        area_px: r.area,
        peak: if dark { r.min } else { r.max },
        sum: c.sum,
        score,
        class: None,
        velocity: None,
        fit: None,
        age_ns: 0,
        plot: None,
    }
}
