//! How far off a centroid near the border is, since the response there is not that of the whole spot.
//!
//! Source: our own. The filter takes what lies outside the frame to be as its edge, so near the border the response is wrong in what the smoothing and the surroundings see of that. How far that moves the centroid of a Gaussian is
//! measured when the detector is built, at every half pixel from the border and for the widths that a size is chosen for; the mean square is added to the variance across the border. The width of a spot is told by how far its centroid follows its disc along the border, beside those found at the same place.
//! Limits: Gaussians whose middle is in the frame; one that lies outside is stated to be at the border. The disc is the largest: in a smaller one a centroid follows more, and the spot counts as wider.

use super::centring::centroid;
use super::disc::{DIAMETER_PER_WIDTH, fill_light};
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
    /// For each width, by how far from the border the spot is found, in steps of 1 / `STEPS` px.
    of_width: Vec<Vec<Place>>,
}

/// What spots of a width found at a place are like.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    /// How far a centroid follows its disc along the border, by which widths are told.
    pull: f64,
    /// px².
    variance: f64,
}

impl Unseen {
    /// Measures it for a size, the sides of both boxes and the radius of the disc, px.
    pub(super) fn new(size_px: f64, (smooth, surround): (usize, usize), radius: usize) -> Self {
        let scale = (size_px / MEASURED_PX).max(1.0);
        let part = |px: usize| (px as f64 / scale).round() as usize;
        let (smooth, radius) = (part(smooth) | 1, part(radius));
        let boxes = (smooth, (part(surround) | 1).max(smooth + 2));
        let of_width = WIDTHS.map(|width| places(width * size_px / scale, boxes, radius)).to_vec();
        Self { scale, of_width }
    }

    /// The variance to be added of a spot at `c` whose centroid follows its disc by that much, px².
    pub(super) fn variance_px2(
        &self,
        c: Vector2<f64>,
        pull: Vector2<f64>,
        (width, height): (usize, usize),
    ) -> Vector2<f64> {
        let of = |v: f64, size: usize, pull: f64| {
            let from_border = v.min(size as f64 - 1.0 - v).max(0.0);
            let place = (from_border / self.scale * STEPS as f64).round() as usize;
            let far = |p: &Place| (p.pull - pull).abs();
            let nearest = self.of_width.iter().filter_map(|of| of.get(place)).min_by(|a, b| far(a).total_cmp(&far(b)));
            nearest.map_or(0.0, |p| p.variance * self.scale.powi(2))
        };
        Vector2::new(of(c.x, width, pull.y), of(c.y, height, pull.x))
    }
}

/// The places of spots of a width, px, for boxes of these sides and a disc of this radius.
fn places(width_px: f64, (smooth, surround): (usize, usize), radius: usize) -> Vec<Place> {
    let far = radius + surround / 2 + smooth;
    let (middle, side) = (far as f64, 2 * far + 1);
    let mut boxes = Boxes::new(smooth, surround);
    let (mut light, mut response) = (Image::filled(side, side, 0.0f32), Image::default());
    let profile = |from: f64| (-0.5 * (WIDTH_PER_DEVIATION / width_px * from).powi(2)).exp();
    let column: Vec<f64> = (0..side).map(|y| profile(y as f64 - middle)).collect();
    // Sums, and of how many.
    let mut sums = vec![(Place::default(), 0.0); far * STEPS + 1];
    // From the edge of the outermost pixels on.
    for at in (0..=far * STEPS).map(|i| i as f64 / STEPS as f64 - 0.5) {
        let row: Vec<f64> = (0..side).map(|x| profile(x as f64 - at)).collect();
        fill_light(&mut light, &row, &column);
        boxes.run(&light, &mut response);
        let found = centroid(&response, radius, Vector2::new(at.round().max(0.0), middle));
        let place = (found.position.x * STEPS as f64).round().clamp(0.0, (far * STEPS) as f64) as usize;
        let (sum, n) = &mut sums[place];
        sum.pull += found.pull.y;
        sum.variance += (found.position.x - at).powi(2);
        *n += 1.0;
    }
    // Where none was found it is as farther out.
    let means = sums.into_iter().scan(Place::default(), |last, (sum, n)| {
        *last = if n > 0.0 { Place { pull: sum.pull / n, variance: sum.variance / n } } else { *last };
        Some(*last)
    });
    means.collect()
}

#[cfg(test)]
mod tests {
    use super::super::border::tests::light;
    use super::*;
    use crate::vision::threshold::spot::SpotDetector;
    use crate::vision::threshold::{Polarity, SpotConfig};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn at_the_border_errors_are_as_large_as_is_stated() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for size_px in [DIAMETER_PER_WIDTH, 1.5, 1.0].map(|part| part * WIDTH_PER_DEVIATION * 2.3) {
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
