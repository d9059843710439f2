//! A track's place on Earth as fields of its events: absent where nothing is known.

use boresight::world::Located;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// What is known of a track's place; written as fields `lat_deg`, `lon_deg`, .., `bearing_deg`, .. of what holds it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnEarth(pub Located);

impl Serialize for OnEarth {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some(p) = &self.0.place {
            map.serialize_entry("lat_deg", &p.latitude_deg)?;
            map.serialize_entry("lon_deg", &p.longitude_deg)?;
            if let Some(height_m) = p.height_m {
                map.serialize_entry("hae_m", &height_m)?;
            }
            map.serialize_entry("ve_m_per_s", &p.velocity_m_per_s.x)?;
            map.serialize_entry("vn_m_per_s", &p.velocity_m_per_s.y)?;
            map.serialize_entry("cov_en", &upper_triangle(|i, j| p.cov[(i, j)]))?;
        }
        if let Some(b) = &self.0.bearing {
            map.serialize_entry("bearing_deg", &b.azimuth_deg)?;
            map.serialize_entry("elevation_deg", &b.elevation_deg)?;
            map.serialize_entry("bearing_sd_deg", &b.azimuth_sd_deg)?;
            map.serialize_entry("elevation_sd_deg", &b.elevation_sd_deg)?;
        }
        map.end()
    }
}

/// The upper triangle of a 4×4 matrix, row by row.
pub fn upper_triangle(at: impl Fn(usize, usize) -> f64) -> [f64; 10] {
    let mut out = [0.0; 10];
    let entries = (0..4).flat_map(|i| (i..4).map(move |j| (i, j)));
    out.iter_mut().zip(entries).for_each(|(c, (i, j))| *c = at(i, j));
    out
}
