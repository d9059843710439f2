//! The motion of the scene's plane from frame to frame: patches looked for where the last motion goes on, else all over.
//!
//! Source: our own; parts in [`super::register`] and [`super::wide_search`].
//! Limits: those of its parts; nothing is bridged: a frame that cannot be followed is said to be so, and the next begins anew.

use super::register::{PlanePatches, Registration};
use super::wide_search::WideSearch;
use crate::{Homography, Image};

/// Follows the plane of a sequence of images of one size.
#[derive(Clone, Debug, Default)]
pub struct PlaneFollower {
    last: Image<f32>,
    last_patches: PlanePatches,
    patches: PlanePatches,
    wide: WideSearch,
    motion: Homography,
    started: bool,
}

impl PlaneFollower {
    /// Whether an image was seen.
    pub fn has_started(&self) -> bool {
        self.started
    }

    /// Where the plane of the last image lies in `now`; `None` at the first one and where it cannot be followed. [`Self::keep`] ends the step.
    pub fn step(&mut self, now: &Image<f32>) -> Option<Registration> {
        self.patches.choose(now);
        if !std::mem::replace(&mut self.started, true) {
            return None;
        }
        let found = self.look(now);
        self.motion = found.map_or(Homography::identity(), |f| f.to_from);
        found
    }

    fn look(&mut self, now: &Image<f32>) -> Option<Registration> {
        let near = self.last_patches.register(&self.last, now, &self.motion);
        if near.is_some_and(|r| r.is_clear()) {
            return near;
        }
        let rough = self.wide.look(&self.last, now);
        let looked = rough.and_then(|rough| self.last_patches.register(&self.last, now, &rough));
        // A plane through many patches is a better one, then one that they lie close to.
        let worth = |r: &Registration| r.found / r.spread_px.max(0.05);
        near.into_iter().chain(looked).filter(|r| !r.is_lost()).max_by(|a, b| worth(a).total_cmp(&worth(b)))
    }

    /// The patches of the image of the last step.
    pub(crate) fn patches(&self) -> &PlanePatches {
        &self.patches
    }

    /// Takes the image of the last step over; another one is given in exchange.
    pub fn keep(&mut self, now: &mut Image<f32>) {
        std::mem::swap(&mut self.last, now);
        std::mem::swap(&mut self.last_patches, &mut self.patches);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const SIZE: [usize; 2] = [480, 360];

    /// Waves of many lengths and directions with noise of 2 counts, and a fifth of the image that moves by itself.
    fn view(waves: &[[f64; 4]], ground: &Homography, astray_px: f64, rng: &mut ChaCha8Rng) -> Image<f32> {
        let mut image = Image::filled(SIZE[0], SIZE[1], 0.0f32);
        for y in 0..SIZE[1] {
            for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                let mut p = ground.apply(Vector2::new(x as f64, y as f64));
                if (100.0..320.0).contains(&p.x) && (80.0..240.0).contains(&p.y) {
                    p.x += astray_px;
                }
                let value: f64 = waves.iter().map(|[a, kx, ky, phase]| a * (kx * p.x + ky * p.y + phase).sin()).sum();
                let noise: f64 = StandardNormal.sample(rng);
                *v = (120.0 + value + 2.0 * noise) as f32;
            }
        }
        image
    }

    #[test]
    fn pans_turns_zooms_and_tilts_are_followed_to_a_twentieth_of_a_pixel_beside_what_moves() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut errors = Vec::new();
        for k in 0..24 {
            let waves: Vec<[f64; 4]> = (0..40)
                .map(|_| {
                    let (a, angle) = (6.0 * rng.random::<f64>(), std::f64::consts::TAU * rng.random::<f64>());
                    let wave = 0.05 + 0.6 * rng.random::<f64>();
                    [a, wave * angle.cos(), wave * angle.sin(), std::f64::consts::TAU * rng.random::<f64>()]
                })
                .collect();
            let mut any = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
            // Up to 12 px, 1 degree, 1 % and a perspective of 1 % over the image.
            let (dx, dy, turn, zoom, tilt) = (any(12.0), any(12.0), any(0.017), 1.0 + any(0.01), any(2e-5));
            let (c, s) = (zoom * turn.cos(), zoom * turn.sin());
            let about = |x: f64, y: f64| Matrix3::new(1.0, 0.0, x, 0.0, 1.0, y, 0.0, 0.0, 1.0);
            let linear = Matrix3::new(c, -s, 0.0, s, c, 0.0, tilt, -0.5 * tilt, 1.0);
            let truth = Homography::of_matrix(about(240.0 + dx, 180.0 + dy) * linear * about(-240.0, -180.0)).unwrap();
            let mut follower = PlaneFollower::default();
            let mut first = view(&waves, &Homography::identity(), 0.0, &mut rng);
            assert!(follower.step(&first).is_none());
            follower.keep(&mut first);
            let now = view(&waves, &truth.inverse(), if k % 2 == 0 { 3.0 } else { 0.0 }, &mut rng);
            let found = follower.step(&now).expect("a textured plane");
            for (x, y) in [(20.0, 20.0), (460.0, 20.0), (20.0, 340.0), (460.0, 340.0), (240.0, 180.0)] {
                let p = Vector2::new(x, y);
                errors.push((found.to_from.apply(p) - truth.apply(p)).norm());
            }
        }
        errors.sort_by(f64::total_cmp);
        let at = |q: f64| errors[(q * (errors.len() - 1) as f64) as usize];
        println!("error px: median {:.3}, 95 % {:.3}, largest {:.3}", at(0.5), at(0.95), at(1.0));
        assert!(at(0.5) <= 0.05 && at(0.95) <= 0.2, "{:.3} {:.3}", at(0.5), at(0.95));
    }

    #[test]
    fn another_picture_is_not_followed() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || {
            let values = (0..SIZE[0] * SIZE[1]).map(|_| rng.random::<f32>() * 100.0).collect();
            Image::from_vec(SIZE[0], SIZE[1], values).unwrap()
        };
        let (mut one, other) = (noise(), noise());
        let mut follower = PlaneFollower::default();
        follower.step(&one);
        follower.keep(&mut one);
        assert!(follower.step(&other).is_none());
    }
}
