//! Frames as a camera elsewhere would have them.
//!
//! Source: inverse warping with bilinear interpolation (R. Szeliski, *Computer Vision*, 2nd ed., 2022, section 3.6.1).
//! How: along a row the place in the other image is computed at every [`SPAN`]-th pixel and runs in a straight line between: with a perspective that bends
//! by 1 % of the width over the image, [`SPAN`] = 16 of 960 px leave 3·10⁻⁴ px. Of a shift all pixels lie alike between four.
//! Limits: what lies between pixels is smoother than they are.

use crate::{Homography, Image, Pixels};
use nalgebra::Vector2;

/// Pixels over which a place runs in a straight line.
pub(crate) const SPAN: usize = 16;

/// A kind of pixel that can be mixed.
pub(crate) trait Mix: Copy + Default {
    /// The mean of four with weights that sum to one.
    fn mix(four: [Self; 4], weights: [f32; 4]) -> Self;
}

macro_rules! mix_whole {
    ($($kind:ty),*) => {$(
        impl Mix for $kind {
            #[inline]
            fn mix(four: [Self; 4], weights: [f32; 4]) -> Self {
                // The sum is not negative: half more is cut off to the nearest.
                (four.into_iter().zip(weights).map(|(v, w)| w * f32::from(v)).sum::<f32>() + 0.5) as Self
            }
        }
    )*};
}
mix_whole!(u8, u16);

impl Mix for f32 {
    #[inline]
    fn mix(four: [Self; 4], weights: [f32; 4]) -> Self {
        four.into_iter().zip(weights).map(|(v, w)| w * v).sum()
    }
}

impl Mix for [u8; 3] {
    #[inline]
    fn mix(four: [Self; 4], weights: [f32; 4]) -> Self {
        std::array::from_fn(|i| u8::mix(four.map(|v| v[i]), weights))
    }
}

/// Value between pixels; `None` outside.
#[inline]
pub(crate) fn between<T: Mix>(image: &Image<T>, p: Vector2<f64>) -> Option<T> {
    let (w, h) = (image.width(), image.height());
    if !(p.x >= 0.0 && p.y >= 0.0 && p.x <= (w - 1) as f64 && p.y <= (h - 1) as f64) {
        return None;
    }
    let (x, y) = ((p.x as usize).min(w.saturating_sub(2)), (p.y as usize).min(h.saturating_sub(2)));
    let (u, v) = ((p.x - x as f64) as f32, (p.y - y as f64) as f32);
    let (right, below) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
    let (a, b) = (image.row(y), image.row(below));
    Some(T::mix([a[x], a[right], b[x], b[right]], weights(u, v)))
}

