//! The papers' synthetic FLIR frame from supplied standard normals.
//!
//! Source: `docs/theory/image.md` (Roopa et al. 2016, eqs 12-16). Target pixels **replace** the background; "N(m, s)"
//! are standard deviations. Symbols: background mean, std (counts); target centre (x, y) px, nx x ny px, mean, std
//! (counts).
//! Departure: coordinates here count from 0, centre of the top-left pixel = (0, 0); the papers count from 1.
//! Limits: a centre between pixels is rounded to the grid, so that a sub-pixel truth has an error of up to half a pixel.

use crate::Image;

/// A rectangular target of the papers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperTarget {
    /// Centre, column, px (from 0).
    pub x_px: f64,
    /// Centre, row, px (from 0).
    pub y_px: f64,
    /// Columns.
    pub nx: usize,
    /// Rows.
    pub ny: usize,
    /// Mean of the target's pixels, counts.
    pub mean: f64,
    /// Standard deviation of the target's pixels, counts.
    pub std: f64,
}

/// Returns `clamp(floor(v + 1/2), 0, 255)`.
#[inline]
pub fn quantise(v: f64) -> u8 {
    (v + 0.5).floor().clamp(0.0, 255.0) as u8
}

/// First column (or row) of a target of `n` pixels centred on `centre_px`: `floor(centre - (n - 1)/2 + 1/2)`.
#[inline]
pub fn first_pixel(centre_px: f64, n: usize) -> i64 {
    (centre_px - (n as f64 - 1.0) / 2.0 + 0.5).floor() as i64
}

/// The part of a target's row that lies inside the image: `(first pixel in the image, first in the target, length)`.
#[inline]
pub(crate) fn clip(first: i64, n: usize, limit: usize) -> Option<(usize, usize, usize)> {
    let start = first.max(0);
    let end = first.saturating_add(n as i64).min(limit as i64);
    (start < end).then(|| (start as usize, (start - first) as usize, (end - start) as usize))
}

/// Renders a frame before quantisation: `bg_mean + bg_std z`, then each target in order over it.
///
/// `z_background` holds one standard normal a pixel; `z_targets[t]` one for each pixel of target t, row by row.
/// Later targets overwrite earlier ones; pixels outside are dropped. Pass the result through [`quantise`] for an 8-bit frame.
/// # Panics
/// If a target has fewer normals than pixels: a bug of the caller.
pub fn render_from_normals(
    z_background: &Image<f64>,
    bg_mean: f64,
    bg_std: f64,
    targets: &[PaperTarget],
    z_targets: &[Vec<f64>],
) -> Image<f64> {
    let (w, h) = (z_background.width(), z_background.height());
    let mut out = z_background.clone();
    for v in out.as_mut_slice() {
        *v = bg_mean + bg_std * *v;
    }
    for (t, z) in targets.iter().zip(z_targets) {
        let (Some((c0, b0, n)), Some((r0, a0, m))) =
            (clip(first_pixel(t.x_px, t.nx), t.nx, w), clip(first_pixel(t.y_px, t.ny), t.ny, h))
        else {
            continue;
        };
        for i in 0..m {
            let from = (a0 + i) * t.nx + b0;
            for (v, z) in out.row_mut(r0 + i)[c0..c0 + n].iter_mut().zip(&z[from..from + n]) {
                *v = t.mean + t.std * z;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nine_by_nine_target_at_the_papers_sixty_ends_at_the_last_column() {
        // docs/theory/image.md: centre 60 (from 1) covers 56..64, that is 55..=63 from 0.
        assert_eq!(first_pixel(59.0, 9), 55);
        assert_eq!(clip(first_pixel(59.0, 9), 9, 64), Some((55, 0, 9)));
    }

    #[test]
    fn half_positions_round_up_and_targets_are_cut_at_the_border() {
        assert_eq!(first_pixel(10.5, 3), 10);
        assert_eq!(first_pixel(10.49, 3), 9);
        assert_eq!(clip(-2, 5, 64), Some((0, 2, 3)));
        assert_eq!(clip(62, 5, 64), Some((62, 0, 2)));
        assert_eq!(clip(64, 5, 64), None);
        assert_eq!(clip(-5, 5, 64), None);
    }

    #[test]
    fn quantising_rounds_half_up_and_clamps() {
        assert_eq!(
            [quantise(-3.0), quantise(0.49), quantise(0.5), quantise(254.5), quantise(900.0)],
            [0, 0, 1, 255, 255]
        );
    }
}
