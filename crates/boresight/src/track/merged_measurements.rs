//! Merged measurements: one detection that several tracks predict is split among them, until they part again.
//!
//! Method (ours; docs/theory/track-management.md): a confirmed track without a detection whose predicted centre lies inside a
//! detection's box shares that detection with the track that took it. Along each axis the outer members are placed by the box's edges
//! and their own size from before (the leftmost at left + w/2, the rightmost at right − w/2); members between keep their predicted place
//! relative to the centre. Or one member alone makes both edges, as a large target does that a small one crosses: then it stands in the box's middle, and of the others only
//! is known that they lie within. Which of all these it is is not known: every pair, and every member as both, is weighed by how likely it makes the two edges, and a member's
//! place is the mean over them, with their spread added to its noise. So what passes keeps its velocity, and is not turned back at an edge that
//! is the other's by then. Sizes do not follow while merged. The member that fits best is primary; the others are secondary and live on
//! the time that they were seen alone before (`step/delete.rs`), so a target that ended inside another does not live for ever.
//! Symbols: p variance of a member's predicted place and n of an edge (px²), s = p + n; a pair (l, r) weighs exp(−(left + w_l/2 − x_l)²/2s_l − (right − w_r/2 − x_r)²/2s_r)/√(s_l s_r);
//! one member as both, its errors of the box's middle m and width w: exp(−(m − x)²/2(p + n/2) − (right − left − w)²/4n)/√(2n(p + n/2)). All are densities of the same two edges.
//! Limits: needs boxes; the axes are taken one by one.

use super::appearance::Appearance;
use super::scan_table::{Cov2, MOST_LOOKED_AT, Predicted, ScanTable};
use crate::validate::not_negative;
use crate::{Result, Scan};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Merged measurements: one detection of several targets is split among their tracks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MergedMeasurementsConfig {
    /// Whether detections are split at all; off: a detection belongs to one track only. On where the table is left out.
    pub enabled: bool,
    /// Longest time a track is kept on detections that fit another track better, s, 0 or more; and no longer than eight times as long as it was seen alone.
    pub max_secondary_s: f64,
    /// Standard deviation of a box edge, px, 0 or more: noise of the places found from edges.
    pub edge_std_px: f64,
}

impl Default for MergedMeasurementsConfig {
    fn default() -> Self {
        Self { enabled: true, max_secondary_s: 2.0, edge_std_px: 0.7 }
    }
}

impl MergedMeasurementsConfig {
    /// Switched off: a detection belongs to one track only.
    pub fn off() -> Self {
        Self { enabled: false, ..Self::default() }
    }

    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        not_negative(at, "max-secondary-s", self.max_secondary_s, "2 s bridges people who pass each other")?;
        not_negative(at, "edge-std-px", self.edge_std_px, "0.7 px suits thresholded blobs")
    }
}

/// One member's part of a merged measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    pub track: u32,
    pub detection: u32,
    pub position: [f64; 2],
    pub noise: Cov2,
    /// Whether this member fits best.
    pub primary: bool,
    /// Whether what is not known of who makes which edge adds no more to the noise than the innovation covariance is without it, along both axes: else the innovation says
    /// nothing of the filter.
    pub measures: bool,
}

/// Finds which tracks a detection is merged of; keeps its memory.
#[derive(Default)]
pub(super) struct MergedMeasurements {
    members: Vec<(u32, u32)>,
    pub parts: Vec<Part>,
    group: Vec<u32>,
    outer: Vec<Outer>,
}

