//! Detections as chains see them: where on steady ground, and how sure.

use super::ground::Ground;
use crate::Scan;
use nalgebra::Vector2;

/// Detections of a scan that are looked at: the number of first steps grows with the square.
pub const MOST_A_SCAN: usize = 150;
/// A centre is known no better than this, px: pixels are of finite size and outlines wander.
const LEAST_STD_PX: f64 = 0.2;
/// And no better than this share of its box.
const SHARE_OF_SIDE: f64 = 0.05;

/// A detection as a chain sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Position on steady ground, px.
    pub at: Vector2<f64>,
    /// Variance per axis, px².
    pub variance: f64,
    /// Longer side of its box, px.
    pub side_px: f64,
    /// Its area over that side, px; that side where no area is known.
    pub thickness_px: f64,
    /// How clearly it stands out, in the detector's measure; 0 where that is not known.
    pub score: f64,
}

impl Sighting {
    /// The middle of a box of that longer side, px, known to that variance, px².
    pub fn of_box(at: Vector2<f64>, variance: f64, side_px: f64) -> Self {
        let variance = variance + LEAST_STD_PX.powi(2) + (SHARE_OF_SIDE * side_px).powi(2);
        Self { at, variance, side_px, thickness_px: side_px, score: 0.0 }
    }

    /// Whether it touches another one, or nearly does: an edge or a shadow touches its thing.
    pub fn touches(&self, other: &Self) -> bool {
        (self.at - other.at).norm() <= self.side_px + other.side_px + 2.0
    }
}

/// The sightings of one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sightings {
    /// Time, s.
    pub time_s: f64,
    /// The strongest first.
    pub all: Vec<Sighting>,
}

impl Sightings {
    /// Those of a scan; `ground` tells where the steady ground lies in it, if the ground moves.
    pub fn of(scan: &Scan, ground: Option<&Ground>) -> Self {
        let mut order: Vec<usize> = (0..scan.detections.len()).collect();
        order.sort_by(|a, b| scan.detections[*b].score.total_cmp(&scan.detections[*a].score).then(a.cmp(b)));
        let sighting = |i: usize| {
            let d = &scan.detections[i];
            let at = ground.map_or(d.position, |g| g.of(d.position));
            let of_ground = ground.map_or(0.0, |g| g.variance(at));
            let side_px = d.extent.width_px.max(d.extent.height_px);
            let thickness_px = f64::from(d.area_px) / side_px.max(1.0);
            Sighting {
                score: f64::from(d.score),
                thickness_px,
                ..Sighting::of_box(at, 0.5 * d.cov.trace() + of_ground, side_px)
            }
        };
        Self { time_s: scan.time.ns as f64 * 1e-9, all: order.into_iter().take(MOST_A_SCAN).map(sighting).collect() }
    }

    /// Those of the scans of the frames at these places; `ground` is the first frame's in each frame, none where it stands.
    pub fn of_looks(scans: &[Scan], places: &[usize], ground: &[Ground]) -> Vec<Self> {
        scans.iter().zip(places).map(|(scan, &k)| Self::of(scan, ground.get(k))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use nalgebra::Matrix2;

    #[test]
    fn the_strongest_are_kept_where_the_ground_has_them() {
        let detection = |k: usize| Detection::point(k as f64, 0.0, 0.1).with_score(k as f32);
        let scan = Scan::at(FrameIndex(0), Timestamp::from_ns(0)).with_detections((0..400).map(detection).collect());
        // The image lies 3 px to the right of the ground.
        let ground = Ground::from(&crate::Homography::shift(Vector2::new(3.0, 0.0)));
        let seen = Sightings::of(&scan, Some(&ground));
        assert_eq!(seen.all.len(), MOST_A_SCAN);
        assert_eq!(seen.all[0].at, Vector2::new(396.0, 0.0));
        assert!((seen.all[0].variance - (0.01 + LEAST_STD_PX.powi(2))).abs() < 1e-12);
        let large = Detection::at(Vector2::zeros(), Matrix2::zeros());
        let large = large.with_extent(crate::Extent::around(Vector2::zeros(), 20.0, 40.0));
        let seen = Sightings::of(&Scan::default().with_detections(vec![large]), None);
        assert!((seen.all[0].variance - (LEAST_STD_PX.powi(2) + 4.0)).abs() < 1e-12, "a twentieth of its box");
    }
}
