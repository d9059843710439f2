//! The threshold detector: rows of pixels -> rows of bits -> regions -> detections, in one pass over the frame.

use super::background::BitImage;
use super::centroid::{Surroundings, centroid};
use super::cfar::CfarDetector;
use super::cluster::Clusterer;
use super::colour::{ColourMask, grey_image};
use super::config::{CentroidMethod, DetectorConfig, NoiseConfig, Weight};
use super::isolated::IsolatedDetector;
use super::noise_level::noise_level;
use super::pixel::Pixel;
use super::preprocess::Preprocessing;
use super::strongest::Strongest;
use super::threshold::band::words;
use super::threshold::grid::BackgroundGrid;
use super::threshold::level::{band_edge, one_band, one_side};
use super::threshold::local::LocalThreshold;
use super::threshold::otsu::otsu_level;
use super::threshold::spot::SpotDetector;
use super::threshold::{LevelConfig, Side, ThresholdConfig};
use super::window::Follower;
use super::{Detector, region::Region};
use crate::camera::{CameraConfig, CameraMotionEstimator};
use crate::{
    Detection, Error, ErrorKind, Extent, Frame, Image, PixelKind, Pixels, Result, Scan, SourceInfo, Timestamp,
};

/// Cells of the background when the threshold itself does not name a size, px.
const DEFAULT_CELL_PX: u32 = 32;

/// Builds the detector that a configuration describes, for frames as the source announces them.
/// # Errors
/// A parameter out of its range.
pub fn build(config: &DetectorConfig, source: &SourceInfo) -> Result<Box<dyn Detector>> {
    config.validate("detector")?;
    if matches!(config.threshold, ThresholdConfig::Colour(_)) && source.kind != PixelKind::Rgb8 {
        return Err(Error::new(ErrorKind::Config, format!("expected colour frames, found {:?}", source.kind))
            .at("detector.threshold.colour")
            .hint("--set input.colour=rgb reads a video in colour; grey pictures have none"));
    }
    let detector = Box::new(ThresholdDetector::new(config.clone(), (source.width, source.height), source.kind)?);
    Ok(match config.camera {
        CameraConfig::Fixed => detector,
        CameraConfig::Moving => Box::new(WithCamera { detector, camera: CameraMotionEstimator::default() }),
    })
}

/// A detector that also says how far the background moved.
struct WithCamera {
    detector: Box<dyn Detector>,
    camera: CameraMotionEstimator,
}

impl Detector for WithCamera {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        self.detector.detect(frame, scan)?;
        scan.camera_shift_px = self.camera.step(&frame.pixels);
        Ok(())
    }
}

struct ThresholdDetector {
    config: DetectorConfig,
    size: (usize, usize),
    kind: PixelKind,
    /// Colour frames as grey.
    grey: Image<u8>,
    grid: BackgroundGrid,
    local: LocalThreshold,
    bits: Vec<u64>,
    /// Clusters brighter and darker than their surroundings.
    bright: Clusterer,
    dark: Clusterer,
    samples: Vec<f32>,
    strongest: Strongest,
    isolated: IsolatedDetector,
    spots: Option<SpotDetector>,
    cfar: Option<CfarDetector>,
    colour: Option<ColourMask>,
    /// One per pixel type, so that a frame keeps its type.
    pre8: Preprocessing<u8>,
    pre16: Preprocessing<u16>,
    pre32: Preprocessing<f32>,
    last: Option<Timestamp>,
    follower: Option<Follower>,
}

