//! What is known of the camera's place on Earth: the configuration's table `[world]`.

use super::located::Site;
use crate::Result;
use crate::validate::{check, check_shown, not_negative, positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most points of a map: a guard of time.
const MOST_POINTS: usize = 10_000;

/// Where on Earth tracks are: by a map of the ground or by the camera's pose. The camera must stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum WorldConfig {
    /// A map from the image to a plane in metres, whose origin and direction on Earth are known.
    Plane(PlaneConfig),
    /// A map from the image to the ground, fitted to points whose latitude and longitude are known.
    Points(PointsConfig),
    /// A camera without distortion whose position, attitude and focal length are known.
    Pinhole(PinholeConfig),
}

/// A map from the image to a plane in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PlaneConfig {
    /// The map from pixels (centre of the top-left pixel: 0, 0) to metres on the plane: 9 numbers, the rows of a homography, or 6, those of an affine map. On the plane y points to the left of x, seen from above. Tracks lie on the side of its horizon that a camera above the ground sees.
    pub homography: Vec<f64>,
    /// Latitude of the plane's origin (WGS 84), degrees, -90..=90, north positive.
    pub latitude_deg: f64,
    /// Longitude of the plane's origin, degrees, -180..=180, east positive.
    pub longitude_deg: f64,
    /// Height of the plane above the ellipsoid, m; absent: unknown, and published as unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// Bearing of the plane's y axis, degrees clockwise from north, -360..=360; its x axis points 90 degrees clockwise of it. With 0 x is east and y is north.
    #[serde(default)]
    pub bearing_deg: f64,
    /// Standard deviation of the map itself, m for each of east and north, 0 or more; it adds to that of the track.
    #[serde(default)]
    pub position_sd_m: f64,
}

/// Points of the ground that are known in the image and on Earth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PointsConfig {
    /// Four points or more, not three of four on a line, each `[x (px), y (px), latitude (degrees), longitude (degrees)]`. From five on they check each other, and the residual is said.
    pub points: Vec<[f64; 4]>,
    /// Height of the ground above the ellipsoid, m; absent: unknown, and published as unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// Standard deviation of the map itself, m for each of east and north, 0 or more; absent: that of the residual (0 with four points, which leave none).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_sd_m: Option<f64>,
}

/// A camera's pose and focal length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PinholeConfig {
    /// Focal length, px, above 0: half the image's width by the tangent of half its field of view.
    pub focal_px: f64,
    /// Where the optical axis meets the image, x and y, px (centre of the top-left pixel: 0, 0); usually the image's centre.
    pub principal_point_px: [f64; 2],
    /// Latitude of the camera (WGS 84), degrees, -90..=90, north positive.
    pub latitude_deg: f64,
    /// Longitude of the camera, degrees, -180..=180, east positive.
    pub longitude_deg: f64,
    /// Height of the camera above the ellipsoid, m. Maps and receivers often say the height above the sea, which differs by up to 107 m.
    pub height_m: f64,
    /// Bearing of the optical axis, degrees clockwise from true north, -360..=360.
    pub yaw_deg: f64,
    /// Elevation of the optical axis above the horizontal plane, degrees, -90..=90; negative looks down.
    pub pitch_deg: f64,
    /// Turn about the optical axis, degrees, -360..=360; positive: the camera's right side is lower.
    #[serde(default)]
    pub roll_deg: f64,
    /// Height of the ground (or the water) above the ellipsoid, m, below the camera; targets are taken to be on it. Absent: the range is unknown, and only the direction is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_height_m: Option<f64>,
    /// Standard deviation of the camera's position, m for each of east and north, 0 or more.
    #[serde(default)]
    pub position_sd_m: f64,
    /// Standard deviation of the camera's height, m, 0 or more.
    #[serde(default)]
    pub height_sd_m: f64,
    /// Standard deviation of yaw, degrees, 0 or more.
    #[serde(default)]
    pub yaw_sd_deg: f64,
    /// Standard deviation of pitch, degrees, 0 or more. It decides how well far targets are placed.
    #[serde(default)]
    pub pitch_sd_deg: f64,
    /// Standard deviation of roll, degrees, 0 or more.
    #[serde(default)]
    pub roll_sd_deg: f64,
    /// Standard deviation of the ground's height, m, 0 or more.
    #[serde(default)]
    pub ground_height_sd_m: f64,
}

/// Lowest and highest height that is taken, m: below the deepest sea, and where satellites are.
const HEIGHTS_M: [f64; 2] = [-12_000.0, 50_000_000.0];

fn site(at: &str, latitude_deg: f64, longitude_deg: f64, height: Option<(&str, f64)>) -> Result<()> {
    let mend = "decimal degrees, north and east positive: 48.137154 and 11.576124";
    check(latitude_deg.abs() <= 90.0, at, "latitude-deg", latitude_deg, "degrees from -90 to 90", mend)?;
    check(longitude_deg.abs() <= 180.0, at, "longitude-deg", longitude_deg, "degrees from -180 to 180", mend)?;
    height.map_or(Ok(()), |(key, height_m)| {
        let ok = (HEIGHTS_M[0]..=HEIGHTS_M[1]).contains(&height_m);
        check(
            ok,
            at,
            key,
            height_m,
            "metres above the ellipsoid, from -12 km to 50 000 km",
            "leave it out if it is not known",
        )
    })
}

