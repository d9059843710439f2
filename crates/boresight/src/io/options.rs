//! How a source of frames is opened: wanted pixels, layout of raw frames, rate, limits.

use super::colours_beside::ColoursBeside;
use crate::{ASSUMED_RATE_HZ, Error, ErrorKind, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which pixels are wanted from a source that could give several kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Colour {
    /// What the file holds: grey stays grey; colour stills give RGB; video gives its luma plane.
    #[default]
    Native,
    /// Grey always: luma of video, BT.601 of RGB.
    Gray,
    /// RGB always, if the file has colour.
    Rgb,
}

/// Pixel type of headerless (raw) frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawType {
    /// 8-bit grey.
    U8,
    /// 16-bit grey, least significant byte first.
    U16Le,
    /// 16-bit grey, most significant byte first.
    U16Be,
    /// 32-bit float grey, least significant byte first.
    F32Le,
    /// 8-bit RGB, interleaved.
    Rgb8,
}

/// Layout of headerless (raw) frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RawFormat {
    /// Width, px, above 0.
    pub width: usize,
    /// Height, px, above 0.
    pub height: usize,
    /// Type of a pixel.
    pub pixel: RawType,
}

/// Tells a source from another thread that nobody wants its frames any more.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Says so, for good.
    pub fn stop(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether it was said.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

impl PartialEq for StopFlag {
    /// Whether both are raised by one call.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// How a source is to be opened.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenOptions {
    /// Which pixels are wanted.
    pub colour: Colour,
    /// Layout of raw frames; needed for raw input only.
    pub raw: Option<RawFormat>,
    /// Rate for sequences without times of their own, frames/s.
    pub rate_hz: f64,
    /// Largest accepted frame, pixels; a header that claims more is refused before memory is taken.
    pub max_pixels: u64,
    /// Of a TIFF's pages every how many-th is a frame, 1 or more; `None`: as ImageJ's or OME's description says, else every one.
    pub page_step: Option<u64>,
    /// Number of the first such page, from 0.
    pub first_page: u64,
    /// Ends a stream that another program reads while it is waited for; other sources never wait for long. `None`: it ends by itself.
    pub stop: Option<StopFlag>,
    /// Some of the first frames in colour beside the grey ones handed out, of a source that reads colour. `None`: none.
    pub colours_beside: Option<ColoursBeside>,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self {
            colour: Colour::Native,
            raw: None,
            rate_hz: ASSUMED_RATE_HZ,
            max_pixels: 1 << 28,
            page_step: None,
            first_page: 0,
            stop: None,
            colours_beside: None,
        }
    }
}

impl OpenOptions {
    /// Checks the rate and the limits.
    /// # Errors
    /// [`ErrorKind::Config`] for a rate that is not positive, raw frames of no size, or a limit of no pixels.
    pub fn validate(&self) -> Result<()> {
        if !(self.rate_hz.is_finite() && self.rate_hz > 0.0) {
            return Err(Error::new(ErrorKind::Config, "expected a positive number of frames/s")
                .at(format!("rate-hz = {}", self.rate_hz)));
        }
        crate::time::check_rate(self.rate_hz).map_err(|e| e.at(format!("rate-hz = {}", self.rate_hz)))?;
        if self.max_pixels == 0 {
            return Err(Error::new(ErrorKind::Config, "expected at least 1 pixel").at("max-pixels = 0"));
        }
        if self.page_step == Some(0) {
            return Err(Error::new(ErrorKind::Config, "expected a whole number of at least 1").at("page-step = 0"));
        }
        if let Some(raw) = self.raw {
            super::pixels::check_size(raw.width as u64, raw.height as u64, self.max_pixels)
                .map_err(|_| Error::new(ErrorKind::Config, "expected a size of at least 1 x 1 and at most max-pixels"))
                .map_err(|e| e.at(format!("raw frames of {} x {} pixels", raw.width, raw.height)))?;
        }
        Ok(())
    }
}
