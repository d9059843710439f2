//! What the frame's border cuts off: the centroid of what is seen is not the target's.
//!
//! Source: our own. Of a target that touches the border w px are seen across it. As much again at most is taken to be unseen, any amount as likely as another: the target's
//! middle then lies between 0 and w/2 beyond that of what is seen, with the mean square w²/12, which is added to the variance across that border. Without it a target that enters
//! is held at half of its speed with the certainty of its many pixels, and lost when it has come in.
//! Symbols: w side of the box across the border, px.
//! Limits: the position itself stays that of what is seen; the errors of one target are alike from frame to frame while it enters or leaves.

use crate::Detection;

/// Mean square of the distance between the middles of what is seen and of the target, in squared sides: that of a number from 0 to 1/2.
const UNSEEN: f64 = 1.0 / 12.0;

/// Adds the variance of what the border of a frame of that width and height cuts off.
pub(super) fn add(detections: &mut [Detection], (width, height): (usize, usize)) {
    // Boxes are given by the edges of pixels, and the first pixel's edge is at -1/2.
    let (right, bottom) = (width as f64 - 0.5, height as f64 - 0.5);
    for d in detections {
        let e = &d.extent;
        if e.left_px <= -0.5 || e.left_px + e.width_px >= right {
            d.cov[(0, 0)] += UNSEEN * e.width_px * e.width_px;
        }
        if e.top_px <= -0.5 || e.top_px + e.height_px >= bottom {
            d.cov[(1, 1)] += UNSEEN * e.height_px * e.height_px;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn what_is_cut_off_is_unknown_across_the_border_it_is_cut_by_and_nowhere_else() {
        let seen = |left_px: f64, top_px: f64, width_px: f64, height_px: f64| {
            let extent = Extent { left_px, top_px, width_px, height_px };
            let middle = Vector2::new(left_px + 0.5 * width_px, top_px + 0.5 * height_px);
            let mut d = [Detection::at(middle, Matrix2::identity()).with_extent(extent)];
            add(&mut d, (100, 50));
            [d[0].cov[(0, 0)], d[0].cov[(1, 1)], d[0].cov[(0, 1)]]
        };
        assert_eq!(seen(0.5, 0.5, 98.0, 48.0), [1.0, 1.0, 0.0], "one pixel from each border");
        assert_eq!(seen(-0.5, 10.5, 6.0, 12.0), [4.0, 1.0, 0.0]);
        assert_eq!(seen(93.5, 10.5, 6.0, 12.0), [4.0, 1.0, 0.0]);
        assert_eq!(seen(10.5, -0.5, 6.0, 12.0), [1.0, 13.0, 0.0]);
        assert_eq!(seen(10.5, 37.5, 6.0, 12.0), [1.0, 13.0, 0.0]);
        assert_eq!(seen(93.5, 37.5, 6.0, 12.0), [4.0, 13.0, 0.0]);
    }

    #[test]
    fn the_variance_is_that_of_what_may_be_unseen() {
        // Numbers from 0 to 1/2, evenly.
        let mean_square = (0..1000).map(|i| (0.5 * (f64::from(i) + 0.5) / 1000.0).powi(2)).sum::<f64>() / 1000.0;
        assert!((mean_square - UNSEEN).abs() < 1e-6);
    }
}
