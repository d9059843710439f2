//! Detections of the other polarity: what false detections of the own one look like, where the noise is as often dark as bright.
//!
//! Source: our own; the idea is the target-decoy comparison of J. E. Elias, S. P. Gygi, Nature Methods 4, 2007. Rims of targets, which the filters answer with the other sign, are left out.
//! Frames come in pairs, so that what stays from one to the next is seen.
//! Limits: what is dark and no noise, gaps between bright things and shadows, counts as noise.

use super::looks;
use super::spread::spread;
use crate::vision::cfar::CfarConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::vision::threshold::{Polarity, SpotConfig, ThresholdConfig};
use crate::{Config, Detection, Frame, Result, Scan, SourceInfo};

/// Frames looked at, two and two.
const LOOKS: usize = 12;
/// Reach of the rim of a target, in units of its size, and how much stronger than its rim the target is at least.
const RIM_REACH: f64 = 1.5;
const RIM_RATIO: f32 = 2.0;
/// How far a false detection that stays moves from frame to frame, px.
const STAYS_PX: f64 = 1.0;

/// Scores of detections, rising.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decoys {
    /// Of the own polarity in the frames looked at.
    pub own: Vec<f32>,
    /// Of the other one.
    pub other: Vec<f32>,
    /// Of these the ones in the first frame of a pair, and those of them that stay to the second.
    pub first: Vec<f32>,
    pub lasting: Vec<f32>,
}

/// The detector for the other polarity, where it has one.
fn other_polarity(threshold: &ThresholdConfig) -> Option<ThresholdConfig> {
    let other = |polarity: Polarity| match polarity {
        Polarity::Bright => Some(Polarity::Dark),
        Polarity::Dark => Some(Polarity::Bright),
        Polarity::Both => None,
    };
    Some(match threshold {
        ThresholdConfig::Spot(c) => ThresholdConfig::Spot(SpotConfig { polarity: other(c.polarity)?, ..c.clone() }),
        ThresholdConfig::Cfar(c) => ThresholdConfig::Cfar(CfarConfig { polarity: other(c.polarity)?, ..c.clone() }),
        ThresholdConfig::Isolated(c) => {
            ThresholdConfig::Isolated(IsolatedConfig { polarity: other(c.polarity)?, ..c.clone() })
        }
        _ => return None,
    })
}

/// The detections of both polarities in some of the frames, of which `scans` are what the detector of the configuration made; none where it knows no other polarity.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(
    frames: &[Frame],
    scans: &[Scan],
    config: &Config,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<Decoys>> {
    let Some(threshold) = other_polarity(&config.detector.threshold) else { return Ok(None) };
    let firsts: Vec<usize> = (0..frames.len().min(scans.len()).saturating_sub(1)).collect();
    let mut places: Vec<usize> = spread(&firsts, LOOKS / 2).flat_map(|&k| [k, k + 1]).collect();
    places.dedup();
    let mut other = config.detector.clone();
    other.threshold = threshold;
    let of_other = looks::scans(&other, places.iter().map(|&k| &frames[k]), info, n_threads)?;
    let own: Vec<&Scan> = places.iter().map(|&k| &scans[k]).collect();
    Ok(Some(of_scans(&places, &own, &of_other)))
}

/// The same, of scans of both polarities at these places in time.
fn of_scans(places: &[usize], own: &[&Scan], other: &[Scan]) -> Decoys {
    let noise: Vec<Vec<&Detection>> = own.iter().zip(other).map(|(own, other)| without_rims(other, own)).collect();
    let pairs = || {
        let next = |k: &[usize]| k[1] == k[0] + 1;
        noise.windows(2).zip(places.windows(2)).filter(move |(_, k)| next(k)).map(|(pair, _)| pair)
    };
    let scores = |found: &mut dyn Iterator<Item = &Detection>| {
        let mut scores: Vec<f32> = found.map(|d| d.score).collect();
        scores.sort_unstable_by(f32::total_cmp);
        scores
    };
    let stays = |d: &Detection, next: &[&Detection]| next.iter().any(|n| (n.position - d.position).norm() <= STAYS_PX);
    Decoys {
        own: scores(&mut own.iter().flat_map(|scan| &scan.detections)),
        other: scores(&mut noise.iter().flatten().copied()),
        first: scores(&mut pairs().flat_map(|pair| pair[0].iter().copied())),
        lasting: scores(&mut pairs().flat_map(|p| p[0].iter().copied().filter(|d| stays(d, &p[1])))),
    }
}

/// The detections of a scan but those near a stronger one of the other polarity: its rim.
fn without_rims<'s>(scan: &'s Scan, other: &Scan) -> Vec<&'s Detection> {
    let mut others: Vec<&Detection> = other.detections.iter().collect();
    others.sort_by(|a, b| a.position.y.total_cmp(&b.position.y));
    // A spot with its soft edge is 2.45 times as wide as at half of its height.
    let reach = |o: &Detection| RIM_REACH * 2.45 * (o.extent.width_px * o.extent.height_px).sqrt();
    let farthest = others.iter().map(|o| reach(o)).fold(0.0, f64::max);
    let is_rim = |d: &Detection| {
        let from = others.partition_point(|o| o.position.y < d.position.y - farthest);
        let mut near = others[from..].iter().take_while(|o| o.position.y <= d.position.y + farthest);
        near.any(|o| o.score > RIM_RATIO * d.score && (o.position - d.position).norm() <= reach(o))
    };
    scan.detections.iter().filter(|d| !is_rim(d)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;

    #[test]
    fn a_rim_is_left_out_and_what_lies_farther_away_or_is_as_strong_is_not() {
        let of = |places: &[(f64, f64, f32)]| {
            let detection = |&(x, y, score): &(f64, f64, f32)| Detection {
                score,
                extent: Extent { width_px: 2.75, height_px: 2.75, ..Extent::default() },
                ..Detection::at(nalgebra::Vector2::new(x, y), nalgebra::Matrix2::identity())
            };
            Scan::default().with_detections(places.iter().map(detection).collect())
        };
        let bright = of(&[(50.0, 90.0, 30.0), (50.0, 20.0, 30.0), (100.0, 50.0, 4.0)]);
        let dark = of(&[(60.0, 20.0, 5.0), (50.0, 31.0, 6.0), (50.0, 81.0, 7.0), (100.0, 52.0, 3.0)]);
        let left: Vec<f32> = without_rims(&dark, &bright).iter().map(|d| d.score).collect();
        assert_eq!(left, [6.0, 3.0]);
    }
}
