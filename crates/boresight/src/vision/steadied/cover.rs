//! An image as another view of the same plane sees it, and the working image that the comparison is made on.
//!
//! Source: inverse warping with bilinear interpolation (R. Szeliski, *Computer Vision*, 2nd ed., 2022, section 3.6.1).
//! How: along a row span by span, as [`crate::warp`] does.
//! Limits: outside the other image there is NaN.

use crate::vision::pixel::Pixel;
use crate::warp::{SPAN, spans};
use crate::{Homography, Image, Pixels};

/// Wider or higher frames are made smaller by a whole factor, px.
const WORKING_PX: usize = 960;

/// Side of the block of pixels that becomes one of the working image.
pub(super) fn factor(width: usize, height: usize) -> usize {
    width.max(height).div_ceil(WORKING_PX).max(1)
}

/// The working image: means of blocks, smoothed by [1 2 1]/4 both ways; pixels that are no numbers take their left neighbour's value.
pub(super) fn working<T: Pixel>(image: &Image<T>, factor: usize, line: &mut Vec<f32>, out: &mut Image<f32>) {
    let (w, h) = (image.width() / factor, image.height() / factor);
    out.reset(w, h, 0.0);
    let scale = 1.0 / (factor * factor) as f32;
    for y in 0..h {
        let to = out.row_mut(y);
        for dy in 0..factor {
            add_blocks(&image.row(y * factor + dy)[..w * factor], factor, to);
        }
        let mut last = 0.0;
        for t in to {
            *t = if t.is_finite() { *t * scale } else { last };
            last = *t;
        }
    }
    smooth(out, line);
}

widest! {
    /// Adds the values of each so many pixels of a row.
    fn add_blocks<T: Pixel>(row: &[T], factor: usize, to: &mut [f32]) {
        match factor {
            1 => to.iter_mut().zip(row).for_each(|(t, v)| *t += v.value_f32()),
            2 => to.iter_mut().zip(row.chunks_exact(2)).for_each(|(t, v)| *t += v[0].value_f32() + v[1].value_f32()),
            n => {
                to.iter_mut().zip(row.chunks_exact(n)).for_each(|(t, v)| *t += v.iter().map(|v| v.value_f32()).sum::<f32>())
            }
        }
    }
}

/// As [`working`] for frames of any kind, colours by their green; and the side of its blocks.
pub(crate) fn plane_image(pixels: &Pixels, line: &mut Vec<f32>, out: &mut Image<f32>) -> usize {
    let factor = factor(pixels.width(), pixels.height());
    match pixels {
        Pixels::Gray8(i) => working(i, factor, line, out),
        Pixels::Gray16(i) => working(i, factor, line, out),
        Pixels::GrayF32(i) => working(i, factor, line, out),
        Pixels::Rgb8(i) => {
            let green = Image::from_vec(i.width(), i.height(), i.as_slice().iter().map(|p| p[1]).collect());
            working(&green.unwrap_or_default(), factor, line, out);
        }
    }
    factor
}

/// [1 2 1]/4 along rows and columns, in place.
fn smooth(image: &mut Image<f32>, line: &mut Vec<f32>) {
    let (w, h) = (image.width(), image.height());
    if w < 3 || h < 3 {
        return;
    }
    line.clear();
    line.resize(2 * w, 0.0);
    let (above, row) = line.split_at_mut(w);
    for y in 0..h {
        row.copy_from_slice(image.row(y));
        let out = image.row_mut(y);
        for x in 1..w - 1 {
            out[x] = 0.25 * (row[x - 1] + row[x + 1]) + 0.5 * row[x];
        }
    }
    above.copy_from_slice(image.row(0));
    for y in 1..h - 1 {
        row.copy_from_slice(image.row(y));
        let (this, below) = image.as_mut_slice()[y * w..(y + 2) * w].split_at_mut(w);
        for x in 0..w {
            this[x] = 0.25 * (above[x] + below[x]) + 0.5 * row[x];
        }
        above.copy_from_slice(row);
    }
}

