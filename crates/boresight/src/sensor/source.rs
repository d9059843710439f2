//! A source whose frames are mended on their way.
//!
//! Nobody need ask for bad pixels of frames that no codec has smeared ([`if_bad_pixels`]): they are mended if there are any.
//! Where defects are to be found and there are no dark frames, the first [`LEARN`] frames are read ahead and looked at; they are handed out mended as all others.

use super::config::SensorConfig;
use super::correction::{Calibration, Correction};
use super::defects::{Defects, find_defects};
use super::mean_map::MeanMap;
use crate::{Error, ErrorKind, Frame, FrameSource, PixelKind, Result, SourceInfo, Wanted};
use std::collections::VecDeque;

/// Frames in which defects are looked for.
pub(super) const LEARN: usize = 32;

/// A larger share of the pixels is no sensor's: it is how such frames are made.
const MOST_BAD: f64 = 0.01;

/// The source with its bad pixels mended and how many there are, if it is of grey frames as a sensor gives them, `ahead` of them may be read ahead, and they have any; else itself, and 0.
/// # Errors
/// A first frame that cannot be read.
pub(crate) fn if_bad_pixels(source: Box<dyn FrameSource>, ahead: usize) -> Result<(Box<dyn FrameSource>, usize)> {
    let info = source.info().clone();
    // Video in the usual sense is coded in blocks, which smear a single pixel, and looking costs as much as decoding.
    let is_coded = ["H.264", "ffmpeg"].iter().any(|coded| info.reader.starts_with(coded));
    if is_coded || info.kind == PixelKind::Rgb8 || ahead < LEARN || info.n_frames.is_some_and(|n| n < LEARN as u64) {
        return Ok((source, 0));
    }
    let config = SensorConfig { bad_pixels: Some(true), ..SensorConfig::default() };
    let mut mended = MendedSource::new(source, &config, &Calibration::default(), None)?;
    let n = mended.correction.n_bad();
    let is_sensors = mended.ahead.len() >= LEARN && n as f64 <= MOST_BAD * (info.width * info.height) as f64;
    if n == 0 || !is_sensors {
        mended.info = info;
        mended.correction = Correction::none();
        return Ok((Box::new(mended), 0));
    }
    Ok((Box::new(mended), n))
}

/// Mends the frames of a source.
pub struct MendedSource {
    inner: Box<dyn FrameSource>,
    info: SourceInfo,
    ahead: VecDeque<Frame>,
    correction: Correction,
    /// A failure among the frames read ahead, to be handed out behind them.
    broken: Option<Error>,
}

opaque_debug!(MendedSource);

impl MendedSource {
    /// Wraps a source; `dark` holds the dark frames that defects are looked for in, if there are any.
    /// # Errors
    /// Colour frames; dark or flat frames that do not go with the source's; a first frame that cannot be read.
    pub fn new(
        mut inner: Box<dyn FrameSource>,
        config: &SensorConfig,
        known: &Calibration,
        dark: Option<&MeanMap>,
    ) -> Result<Self> {
        let mut info = inner.info().clone();
        if info.kind == PixelKind::Rgb8 {
            return Err(Error::new(ErrorKind::Config, "a sensor's frames are mended in grey only")
                .at("input.sensor")
                .hint("--set input.colour=gray"));
        }
        let (mut ahead, mut broken) = (VecDeque::new(), None);
        let defects = match dark {
            _ if !(config.fills() || config.column_noise) => Defects::default(),
            Some(dark) => find_defects(dark),
            None => {
                let mut map = MeanMap::default();
                while ahead.len() < LEARN && broken.is_none() {
                    match inner.next_frame() {
                        Ok(Some(frame)) => {
                            // A frame of another size is the detector's to refuse.
                            let _ = map.push(&frame.pixels);
                            ahead.push_back(frame);
                        }
                        Ok(None) => break,
                        Err(e) => broken = Some(e),
                    }
                }
                find_defects(&map)
            }
        };
        let correction = Correction::new((info.width, info.height), config, known, &defects)?;
        let mut done = Vec::new();
        done.extend(known.dark.is_some().then(|| "dark frame".to_string()));
        done.extend(known.flat.is_some().then(|| "flat frame".to_string()));
        done.extend((config.fills() || correction.n_bad() > 0).then(|| format!("{} bad pixels", correction.n_bad())));
        let columns = known.dark.is_none() && config.column_noise;
        done.extend(columns.then(|| format!("columns of {:.2} counts rms", defects.column_rms())));
        info.reader = format!("{}; mended: {}", info.reader, done.join(", "));
        Ok(Self { inner, info, ahead, correction, broken })
    }
}

