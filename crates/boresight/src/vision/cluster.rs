//! Clusters of set pixels by proximity distance d_p, from rows of bits, without a label or mask image.
//!
//! Source: `docs/theory/segmentation.md` (single linkage: two set pixels are linked iff their Euclidean distance is <
//! d_p, or <= d_p). A row becomes runs. Row offset dy is reached by horizontal distances up to `reach[dy]`, so two runs
//! are linked iff the gap between them is at most that reach; runs are joined by union-find, their moments added as
//! they come. Distances are compared as correctly rounded square roots, so d_p = √2 given as the nearest f64 means √2.
//! Symbols: d_p proximity distance (px); reach\[dy\] whole px. Cost: one pass over the runs per reached row offset.
//! Regions come out in raster order of their first pixel: the smaller number wins a union, and numbers are given in raster order.

use super::config::ClusterConfig;
use super::pixel::Pixel;
use super::region::Region;
use super::runs::{Mask, RowRuns, RunWord, find_runs};
use super::threshold::{band_bits, words};
use crate::Image;
use crate::union_find::root;
use fearless_simd::Level;

/// Joins rows of bits to regions.
#[derive(Clone, Debug)]
pub struct Clusterer {
    /// Furthest linked column distance per row offset, from 0.
    reach: Vec<u32>,
    /// Whether not even neighbours are linked.
    single: bool,
    /// Runs of the last rows; row y lies in slot y % len.
    rows: Vec<RowRuns>,
    regions: Vec<Region>,
    /// All rows of bits, where regions are to be cut.
    mask: Option<Mask>,
}

/// The furthest linked column distance of each row offset 0.. that has one.
fn reaches(distance_px: f64, inclusive: bool) -> Vec<u32> {
    let linked = |dx: u64, dy: u64| {
        let d = ((dx * dx + dy * dy) as f64).sqrt();
        if inclusive { d <= distance_px } else { d < distance_px }
    };
    let mut reach = Vec::new();
    let mut dy = 0u64;
    while linked(0, dy) {
        let mut dx = distance_px as u64 + 1;
        while !linked(dx, dy) && dx > 0 {
            dx -= 1;
        }
        reach.push(dx as u32);
        dy += 1;
    }
    reach
}

impl Clusterer {
    /// Builds a clusterer for a checked configuration.
    pub fn new(config: &ClusterConfig) -> Self {
        let reach = reaches(config.distance_px, config.inclusive);
        let single = reach.first().is_none_or(|&r| r == 0);
        let n = reach.len().max(1);
        let mask = config.neck.map(|_| Mask::default());
        Self { reach, single, rows: vec![RowRuns::default(); n], regions: Vec::new(), mask }
    }

    /// Starts a frame of `width` columns; what was kept of the last frame is dropped, its memory stays.
    pub fn begin(&mut self, width: usize) {
        self.regions.clear();
        if let Some(mask) = &mut self.mask {
            mask.words.clear();
            mask.stride = words(width);
        }
        let n = width.div_ceil(2) + 8;
        for row in &mut self.rows {
            row.n = 0;
            row.start.resize(n, 0);
            row.end.resize(n, 0);
            row.region.resize(n, 0);
            row.words.clear();
            row.words.resize(words(width), RunWord::default());
        }
    }

    /// Takes row `y` (rows come in order, from 0, every row): its bits and its pixels.
    ///
    /// Bits past the pixels of the row must be 0.
    pub fn row<T: Pixel>(&mut self, y: usize, bits: &[u64], pixels: &[T]) {
        let n = self.rows.len();
        if let Some(mask) = &mut self.mask {
            mask.words.extend(bits.iter().copied().chain(std::iter::repeat(0)).take(mask.stride));
        }
        // Most rows of most frames are empty.
        if bits.iter().fold(0, |all, w| all | w) == 0 {
            self.rows[y % n].n = 0;
            return;
        }
        // Not for vectors but for the bit counting instructions, which the oldest machines lack.
        fearless_simd::dispatch!(Level::new(), _simd => self.filled_row(y, bits, pixels));
    }

    #[inline(always)]
    fn filled_row<T: Pixel>(&mut self, y: usize, bits: &[u64], pixels: &[T]) {
        if self.single {
            for (w, &word) in bits.iter().enumerate() {
                let mut rest = word;
                while rest != 0 {
                    let x = w as u32 * 64 + rest.trailing_zeros();
                    rest &= rest - 1;
                    self.new_region(y, x, x, pixels);
                }
            }
            return;
        }
        let n = self.rows.len();
        // Out of the ring while it is filled, so that the other rows can be read.
        let mut current = std::mem::take(&mut self.rows[y % n]);
        find_runs(bits, &mut current);
        if n == 2 {
            self.link_neighbours(y, &mut current, pixels);
        } else {
            self.link(y, &mut current, pixels);
        }
        self.rows[y % n] = current;
    }

