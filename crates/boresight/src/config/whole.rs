//! The whole configuration of a run, as it stands in a file: input, detector, tracker, place on Earth.
//!
//! Enums are externally tagged (`[tracker.associator.global-nearest]`), unknown keys are refused with their line. Errors name
//! the key, its value, what was expected and a mend.

use super::schema_tree::{children, is_choice};
use super::{renamed, typo};
use crate::io::{Colour, OpenOptions, RawFormat, TableOptions};
use crate::sensor::SensorConfig;
use crate::track::TrackerConfig;
use crate::vision::DetectorConfig;
use crate::world::{World, WorldConfig};
use crate::{ASSUMED_RATE_HZ, Error, ErrorKind, Result, SourceInfo};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Everything that decides what a run gives.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Config {
    /// How frames are read.
    pub input: InputConfig,
    /// How frames become detections.
    pub detector: DetectorConfig,
    /// How detections become tracks.
    pub tracker: TrackerConfig,
    /// Where on Earth tracks are: by a map of the ground or by the camera's pose. The camera must stand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub world: Option<WorldConfig>,
}

/// How frames are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct InputConfig {
    /// Which pixels are wanted: `native` (grey of video, colour of stills), `gray` or `rgb`.
    pub colour: Colour,
    /// Rate of sequences and tables that carry no times, frames/s, above 0.
    pub rate_hz: f64,
    /// Largest accepted frame, pixels, above 0; what claims more is refused before memory is taken.
    pub max_pixels: u64,
    /// Of a TIFF's pages every how many-th is a frame, 1 or more; absent: as ImageJ's or OME's description says (one channel and
    /// one plane of a hyperstack), else every page.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub page_step: Option<u64>,
    /// Number of the first such page, from 0: in a stack of two channels 1 takes the second.
    pub first_page: u64,
    /// Layout of headerless frames; needed for raw input only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw: Option<RawFormat>,
    /// How late a scan of detections may come to a live run by its time stamp, s, 0..=60: up to that it is taken at its own time, and the scans behind it again.
    /// Longer costs memory and, with each late scan, time. Of no effect on frames and tables.
    pub late_s: f64,
    /// How a table of detections is read; of no effect on frames.
    pub table: TableOptions,
    /// What is mended of grey frames before anything is detected: dark and flat frames, bad pixels, columns.
    pub sensor: SensorConfig,
}

impl Default for InputConfig {
    fn default() -> Self {
        let o = OpenOptions::default();
        Self {
            colour: o.colour,
            rate_hz: o.rate_hz,
            max_pixels: o.max_pixels,
            page_step: o.page_step,
            first_page: o.first_page,
            raw: None,
            late_s: 1.0,
            table: Default::default(),
            sensor: SensorConfig::default(),
        }
    }
}

impl InputConfig {
    /// What [`crate::io::open`] takes.
    pub fn open_options(&self) -> OpenOptions {
        OpenOptions {
            colour: self.colour,
            raw: self.raw,
            rate_hz: self.rate_hz,
            max_pixels: self.max_pixels,
            page_step: self.page_step,
            first_page: self.first_page,
            stop: None,
            colours_beside: None,
        }
    }

    /// What [`crate::io::read_detections`] takes.
    pub fn table_options(&self) -> TableOptions {
        TableOptions { assumed_rate_hz: self.rate_hz, ..self.table.clone() }
    }

    fn validate(&self, at: &str) -> Result<()> {
        self.table.validate(&format!("{at}.table"))?;
        if !(self.rate_hz > 0.0 && self.rate_hz.is_finite()) {
            return Err(Error::new(ErrorKind::Config, "expected a rate above 0 frames/s")
                .at(format!("{at}.rate-hz = {}", self.rate_hz))
                .hint(format!("leave it out for {ASSUMED_RATE_HZ} frames/s")));
        }
        if !(0.0..=60.0).contains(&self.late_s) {
            return Err(Error::new(ErrorKind::Config, "expected a time from 0 to 60 s")
                .at(format!("{at}.late-s = {}", self.late_s))
                .hint("1 waits for a sensor on a slow network; 0 takes scans in order only"));
        }
        if self.max_pixels == 0 {
            return Err(Error::new(ErrorKind::Config, "expected a number of pixels above 0")
                .at(format!("{at}.max-pixels = 0"))
                .hint("leave it out for 268 million"));
        }
        if let Some(r) = &self.raw
            && (r.width == 0 || r.height == 0)
        {
            return Err(Error::new(ErrorKind::Config, "expected a width and a height above 0")
                .at(format!("{at}.raw = {} x {}", r.width, r.height))
                .hint("raw frames have no header: their size must be given"));
        }
        Ok(())
    }
}

/// The JSON schema of the configuration, with every key's meaning.
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Config).to_value();
    shorten(&mut schema);
    schema
}

