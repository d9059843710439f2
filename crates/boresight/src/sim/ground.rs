//! A ground without end whose texture moves with the camera, and the camera's way over it.
//!
//! Texture: value noise, as in K. Perlin, "An image synthesizer", *SIGGRAPH* 1985: numbers at the knots of a lattice, between them a
//! smooth blend; here two lattices, the second of half the length and half the height, so that every part has fine and coarse things.
//! A knot's number is a hash of its place and the seed: the ground needs no memory and is the same wherever the camera comes from.
//! Camera: `x = m + e^(zoom t) R(rotation t) (g - m) + pan t + jitter`; m is the image's middle, g the place on the ground (at t = 0 the image's).
//! Units: px, s, counts, degrees. Limits: the blend has a kink in its second derivative at the knots.

use crate::Similarity;
use nalgebra::{Vector2, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`super::scene::Background::Ground`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Ground {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation at the knots, counts, 0 or more; about 0.6 of it between them.
    pub std: f64,
    /// Distance of the coarse lattice's knots, px, 1..=1024.
    pub length_px: f64,
    /// Standard deviation of white noise on it, new in each frame, counts, 0 or more.
    pub noise_std: f64,
}

impl Default for Ground {
    fn default() -> Self {
        Self { mean: 80.0, std: 20.0, length_px: 16.0, noise_std: 2.0 }
    }
}

/// How the camera moves over the ground; it stands still by default. Its shake is `sensor.jitter-px`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CameraPathConfig {
    /// How fast the ground moves through the image, px/s.
    pub pan_px_per_s: [f64; 2],
    /// How fast the image turns, degrees/s, from +x towards +y.
    pub rotation_deg_per_s: f64,
    /// How fast lengths grow, share per second (exponentially); negative zooms out.
    pub zoom_per_s: f64,
}

impl CameraPathConfig {
    /// Whether it stands still.
    pub fn is_still(&self) -> bool {
        *self == Self::default()
    }

    /// Where the ground lies in the image at a time, with the camera's jitter (px).
    pub fn image_from_ground(&self, t_s: f64, middle_px: Vector2<f64>, jitter_px: Vector2<f64>) -> Similarity {
        let shift = Vector2::from(self.pan_px_per_s) * t_s + jitter_px;
        let angle = (self.rotation_deg_per_s * t_s).to_radians();
        Similarity::about(middle_px, shift, angle, (self.zoom_per_s * t_s).exp())
    }

    /// A state `[x, vx, y, vy]` on the ground as it is in the image; `path` is where the ground lies. Jitter has no velocity.
    pub fn state_in_image(&self, path: &Similarity, middle_px: Vector2<f64>, s: &Vector4<f64>) -> Vector4<f64> {
        let position = path.apply(Vector2::new(s[0], s[2]));
        let pan = Vector2::from(self.pan_px_per_s);
        // The ground turns and grows about where the image's middle has come to.
        let from_middle = position - path.apply(middle_px);
        let turning = self.rotation_deg_per_s.to_radians() * Vector2::new(-from_middle.y, from_middle.x);
        let growing = self.zoom_per_s * from_middle;
        let velocity = path.turn(Vector2::new(s[1], s[3])) + turning + growing + pan;
        Vector4::new(position.x, velocity.x, position.y, velocity.y)
    }
}

/// The ground's texture.
pub(super) struct Texture {
    seed: u64,
}

impl Texture {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// Brightness at a place of the ground, counts.
    pub(super) fn at(&self, g: &Ground, p: Vector2<f64>) -> f64 {
        let coarse = self.layer(0, p / g.length_px);
        let fine = self.layer(1, 2.0 * p / g.length_px);
        g.mean + g.std * (coarse + 0.5 * fine)
    }

    /// Value noise of one lattice, its knots at whole numbers.
    fn layer(&self, layer: u64, p: Vector2<f64>) -> f64 {
        let (fx, fy) = (p.x.floor(), p.y.floor());
        // Weights 10 t³ - 15 t⁴ + 6 t⁵: two derivatives vanish at the knots.
        let fade = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
        let (u, v) = (fade(p.x - fx), fade(p.y - fy));
        let (i, j) = (fx as i64, fy as i64);
        let at = |di: i64, dj: i64| knot(self.seed, layer, i + di, j + dj);
        (at(0, 0) * (1.0 - u) + at(1, 0) * u) * (1.0 - v) + (at(0, 1) * (1.0 - u) + at(1, 1) * u) * v
    }
}

/// A knot's number: uniform with variance 1, the finaliser of SplitMix64 (G. Steele et al., *OOPSLA* 2014) over its place.
fn knot(seed: u64, layer: u64, i: i64, j: i64) -> f64 {
    let mut h = seed.wrapping_add(layer.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    for word in [i as u64, j as u64] {
        h = (h ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^= h >> 31;
    }
    // 53 bits to [0, 1), then to a variance of 1.
    let uniform = (h >> 11) as f64 / (1u64 << 53) as f64;
    (uniform - 0.5) * 12f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_velocity_is_the_derivative_of_the_position() {
        let camera = CameraPathConfig { pan_px_per_s: [50.0, -20.0], rotation_deg_per_s: 25.0, zoom_per_s: 0.25 };
        let middle = Vector2::new(159.5, 119.5);
        let ground = |t: f64| Vector4::new(40.0 + 30.0 * t, 30.0, 60.0 - 10.0 * t, -10.0);
        let image = |t: f64| {
            let path = camera.image_from_ground(t, middle, Vector2::zeros());
            camera.state_in_image(&path, middle, &ground(t))
        };
        let (before, now, after) = (image(1.0 - 1e-5), image(1.0), image(1.0 + 1e-5));
        assert!(((after[0] - before[0]) / 2e-5 - now[1]).abs() < 1e-4);
        assert!(((after[2] - before[2]) / 2e-5 - now[3]).abs() < 1e-4);
    }

    #[test]
    fn the_texture_is_smooth_and_has_its_mean() {
        let (texture, ground) = (Texture::new(5), Ground::default());
        let values: Vec<f64> = (0..200 * 200)
            .map(|i| texture.at(&ground, 3.7 * Vector2::new(f64::from(i % 200), f64::from(i / 200) - 100.0)))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        // 46 x 46 coarse knots of a spread of 20: the mean is known to about 0.45.
        assert!((mean - 80.0).abs() < 2.0 && (8.0..20.0).contains(&std), "{mean} {std}");
        let near = |i: i32| texture.at(&ground, Vector2::new(0.01 * f64::from(i), 3.3));
        assert!((-3000..3000).all(|i| (near(i + 1) - near(i)).abs() < 0.3), "no jumps at the knots");
    }
}
