//! What is said of parameters that a run changed by itself: those that moved by more than a tenth since they were said last.

use boresight::track::TrackerParameters;

/// Moves that are said, as a share of the value.
const SAID_SHARE: f64 = 0.1;

/// What moved by more than a tenth, from the values that were said last to those now; `None` if nothing did.
pub fn words(said: &TrackerParameters, now: &TrackerParameters) -> Option<String> {
    let pairs = said.values().into_iter().zip(now.values()).filter_map(|((key, before), (_, after))| {
        let (before, after) = before.zip(after)?;
        ((after - before).abs() > SAID_SHARE * before).then(|| format!("{key} {before} -> {after}"))
    });
    let said: Vec<String> = pairs.collect();
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