/// Writes single-precision defaults as they stand in the code: 0.1, not the 0.10000000149011612 of its neighbour in `f64`.
fn shorten(at: &mut serde_json::Value) {
    match at {
        serde_json::Value::Number(n) => {
            let single = n.as_f64().filter(|_| n.is_f64()).map(|v| (v, v as f32)).filter(|(v, s)| f64::from(*s) == *v);
            // A double with a single's 24 bits passes too: 0.5, 1e9, not 0.1; of defaults its shortest decimal is the same.
            if let Some(short) =
                single.and_then(|(_, s)| s.to_string().parse().ok()).and_then(serde_json::Number::from_f64)
            {
                *n = short;
            }
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(shorten),
        serde_json::Value::Object(entries) => entries.iter_mut().for_each(|(_, v)| shorten(v)),
        _ => {}
    }
}

impl Config {
    /// Reads a configuration from TOML text; `name` stands in errors (a file's name).
    /// # Errors
    /// A key that is unknown, of the wrong type or out of its range, with its line.
    pub fn from_toml(text: &str, name: &str) -> Result<Self> {
        renamed::refuse_in_file(text, name)?;
        let config: Self = toml::from_str(text).map_err(|e| typo::explain(&e, true).at(name))?;
        config.validate().map_err(|e| e.at(name))?;
        Ok(config)
    }

    /// Reads a configuration file.
    /// # Errors
    /// A file that cannot be read, and what [`Config::from_toml`] refuses.
    pub fn from_file(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| {
            Error::new(ErrorKind::NotFound, "the configuration cannot be read").at(path.display()).because(e).hint("`boresight config > my.toml` writes one with every key's default; each run leaves its own as config.toml")
        })?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Fills in what the configuration leaves to the frames: their size as the field in which tracks are reported.
    pub fn fill_in(&mut self, frames: &SourceInfo) {
        self.tracker.field_px.get_or_insert([frames.width as f64, frames.height as f64]);
    }

    /// Checks every value.
    /// # Errors
    /// The first value out of its range.
    pub fn validate(&self) -> Result<()> {
        self.input.validate("input")?;
        self.detector.validate("detector")?;
        self.tracker.validate("tracker")?;
        self.world.as_ref().map_or(Ok(()), |world| World::new(world).map(|_| ()))
    }

    /// Writes the configuration as TOML; reading it back gives the same configuration.
    /// # Errors
    /// Never for a valid configuration.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string_pretty(self).map_err(|e| Error::new(ErrorKind::Config, "cannot be written as TOML").because(e))
    }

    /// Returns the configuration with one key changed: `tracker.gate-probability=0.95`.
    /// # Errors
    /// A text without `=`, an unknown key, a value of the wrong type or out of its range.
    pub fn with(&self, assignment: &str) -> Result<Self> {
        let bad = |what: &str| {
            Error::new(ErrorKind::Config, what.to_string())
                .at(format!("--set {assignment}"))
                .hint("for example --set tracker.gate-probability=0.95 or --set tracker.associator.nearest={}")
        };
        let (key, value) = assignment.split_once('=').ok_or_else(|| bad("expected KEY=VALUE"))?;
        // A bare word is a string, so that enums need no quotes.
        let parsed: toml::Table = toml::from_str(&format!("v = {value}"))
            .or_else(|_| toml::from_str(&format!("v = {:?}", value.trim())))
            .map_err(|_| bad("the value is not TOML"))?;
        let value = parsed.get("v").cloned().ok_or_else(|| bad("the value is empty"))?;
        let name = format!("--set {assignment}");
        renamed::refuse_in_assignment(key.trim(), &value).map_err(|e| e.at(&name))?;
        let changed = |value: toml::Value| -> Result<std::result::Result<Self, toml::de::Error>> {
            let mut tree = toml::Value::try_from(self).map_err(|e| bad(&e.to_string()))?;
            set(&mut tree, key.trim(), value).ok_or_else(|| bad("no such table"))?;
            Ok(toml::from_str(&toml::to_string(&tree).map_err(|e| bad(&e.to_string()))?))
        };
        // A word alone chooses what it names, as it is by default: `detector.filter=gaussian` is `detector.filter.gaussian={}`.
        let chosen = value.as_str().map(|word| {
            toml::Value::Table([(word.to_string(), toml::Value::Table(toml::Table::new()))].into_iter().collect())
        });
        let config = match (changed(value)?, chosen) {
            (Err(e), Some(chosen)) => changed(chosen)?.or(Err(e)),
            (config, _) => config,
        };
        // The text is ours: its lines would say nothing to a user.
        let config: Self = config.map_err(|e| typo::explain(&e, false).at(&name))?;
        config.validate().map_err(|e| e.at(name))?;
        Ok(config)
    }
}

