//! The tracker's configuration: the parts' own configurations, and the numbers that several parts share.
//!
//! Every choice is an enum, every number has a unit and a range. A part's configuration stands in the part's file and never
//! looks up here.

use super::association_cost::AssociationCostConfig;
use super::clutter::ClutterConfig;
use super::confirm::motion_test::{MotionTestConfig, Report};
use super::confirm::rule::ConfirmationConfig;
use super::filter::{AccelerationNoise, DEFAULT_DENSITY_PX2_PER_S3, FilterConfig, TrackedFilter, presets};
use super::initial_tracks::InitialTrackConfig;
use super::initiation::InitiationConfig;
use super::merged_measurements::MergedMeasurementsConfig;
use super::mht::config::MhtConfig;
use super::radar_update::RadarUpdate;
use super::reidentify::ReidentificationConfig;
use super::score_likelihood::ScoreLikelihoodConfig;
use crate::associate::AssociatorConfig;
use crate::validate::{at_least_one, check, not_negative, positive, probability};
use crate::{Error, ErrorKind, Result};
use boresight_filters::{FilterError, Gaussian};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How detections become tracks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TrackerConfig {
    /// The filter of each track: a name (`boresight config --list filters`), or a table of its parts.
    #[serde(deserialize_with = "presets::name_or_parts")]
    #[schemars(schema_with = "presets::schema")]
    pub filter: FilterConfig,
    /// Power density of the target's white acceleration, px²/s³, above 0; larger follows manoeuvres, smaller smooths more. Within t seconds
    /// the velocity changes by √(this × t): 25 is 5 px/s in one second, at any frame rate.
    pub acceleration_density_px2_per_s3: f64,
    /// Density added to it in proportion to the square of the target's box, 1/s³: `box height² × this`, 0 or more. For scenes with
    /// near and far targets, where a tall box moves more pixels.
    pub acceleration_density_per_height2_per_s3: f64,
    /// Discrete noise instead: standard deviation of an acceleration that is constant within each scan interval, px/s², above 0. Its effect
    /// depends on the frame rate; left out, the densities above are used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_std_px_per_s2: Option<f64>,
    /// Acceleration added to the discrete one in proportion to the target's box, 1/s²: `box height × this`, 0 or more.
    pub acceleration_per_height_per_s2: f64,
    /// Factor on every detection's own covariance, above 0: what the detector states may be too much or too little. The two numbers of extra noise
    /// below are not multiplied.
    pub detection_covariance_scale: f64,
    /// Measurement noise in proportion to the detection's box: `box height × this` per axis, standard deviation, 0 or more.
    pub extra_noise_per_height: f64,
    /// Measurement noise added to each detection's own covariance, standard deviation per axis, px, 0 or more.
    pub extra_noise_px: f64,
    /// What errors of measurements that last from scan to scan leave in a track's position, standard deviation per axis, px, 0 or more: added to the covariances that are stated, not to gates. 0: errors are
    /// independent.
    pub correlated_error_px: f64,
    /// How a radar's plots correct a track: `converted` once to positions, or `extended`, by range and azimuth linearised at each track's prediction. Of other detections
    /// it says nothing.
    pub radar_update: RadarUpdate,
    /// Probability that a target's detection lies in its gate, in (0, 1); the gate is χ² with 2 degrees of freedom.
    pub gate_probability: f64,
    /// Largest speed of a target, px/s, above 0: limits two-point initiation and gates that grow while a track coasts.
    pub max_speed_px_per_s: f64,
    /// Whether a gate that grows while its track coasts is cut to what the largest speed allows.
    pub gate_within_max_speed: bool,
    /// Probability that a target is detected in a scan, in (0, 1].
    pub detection_probability: f64,
    /// The same after a scan in which it was not detected, in (0, 1]: a target that hides or fades stays so for a while (detections are a Markov
    /// chain), and a second miss says less than the first. Left out: scans are independent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub redetection_probability: Option<f64>,
    /// False detections per px² and scan, 0 or more (used by every method that weighs detections against clutter).
    pub clutter_density_per_px2: f64,
    /// Whether that density is taken as given, or estimated from the scans.
    pub clutter: ClutterConfig,
    /// How detections are assigned to tracks.
    pub associator: AssociatorConfig,
    /// Multiple-hypothesis tracking instead of an associator (which is then not used); left out: decisions are made at once.
    pub mht: Option<MhtConfig>,
    /// When a track is confirmed and when it is deleted.
    pub confirmation: ConfirmationConfig,
    /// Which of the tracks that this rule confirms are reported: `all`, or only what is `moving` by itself.
    pub report: Report,
    /// With `report = "moving"`: when a track has moved by itself.
    pub motion_test: MotionTestConfig,
    /// How tracks are initiated.
    pub initiation: InitiationConfig,
    /// Least score of a detection that initiates a track, 0 or more; weaker ones only continue tracks. 0 asks for no score: some
    /// detectors give negative ones.
    pub min_initiation_score: f64,
    /// False detections that score less than this may stay where they are from scan to scan, 0 or more: a second one there says nothing of existence. 0: false detections are independent.
    pub lasting_clutter_score: f64,
    /// Targets known before the first scan: confirmed tracks at once. None by default.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub initial_tracks: Vec<InitialTrackConfig>,
    /// What a pair costs beside position: size, intensity, class, overlap.
    pub association_cost: AssociationCostConfig,
    /// How scores tell targets from false detections; left out: they only say what may initiate a track.
    pub score_likelihood: Option<ScoreLikelihoodConfig>,
    /// A second association of weak detections with tracks that took no strong one; left out: all detections are equal.
    pub two_stage: Option<TwoStageConfig>,
    /// Detections of several targets at once are split among their tracks; left out: they are (`enabled = false` switches it off).
    pub merged_measurements: MergedMeasurementsConfig,
    /// Whether a target that was lost gets its old id when it is found again.
    pub reidentification: ReidentificationConfig,
    /// A run on a file holds back its results this long, s, 0 or more, and reports a track that is confirmed within it from its first detection on
    /// (shorter where frames and tracks of that time take more than 64 MiB each). 0 reports every scan at once, as a live run always does.
    pub retrospective_s: f64,
    /// Two confirmed tracks that follow the same detections this long become one, s, above 0; the younger ends.
    pub duplicate_s: f64,
    /// How fast a track's box and intensity follow its detections, in (0, 1]; 1 takes the newest box as it is.
    pub appearance_gain: f64,
    /// A confirmed track without detections is kept this long, s, 0 or more.
    pub coast_s: f64,
    /// It is kept for at least this many scans, whatever the frame rate; 1 or more.
    pub coast_scans: u32,
    /// Width and height of the image, px, above 0: tracks whose estimate lies outside are not reported. Left out: the frames', in a run on frames; else everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field_px: Option<[f64; 2]>,
    /// Most tracks alive at a time; no track is started beyond (a guard of memory and time).
    pub max_tracks: u32,
    /// Most gated detections kept per track, the nearest (a guard of memory and time).
    pub max_gated: u32,
}

