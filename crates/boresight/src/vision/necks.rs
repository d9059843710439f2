//! Regions of several things that touch, cut where they are narrow.
//!
//! Source: the watershed of the distance to the ground (S. Beucher, C. Lantuéjoul 1979; L. Vincent, P. Soille, IEEE PAMI 13(6), 1991), with a rule of our own for which basins are things: from the pixels farthest from the
//! ground downward each joins the basin that it touches, or begins one. Where two meet, the distance there is half the width of the neck, and that of the shallower one's deepest pixel half the width of the
//! narrower part. They stay apart if the neck is narrower than a given share of that part, and if the disc within it is as large as a region must be; else they are one.
//! Symbols: distances d from pixel centre to the nearest pixel centre of the ground; two equal discs whose neck is half as wide as they are lie 1.73 radii apart.
//! Departures: holes belong to the thing around them (a nucleus has dark places), and what lies beyond the frame is no ground.
//! Limits: of one shape, not of its light; a thing that is itself narrow in the middle (before it divides) is cut at the same neck. A cut is straight only as pixels are. A region of more than 4094 px a side, or that fills less than a sixteenth of its box, stays whole. No allocation once warm.

use super::config::ClusterConfig;
use super::distance::{Distances, FAR};
use super::pixel::Pixel;
use super::region::Region;
use super::runs::Mask;
use crate::Image;
use crate::union_find::root;
use std::f64::consts::PI;

/// What a cell of the box is, with one cell around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    /// Not reached yet: a hole, or what another region has there.
    Unknown,
    /// The region.
    Own,
    /// Another region.
    Other,
    Ground,
    /// Beyond the frame.
    Beyond,
}

/// Cells of a box's side, at most: their numbers fit in 24 bits, and what is kept of them in some 300 MB.
const MOST_SIDE: usize = 1 << 12;
/// Cells of a box for each of the region's pixels, at most: however regions lie in each other, a frame costs no more than so many of itself.
const MOST_CELLS: u64 = 16;
/// No basin yet.
const NONE: u32 = u32::MAX;

/// Cuts regions at their necks.
#[derive(Clone, Debug)]
pub(super) struct Cutter {
    /// Share of the narrower part's width up to which a neck is cut.
    neck: f64,
    least_area_px: f64,
    cells: Vec<Cell>,
    stack: Vec<usize>,
    distances: Distances,
    /// Cells of the region and its holes, from the farthest from the ground on.
    order: Vec<u64>,
    /// Basin of each cell.
    basin: Vec<u32>,
    /// Of each basin: the one it was joined to, and its deepest cell's squared distance, cells².
    parent: Vec<u32>,
    depth: Vec<u64>,
    /// Its part's number.
    part_of: Vec<u32>,
    parts: Vec<Region>,
}

impl Cutter {
    /// A cutter, if anything is to be cut.
    pub(super) fn new(config: &ClusterConfig) -> Option<Self> {
        let neck = config.neck?;
        Some(Self {
            neck,
            least_area_px: f64::from(config.area_limits().0),
            cells: Vec::new(),
            stack: Vec::new(),
            distances: Distances::default(),
            order: Vec::new(),
            basin: Vec::new(),
            parent: Vec::new(),
            depth: Vec::new(),
            part_of: Vec::new(),
            parts: Vec::new(),
        })
    }

    /// The parts of a region of `image`, whose set pixels are `mask`; none if it is whole. In raster order of their first pixel.
    pub(super) fn cut<T: Pixel>(&mut self, region: &Region, mask: &Mask, image: &Image<T>) -> &[Region] {
        self.parts.clear();
        let size = ((region.right - region.left) as usize + 3, (region.bottom - region.top) as usize + 3);
        let n_cells = size.0 as u64 * size.1 as u64;
        let is_dense = size.0.max(size.1) <= MOST_SIDE && n_cells <= MOST_CELLS * (u64::from(region.area) + 1);
        if is_dense && self.take_out(region, size, mask, image) {
            let cells = &self.cells;
            self.distances.fill(size.0, size.1, |i| matches!(cells[i], Cell::Ground | Cell::Other));
            if self.flood(size) > 1 {
                self.gather(region, size, image);
            }
            // A basin may lie in a hole.
            if self.parts.len() == 1 {
                self.parts.clear();
            }
        }
        &self.parts
    }

