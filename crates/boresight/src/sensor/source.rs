//! A source whose frames are mended on their way.
//!
//! Nobody need ask for bad pixels, and columns, of frames that no codec has smeared, nor for what is drawn on the picture ([`if_defective`]): they are mended if there are any.
//! Where defects are to be found and there are no dark frames, the first [`LEARN`] frames are read ahead and looked at, for what is drawn [`OVERLAY_FRAMES`]; they are handed out mended as all others.

use super::config::SensorConfig;
use super::correction::{Calibration, Correction};
use super::defects::{Defects, find_defects};
use super::mean_map::MeanMap;
use super::overlay::find_overlay;
use crate::{Error, ErrorKind, Frame, FrameSource, Image, PixelKind, Pixels, Result, SourceInfo, Wanted};
use std::collections::VecDeque;

/// Frames in which defects are looked for.
pub(super) const LEARN: usize = 32;

/// Frames in which it is looked for what is drawn, of a file and of a stream, and the memory they take at most, bytes: some seconds, in which a clock goes on and a camera pans.
const OVERLAY_FRAMES: [usize; 2] = [400, 48];
const OVERLAY_BYTES: usize = 128 << 20;

/// A larger share of the pixels is no sensor's: it is how such frames are made.
const MOST_BAD: f64 = 0.01;

/// What is mended unasked.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Found {
    pub n_bad: usize,
    /// Root mean square of the columns' offsets, counts; 0 where they are left.
    pub column_rms: f64,
    /// Pixels of what is drawn on the picture.
    pub drawn: Vec<[u32; 2]>,
}

impl Found {
    /// What fills in other frames of this size what is drawn on the picture; none where nothing is.
    pub(crate) fn overlay(&self, width: usize, height: usize) -> Option<Correction> {
        let config = SensorConfig { overlay: Some(true), ..SensorConfig::default() };
        let defects = Defects { overlay: self.drawn.clone(), ..Defects::default() };
        let known = Calibration::default();
        (!self.drawn.is_empty()).then(|| Correction::new((width, height), &config, &known, &defects).ok()).flatten()
    }
}

/// The source with its bad pixels and its columns mended and what is drawn on it filled, and what was found, if it is of grey frames (as a sensor gives them, for what is a sensor's), `ahead` of them may
/// be read ahead, and there is anything of which the configuration does not say whether it is mended; else itself, and nothing. Columns only where the scene moves over them: else they may be the
/// scene's, and at rest they do no harm.
/// # Errors
/// A first frame that cannot be read.
pub(crate) fn if_defective(
    source: Box<dyn FrameSource>,
    ahead: usize,
    asked: &SensorConfig,
) -> Result<(Box<dyn FrameSource>, Found)> {
    let info = source.info().clone();
    let is_short = ahead < LEARN || info.n_frames.is_some_and(|n| n < LEARN as u64);
    if is_short || asked.is_active() {
        return Ok((source, Found::default()));
    }
    let all_said = asked.bad_pixels.is_some() && asked.column_noise.is_some();
    let of_a_sensor = !all_said && !source.is_coded() && info.kind != PixelKind::Rgb8;
    let may_be_drawn = asked.overlay.is_none() && info.kind == PixelKind::Gray8;
    if !of_a_sensor && !may_be_drawn {
        return Ok((source, Found::default()));
    }
    let looked_at = LookedAt::of(source, of_a_sensor, may_be_drawn);
    let defects = looked_at.defects(may_be_drawn);
    let n_bad = defects.pixels.len();
    let of_all = (info.width * info.height) as f64;
    let is_sensors = of_a_sensor && looked_at.ahead.len() >= LEARN && n_bad as f64 <= MOST_BAD * of_all;
    let fills = is_sensors && n_bad > 0 && asked.bad_pixels.is_none();
    let moves = || looked_at.map.is_of_a_moving_scene();
    let levels = is_sensors && asked.column_noise.is_none() && !defects.columns.is_empty() && moves();
    let overlay = !defects.overlay.is_empty();
    let config = SensorConfig {
        bad_pixels: Some(fills),
        column_noise: Some(levels),
        overlay: Some(overlay),
        ..SensorConfig::default()
    };
    let found = Found {
        n_bad: if fills { n_bad } else { 0 },
        column_rms: if levels { defects.column_rms() } else { 0.0 },
        drawn: defects.overlay.clone(),
    };
    let mended = MendedSource::put_together(looked_at, &config, &Calibration::default(), &defects)?;
    Ok((Box::new(mended), found))
}

