//! From a configuration to what places tracks: by a map of the ground, or by the camera's pose.

use super::config::WorldConfig;
use super::flat::Flat;
use super::located::Located;
use super::pinhole::Pinhole;
use crate::Result;
use boresight_filters::Gaussian;

#[derive(Clone, Debug)]
enum Way {
    Flat(Flat),
    Pinhole(Box<Pinhole>),
}

/// Places tracks on Earth.
///
/// ```
/// use boresight::{Config, world::World};
/// # use boresight_filters::{Gaussian, nalgebra::{Matrix4, Vector4}};
/// # fn main() -> boresight::Result<()> {
/// let config = Config::from_toml(
///     "[world.pinhole]
///      focal-px = 1000
///      principal-point-px = [639.5, 359.5]
///      latitude-deg = 48.0
///      longitude-deg = 11.0
///      height-m = 530
///      yaw-deg = 90            # looks east
///      pitch-deg = -45         # half down
///      ground-height-m = 500",
///     "example",
/// )?;
/// let world = World::new(config.world.as_ref().unwrap())?;
/// let belief = Gaussian { mean: Vector4::new(639.5, 0.0, 359.5, 0.0), cov: Matrix4::identity() };
/// let place = world.locate(&belief).place.unwrap();
/// assert!((place.longitude_deg - 11.0004).abs() < 1e-5); // 30 m east
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct World {
    way: Way,
    says: String,
}

impl World {
    /// Takes what is known of the camera.
    /// # Errors
    /// A value out of its range, a map without an inverse, points that do not determine one.
    pub fn new(config: &WorldConfig) -> Result<Self> {
        config.validate("world")?;
        let of = |way, says: &str| Self { way, says: says.to_string() };
        Ok(match config {
            WorldConfig::Plane(c) => of(Way::Flat(Flat::of_plane(c)?), "Places on Earth: by the map of a plane."),
            WorldConfig::Points(c) => {
                let (flat, rms_m) = Flat::of_points(c)?;
                let n = c.points.len();
                let residual = match n {
                    4 => "which leave no residual: nothing checks them".to_string(),
                    _ => format!("which deviate from it by {rms_m:.2} m (root mean square)"),
                };
                of(Way::Flat(flat), &format!("Places on Earth: by a map of the ground through {n} points, {residual}."))
            }
            WorldConfig::Pinhole(c) => {
                let says = match c.ground_height_m {
                    Some(h) => format!("Places on Earth: by the camera's pose, on ground {h} m above the ellipsoid."),
                    None => {
                        "Places on Earth: by the camera's pose, directions only: no ground-height-m is given.".into()
                    }
                };
                of(Way::Pinhole(Box::new(Pinhole::new(c))), &says)
            }
        })
    }

    /// What is known of a belief `[x, vx, y, vy]` (px, px/s; covariance 4×4): nothing where the map does not reach, a direction alone above the horizon.
    pub fn locate(&self, belief: &Gaussian<4>) -> Located {
        match &self.way {
            Way::Flat(flat) => flat.locate(belief),
            Way::Pinhole(pinhole) => pinhole.locate(belief),
        }
    }

    /// A sentence for people: how places are found, and how well the map fits its points.
    pub fn says(&self) -> &str {
        &self.says
    }
}