impl FrameSource for MendedSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let frame = match self.ahead.pop_front() {
            Some(frame) => Some(frame),
            None => match self.broken.take() {
                Some(e) => return Err(e),
                None => self.inner.next_frame()?,
            },
        };
        Ok(frame.map(|mut frame| {
            self.correction.apply(&mut frame.pixels);
            frame
        }))
    }

    fn recycle(&mut self, frame: Frame) {
        self.inner.recycle(frame);
    }

    fn entries(&self) -> Vec<u64> {
        self.inner.entries()
    }

    fn want_only(&mut self, wanted: Wanted) {
        self.inner.want_only(wanted);
    }

    fn reads_ahead(&self) -> bool {
        self.inner.reads_ahead()
    }

    fn warnings(&self) -> &[String] {
        self.inner.warnings()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIZE: usize = 40;

    /// Frames of noise in which pixels are changed.
    struct Noise {
        info: SourceInfo,
        rng: ChaCha8Rng,
        given: u64,
        change: fn(u64, &mut Image<u16>),
    }

    impl FrameSource for Noise {
        fn info(&self) -> &SourceInfo {
            &self.info
        }

        fn next_frame(&mut self) -> Result<Option<Frame>> {
            let k = self.given;
            self.given += 1;
            let mut image = Image::filled(SIZE, SIZE, 0u16);
            let noise = |v: &mut u16| *v = (1000.0 + 5.0 * self.rng.sample::<f64, _>(StandardNormal)) as u16;
            image.as_mut_slice().iter_mut().for_each(noise);
            (self.change)(k, &mut image);
            let time = Timestamp::from_secs_f64(k as f64);
            Ok((k < 40).then_some(Frame { index: FrameIndex(k), time, pixels: Pixels::Gray16(image) }))
        }
    }

    fn noise(reader: &str, change: fn(u64, &mut Image<u16>)) -> Box<dyn FrameSource> {
        let info = SourceInfo {
            label: String::new(),
            reader: reader.to_string(),
            width: SIZE,
            height: SIZE,
            kind: PixelKind::Gray16,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        Box::new(Noise { info, rng: ChaCha8Rng::seed_from_u64(6), given: 0, change })
    }

    /// How many are found, and all frames as they are handed out.
    fn mended(source: Box<dyn FrameSource>) -> (usize, Vec<Pixels>) {
        let (mut source, n) = if_bad_pixels(source, LEARN).unwrap();
        let mut out = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            out.push(frame.pixels);
        }
        (n, out)
    }

    #[test]
    fn bad_pixels_are_filled_unasked_and_nothing_else_is_touched() {
        let hot_and_dead = |_: u64, image: &mut Image<u16>| {
            image.row_mut(7)[5] = 4000;
            image.row_mut(30)[21] = 0;
        };
        let (n, frames) = mended(noise("TIFF pages", hot_and_dead));
        assert_eq!((n, frames.len()), (2, 40));
        for pixels in &frames {
            let Pixels::Gray16(image) = pixels else { panic!() };
            assert!(image.as_slice().iter().all(|v| (900..1100).contains(v)), "all are as noise is");
        }
        let plain = |_: u64, _: &mut Image<u16>| {};
        let (n, frames) = mended(noise("TIFF pages", plain));
        let mut source = noise("TIFF pages", plain);
        assert_eq!((n, frames.len()), (0, 40));
        for pixels in frames {
            assert_eq!(pixels, source.next_frame().unwrap().unwrap().pixels);
        }
        assert_eq!(mended(noise("H.264 in process", hot_and_dead)).0, 0, "coded video is not looked at");
    }

    #[test]
    fn a_point_of_a_single_pixel_that_moves_is_no_bad_pixel() {
        // By three pixels a frame it is once on each; by one in twelve frames it stays a while.
        let fast = |k: u64, image: &mut Image<u16>| image.row_mut(11)[(3 * k as usize + 2) % SIZE] = 3000;
        let slow = |k: u64, image: &mut Image<u16>| image.row_mut(11)[2 + k as usize / 12] = 3000;
        assert_eq!(mended(noise("TIFF pages", fast)).0, 0);
        assert_eq!(mended(noise("TIFF pages", slow)).0, 0);
    }
}