impl MergedMeasurements {
    /// Finds the parts. `taker[j]` is the confirmed track that took detection j (or `u32::MAX`), `missed` the confirmed
    /// tracks without a detection, ascending.
    pub fn find(
        &mut self,
        config: &MergedMeasurementsConfig,
        scan: &Scan,
        table: &ScanTable,
        predicted: &[Predicted],
        appearance: impl Fn(u32) -> Appearance,
        taker: &[u32],
        missed: &[u32],
    ) {
        let [half_x, half_y] = table.largest_half_px;
        self.members.clear();
        self.parts.clear();
        for i in missed {
            let p = &predicted[*i as usize];
            let mut best: Option<(f64, u32)> = None;
            let mut looked_at = 0;
            table.grid().near(p.x, p.y, half_x, half_y, |g| {
                looked_at += 1;
                let e = &scan.detections[g.index as usize].extent;
                let (dx, dy) = (p.x - e.left_px, p.y - e.top_px);
                let inside = dx >= 0.0 && dy >= 0.0 && dx <= e.width_px && dy <= e.height_px;
                let d = (p.x - g.x).powi(2) + (p.y - g.y).powi(2);
                if inside && best.is_none_or(|(b, j)| d < b || (d == b && g.index < j)) {
                    best = Some((d, g.index));
                }
                looked_at < MOST_LOOKED_AT
            });
            if let Some((_, j)) = best {
                self.members.push((j, *i));
            }
        }
        self.members.sort_unstable();
        let mut from = 0;
        while from < self.members.len() {
            let j = self.members[from].0;
            let to = from + self.members[from..].iter().take_while(|m| m.0 == j).count();
            let took = taker[j as usize];
            let mut group = std::mem::take(&mut self.group);
            group.clear();
            group.extend(self.members[from..to].iter().map(|m| m.1));
            if took != u32::MAX {
                group.push(took);
            }
            if group.len() > 1 {
                self.split(config, scan, table, predicted, &appearance, j, took, &group);
            }
            self.group = group;
            from = to;
        }
        self.parts.sort_unstable_by_key(|p| p.track);
    }

    fn split(
        &mut self,
        config: &MergedMeasurementsConfig,
        scan: &Scan,
        table: &ScanTable,
        predicted: &[Predicted],
        appearance: &impl Fn(u32) -> Appearance,
        j: u32,
        took: u32,
        group: &[u32],
    ) {
        let d = &scan.detections[j as usize];
        let noise = table.noise(j);
        let first = self.parts.len();
        let off = |i: u32| {
            let p = &predicted[i as usize];
            (p.x - d.position.x).powi(2) + (p.y - d.position.y).powi(2)
        };
        let nearest = group.iter().copied().min_by(|a, b| off(*a).total_cmp(&off(*b)).then(a.cmp(b)));
        let primary = if took != u32::MAX { Some(took) } else { nearest };
        let edge = config.edge_std_px * config.edge_std_px;
        for i in group {
            let noise = Cov2 { xx: noise.xx + edge, xy: noise.xy, yy: noise.yy + edge };
            self.parts.push(Part {
                track: *i,
                detection: j,
                position: [0.0; 2],
                noise,
                primary: Some(*i) == primary,
                measures: true,
            });
        }
        for axis in 0..2 {
            let (low, high) = if axis == 0 {
                (d.extent.left_px, d.extent.left_px + d.extent.width_px)
            } else {
                (d.extent.top_px, d.extent.top_px + d.extent.height_px)
            };
            let place = |i: u32| if axis == 0 { predicted[i as usize].x } else { predicted[i as usize].y };
            let parts = &mut self.parts[first..];
            let mean = group.iter().map(|i| place(*i)).sum::<f64>() / group.len() as f64;
            self.outer.clear();
            self.outer.extend(group.iter().zip(&*parts).map(|(i, part)| {
                let cov = &predicted[*i as usize].cov;
                Outer {
                    edges: [low, high],
                    size: appearance(*i).size[axis],
                    between: 0.5 * (low + high) + place(*i) - mean,
                    predicted: place(*i),
                    variance: if axis == 0 { [cov.xx, part.noise.xx] } else { [cov.yy, part.noise.yy] },
                    share: [0.0; 4],
                }
            }));
            weigh(&mut self.outer);
            for (part, outer) in parts.iter_mut().zip(&self.outer) {
                let (position, variance) = outer.place();
                part.position[axis] = position;
                part.measures &= variance <= outer.variance.iter().sum();
                *(if axis == 0 { &mut part.noise.xx } else { &mut part.noise.yy }) += variance;
            }
        }
    }
}

/// What one member would be along one axis.
#[derive(Clone, Copy, Debug)]
struct Outer {
    /// Of the box.
    edges: [f64; 2],
    size: f64,
    /// Its place between others.
    between: f64,
    predicted: f64,
    /// Of the prediction, and of an edge.
    variance: [f64; 2],
    /// Probability to make the first edge, the last one, both, and that another member makes both.
    share: [f64; 4],
}