/// Draws `other` as it looks where `other_from_own` takes each pixel, into `out` (of the size wanted).
pub(super) fn cover(other: &Image<f32>, other_from_own: &Homography, out: &mut Image<f32>) {
    let (w, h) = (other.width(), other.height());
    if w < 2 || h < 2 {
        out.as_mut_slice().fill(f32::NAN);
        return;
    }
    for y in 0..out.height() {
        spans(out.row_mut(y), y, other_from_own, |span, from, step| {
            cover_span(other, [from.x as f32, from.y as f32], [step.x as f32, step.y as f32], span);
        });
    }
}

widest! {
    /// Draws the pixels of a span that begin at `from` and lie `step` apart.
    fn cover_span(other: &Image<f32>, from: [f32; 2], step: [f32; 2], span: &mut [f32]) {
        let (w, h) = (other.width(), other.height());
        let (most_x, most_y) = ((w - 1) as f32, (h - 1) as f32);
        let pixels = other.as_slice();
        let (mut px, mut py) = ([0.0f32; SPAN], [0.0f32; SPAN]);
        for i in 0..SPAN {
            (px[i], py[i]) = (from[0] + i as f32 * step[0], from[1] + i as f32 * step[1]);
        }
        let (mut first, mut inside) = ([0u32; SPAN], true);
        let (mut u, mut t) = ([0.0f32; SPAN], [0.0f32; SPAN]);
        for i in 0..SPAN {
            inside &= (px[i] >= 0.0) & (py[i] >= 0.0) & (px[i] < most_x) & (py[i] < most_y);
            // Of what is not inside no place is used.
            let (x, y) = (px[i] as i32, py[i] as i32);
            (u[i], t[i]) = (px[i] - x as f32, py[i] - y as f32);
            first[i] = (y as u32).wrapping_mul(w as u32).wrapping_add(x as u32);
        }
        for (i, v) in span.iter_mut().enumerate().take(SPAN) {
            let seen = inside || (px[i] >= 0.0 && py[i] >= 0.0 && px[i] < most_x && py[i] < most_y);
            let first = first[i] as usize;
            *v = match pixels.get(first..first + w + 2) {
                Some(four) if seen => {
                    let (a, b) = (four[0] + u[i] * (four[1] - four[0]), four[w] + u[i] * (four[w + 1] - four[w]));
                    a + t[i] * (b - a)
                }
                _ => f32::NAN,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector2};

    #[test]
    fn a_plane_of_slopes_is_drawn_exactly_where_it_is_seen_and_nowhere_else() {
        // Bilinear interpolation is exact on a linear ramp: v = x + 100 y.
        let mut ramp = Image::filled(80, 60, 0.0f32);
        for y in 0..60 {
            ramp.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = x as f32 + 100.0 * y as f32);
        }
        let h = Homography::of_matrix(Matrix3::new(1.01, -0.02, 3.3, 0.02, 0.99, -1.7, 1e-5, -2e-5, 1.0)).unwrap();
        let mut out = Image::filled(80, 60, 0.0f32);
        cover(&ramp, &h, &mut out);
        let mut n = 0;
        for y in 0..60 {
            for x in 0..80 {
                let p = h.apply(Vector2::new(x as f64, y as f64));
                let inside = p.x > 0.01 && p.y > 0.01 && p.x < 78.99 && p.y < 58.99;
                let v = f64::from(out.row(y)[x]);
                assert!(!inside || (v - p.x - 100.0 * p.y).abs() < 0.05, "{x} {y}: {v}");
                n += usize::from(v.is_nan());
            }
        }
        assert!(n > 100, "{n} pixels are not seen");
    }

    #[test]
    fn large_frames_are_halved_and_an_even_one_stays_even() {
        assert_eq!([factor(512, 270), factor(1920, 1080), factor(3840, 2160), factor(1, 1)], [1, 2, 4, 1]);
        let (mut out, mut line) = (Image::default(), Vec::new());
        working(&Image::filled(41, 31, 7u16), 2, &mut line, &mut out);
        assert!((out.width(), out.height()) == (20, 15) && out.as_slice().iter().all(|v| (v - 7.0).abs() < 1e-6));
        // A lone pixel is spread by [1 2 1]/4 both ways.
        let mut lone = Image::filled(9, 9, 0u8);
        lone.row_mut(4)[4] = 160;
        working(&lone, 1, &mut line, &mut out);
        assert_eq!((out.row(4)[4], out.row(3)[4], out.row(3)[3], out.row(2)[4]), (40.0, 20.0, 10.0, 0.0));
    }
}
