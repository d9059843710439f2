//! What is said of parameters that a run changed by itself: those that moved by more than a tenth since they were said last.

use boresight::track::TrackerParameters;

/// Moves that are said, as a share of the value.
const SAID_SHARE: f64 = 0.1;

/// The keys of parameters, with their values.
fn values(p: &TrackerParameters) -> [(&'static str, f64); 8] {
    [
        ("detection-covariance-scale", p.detection_covariance_scale),
        ("extra-noise-px", p.extra_noise_px),
        ("extra-noise-per-height", p.extra_noise_per_height),
        ("acceleration-density-px2-per-s3", p.acceleration_density_px2_per_s3),
        ("acceleration-density-per-height2-per-s3", p.acceleration_density_per_height2_per_s3),
        ("detection-probability", p.detection_probability),
        ("redetection-probability", p.redetection_probability.unwrap_or(p.detection_probability)),
        ("clutter-density-per-px2", p.clutter_density_per_px2),
    ]
}

/// What moved by more than a tenth, from the values that were said last to those now; `None` if nothing did.
pub fn words(said: &TrackerParameters, now: &TrackerParameters) -> Option<String> {
    let moved = |(before, after): &((&str, f64), (&str, f64))| (after.1 - before.1).abs() > SAID_SHARE * before.1;
    let pairs = values(said).into_iter().zip(values(now)).filter(moved);
    let said: Vec<String> = pairs.map(|(before, after)| format!("{} {} -> {}", after.0, before.1, after.1)).collect();
    (!said.is_empty()).then(|| said.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use boresight::track::TrackerConfig;

    #[test]
    fn a_tenth_is_said_and_less_is_not() {
        let said = TrackerParameters { extra_noise_px: 1.0, ..TrackerParameters::of(&TrackerConfig::default()) };
        let now = |extra_noise_px| TrackerParameters { extra_noise_px, ..said };
        assert_eq!(words(&said, &now(1.05)), None);
        assert_eq!(words(&said, &now(1.5)).as_deref(), Some("extra-noise-px 1 -> 1.5"));
        assert_eq!(words(&said, &now(0.5)).as_deref(), Some("extra-noise-px 1 -> 0.5"));
    }
}
