//! A cluster's box, centroid and covariance.

use super::blob::Blob;
use super::nested::Candidate;
use crate::vision::centroid::{Surroundings, centroid};
use crate::vision::config::DetectorConfig;
use crate::vision::pixel::Pixel;
use crate::vision::region::Region;
use crate::vision::threshold::Side;
use crate::{Detection, Image};

/// Measures the cluster in the box `shape` at `level`, times the sign of the side; its score is that of `best`; `variance`: of a pixel's noise at 0
/// (counts²), and its growth with intensity (counts).
pub fn detection<T: Pixel>(
    image: &Image<T>,
    config: &DetectorConfig,
    side: Side,
    best: &Candidate,
    (shape, level): (&Blob, f64),
    (variance, gain): (f64, f64),
) -> Option<Detection> {
    let sign = if side == Side::Bright { 1.0 } else { -1.0 };
    let region = moments(image, side, shape, sign * level)?;
    let around = Surroundings {
        background: sign * best.background,
        sign,
        variance,
        gain,
        level: Some(sign * level),
        ground: Some(sign * best.background),
    };
    let c = centroid(&region, image, config.centroid.method, &around);
    Some(Detection {
        position: c.position,
        cov: c.cov,
        extent: region.extent(),
        area_px: region.area,
        peak: if side == Side::Bright { region.max } else { region.min },
        sum: c.sum,
        score: best.score as f32,
        class: None,
        velocity: None,
        fit: None,
        age_ns: 0,
        plot: None,
    })
}

/// The moments of a cluster: the pixels beyond its level inside its box.
fn moments<T: Pixel>(image: &Image<T>, side: Side, blob: &Blob, level: f64) -> Option<Region> {
    // Infinite values are no measurement, as NaN is none.
    let (low, high) = match side {
        Side::Bright => T::band(level, f64::MAX),
        Side::Dark => T::band(f64::MIN, level),
    }?;
    let set = |p: &T| *p >= low && *p <= high;
    let mut region: Option<Region> = None;
    for y in blob.top..=blob.bottom {
        let row = image.row(y as usize);
        let mut x = blob.left;
        while x <= blob.right {
            let rest = row.get(x as usize..=blob.right as usize)?;
            let Some(skip) = rest.iter().position(set) else { break };
            let length = rest.iter().skip(skip).position(|p| !set(p)).unwrap_or(rest.len() - skip);
            let start = x + skip as u32;
            let part = Region::of_run(0, y, start, start + length as u32 - 1, row);
            match &mut region {
                Some(r) => r.absorb(&part),
                None => region = Some(part),
            }
            x = start + length as u32;
        }
    }
    region
}
