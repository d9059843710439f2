//! Grey frames as plain numbers, whatever their type.

use crate::Pixels;

/// Writes a frame's values (counts) into `out`; whether it has any: a colour frame has none.
pub(super) fn values(pixels: &Pixels, out: &mut Vec<f32>) -> bool {
    out.clear();
    match pixels {
        Pixels::Gray8(image) => out.extend(image.as_slice().iter().map(|v| f32::from(*v))),
        Pixels::Gray16(image) => out.extend(image.as_slice().iter().map(|v| f32::from(*v))),
        Pixels::GrayF32(image) => out.extend_from_slice(image.as_slice()),
        Pixels::Rgb8(_) => return false,
    }
    !out.is_empty()
}

/// The largest value of a frame's type, counts, and the distance of its values.
pub(super) fn range(pixels: &Pixels) -> (f32, f32) {
    match pixels {
        Pixels::Gray8(_) | Pixels::Rgb8(_) => (255.0, 1.0),
        Pixels::Gray16(_) => (65535.0, 1.0),
        Pixels::GrayF32(_) => (f32::INFINITY, 0.0),
    }
}
