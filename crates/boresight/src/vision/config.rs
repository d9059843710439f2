//! What a detector is made from: filter, threshold, clusters, centroid, noise; every choice is an enum, matched once a frame.
//!
//! Every struct checks itself with `validate(at)`, where `at` is the path of the key (`detector`), so that errors name the
//! line a user wrote.

use super::fit::FitConfig;
use super::spatial::SpatialConfig;
use super::threshold::ThresholdConfig;
use super::window::FollowConfig;
use crate::Result;
use crate::camera::CameraConfig;
use crate::validate::wrong;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// How frames become detections.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DetectorConfig {
    /// Smoothing before the threshold; centroids are taken from the smoothed frame too.
    pub filter: SpatialConfig,
    /// Which pixels belong to targets.
    pub threshold: ThresholdConfig,
    /// How pixels are joined to clusters, and which clusters are kept.
    pub cluster: ClusterConfig,
    /// How a cluster's position is computed.
    pub centroid: CentroidConfig,
    /// How the noise of one pixel is known; it sets the covariance of the centroids.
    pub noise: NoiseConfig,
    /// Whether the camera's motion is followed, so that tracks live on steady ground.
    pub camera: CameraConfig,
    /// Whether a frame is looked at that shows the picture before once more, to the last pixel or to the few counts that a codec leaves, as behind a shutter, of a link that stalls, or where 30 frames are made of 25. If not, tracks coast in it, for 2 s of a
    /// picture that stands; as long as not more than a sixteenth of the pixels has ever changed, as in pictures without noise, it is looked at in any case.
    pub look_at_repeated: bool,
    /// Follow a single target: only the largest cluster in a window around the predicted place is kept. Absent: all are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub follow: Option<FollowConfig>,
    /// Most detections kept in a frame, those with the largest score; no limit if absent. Range 1...
    /// Protects what follows from a threshold that floods it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_detections: Option<u32>,
}

/// How set pixels are joined and which clusters are kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ClusterConfig {
    /// Proximity distance d_p, px, above 0 and at most 1000: pixels nearer than this are of one cluster. 2 joins the 8
    /// neighbours; larger values bridge gaps and join neighbouring targets.
    pub distance_px: f64,
    /// Whether pixels exactly `distance-px` apart are joined too (`<=` instead of `<`).
    pub inclusive: bool,
    /// Smallest cluster kept, px. If absent: 0.35 of `target-size-px`'s area, or 1 without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_area_px: Option<u32>,
    /// Largest cluster kept, px. If absent: 1.6 of `target-size-px`'s area, or no limit without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_area_px: Option<u32>,
    /// Width and height of the target, px, from which absent area limits follow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_size_px: Option<[f64; 2]>,
    /// Things that touch are cut apart where the neck between them is narrower than this share of the narrower one's width, in (0, 1]; a thing that is cut off holds a disc of the smallest area kept.
    /// Larger also cuts what only narrows. For clusters of 8 neighbours. Absent: clusters stay whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neck: Option<f64>,
}

impl Default for ClusterConfig {
    fn default() -> Self {
        Self {
            distance_px: 2.0,
            inclusive: false,
            min_area_px: None,
            max_area_px: None,
            target_size_px: None,
            neck: None,
        }
    }
}

impl ClusterConfig {
    /// Whether a pixel is joined to its 8 neighbours and to no other.
    fn joins_eight(&self) -> bool {
        let joins = |d: f64| d < self.distance_px || (self.inclusive && d == self.distance_px);
        joins(SQRT_2) && !joins(2.0)
    }

    /// Returns the smallest and largest area kept, px.
    pub fn area_limits(&self) -> (u32, u32) {
        let area = self.target_size_px.map(|[w, h]| w * h);
        // A cast of a float saturates, so absurd sizes end as u32::MAX.
        let min = self.min_area_px.unwrap_or_else(|| area.map_or(1, |a| (0.35 * a).ceil() as u32));
        let max = self.max_area_px.unwrap_or_else(|| area.map_or(u32::MAX, |a| (1.6 * a).floor() as u32));
        (min, max)
    }
}

