//! How far off a centroid near the border is, since the response there is not that of the whole spot.
//!
//! Source: our own. The filter takes what lies outside the frame to be as its edge, so near the border the response is wrong in what the smoothing and the surroundings see of that. How far that moves the centroid of a Gaussian is
//! measured when the detector is built, at every half pixel from the border and for the widths that a size is chosen for; the mean square is added to the variance across the border. The width of a spot is told by how far its centroid follows its disc.
//! Limits: Gaussians whose middle is in the frame; one that lies outside is stated to be at the border.

use super::centring::centroid;
use super::disc::DIAMETER_PER_WIDTH;
use crate::Image;
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::threshold::boxes::Boxes;
use nalgebra::Vector2;

/// Widths at half height in units of the size that is looked for: of the size with the soft edge, half way, and the size itself.
const WIDTHS: [f64; 3] = [1.0 / DIAMETER_PER_WIDTH, 1.0 / 1.5, 1.0];

/// Distances from the border a px.
const STEPS: usize = 2;

/// The largest size that it is measured at, px: beyond it all lengths grow alike.
const MEASURED_PX: f64 = 16.0;

/// The mean square of a centroid's error across the border, since the response there is not that of the whole spot.
#[derive(Clone, Debug)]
pub(super) struct Unseen {
    /// What lengths were divided by.
    scale: f64,
    of_width: Vec<UnseenOf>,
}

/// That of spots of a width.
#[derive(Clone, Debug)]
struct UnseenOf {
    /// How far a centroid follows its disc, by which widths are told.
    pull: f64,
    /// px², by how far from the border the spot is found, in steps of 1 / `STEPS` px.
    variance: Vec<f64>,
}

impl Unseen {
    /// Measures it for a size, the sides of both boxes and the radius of the disc, px.
    pub(super) fn new(size_px: f64, (smooth, surround): (usize, usize), radius: usize) -> Self {
        let scale = (size_px / MEASURED_PX).max(1.0);
        let part = |px: usize| (px as f64 / scale).round() as usize;
        let (smooth, radius) = (part(smooth) | 1, part(radius));
        let boxes = (smooth, (part(surround) | 1).max(smooth + 2));
        let of_width = WIDTHS.map(|width| UnseenOf::new(width * size_px / scale, boxes, radius)).to_vec();
        Self { scale, of_width }
    }

    /// The variance to be added of a spot at `c` whose centroid follows its disc by that much, px².
    pub(super) fn variance_px2(
        &self,
        c: Vector2<f64>,
        pull: Vector2<f64>,
        (width, height): (usize, usize),
    ) -> Vector2<f64> {
        // What follows less is cut less.
        let pull = pull.min();
        let nearest = self.of_width.iter().min_by(|a, b| (a.pull - pull).abs().total_cmp(&(b.pull - pull).abs()));
        let of = |v: f64, size: usize| {
            let from_border = v.min(size as f64 - 1.0 - v).max(0.0);
            let place = (from_border / self.scale * STEPS as f64).round() as usize;
            nearest.and_then(|n| n.variance.get(place)).map_or(0.0, |v| v * self.scale.powi(2))
        };
        Vector2::new(of(c.x, width), of(c.y, height))
    }
}

impl UnseenOf {
    fn new(width_px: f64, (smooth, surround): (usize, usize), radius: usize) -> Self {
        let far = radius + surround / 2 + smooth;
        let (middle, side) = (far as f64, 2 * far + 1);
        let mut boxes = Boxes::new(smooth, surround);
        let (mut light, mut response) = (Image::filled(side, side, 0.0f32), Image::default());
        let profile = |from: f64| (-0.5 * (WIDTH_PER_DEVIATION / width_px * from).powi(2)).exp();
        let column: Vec<f64> = (0..side).map(|y| profile(y as f64 - middle)).collect();
        // Sums of squares, and of how many.
        let mut squares = vec![(0.0, 0.0); far * STEPS + 1];
        let mut pull = 0.0;
        // From the edge of the outermost pixels on.
        for at in (0..=far * STEPS).map(|i| i as f64 / STEPS as f64 - 0.5) {
            let row: Vec<f64> = (0..side).map(|x| profile(x as f64 - at)).collect();
            for (y, v) in column.iter().enumerate() {
                light.row_mut(y).iter_mut().zip(&row).for_each(|(p, u)| *p = (u * v) as f32);
            }
            boxes.run(&light, &mut response);
            let found = centroid(&response, radius, Vector2::new(at.round().max(0.0), middle));
            let place = (found.position.x * STEPS as f64).round().clamp(0.0, (far * STEPS) as f64) as usize;
            squares[place].0 += (found.position.x - at).powi(2);
            squares[place].1 += 1.0;
            // The last is whole.
            pull = found.pull.y;
        }
        // Where none was found it is as farther out.
        let variance = squares.into_iter().scan(0.0, |last, (sum, n)| {
            *last = if n > 0.0 { sum / n } else { *last };
            Some(*last)
        });
        Self { pull, variance: variance.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::threshold::spot::SpotDetector;
    use crate::vision::threshold::{Polarity, SpotConfig};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// A Gaussian of the deviation 2.3 px.
    fn light(side: usize, at: Vector2<f64>) -> impl Fn(usize) -> f64 {
        move |i| {
            (-0.5 * (Vector2::new((i % side) as f64, (i / side) as f64) - at).norm_squared() / 2.3f64.powi(2)).exp()
        }
    }

    #[test]
    fn at_the_border_errors_are_as_large_as_is_stated() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for size_px in [DIAMETER_PER_WIDTH, 1.5].map(|part| part * WIDTH_PER_DEVIATION * 2.3) {
            let config = SpotConfig { size_px, k: 5.0, polarity: Polarity::Bright, ..SpotConfig::default() };
            let mut detector = SpotDetector::new(&config);
            let (mut found, mut squares) = (0.0, 0.0);
            for _ in 0..200 {
                let at = Vector2::new(5.0 * rng.random::<f64>(), 30.0 + rng.random::<f64>());
                let light = light(60, at);
                let pixels = (0..3600).map(|i| 30.0 * light(i) as f32 + rng.sample::<f32, _>(StandardNormal)).collect();
                let mut out = Vec::new();
                detector.detect(&Image::from_vec(60, 60, pixels).unwrap(), (1.0, 0.0), &mut out);
                let nearest = out.iter().min_by(|a, b| (a.position - at).norm().total_cmp(&(b.position - at).norm()));
                let Some(d) = nearest.filter(|d| (d.position - at).norm() < 4.0) else { continue };
                found += 1.0;
                squares += (d.position.x - at.x).powi(2) / d.cov[(0, 0)];
            }
            assert!(found > 180.0, "{found}");
            assert!((0.25..2.0).contains(&(squares / found)), "{size_px} {}", squares / found);
        }
    }
}
