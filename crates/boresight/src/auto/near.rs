//! The detections of one scan by their places: what lies near another one.

use crate::associate::UniformGrid;
use crate::{Detection, Scan};

/// A scan whose detections are found by their places.
pub struct Near<'s> {
    detections: &'s [Detection],
    grid: UniformGrid,
}

impl<'s> Near<'s> {
    /// Sorts the detections of a scan.
    pub fn of(scan: &'s Scan) -> Self {
        let mut grid = UniformGrid::new();
        grid.build(scan.detections.iter().map(|d| (d.position.x, d.position.y)));
        Self { detections: &scan.detections, grid }
    }

    /// Visits every detection within so many pixels of another, with its number and how far away it is.
    pub fn within(&self, d: &Detection, far_px: f64, mut visit: impl FnMut(usize, f64)) {
        self.grid.near(d.position.x, d.position.y, far_px, far_px, |p| {
            let far = (p.x - d.position.x).hypot(p.y - d.position.y);
            if far <= far_px {
                visit(p.index as usize, far);
            }
            true
        });
    }

    /// The nearest one within so many pixels, the first of equals, and how far away it is.
    pub fn nearest(&self, d: &Detection, far_px: f64) -> Option<(usize, f64)> {
        let mut best = None;
        self.within(d, far_px, |j, far| {
            if best.is_none_or(|(i, least)| (far, j) < (least, i)) {
                best = Some((j, far));
            }
        });
        best
    }

    /// The detection of that number.
    pub fn get(&self, j: usize) -> &'s Detection {
        &self.detections[j]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.detections.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_nearest_and_all_within_are_those_of_a_search_through_all() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut place = || Vector2::from_fn(|_, _| 200.0 * rng.random::<f64>());
        let at = |p| Detection::at(p, Matrix2::identity());
        let scan = Scan::default().with_detections((0..300).map(|_| at(place())).collect());
        let near = Near::of(&scan);
        for _ in 0..200 {
            let (d, far_px) = (at(place()), 9.0);
            let far = |j: usize| (scan.detections[j].position - d.position).norm();
            let all: Vec<usize> = (0..scan.detections.len()).filter(|j| far(*j) <= far_px).collect();
            let mut found = Vec::new();
            near.within(&d, far_px, |j, _| found.push(j));
            found.sort_unstable();
            assert_eq!(found, all);
            let nearest = all.into_iter().min_by(|a, b| far(*a).total_cmp(&far(*b)));
            assert_eq!(near.nearest(&d, far_px).map(|n| n.0), nearest);
        }
        assert_eq!(Near::of(&Scan::default()).nearest(&at(place()), 9.0), None);
    }
}
