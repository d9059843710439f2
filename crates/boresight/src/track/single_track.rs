//! One track: what it carries from scan to scan, and what one scan brought it.

use super::appearance::Appearance;
use super::confirm::history::History;
use super::confirm::motion_test::{MotionProgress, Report};
use super::filter::TrackedFilter;
use super::scan_table::Cov2;
use crate::camera::CameraPath;
use crate::record::TrackInnovation;
use crate::{Detection, Timestamp};
use nalgebra::Vector2;

/// Tracks whose neighbourhoods are fetched together, so that the waits for memory overlap.
pub(super) const BATCH: usize = 16;

/// One track.
#[derive(Clone)]
pub(super) struct Track {
    pub id: u64,
    pub filter: TrackedFilter,
    pub history: History,
    pub appearance: Appearance,
    /// Since when it follows the same detections as an older track, ns.
    pub duplicate_since_ns: Option<i64>,
    /// Where it was at its last detection, and how sure (standard deviation), px: the centre of its possible reach.
    pub last_place: [f64; 3],
    /// Where it was when a detection last counted as evidence, px (`lasting.rs`).
    pub counted: Vector2<f64>,
    /// How long before its scan's time that detection was seen, ns.
    pub last_age_ns: u64,
    /// Whether it was ever reported as confirmed.
    pub reported: bool,
    /// Whether it was asked whose it is since its rule confirmed it.
    pub identified: bool,
    /// Mean of the logarithm of its score; unknown before its first detection, and where scores say nothing.
    pub log_score: Option<f64>,
    /// What it has shown of its motion.
    pub motion: MotionProgress,
}

/// What one scan brought a track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outcome {
    pub hit: bool,
    /// The detection is a merged measurement of several tracks.
    pub merged: bool,
    /// And another of them fits it better.
    pub secondary: bool,
    /// The detection of the largest weight.
    pub detection: Option<u32>,
    /// Λ of the scan.
    pub likelihood_ratio: f64,
    pub innovation: Option<TrackInnovation>,
}

impl Track {
    /// When it was last seen.
    #[inline]
    pub(super) fn last_seen(&self) -> Timestamp {
        Timestamp::from_ns(self.history.last_seen_ns.saturating_sub_unsigned(self.last_age_ns))
    }

    /// Takes in the box, place and score of a detection that is (most likely) its own.
    #[inline]
    pub(super) fn follow(
        &mut self,
        d: &Detection,
        age_ns: u64,
        noise: &Cov2,
        log_score: Option<f64>,
        appearance_gain: f64,
    ) {
        self.appearance.follow(d, appearance_gain);
        if let Some(now) = log_score {
            self.log_score = Some(self.log_score.map_or(now, |mean| mean + appearance_gain * (now - mean)));
        }
        (self.last_place, self.last_age_ns) = (place_of(d, noise), age_ns);
        self.motion.add_size([d.extent.width_px, d.extent.height_px]);
    }
}

/// The motion of a track that begins with a detection.
pub(super) fn motion_of(d: &Detection, noise: &Cov2, camera: CameraPath, report: Report) -> MotionProgress {
    if report == Report::All {
        return MotionProgress::passed();
    }
    let size = [d.extent.width_px, d.extent.height_px];
    MotionProgress::begin([d.position.x, d.position.y], [noise.xx, noise.yy], size, camera)
}

/// Position of a detection and its larger standard deviation, px.
#[inline]
pub(super) fn place_of(d: &Detection, noise: &Cov2) -> [f64; 3] {
    [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::step::initiate::from_initial_tracks;
    use crate::track::{InitialTrackConfig, TrackerConfig};
    use nalgebra::Matrix2;

    #[test]
    fn the_level_of_the_scores_is_their_exponential_mean() {
        let config = TrackerConfig { initial_tracks: vec![InitialTrackConfig::default()], ..TrackerConfig::default() };
        let mut tracks = Vec::new();
        from_initial_tracks(&config, Timestamp::default(), &mut tracks, &mut 1).unwrap();
        let d = Detection::at(Vector2::zeros(), Matrix2::identity());
        let mut level_after = |ln: Option<f64>| {
            tracks[0].follow(&d, 0, &Cov2::default(), ln, 0.25);
            tracks[0].log_score
        };
        // The first one, then a quarter of the way to each: 1, 1 + 2/4, 1.5 − 3/4; a detection that says nothing changes nothing.
        let levels = [None, Some(1.0), Some(3.0), None, Some(-1.5)].map(&mut level_after);
        assert_eq!(levels, [None, Some(1.0), Some(1.5), Some(1.5), Some(0.75)]);
    }
}
