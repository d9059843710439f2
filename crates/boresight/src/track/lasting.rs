//! Lasting clutter: false detections that stay where they are, so that the second is no news of the first.
//!
//! Source: our own. The likelihood ratio of a scan takes false detections for independent from scan to scan. What a codec makes of noise is copied from frame to frame for seconds, and a false
//! detection in it comes again, at the same place to a hundredth of a pixel.
//! Method: a detection that scores less than false ones that last reach, and lies nearer than its own width to where the track's evidence last counted, multiplies the odds by 1 at most: either hypothesis foretells it. A
//! target that moves moves by its own width, one that is brighter than such clutter counts as ever. The survival of that scan does not count either: what was copied is no later view.
//! Symbols: Λ likelihood ratio of a scan, target against clutter (no unit).
//! Limits: a target at rest that is no brighter than lasting clutter is not told from it. Rules that count hits know of no evidence.

use super::config::TrackerConfig;
use super::single_track::Track;
use crate::Detection;
use nalgebra::Vector2;

impl TrackerConfig {
    /// Whether a detection says no more than the one at `counted` did, px.
    #[inline]
    pub(super) fn says_nothing_new(&self, d: &Detection, place: &Vector2<f64>, counted: &Vector2<f64>) -> bool {
        let width2 = d.extent.width_px * d.extent.height_px;
        let is_clutter = self.lasting_clutter_score > 0.0 && f64::from(d.score) < self.lasting_clutter_score;
        is_clutter && (place - counted).norm_squared() <= width2
    }

    /// ln Λ of a scan by whether its detection is news; where it is, it is what later ones are compared with.
    #[inline]
    pub(super) fn evidence(
        &self,
        d: &Detection,
        place: &Vector2<f64>,
        counted: &mut Vector2<f64>,
        log_ratio: f64,
    ) -> f64 {
        if self.says_nothing_new(d, place, counted) {
            return log_ratio.min(0.0);
        }
        *counted = *place;
        log_ratio
    }
}

impl Track {
    /// Λ of a scan whose detection is this track's, by whether it is news; existence was predicted over `dt_s`.
    #[inline]
    pub(super) fn evidence_of(
        &mut self,
        config: &TrackerConfig,
        detection: &Detection,
        likelihood_ratio: f64,
        dt_s: f64,
    ) -> f64 {
        if config.says_nothing_new(detection, &detection.position, &self.counted) {
            config.confirmation.undo_prediction(&mut self.history, config.confirmation.survival(dt_s));
            return likelihood_ratio.min(1.0);
        }
        self.counted = detection.position;
        likelihood_ratio
    }
}

#[cfg(test)]
mod tests {
    use crate::track::{ConfirmationConfig, ExistenceConfig, TrackerConfig, build};
    use crate::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackStatus};
    use nalgebra::{Matrix2, Vector2};

    const EXTENT: Extent = Extent { left_px: 0.0, top_px: 0.0, width_px: 2.0, height_px: 2.0 };

    /// In how many of 60 scans a thing is reported that scores `score`, moves by `step_px` a scan and comes anew `jitter_px` from there.
    fn reported(config: &TrackerConfig, score: f32, step_px: f64, jitter_px: f64) -> usize {
        let mut tracker = build(config).unwrap();
        let seen = (0..60u64).filter(|k| {
            let off = if k % 2 == 0 { jitter_px } else { 0.0 };
            let place = Vector2::new(50.0 + step_px * *k as f64 + off, 40.0);
            let d = Detection { score, extent: EXTENT, ..Detection::at(place, Matrix2::identity() * 0.01) };
            let scan = Scan::at(FrameIndex(*k), Timestamp::from_secs_f64(0.04 * *k as f64)).with_detections(vec![d]);
            tracker.step(&scan).unwrap().iter().any(|s| s.status != TrackStatus::Tentative)
        });
        seen.count()
    }

    fn config(lasting_clutter_score: f64) -> TrackerConfig {
        TrackerConfig {
            confirmation: ConfirmationConfig::Existence(ExistenceConfig::default()),
            lasting_clutter_score,
            ..TrackerConfig::default()
        }
    }

    #[test]
    fn what_stays_and_scores_as_lasting_clutter_does_is_no_evidence() {
        // Some detectors give scores below 0.
        for score in [5.0, -5.0] {
            assert_eq!(reported(&config(0.0), score, 0.0, 0.0), reported(&config(0.0), 9.0, 0.0, 0.0));
            assert!(reported(&config(0.0), score, 0.0, 0.0) > 50);
        }
        for jitter_px in [0.0, 0.1] {
            assert_eq!(reported(&config(8.0), 5.0, 0.0, jitter_px), 0);
        }
        assert!(reported(&config(8.0), 9.0, 0.0, 0.0) > 50, "brighter than such clutter");
        assert!(reported(&config(8.0), 5.0, 1.0, 0.0) > 50, "it moves");
        assert!(reported(&config(8.0), 5.0, 0.1, 0.0) > 10, "it moves slowly");
    }

    #[test]
    fn a_track_that_was_confirmed_stays_so_where_it_comes_to_rest() {
        let lived = ExistenceConfig { mean_target_lifetime_s: 1.0, ..ExistenceConfig::default() };
        let config = TrackerConfig { confirmation: ConfirmationConfig::Existence(lived), ..config(8.0) };
        let mut tracker = build(&config).unwrap();
        let (mut last, mut ids) = (None, std::collections::BTreeSet::new());
        for k in 0..200u64 {
            let place = Vector2::new(50.0 + 20.0 * (1.0 - (-(k as f64) / 15.0).exp()), 40.0);
            let d = Detection { score: 5.0, extent: EXTENT, ..Detection::at(place, Matrix2::identity() * 0.01) };
            let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(vec![d]);
            let states = tracker.step(&scan).unwrap();
            ids.extend(states.iter().map(|s| s.id));
            last = states.first().map(|s| s.status);
        }
        // Eight seconds of rest are eight lives of such a target.
        assert_eq!((last, ids.len()), (Some(TrackStatus::Confirmed), 1));
    }
}