    #[inline(always)]
    fn new_region<T: Pixel>(&mut self, y: usize, start: u32, end: u32, pixels: &[T]) -> u32 {
        let label = self.regions.len() as u32;
        self.regions.push(Region::of_run(label, y as u32, start, end, pixels));
        label
    }

    /// Gives every run its region where only the row above is reached (4 and 8 neighbours): one pass over both rows.
    #[inline(always)]
    fn link_neighbours<T: Pixel>(&mut self, y: usize, current: &mut RowRuns, pixels: &[T]) {
        let reach = self.reach[1];
        let above = std::mem::take(&mut self.rows[(y + 1) % 2]);
        // A row without runs has not set its words.
        let no_above = y == 0 || above.n == 0;
        let columns = current.start.iter().zip(&current.end).zip(&mut current.region).take(current.n);
        for ((&start, &end), region) in columns {
            // Counting bits instead of walking along the row above: a walk's branches are guessed wrong too often.
            let first = if no_above { usize::MAX } else { above.ending_before(start.saturating_sub(reach)) };
            let last = above.starting_up_to(end + reach);
            *region = match above.region.get(first..last) {
                Some([one, more @ ..]) => {
                    let mut label = self.root(*one);
                    self.regions[label as usize].add_run(y as u32, start, end, pixels);
                    for &other in more {
                        label = self.union(other, label);
                    }
                    label
                }
                _ => self.new_region(y, start, end, pixels),
            };
        }
        self.rows[(y + 1) % 2] = above;
    }

    /// Gives every run its region for any reach: the same row first, then one pass for each row above.
    #[inline(always)]
    fn link<T: Pixel>(&mut self, y: usize, current: &mut RowRuns, pixels: &[T]) {
        let n = self.rows.len();
        for i in 0..current.n {
            let (start, end) = (current.start[i], current.end[i]);
            current.region[i] = if i > 0 && start - current.end[i - 1] <= self.reach[0] {
                let root = self.root(current.region[i - 1]);
                self.regions[root as usize].add_run(y as u32, start, end, pixels);
                root
            } else {
                self.new_region(y, start, end, pixels)
            };
        }
        for dy in 1..=(n - 1).min(y) {
            let reach = self.reach[dy];
            let above = std::mem::take(&mut self.rows[(y - dy) % n]);
            let mut from = 0;
            for i in 0..current.n {
                let (start, end) = (current.start[i], current.end[i]);
                while from < above.n && above.end[from] + reach < start {
                    from += 1;
                }
                for k in from..above.n {
                    if above.start[k] > end + reach {
                        break;
                    }
                    self.union(above.region[k], current.region[i]);
                }
            }
            self.rows[(y - dy) % n] = above;
        }
    }

    #[inline(always)]
    fn root(&mut self, label: u32) -> u32 {
        root(&mut self.regions, label)
    }

    /// Joins two regions and returns the one that stays, the earlier.
    fn union(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return a;
        }
        let (first, second) = (a.min(b) as usize, a.max(b) as usize);
        let (head, tail) = self.regions.split_at_mut(second);
        head[first].absorb(&tail[0]);
        tail[0].parent = first as u32;
        first as u32
    }

    /// The set pixels of the frame whose rows were all given, where regions are to be cut.
    pub(super) fn mask(&self) -> Option<&Mask> {
        self.mask.as_ref()
    }

    /// The regions of the frame whose rows were all given, in raster order of their first pixel.
    pub fn regions(&self) -> impl Iterator<Item = &Region> {
        self.regions.iter().enumerate().filter(|(i, r)| r.parent as usize == *i).map(|(_, r)| r)
    }
}

