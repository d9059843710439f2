//! A picture that can be drawn on: anti-aliased lines, boxes, ellipses, all blended over what is there.
//!
//! Coordinates are canvas pixels, (x, y) = (column, row), centre of the top-left pixel = (0, 0). Everything is clipped
//! to the picture; positions that are not finite draw nothing.
//! Cost: proportional to the pixels touched; a line looks at the pixels of its bounding box.

use crate::Image;

/// A colour, red, green, blue.
pub type Rgb = [u8; 3];

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Its colour.
    pub colour: Rgb,
    /// Opacity, 0..=1.
    pub alpha: f32,
    /// Width, px.
    pub width_px: f32,
    /// Lengths of dash and gap, px; `None` = solid.
    pub dash_px: Option<(f32, f32)>,
}

impl Pen {
    /// A solid, opaque pen.
    pub fn solid(colour: Rgb, width_px: f32) -> Self {
        Self { colour, alpha: 1.0, width_px, dash_px: None }
    }
}

/// A picture being drawn on.
pub struct Canvas<'a> {
    image: &'a mut Image<Rgb>,
}

impl<'a> Canvas<'a> {
    /// Draws on `image`.
    pub fn new(image: &'a mut Image<Rgb>) -> Self {
        Self { image }
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.image.width()
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.image.height()
    }

    /// Blends one pixel; outside the picture nothing happens.
    #[inline]
    pub fn blend(&mut self, x: i64, y: i64, colour: Rgb, alpha: f32) {
        let (w, h) = (self.image.width(), self.image.height());
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= w || y >= h || alpha <= 0.0 {
            return;
        }
        let a = (alpha.min(1.0) * 256.0) as i32;
        if let Some(p) = self.image.as_mut_slice().get_mut(y * w + x) {
            for (p, c) in p.iter_mut().zip(colour) {
                *p = (i32::from(*p) + (((i32::from(c) - i32::from(*p)) * a) >> 8)) as u8;
            }
        }
    }

    /// Blends a filled box given by its edges (pixel-edge coordinates: a pixel (x, y) covers x - 0.5 ..= x + 0.5).
    pub fn fill(&mut self, left: f64, top: f64, right: f64, bottom: f64, colour: Rgb, alpha: f32) {
        let clip = |v: f64, n: usize| (v + 0.5).round().clamp(0.0, n as f64) as i64;
        let (x0, x1) = (clip(left, self.width()), clip(right, self.width()));
        let (y0, y1) = (clip(top, self.height()), clip(bottom, self.height()));
        for y in y0..y1 {
            for x in x0..x1 {
                self.blend(x, y, colour, alpha);
            }
        }
    }

    /// Draws one straight solid piece.
    fn segment(&mut self, from: (f64, f64), to: (f64, f64), pen: &Pen) {
        let half = f64::from(pen.width_px.max(0.5)) / 2.0;
        let reach = half + 0.5;
        let range = |a: f64, b: f64, n: usize| {
            let (low, high) = (a.min(b) - reach, a.max(b) + reach);
            (low.ceil().clamp(0.0, n as f64) as i64, high.floor().clamp(-1.0, n as f64 - 1.0) as i64)
        };
        if ![from.0, from.1, to.0, to.1].iter().all(|v| v.is_finite()) {
            return;
        }
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let len2 = dx * dx + dy * dy;
        let (y0, y1) = range(from.1, to.1, self.height());
        let (all_x0, all_x1) = range(from.0, to.0, self.width());
        for y in y0..=y1 {
            // Only the stretch of the row that the line's band can touch.
            let (mut x0, mut x1) = (all_x0, all_x1);
            if dy.abs() > 1e-9 {
                let at = |yy: f64| from.0 + dx * (yy - from.1) / dy;
                let (a, b) = (at(y as f64 - reach), at(y as f64 + reach));
                let slack = reach * (len2.sqrt() / dy.abs()).min(1e6);
                x0 = x0.max((a.min(b) - slack).max(-1.0) as i64);
                x1 = x1.min((a.max(b) + slack).min(self.width() as f64) as i64 + 1);
            }
            for x in x0..=x1 {
                let (px, py) = (x as f64 - from.0, y as f64 - from.1);
                let t = if len2 > 0.0 { ((px * dx + py * dy) / len2).clamp(0.0, 1.0) } else { 0.0 };
                let (ex, ey) = (px - t * dx, py - t * dy);
                let cover = reach - (ex * ex + ey * ey).sqrt();
                if cover > 0.0 {
                    self.blend(x, y, pen.colour, pen.alpha * (cover.min(1.0) as f32));
                }
            }
        }
    }

