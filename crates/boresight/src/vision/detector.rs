//! The detector: a frame of any pixel type goes through the spatial filter, the way of finding that the configuration names, the fit of
//! spots if one is asked for, and the limits that hold for all of them.

use super::Detector;
use super::background::{Background, FrameDifference};
use super::bernoulli::BernoulliDetector;
use super::cfar::CfarDetector;
use super::colour::{ColourMask, grey_image, needs_colour};
use super::config::DetectorConfig;
use super::fit::Fitter;
use super::integrate::IntegrateDetector;
use super::isolated::IsolatedDetector;
use super::pixel::Pixel;
use super::region_finder::RegionFinder;
use super::repeated::Repeated;
use super::shaking::Shaking;
use super::spatial::{SpatialConfig, SpatialFilter};
use super::steadied::Steadied;
use super::strongest::Strongest;
use super::target_finder::{PRIME_FRAMES, TargetFinder, TypedFrame};
use super::threshold::ThresholdConfig;
use super::threshold::local::LocalThreshold;
use super::threshold::otsu::OtsuThreshold;
use super::threshold::spot::SpotDetector;
use super::window::Follower;
use crate::camera::{CameraConfig, CameraMotionEstimator};
use crate::{Detection, Error, ErrorKind, Frame, Image, PixelKind, Pixels, Result, Scan, SourceInfo, Timestamp};

/// Builds the detector that a configuration describes, for frames as the source announces them.
/// # Errors
/// A parameter out of its range.
pub fn build(config: &DetectorConfig, source: &SourceInfo) -> Result<Box<dyn Detector>> {
    config.validate("detector")?;
    if matches!(config.threshold, ThresholdConfig::Colour(_)) && source.kind != PixelKind::Rgb8 {
        return Err(needs_colour(&format!("{:?}", source.kind)));
    }
    let (of, size, kind) = (config.clone(), (source.width, source.height), source.kind);
    let make = move || FrameDetector::new(&of, size, kind).map(|detector| Box::new(detector) as Box<dyn Detector>);
    let detector: Box<dyn Detector> = match config.camera {
        CameraConfig::Fixed => make()?,
        CameraConfig::Moving => Box::new(WithCamera { detector: make()?, camera: CameraMotionEstimator::default() }),
        CameraConfig::Shaking => Box::new(Shaking::new(make)?),
    };
    Ok(if config.look_at_repeated { detector } else { Box::new(Repeated::new(detector)) })
}

/// Builds the way of finding that the configuration names: the one place that knows them all.
fn finder<T: Pixel>(config: &DetectorConfig) -> Result<Box<dyn TargetFinder<T>>> {
    Ok(match &config.threshold {
        ThresholdConfig::Band(c) => Box::new(RegionFinder::new(c.clone(), config)),
        ThresholdConfig::Level(c) => Box::new(RegionFinder::new(c.clone(), config)),
        ThresholdConfig::Otsu(c) => Box::new(RegionFinder::new(OtsuThreshold::new(c), config)),
        ThresholdConfig::Local(c) => Box::new(RegionFinder::new(LocalThreshold::new(c), config)),
        ThresholdConfig::Moving(c) => Box::new(RegionFinder::new(Background::<T>::new(c.clone())?, config)),
        ThresholdConfig::Difference(c) => Box::new(RegionFinder::new(FrameDifference::<T>::new(c.clone())?, config)),
        ThresholdConfig::Steadied(c) => Box::new(RegionFinder::new(Steadied::<T>::new(c)?, config)),
        ThresholdConfig::Colour(c) => Box::new(RegionFinder::new(ColourMask::new(*c)?, config)),
        ThresholdConfig::Isolated(c) => Box::new(IsolatedDetector::new(c)),
        ThresholdConfig::Spot(c) => Box::new(SpotDetector::new(c)),
        ThresholdConfig::Cfar(c) => Box::new(CfarDetector::new(c)),
        ThresholdConfig::Integrate(c) => Box::new(IntegrateDetector::new(c)),
        ThresholdConfig::Bernoulli(c) => Box::new(BernoulliDetector::new(c)),
    })
}

/// A detector that also says how the background moved.
struct WithCamera {
    detector: Box<dyn Detector>,
    camera: CameraMotionEstimator,
}

