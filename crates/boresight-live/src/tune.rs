//! The few parameters that the page may change while a run goes on: which, between what limits, and a change of one as TOML.

use boresight::{Config, Error, ErrorKind, Result};
use serde::Serialize;

/// A parameter that can be changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Dial {
    /// Its key in the configuration.
    pub key: &'static str,
    /// Its limits; within those of the configuration.
    pub least: f64,
    /// See `least`.
    pub most: f64,
    /// Whether it is a whole number.
    pub whole: bool,
}

const fn dial(key: &'static str, least: f64, most: f64) -> Dial {
    Dial { key, least, most, whole: false }
}

/// All of them; a configuration has those of its own detector and tracker.
const DIALS: [Dial; 13] = [
    dial("detector.threshold.cfar.false-alarms-per-frame", 1e-4, 100.0),
    dial("detector.threshold.integrate.false-alarms-per-frame", 1e-6, 1.0),
    dial("detector.threshold.bernoulli.false-alarms-per-frame", 1e-6, 1.0),
    dial("detector.threshold.isolated.min-score", 1.0, 30.0),
    dial("detector.threshold.spot.k", 1.0, 30.0),
    dial("detector.threshold.local.k", 1.0, 30.0),
    dial("detector.threshold.moving.threshold-sd", 1.0, 50.0),
    dial("detector.threshold.steadied.threshold-sd", 1.0, 50.0),
    Dial { key: "detector.cluster.min-area-px", least: 1.0, most: 10_000.0, whole: true },
    dial("tracker.coast-s", 0.05, 60.0),
    dial("tracker.gate-probability", 0.5, 0.9999),
    dial("tracker.acceleration-density-px2-per-s3", 1e-3, 1e5),
    dial("tracker.extra-noise-px", 0.01, 30.0),
];

/// The number that stands at a key of a configuration, if it has that key.
fn number(tree: &toml::Table, key: &str) -> Option<f64> {
    let mut parts = key.split('.');
    let first = tree.get(parts.next()?)?;
    let value = parts.try_fold(first, |value, part| value.get(part))?;
    value.as_float().or_else(|| value.as_integer().map(|v| v as f64))
}

/// Detectors that find targets without joining pixels to regions.
const WITHOUT_REGIONS: [&str; 5] = ["isolated", "spot", "cfar", "integrate", "bernoulli"];

/// The parameters of this configuration that can be changed, with their values; `detects`: whether there is a detector at all.
pub fn dials(toml: &str, detects: bool) -> Vec<(Dial, f64)> {
    let tree: toml::Table = toml::from_str(toml).unwrap_or_default();
    let threshold = tree.get("detector").and_then(|d| d.get("threshold"));
    let has_regions = threshold.is_none_or(|t| WITHOUT_REGIONS.iter().all(|name| t.get(name).is_none()));
    let acts = |dial: &&Dial| match dial.key {
        key if key.starts_with("detector.") && !detects => false,
        key if key.starts_with("detector.cluster.") => has_regions,
        _ => true,
    };
    DIALS.iter().filter(acts).filter_map(|dial| number(&tree, dial.key).map(|value| (*dial, value))).collect()
}

/// One parameter and the value that it shall have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    key: &'static str,
    value: f64,
    whole: bool,
}

impl Change {
    /// A change of this configuration.
    /// # Errors
    /// [`ErrorKind::Config`] for a key that it has not, or that may not be changed, and for a value beyond its limits.
    pub fn of(toml: &str, detects: bool, key: &str, value: f64) -> Result<Self> {
        let wrong = |what: String, hint: &str| Error::new(ErrorKind::Config, what).at(key).hint(hint);
        let Some((dial, _)) = dials(toml, detects).into_iter().find(|(dial, _)| dial.key == key) else {
            return Err(wrong("cannot be changed here".into(), "/api/config lists what can"));
        };
        // NaN is within no limits.
        if !(dial.least..=dial.most).contains(&value) {
            let what = format!("expected {} to {}, not {value}", dial.least, dial.most);
            return Err(wrong(what, "move it back within its limits"));
        }
        let value = if dial.whole { value.round() } else { value };
        Ok(Self { key: dial.key, value, whole: dial.whole })
    }