impl Outer {
    /// Half of its size, no more than half of the box.
    fn half(&self) -> f64 {
        0.5 * self.size.min(self.edges[1] - self.edges[0])
    }

    /// Mean and variance over what it may be.
    fn place(&self) -> (f64, f64) {
        let [low, high] = self.edges;
        let [first, last] = [low + self.half(), high - self.half()];
        let inner = (1.0 - self.share.iter().sum::<f64>()).max(0.0);
        let within = self.predicted.max(first).min(last);
        let places = [
            (self.share[0], first),
            (self.share[1], last),
            (self.share[2], 0.5 * (low + high)),
            (self.share[3], within),
            (inner, self.between),
        ];
        let mean = places.iter().map(|(share, at)| share * at).sum::<f64>();
        let spread = places.iter().map(|(share, at)| share * (at - mean).powi(2)).sum::<f64>();
        (mean, spread + self.share[3] * (last - first).powi(2) / 12.0)
    }

    /// Log-density of the edge at one end, made by this member.
    fn one_edge(&self, end: usize) -> f64 {
        let at = if end == 0 { self.edges[0] + self.half() } else { self.edges[1] - self.half() };
        log_density(at - self.predicted, self.variance[0] + self.variance[1])
    }

    /// Log-density of both edges, made by this member.
    fn both_edges(&self) -> f64 {
        let [low, high] = self.edges;
        let [place, edge] = self.variance;
        log_density(0.5 * (low + high) - self.predicted, place + 0.5 * edge)
            + log_density(high - low - self.size, 2.0 * edge)
    }
}

/// Of a normal error, without the constant that all share.
fn log_density(error: f64, variance: f64) -> f64 {
    -0.5 * (error.powi(2) / variance + variance.ln())
}