    /// Fills `cells` with the region, its holes and what is around it.
    fn take_out<T: Pixel>(&mut self, region: &Region, (w, h): (usize, usize), mask: &Mask, image: &Image<T>) -> bool {
        self.cells.clear();
        self.cells.resize(w * h, Cell::Unknown);
        let (left, top) = (region.left, region.top);
        let at = |i: usize| (left + (i % w) as u32 - 1, top + (i / w) as u32 - 1);
        let is_inside = |i: usize| (1..w - 1).contains(&(i % w)) && (1..h - 1).contains(&(i / w));
        // Of the pieces that the first row shows the region is the one with its moments.
        let mut is_found = false;
        for first in w + 1..2 * w - 1 {
            let (x, y) = at(first);
            if is_found || self.cells[first] != Cell::Unknown || !mask.is_set(x, y) {
                continue;
            }
            let (mut area, mut sum_x, mut sum_y) = (0u64, 0u64, 0u64);
            self.cells[first] = Cell::Own;
            let mut done = 0;
            self.stack.clear();
            self.stack.push(first);
            while let Some(&i) = self.stack.get(done) {
                done += 1;
                let (x, y) = at(i);
                area += 1;
                sum_x += u64::from(x);
                sum_y += u64::from(y);
                for j in [i - w - 1, i - w, i - w + 1, i - 1, i + 1, i + w - 1, i + w, i + w + 1] {
                    if self.cells[j] == Cell::Unknown && is_inside(j) {
                        let (x, y) = at(j);
                        if mask.is_set(x, y) {
                            self.cells[j] = Cell::Own;
                            self.stack.push(j);
                        }
                    }
                }
            }
            is_found = area == u64::from(region.area) && sum_x as f64 == region.x && sum_y as f64 == region.y;
            if !is_found {
                self.stack.iter().for_each(|&i| self.cells[i] = Cell::Other);
            }
        }
        // What the cells around the box reach is ground.
        self.stack.clear();
        for i in (0..w * h).filter(|&i| !is_inside(i)) {
            let (column, row) = (left as usize + i % w, top as usize + i / w);
            let is_beyond = column == 0 || row == 0 || column > image.width() || row > image.height();
            self.cells[i] = if is_beyond { Cell::Beyond } else { Cell::Ground };
            self.stack.push(i);
        }
        while let Some(i) = self.stack.pop() {
            let (x, y) = (i % w, i / w);
            let around = [(x > 0, 1, false), (x + 1 < w, 1, true), (y > 0, w, false), (y + 1 < h, w, true)];
            for j in around.iter().filter(|a| a.0).map(|&(_, by, on)| if on { i + by } else { i - by }) {
                if self.cells[j] == Cell::Unknown {
                    self.cells[j] = Cell::Ground;
                    self.stack.push(j);
                }
            }
        }
        is_found
    }

    /// Gives every cell of the region and its holes a basin; returns how many there are.
    fn flood(&mut self, (w, h): (usize, usize)) -> usize {
        let Self { cells, distances, order, basin, parent, depth, .. } = self;
        order.clear();
        let is_part = |i: usize| matches!(cells[i], Cell::Own | Cell::Unknown) && distances.squared[i] < FAR;
        // The farthest first, of equals the first in raster order: one number each, since numbers are sorted faster than pairs.
        let key = |i: usize| (FAR - distances.squared[i]) << 24 | i as u64;
        order.extend((0..w * h).filter(|&i| is_part(i)).map(key));
        order.sort_unstable();
        basin.clear();
        basin.resize(w * h, NONE);
        parent.clear();
        depth.clear();
        for &key in &*order {
            let i = (key & 0xff_ffff) as usize;
            let here = FAR - (key >> 24);
            let around = [i - w - 1, i - w, i - w + 1, i - 1, i + 1, i + w - 1, i + w, i + w + 1];
            let (mut own, mut steepest, mut are_alike) = (NONE, 0, true);
            for &j in around.iter().filter(|j| basin[**j] != NONE) {
                are_alike &= own == NONE || basin[j] == own;
                if distances.squared[j] > steepest {
                    (own, steepest) = (basin[j], distances.squared[j]);
                }
            }
            if own == NONE {
                own = parent.len() as u32;
                parent.push(own);
                depth.push(here);
            } else if !are_alike {
                for (k, &a) in around.iter().enumerate().filter(|(_, a)| basin[**a] != NONE) {
                    for &b in around[..k].iter().filter(|b| basin[**b] != NONE) {
                        let (a, b) = (root(parent, basin[a]), root(parent, basin[b]));
                        // The earlier basin is the deeper one.
                        let (deeper, other) = (a.min(b), a.max(b));
                        if a != b && !stay_apart(self.neck, self.least_area_px, here, depth[other as usize]) {
                            parent[other as usize] = deeper;
                        }
                    }
                }
                own = root(parent, own);
            }
            basin[i] = own;
        }
        (0..parent.len()).filter(|&k| parent[k] as usize == k).count()
    }

