//! The frame behind the trajectories: grey, stretched between its 0.5 % and 99.5 % levels, at most 1024 px wide, as PNG.

use super::text::base64;
use crate::{Frame, Image, Pixels};

/// Wider frames are averaged down.
const MAX_WIDTH: usize = 1024;

/// A small grey picture of a frame.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// The frame's number.
    pub frame: u64,
    /// The frame's own size, px.
    pub width: usize,
    pub height: usize,
    small_width: usize,
    small_height: usize,
    gray: Vec<u8>,
}

impl Picture {
    pub fn of_frame(frame: &Frame) -> Self {
        Self::of_frame_within(frame, MAX_WIDTH)
    }

    /// With no side longer than `most` px.
    pub fn of_frame_within(frame: &Frame, most: usize) -> Self {
        let (width, height) = (frame.pixels.width(), frame.pixels.height());
        // At least as coarse as needed for the height too, so that no picture grows without bound.
        let block = block(width, height, most);
        let (small_width, small_height) = (width.div_ceil(block), height.div_ceil(block));
        let means = match &frame.pixels {
            Pixels::Gray8(i) => means(i, block, |v| f32::from(*v)),
            Pixels::Gray16(i) => means(i, block, |v| f32::from(*v)),
            Pixels::GrayF32(i) => means(i, block, |v| *v),
            Pixels::Rgb8(i) => means(i, block, |p| {
                let [r, g, b] = p.map(f32::from);
                0.299 * r + 0.587 * g + 0.114 * b // BT.601
            }),
        };
        let mut finite: Vec<f32> = means.iter().copied().filter(|v| v.is_finite()).collect();
        let mut level = |share: f64| {
            let at = ((finite.len() as f64 - 1.0) * share).round() as usize;
            if finite.is_empty() { 0.0 } else { *finite.select_nth_unstable_by(at, f32::total_cmp).1 }
        };
        let (low, high) = (level(0.005), level(0.995));
        let scale = if high > low { 255.0 / (high - low) } else { 0.0 };
        // A flat picture is drawn in mid grey; `as` saturates and turns NaN into 0.
        let gray = means.iter().map(|v| if scale > 0.0 { ((v - low) * scale).round() as u8 } else { 128 }).collect();
        Self { frame: frame.index.0, width, height, small_width, small_height, gray }
    }

    /// The picture as a `data:` address; `None` if it cannot be coded (it has no pixels).
    pub fn data_url(&self) -> Option<String> {
        png_url(self.small_width, self.small_height, png::ColorType::Grayscale, &self.gray)
    }
}

/// Samples of 8 bits as the `data:` address of a PNG; `None` if they make no picture.
pub(super) fn png_url(width: usize, height: usize, colour: png::ColorType, samples: &[u8]) -> Option<String> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, u32::try_from(width).ok()?, u32::try_from(height).ok()?);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(samples).ok()?;
    writer.finish().ok()?;
    Some(format!("data:image/png;base64,{}", base64(&bytes)))
}

/// Side of the blocks that make one pixel of a picture of which no side is longer than `most`, px.
pub(super) fn block(width: usize, height: usize, most: usize) -> usize {
    width.div_ceil(most).max(height.div_ceil(most)).max(1)
}

/// Means of blocks of `block` x `block` pixels, without those that are not finite; NaN where none is.
pub(super) fn means<T: Copy>(image: &Image<T>, block: usize, value: impl Fn(&T) -> f32) -> Vec<f32> {
    let (width, height) = (image.width(), image.height());
    let mut means = Vec::with_capacity(width.div_ceil(block) * height.div_ceil(block));
    let mut columns = vec![0.0f32; width];
    for top in (0..height).step_by(block) {
        let rows = top..(top + block).min(height);
        columns.fill(0.0);
        for y in rows.clone() {
            columns.iter_mut().zip(image.row(y)).for_each(|(sum, p)| *sum += value(p));
        }
        for (left, part) in (0..width).step_by(block).zip(columns.chunks(block)) {
            let sum: f32 = part.iter().sum();
            let n = (part.len() * rows.len()) as f32;
            means.push(if sum.is_finite() { sum / n } else { finite_mean(image, left, rows.clone(), block, &value) });
        }
    }
    means
}

/// Mean of those pixels of a block that are finite.
#[cold]
fn finite_mean<T: Copy>(
    image: &Image<T>,
    left: usize,
    rows: std::ops::Range<usize>,
    block: usize,
    value: impl Fn(&T) -> f32,
) -> f32 {
    let right = (left + block).min(image.width());
    let pixels = rows.flat_map(|y| image.row(y)[left..right].iter().map(&value).filter(|v| v.is_finite()));
    let (sum, n) = pixels.fold((0.0f64, 0u32), |(sum, n), v| (sum + f64::from(v), n + 1));
    if n > 0 { (sum / f64::from(n)) as f32 } else { f32::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Timestamp};

    #[test]
    fn wide_frames_are_averaged_and_stretched() {
        let mut image = Image::filled(2048, 2, 1000u16);
        image.row_mut(0)[..1024].fill(3000);
        image.row_mut(1)[..1024].fill(3000);
        let frame = Frame { index: FrameIndex(7), time: Timestamp::default(), pixels: Pixels::Gray16(image) };
        let picture = Picture::of_frame(&frame);
        assert_eq!((picture.small_width, picture.small_height, picture.width), (1024, 1, 2048));
        assert_eq!((picture.gray[0], picture.gray[1023]), (255, 0));
        assert!(picture.data_url().unwrap().starts_with("data:image/png;base64,iVBORw0KGgo"));
    }

    #[test]
    fn pixels_that_are_not_finite_count_for_nothing_and_the_last_blocks_are_smaller() {
        let mut image = Image::filled(5, 3, 2.0f32);
        image.row_mut(0)[0] = f32::NAN;
        image.row_mut(1)[1] = 8.0;
        image.row_mut(2)[4] = f32::INFINITY;
        image.row_mut(2)[2] = f32::MAX;
        image.row_mut(2)[3] = f32::MAX;
        let means = means(&image, 2, |v| *v);
        assert_eq!(&means[..5], &[4.0, 2.0, 2.0, 2.0, f32::MAX]);
        assert!(means[5].is_nan() && means.len() == 6);
    }
}
