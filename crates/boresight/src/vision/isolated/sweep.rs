//! One level's clusters (8 neighbours) with box and area only: rows become runs, runs are joined by union-find.
//!
//! The full moments of a cluster are taken later and only for the few that count.

use super::highest::Highest;
use crate::Image;
use crate::union_find::{Node, root};
use crate::vision::pixel::Pixel;
use crate::vision::runs::runs;
use crate::vision::threshold::Side;

/// A cluster at one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blob {
    parent: u32,
    pub area: u32,
    pub left: u32,
    pub right: u32,
    pub top: u32,
    pub bottom: u32,
    /// Column of the first pixel of row `top`.
    pub seed: u32,
}

impl Blob {
    /// A blob that fills its box.
    #[cfg(test)]
    pub fn of_box([left, top, right, bottom]: [u32; 4]) -> Self {
        let area = (right - left + 1) * (bottom - top + 1);
        Self { parent: 0, area, left, right, top, bottom, seed: left }
    }

    /// Whether the two boxes hold each other's middles: nested clusters of one thing.
    pub fn overlaps(&self, other: &Self) -> bool {
        let holds_middle = |a: &Self, b: &Self| {
            let (x, y) = (b.left + b.right, b.top + b.bottom);
            2 * a.left <= x && x <= 2 * a.right && 2 * a.top <= y && y <= 2 * a.bottom
        };
        holds_middle(self, other) || holds_middle(other, self)
    }

    /// Whether one of the two boxes lies in the other: the clusters are nested, not merely near.
    pub fn holds(&self, other: &Self) -> bool {
        let inside =
            |a: &Self, b: &Self| a.left <= b.left && b.right <= a.right && a.top <= b.top && b.bottom <= a.bottom;
        inside(self, other) || inside(other, self)
    }
}

/// The pixel values that belong to a level's set; infinite ones are no measurement, as NaN is none.
pub fn band<T: Pixel>(side: Side, level: f64) -> Option<(T, T)> {
    match side {
        Side::Bright => T::band(level, f64::MAX),
        Side::Dark => T::band(f64::MIN, level),
    }
}

#[derive(Clone, Copy, Debug)]
struct Run {
    start: u32,
    end: u32,
    blob: u32,
}

/// Finds the clusters of one level; keeps its memory.
#[derive(Debug, Default)]
pub struct Sweep {
    above: Vec<Run>,
    current: Vec<Run>,
    blobs: Vec<Blob>,
}

impl Sweep {
    /// Finds the clusters of the pixels beyond `level`; `bits` is scratch of one row.
    pub fn run<T: Pixel>(&mut self, image: &Image<T>, highest: &Highest, side: Side, level: f64, bits: &mut [u64]) {
        self.blobs.clear();
        self.above.clear();
        let Some((low, high)) = band::<T>(side, level) else { return };
        // Rounded down: a word too many costs little.
        let least = (if side == Side::Bright { level } else { -level } as f32).next_down();
        for y in 0..image.height() {
            let words = highest.reached(y, least);
            if words.is_empty() {
                self.above.clear();
                continue;
            }
            let row = image.row(y);
            bits.fill(0);
            T::band_bits(&row[64 * words.start..row.len().min(64 * words.end)], low, high, &mut bits[words]);
            self.row(y as u32, bits);
        }
    }

    fn row(&mut self, y: u32, bits: &[u64]) {
        let Self { above, current, blobs } = self;
        current.clear();
        let mut from = 0;
        runs(bits, |start, end| {
            while above.get(from).is_some_and(|a| a.end + 1 < start) {
                from += 1;
            }
            let mut label = None;
            let mut i = from;
            while let Some(a) = above.get(i).filter(|a| a.start <= end + 1) {
                let root = root(blobs, a.blob);
                label = Some(match label {
                    None => root,
                    Some(own) if own == root => own,
                    Some(own) => join(blobs, own, root),
                });
                i += 1;
            }
            let n = end - start + 1;
            let blob = match label {
                Some(l) => {
                    let b = &mut blobs[l as usize];
                    b.area += n;
                    b.left = b.left.min(start);
                    b.right = b.right.max(end);
                    b.bottom = y;
                    l
                }
                None => {
                    let l = blobs.len() as u32;
                    blobs.push(Blob { parent: l, area: n, left: start, right: end, top: y, bottom: y, seed: start });
                    l
                }
            };
            current.push(Run { start, end, blob });
        });
        std::mem::swap(above, current);
    }

    /// The clusters of the last run, in raster order of their first pixel.
    pub fn blobs(&self) -> impl Iterator<Item = Blob> {
        self.blobs.iter().enumerate().filter(|(i, b)| b.parent as usize == *i).map(|(_, b)| *b)
    }
}

impl Node for Blob {
    fn parent(&self) -> u32 {
        self.parent
    }
    fn set_parent(&mut self, parent: u32) {
        self.parent = parent;
    }
}

fn join(blobs: &mut [Blob], a: u32, b: u32) -> u32 {
    let (first, second) = (a.min(b), a.max(b));
    let other = blobs[second as usize];
    blobs[second as usize].parent = first;
    let into = &mut blobs[first as usize];
    into.area += other.area;
    into.left = into.left.min(other.left);
    into.right = into.right.max(other.right);
    into.top = into.top.min(other.top);
    into.bottom = into.bottom.max(other.bottom);
    first
}
