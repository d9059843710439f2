//! Grey of RGB, and the limit on what a header may claim.
//!
//! Grey of RGB is BT.601 in integers, `(9798 R + 19235 G + 3735 B + 16384) >> 15` (bit for bit what OpenCV gives for 8 bits); the
//! same weights serve 16 bits (`samples`).

use crate::{Error, ErrorKind, Result};

/// Grey of an 8-bit RGB pixel, BT.601 in integers.
#[inline]
pub fn gray_of_rgb8(rgb: [u8; 3]) -> u8 {
    ((9798 * u32::from(rgb[0]) + 19235 * u32::from(rgb[1]) + 3735 * u32::from(rgb[2]) + 16384) >> 15) as u8
}

/// Refuses an image that claims more pixels than allowed, or none, before memory is taken for it.
pub(crate) fn check_size(width: u64, height: u64, max_pixels: u64) -> Result<(usize, usize)> {
    if width == 0 || height == 0 {
        return Err(Error::new(ErrorKind::Damaged, format!("the header claims {width} x {height} pixels")));
    }
    match (width.checked_mul(height), usize::try_from(width), usize::try_from(height)) {
        (Some(n), Ok(w), Ok(h)) if n <= max_pixels => Ok((w, h)),
        _ => Err(Error::new(
            ErrorKind::Damaged,
            format!("the header claims {width} x {height} pixels, more than the {max_pixels} allowed"),
        )
        .hint("if the file is sound, raise the limit: --set input.max-pixels=NUMBER")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_weights_are_those_of_spec_i1() {
        assert_eq!(gray_of_rgb8([255, 255, 255]), 255);
        assert_eq!(gray_of_rgb8([255, 0, 0]), 76); // 76.245, OpenCV cvtColor gives 76
        assert_eq!(gray_of_rgb8([0, 255, 0]), 150); // 149.685
        assert_eq!(gray_of_rgb8([0, 0, 255]), 29); // 29.07
    }

    #[test]
    fn a_billion_pixels_are_refused() {
        assert!(check_size(1 << 20, 1 << 20, 1 << 28).is_err());
        assert!(check_size(u64::MAX, u64::MAX, u64::MAX).is_err());
        assert!(check_size(0, 5, 10).is_err());
        assert_eq!(check_size(4, 5, 20).unwrap(), (4, 5));
    }
}