fn weights(u: f32, v: f32) -> [f32; 4] {
    [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
}

/// Draws an image where `image_from_canvas` says that each place of the canvas lies in it; elsewhere the canvas stays as it is. A canvas of another size or kind begins as the image.
pub(crate) fn draw_onto(pixels: &Pixels, image_from_canvas: &Homography, canvas: &mut Pixels) {
    if !pixels.are_like(canvas) || image_from_canvas.is_identity() {
        canvas.clone_from(pixels);
        return;
    }
    match (pixels, canvas) {
        (Pixels::Gray8(i), Pixels::Gray8(c)) => draw(i, image_from_canvas, c),
        (Pixels::Gray16(i), Pixels::Gray16(c)) => draw(i, image_from_canvas, c),
        (Pixels::GrayF32(i), Pixels::GrayF32(c)) => draw(i, image_from_canvas, c),
        (Pixels::Rgb8(i), Pixels::Rgb8(c)) => draw(i, image_from_canvas, c),
        // They are of one kind.
        _ => {}
    }
}

fn draw<T: Mix>(image: &Image<T>, image_from_canvas: &Homography, canvas: &mut Image<T>) {
    if image_from_canvas.is_shift() {
        return draw_shifted(image, image_from_canvas.shift_at(Vector2::zeros()), canvas);
    }
    for y in 0..canvas.height() {
        spans(canvas.row_mut(y), y, image_from_canvas, |span, from, step| {
            for (k, v) in span.iter_mut().enumerate() {
                *v = between(image, from + step * k as f64).unwrap_or(*v);
            }
        });
    }
}

/// Hands on the spans of a row of an image, each with the place of its first pixel in another image and the step to the next.
pub(crate) fn spans<T>(
    row: &mut [T],
    y: usize,
    other_from_own: &Homography,
    mut draw: impl FnMut(&mut [T], Vector2<f64>, Vector2<f64>),
) {
    let at = |x: usize| other_from_own.apply(Vector2::new(x as f64, y as f64));
    let mut from = at(0);
    for (i, span) in row.chunks_mut(SPAN).enumerate() {
        let to = at((i + 1) * SPAN);
        draw(span, from, (to - from) / SPAN as f64);
        from = to;
    }
}

/// The same by a shift: the canvas's pixel lies there in the image.
fn draw_shifted<T: Mix>(image: &Image<T>, shift: Vector2<f64>, canvas: &mut Image<T>) {
    let whole = [shift.x.floor(), shift.y.floor()];
    let weights = weights((shift.x - whole[0]) as f32, (shift.y - whole[1]) as f32);
    let [dx, dy] = whole.map(|v| v as isize);
    let (w, h) = (image.width() as isize, image.height() as isize);
    // Both neighbours are in the image.
    let seen = |d: isize, n: isize| (-d).clamp(0, n) as usize..(n - 1 - d).clamp(0, n) as usize;
    let (columns, rows) = (seen(dx, w), seen(dy, h));
    if columns.is_empty() {
        return;
    }
    let left = (columns.start as isize + dx) as usize;
    let n = columns.len();
    for y in rows {
        let above = (y as isize + dy) as usize;
        let [a, b] = [above, above + 1].map(|row| &image.row(row)[left..=left + n]);
        blend(a, b, weights, &mut canvas.row_mut(y)[columns.clone()]);
    }
}

widest! {
    /// Mixes two rows, each pixel with its right neighbour.
    fn blend<T: Mix>(a: &[T], b: &[T], weights: [f32; 4], to: &mut [T]) {
        let n = to.len();
        let (a, b) = (&a[..n + 1], &b[..n + 1]);
        for x in 0..n {
            to[x] = T::mix([a[x], a[x + 1], b[x], b[x + 1]], weights);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Similarity;

    fn ramp(w: usize, h: usize) -> Pixels {
        Pixels::GrayF32(
            Image::from_vec(w, h, (0..w * h).map(|i| (3 * (i % w) + 7 * (i / w)) as f32).collect()).unwrap(),
        )
    }

    #[test]
    fn a_plane_of_values_is_drawn_exactly_where_it_is_seen_and_stays_elsewhere() {
        let turned = Similarity::about(Vector2::new(20.0, 15.0), Vector2::new(1.3, -2.6), 0.05, 1.03);
        for h in [Homography::shift(Vector2::new(2.25, -3.5)), Homography::of_similarity(&turned)] {
            let mut canvas = Pixels::GrayF32(Image::filled(40, 30, -1.0));
            draw_onto(&ramp(40, 30), &h, &mut canvas);
            let Pixels::GrayF32(canvas) = canvas else { panic!("another kind") };
            let mut n = 0;
            for y in 0..30 {
                for (x, v) in canvas.row(y).iter().enumerate() {
                    let at = h.apply(Vector2::new(x as f64, y as f64));
                    let inside = (0.0..=39.0).contains(&at.x) && (0.0..=29.0).contains(&at.y);
                    let expected = if inside { 3.0 * at.x + 7.0 * at.y } else { -1.0 };
                    assert!((f64::from(*v) - expected).abs() < 1e-3, "({x}, {y}): {v}, not {expected}");
                    n += usize::from(inside);
                }
            }
            assert!(n > 800);
        }
    }

    #[test]
    fn a_shift_is_drawn_as_any_motion_is_in_every_kind_of_pixel() {
        let of = |i: usize| (i.wrapping_mul(2_654_435_761) >> 8) as u8;
        let image = Image::from_vec(37, 23, (0..37 * 23).map(of).collect()).unwrap();
        // Nearly a shift, so that it goes the other way.
        let nearly = |s: Vector2<f64>| Homography::of_similarity(&Similarity::about(Vector2::zeros(), s, 1e-12, 1.0));
        for shift in [[0.5, 0.25], [-4.0, 3.0], [7.75, -8.5], [50.0, 0.0], [0.0, -30.0]].map(Vector2::from) {
            let (mut one, mut other) =
                (Pixels::Gray8(Image::filled(37, 23, 9)), Pixels::Gray8(Image::filled(37, 23, 9)));
            let pixels = Pixels::Gray8(image.clone());
            draw_onto(&pixels, &Homography::shift(shift), &mut one);
            draw_onto(&pixels, &nearly(shift), &mut other);
            let (Pixels::Gray8(one), Pixels::Gray8(other)) = (one, other) else { panic!("another kind") };
            // Of the last column and row the neighbour is missing where the shift is whole.
            let n = one.as_slice().iter().zip(other.as_slice()).filter(|(a, b)| a.abs_diff(**b) > 1).count();
            assert!(n <= 37 + 23, "{shift}: {n}");
        }
    }
}