impl Detector for WithCamera {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        self.detector.detect(frame, scan)?;
        scan.camera_motion = self.camera.step(&frame.pixels);
        Ok(())
    }

    fn prime_s(&self) -> f64 {
        self.detector.prime_s()
    }

    fn prime(&mut self, frames: &[Frame]) -> Result<()> {
        self.detector.prime(frames)
    }

    fn leave_out_below(&mut self, area_px: u32) -> bool {
        self.detector.leave_out_below(area_px)
    }

    fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
        let done = self.detector.begin(frame, scan)?;
        scan.camera_motion = self.camera.step(&frame.pixels);
        Ok(done)
    }

    fn twin(&self) -> Option<Box<dyn Detector>> {
        self.detector.twin()
    }
}

/// The parts of a detector that depend on the pixel type.
struct Typed<T: Pixel> {
    /// The spatial filter and its result.
    filter: Option<(SpatialFilter<T>, Image<T>)>,
    finder: Box<dyn TargetFinder<T>>,
    /// Fits spots around what is found.
    fitter: Option<Fitter>,
}

impl<T: Pixel> Typed<T> {
    fn new(config: &DetectorConfig) -> Result<Self> {
        let filter = match config.filter {
            SpatialConfig::None => None,
            filter => Some((SpatialFilter::new(filter)?, Image::default())),
        };
        // Sums of frames have no frame to fit to.
        let is_summed = matches!(config.threshold, ThresholdConfig::Integrate(_) | ThresholdConfig::Bernoulli(_));
        let fitter = config.centroid.fit.clone().filter(|_| !is_summed).map(Fitter::new);
        Ok(Self { filter, finder: finder(config)?, fitter })
    }

    /// Learns from frames, after the filter; `times_s` are theirs since the first of them.
    fn prime(&mut self, times_s: &[f64], frames: &[&Image<T>]) -> Result<()> {
        let Some((filter, filtered)) = &mut self.filter else { return self.finder.prime(times_s, frames) };
        let filtered: Vec<Image<T>> = frames
            .iter()
            .map(|frame| {
                filter.apply(frame, filtered);
                filtered.clone()
            })
            .collect();
        self.finder.prime(times_s, &filtered.iter().collect::<Vec<_>>())
    }

    /// Appends what is found; whether the frame was one in which nothing could be.
    fn find(
        &mut self,
        raw: &Image<T>,
        colours: Option<&Image<[u8; 3]>>,
        dt_s: f64,
        config: &DetectorConfig,
        out: &mut Vec<Detection>,
    ) -> Result<bool> {
        let image = match &mut self.filter {
            Some((filter, filtered)) => {
                filter.apply(raw, filtered);
                filtered
            }
            None => raw,
        };
        self.finder.find(&TypedFrame { raw, image, colours, dt_s }, config, out)?;
        if let Some(fitter) = &mut self.fitter {
            fitter.refine(raw, &config.noise, out);
        }
        Ok(self.finder.is_blind())
    }
}

/// Frames keep their pixel type; colours are also made grey.
enum ByPixel {
    Gray8(Typed<u8>),
    Gray16(Typed<u16>),
    GrayF32(Typed<f32>),
    Rgb8(Typed<u8>, Image<u8>),
}

struct FrameDetector {
    config: DetectorConfig,
    size: (usize, usize),
    kind: PixelKind,
    by_pixel: ByPixel,
    strongest: Strongest,
    follower: Option<Follower>,
    last: Option<Timestamp>,
}

impl FrameDetector {
    fn new(config: &DetectorConfig, size: (usize, usize), kind: PixelKind) -> Result<Self> {
        Ok(Self {
            by_pixel: match kind {
                PixelKind::Gray8 => ByPixel::Gray8(Typed::new(config)?),
                PixelKind::Gray16 => ByPixel::Gray16(Typed::new(config)?),
                PixelKind::GrayF32 => ByPixel::GrayF32(Typed::new(config)?),
                PixelKind::Rgb8 => ByPixel::Rgb8(Typed::new(config)?, Image::default()),
            },
            size,
            kind,
            strongest: Strongest::default(),
            follower: config.follow.clone().map(Follower::new),
            last: None,
            config: config.clone(),
        })
    }

    /// Forgets the last scan.
    fn clear(&self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        scan.index = frame.index;
        scan.time = frame.time;
        scan.detections.clear();
        scan.camera_motion = None;
        scan.blind = false;
        if self.fits(frame) { Ok(()) } else { Err(self.refused(frame)) }
    }

    fn fits(&self, frame: &Frame) -> bool {
        (frame.pixels.width(), frame.pixels.height()) == self.size && frame.pixels.kind() == self.kind
    }

    /// Whether what is found in a frame depends on the frames before.
    fn remembers(&self) -> bool {
        let finds = match &self.by_pixel {
            ByPixel::Gray8(d) | ByPixel::Rgb8(d, _) => d.finder.remembers(),
            ByPixel::Gray16(d) => d.finder.remembers(),
            ByPixel::GrayF32(d) => d.finder.remembers(),
        };
        finds || self.follower.is_some()
    }

