//! A source whose frames are mended on their way.
//!
//! Where defects are to be found and there are no dark frames, the first [`LEARN`] frames are read ahead and looked at; they are handed out mended as all others.

use super::config::SensorConfig;
use super::correction::{Calibration, Correction};
use super::defects::{Defects, find_defects};
use super::mean_map::MeanMap;
use crate::{Error, ErrorKind, Frame, FrameSource, PixelKind, Result, SourceInfo, Wanted};
use std::collections::VecDeque;

/// Frames in which defects are looked for.
pub(super) const LEARN: usize = 32;

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
            _ if !(config.bad_pixels || config.column_noise) => Defects::default(),
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
        done.extend(
            (config.bad_pixels || correction.n_bad() > 0).then(|| format!("{} bad pixels", correction.n_bad())),
        );
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