/// How a cluster's position is computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CentroidConfig {
    /// Over which pixels.
    pub method: CentroidMethod,
    /// With which weight a pixel counts.
    pub weight: Weight,
    /// Standard deviation added to each axis, px, 0...: what the pixel noise does not explain (a target whose shape
    /// changes, a codec). 0 gives the covariance from the pixels' noise alone.
    pub extra_sd_px: f64,
    /// Fit a spot around each detection, on the frame as it came; its position and covariance replace the centroid's. Absent: none is fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<FitConfig>,
}

/// Over which pixels a centroid is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CentroidMethod {
    /// The cluster's own pixels, weighted.
    #[default]
    Mask,
    /// The cluster's own pixels, each with weight 1.
    Binary,
    /// All pixels of the cluster's bounding rectangle, weighted.
    Bbox,
    /// The middle of the bounding rectangle.
    BoxCentre,
}

/// The weight of a pixel in a centroid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weight {
    /// What suits the threshold: `intensity` for a band, a bright level and Otsu, `above-background` for the others.
    #[default]
    Auto,
    /// The pixel's value I.
    Intensity,
    /// The distance from the local background: I - b for bright targets, b - I for dark ones.
    AboveBackground,
}

/// How the noise of one pixel is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseConfig {
    /// Estimated in every frame from the differences of neighbouring pixels (robust, so edges and targets count little).
    #[default]
    Estimated,
    /// Given: variance = `read-counts`² + `gain` x (intensity - `offset-counts`); `boresight sensor INPUT` measures all three.
    Given(GivenNoise),
}

/// The known noise of one pixel: variance = read-counts² + gain x (intensity - offset-counts).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GivenNoise {
    /// Standard deviation that does not depend on the light, counts, 0... .
    pub read_counts: f64,
    /// Variance per count of intensity (shot noise), counts, 0... .
    pub gain: f64,
    /// Intensity without light, from which the intensity is counted, counts.
    pub offset_counts: f64,
}

impl Default for GivenNoise {
    fn default() -> Self {
        Self { read_counts: 1.0, gain: 0.0, offset_counts: 0.0 }
    }
}

impl DetectorConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        self.filter.validate(&format!("{at}.filter"))?;
        self.threshold.validate(&format!("{at}.threshold"))?;
        self.cluster.validate(&format!("{at}.cluster"))?;
        self.centroid.validate(&format!("{at}.centroid"))?;
        self.noise.validate(&format!("{at}.noise"))?;
        if let Some(follow) = &self.follow {
            follow.validate(&format!("{at}.follow"))?;
        }
        if self.max_detections == Some(0) {
            return Err(wrong(at, "max-detections", 0, "at least 1", "leave it out for no limit"));
        }
        Ok(())
    }
}