    fn refused(&self, frame: &Frame) -> Error {
        let ((w, h), pixels) = (self.size, &frame.pixels);
        let found = format!("{} x {} {:?}", pixels.width(), pixels.height(), pixels.kind());
        Error::new(ErrorKind::Damaged, format!("expected {w} x {h} {:?}, found {found}", self.kind))
            .at(format!("frame {:?}", frame.index))
            .hint("all frames of a sequence must have one size and one pixel type")
    }
}

impl Detector for FrameDetector {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        self.clear(frame, scan)?;
        let dt_s = self.last.map_or(0.0, |last| frame.time.seconds_since(last));
        let (config, out) = (&self.config, &mut scan.detections);
        scan.blind = match (&mut self.by_pixel, &frame.pixels) {
            (ByPixel::Gray8(d), Pixels::Gray8(image)) => d.find(image, None, dt_s, config, out)?,
            (ByPixel::Gray16(d), Pixels::Gray16(image)) => d.find(image, None, dt_s, config, out)?,
            (ByPixel::GrayF32(d), Pixels::GrayF32(image)) => d.find(image, None, dt_s, config, out)?,
            (ByPixel::Rgb8(d, grey), Pixels::Rgb8(image)) => {
                grey_image(image, grey);
                d.find(grey, Some(image), dt_s, config, out)?
            }
            _ => return Err(self.refused(frame)),
        };
        self.last = Some(frame.time);
        let extra = nalgebra::Matrix2::identity() * (config.centroid.extra_sd_px * config.centroid.extra_sd_px);
        out.iter_mut().for_each(|d| d.cov += extra);
        self.strongest.keep(out, config.max_detections);
        if let Some(follower) = &mut self.follower {
            follower.pick(out, self.size);
        }
        Ok(())
    }

    fn prime_s(&self) -> f64 {
        match &self.by_pixel {
            ByPixel::Gray8(d) | ByPixel::Rgb8(d, _) => d.finder.prime_s(),
            ByPixel::Gray16(d) => d.finder.prime_s(),
            ByPixel::GrayF32(d) => d.finder.prime_s(),
        }
    }

    fn prime(&mut self, frames: &[Frame]) -> Result<()> {
        if let Some(wrong) = frames.iter().find(|f| !self.fits(f)) {
            return Err(self.refused(wrong));
        }
        let n = PRIME_FRAMES.min(frames.len());
        let some: Vec<&Frame> = (0..n).map(|i| &frames[i * (frames.len() - 1) / (n - 1).max(1)]).collect();
        let times_s: Vec<f64> = some.iter().map(|f| f.time.seconds_since(frames[0].time)).collect();
        macro_rules! of_kind {
            ($kind:ident) => {
                some.iter()
                    .filter_map(|f| if let Pixels::$kind(image) = &f.pixels { Some(image) } else { None })
                    .collect::<Vec<_>>()
            };
        }
        match &mut self.by_pixel {
            ByPixel::Gray8(d) => d.prime(&times_s, &of_kind!(Gray8)),
            ByPixel::Gray16(d) => d.prime(&times_s, &of_kind!(Gray16)),
            ByPixel::GrayF32(d) => d.prime(&times_s, &of_kind!(GrayF32)),
            ByPixel::Rgb8(d, _) => {
                let grey = |image: &&Image<[u8; 3]>| {
                    let mut grey = Image::default();
                    grey_image(image, &mut grey);
                    grey
                };
                let grey: Vec<Image<u8>> = of_kind!(Rgb8).iter().map(grey).collect();
                d.prime(&times_s, &grey.iter().collect::<Vec<_>>())
            }
        }
    }

    fn leave_out_below(&mut self, area_px: u32) -> bool {
        let config = &mut self.config;
        let are_regions = matches!(config.threshold, ThresholdConfig::Moving(_));
        let is_possible = are_regions && config.follow.is_none() && config.centroid.fit.is_none();
        if is_possible {
            config.cluster.min_area_px = Some(area_px);
        }
        is_possible
    }

    fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
        if self.remembers() {
            return self.detect(frame, scan).map(|()| true);
        }
        self.clear(frame, scan).map(|()| false)
    }

    fn twin(&self) -> Option<Box<dyn Detector>> {
        if self.remembers() {
            return None;
        }
        // The configuration was checked when this one was built.
        FrameDetector::new(&self.config, self.size, self.kind).ok().map(|d| Box::new(d) as _)
    }
}
