//! How many sightings there are of a scan, place by place: what a chain of them is weighed against.
//!
//! Source: our own. Of the whole field or, where there are more, of the nine cells around a place, less one a scan: a target's own.

use super::sightings::Sightings;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Cells of the map of densities along the root of the field's area.
const CELLS: f64 = 24.0;

/// The density of sightings, place by place.
pub struct Density {
    whole: f64,
    cell_px: f64,
    scans: f64,
    counts: BTreeMap<(i64, i64), f64>,
}

impl Density {
    /// That of scans in a field of that area, px².
    pub fn of(scans: &[Sightings], area_px2: f64) -> Self {
        let n_all: usize = scans.iter().map(|s| s.all.len()).sum();
        let n_scans = scans.len().max(1) as f64;
        let whole = (n_all as f64 / n_scans / area_px2.max(1.0)).max(1e-12);
        let cell_px = area_px2.max(1.0).sqrt() / CELLS;
        let mut out = Self { whole, cell_px, scans: n_scans, counts: BTreeMap::new() };
        for s in scans.iter().flat_map(|s| &s.all) {
            let (x, y) = out.cell(s.at);
            for (dx, dy) in (0..9).map(|i| (i % 3 - 1, i / 3 - 1)) {
                *out.counts.entry((x + dx, y + dy)).or_default() += 1.0;
            }
        }
        out
    }

    fn cell(&self, at: Vector2<f64>) -> (i64, i64) {
        ((at.x / self.cell_px).floor() as i64, (at.y / self.cell_px).floor() as i64)
    }

    /// Sightings per px² and scan at a place.
    pub fn at(&self, place: Vector2<f64>) -> f64 {
        let n = self.counts.get(&self.cell(place)).copied().unwrap_or(0.0) - self.scans;
        self.whole.max(n / (9.0 * self.cell_px * self.cell_px * self.scans))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::sightings::Sighting;

    #[test]
    fn a_patch_is_dense_and_a_target_does_not_count_against_itself() {
        // A field of 240 px with cells of 10 px: 90 sightings a scan in a patch of 30 px, and one thing that stands elsewhere.
        let scans: Vec<Sightings> = (0..10)
            .map(|k| {
                let patch =
                    (0..90).map(|i| Vector2::new(30.0 + f64::from(i % 10) * 3.0, 30.0 + f64::from(i / 10) * 3.3));
                let all = patch.chain([Vector2::new(200.0, 200.0)]);
                let sighting = |at| Sighting { at, variance: 0.1, side_px: 2.0, thickness_px: 2.0, score: 0.0 };
                Sightings { time_s: f64::from(k), all: all.map(sighting).collect() }
            })
            .collect();
        let density = Density::of(&scans, 240.0 * 240.0);
        assert!((density.at(Vector2::new(45.0, 45.0)) - 89.0 / 900.0).abs() < 1e-9);
        assert!((density.at(Vector2::new(200.0, 200.0)) - 91.0 / 57_600.0).abs() < 1e-9);
        assert!(Density::of(&[], 0.0).at(Vector2::zeros()) > 0.0);
    }
}