impl DetectorConfig {
    /// Keys that stand at another value than their default although the way of finding (`threshold`) does not look at them.
    ///
    /// ```
    /// use boresight::Config;
    /// let config = Config::from_toml("[detector]\nthreshold.cfar = {}\ncluster.min-area-px = 4", "example")?;
    /// assert_eq!(config.detector.unused_keys(), ["detector.cluster.min-area-px"]);
    /// # Ok::<(), boresight::Error>(())
    /// ```
    pub fn unused_keys(&self) -> Vec<&'static str> {
        let usual = Self::default();
        let (joined, as_usual) = (&self.cluster, &usual.cluster);
        let joining = [
            ("detector.cluster.distance-px", joined.distance_px != as_usual.distance_px),
            ("detector.cluster.inclusive", joined.inclusive != as_usual.inclusive),
            ("detector.cluster.neck", joined.neck.is_some()),
        ];
        let areas = [
            ("detector.cluster.min-area-px", joined.min_area_px.is_some()),
            ("detector.cluster.max-area-px", joined.max_area_px.is_some()),
            ("detector.cluster.target-size-px", joined.target_size_px.is_some()),
        ];
        let method = ("detector.centroid.method", self.centroid.method != usual.centroid.method);
        let weight = ("detector.centroid.weight", self.centroid.weight != usual.centroid.weight);
        // A fit takes the noise from there, whatever finds the targets.
        let noise = ("detector.noise", self.noise != usual.noise && self.centroid.fit.is_none());
        let fit = ("detector.centroid.fit", self.centroid.fit.is_some());
        let sheds = matches!(&self.noise, NoiseConfig::Given(g) if g.gain != 0.0);
        let shot_noise = ("detector.noise.given.gain", sheds && self.centroid.fit.is_none());
        let unused = match self.threshold {
            ThresholdConfig::Band(_)
            | ThresholdConfig::Level(_)
            | ThresholdConfig::Otsu(_)
            | ThresholdConfig::Local(_)
            | ThresholdConfig::Moving(_)
            | ThresholdConfig::Difference(_)
            | ThresholdConfig::Steadied(_)
            | ThresholdConfig::Colour(_) => Vec::new(),
            ThresholdConfig::Isolated(_) => [&joining[..], &[weight, shot_noise]].concat(),
            ThresholdConfig::Spot(_) => [&joining[..], &areas, &[method, weight]].concat(),
            ThresholdConfig::Cfar(_) => [&joining[..], &areas, &[method, weight, noise]].concat(),
            ThresholdConfig::Integrate(_) | ThresholdConfig::Bernoulli(_) => {
                let noise = ("detector.noise", self.noise != usual.noise);
                [&joining[..], &areas, &[method, weight, fit, noise]].concat()
            }
        };
        unused.into_iter().filter(|(_, is_set)| *is_set).map(|(key, _)| key).collect()
    }
}

impl ClusterConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(self.distance_px > 0.0 && self.distance_px <= 1000.0) {
            return Err(wrong(
                at,
                "distance-px",
                self.distance_px,
                "a distance above 0 and at most 1000 px",
                "2 joins the 8 neighbours of a pixel",
            ));
        }
        if let Some(size) = self.target_size_px
            && !size.iter().all(|s| *s >= 1.0 && s.is_finite())
        {
            return Err(wrong(
                at,
                "target-size-px",
                format!("{size:?}"),
                "a width and a height of at least 1 px",
                "[9, 9] for a target of 9 x 9 pixels",
            ));
        }
        if let Some(neck) = self.neck {
            if !(neck > 0.0 && neck <= 1.0) {
                let expected = "a share above 0 and at most 1";
                return Err(wrong(
                    at,
                    "neck",
                    neck,
                    expected,
                    "0.5 cuts at necks of half the width; leave it out to cut nothing",
                ));
            }
            if !self.joins_eight() {
                let expected = "a distance that joins the 8 neighbours of a pixel and no more, where clusters are cut at their necks";
                return Err(wrong(at, "distance-px", self.distance_px, expected, "2, or leave out neck"));
            }
        }
        let (min, max) = self.area_limits();
        if min > max || max == 0 {
            return Err(wrong(
                at,
                "min-area-px",
                min,
                &format!("at most the largest area, {max} px, and that above 0"),
                "lower min-area-px or raise max-area-px",
            ));
        }
        Ok(())
    }
}

impl CentroidConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(self.extra_sd_px >= 0.0 && self.extra_sd_px.is_finite()) {
            return Err(wrong(
                at,
                "extra-sd-px",
                self.extra_sd_px,
                "a standard deviation of 0 px or more",
                "0 leaves the covariance from the pixels' noise alone",
            ));
        }
        if let Some(fit) = &self.fit {
            fit.validate(&format!("{at}.fit"))?;
        }
        Ok(())
    }
}

