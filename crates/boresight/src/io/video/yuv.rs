//! Planar luma and chroma to the pixels that are handed out: the luma plane untouched, or RGB.
//!
//! Source: ITU-R BT.601-7, BT.709-6, BT.2020-2 (weights), ITU-T H.264 E.2.1 (code points, video range).
//! A file that does not say its weights: BT.709 from 720 rows up, BT.601 below, as players take it.
//! Limits: chroma is repeated, not interpolated; 10 bits become 8 by rounding in RGB.

/// Weights and range of a video's colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Matrix {
    y_scale: i32,
    y_offset: i32,
    r_v: i32,
    g_u: i32,
    g_v: i32,
    b_u: i32,
}

/// Fraction bits of the weights.
const BITS: u32 = 16;

impl Matrix {
    /// From H.264's `matrix_coefficients`, range flag and picture height.
    pub fn new(code: u8, full_range: bool, height: usize) -> Self {
        let (kr, kb) = match code {
            1 => (0.2126, 0.0722),
            4..=7 => (0.299, 0.114), // 240M (7) is close to it and not seen in practice
            9 | 10 => (0.2627, 0.0593),
            _ if height >= 720 => (0.2126, 0.0722),
            _ => (0.299, 0.114),
        };
        let kg = 1.0 - kr - kb;
        let (y_range, c_range, y_offset) = if full_range { (255.0, 255.0, 0) } else { (219.0, 224.0, 16) };
        let fix = |v: f64| (v * f64::from(1u32 << BITS)).round() as i32;
        let (y, c) = (255.0 / y_range, 2.0 * 255.0 / c_range);
        Self {
            y_scale: fix(y),
            y_offset,
            r_v: fix(c * (1.0 - kr)),
            g_u: fix(-c * kb * (1.0 - kb) / kg),
            g_v: fix(-c * kr * (1.0 - kr) / kg),
            b_u: fix(c * (1.0 - kb)),
        }
    }

    #[inline]
    fn pixel(&self, y: i32, u: i32, v: i32) -> [u8; 3] {
        let y = (y - self.y_offset) * self.y_scale + (1 << (BITS - 1));
        let (u, v) = (u - 128, v - 128);
        let clip = |x: i32| (x >> BITS).clamp(0, 255) as u8;
        [clip(y + self.r_v * v), clip(y + self.g_u * u + self.g_v * v), clip(y + self.b_u * u)]
    }
}

/// One picture's planes without padding; 2 bytes a sample, least significant first, above 8 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planes<'a> {
    pub width: usize,
    pub height: usize,
    pub y: &'a [u8],
    pub u: &'a [u8],
    pub v: &'a [u8],
    /// Columns and rows of luma to one of chroma, as shifts.
    pub shift: (u32, u32),
    pub bits: u32,
}

/// Pixels of a row that are turned side by side.
const BLOCK: usize = 64;

/// A block of a row, chroma repeated for each pixel.
struct Wide {
    y: [u8; BLOCK],
    u: [u8; BLOCK],
    v: [u8; BLOCK],
}

widest! {
    /// Converts a block of a row.
    fn block_to_rgb(matrix: &Matrix, block: &Wide, out: &mut [[u8; 3]; BLOCK]) {
        let [mut r, mut g, mut b] = [[0u8; BLOCK]; 3];
        for i in 0..BLOCK {
            [r[i], g[i], b[i]] = matrix.pixel(i32::from(block.y[i]), i32::from(block.u[i]), i32::from(block.v[i]));
        }
        for (i, p) in out.iter_mut().enumerate() {
            *p = [r[i], g[i], b[i]];
        }
    }
}

