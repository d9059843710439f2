//! Density of false detections: given, estimated scan by scan, or learnt as a map.
//!
//! Method: detections that no confirmed track took are counted. `per-scan`: their number over the area in view, smoothed
//! over `memory_s`. `map`: the same cell by cell, so that a waving tree is expected where it stands. New targets are among
//! the uncounted; they are few against clutter, and where they are not, too high a density only delays confirmation.
//! Symbols: λ false detections per px² and scan.
//! Limits: the area is the given one or the box of all detections so far; at most [`MOST_CELLS`] cells of a map are kept.

use crate::validate::{not_negative, positive};
use crate::{Result, Scan};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Cells of a map beyond these are not learnt (they keep the given density).
pub const MOST_CELLS: usize = 65_536;

/// Where the clutter density comes from; `clutter-density-per-px2` is where it starts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ClutterConfig {
    /// The given density, everywhere and always.
    #[default]
    Given,
    /// One density, estimated from each scan and smoothed.
    PerScan(PerScanConfig),
    /// A density for each cell of a map, learnt.
    Map(ClutterMapConfig),
}

/// One density, estimated from each scan and smoothed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PerScanConfig {
    /// Time constant of the smoothing, s, above 0.
    pub memory_s: f64,
    /// Area in view, px²; 0: the box of all detections so far.
    pub area_px2: f64,
}

impl Default for PerScanConfig {
    fn default() -> Self {
        Self { memory_s: 2.0, area_px2: 0.0 }
    }
}

/// A density for each cell of a map, learnt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ClutterMapConfig {
    /// Time constant of the learning, s, above 0.
    pub memory_s: f64,
    /// Side of a cell, px, above 0.
    pub cell_px: f64,
}

impl Default for ClutterMapConfig {
    fn default() -> Self {
        Self { memory_s: 10.0, cell_px: 32.0 }
    }
}

impl ClutterConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Given => Ok(()),
            Self::PerScan(c) => {
                positive(&format!("{at}.per-scan"), "memory-s", c.memory_s, "2 s is 60 scans of video")?;
                not_negative(&format!("{at}.per-scan"), "area-px2", c.area_px2, "width times height of the picture")
            }
            Self::Map(c) => {
                positive(&format!("{at}.map"), "memory-s", c.memory_s, "10 s is 300 scans of video")?;
                positive(&format!("{at}.map"), "cell-px", c.cell_px, "32 px holds a bush")
            }
        }
    }
}

/// The density in use.
#[derive(Clone)]
pub(super) struct Clutter {
    config: ClutterConfig,
    given: f64,
    /// Estimated density, 1/px².
    one: f64,
    /// Box of all detections so far: left, top, right, bottom.
    seen: [f64; 4],
    /// Density of each cell, 1/px².
    map: BTreeMap<(i64, i64), f64>,
    /// Cells of the detections that nobody took, sorted: scratch.
    free: Vec<(i64, i64)>,
}

impl Clutter {
    pub fn new(config: &ClutterConfig, given: f64) -> Self {
        let inf = f64::INFINITY;
        let seen = [inf, inf, -inf, -inf];
        Self { config: config.clone(), given, one: given, seen, map: BTreeMap::new(), free: Vec::new() }
    }

    /// Takes another given density; what was learnt stays.
    pub fn set_given(&mut self, given: f64) {
        self.given = given;
    }

    /// Whether each detection has a density of its own.
    pub fn is_map(&self) -> bool {
        matches!(self.config, ClutterConfig::Map(_))
    }

    /// The density where nothing more is known, 1/px².
    pub fn density(&self) -> f64 {
        if matches!(self.config, ClutterConfig::PerScan(_)) { self.one } else { self.given }
    }

