//! A frame made small for the search: mean over square blocks.

use crate::{Image, Pixels};

/// Wider frames are reduced to at most this width, px.
const REDUCED_PX: usize = 320;

/// Side of a block for frames of this width, px.
pub(super) fn factor(width: usize) -> usize {
    width.div_ceil(REDUCED_PX).max(1)
}

/// Reduces a frame of any pixel type by [`factor`]; `sums` is scratch memory.
pub(super) fn reduce(pixels: &Pixels, out: &mut Image<f32>, sums: &mut Vec<f32>) {
    let factor = factor(pixels.width());
    match pixels {
        Pixels::Gray8(i) => blocks(i, factor, out, sums, f32::from),
        Pixels::Gray16(i) => blocks(i, factor, out, sums, f32::from),
        Pixels::GrayF32(i) => blocks(i, factor, out, sums, |p| p),
        // The green channel stands for the light.
        Pixels::Rgb8(i) => blocks(i, factor, out, sums, |p| f32::from(p[1])),
    }
}

/// Means over blocks of `factor` x `factor` pixels along a row of them, from that block on.
pub(super) fn blocks_of<T: Copy>(
    image: &Image<T>,
    factor: usize,
    (x, y): (usize, usize),
    value: impl Fn(T) -> f32,
    out: &mut [f32],
) {
    out.fill(0.0);
    for r in y * factor..(y + 1) * factor {
        let row = &image.row(r)[x * factor..(x + out.len()) * factor];
        if factor == 1 {
            out.iter_mut().zip(row).for_each(|(o, p)| *o = value(*p));
            return;
        }
        match factor {
            2 => add_pairs(row, out, &value),
            4 => add_fours(row, out, &value),
            _ => {
                for (o, block) in out.iter_mut().zip(row.chunks_exact(factor)) {
                    *o += block.iter().map(|p| value(*p)).sum::<f32>();
                }
            }
        }
    }
    let scale = 1.0 / (factor * factor) as f32;
    out.iter_mut().for_each(|o| *o *= scale);
}

/// Mean over blocks of `factor` x `factor` pixels; `sums` is scratch memory.
pub(super) fn blocks<T: Copy>(
    image: &Image<T>,
    factor: usize,
    out: &mut Image<f32>,
    sums: &mut Vec<f32>,
    value: impl Fn(T) -> f32 + Copy,
) {
    let (w, h) = (image.width() / factor, image.height() / factor);
    out.reset(w, h, 0.0);
    if factor == 1 {
        out.as_mut_slice().iter_mut().zip(image.as_slice()).for_each(|(o, &p)| *o = value(p));
        return;
    }
    let scale = 1.0 / (factor * factor) as f32;
    for y in 0..h {
        sums.clear();
        sums.resize(w * factor, 0.0);
        for row in (y * factor..(y + 1) * factor).map(|y| image.row(y)) {
            add_row(row, sums, &value);
        }
        let row = out.row_mut(y);
        // Frames of up to 640, 960, 1280, 1920 and 3840 px.
        match factor {
            2 => across::<2>(sums, scale, row),
            3 => across::<3>(sums, scale, row),
            4 => across::<4>(sums, scale, row),
            6 => across::<6>(sums, scale, row),
            12 => across::<12>(sums, scale, row),
            _ => {
                for (o, block) in row.iter_mut().zip(sums.chunks_exact(factor)) {
                    *o = scale * block.iter().sum::<f32>();
                }
            }
        }
    }
}

/// Means of so many sums each: without a loop within the block.
fn across<const N: usize>(sums: &[f32], scale: f32, out: &mut [f32]) {
    for (o, block) in out.iter_mut().zip(sums.as_chunks::<N>().0) {
        *o = scale * block.iter().sum::<f32>();
    }
}

widest! {
    fn add_row<T: Copy>(row: &[T], sums: &mut [f32], value: &impl Fn(T) -> f32) {
        sums.iter_mut().zip(row).for_each(|(s, &p)| *s += value(p));
    }
}

widest! {
    fn add_pairs<T: Copy>(row: &[T], sums: &mut [f32], value: &impl Fn(T) -> f32) {
        add_small::<2, T>(row, sums, value);
    }
}

widest! {
    fn add_fours<T: Copy>(row: &[T], sums: &mut [f32], value: &impl Fn(T) -> f32) {
        add_small::<4, T>(row, sums, value);
    }
}

/// Adds the sums of so many pixels each; the usual sizes of the blocks, with loops that the compiler turns into vectors.
#[inline(always)]
fn add_small<const N: usize, T: Copy>(row: &[T], sums: &mut [f32], value: &impl Fn(T) -> f32) {
    for (s, block) in sums.iter_mut().zip(row.as_chunks::<N>().0) {
        *s += block.iter().map(|p| value(*p)).sum::<f32>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_frame_becomes_the_means_of_its_blocks() {
        let mut wide = Image::filled(640, 4, 0u8);
        for y in 0..4 {
            wide.row_mut(y).iter_mut().enumerate().for_each(|(x, p)| *p = (x % 2 * 4) as u8 + y as u8);
        }
        let mut small = Image::default();
        reduce(&Pixels::Gray8(wide), &mut small, &mut Vec::new());
        assert_eq!((small.width(), small.height(), small.row(0)[7], small.row(1)[319]), (320, 2, 2.5, 4.5));
    }
}