/// Weighs every pair of a first and a last member, and every member as both.
fn weigh(members: &mut [Outer]) {
    let pairs = |n: usize| (0..n).flat_map(move |l| (0..n).map(move |r| (l, r)));
    let n = members.len();
    let fit = |members: &[Outer], l: usize, r: usize| {
        if l == r { members[l].both_edges() } else { members[l].one_edge(0) + members[r].one_edge(1) }
    };
    let most = pairs(n).map(|(l, r)| fit(members, l, r)).fold(f64::NEG_INFINITY, f64::max);
    let (mut all, mut alone) = (0.0, 0.0);
    for (l, r) in pairs(n) {
        let weight = (fit(members, l, r) - most).exp();
        if l == r {
            members[l].share[2] += weight;
            alone += weight;
        } else {
            members[l].share[0] += weight;
            members[r].share[1] += weight;
        }
        all += weight;
    }
    for m in members {
        m.share[3] = (alone - m.share[2]).max(0.0);
        m.share = m.share.map(|s| s / all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, Extent};
    use nalgebra::{Matrix2, Vector2};

    /// Box from (10, 0) to (30, 4) px, its centre at (20, 2), variance 1 px².
    fn blob() -> Detection {
        let extent = Extent { left_px: 10.0, top_px: 0.0, width_px: 20.0, height_px: 4.0 };
        Detection::at(Vector2::new(20.0, 2.0), Matrix2::identity()).with_extent(extent)
    }

    /// Parts of the blob among tracks at these x (px) of these widths (px); `taker` took it, `missed` took nothing.
    fn parts(x: &[f64], width: &[f64], taker: Option<u32>, missed: &[u32]) -> Vec<Part> {
        let scan = Scan { detections: vec![blob()], ..Scan::default() };
        let mut table = ScanTable::default();
        table.read(&scan, 1.0, 0.0, 0.0).unwrap();
        table.sort(&scan);
        let cov = Cov2 { xx: 1.0, xy: 0.0, yy: 1.0 };
        let predicted: Vec<Predicted> = x.iter().map(|x| Predicted { x: *x, y: 2.0, cov, reach: 99.0 }).collect();
        let appearance = |i: u32| Appearance { size: [width[i as usize], 4.0], sum: 1.0, class: None };
        let mut merged = MergedMeasurements::default();
        let config = MergedMeasurementsConfig::default();
        merged.find(&config, &scan, &table, &predicted, appearance, &[taker.unwrap_or(u32::MAX)], missed);
        merged.parts
    }

    #[test]
    fn outer_members_stand_at_the_edges_and_inner_ones_keep_their_place_to_the_centre() {
        // Left edge 10 + 6/2, right edge 30 − 8/2; between: 20 + 19 − (13 + 19 + 27)/3. Other pairs weigh e^-10 at most (a shift of 7 px with a variance of 2.5 px²).
        let parts = parts(&[13.0, 19.0, 27.0], &[6.0, 4.0, 8.0], Some(2), &[0, 1]);
        let x: Vec<f64> = parts.iter().map(|p| p.position[0]).collect();
        assert!((x[0] - 13.0).abs() < 1e-3 && (x[2] - 26.0).abs() < 1e-3, "{x:?}");
        assert!((x[1] - (39.0 - 59.0 / 3.0)).abs() < 1e-3, "{}", x[1]);
        assert!(parts.iter().all(|p| (p.position[1] - 2.0).abs() < 1e-12 && p.detection == 0));
        assert_eq!(parts.iter().map(|p| p.track).collect::<Vec<_>>(), [0, 1, 2]);
        assert!(parts.iter().all(|p| p.measures));
        // The detection's own variance and that of an edge, 0.7 px.
        assert!(parts.iter().all(|p| (p.noise.xx - 1.49).abs() < 0.01 && (p.noise.yy - 1.49).abs() < 1e-12));
    }

    #[test]
    fn who_took_the_detection_is_primary_and_without_one_the_nearest() {
        let primary = |taker, missed: &[u32]| {
            let parts = parts(&[13.0, 19.0, 27.0], &[6.0; 3], taker, missed);
            parts.iter().filter(|p| p.primary).map(|p| p.track).collect::<Vec<_>>()
        };
        assert_eq!(primary(Some(2), &[0, 1]), [2]);
        assert_eq!(primary(None, &[0, 1, 2]), [1]);
    }

    #[test]
    fn members_that_pass_each_other_are_placed_by_no_edge() {
        // Both predicted in the middle: each is the left one or the right one, 13 or 27 px, and no place is better.
        let parts = parts(&[20.0, 20.0], &[6.0; 2], Some(1), &[0]);
        for part in &parts {
            assert!((part.position[0] - 20.0).abs() < 1e-12, "{}", part.position[0]);
            // Either one as both edges weighs e^(−14²/(4 · 1.49) + 2 · 7²/(2 · 2.49)) = 2·10⁻⁶ beside that, and then nothing is added.
            assert!((part.noise.xx - 1.49 - 49.0).abs() < 1e-3, "{}", part.noise.xx);
            assert!(!part.measures);
        }
    }

    #[test]
    fn a_small_member_that_crosses_a_large_one_is_placed_by_neither_edge() {
        // The box is as wide as the large one was: it alone makes both edges. By its own edges the small one would stand at 11 or 29 px.
        let parts = parts(&[20.0, 21.0], &[20.0, 2.0], Some(0), &[1]);
        assert_eq!(parts.len(), 2);
        let (large, small) = (parts[0], parts[1]);
        assert!(
            (large.position[0] - 20.0).abs() < 1e-3 && (large.noise.xx - 1.49).abs() < 0.01 && large.measures,
            "{large:?}"
        );
        // Anywhere in the 18 px that it has: 18²/12.
        assert!(
            (small.position[0] - 21.0).abs() < 0.02 && (small.noise.xx - 1.49 - 27.0).abs() < 0.1 && !small.measures,
            "{small:?}"
        );
    }

    #[test]
    fn a_member_wider_than_the_box_stands_in_its_middle() {
        let parts = parts(&[15.0, 25.0], &[90.0, 2.0], None, &[0, 1]);
        let x: Vec<f64> = parts.iter().map(|p| p.position[0]).collect();
        assert!(x[0] == 20.0 && (x[1] - 29.0).abs() < 1e-3, "{x:?}");
    }

    #[test]
    fn one_track_alone_or_outside_the_box_shares_nothing() {
        assert!(parts(&[13.0], &[6.0], None, &[0]).is_empty());
        assert!(parts(&[9.9, 20.0], &[6.0; 2], Some(1), &[0]).is_empty());
        assert_eq!(parts(&[10.0, 20.0], &[6.0; 2], Some(1), &[0]).len(), 2);
        assert!(parts(&[30.1, 20.0], &[6.0; 2], Some(1), &[0]).is_empty());
    }
}