impl Default for TrackerConfig {
    fn default() -> Self {
        Self {
            filter: FilterConfig::default(),
            acceleration_density_px2_per_s3: DEFAULT_DENSITY_PX2_PER_S3,
            acceleration_density_per_height2_per_s3: 0.0,
            acceleration_std_px_per_s2: None,
            acceleration_per_height_per_s2: 0.0,
            detection_covariance_scale: 1.0,
            extra_noise_per_height: 0.0,
            extra_noise_px: 0.3,
            correlated_error_px: 0.0,
            radar_update: RadarUpdate::default(),
            gate_probability: 0.99,
            max_speed_px_per_s: 150.0,
            gate_within_max_speed: true,
            detection_probability: 0.9,
            redetection_probability: None,
            clutter_density_per_px2: 1e-5,
            clutter: ClutterConfig::default(),
            associator: AssociatorConfig::default(),
            mht: None,
            confirmation: ConfirmationConfig::default(),
            report: Report::All,
            motion_test: MotionTestConfig::default(),
            initiation: InitiationConfig::default(),
            min_initiation_score: 0.0,
            lasting_clutter_score: 0.0,
            initial_tracks: Vec::new(),
            association_cost: AssociationCostConfig::default(),
            score_likelihood: None,
            two_stage: None,
            merged_measurements: MergedMeasurementsConfig::default(),
            reidentification: ReidentificationConfig::default(),
            retrospective_s: 0.0,
            duplicate_s: 0.5,
            appearance_gain: 0.3,
            coast_s: 0.5,
            coast_scans: 5,
            field_px: None,
            max_tracks: 250_000,
            max_gated: 64,
        }
    }
}