impl ThresholdDetector {
    fn new(config: DetectorConfig, size: (usize, usize), kind: PixelKind) -> Result<Self> {
        let cell = match &config.threshold {
            ThresholdConfig::Local(c) => c.cell_px,
            _ => DEFAULT_CELL_PX,
        };
        let spots = match &config.threshold {
            ThresholdConfig::Spot(c) => Some(SpotDetector::new(c)),
            _ => None,
        };
        let cfar = match &config.threshold {
            ThresholdConfig::Cfar(c) => Some(CfarDetector::new(c)),
            _ => None,
        };
        Ok(Self {
            cfar,
            colour: match &config.threshold {
                ThresholdConfig::Colour(c) => Some(ColourMask::new(*c)?),
                _ => None,
            },
            size,
            kind,
            spots,
            pre8: Preprocessing::new(config.filter, &config.threshold)?,
            pre16: Preprocessing::new(config.filter, &config.threshold)?,
            pre32: Preprocessing::new(config.filter, &config.threshold)?,
            last: None,
            follower: config.follow.clone().map(Follower::new),
            grey: Image::default(),
            grid: BackgroundGrid::new(cell as usize),
            local: LocalThreshold::default(),
            bits: vec![0; words(size.0)],
            bright: Clusterer::new(&config.cluster),
            dark: Clusterer::new(&config.cluster),
            samples: Vec::new(),
            strongest: Strongest::default(),
            isolated: IsolatedDetector::default(),
            config,
        })
    }

    /// Whether positions are weighed by the distance from the background.
    fn above_background(&self) -> bool {
        match self.config.centroid.weight {
            Weight::Intensity => false,
            Weight::AboveBackground => true,
            Weight::Auto => match &self.config.threshold {
                ThresholdConfig::Band(_) => false,
                ThresholdConfig::Level(LevelConfig { side, .. }) => *side == Side::Dark,
                ThresholdConfig::Otsu(c) => c.side == Side::Dark,
                ThresholdConfig::Local(_)
                | ThresholdConfig::Spot(_)
                | ThresholdConfig::Cfar(_)
                | ThresholdConfig::Isolated(_) => true,
                // Their pixels may be brighter or darker than the ground, so they count alike, see `method`.
                ThresholdConfig::Moving(_) | ThresholdConfig::Difference(_) | ThresholdConfig::Colour(_) => false,
            },
        }
    }

    /// Variance of one pixel at intensity 0, counts², and its growth with intensity.
    fn pixel_noise<T: Pixel>(&mut self, image: &Image<T>) -> (f64, f64) {
        if matches!(self.config.threshold, ThresholdConfig::Isolated(_) | ThresholdConfig::Cfar(_)) {
            // They measure the noise of the pixels that they see, themselves.
            return (0.0, 0.0);
        }
        match &self.config.noise {
            // The rounding to whole counts is noise as well.
            NoiseConfig::Given(g) => (g.read_counts * g.read_counts + f64::from(T::STEP) / 12.0, g.gain),
            NoiseConfig::Estimated => (noise_level(image, &mut self.samples).powi(2), 0.0),
        }
    }

    /// The centroid's method: where a pixel's value does not say how surely it is target, all pixels count alike.
    fn method(&self) -> CentroidMethod {
        let alike = matches!(
            self.config.threshold,
            ThresholdConfig::Moving(_) | ThresholdConfig::Difference(_) | ThresholdConfig::Colour(_)
        );
        match self.config.centroid.method {
            CentroidMethod::Mask if alike && self.config.centroid.weight == Weight::Auto => CentroidMethod::Binary,
            method => method,
        }
    }

    fn run8(&mut self, image: &Image<u8>, scan: &mut Scan) -> Result<()> {
        let mut pre = std::mem::take(&mut self.pre8);
        let done = self.run_on(image, &mut pre, scan);
        self.pre8 = pre;
        done
    }

    fn run_on<T: Pixel>(&mut self, image: &Image<T>, pre: &mut Preprocessing<T>, scan: &mut Scan) -> Result<()> {
        // The noise is that of the unfiltered pixels: a weighted sum over a cluster of smoothed pixels is nearly the same
        // sum over the pixels before smoothing, whose noise is white.
        let noise = self.pixel_noise(image);
        let image = pre.smoother.as_mut().map_or(image, |f| f.apply(image));
        if let Some(motion) = &mut pre.motion {
            motion.update(image, scan.time, self.last)?;
        }
        self.last = Some(scan.time);
        let colour = self.colour.take();
        let mask = pre.motion.as_ref().map(|m| m.bits()).or(colour.as_ref().map(ColourMask::bits));
        self.run(image, noise, mask, scan);
        self.colour = colour;
        Ok(())
    }

