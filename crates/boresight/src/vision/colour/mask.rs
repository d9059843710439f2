//! The pixels of a frame that have the target's colour, cleaned, 64 a word: what the detector joins to clusters.

use super::{ColourMatch, ColourMatchConfig};
use crate::vision::background::{BitImage, mask_rows, morphology};
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;
use crate::vision::threshold::BackgroundGrid;
use crate::{Error, ErrorKind, Image, Result};

/// Frames without colour were given, `found` in words.
pub(crate) fn needs_colour(found: &str) -> Error {
    Error::new(ErrorKind::Config, format!("expected colour frames, found {found}"))
        .at("detector.threshold.colour")
        .hint("--set input.colour=rgb reads a video in colour; grey pictures have none")
}

/// Finds the pixels of a colour in whole frames; keeps its memory.
#[derive(Clone, Debug)]
pub(crate) struct ColourMask {
    matcher: ColourMatch,
    bits: BitImage,
    work: BitImage,
}

impl ColourMask {
    /// Builds it.
    /// # Errors
    /// As [`ColourMatchConfig::validate`].
    pub(crate) fn new(config: ColourMatchConfig) -> Result<Self> {
        Ok(Self { matcher: ColourMatch::new(config)?, bits: BitImage::default(), work: BitImage::default() })
    }

    /// Takes the next frame.
    fn update(&mut self, image: &Image<[u8; 3]>) {
        self.bits.reset(image.width(), image.height());
        for y in 0..image.height() {
            self.matcher.row(image.row(y), self.bits.row_mut(y));
        }
        morphology::clean(&mut self.bits, self.matcher.config().clean_up, &mut self.work);
    }
}

impl<T: Pixel> Segmenter<T> for ColourMask {
    fn weight(&self) -> PixelWeight {
        PixelWeight::Alike
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        let Some(colours) = frame.colours else {
            return Err(needs_colour("grey ones"));
        };
        self.update(colours);
        mask_rows(&self.bits, frame.image, &mut regions.bright);
        Ok(None)
    }
}