/// A second association of weak detections (Y. Zhang et al., "ByteTrack", ECCV 2022).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TwoStageConfig {
    /// Detections with at least this score are strong: they may initiate tracks and are assigned first.
    pub high_score: f32,
    /// Detections with less than this score are not used at all; at most `high-score`.
    pub low_score: f32,
}

impl Default for TwoStageConfig {
    fn default() -> Self {
        Self { high_score: 0.5, low_score: 0.1 }
    }
}

impl TrackerConfig {
    /// Gate threshold on d²: γ = −2 ln(1 − P_G), the χ² quantile with 2 degrees of freedom (no unit).
    pub fn gate(&self) -> f64 {
        -2.0 * (1.0 - self.gate_probability).ln()
    }

    /// Probability that a target is detected that was missed in so many scans before.
    #[inline]
    pub(super) fn p_detection(&self, misses: u32) -> f64 {
        match self.redetection_probability {
            Some(p) if misses > 0 => p,
            _ => self.detection_probability,
        }
    }

    /// Whether a detection of this score may initiate a track.
    #[inline]
    pub(super) fn may_initiate(&self, score: f32) -> bool {
        self.min_initiation_score <= 0.0 || f64::from(score) >= self.min_initiation_score
    }

    /// Builds the filter of a new track of that height.
    pub(super) fn start_filter(&self, start: &Gaussian<4>, height_px: f64) -> Result<TrackedFilter, FilterError> {
        self.filter.start(start, self.acceleration_noise(height_px))
    }

    /// The white acceleration of a target of that height, px.
    pub fn acceleration_noise(&self, height_px: f64) -> AccelerationNoise {
        let (density, per_height2) =
            (self.acceleration_density_px2_per_s3, self.acceleration_density_per_height2_per_s3);
        match self.acceleration_std_px_per_s2 {
            None => AccelerationNoise::Continuous(density + per_height2 * height_px * height_px),
            Some(std) => AccelerationNoise::Discrete(std.hypot(self.acceleration_per_height_per_s2 * height_px)),
        }
    }