    fn run<T: Pixel>(
        &mut self,
        image: &Image<T>,
        (variance, gain): (f64, f64),
        mask: Option<&BitImage>,
        scan: &mut Scan,
    ) {
        if let ThresholdConfig::Isolated(c) = &self.config.threshold {
            self.isolated.run(image, &self.config, c, scan);
            self.strongest.keep(&mut scan.detections, self.config.max_detections);
            return;
        }
        if let Some(cfar) = &mut self.cfar {
            cfar.detect(image, &mut scan.detections);
            let extra = nalgebra::Matrix2::identity() * self.config.centroid.extra_sd_px.powi(2);
            scan.detections.iter_mut().for_each(|d| d.cov += extra);
            self.strongest.keep(&mut scan.detections, self.config.max_detections);
            return;
        }
        if let Some(spots) = &mut self.spots {
            spots.detect(image, (variance, gain), &mut scan.detections);
            let extra = nalgebra::Matrix2::identity() * self.config.centroid.extra_sd_px.powi(2);
            scan.detections.iter_mut().for_each(|d| d.cov += extra);
            self.strongest.keep(&mut scan.detections, self.config.max_detections);
            return;
        }
        let above_background = self.above_background();
        let fresh_grid = above_background || matches!(self.config.threshold, ThresholdConfig::Local(_));
        if fresh_grid {
            self.grid.refresh(image);
        }
        self.bright.begin(image.width());
        self.dark.begin(image.width());
        // The level at which pixels join, where it is the same all over the frame.
        let mut level = None;
        match &self.config.threshold {
            ThresholdConfig::Band(c) => {
                let band = T::band(c.low, c.high);
                level = band.map(|(low, high)| band_edge(low, high));
                one_band(image, band, &mut self.bits, &mut self.bright);
            }
            ThresholdConfig::Level(c) => {
                level = one_side(image, c, &mut self.bits, &mut self.bright, &mut self.dark);
            }
            ThresholdConfig::Otsu(c) => {
                if let Some(found) = otsu_level(image) {
                    let c = LevelConfig { level: found, side: c.side, exclusive: false };
                    level = one_side(image, &c, &mut self.bits, &mut self.bright, &mut self.dark);
                }
            }
            ThresholdConfig::Moving(_) | ThresholdConfig::Difference(_) | ThresholdConfig::Colour(_) => {
                for (y, mask) in mask.iter().flat_map(|m| (0..image.height()).map(move |y| (y, m))) {
                    self.bright.row(y, mask.row(y), image.row(y));
                }
            }
            // Ran above: they have no rows of bits of their own.
            ThresholdConfig::Isolated(_) | ThresholdConfig::Spot(_) | ThresholdConfig::Cfar(_) => {}
            ThresholdConfig::Local(c) => {
                for y in 0..image.height() {
                    let row = image.row(y);
                    if c.polarity.has(Side::Bright) {
                        self.local.bits::<T, true>(c, &self.grid, y, row, &mut self.bits);
                        self.bright.row(y, &self.bits, row);
                    }
                    if c.polarity.has(Side::Dark) {
                        self.local.bits::<T, false>(c, &self.grid, y, row, &mut self.bits);
                        self.dark.row(y, &self.bits, row);
                    }
                }
            }
        }
        let method = self.method();
        let (min, max) = self.config.cluster.area_limits();
        for (clusters, dark) in [(&self.bright, false), (&self.dark, true)] {
            for region in clusters.regions().filter(|r| (min..=max).contains(&r.area)) {
                let local = fresh_grid.then(|| {
                    let n = f64::from(region.area);
                    self.grid.at(region.x / n, region.y / n)
                });
                let ground = local.map(|(median, _)| median);
                // Moving and coloured pixels are not told apart by their sign: the region's mean tells.
                let below = ground.is_some_and(|g| region.sum < g * f64::from(region.area));
                let dark = if mask.is_some() { below } else { dark };
                let sign = if dark { -1.0 } else { 1.0 };
                let level = match (&self.config.threshold, local) {
                    (ThresholdConfig::Local(c), Some((median, deviation))) => {
                        Some(median + sign * (c.k * deviation).max(c.min_contrast))
                    }
                    _ => level,
                };
                let around = Surroundings {
                    background: ground.filter(|_| above_background).unwrap_or(0.0),
                    sign: if above_background { sign } else { 1.0 },
                    variance,
                    gain,
                    level,
                    ground,
                };
                scan.detections.push(detection(region, image, &self.config, method, &around, dark));
            }
        }
        self.strongest.keep(&mut scan.detections, self.config.max_detections);
    }
}

