//! A decoded picture, why a sample gave none, and the fence around third-party decoders: what every decoder shares.

use crate::{Error, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a sample gave no picture.
#[derive(Debug)]
pub(super) enum Refusal {
    /// A kind of H.264 that is not decoded here.
    Unsupported(String),
    /// Broken data.
    Damaged(String),
}

/// A decoded picture and the step it belongs to.
#[derive(Debug)]
pub(super) struct Picture {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Luma, two bytes a sample above 8 bits.
    pub y: Vec<u8>,
    /// Chroma, as luma.
    pub u: Vec<u8>,
    pub v: Vec<u8>,
    /// Rows of luma to one of chroma, as a shift; columns are always halved.
    pub chroma_row_shift: u32,
    /// Bits of a sample.
    pub bits: u32,
    /// Picture order count.
    pub order_count: i32,
    /// Number of the step (in decoding order) it was decoded from.
    pub step: usize,
    /// Counts the instantaneous refreshes; picture order counts compare within one period only.
    pub period: u32,
}

/// Makes pictures of the samples of one track, in decoding order.
pub(super) trait PictureDecoder {
    /// Decodes one sample of a step and a period; gives the pictures that are whole now (none or one, more never for sound data).
    fn decode(
        &mut self,
        data: &[u8],
        description: u16,
        at: (usize, u32),
        out: &mut Vec<Picture>,
    ) -> std::result::Result<(), Refusal>;
    /// Ends the stream: gives the picture still held.
    fn finish(&mut self, out: &mut Vec<Picture>);
    /// Forgets all pictures after damage; the next sync sample starts anew.
    fn reset(&mut self);
}

/// Runs third-party code; a panic in it is damage of the data at hand.
pub(super) fn guarded<T>(f: impl FnOnce() -> std::result::Result<T, Refusal>) -> std::result::Result<T, Refusal> {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|_| Err(Refusal::Damaged("the decoder gave up on it".into())))
}

/// The parts of a sample without their lengths; `None` if the lengths do not fill it (a few bytes of padding are forgiven).
pub(super) fn parts(data: &[u8], length_size: usize) -> Option<Vec<&[u8]>> {
    let (mut rest, mut parts) = (data, Vec::new());
    while let Some((head, tail)) = rest.split_at_checked(length_size).filter(|(h, _)| !h.is_empty()) {
        let len = head.iter().fold(0usize, |len, b| len << 8 | usize::from(*b));
        let (part, next) = tail.split_at_checked(len)?;
        parts.push(part);
        rest = next;
    }
    rest.iter().all(|b| *b == 0).then_some(parts)
}

/// Turns a refusal of the stream's very start into an error.
pub(super) fn start_error(refusal: Refusal) -> Error {
    match refusal {
        Refusal::Unsupported(what) => {
            Error::new(ErrorKind::Unsupported, format!("this kind of H.264 is not decoded in process ({what})"))
        }
        Refusal::Damaged(what) => Error::new(ErrorKind::Damaged, format!("its first picture is damaged: {what}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_run_over_the_end_are_found() {
        assert_eq!(parts(&[0, 0, 0, 2, 9, 9, 0, 0, 0, 1, 7], 4).unwrap(), [&[9u8, 9][..], &[7]]);
        assert!(parts(&[0, 0, 0, 3, 9, 9], 4).is_none());
        assert!(parts(&[255, 255, 255, 255, 1], 4).is_none());
        assert_eq!(parts(&[0, 0, 0, 1, 7, 0, 0], 4).unwrap(), [[7u8]]);
    }

    #[test]
    fn a_panic_becomes_damage() {
        let r: std::result::Result<(), Refusal> = guarded(|| std::panic::resume_unwind(Box::new("x")));
        assert!(matches!(r, Err(Refusal::Damaged(_))));
    }
}