/// A source of which frames were read ahead, and the map of the first of them.
struct LookedAt {
    inner: Box<dyn FrameSource>,
    ahead: VecDeque<Frame>,
    broken: Option<Error>,
    map: MeanMap,
    /// Frames in which it is looked for what is drawn: of all that are read ahead as many as a run with the configuration written reads.
    n_drawn: usize,
}

impl LookedAt {
    /// Reads what a sensor's defects are looked for in, and what is drawn.
    fn of(mut inner: Box<dyn FrameSource>, of_a_sensor: bool, drawn: bool) -> Self {
        let info = inner.info();
        let [of_file, of_stream] = OVERLAY_FRAMES;
        let most = if info.n_frames.is_some() { of_file } else { of_stream };
        let n_drawn = if drawn { most.min(OVERLAY_BYTES / (info.width * info.height).max(1)) } else { 0 };
        let n_mapped = if of_a_sensor { LEARN } else { 0 };
        let (mut ahead, mut broken, mut map) = (VecDeque::new(), None, MeanMap::default());
        while ahead.len() < n_mapped.max(n_drawn) && broken.is_none() {
            match inner.next_frame() {
                Ok(Some(frame)) => {
                    if ahead.len() < n_mapped {
                        // A frame of another size is the detector's to refuse.
                        let _ = map.push(&frame.pixels);
                    }
                    ahead.push_back(frame);
                }
                Ok(None) => break,
                Err(e) => broken = Some(e),
            }
        }
        Self { inner, ahead, broken, map, n_drawn }
    }

    /// What was found in what was read; what is drawn only if that was.
    fn defects(&self, drawn: bool) -> Defects {
        let mut defects = find_defects(&self.map);
        if drawn {
            fn grey(frame: &Frame) -> Option<&Image<u8>> {
                match &frame.pixels {
                    Pixels::Gray8(image) => Some(image),
                    _ => None,
                }
            }
            defects.overlay = find_overlay(&self.ahead.iter().take(self.n_drawn).filter_map(grey).collect::<Vec<_>>());
            // Thin lines are unlike all around as bad pixels are: they count once. Both are in the order of rows.
            let place = |[x, y]: &[u32; 2]| [*y, *x];
            let Defects { pixels, overlay, .. } = &mut defects;
            pixels.retain(|p| overlay.binary_search_by_key(&place(p), place).is_err());
        }
        defects
    }
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
        inner: Box<dyn FrameSource>,
        config: &SensorConfig,
        known: &Calibration,
        dark: Option<&MeanMap>,
    ) -> Result<Self> {
        if inner.info().kind == PixelKind::Rgb8 {
            return Err(Error::new(ErrorKind::Config, "a sensor's frames are mended in grey only")
                .at("input.sensor")
                .hint("--set input.colour=gray"));
        }
        let nothing =
            |inner| LookedAt { inner, ahead: VecDeque::new(), broken: None, map: MeanMap::default(), n_drawn: 0 };
        let (looked_at, defects) = match dark {
            _ if !(config.fills() || config.levels_columns() || config.fills_overlay()) => {
                (nothing(inner), Defects::default())
            }
            Some(dark) if !config.fills_overlay() => (nothing(inner), find_defects(dark)),
            _ => {
                let of_frames = dark.is_none() && (config.fills() || config.levels_columns());
                let looked_at = LookedAt::of(inner, of_frames, config.fills_overlay());
                let drawn = looked_at.defects(config.fills_overlay());
                let defects = match dark {
                    Some(dark) => Defects { overlay: drawn.overlay, ..find_defects(dark) },
                    None => drawn,
                };
                (looked_at, defects)
            }
        };
        Self::put_together(looked_at, config, known, &defects)
    }

    fn put_together(
        looked_at: LookedAt,
        config: &SensorConfig,
        known: &Calibration,
        defects: &Defects,
    ) -> Result<Self> {
        let LookedAt { inner, ahead, broken, .. } = looked_at;
        let mut info = inner.info().clone();
        let correction = Correction::new((info.width, info.height), config, known, defects)?;
        let mut done = Vec::new();
        done.extend(known.dark.is_some().then(|| "dark frame".to_string()));
        done.extend(known.flat.is_some().then(|| "flat frame".to_string()));
        let n_drawn = if config.fills_overlay() { defects.overlay.len() } else { 0 };
        let n_bad = correction.n_bad().saturating_sub(n_drawn);
        done.extend((config.fills() || n_bad > 0).then(|| format!("{n_bad} bad pixels")));
        done.extend((n_drawn > 0).then(|| format!("{n_drawn} pixels of what is drawn")));
        let columns = known.dark.is_none() && config.levels_columns();
        done.extend(columns.then(|| format!("columns of {:.2} counts rms", defects.column_rms())));
        if !done.is_empty() {
            info.reader = format!("{}; mended: {}", info.reader, done.join(", "));
        }
        Ok(Self { inner, info, ahead, correction, broken })
    }
}

