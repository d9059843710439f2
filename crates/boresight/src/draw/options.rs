//! What is drawn, and how large.

use super::reduced;
use super::tone::legible_scale;
use crate::{Error, ErrorKind, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is drawn, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DrawOptions {
    /// Enlargement of the picture, whole number, 1..=8; 0 chooses one at which numbers can be read.
    pub scale: u32,
    /// Reduction of the picture, whole number, 1..=32: so many pixels across and down become one; 0 chooses one with at most 1280 x 720 pixels.
    pub reduce: u32,
    /// Length of the trails, s of video (longer where frames are farther apart than a third of a second), 0..=3600; 0 draws none.
    pub trail_s: f64,
    /// Whether detections that no track took are marked with a small cross.
    pub detections: bool,
    /// Whether tracks that are not confirmed yet are drawn.
    pub tentative: bool,
    /// Whether the 95 % ellipse of the position is drawn.
    pub ellipses: bool,
    /// Whether boxes are drawn.
    pub boxes: bool,
    /// Whether track numbers are drawn.
    pub labels: bool,
    /// Whether a line with frame, time and number of tracks is drawn at the top.
    pub caption: bool,
}

impl Default for DrawOptions {
    fn default() -> Self {
        Self {
            scale: 0,
            reduce: 1,
            trail_s: 2.0,
            detections: true,
            tentative: false,
            ellipses: true,
            boxes: true,
            labels: true,
            caption: true,
        }
    }
}

impl DrawOptions {
    /// Checks the values.
    /// # Errors
    /// [`ErrorKind::Config`] with the key, its value and what is expected.
    pub fn validate(&self, at: &str) -> Result<()> {
        if self.scale > 8 {
            return Err(Error::new(ErrorKind::Config, "expected a whole number from 0 to 8")
                .at(format!("{at}.scale = {}", self.scale))
                .hint("0 chooses an enlargement at which track numbers can be read"));
        }
        if self.reduce > 32 || (self.reduce > 1 && self.scale > 1) {
            return Err(Error::new(
                ErrorKind::Config,
                "expected a whole number from 0 to 32, and 0 or 1 beside an enlargement",
            )
            .at(format!("{at}.reduce = {}", self.reduce))
            .hint("0 makes pictures of more than 1280 x 720 smaller"));
        }
        if !(0.0..=3600.0).contains(&self.trail_s) {
            return Err(Error::new(ErrorKind::Config, "expected seconds from 0 to 3600")
                .at(format!("{at}.trail-s = {}", self.trail_s))
                .hint("2 shows where a target has come from without hiding the picture"));
        }
        Ok(())
    }

    /// Enlargement and reduction of frames of that size, so that the picture is within `most` (longer side, shorter side).
    pub(super) fn sizes(&self, (width, height): (usize, usize), most: (usize, usize)) -> (usize, usize) {
        let reduce = match self.reduce {
            0 if self.scale < 2 => reduced::for_screen(width, height),
            n => n.max(1) as usize,
        };
        let scale = match self.scale {
            0 if reduce == 1 => legible_scale(width, height),
            n => n.max(1) as usize,
        };
        let fits = |scale: &usize| reduced::to_fit(width * scale, height * scale, most) == 1;
        let scale = (1..=scale).rev().find(fits).unwrap_or(1);
        (scale, reduce.max(reduced::to_fit(width, height, most)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_out_of_range_names_its_key() {
        let err = DrawOptions { trail_s: -1.0, ..DrawOptions::default() }.validate("draw").unwrap_err();
        assert!(err.to_string().starts_with("draw.trail-s = -1: expected seconds"), "{err}");
    }

    #[test]
    fn a_picture_is_legible_and_of_a_size_that_is_asked_for_and_that_the_encoder_takes() {
        const MOST: (usize, usize) = (3840, 2160);
        let of = |scale: u32, reduce: u32, size: (usize, usize)| {
            DrawOptions { scale, reduce, ..DrawOptions::default() }.sizes(size, MOST)
        };
        // Nothing said: small frames are enlarged, large ones reduced where that is wanted.
        assert_eq!([of(0, 0, (320, 256)), of(0, 0, (1920, 1080)), of(0, 1, (1920, 1080))], [(3, 1), (1, 2), (1, 1)]);
        assert_eq!([of(2, 0, (1920, 1080)), of(1, 0, (320, 256)), of(0, 4, (320, 256))], [(2, 1), (1, 1), (1, 4)]);
        // Beyond the encoder: as large as it takes.
        assert_eq!([of(8, 1, (1000, 500)), of(0, 1, (9000, 1)), of(1, 1, (8192, 8192))], [(3, 1), (1, 3), (1, 4)]);
        let err = DrawOptions { scale: 2, reduce: 2, ..DrawOptions::default() }.validate("draw").unwrap_err();
        assert!(err.to_string().starts_with("draw.reduce = 2: expected a whole number"), "{err}");
    }
}