/// Puts a value at a key; a choice on the way there holds one entry only, so choosing another replaces the old one.
fn set(tree: &mut toml::Value, key: &str, value: toml::Value) -> Option<()> {
    let parts: Vec<&str> = key.split('.').collect();
    let (last, path) = parts.split_last()?;
    let schema = schema();
    let (mut at, mut meaning) = (tree, schema.clone());
    for part in path {
        let table = table_for(at, part, is_choice(&schema, &meaning))?;
        at = table.entry(*part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        let inner = children(&schema, &meaning).into_iter().find(|(name, _)| name == part);
        meaning = inner.map_or(serde_json::Value::Null, |(_, inner)| inner);
    }
    table_for(at, last, is_choice(&schema, &meaning))?.insert((*last).to_string(), value);
    Some(())
}

/// The table that is to hold the entry `name`: emptied before, if it is a choice and holds another one.
fn table_for<'t>(at: &'t mut toml::Value, name: &str, is_choice: bool) -> Option<&'t mut toml::Table> {
    if !at.is_table() || (is_choice && at.get(name).is_none()) {
        *at = toml::Value::Table(toml::Table::new());
    }
    at.as_table_mut()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_survives_a_round_trip() {
        let config = Config::default();
        assert_eq!(Config::from_toml(&config.to_toml().unwrap(), "x").unwrap(), config);
    }

    #[test]
    fn the_frames_fill_in_their_size_where_no_field_is_said() {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 320,
            height: 256,
            kind: crate::PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        let mut config = Config::default();
        config.fill_in(&info);
        assert_eq!(config.tracker.field_px, Some([320.0, 256.0]));
        config.tracker.field_px = Some([9.0, 8.0]);
        config.fill_in(&info);
        assert_eq!(config.tracker.field_px, Some([9.0, 8.0]), "what is said holds");
    }

    #[test]
    fn a_misspelt_key_is_named_with_its_line() {
        let e = Config::from_toml("[tracker]\ngate_probability = 0.9\n", "my.toml").unwrap_err().to_string();
        assert!(e.starts_with("my.toml: ") && e.contains("line 2") && e.contains("gate-probability"), "{e}");
    }

    #[test]
    fn a_value_out_of_range_says_what_was_expected() {
        let e = Config::from_toml("[tracker]\ngate-probability = 1.2\n", "my.toml").unwrap_err().to_string();
        assert!(e.contains("tracker.gate-probability = 1.2: expected a probability in (0, 1)"), "{e}");
    }

    #[test]
    fn one_key_can_be_set_and_a_choice_replaced() {
        let config = Config::default().with("tracker.gate-probability=0.5").unwrap();
        assert_eq!(config.tracker.gate_probability, 0.5);
        let config = config.with("detector.threshold.band.low=3").unwrap();
        assert!(config.to_toml().unwrap().contains("[detector.threshold.band]"), "{}", config.to_toml().unwrap());
        let config = config.with("tracker.associator.nearest={}").unwrap();
        assert!(!config.to_toml().unwrap().contains("global-nearest"));
        let config = config.with("detector.filter=gaussian").unwrap();
        assert_eq!(config, config.with("detector.filter.gaussian={}").unwrap(), "a word alone is its default");
        assert!(
            config
                .with("detector.threshold=moving")
                .unwrap()
                .to_toml()
                .unwrap()
                .contains("[detector.threshold.moving]")
        );
        let e = config.with("tracker.gate-probability=much").unwrap_err().to_string();
        assert!(e.contains("expected f64"), "{e}");
        assert!(config.with("tracker.gate-probability=2").is_err());
        assert!(config.with("tracker.nonsense=2").is_err());
        assert!(config.with("nonsense").is_err());
    }

    #[test]
    fn merged_measurements_are_on_unless_they_are_switched_off() {
        let enabled = |text: &str| Config::from_toml(text, "x").unwrap().tracker.merged_measurements.enabled;
        assert!(enabled("") && enabled("[tracker.merged-measurements]\nmax-secondary-s = 1.0\n"));
        assert!(!enabled("[tracker.merged-measurements]\nenabled = false\n"));
        let off = Config::default().with("tracker.merged-measurements.enabled=false").unwrap();
        assert!(!off.tracker.merged_measurements.enabled);
        assert_eq!(Config::from_toml(&off.to_toml().unwrap(), "x").unwrap(), off, "off stays off in a written file");
    }

    #[test]
    fn every_choice_can_be_made_anew_after_another() {
        let schema = schema();
        let mut n_choices = 0;
        visit(&schema, &schema, String::new(), &mut |key, choices| {
            n_choices += 1;
            let set = |config: &Config, name: &str| config.with(&format!("{key}.{name}={{}}"));
            // A choice without parameters is a name, not a table.
            let tables = choices.iter().filter_map(|name| Some((name, set(&Config::default(), name).ok()?)));
            let tables: Vec<_> = tables.collect();
            for pair in tables.windows(2) {
                let ((first, config), (second, _)) = (&pair[0], &pair[1]);
                set(config, second).unwrap_or_else(|e| panic!("{second} after {first}: {e}"));
            }
        });
        assert!(n_choices > 10, "{n_choices} choices");
    }

    /// Calls `each` with the key of every choice, and the names that it takes.
    fn visit(root: &serde_json::Value, at: &serde_json::Value, key: String, each: &mut impl FnMut(&str, &[String])) {
        let inner = children(root, at);
        if is_choice(root, at) {
            each(&key, &inner.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>());
        }
        for (name, child) in inner {
            let key = if key.is_empty() { name } else { format!("{key}.{name}") };
            visit(root, &child, key, each);
        }
    }
}
