//! The centroid of the positive response in a disc that is moved until it is centred on it.
//!
//! Source: Crocker & Grier, J. Colloid Interface Sci. 179, 298 (1996), by parts of a pixel and by Newton's steps: the centroid follows the disc by the part of its way that the response cut off at its edge tells.
//! Limits: of a peak on the outermost pixels the middle may lie outside; then it is stated to be on them.

use super::border::{cuts, moments};
use super::disc::Moments;
use crate::Image;
use nalgebra::Vector2;

/// The largest part of a disc's way that its centroid is taken to follow: beyond it what is inside has no middle of its own.
pub(super) const MOST_PULL: f64 = 0.7;

/// Most steps.
const MOST_STEPS: usize = 30;

/// A way that is none, px.
const LEAST_STEP_PX: f64 = 1e-3;

/// A centroid, and what it was taken of.
pub(super) struct Centroid {
    pub(super) position: Vector2<f64>,
    /// Sum of the positive response in the disc, counts.
    pub(super) mass: f64,
    /// How far the disc's centroid moves when the disc moves by 1 px.
    pub(super) pull: Vector2<f64>,
}

/// The centroid nearest to a pixel, in a disc of this radius.
pub(super) fn centroid(response: &Image<f32>, radius: usize, pixel: Vector2<f64>) -> Centroid {
    let (w, h) = (response.width() as f64, response.height() as f64);
    let mut of = Centroid { position: pixel, mass: 0.0, pull: Vector2::zeros() };
    if cuts(response, radius, pixel) {
        // At the very edge a window of one pixel has its middle wherever it is.
        let inside = |v: f64, size: f64| {
            let margin = (0.5 * (size - 1.0)).min(0.5);
            v.clamp(margin, size - 1.0 - margin)
        };
        of.position = Vector2::new(inside(pixel.x, w), inside(pixel.y, h));
    }
    for _ in 0..MOST_STEPS {
        let Moments { sum, moment, edge } = moments(response, radius, of.position);
        if sum <= 0.0 {
            break;
        }
        (of.mass, of.pull) = (sum, edge / sum);
        // Newton's step: where it stands still is so much further.
        let step = (moment / sum).component_div(&of.pull.map(|pull| 1.0 - pull.min(MOST_PULL)));
        let next = of.position + step;
        if !(0.0..=w - 1.0).contains(&next.x) || !(0.0..=h - 1.0).contains(&next.y) {
            break;
        }
        of.position = next;
        if step.norm() < LEAST_STEP_PX {
            break;
        }
    }
    of
}
