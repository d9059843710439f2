//! What a target looks like along an axis, the same along both, and what follows from it for the detector.
//!
//! A target matched to its own profile P (both axes alike, P(x) P(y)) shows a place d beside it by the autocorrelation, ρ(d) = ∫ P(u) P(u + d) du / ∫ P². With P = 1 at its peak:
//! a spot, exp(−u²/2σ²): ρ = exp(−d²/4σ²), ∫ P = √(2π) σ, ∫ P² = √π σ; a square of the side L, 1 within ±L/2: ρ = 1 − |d|/L and 0 from L on, ∫ P = ∫ P² = L.
//! What a distance does to the detector is what is lost of the target over it. So whatever is k σ for a spot is for any profile the distance at which it shows
//! as much as a spot does there: ρ(d) = exp(−k²/4); of a square d = L (1 − exp(−k²/4)), its edges make it finer than a spot of the same width. With that:
//! the resolution δ (k = 1; σ, or 0.221 L) is what white acceleration of the density q moves it by in a straight time, q T³ / 3 = δ²; velocities lie 2 δ / T apart, so that half of that for T is δ;
//! a cell loses at its rim what a spot does at 0.6 σ; and so for boxes, light and twins, by their own k. Mixing between velocities has p = q dt / (2 δ / T)² as for a spot: it
//! is the walk's own variance, whatever the target looks like.
//! Height: a frame matched to P of unit energy shows a height A as A (∫ P²) of both axes' root, √π σ or L. Surroundings: a target takes (∫ P)⁴ / (∫ P²)² / area of its own energy out with the mean
//! around it: for the same share the half side is in proportion to (∫ P)² / ∫ P², 2 √π σ or L.
//! Limits: targets whose axes differ, or whose edges turn against the pixels, lose as their overlap does.

use super::config::{BernoulliConfig, TargetShape};
use crate::vision::gaussian::WIDTH_PER_DEVIATION;
use crate::vision::matched::{half_surround, kernel, unit_energy};
use nalgebra::Vector2;

/// A target's profile along an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    shape: TargetShape,
    /// σ of a spot, side of a square; px or cells.
    size: f64,
}

impl Profile {
    /// The one that is looked for, px.
    pub(super) const fn new(config: &BernoulliConfig) -> Self {
        let size = match config.shape {
            TargetShape::Spot => config.sigma_px,
            TargetShape::Square => config.side_px,
        };
        Self { shape: config.shape, size }
    }

    /// The same in units of that many.
    pub(super) fn in_cells(self, step: usize) -> Self {
        Self { size: self.size / step as f64, ..self }
    }

    /// Pixels of the profile along an axis, Σ P² = 1, an odd number of them.
    pub(super) fn kernel(&self) -> Vec<f32> {
        match self.shape {
            TargetShape::Spot => kernel(self.size),
            TargetShape::Square => {
                let half = 0.5 * self.size;
                let radius = (half - 0.5).ceil().max(0.0) as i64;
                // What of a pixel is within.
                unit_energy((-radius..=radius).map(|i| (half + 0.5 - (i as f64).abs()).clamp(0.0, 1.0)))
            }
        }
    }

    /// Part of its peak that it shows at an offset in the matched frame.
    #[inline]
    pub(super) fn shows(&self, d: Vector2<f64>) -> f64 {
        match self.shape {
            TargetShape::Spot => (-0.25 * d.norm_squared() / (self.size * self.size)).exp(),
            TargetShape::Square => {
                let along = |d: f64| (1.0 - d.abs() / self.size).max(0.0);
                along(d.x) * along(d.y)
            }
        }
    }

    /// Distance along an axis at which it shows what a spot does at `k` σ.
    pub(super) fn reach(&self, k: f64) -> f64 {
        match self.shape {
            TargetShape::Spot => k * self.size,
            TargetShape::Square => self.size * (1.0 - shown_at(k)),
        }
    }

    /// Distance by which one has to move to be told from itself.
    pub(super) fn resolution(&self) -> f64 {
        self.reach(1.0)
    }

    /// Half side of the square around whose mean is taken out, px.
    pub(super) fn half_surround(&self) -> usize {
        half_surround(match self.shape {
            TargetShape::Spot => self.size,
            // The spot whose 2 √π σ is the side.
            TargetShape::Square => 0.5 * self.size / std::f64::consts::PI.sqrt(),
        })
    }

    /// Peak in the matched frame of one of the height 1.
    pub(super) fn root_energy(&self) -> f64 {
        match self.shape {
            TargetShape::Spot => std::f64::consts::PI.sqrt() * self.size,
            TargetShape::Square => self.size,
        }
    }