    /// Its key.
    pub fn key(&self) -> &'static str {
        self.key
    }

    /// The value as TOML.
    fn text(&self) -> String {
        if self.whole { format!("{}", self.value) } else { format!("{:?}", self.value) }
    }

    /// The change as `KEY = VALUE`.
    pub fn words(&self) -> String {
        format!("{} = {}", self.key, self.text())
    }

    /// The change as a table of a configuration file.
    pub fn toml(&self) -> String {
        let (table, key) = self.key.rsplit_once('.').unwrap_or(("", self.key));
        format!("[{table}]\n{key} = {}\n", self.text())
    }

    /// The configuration with it.
    /// # Errors
    /// A value that does not fit the others.
    pub fn apply(&self, config: &Config) -> Result<Config> {
        config.with(&format!("{}={}", self.key, self.text()))
    }

    /// Whether the detector is changed; else the tracker is.
    pub fn is_of_detector(&self) -> bool {
        self.key.starts_with("detector.")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dial_is_a_key_of_a_configuration_and_its_limits_are_allowed() {
        for dial in DIALS {
            for value in [dial.least, dial.most] {
                let change = Change { key: dial.key, value, whole: dial.whole };
                let config = change.apply(&Config::default()).unwrap();
                let toml = config.to_toml().unwrap();
                let (_, now) = dials(&toml, true).into_iter().find(|(d, _)| d.key == dial.key).unwrap();
                // A detector's numbers may be kept with 32 bits.
                assert!((now - value).abs() <= 1e-6 * value, "{}: {now}", change.words());
                assert_eq!(
                    Config::from_toml(&change.toml(), "copied").unwrap().to_toml().unwrap(),
                    toml,
                    "as it is copied"
                );
            }
        }
    }

    #[test]
    fn what_would_change_nothing_is_not_offered() {
        let keys = |set: &str, detects: bool| -> Vec<&str> {
            let config = Config::default().with(set).unwrap().with("detector.cluster.min-area-px=9").unwrap();
            dials(&config.to_toml().unwrap(), detects).into_iter().map(|(dial, _)| dial.key).collect()
        };
        let (area, score) = ("detector.cluster.min-area-px", "detector.threshold.isolated.min-score");
        let isolated = keys("detector.threshold=isolated", true);
        assert!(isolated.contains(&score) && !isolated.contains(&area), "{isolated:?}");
        let band = keys("detector.threshold.band.low=5", true);
        assert!(band.contains(&area) && !band.contains(&score), "{band:?}");
        let detections = keys("detector.threshold=isolated", false);
        assert!(detections.contains(&"tracker.coast-s") && detections.iter().all(|k| k.starts_with("tracker.")));
    }

    #[test]
    fn what_may_not_be_changed_is_refused() {
        let toml = Config::default().to_toml().unwrap();
        for (key, value) in [
            ("input.rate-hz", 5.0),
            ("tracker.max-tracks", 1e9),
            ("detector.threshold.cfar.false-alarms-per-frame\n[tracker]", 1.0),
            ("tracker.coast-s", 1e9),
            ("tracker.coast-s", -1.0),
            ("tracker.coast-s", f64::NAN),
            ("", 1.0),
        ] {
            assert!(Change::of(&toml, true, key, value).is_err(), "{key} {value}");
        }
        let change = Change::of(&toml, true, "tracker.coast-s", 2.5).unwrap();
        assert_eq!(
            (change.words().as_str(), change.toml().as_str()),
            ("tracker.coast-s = 2.5", "[tracker]\ncoast-s = 2.5\n")
        );
    }
}