fn angle(at: &str, key: &str, deg: f64, most: f64) -> Result<()> {
    check(deg.abs() <= most, at, key, deg, &format!("degrees from -{most} to {most}"), "degrees, not radians")
}

impl WorldConfig {
    /// Where the camera is, if that is said.
    pub fn camera(&self) -> Option<Site> {
        match self {
            Self::Pinhole(c) => {
                Some(Site { latitude_deg: c.latitude_deg, longitude_deg: c.longitude_deg, height_m: c.height_m })
            }
            Self::Plane(_) | Self::Points(_) => None,
        }
    }

    /// Checks every value by itself; `at`: the table's name.
    /// # Errors
    /// The first value out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Plane(c) => c.validate(&format!("{at}.plane")),
            Self::Points(c) => c.validate(&format!("{at}.points")),
            Self::Pinhole(c) => c.validate(&format!("{at}.pinhole")),
        }
    }
}

impl PlaneConfig {
    fn validate(&self, at: &str) -> Result<()> {
        site(at, self.latitude_deg, self.longitude_deg, self.height_m.map(|h| ("height-m", h)))?;
        angle(at, "bearing-deg", self.bearing_deg, 360.0)?;
        not_negative(at, "position-sd-m", self.position_sd_m, "leave it out for 0")?;
        let h = &self.homography;
        let ok = matches!(h.len(), 6 | 9) && h.iter().all(|v| v.is_finite());
        check_shown(ok, at, "homography", h, "9 numbers (a homography, row by row) or 6 (an affine map)")
    }
}

impl PointsConfig {
    fn validate(&self, at: &str) -> Result<()> {
        let n = self.points.len();
        let mend = "points spread over the ground that is seen, each [x, y, latitude, longitude]";
        check((4..=MOST_POINTS).contains(&n), at, "points", format!("{n} points"), "4 to 10 000 points", mend)?;
        for p in &self.points {
            let ok = p.iter().all(|v| v.is_finite()) && p[2].abs() <= 90.0 && p[3].abs() <= 180.0;
            check_shown(ok, at, "points", p, "[x (px), y (px), latitude (-90 to 90), longitude (-180 to 180)]")?;
        }
        site(at, 0.0, 0.0, self.height_m.map(|h| ("height-m", h)))?;
        self.position_sd_m.map_or(Ok(()), |sd| not_negative(at, "position-sd-m", sd, "leave it out for the residual's"))
    }
}

impl PinholeConfig {
    fn validate(&self, at: &str) -> Result<()> {
        positive(at, "focal-px", self.focal_px, "1108 for an image of 1280 px with a field of view of 60 degrees")?;
        let centre = &self.principal_point_px;
        check_shown(centre.iter().all(|v| v.is_finite()), at, "principal-point-px", centre, "two numbers")?;
        site(at, self.latitude_deg, self.longitude_deg, Some(("height-m", self.height_m)))?;
        angle(at, "yaw-deg", self.yaw_deg, 360.0)?;
        angle(at, "pitch-deg", self.pitch_deg, 90.0)?;
        angle(at, "roll-deg", self.roll_deg, 360.0)?;
        if let Some(ground) = self.ground_height_m {
            site(at, 0.0, 0.0, Some(("ground-height-m", ground)))?;
            let expected = format!("a ground below the camera's height-m = {}", self.height_m);
            check(ground < self.height_m, at, "ground-height-m", ground, &expected, "both above the ellipsoid")?;
        }
        for (key, sd) in [
            ("position-sd-m", self.position_sd_m),
            ("height-sd-m", self.height_sd_m),
            ("yaw-sd-deg", self.yaw_sd_deg),
            ("pitch-sd-deg", self.pitch_sd_deg),
            ("roll-sd-deg", self.roll_sd_deg),
            ("ground-height-sd-m", self.ground_height_sd_m),
        ] {
            not_negative(at, key, sd, "leave it out for 0")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pinhole() -> PinholeConfig {
        let text = "focal-px = 1000\nprincipal-point-px = [639.5, 359.5]\nlatitude-deg = 48\nlongitude-deg = 11\nheight-m = 500\nyaw-deg = 10\npitch-deg = -5";
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_value_out_of_its_range_is_named_with_its_table() {
        assert!(WorldConfig::Pinhole(pinhole()).validate("world").is_ok());
        let said = |change: fn(&mut PinholeConfig)| {
            let mut c = pinhole();
            change(&mut c);
            WorldConfig::Pinhole(c).validate("world").unwrap_err().to_string()
        };
        assert!(said(|c| c.latitude_deg = 91.0).starts_with("world.pinhole.latitude-deg = 91: expected degrees"));
        assert!(said(|c| c.ground_height_m = Some(500.0)).contains("below the camera's height-m = 500"));
        assert!(said(|c| c.focal_px = 0.0).contains("world.pinhole.focal-px = 0"));
        assert!(said(|c| c.yaw_sd_deg = -1.0).contains("world.pinhole.yaw-sd-deg = -1"));
        assert!(said(|c| c.height_m = f64::NAN).contains("height-m = NaN"));
    }

    #[test]
    fn a_place_has_no_default() {
        let e = toml::from_str::<PinholeConfig>("focal-px = 1000").unwrap_err().to_string();
        assert!(e.contains("missing field"), "{e}");
    }
}
