//! Where labels stand: beside their target, over no target and over no other label.
//!
//! Source: our own; the usual greedy placing at a few places around each target. The place that a target's label had in the frame before is tried first, so that
//! labels do not jump. A label that finds no room is left out.
//! Symbols: rectangles are `[left, top, right, bottom]`, canvas px.
//! Cost: rectangles are kept in cells of a grid, so that a place is compared with those nearby only.

use std::collections::BTreeMap;

/// A rectangle, px.
pub(super) type Rect = [f64; 4];

/// Side of a cell, px.
const CELL_PX: f64 = 64.0;
/// Most cells that one rectangle is entered in; larger ones are compared with every place.
const MOST_CELLS: usize = 400;
/// Gap between a target and its label, px.
const GAP_PX: f64 = 2.0;

/// What is occupied.
#[derive(Debug, Default)]
pub(super) struct Labels {
    cells: BTreeMap<(i64, i64), Vec<Rect>>,
    large: Vec<Rect>,
    size: [f64; 2],
}

/// The cells that a rectangle touches.
fn cells(r: &Rect) -> (std::ops::RangeInclusive<i64>, std::ops::RangeInclusive<i64>) {
    let cell = |v: f64| (v / CELL_PX).floor() as i64;
    (cell(r[0])..=cell(r[2]), cell(r[1])..=cell(r[3]))
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

impl Labels {
    /// Begins a picture of that size, px, with nothing in it.
    pub fn begin(&mut self, width: f64, height: f64) {
        self.cells.clear();
        self.large.clear();
        self.size = [width, height];
    }

    /// Marks a rectangle as occupied.
    pub fn occupy(&mut self, r: Rect) {
        if !r.iter().all(|v| v.abs() < 1e9) {
            return;
        }
        let (xs, ys) = cells(&r);
        if (xs.clone().count().saturating_mul(ys.clone().count())) > MOST_CELLS {
            self.large.push(r);
            return;
        }
        for x in xs {
            for y in ys.clone() {
                self.cells.entry((x, y)).or_default().push(r);
            }
        }
    }

    fn is_free(&self, r: &Rect) -> bool {
        if r[0] < 0.0 || r[1] < 0.0 || r[2] > self.size[0] || r[3] > self.size[1] {
            return false;
        }
        let (xs, ys) = cells(r);
        let mut near = xs.flat_map(|x| ys.clone().filter_map(move |y| self.cells.get(&(x, y)))).flatten();
        !near.any(|o| overlap(o, r)) && !self.large.iter().any(|o| overlap(o, r))
    }

    /// Places a label of a size (px) beside its target and occupies it: which of the places, and where its corner is; `before` is the place it had.
    pub fn place(&mut self, target: &Rect, [w, h]: [f64; 2], before: Option<usize>) -> Option<(usize, [f64; 2])> {
        let [left, top, right, bottom] = *target;
        let middle = [(left + right - w) / 2.0, (top + bottom - h) / 2.0];
        let (above, below) = (top - h - GAP_PX, bottom + GAP_PX);
        let (before_it, behind_it) = (left - w - GAP_PX, right + GAP_PX);
        let places = [
            [left, above],
            [right - w, above],
            [left, below],
            [right - w, below],
            [behind_it, top],
            [before_it, top],
            [behind_it, middle[1]],
            [before_it, middle[1]],
            [middle[0], above - h],
            [middle[0], below + h],
            [behind_it, above],
            [before_it, above],
            [behind_it, below],
            [before_it, below],
        ];
        let order = before.into_iter().chain(0..places.len());
        for k in order {
            let Some([x, y]) = places.get(k).map(|p| p.map(f64::round)) else { continue };
            let r = [x, y, x + w, y + h];
            if self.is_free(&r) {
                self.occupy(r);
                return Some((k, [x, y]));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn labels_cover_neither_each_other_nor_a_target_and_stay_in_the_picture() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut labels = Labels::default();
        for n in [3, 20, 60] {
            labels.begin(640.0, 480.0);
            let mut target = || {
                let (x, y) = (rng.random_range(-20.0..640.0), rng.random_range(-20.0..480.0));
                let (w, h) = (rng.random_range(3.0..90.0), rng.random_range(3.0..90.0));
                [x, y, x + w, y + h]
            };
            let targets: Vec<Rect> = (0..n).map(|_| target()).collect();
            targets.iter().for_each(|t| labels.occupy(*t));
            let placed: Vec<Rect> = targets
                .iter()
                .filter_map(|t| labels.place(t, [24.0, 15.0], None))
                .map(|(_, [x, y])| [x, y, x + 24.0, y + 15.0])
                .collect();
            assert!(placed.len() * 2 > n, "{} of {n}", placed.len());
            for (i, a) in placed.iter().enumerate() {
                assert!(a[0] >= 0.0 && a[1] >= 0.0 && a[2] <= 640.0 && a[3] <= 480.0);
                assert!(!targets.iter().chain(&placed[i + 1..]).any(|b| overlap(a, b)), "{a:?}");
            }
        }
    }

    #[test]
    fn the_place_of_the_frame_before_is_kept_while_it_is_free() {
        let mut labels = Labels::default();
        let target = [100.0, 100.0, 120.0, 120.0];
        labels.begin(300.0, 300.0);
        labels.occupy(target);
        assert_eq!(labels.place(&target, [20.0, 10.0], Some(3)), Some((3, [100.0, 122.0])));
        labels.begin(300.0, 300.0);
        labels.occupy(target);
        labels.occupy([90.0, 121.0, 130.0, 140.0]);
        assert_eq!(labels.place(&target, [20.0, 10.0], Some(3)), Some((0, [100.0, 88.0])));
    }

    #[test]
    fn a_target_without_room_has_no_label_and_a_wild_one_is_passed_over() {
        let mut labels = Labels::default();
        labels.begin(100.0, 50.0);
        labels.occupy([-10.0, -10.0, 110.0, 60.0]);
        labels.occupy([f64::NAN, 0.0, 1.0, 1.0]);
        labels.occupy([-1e300, 0.0, 1e300, 1.0]);
        assert_eq!(labels.place(&[40.0, 20.0, 50.0, 30.0], [20.0, 10.0], None), None);
    }
}
