//! A frame made smaller for drawing: the mean over square blocks of whole pixels.
//!
//! A side shorter than a block makes one shorter block; what is left over at the right and below is not drawn.

use crate::{Image, Pixels};

/// Most pixels of a picture that is made smaller because nothing is said of its size: 1280 x 720, what most screens show at once: of
/// 1080p in noise coding takes five times what decoding does (docs/speed.md).
const MOST_PX: usize = 1280 * 720;

/// Side of the blocks, px, with which a frame of that size has at most [`MOST_PX`].
pub(super) fn for_screen(width: usize, height: usize) -> usize {
    (1..).find(|n| (width / n).max(1) * (height / n).max(1) <= MOST_PX).unwrap_or(1)
}

/// Side of the blocks, px, with which a frame of that size is within `long` and `short` sides.
pub(super) fn to_fit(width: usize, height: usize, (long, short): (usize, usize)) -> usize {
    let (a, b) = (width.max(height), width.min(height));
    a.div_ceil(long.max(1)).max(b.div_ceil(short.max(1))).max(1)
}

/// A kind of pixel whose mean can be taken.
trait Mean: Copy + Default {
    /// What pixels are added up in.
    type Sum: Copy + Default;
    fn add(sum: &mut Self::Sum, value: Self);
    fn of(sum: Self::Sum, n: u32) -> Self;
}

macro_rules! mean_of_whole {
    ($($kind:ty),*) => {$(
        impl Mean for $kind {
            type Sum = u32;
            fn add(sum: &mut u32, value: Self) {
                *sum += u32::from(value);
            }
            fn of(sum: u32, n: u32) -> Self {
                ((sum + n / 2) / n) as Self
            }
        }
    )*};
}
mean_of_whole!(u8, u16);

impl Mean for f32 {
    type Sum = f32;
    fn add(sum: &mut f32, value: Self) {
        *sum += value;
    }
    fn of(sum: f32, n: u32) -> Self {
        sum / n as f32
    }
}

impl Mean for [u8; 3] {
    type Sum = [u32; 3];
    fn add(sum: &mut [u32; 3], value: Self) {
        sum.iter_mut().zip(value).for_each(|(s, v)| *s += u32::from(v));
    }
    fn of(sum: [u32; 3], n: u32) -> Self {
        sum.map(|s| u8::of(s, n))
    }
}

/// A frame made smaller; keeps its memory.
#[derive(Debug)]
pub(super) struct Reduced(Pixels);

impl Default for Reduced {
    fn default() -> Self {
        Self(Pixels::Gray8(Image::default()))
    }
}

impl Reduced {
    /// The means of blocks of `n` x `n` pixels.
    pub fn of(&mut self, pixels: &Pixels, n: usize) -> &Pixels {
        macro_rules! blocks {
            ($image:expr, $kind:ident) => {{
                let old = std::mem::replace(&mut self.0, Pixels::Gray8(Image::default()));
                let mut out = if let Pixels::$kind(old) = old { old } else { Image::default() };
                blocks($image, n, &mut out);
                Pixels::$kind(out)
            }};
        }
        self.0 = match pixels {
            Pixels::Gray8(i) => blocks!(i, Gray8),
            Pixels::Gray16(i) => blocks!(i, Gray16),
            Pixels::GrayF32(i) => blocks!(i, GrayF32),
            Pixels::Rgb8(i) => blocks!(i, Rgb8),
        };
        &self.0
    }
}

fn blocks<T: Mean>(image: &Image<T>, n: usize, out: &mut Image<T>) {
    let (across, down) = (n.min(image.width()), n.min(image.height()));
    let (w, h) = ((image.width() / n.max(1)).max(1), (image.height() / n.max(1)).max(1));
    if (out.width(), out.height()) != (w, h) {
        out.reset(w, h, T::default());
    }
    if across == 0 || down == 0 {
        return;
    }
    for y in 0..out.height() {
        match (across, down) {
            (2, 2) => blocks_of_two(image, 2 * y, out.row_mut(y)),
            (3, 3) => blocks_of_three(image, 3 * y, out.row_mut(y)),
            _ => {
                for (x, o) in out.row_mut(y).iter_mut().enumerate() {
                    let mut sum = T::Sum::default();
                    for row in (y * down..(y + 1) * down).map(|r| &image.row(r)[x * across..(x + 1) * across]) {
                        row.iter().for_each(|v| T::add(&mut sum, *v));
                    }
                    *o = T::of(sum, (across * down) as u32);
                }
            }
        }
    }
}