    /// Adds up the region's runs by basin.
    fn gather<T: Pixel>(&mut self, region: &Region, (w, h): (usize, usize), image: &Image<T>) {
        let Self { cells, basin, parent, parts, part_of, .. } = self;
        part_of.clear();
        part_of.resize(parent.len(), NONE);
        for y in 1..h - 1 {
            let row_y = region.top + y as u32 - 1;
            let row = image.row(row_y as usize);
            let mut x = 1;
            while x < w - 1 {
                let i = y * w + x;
                if cells[i] != Cell::Own || basin[i] == NONE {
                    x += 1;
                    continue;
                }
                let own = root(parent, basin[i]);
                let start = x;
                while x < w - 1 && cells[y * w + x] == Cell::Own && root(parent, basin[y * w + x]) == own {
                    x += 1;
                }
                let [from, to] = [start, x - 1].map(|x| region.left + x as u32 - 1);
                let part = &mut part_of[own as usize];
                match parts.get_mut(*part as usize) {
                    Some(part) => part.add_run(row_y, from, to, row),
                    None => {
                        *part = parts.len() as u32;
                        parts.push(Region::of_run(own, row_y, from, to, row));
                    }
                }
            }
        }
    }
}

/// Whether two basins that meet are two things: by the squared distances, cells², where they meet and in the middle of the narrower.
fn stay_apart(neck: f64, least_area_px: f64, meeting: u64, narrower: u64) -> bool {
    (meeting as f64) < neck * neck * narrower as f64 && PI * narrower as f64 >= least_area_px
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::cluster::Clusterer;
    use crate::vision::threshold::{band_bits, words};
    use proptest::prelude::*;

    /// The parts of each region of set pixels, cut at necks of half the width.
    fn parts(image: &Image<u8>, min_area_px: u32) -> Vec<Vec<Region>> {
        let config = ClusterConfig { neck: Some(0.5), min_area_px: Some(min_area_px), ..Default::default() };
        let (mut clusters, mut cutter) = (Clusterer::new(&config), Cutter::new(&config).unwrap());
        clusters.begin(image.width());
        let mut bits = vec![0; words(image.width())];
        for y in 0..image.height() {
            band_bits(image.row(y), 1, 255, &mut bits);
            clusters.row(y, &bits, image.row(y));
        }
        let mask = clusters.mask().unwrap();
        clusters.regions().map(|r| cutter.cut(r, mask, image).to_vec()).collect()
    }

    fn drawn(width: usize, height: usize, is_set: impl Fn(f64, f64) -> bool) -> Image<u8> {
        let at = |i: usize| u8::from(is_set((i % width) as f64, (i / width) as f64));
        Image::from_vec(width, height, (0..width * height).map(at).collect()).unwrap()
    }

    /// Two discs of that radius, px, whose middles lie so far apart in that direction.
    fn two_discs(radius: f64, apart: f64, angle: f64) -> Image<u8> {
        let (dx, dy) = (0.5 * apart * angle.cos(), 0.5 * apart * angle.sin());
        drawn(130, 130, |x, y| {
            (x - 64.0 + dx).hypot(y - 64.0 + dy) <= radius || (x - 64.0 - dx).hypot(y - 64.0 - dy) <= radius
        })
    }

    proptest! {
        #[test]
        fn discs_that_overlap_are_two_where_their_neck_is_half_as_wide(radius in 12f64..32.0, share in 0.1f64..0.95, angle in 0f64..PI) {
            // Half the neck is √(r² - a²/4); both it and the disc's half width are open by a pixel.
            let apart = 2.0 * radius * (1.0 - share * share).sqrt();
            prop_assume!((share - 0.5).abs() * radius > 2.0);
            let found = parts(&two_discs(radius, apart, angle), 20);
            prop_assert_eq!(found.len(), 1);
            prop_assert_eq!(found[0].len(), if share < 0.5 { 2 } else { 0 }, "{}", share);
            for part in &found[0] {
                let n = f64::from(part.area);
                let off = (part.x / n - 64.0).hypot(part.y / n - 64.0);
                prop_assert!((off - 0.5 * apart).abs() < 0.1 * radius, "{} of {}", off, 0.5 * apart);
            }
        }

        #[test]
        fn an_ellipse_is_whole(long in 8f64..50.0, ratio in 0.3f64..1.0, angle in 0f64..PI) {
            let (c, s) = (angle.cos(), angle.sin());
            let image = drawn(130, 130, |x, y| {
                let (u, v) = ((x - 64.0) * c + (y - 64.0) * s, (y - 64.0) * c - (x - 64.0) * s);
                (u / long).hypot(v / (long * ratio)) <= 1.0
            });
            prop_assert!(parts(&image, 1).iter().all(Vec::is_empty));
        }

        #[test]
        fn parts_hold_each_pixel_of_the_region_once(
            width in 3usize..70,
            set in prop::collection::vec(prop::bool::weighted(0.6), 900),
            least in 1u32..6,
        ) {
            let height = set.len() / width;
            let image = Image::from_vec(width, height, set[..width * height].iter().map(|b| u8::from(*b)).collect()).unwrap();
            let config = ClusterConfig::default();
            let regions = crate::vision::segment(&image, 1, 255, &config);
            let found = parts(&image, least);
            prop_assert_eq!(regions.len(), found.len());
            for (region, parts) in regions.iter().zip(&found).filter(|(_, p)| !p.is_empty()) {
                let all = parts[1..].iter().fold(parts[0].clone(), |mut all, p| {
                    all.absorb(p);
                    all
                });
                prop_assert!(parts.len() > 1);
                prop_assert_eq!(&Region { parent: region.parent, ..all }, region);
            }
        }
    }

    #[test]
    fn holes_borders_and_specks_cut_nothing() {
        let ring = drawn(60, 60, |x, y| {
            let r = (x - 30.0).hypot(y - 30.0);
            r <= 20.0 && (x - 25.0).hypot(y - 33.0) > 9.0
        });
        assert_eq!(parts(&ring, 20), [Vec::new()], "a hole near the rim leaves a thin bridge");
        let cut_off = drawn(60, 60, |x, y| (x - 30.0).hypot(y + 10.0) <= 20.0);
        assert_eq!(parts(&cut_off, 20), [Vec::new()], "half of a disc at the border");
        let speck = drawn(60, 60, |x, y| (x - 30.0).hypot(y - 30.0) <= 20.0 || (x - 54.0).hypot(y - 30.0) <= 4.0);
        assert_eq!(parts(&speck, 70), [Vec::new()], "a disc of 49 px where 70 are least");
        assert_eq!(parts(&speck, 20)[0].len(), 2);
        let on_a_string = |length: f64| {
            let is_on = move |x: f64, y: f64| (x - y).abs() < 1.5 && x > 9.0 && x < 9.0 + length;
            parts(
                &drawn(130, 130, |x, y| is_on(x, y) || [9.0, 9.0 + length].iter().any(|c| (x - c).hypot(y - c) <= 6.0)),
                100,
            )
        };
        assert_eq!(on_a_string(20.0)[0].len(), 2);
        assert_eq!(on_a_string(110.0), [Vec::new()], "some 560 px in a box of 15000");
        assert_eq!(parts(&drawn(20, 9, |_, _| true), 1), [Vec::new()], "no ground at all");
    }
}