    /// Sum over all of one of the height 1.
    pub(super) fn light(&self) -> f64 {
        match self.shape {
            TargetShape::Spot => std::f64::consts::TAU * self.size * self.size,
            TargetShape::Square => self.size * self.size,
        }
    }

    /// Width at half height.
    pub(super) fn width(&self) -> f64 {
        match self.shape {
            TargetShape::Spot => WIDTH_PER_DEVIATION * self.size,
            TargetShape::Square => self.size,
        }
    }

    /// Area at half height.
    pub(super) fn area(&self) -> f64 {
        let square = self.width() * self.width();
        match self.shape {
            TargetShape::Spot => std::f64::consts::FRAC_PI_4 * square,
            TargetShape::Square => square,
        }
    }
}

/// For how long a path is straight to within the resolution, s: where white acceleration of the density q moves a target by it, q T³ / 3 = δ².
pub(super) fn straight_s(config: &BernoulliConfig) -> f64 {
    let moved = Profile::new(config).resolution();
    (3.0 * moved * moved / config.acceleration_density_px2_per_s3).cbrt()
}

/// What a spot shows at `k` σ.
pub(super) fn shown_at(k: f64) -> f64 {
    (-0.25 * k * k).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profiles() -> [Profile; 4] {
        let of = |shape, size| Profile { shape, size };
        [
            of(TargetShape::Spot, 1.3),
            of(TargetShape::Spot, 3.9),
            of(TargetShape::Square, 9.0),
            of(TargetShape::Square, 6.6),
        ]
    }

    #[test]
    fn what_is_shown_is_the_correlation_of_the_pixels_with_the_profile_moved() {
        for profile in profiles() {
            let kernel = profile.kernel();
            assert!((kernel.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5 && kernel.len() % 2 == 1);
            for lag in 0..kernel.len() {
                let sum: f32 = kernel.iter().zip(&kernel[lag..]).map(|(a, b)| a * b).sum();
                let shows = profile.shows(Vector2::new(lag as f64, 0.0));
                // A side that ends within a pixel is a trapezium there: of 6.6 px Σ P² is 6.28, 5 % less.
                assert!((f64::from(sum) - shows).abs() < 0.05, "{profile:?} at {lag}: {sum} {shows}");
            }
        }
    }

    #[test]
    fn a_path_is_straight_for_as_long_as_white_acceleration_moves_it_by_less_than_the_resolution() {
        let c = BernoulliConfig { sigma_px: 2.0, acceleration_density_px2_per_s3: 12.0, ..Default::default() };
        assert!((straight_s(&c) - 1.0).abs() < 1e-12);
        let side_px = 2.0 / (1.0 - (-0.25f64).exp());
        let c = BernoulliConfig { shape: TargetShape::Square, side_px, ..c };
        assert!((straight_s(&c) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn at_its_reach_each_shows_what_a_spot_does() {
        for profile in profiles() {
            for k in [0.6, 1.0, 1.5, 2.0, 3.0, 6.0] {
                let shown = profile.shows(Vector2::new(profile.reach(k), 0.0));
                assert!((shown - (-k * k / 4.0).exp()).abs() < 1e-12, "{profile:?} {k}");
            }
        }
        let square = profiles()[2];
        assert!((square.resolution() - 9.0 * 0.221_199).abs() < 1e-4);
    }

    #[test]
    fn energy_and_light_are_the_sums_over_the_pixels_of_a_target_of_height_one() {
        for profile in profiles() {
            let kernel = profile.kernel();
            // A separable one of height 1: kernel over its peak, along both axes.
            let peak = f64::from(kernel[kernel.len() / 2]);
            let sum = kernel.iter().map(|v| f64::from(*v)).sum::<f64>() / peak;
            let root_energy = 1.0 / (peak * peak);
            // Ends of a side within a pixel hold their share squared.
            assert!((profile.root_energy() / root_energy - 1.0).abs() < 0.07, "{profile:?} {root_energy}");
            assert!((profile.light() / (sum * sum) - 1.0).abs() < 0.01, "{profile:?} {sum}");
            // The mean around takes the same share of each out, 4 π σ² of 16 σ squared.
            let side = (2 * profile.half_surround() + 1) as f64;
            let share = sum * sum * sum * sum / (root_energy * root_energy) / (side * side);
            assert!((0.03..0.051).contains(&share), "{profile:?}: {share}");
        }
    }
}
