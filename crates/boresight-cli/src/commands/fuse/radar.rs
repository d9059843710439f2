//! `fuse --register range,azimuth`: the biases of a radar, said in the sense of its table, and taken off.

use super::input::Sensor;
use crate::console::say;
use boresight::fuse::{PolarConfig, Timeline, register_polar};
use boresight::io::{AzimuthFrom, LengthUnit};
use boresight::{Config, Error, ErrorKind};
use nalgebra::{Matrix2, Rotation2, Vector2};

/// Estimates the biases (`what`: range, azimuth) of the radar `b` from `a` and takes them off its tracks and plots.
pub fn register(
    a: &Sensor,
    b: &mut Sensor,
    what: [bool; 2],
    pivot: Option<&[f64]>,
    max_gap_s: f64,
    config: Option<&Config>,
) -> boresight::Result<()> {
    let place = pivot.and_then(|p| p.first_chunk::<2>().copied());
    if place.is_none() && b.radar.is_none() {
        let e = Error::new(ErrorKind::Config, "the second table does not say where its radar was");
        return Err(e
            .at("--register range,azimuth")
            .hint("give the radar's plots (range and azimuth, ownship.csv beside them), or its place: --pivot X,Y"));
    }
    let picture = b.radar.clone();
    let own = |t: f64| place.or(picture.as_ref().map(|r| r.own_at(t))).unwrap_or_default();
    // Plots have errors of their own; those of tracks hang together, so that the deviations found would be too small.
    let seen: &[Timeline] = if b.plots.is_empty() { &b.tracks } else { &b.plots };
    let polar = PolarConfig { range: what[0], azimuth: what[1], max_gap_s, ..PolarConfig::default() };
    let found = register_polar(&a.tracks, seen, own, &polar)?;
    let unit = picture.as_ref().map(|r| r.unit).unwrap_or_default();
    let from = config.map(|c| c.input.table.radar.azimuth_from).unwrap_or_default();
    // The table counts clockwise, unless it counts from the x axis.
    let sense = if from == AzimuthFrom::XAxis { 1.0 } else { -1.0 };
    let (azimuth_deg, std_deg) = (sense * found.azimuth_rad.to_degrees(), found.cov[(1, 1)].sqrt().to_degrees());
    let (range, std) = (found.range, found.cov[(0, 0)].sqrt());
    let mut said = Vec::new();
    let mut keys = Vec::new();
    if what[0] {
        said.push(format!("range {range:.1} ± {std:.1} {}", unit.sign()));
        keys.push(format!("--set input.table.radar.range-bias-m={range:.1}"));
    }
    if what[1] {
        said.push(format!("azimuth {azimuth_deg:.3} ± {std_deg:.3} degrees"));
        keys.push(format!("--set input.table.radar.azimuth-bias-deg={azimuth_deg:.3}"));
    }
    say!(
        "radar's bias from {} common points of {} pairs of tracks: {}; mean d² {:.2} -> {:.2}",
        found.n_points,
        found.pairs.len(),
        said.join(", "),
        found.mean_d2[0],
        found.mean_d2[1]
    );
    if unit == LengthUnit::Metre {
        say!("  to track without it: {}", keys.join(" "));
    }
    if b.plots.is_empty() {
        say!("  errors of tracks hang together in time: the deviations are too small; plots give honest ones");
    }
    b.tracks = b.tracks.iter().map(|t| found.timeline(t, own)).collect();
    let turn: Matrix2<f64> = *Rotation2::new(-found.azimuth_rad).matrix();
    for scan in b.scans.iter_mut().flatten() {
        let time_s = scan.time.as_secs_f64();
        for d in &mut scan.detections {
            let at = Vector2::from(own(time_s - d.age_ns as f64 * 1e-9));
            let moved = found.position(d.position, at) - d.position;
            d.position += moved;
            d.extent.left_px += moved.x;
            d.extent.top_px += moved.y;
            d.cov = turn * d.cov * turn.transpose();
        }
    }
    Ok(())
}
