//! Frames as H.264 to look at, coded once for all viewers: a key each second, and when a viewer joins or has fallen behind.

use super::hub::{Coded, coded_message};
use super::picture::LARGEST;
use crate::eight_bits::EightBits;
use boresight::Pixels;
use boresight::io::video::{H264Coder, Mp4Options};
use std::time::{Duration, Instant};

/// Longest time between two keys.
const KEY_EVERY: Duration = Duration::from_secs(1);
/// Least time between two keys, however many viewers ask.
const KEY_AT_MOST: Duration = Duration::from_millis(250);

/// Codes one frame after another.
pub struct CodedPictures {
    eight: EightBits,
    coder: H264Coder,
    last_key: Option<Instant>,
}

impl Default for CodedPictures {
    fn default() -> Self {
        Self { eight: EightBits::at_most(LARGEST, LARGEST), coder: coder(), last_key: None }
    }
}

fn coder() -> H264Coder {
    H264Coder::new(Mp4Options { key_every: u32::MAX >> 1, ..Mp4Options::default() })
}

impl CodedPictures {
    /// The frame with its text; `None` if such frames cannot be coded.
    pub fn encode(&mut self, pixels: Option<&Pixels>, json: &str, wants_key: bool) -> Option<Coded> {
        let Some(pixels) = pixels.and_then(|p| self.eight.of(p)) else {
            return Some(Coded { bytes: coded_message(json, "", &[]), key: None });
        };
        let since = self.last_key.map(|at| at.elapsed());
        let is_due = since.is_none_or(|s| s >= KEY_EVERY || (wants_key && s >= KEY_AT_MOST));
        let mut outcome = self.coder.code(pixels, is_due);
        if outcome.is_err() {
            // Frames of another size or kind begin anew.
            self.coder = coder();
            outcome = self.coder.code(pixels, true);
        }
        let coded = outcome.ok()?;
        if coded.is_key {
            self.last_key = Some(Instant::now());
        }
        let mut stream = Vec::with_capacity(coded.data.len() + 64);
        coded.append_byte_stream(&mut stream);
        let codec = coded.codec().unwrap_or_default();
        Some(Coded { bytes: coded_message(json, &codec, &stream), key: Some(coded.is_key) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use boresight::Image;

    #[test]
    fn the_first_picture_is_a_key_another_size_begins_anew_and_what_cannot_be_coded_is_none() {
        let mut pictures = CodedPictures::default();
        let gray = |side: usize| Pixels::Gray8(Image::filled(side, side, 9));
        let mut key = |side: usize| pictures.encode(Some(&gray(side)), "{}", false).map(|coded| coded.key);
        assert_eq!((key(32), key(32)), (Some(Some(true)), Some(Some(false))));
        assert_eq!((key(48), key(48)), (Some(Some(true)), Some(Some(false))));
        assert_eq!(key(4), None);
        let text = pictures.encode(None, "{}", false).unwrap();
        assert_eq!((text.key, &text.bytes[..]), (None, &[0, 0, 0, 2, b'{', b'}', 0][..]));
    }
}