/// Returns the regions of the pixels with `low` <= value <= `high` of a whole image.
///
/// The worked example of `docs/theory/segmentation.md` (its coordinates count from 1):
/// ```
/// use boresight::{Image, vision::segment};
/// use boresight::vision::{CentroidMethod, ClusterConfig, Surroundings, centroid};
/// let image = Image::from_vec(6, 6, vec![
///     95u8, 100, 20, 30, 105, 40,   98, 60, 20, 97, 10, 40,     30, 20, 99, 20, 10, 108,
///     10, 101, 10, 20, 200, 90,     10, 20, 30, 110, 20, 30,    94, 20, 111, 89, 20, 103,
/// ]).unwrap();
/// let sizes = |distance_px, inclusive| {
///     let config = ClusterConfig { distance_px, inclusive, ..Default::default() };
///     segment(&image, 90, 110, &config).iter().map(|r| r.area).collect::<Vec<_>>()
/// };
/// assert_eq!(sizes(1.0, false), [1; 12]);
/// assert_eq!(sizes(1.0, true), [3, 1, 1, 1, 2, 1, 1, 1, 1]);
/// assert_eq!(sizes(1.5, false), [3, 4, 2, 1, 1, 1]);
/// assert_eq!(sizes(2.0, false), [3, 4, 2, 1, 1, 1]);
/// assert_eq!(sizes(2.0, true), [3, 4, 3, 1, 1]);
/// assert_eq!(sizes(3.0, false), [12]);
///
/// let plain = Surroundings::plain();
/// let regions = segment(&image, 90, 110, &ClusterConfig::default());
/// let mask = centroid(&regions[0], &image, CentroidMethod::Mask, &plain).position.add_scalar(1.0);
/// assert!((mask.x - 1.3412969283276).abs() < 1e-12 && (mask.y - 1.3344709897611).abs() < 1e-12);
/// let bbox = centroid(&regions[0], &image, CentroidMethod::Bbox, &plain).position.add_scalar(1.0);
/// assert!((bbox.x - 1.4532577903683).abs() < 1e-12 && (bbox.y - 1.4475920679887).abs() < 1e-12);
/// ```
pub fn segment<T: Pixel>(image: &Image<T>, low: T, high: T, config: &ClusterConfig) -> Vec<Region> {
    let mut clusters = Clusterer::new(config);
    clusters.begin(image.width());
    let mut bits = vec![0; words(image.width())];
    for y in 0..image.height() {
        band_bits(image.row(y), low, high, &mut bits);
        clusters.row(y, &bits, image.row(y));
    }
    clusters.regions().cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Clusters by comparing all pairs of set pixels: area, Σx, Σy and first row of each, in raster order.
    fn brute(image: &Image<u8>, distance_px: f64, inclusive: bool) -> Vec<(u32, f64, f64, u32)> {
        let set: Vec<(i64, i64)> = (0..image.height())
            .flat_map(|y| (0..image.width()).map(move |x| (x as i64, y as i64)))
            .filter(|&(x, y)| image.row(y as usize)[x as usize] > 0)
            .collect();
        let mut label: Vec<usize> = (0..set.len()).collect();
        for i in 0..set.len() {
            for j in 0..i {
                let d = (((set[i].0 - set[j].0).pow(2) + (set[i].1 - set[j].1).pow(2)) as f64).sqrt();
                if (if inclusive { d <= distance_px } else { d < distance_px }) && label[i] != label[j] {
                    let (a, b) = (label[i], label[j]);
                    label.iter_mut().filter(|l| **l == a.max(b)).for_each(|l| *l = a.min(b));
                }
            }
        }
        let mut out = Vec::new();
        for k in 0..set.len() {
            let members: Vec<_> = (0..set.len()).filter(|&i| label[i] == k).map(|i| set[i]).collect();
            if let Some(first) = members.first() {
                let sum = |f: fn(&(i64, i64)) -> i64| members.iter().map(f).sum::<i64>() as f64;
                out.push((members.len() as u32, sum(|p| p.0), sum(|p| p.1), first.1 as u32));
            }
        }
        out
    }

    fn distance() -> impl Strategy<Value = f64> {
        prop_oneof![
            3 => 0.2f64..9.0,
            // Distances that pixels really have: where < and <= differ.
            2 => (0u32..6, 0u32..6).prop_filter("not zero", |p| *p != (0, 0)).prop_map(|(a, b)| f64::from(a * a + b * b).sqrt()),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn clusters_are_those_of_all_pairs_of_pixels(
            width in prop_oneof![1usize..12, 60usize..70, Just(129usize)],
            height in 1usize..9,
            share in 1u8..=255,
            seed in any::<u64>(),
            distance_px in distance(),
            inclusive in any::<bool>(),
        ) {
            // A cheap generator of pixels; proptest's own vectors are slow for whole images.
            let mut state = seed | 1;
            let data = (0..width * height).map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                u8::from(((state >> 32) as u8) < share / if width > 20 { 8 } else { 1 })
            }).collect();
            let image = Image::from_vec(width, height, data).unwrap();
            let config = ClusterConfig { distance_px, inclusive, ..Default::default() };
            let ours: Vec<_> =
                segment(&image, 1, 255, &config).iter().map(|r| (r.area, r.x, r.y, r.top)).collect();
            prop_assert_eq!(ours, brute(&image, distance_px, inclusive));
        }
    }

    #[test]
    fn the_reach_gives_the_neighbour_sets_of_the_specification() {
        // docs/theory/segmentation.md: neighbours of one pixel for each range of d_p.
        let count = |d: f64, inclusive: bool| {
            let r = reaches(d, inclusive);
            let all: u32 = r.iter().enumerate().map(|(dy, &h)| (2 * h + 1) * if dy == 0 { 1 } else { 2 }).sum();
            all.saturating_sub(1)
        };
        let strict =
            [(0.5, 0), (1.0, 0), (1.2, 4), (2f64.sqrt(), 4), (1.5, 8), (2.0, 8), (2.1, 12), (2.5, 20), (3.0, 24)];
        for (d, n) in strict {
            assert_eq!(count(d, false), n, "d < {d}");
        }
        for (d, n) in [(0.5, 0), (1.0, 4), (1.5, 8), (2.0, 12), (3.0, 28)] {
            assert_eq!(count(d, true), n, "d <= {d}");
        }
    }
}