    /// The density at a place, 1/px².
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let ClutterConfig::Map(c) = &self.config else { return self.density() };
        // Never below a share of the given density: a cell where nothing was seen yet is not free of clutter for ever.
        self.map.get(&cell(x, y, c.cell_px)).map_or(self.given, |v| v.max(0.1 * self.given))
    }

    /// Takes in a scan after association; `taken[j]` says that a confirmed track took detection j.
    pub fn learn(&mut self, scan: &Scan, taken: &[bool], dt_s: f64) {
        match &self.config {
            ClutterConfig::Given => {}
            ClutterConfig::PerScan(c) => {
                for d in &scan.detections {
                    let (x, y) = (d.position.x, d.position.y);
                    self.seen = [self.seen[0].min(x), self.seen[1].min(y), self.seen[2].max(x), self.seen[3].max(y)];
                }
                let box_px2 = (self.seen[2] - self.seen[0]).max(0.0) * (self.seen[3] - self.seen[1]).max(0.0);
                let area_px2 = if c.area_px2 > 0.0 { c.area_px2 } else { box_px2 };
                if area_px2 > 0.0 {
                    let n = taken.iter().filter(|t| !**t).count();
                    let gain = 1.0 - (-dt_s / c.memory_s).exp();
                    self.one += gain * (n as f64 / area_px2 - self.one);
                    self.one = self.one.max(1e-3 / area_px2);
                }
            }
            ClutterConfig::Map(c) => {
                self.free.clear();
                let free = scan.detections.iter().zip(taken).filter(|(_, taken)| !**taken);
                self.free.extend(free.map(|(d, _)| cell(d.position.x, d.position.y, c.cell_px)));
                self.free.sort_unstable();
                let keep = (-dt_s / c.memory_s).exp();
                for v in self.map.values_mut() {
                    *v *= keep;
                }
                for same in self.free.chunk_by(|a, b| a == b) {
                    let full = self.map.len() >= MOST_CELLS;
                    if !full || self.map.contains_key(&same[0]) {
                        let v = self.map.entry(same[0]).or_insert(self.given);
                        *v += (1.0 - keep) * same.len() as f64 / (c.cell_px * c.cell_px);
                    }
                }
            }
        }
    }
}

fn cell(x: f64, y: f64, side: f64) -> (i64, i64) {
    ((x / side).floor() as i64, (y / side).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    fn scan(points: &[(f64, f64)]) -> Scan {
        let detection = |p: &(f64, f64)| Detection::at(Vector2::new(p.0, p.1), Matrix2::identity());
        Scan::at(FrameIndex::default(), Timestamp::default()).with_detections(points.iter().map(detection).collect())
    }

    #[test]
    fn a_bush_is_learnt_where_it_stands() {
        let mut clutter = Clutter::new(&ClutterConfig::Map(ClutterMapConfig::default()), 1e-5);
        for _ in 0..1000 {
            clutter.learn(&scan(&[(40.0, 40.0), (45.0, 50.0)]), &[false, false], 0.1);
        }
        assert!((clutter.at(50.0, 60.0) - 2.0 / 1024.0).abs() < 1e-4, "{}", clutter.at(50.0, 60.0));
        assert_eq!(clutter.at(500.0, 60.0), 1e-5);
    }

    #[test]
    fn the_scan_estimate_settles_on_the_count_over_the_area() {
        let config = ClutterConfig::PerScan(PerScanConfig { area_px2: 1000.0, ..PerScanConfig::default() });
        let mut clutter = Clutter::new(&config, 1e-5);
        for _ in 0..200 {
            clutter.learn(&scan(&[(1.0, 1.0), (5.0, 9.0), (4.0, 4.0)]), &[false, true, false], 0.1);
        }
        assert!((clutter.density() - 0.002).abs() < 1e-6);
    }

    #[test]
    fn each_cell_learns_what_was_seen_in_it_and_not_taken() {
        let config = ClutterMapConfig { cell_px: 10.0, memory_s: 1.0 };
        let mut clutter = Clutter::new(&ClutterConfig::Map(config), 1e-5);
        // Two free ones in the first cell, one in the next, one taken in the third.
        let seen = scan(&[(1.0, 1.0), (12.0, 1.0), (25.0, 1.0), (2.0, 8.0)]);
        for _ in 0..200 {
            clutter.learn(&seen, &[false, false, true, false], 0.1);
        }
        assert!((clutter.at(9.0, 9.0) - 0.02).abs() < 1e-6, "{}", clutter.at(9.0, 9.0));
        assert!((clutter.at(19.0, 9.0) - 0.01).abs() < 1e-6, "{}", clutter.at(19.0, 9.0));
        assert_eq!(clutter.at(25.0, 1.0), 1e-5);
    }

    #[test]
    fn without_an_area_it_is_that_of_the_box_in_which_anything_was_seen() {
        let mut clutter = Clutter::new(&ClutterConfig::PerScan(PerScanConfig::default()), 1e-5);
        for _ in 0..2000 {
            clutter.learn(&scan(&[(10.0, 5.0), (50.0, 25.0), (20.0, 10.0)]), &[false; 3], 1.0);
        }
        // 3 in 40 x 20 px.
        assert!((clutter.density() - 3.0 / 800.0).abs() < 1e-9, "{}", clutter.density());
    }
}