fn detection<T: Pixel>(
    r: &Region,
    image: &Image<T>,
    config: &DetectorConfig,
    method: CentroidMethod,
    around: &Surroundings,
    dark: bool,
) -> Detection {
    let c = centroid(r, image, method, around);
    let extra = config.centroid.extra_sd_px * config.centroid.extra_sd_px;
    let noise = (around.variance.max(1e-12) * f64::from(r.area)).sqrt();
    let contrast = around.sign * (r.sum - around.background * f64::from(r.area));
    // Pixels that are no numbers tell nothing: no score is better than one that compares with none.
    let score = Some((contrast / noise) as f32).filter(|s| s.is_finite()).unwrap_or(0.0);
    Detection {
        position: c.position,
        cov: c.cov + nalgebra::Matrix2::identity() * extra,
        extent: Extent {
            left_px: f64::from(r.left) - 0.5,
            top_px: f64::from(r.top) - 0.5,
            width_px: f64::from(r.right - r.left + 1),
            height_px: f64::from(r.bottom - r.top + 1),
        },
        area_px: r.area,
        peak: if dark { r.min } else { r.max },
        sum: c.sum,
        score,
        class: None,
    }
}

impl Detector for ThresholdDetector {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        scan.index = frame.index;
        scan.time = frame.time;
        scan.detections.clear();
        scan.camera_shift_px = None;
        let (width, height) = (frame.pixels.width(), frame.pixels.height());
        if (width, height) != self.size || frame.pixels.kind() != self.kind {
            let (w, h) = self.size;
            return Err(Error::new(
                ErrorKind::Damaged,
                format!("expected {w} x {h} {:?}, found {width} x {height} {:?}", self.kind, frame.pixels.kind()),
            )
            .at(format!("frame {:?}", frame.index))
            .hint("all frames of a sequence must have one size and one pixel type"));
        }
        match &frame.pixels {
            Pixels::Gray8(image) => self.run8(image, scan)?,
            Pixels::Gray16(image) => {
                let mut pre = std::mem::take(&mut self.pre16);
                let done = self.run_on(image, &mut pre, scan);
                self.pre16 = pre;
                done?;
            }
            Pixels::GrayF32(image) => {
                let mut pre = std::mem::take(&mut self.pre32);
                let done = self.run_on(image, &mut pre, scan);
                self.pre32 = pre;
                done?;
            }
            Pixels::Rgb8(image) => {
                let mut grey = std::mem::take(&mut self.grey);
                grey_image(image, &mut grey);
                if let Some(colour) = &mut self.colour {
                    colour.update(image);
                }
                let done = self.run8(&grey, scan);
                self.grey = grey;
                done?;
            }
        }
        if let Some(follower) = &mut self.follower {
            follower.pick(&mut scan.detections, self.size);
        }
        Ok(())
    }
}