    /// Draws a line.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), pen: &Pen) {
        self.path(&[from, to], pen);
    }

    /// Draws a chain of lines, dashed along its whole length if the pen says so.
    pub fn path(&mut self, points: &[(f64, f64)], pen: &Pen) {
        let Some((dash, gap)) = pen.dash_px.map(|(d, g)| (f64::from(d.max(1.0)), f64::from(g.max(1.0)))) else {
            points.windows(2).for_each(|w| self.segment(w[0], w[1], pen));
            return;
        };
        let mut phase = 0.0;
        for w in points.windows(2) {
            let (a, b) = (w[0], w[1]);
            let len = (b.0 - a.0).hypot(b.1 - a.1);
            // A piece of a line that leaves the picture by far would be dashed for nothing.
            if !len.is_finite() || len > 1e5 {
                continue;
            }
            let at = |d: f64| (a.0 + (b.0 - a.0) * d / len.max(1e-9), a.1 + (b.1 - a.1) * d / len.max(1e-9));
            let mut done = 0.0;
            while done < len {
                let in_dash = phase < dash;
                let step = (if in_dash { dash - phase } else { dash + gap - phase }).min(len - done).max(1e-6);
                if in_dash {
                    self.segment(at(done), at(done + step), pen);
                }
                done += step;
                phase = (phase + step) % (dash + gap);
            }
        }
    }

    /// Draws a box along its edges (centre lines of the pen).
    pub fn rectangle(&mut self, left: f64, top: f64, right: f64, bottom: f64, pen: &Pen) {
        self.path(&[(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], pen);
    }

    /// Draws the ellipse of a 2x2 covariance `[xx, xy, yy]` (px²) at `scale` standard deviations.
    ///
    /// Covariances that are not positive, not finite or wider than the picture draw nothing.
    pub fn ellipse(&mut self, centre: (f64, f64), cov: [f64; 3], scale: f64, pen: &Pen) {
        let [xx, xy, yy] = cov;
        let mid = (xx + yy) / 2.0;
        let spread = ((xx - yy) / 2.0).hypot(xy);
        let (long, short) = (mid + spread, mid - spread);
        let largest = (self.width() + self.height()) as f64;
        if !(short > 0.0 && long.is_finite() && scale * long.sqrt() < largest) {
            return;
        }
        let (a, b) = (scale * long.sqrt(), scale * short.sqrt());
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let (sin, cos) = angle.sin_cos();
        let n = ((a + b) * 1.5).clamp(16.0, 96.0) as usize;
        let point = |i: usize| {
            let (s, c) = (i as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
            (centre.0 + a * c * cos - b * s * sin, centre.1 + a * c * sin + b * s * cos)
        };
        let points: Vec<(f64, f64)> = (0..=n).map(point).collect();
        self.path(&points, pen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white_pixels(image: &Image<Rgb>) -> usize {
        image.as_slice().iter().filter(|p| p[0] > 127).count()
    }

    #[test]
    fn a_one_pixel_line_covers_its_row_and_no_other() {
        let mut image = Image::filled(20, 9, [0; 3]);
        Canvas::new(&mut image).line((2.0, 4.0), (15.0, 4.0), &Pen::solid([255; 3], 1.0));
        assert_eq!(white_pixels(&image), 14);
        assert!(image.row(4)[2..16].iter().all(|p| p[0] == 255), "{:?}", image.row(4));
    }

    #[test]
    fn a_dashed_line_leaves_its_gaps_dark() {
        let mut image = Image::filled(100, 3, [0; 3]);
        let pen = Pen { dash_px: Some((5.0, 5.0)), ..Pen::solid([255; 3], 1.0) };
        Canvas::new(&mut image).line((0.0, 1.0), (99.0, 1.0), &pen);
        let n = white_pixels(&image);
        assert!((45..=65).contains(&n), "{n}");
    }

    #[test]
    fn the_ellipse_of_a_tilted_covariance_passes_through_its_axes_ends() {
        let mut image = Image::filled(101, 101, [0; 3]);
        // Axes 20 and 5 along 45 degrees: xx = yy = (400 + 25) / 2, xy = (400 - 25) / 2.
        let pen = Pen::solid([255; 3], 1.5);
        Canvas::new(&mut image).ellipse((50.0, 50.0), [212.5, 187.5, 212.5], 1.0, &pen);
        let d = 20.0 / f64::sqrt(2.0);
        for s in [-1.0, 1.0] {
            let (x, y) = ((50.0 + s * d).round() as usize, (50.0 + s * d).round() as usize);
            assert!(image.get(x, y).unwrap()[0] > 100);
        }
        assert_eq!(image.get(50, 50), Some([0; 3]));
    }

    #[test]
    fn wild_positions_draw_nothing_and_return_at_once() {
        let mut image = Image::filled(10, 10, [0; 3]);
        let mut canvas = Canvas::new(&mut image);
        let pen = Pen { dash_px: Some((2.0, 2.0)), ..Pen::solid([255; 3], 1.0) };
        canvas.line((f64::NAN, 0.0), (5.0, 5.0), &pen);
        canvas.line((-1e300, -50.0), (1e300, -50.0), &pen);
        canvas.line((-1e9, -50.0), (1e9, -60.0), &Pen::solid([255; 3], 1.0));
        canvas.ellipse((5.0, 5.0), [f64::INFINITY, 0.0, 1.0], 2.0, &pen);
        canvas.ellipse((5.0, 5.0), [-1.0, 0.0, 1.0], 2.0, &pen);
        canvas.fill(-1e300, f64::NAN, 1e300, 4.0, [9; 3], 0.0);
        assert_eq!(white_pixels(&image), 0);
    }
}
