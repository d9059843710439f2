//! Detections of the other polarity: what false detections of the own one look like, where the noise is as often dark as bright.
//!
//! Source: our own; the idea is the target-decoy comparison of J. E. Elias, S. P. Gygi, Nature Methods 4, 2007. Rims of targets, which the filters answer with the other sign, are left out.
//! Frames come in pairs, so that what stays from one to the next is seen.
//! Limits: what is dark and no noise, gaps between bright things and shadows, counts as noise.

use super::looks;
use super::near::Near;
use super::spread::spread;
use crate::vision::cfar::CfarConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::vision::threshold::spot::DIAMETER_PER_WIDTH;
use crate::vision::threshold::{SpotConfig, ThresholdConfig};
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// Frames looked at, two and two.
const LOOKS: usize = 12;
/// Reach of the rim of a target, in units of its size, and how much stronger than its rim the target is at least.
const RIM_REACH: f64 = 1.5;
const RIM_RATIO: f32 = 2.0;
/// How far a false detection that stays moves from frame to frame, px.
const STAYS_PX: f64 = 1.0;
/// Fewest that stay, and their share of all at least, where false detections last: of white noise 1 % lie so near to one of the next frame by chance, of what codecs leave 4 % (crf 22) to 64 % (crf 28) do.
const FEWEST_LASTING: usize = 5;
const LASTING_SHARE: f64 = 0.1;
/// How far apart copies are, px; and the share of those within a tenth of a pixel, at least, where there are copies: errors of 0.014 px an axis in both of what is measured anew would leave as much.
pub const COPIED_PX: f64 = 0.02;
const NEAR_PX: f64 = 0.1;
const COPIED_SHARE: f64 = 0.4;

/// Scores of detections, rising.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decoys {
    /// Of the own polarity in the frames looked at.
    pub own: Vec<f32>,
    /// Of the other one.
    pub other: Vec<f32>,
    /// How many of these are in the first frame of a pair, and the scores of those that stay to the second.
    pub n_first: usize,
    pub lasting: Vec<f32>,
    /// How many of these stay within [`NEAR_PX`], and within [`COPIED_PX`].
    pub n_near: usize,
    pub n_copied: usize,
}

impl Decoys {
    /// Whether false detections are there again in the next frame, so that to be followed is no sign of a target.
    pub fn last(&self) -> bool {
        self.lasting.len() >= FEWEST_LASTING && self.lasting.len() as f64 >= LASTING_SHARE * self.n_first as f64
    }

    /// Whether some that stay are copies, as a codec makes them, and not things that are seen again: few may be ([`super::lasting::is_copied`] asks for a tenth of all), but then many of those that are near.
    pub fn are_copied(&self) -> bool {
        self.n_copied >= FEWEST_LASTING && self.n_copied as f64 >= COPIED_SHARE * self.n_near as f64
    }
}

/// The detector for the other polarity, where it has one.
fn other_polarity(threshold: &ThresholdConfig) -> Option<ThresholdConfig> {
    Some(match threshold {
        ThresholdConfig::Spot(c) => ThresholdConfig::Spot(SpotConfig { polarity: c.polarity.opposite()?, ..c.clone() }),
        ThresholdConfig::Cfar(c) => ThresholdConfig::Cfar(CfarConfig { polarity: c.polarity.opposite()?, ..c.clone() }),
        ThresholdConfig::Isolated(c) => {
            ThresholdConfig::Isolated(IsolatedConfig { polarity: c.polarity.opposite()?, ..c.clone() })
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
    let rising = |mut scores: Vec<f32>| {
        scores.sort_unstable_by(f32::total_cmp);
        scores
    };
    let noise: Vec<Scan> = own.iter().zip(other).map(|(own, other)| without_rims(other, own)).collect();
    let (mut n_first, mut lasting, mut n_near, mut n_copied) = (0, Vec::new(), 0, 0);
    for (pair, _) in noise.windows(2).zip(places.windows(2)).filter(|(_, k)| k[1] == k[0] + 1) {
        let next = Near::of(&pair[1]);
        n_first += pair[0].detections.len();
        for d in &pair[0].detections {
            let Some((_, far_px)) = next.nearest(d, STAYS_PX) else { continue };
            lasting.push(d.score);
            n_near += usize::from(far_px <= NEAR_PX);
            n_copied += usize::from(far_px <= COPIED_PX);
        }
    }
    Decoys {
        own: rising(own.iter().flat_map(|scan| &scan.detections).map(|d| d.score).collect()),
        other: rising(noise.iter().flat_map(|scan| &scan.detections).map(|d| d.score).collect()),
        n_first,
        lasting: rising(lasting),
        n_near,
        n_copied,
    }
}

/// A scan without the detections near a stronger one of the other polarity: its rim.
fn without_rims(scan: &Scan, other: &Scan) -> Scan {
    let near = Near::of(scan);
    let mut is_rim = vec![false; near.len()];
    for o in &other.detections {
        let reach_px = RIM_REACH * DIAMETER_PER_WIDTH * (o.extent.width_px * o.extent.height_px).sqrt();
        near.within(o, reach_px, |j, _| is_rim[j] |= o.score > RIM_RATIO * near.get(j).score);
    }
    let kept = scan.detections.iter().zip(&is_rim).filter(|(_, rim)| !**rim);
    Scan::at(scan.index, scan.time).with_detections(kept.map(|(d, _)| d.clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, Extent};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

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
        let left: Vec<f32> = without_rims(&dark, &bright).detections.iter().map(|d| d.score).collect();
        assert_eq!(left, [6.0, 3.0]);
        // In the next frame one of those is half a pixel away, the other is not there; the frame after that is no neighbour.
        let next = of(&[(50.0, 31.5, 6.0)]);
        let decoys = of_scans(&[3, 4, 9], &[&bright, &bright, &bright], &[dark, next.clone(), next]);
        assert_eq!((decoys.n_first, &decoys.lasting[..]), (2, &[6.0f32][..]));
        assert_eq!((decoys.own.len(), &decoys.other[..]), (9, &[3.0f32, 6.0, 6.0, 6.0][..]));
        assert_eq!((decoys.n_near, decoys.n_copied), (0, 0));
    }

    #[test]
    fn copies_are_told_from_things_that_are_measured_anew() {
        // Four hundred things 20 px apart, so many of them where they were, the others off by that error in both axes.
        let pair = |n_copies: usize, error_px: f64| {
            let mut rng = ChaCha8Rng::seed_from_u64(6);
            let mut scan = |error_px: f64| {
                let at = (0..400).map(|i| {
                    let e = [(); 2]
                        .map(|()| if i < n_copies { 0.0 } else { error_px * rng.sample::<f64, _>(StandardNormal) });
                    Vector2::new(20.0 * (i % 20) as f64 + e[0], 20.0 * (i / 20) as f64 + e[1])
                });
                Scan::default().with_detections(at.map(|at| Detection::at(at, Matrix2::identity())).collect())
            };
            let noise = [scan(0.0), scan(error_px)];
            of_scans(&[0, 1], &[&Scan::default(), &Scan::default()], &noise)
        };
        let (seen_again, copied) = (pair(0, 0.05), pair(120, 0.2));
        assert!(
            seen_again.last() && seen_again.n_copied >= FEWEST_LASTING && !seen_again.are_copied(),
            "{seen_again:?}"
        );
        assert!(copied.last() && copied.are_copied(), "{copied:?}");
        assert!(!Decoys::default().last() && !Decoys::default().are_copied());
    }
}