/// Blocks that are added up side by side.
const SIDE_BY_SIDE: usize = 64;

widest! {
    fn blocks_of_two<T: Mean>(image: &Image<T>, first_row: usize, out: &mut [T]) {
        small_blocks::<2, T>(image, first_row, out);
    }
}

widest! {
    fn blocks_of_three<T: Mean>(image: &Image<T>, first_row: usize, out: &mut [T]) {
        small_blocks::<3, T>(image, first_row, out);
    }
}

/// The usual sizes, with loops that the compiler turns into vectors.
#[inline(always)]
fn small_blocks<const N: usize, T: Mean>(image: &Image<T>, first_row: usize, out: &mut [T]) {
    for (k, out) in out.chunks_mut(SIDE_BY_SIDE).enumerate() {
        let mut sums = [T::Sum::default(); SIDE_BY_SIDE];
        for y in first_row..first_row + N {
            let blocks = &image.row(y).as_chunks::<N>().0[k * SIDE_BY_SIDE..][..out.len()];
            for (sum, block) in sums.iter_mut().zip(blocks) {
                block.iter().for_each(|v| T::add(sum, *v));
            }
        }
        out.iter_mut().zip(sums).for_each(|(o, sum)| *o = T::of(sum, (N * N) as u32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pictures_are_made_as_small_as_a_screen_and_an_encoder_want() {
        assert_eq!([(640, 512), (1280, 720), (1920, 1080), (3840, 2160)].map(|(w, h)| for_screen(w, h)), [1, 1, 2, 3]);
        let most = (3840, 2160);
        assert_eq!([(3840, 2160), (8192, 8192), (100, 4000)].map(|(w, h)| to_fit(w, h, most)), [1, 4, 2]);
        // Cameras of one line, and a size that no picture has.
        assert_eq!((for_screen(9000, 1), for_screen(1_000_000, 1), for_screen(0, 0)), (1, 2, 1));
    }

    #[test]
    fn a_block_becomes_its_mean_whatever_its_pixels_are() {
        let ramp = |w: usize, h: usize| (0..w * h).map(|i| i as u8).collect::<Vec<_>>();
        let mut reduced = Reduced::default();
        for n in 1..=5 {
            let (w, h) = (7, 11);
            let bytes = Image::from_vec(w, h, ramp(w, h)).unwrap();
            let want: Vec<f32> = (0..(h / n) * (w / n))
                .map(|k| {
                    let (x, y) = (k % (w / n) * n, k / (w / n) * n);
                    let sum: f32 = (0..n * n).map(|i| f32::from(bytes.row(y + i / n)[x + i % n])).sum();
                    sum / (n * n) as f32
                })
                .collect();
            let all = ramp(w, h);
            let wide = |f: fn(u8) -> u16| Image::from_vec(w, h, all.iter().map(|v| f(*v)).collect()).unwrap();
            let real = Image::from_vec(w, h, all.iter().map(|v| f32::from(*v)).collect()).unwrap();
            let rgb = Image::from_vec(w, h, all.iter().map(|v| [*v, 0, *v]).collect()).unwrap();
            let near = |got: Vec<f32>, most: f32| {
                assert!(got.len() == want.len() && got.iter().zip(&want).all(|(g, w)| (g - w).abs() <= most), "{n}");
            };
            match reduced.of(&Pixels::Gray8(bytes), n) {
                Pixels::Gray8(i) => near(i.as_slice().iter().map(|v| f32::from(*v)).collect(), 0.5),
                other => panic!("{other:?}"),
            }
            match reduced.of(&Pixels::Gray16(wide(|v| u16::from(v) * 100)), n) {
                Pixels::Gray16(i) => near(i.as_slice().iter().map(|v| f32::from(*v) / 100.0).collect(), 0.006),
                other => panic!("{other:?}"),
            }
            match reduced.of(&Pixels::GrayF32(real), n) {
                Pixels::GrayF32(i) => near(i.as_slice().to_vec(), 1e-4),
                other => panic!("{other:?}"),
            }
            match reduced.of(&Pixels::Rgb8(rgb), n) {
                Pixels::Rgb8(i) => near(i.as_slice().iter().map(|p| f32::from(p[2])).collect(), 0.5),
                other => panic!("{other:?}"),
            }
        }
        let line = Image::from_vec(1, 2, vec![4u8, 8]).unwrap();
        assert!(matches!(reduced.of(&Pixels::Gray8(line), 2), Pixels::Gray8(i) if i.as_slice() == [6]));
    }
}
