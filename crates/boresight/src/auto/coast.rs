//! How long a track of a thing that moves before a fixed camera goes on unseen.
//!
//! Source: our own; the prediction of a constant-velocity model driven by a white acceleration (Bar-Shalom, Li, Kirubarajan 2001, 6.2.2). A track that goes on takes what it finds. Once its place is known no
//! better than half the width of what is tracked, that is as likely another one, and two tracks hold one thing; what comes back later is known again by re-identification, not by going on.
//! Symbols: q density of the acceleration, px²/s³; the deviation of a place predicted over t is √(q t³ / 3) px.
//! Limits: what the velocity lacks when the track is lost is not counted; targets of very different widths share one time.

use super::digits::round;
use crate::track::{ConfirmationConfig, TrackerConfig};
use crate::{Config, Scan};

/// Share of the shorter side of what is detected up to which its place is known.
const SHARE_OF_WIDTH: f64 = 0.5;

/// Lets tracks that are confirmed by their hits go on for no longer than their place is known, by the motion that was learnt of these scans.
pub fn learn(scans: &[Scan], config: &mut Config, reasons: &mut Vec<String>) {
    let tracker = &mut config.tracker;
    // Who judges by probabilities knows from P_D how long to wait.
    if !matches!(tracker.confirmation, ConfirmationConfig::MOfN(_)) {
        return;
    }
    let Some([width_px, height_px]) = sides(scans) else { return };
    let known_s = known_for_s(density(tracker, height_px), SHARE_OF_WIDTH * width_px);
    if known_s < tracker.coast_s {
        reasons.push(format!(
            "A track that is not seen goes on for {} s, not {}: after that its place is known no better than half of the {width_px:.0} px that half of the targets are wide at least.",
            round(known_s),
            tracker.coast_s,
        ));
        tracker.coast_s = round(known_s);
    }
}

/// The density of the acceleration of a target of that height, px²/s³.
fn density(tracker: &TrackerConfig, height_px: f64) -> f64 {
    tracker.acceleration_density_px2_per_s3 + tracker.acceleration_density_per_height2_per_s3 * height_px.powi(2)
}

/// Time in which the place of a target comes to be known to no better than that, s.
fn known_for_s(density_px2_per_s3: f64, known_px: f64) -> f64 {
    (3.0 * known_px.powi(2) / density_px2_per_s3).cbrt()
}

/// Medians of the detections' shorter side and of their height, px.
fn sides(scans: &[Scan]) -> Option<[f64; 2]> {
    let all = || scans.iter().flat_map(|s| &s.detections).map(|d| d.extent);
    let median = |mut of: Vec<f64>| {
        of.sort_by(f64::total_cmp);
        of.get(of.len() / 2).copied()
    };
    let shorter = median(all().map(|e| e.width_px.min(e.height_px)).collect())?;
    Some([shorter, median(all().map(|e| e.height_px).collect())?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};

    /// How long tracks of things of 20 x 40 px go on which are driven by that density, px²/s³, where 0.7 s were assumed.
    fn coast_s(density: f64, confirmation: ConfirmationConfig) -> (f64, usize) {
        let mut d = Detection::point(10.0, 10.0, 1.0);
        (d.extent.width_px, d.extent.height_px) = (20.0, 40.0);
        let scans = [Scan::at(FrameIndex(0), Timestamp::default()).with_detections(vec![d])];
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        config.tracker.coast_s = 0.7;
        config.tracker.confirmation = confirmation;
        config.tracker.acceleration_density_px2_per_s3 = density;
        learn(&scans, &mut config, &mut reasons);
        (config.tracker.coast_s, reasons.len())
    }

    #[test]
    fn what_turns_hard_goes_on_until_its_place_is_known_to_half_its_width_and_what_does_not_as_was_assumed() {
        let hits = || ConfirmationConfig::MOfN(Default::default());
        // 30 000 t³ / 3 = 10² at 0.215 s.
        let (fish_s, n_reasons) = coast_s(30_000.0, hits());
        assert!((fish_s - 0.2154).abs() < 1e-3 && n_reasons == 1, "{fish_s}");
        assert_eq!(coast_s(100.0, hits()), (0.7, 0), "a person");
        assert_eq!(coast_s(30_000.0, ConfirmationConfig::Existence(Default::default())), (0.7, 0), "by probabilities");
        let mut config = Config::default();
        learn(&[], &mut config, &mut Vec::new());
        assert_eq!(config, Config::default(), "nothing seen");
    }
}