    /// Checks all values; `at` names the place in the configuration (`tracker`).
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let density = self.acceleration_density_px2_per_s3;
        positive(at, "acceleration-density-px2-per-s3", density, "25 lets the velocity change by 5 px/s in a second")?;
        let per_height2 = self.acceleration_density_per_height2_per_s3;
        not_negative(at, "acceleration-density-per-height2-per-s3", per_height2, "0.05 suits people in video")?;
        if let Some(std) = self.acceleration_std_px_per_s2 {
            positive(at, "acceleration-std-px-per-s2", std, "left out, the density is used")?;
        } else {
            let none = self.acceleration_per_height_per_s2 == 0.0;
            let mend = "give the density: acceleration-density-per-height2-per-s3";
            let key = "acceleration-per-height-per-s2";
            check(none, at, key, self.acceleration_per_height_per_s2, "0 without acceleration-std-px-per-s2", mend)?;
        }
        positive(at, "detection-covariance-scale", self.detection_covariance_scale, "1 takes covariances as stated")?;
        not_negative(at, "extra-noise-px", self.extra_noise_px, "0.3 covers the heavy tails of thresholded centroids")?;
        not_negative(at, "correlated-error-px", self.correlated_error_px, "0 takes errors for independent")?;
        let mend = "0.99 keeps 99 % of true detections inside the gate";
        probability(at, "gate-probability", self.gate_probability, mend)?;
        positive(at, "max-speed-px-per-s", self.max_speed_px_per_s, "5 px per frame at 30 frames/s is 150")?;
        check(
            self.detection_probability > 0.0 && self.detection_probability <= 1.0,
            at,
            "detection-probability",
            self.detection_probability,
            "a probability in (0, 1]",
            "0.9 suits most detectors",
        )?;
        if let Some(p) = self.redetection_probability {
            let mend = "0.3 finds it again after three scans; left out, a miss says nothing of the next scan";
            check(p > 0.0 && p <= 1.0, at, "redetection-probability", p, "a probability in (0, 1]", mend)?;
        }
        not_negative(
            at,
            "clutter-density-per-px2",
            self.clutter_density_per_px2,
            "3 false detections in 640 x 512 px are 1e-5",
        )?;
        self.filter.validate(&format!("{at}.filter"))?;
        self.associator.validate(&format!("{at}.associator"))?;
        if let Some(c) = &self.mht {
            c.validate(&format!("{at}.mht"))?;
        }
        self.confirmation.validate(&format!("{at}.confirmation"))?;
        self.motion_test.validate(&format!("{at}.motion-test"))?;
        self.initiation.validate(&format!("{at}.initiation"))?;
        not_negative(at, "min-initiation-score", self.min_initiation_score, "0 lets every detection initiate a track")?;
        for (i, initial) in self.initial_tracks.iter().enumerate() {
            initial.validate(&format!("{at}.initial-tracks[{i}]"))?;
        }
        if self.mht.is_some() && !self.initial_tracks.is_empty() {
            let e = Error::new(ErrorKind::Config, "multiple hypotheses take no initial tracks");
            return Err(e.at(format!("{at}.initial-tracks")).hint("leave out `mht`, or the initial tracks"));
        }
        self.clutter.validate(&format!("{at}.clutter"))?;
        self.association_cost.validate(&format!("{at}.association-cost"))?;
        if let Some(c) = &self.two_stage {
            check(
                c.low_score <= c.high_score,
                &format!("{at}.two-stage"),
                "low-score",
                c.low_score,
                "at most high-score",
                "0.1 and 0.5 suit detectors with scores in 0..1",
            )?;
        }
        if let Some(c) = &self.score_likelihood {
            c.validate(&format!("{at}.score-likelihood"))?;
        }
        self.merged_measurements.validate(&format!("{at}.merged-measurements"))?;
        self.reidentification.validate(&format!("{at}.reidentification"))?;
        not_negative(
            at,
            "lasting-clutter-score",
            self.lasting_clutter_score,
            "0 takes false detections for independent",
        )?;
        let mend = "10 reports nearly every track whole, 0 reports at once";
        not_negative(at, "retrospective-s", self.retrospective_s, mend)?;
        positive(at, "duplicate-s", self.duplicate_s, "half a second is usual")?;
        check(
            self.appearance_gain > 0.0 && self.appearance_gain <= 1.0,
            at,
            "appearance-gain",
            self.appearance_gain,
            "a gain in (0, 1]",
            "0.3 smooths over about five scans",
        )?;
        not_negative(
            at,
            "acceleration-per-height-per-s2",
            self.acceleration_per_height_per_s2,
            "1 suits people in video",
        )?;
        not_negative(
            at,
            "extra-noise-per-height",
            self.extra_noise_per_height,
            "0.05 is usual for detectors of people",
        )?;
        not_negative(at, "coast-s", self.coast_s, "0.5 bridges half a second without detections")?;
        for side in self.field_px.iter().flatten() {
            positive(at, "field-px", *side, "the image's width and height: [640, 512]")?;
        }
        at_least_one(at, "coast-scans", self.coast_scans)?;
        at_least_one(at, "max-tracks", self.max_tracks)?;
        at_least_one(at, "max-gated", self.max_gated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_least_score_every_detection_may_initiate_a_track() {
        // Scores of the public MOT17 detections by DPM go below 0.
        assert!(TrackerConfig::default().may_initiate(-0.3));
        let config = TrackerConfig { min_initiation_score: 5.0, ..TrackerConfig::default() };
        assert!(config.may_initiate(5.0) && !config.may_initiate(4.9) && !config.may_initiate(-0.3));
    }

    #[test]
    fn the_gate_is_the_quantile_of_chi_square_with_two_degrees_of_freedom() {
        // −2 ln 0.01 = 9.2103403719762.
        assert!((TrackerConfig::default().gate() - 9.210_340_371_976_2).abs() < 1e-12);
    }

    #[test]
    fn a_probability_of_redetection_is_above_zero_and_at_most_one() {
        let valid = |p: f64| {
            TrackerConfig { redetection_probability: Some(p), ..TrackerConfig::default() }.validate("tracker").is_ok()
        };
        assert_eq!([0.0, -0.1, 1.1, f64::NAN].map(valid), [false; 4]);
        assert_eq!([1e-9, 0.3, 1.0].map(valid), [true; 3]);
    }
}
