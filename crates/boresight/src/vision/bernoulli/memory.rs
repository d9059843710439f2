//! How much memory the density of a frame takes, and how fast targets may be for it.
//!
//! Source: counted. Each place, velocity, strength and sign takes 4 bytes: two numbers of 16 bits, of this frame and of the next. Limits: what is kept of a frame beside it is not counted, some
//! 40 bytes a place.

use super::config::BernoulliConfig;
use super::density::{Motion, apart};
use super::likelihood::STRENGTHS;
use super::shape::Profile;
use super::whitened::step_of;

/// Most places, velocities, strengths and signs of a frame: 512 MB.
const MOST_CELLS: usize = 1 << 27;

/// Velocities along both axes that frames of a size leave room for.
fn velocities(config: &BernoulliConfig, (width, height): (usize, usize)) -> usize {
    let step = step_of(&Profile::new(config));
    let places = width.div_ceil(step).saturating_mul(height.div_ceil(step)).max(1);
    MOST_CELLS / places.saturating_mul(2 * STRENGTHS.len())
}

/// Whether frames of that size take no more memory than is allowed.
pub(super) fn fits(config: &BernoulliConfig, size: (usize, usize)) -> bool {
    let along = Motion::new(config, step_of(&Profile::new(config))).count();
    along.saturating_mul(along) <= velocities(config, size)
}

/// The largest speed along an axis, px/s, at most the one asked for, with which frames of that size fit, or the least there is.
pub(crate) fn speed_that_fits(config: &BernoulliConfig, size: (usize, usize)) -> f64 {
    let each_way = velocities(config, size).isqrt().saturating_sub(1) / 2;
    // A hair less, so that so many steps do not round up to one more.
    config.max_speed_px_per_s.min(each_way.max(1) as f64 * apart(config) * (1.0 - 1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_speed_that_fits_is_the_largest_that_does() {
        let config = BernoulliConfig { max_speed_px_per_s: 1e4, ..Default::default() };
        for (width, height) in [(64, 64), (320, 256), (640, 512), (1920, 1080)] {
            let speed = speed_that_fits(&config, (width, height));
            let of = |max_speed_px_per_s| BernoulliConfig { max_speed_px_per_s, ..config.clone() };
            assert!(fits(&of(speed), (width, height)), "{width} x {height}: {speed}");
            assert!(!fits(&of(speed + apart(&config)), (width, height)), "{width} x {height}: {speed}");
        }
        // Not even one velocity each way: the least there is, which is refused when it is built.
        let speed = speed_that_fits(&config, (7680, 4320));
        assert!(speed > 0.0 && !fits(&BernoulliConfig { max_speed_px_per_s: speed, ..config }, (7680, 4320)));
    }
}