impl NoiseConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let Self::Given(g) = self else { return Ok(()) };
        for (key, value) in [("given.read-counts", g.read_counts), ("given.gain", g.gain)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(wrong(at, key, value, "0 or more", "noise = \"estimated\" measures it in every frame"));
            }
        }
        if !g.offset_counts.is_finite() {
            return Err(wrong(at, "given.offset-counts", g.offset_counts, "a number", "0 where black is 0"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_of_zero_is_refused_with_its_place_and_a_hint() {
        let mut config = DetectorConfig::default();
        config.cluster.distance_px = 0.0;
        let e = config.validate("detector").unwrap_err().to_string();
        assert!(e.starts_with("detector.cluster.distance-px = 0: expected a distance above 0"), "{e}");
        assert!(e.contains("hint: 2 joins"), "{e}");
    }

    #[test]
    fn keys_that_a_way_of_finding_does_not_look_at_are_named() {
        let unused = |threshold: &str, more: &str| {
            let config: DetectorConfig = toml::from_str(&format!("threshold.{threshold} = {{}}\n{more}")).unwrap();
            config.unused_keys()
        };
        let all = "cluster = { distance-px = 3.0, inclusive = true, min-area-px = 2 }\n\
                   centroid = { method = 'bbox', weight = 'intensity' }\nnoise.given = { gain = 1.0 }";
        let [distance, inclusive, area] =
            ["detector.cluster.distance-px", "detector.cluster.inclusive", "detector.cluster.min-area-px"];
        let [method, weight] = ["detector.centroid.method", "detector.centroid.weight"];
        assert_eq!(unused("isolated", all), [distance, inclusive, weight, "detector.noise.given.gain"]);
        assert_eq!(unused("spot", all), [distance, inclusive, area, method, weight]);
        for threshold in ["cfar", "integrate"] {
            assert_eq!(unused(threshold, all), [distance, inclusive, area, method, weight, "detector.noise"]);
        }
        for threshold in ["band", "level", "otsu", "local", "moving", "difference"] {
            assert!(unused(threshold, all).is_empty(), "{threshold}");
        }
        assert_eq!(unused("integrate", "centroid.fit = {}"), ["detector.centroid.fit"]);
        assert!(unused("cfar", "centroid.fit = {}\nnoise.given = { gain = 1.0 }").is_empty());
        for threshold in ["isolated", "spot", "cfar", "integrate"] {
            assert!(unused(threshold, "centroid.extra-sd-px = 0.1\nmax-detections = 5").is_empty(), "{threshold}");
        }
    }

    #[test]
    fn absent_area_limits_follow_from_the_targets_size() {
        // docs/theory/segmentation.md: a 9 x 9 target keeps 29..=129 pixels.
        let config = ClusterConfig { target_size_px: Some([9.0, 9.0]), ..Default::default() };
        assert_eq!(config.area_limits(), (29, 129));
        assert_eq!(ClusterConfig::default().area_limits(), (1, u32::MAX));
    }

    #[test]
    fn a_neck_is_a_share_and_asks_for_clusters_of_eight_neighbours() {
        let check = |neck, distance_px, inclusive| {
            let config = ClusterConfig { neck: Some(neck), distance_px, inclusive, ..Default::default() };
            config.validate("cluster").map_err(|e| e.to_string())
        };
        assert!(check(0.7, 2.0, false).is_ok() && check(1.0, 1.5, true).is_ok());
        for neck in [0.0, 1.1, f64::NAN] {
            assert!(check(neck, 2.0, false).unwrap_err().contains("cluster.neck"));
        }
        for (distance_px, inclusive) in [(2.0, true), (1.4, false), (7.0, false)] {
            assert!(check(0.7, distance_px, inclusive).unwrap_err().contains("cluster.distance-px"));
        }
    }

    #[test]
    fn the_default_configuration_survives_a_round_trip_through_toml() {
        let text = toml::to_string(&DetectorConfig::default()).unwrap();
        assert_eq!(toml::from_str::<DetectorConfig>(&text).unwrap(), DetectorConfig::default(), "{text}");
        assert!(toml::from_str::<DetectorConfig>("[cluster]\ndistance = 2.0").is_err());
    }
}
