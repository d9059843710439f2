//! The tracker for detections made elsewhere: speeds and noise from the table itself.

use super::digits::round;
use crate::{Config, Scan};

/// Writes the tracker's configuration for a table of detections.
pub fn for_detections(scans: &[Scan], rate_hz: f64, config: &mut Config, reasons: &mut Vec<String>) {
    let mut sides: Vec<f64> = scans
        .iter()
        .flat_map(|s| &s.detections)
        .map(|d| d.extent.width_px.min(d.extent.height_px))
        .filter(|s| s.is_finite() && *s > 0.0)
        .collect();
    sides.sort_by(f64::total_cmp);
    let side = sides.get(sides.len() / 2).copied().unwrap_or(0.0);
    let rate = if rate_hz.is_finite() && rate_hz > 0.0 { rate_hz } else { 25.0 };
    let tracker = &mut config.tracker;
    // Boxes of larger things jump more: a tenth of the side is what detectors leave in the centre.
    tracker.extra_noise_px = round((0.1 * side).max(0.3));
    tracker.acceleration_std_px_per_s2 = round((0.005 * side).max(0.03) * rate * rate);
    tracker.max_speed_px_per_s = round((0.3 * side).max(5.0) * rate);
    reasons.push(format!(
        "Median shorter side {side:.1} px: noise {} px, acceleration {} px/s², at most {} px/s.",
        tracker.extra_noise_px, tracker.acceleration_std_px_per_s2, tracker.max_speed_px_per_s
    ));
}
