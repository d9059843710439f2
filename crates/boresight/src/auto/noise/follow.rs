//! The tracks of a first pass as series of positions, on steady ground.
//!
//! Source: our own. What several tracks share, and what is copied from the frame before, is no measurement of one target.

use super::super::first_scans::Shares;
use super::fit::Step;
use crate::camera::SteadyGround;
use crate::track::TrackerConfig;
use crate::{Result, Scan, TrackStatus};
use std::collections::BTreeMap;

/// A position within this share of the stated deviation of the one before, along both axes, is a copy: what a codec copies differs by the digits of the ground measured around it, and two
/// measurements come so near each other once in eight thousand.
const COPY: f64 = 0.02;

/// What is known of one track of the first pass.
#[derive(Default)]
pub(super) struct Followed {
    pub(super) steps: Vec<Step>,
    last_ns: i64,
    /// Width and height of each detection, px.
    pub(super) sizes: [Vec<f64>; 2],
    confirmed: bool,
}

/// Runs the tracker over `scans` and returns what it confirmed.
pub(super) fn follow(scans: &[Scan], config: &TrackerConfig) -> Result<BTreeMap<u64, Followed>> {
    let mut tracker = crate::track::build(config)?;
    let mut tracks: BTreeMap<u64, Followed> = BTreeMap::new();
    let (mut ground, mut on_ground) = (SteadyGround::default(), Scan::default());
    let mut shares = Shares::default();
    for scan in scans {
        let states = tracker.step(scan)?;
        ground = ground.after(scan);
        ground.scan_on_ground(scan, &mut on_ground);
        shares.count(scan.detections.len(), states);
        for s in states {
            let of = tracks.entry(s.id.0).or_default();
            of.confirmed |= s.status != TrackStatus::Tentative;
            let Some(j) = s.detection else { continue };
            if !shares.is_one(j) {
                continue;
            }
            let d = &on_ground.detections[j as usize];
            let position = [d.position.x, d.position.y];
            // A picture that is shown again, or a block that a codec copies, measures nothing anew; taken for measurements without error they would make the noise nothing.
            if of.steps.last().is_some_and(|before| is_copy(position, before)) {
                continue;
            }
            let seen_ns = scan.time.ns.saturating_sub_unsigned(d.age_ns);
            let dt_s = if of.steps.is_empty() { 0.0 } else { (seen_ns - of.last_ns).max(0) as f64 * 1e-9 };
            of.last_ns = seen_ns;
            of.sizes[0].push(d.extent.width_px);
            of.sizes[1].push(d.extent.height_px);
            let variance = [d.cov[(0, 0)], d.cov[(1, 1)]];
            of.steps.push(Step { dt_s, position, variance, height_px: d.extent.height_px, weight: 1.0 });
        }
    }
    tracks.retain(|_, t| t.confirmed);
    Ok(tracks)
}

/// Whether a position is a copy of the one before.
pub(in super::super) fn is_copy(position: [f64; 2], before: &Step) -> bool {
    (0..2).all(|axis| {
        let far = position[axis] - before.position[axis];
        far * far <= COPY * COPY * before.variance[axis]
    })
}