/// Converts a picture to RGB; `false` if the planes are too short for its size.
pub(super) fn to_rgb(planes: &Planes<'_>, matrix: &Matrix, out: &mut Vec<[u8; 3]>) -> bool {
    let Planes { width, height, y, u, v, shift, bits } = *planes;
    out.clear();
    if width == 0 || height == 0 {
        return false;
    }
    let bytes = if bits > 8 { 2 } else { 1 };
    // Decoders round the size of chroma up or down for odd pictures: its own size says which.
    let c_rows = (height + (1 << shift.1) - 1) >> shift.1;
    let c_width_up = (width + (1 << shift.0) - 1) >> shift.0;
    let c_width = if u.len() >= c_width_up * c_rows * bytes { c_width_up } else { width >> shift.0 };
    let c_rows = if c_width == 0 { 0 } else { (u.len() / (c_width * bytes)).min(c_rows) };
    if y.len() < width * height * bytes || v.len() < c_width * c_rows * bytes || c_rows == 0 {
        return false;
    }
    out.reserve(width * height);
    let c_len = c_width * bytes;
    for (row, luma) in y.chunks_exact(width * bytes).take(height).enumerate() {
        let c = (row >> shift.1).min(c_rows - 1) * c_len;
        let (u, v) = (&u[c..c + c_len], &v[c..c + c_len]);
        if bits > 8 {
            let down = |plane: &[u8], i: usize| {
                let sample = u32::from(u16::from_le_bytes([plane[2 * i], plane[2 * i + 1]]));
                ((sample + (1 << (bits - 9))) >> (bits - 8)).min(255) as i32
            };
            let chroma = |x: usize| (x >> shift.0).min(c_width - 1);
            out.extend((0..width).map(|x| matrix.pixel(down(luma, x), down(u, chroma(x)), down(v, chroma(x)))));
        } else if shift.0 == 1 {
            let mut done = [[0; 3]; BLOCK];
            for (k, luma) in luma.chunks(BLOCK).enumerate() {
                let from = k * BLOCK / 2;
                let mut wide = Wide { y: [0; BLOCK], u: [0; BLOCK], v: [0; BLOCK] };
                wide.y[..luma.len()].copy_from_slice(luma);
                for (to, plane) in [(&mut wide.u, u), (&mut wide.v, v)] {
                    for (i, pair) in to.chunks_exact_mut(2).enumerate() {
                        pair.fill(plane[(from + i).min(c_width - 1)]);
                    }
                }
                block_to_rgb(matrix, &wide, &mut done);
                out.extend_from_slice(&done[..luma.len()]);
            }
        } else {
            let chroma = |x: usize| (x >> shift.0).min(c_width - 1);
            out.extend(
                luma.iter()
                    .enumerate()
                    .map(|(x, &y)| matrix.pixel(i32::from(y), i32::from(u[chroma(x)]), i32::from(v[chroma(x)]))),
            );
        }
    }
    out.len() == width * height
}

/// Two bytes to a sample, least significant first.
pub(super) fn to_u16(bytes: &[u8], out: &mut Vec<u16>) {
    out.clear();
    out.extend(bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_colours_of_the_standards_bars_come_out() {
        // 100 % bars in video range, BT.709 (ITU-R BT.709-6, rounded codes): white, yellow, green, red, blue, black.
        let m = Matrix::new(1, false, 1080);
        for (yuv, rgb) in [
            ([235, 128, 128], [255, 255, 255]),
            ([219, 16, 138], [255, 255, 0]),
            ([173, 42, 26], [0, 255, 0]),
            ([63, 102, 240], [255, 0, 0]),
            ([32, 240, 118], [0, 0, 255]),
            ([16, 128, 128], [0, 0, 0]),
        ] {
            let got = m.pixel(yuv[0], yuv[1], yuv[2]);
            for (g, w) in got.iter().zip(rgb) {
                assert!((i32::from(*g) - w).abs() <= 2, "{yuv:?} gave {got:?}, not {rgb:?}");
            }
        }
    }

    #[test]
    fn odd_pictures_repeat_the_last_chroma() {
        let y = [100u8; 15];
        for c_len in [6, 2] {
            let c = vec![128u8; c_len];
            let p = Planes { width: 5, height: 3, y: &y, u: &c, v: &c, shift: (1, 1), bits: 8 };
            let mut out = Vec::new();
            assert!(to_rgb(&p, &Matrix::new(0, true, 3), &mut out));
            assert_eq!(out, [[100; 3]; 15]);
        }
    }

    #[test]
    fn every_pixel_has_its_own_luma_and_the_chroma_of_its_pair_whatever_the_width() {
        let m = Matrix::new(1, false, 4);
        for width in [1usize, 2, 5, 63, 64, 65, 127, 130, 131] {
            // Chroma of odd pictures rounded up or down.
            for c_width in [width.div_ceil(2), width / 2].into_iter().filter(|c| *c > 0) {
                let plane = |n: usize, by: usize| (0..n).map(|i| (i * by % 251) as u8).collect::<Vec<_>>();
                let (y, u, v) = (plane(4 * width, 7), plane(2 * c_width, 31), plane(2 * c_width, 57));
                let planes = Planes { width, height: 4, y: &y, u: &u, v: &v, shift: (1, 1), bits: 8 };
                let mut out = Vec::new();
                assert!(to_rgb(&planes, &m, &mut out));
                for (i, p) in out.iter().enumerate() {
                    let c = i / width / 2 * c_width + (i % width / 2).min(c_width - 1);
                    assert_eq!(*p, m.pixel(y[i].into(), u[c].into(), v[c].into()), "{width} {c_width} {i}");
                }
            }
        }
    }

    #[test]
    fn planes_that_are_too_short_are_refused() {
        let p = Planes { width: 4, height: 4, y: &[0; 15], u: &[0; 4], v: &[0; 4], shift: (1, 1), bits: 8 };
        assert!(!to_rgb(&p, &Matrix::new(0, true, 4), &mut Vec::new()));
    }
}