impl FrameSource for MendedSource {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn is_coded(&self) -> bool {
        self.inner.is_coded()
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

    fn will_hold(&mut self, n: usize) {
        self.inner.will_hold(n);
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
    use crate::{FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIZE: usize = 40;

    /// Frames of noise in which pixels are changed.
    struct Noise {
        info: SourceInfo,
        coded: bool,
        rng: ChaCha8Rng,
        given: u64,
        change: fn(u64, &mut Image<u16>),
    }

    impl FrameSource for Noise {
        fn info(&self) -> &SourceInfo {
            &self.info
        }

        fn is_coded(&self) -> bool {
            self.coded
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

    fn noise(coded: bool, change: fn(u64, &mut Image<u16>)) -> Box<dyn FrameSource> {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: SIZE,
            height: SIZE,
            kind: PixelKind::Gray16,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        Box::new(Noise { info, coded, rng: ChaCha8Rng::seed_from_u64(6), given: 0, change })
    }

    /// How many are found, and all frames as they are handed out.
    fn mended(source: Box<dyn FrameSource>) -> (usize, Vec<Pixels>) {
        let (mut source, found) = if_defective(source, LEARN, &SensorConfig::default()).unwrap();
        let mut out = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            out.push(frame.pixels);
        }
        (found.n_bad, out)
    }

    #[test]
    fn bad_pixels_are_filled_unasked_and_nothing_else_is_touched() {
        let hot_and_dead = |_: u64, image: &mut Image<u16>| {
            image.row_mut(7)[5] = 4000;
            image.row_mut(30)[21] = 0;
        };
        let (n, frames) = mended(noise(false, hot_and_dead));
        assert_eq!((n, frames.len()), (2, 40));
        for pixels in &frames {
            let Pixels::Gray16(image) = pixels else { panic!() };
            assert!(image.as_slice().iter().all(|v| (900..1100).contains(v)), "all are as noise is");
        }
        let plain = |_: u64, _: &mut Image<u16>| {};
        let (n, frames) = mended(noise(false, plain));
        let mut source = noise(false, plain);
        assert_eq!((n, frames.len()), (0, 40));
        for pixels in frames {
            assert_eq!(pixels, source.next_frame().unwrap().unwrap().pixels);
        }
        assert_eq!(mended(noise(true, hot_and_dead)).0, 0, "coded video is not looked at");
    }

    #[test]
    fn a_point_of_a_single_pixel_that_moves_is_no_bad_pixel() {
        // By three pixels a frame it is once on each; by one in twelve frames it stays a while.
        let fast = |k: u64, image: &mut Image<u16>| image.row_mut(11)[(3 * k as usize + 2) % SIZE] = 3000;
        let slow = |k: u64, image: &mut Image<u16>| image.row_mut(11)[2 + k as usize / 12] = 3000;
        assert_eq!(mended(noise(false, fast)).0, 0);
        assert_eq!(mended(noise(false, slow)).0, 0);
    }

    #[test]
    fn offsets_of_columns_are_taken_off_where_the_scene_moves_over_them() {
        const COLUMN: f64 = 10.0;
        /// Columns off by up to that many counts to either side, over waves that go to the right by so many pixels a frame.
        fn frames<const SPEED: u64>(k: u64, image: &mut Image<u16>) {
            for y in 0..SIZE {
                for x in 0..SIZE {
                    let way = x as f64 - (SPEED * k) as f64;
                    let scene = 20.0 * (std::f64::consts::TAU / 16.0 * way + 0.2 * y as f64).sin();
                    let column = COLUMN * 2.0 * ((12.9898 * x as f64).sin() * 43_758.545_3).rem_euclid(1.0) - COLUMN;
                    let v = &mut image.row_mut(y)[x];
                    *v = (f64::from(*v) + scene + column) as u16;
                }
            }
        }
        let looked = |change| if_defective(noise(false, change), LEARN, &SensorConfig::default()).unwrap().1;
        let rms = looked(frames::<2>).column_rms;
        assert!((rms / (COLUMN / 3f64.sqrt()) - 1.0).abs() < 0.25, "{rms}: even within 10 counts");
        assert_eq!(looked(frames::<0>), Found::default(), "they may be the scene's");
        let left = SensorConfig { column_noise: Some(false), ..SensorConfig::default() };
        let found = if_defective(noise(false, frames::<2>), LEARN, &left).unwrap().1;
        assert_eq!(found, Found::default(), "said to be left");
    }
}
