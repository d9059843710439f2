//! The pixels of a frame that have the target's colour, cleaned, 64 a word: what the detector joins to clusters.

use super::{ColourMatch, ColourMatchConfig};
use crate::vision::background::{BitImage, morphology};
use crate::{Image, Result};

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
    pub(crate) fn update(&mut self, image: &Image<[u8; 3]>) {
        self.bits.reset(image.width(), image.height());
        for y in 0..image.height() {
            self.matcher.row(image.row(y), self.bits.row_mut(y));
        }
        morphology::clean(&mut self.bits, self.matcher.config().clean_up, &mut self.work);
    }

    /// The matching pixels of the last frame.
    pub(crate) fn bits(&self) -> &BitImage {
        &self.bits
    }
}
