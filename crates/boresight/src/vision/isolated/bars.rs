//! What a pixel must reach to be the peak of a target of some size, and the lowest ground that such a target can stand on.
//!
//! A cluster's score is (mean - ground - tail) / (noise + step + spread), and its mean is no higher than its peak. So a peak needs at least
//! `ground + min-score (noise + step) + (min-score + tail) spread`: next to it for a small cluster, in rings of cells each twice as large as the one before for larger ones.
//! Next to it the third lowest ground and the third lowest spread of nine cells count, so that a target beside another, or at the edge of a wood, is not measured by that.
//! A larger cluster has one highest pixel: only a cell that is the highest within some way of it is asked whether one begins in it.
//! Departures: rings are taken about the peak's cell, not about the middle of a cluster that is not known yet; of their spread half is counted.
//! Units: counts; values times the sign of the side.
//! Limits: a ground that is quieter than the third quietest cell around it loses blobs near the least score.

use super::cells::{CELL, Cells};

/// Share of the spread of the cells next to a peak that is counted: one standard deviation of what a cell's 61 degrees of freedom tell is left out.
const SURE_NEAR: f64 = 0.9;

/// Share of the noise in a ring of cells that is counted: rings of other middles may be quieter.
const SURE: f64 = 0.5;

/// The 99 % point of a ring above its ground, in spreads: 2.3 in normal noise, less what some hundred pixels leave open.
const TAIL_NEAR: f64 = 2.0;
/// The same of large rings, whose spread is counted by half.
const TAIL: f64 = 1.5;

/// Rings of cells: within `.1` cells of the middle, but not within `.0`. A cluster of side w has a ring that ends between w/2 + 12 px and w from its middle.
const RINGS: [(usize, usize); 10] =
    [(0, 1), (1, 2), (2, 4), (4, 8), (8, 16), (16, 32), (32, 64), (64, 128), (128, 256), (256, 512)];

/// Longest side, px, of a cluster whose ring lies in the cells next to its own.
const NEXT: u32 = 8;

/// What a target must reach.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// -1 for dark targets.
    pub sign: f64,
    /// Noise and step of a pixel, counts.
    pub unit: f64,
    pub min_score: f64,
    /// Longest side of a target's box, px.
    pub max_side: u32,
}

impl Bar {
    /// Least value that stands clear of a ground with that spread.
    fn over(&self, ground: f64, spread: f64) -> f64 {
        ground + self.min_score * self.unit + (self.min_score + TAIL) * SURE * spread
    }

    /// The same for cells next to it.
    #[inline(always)]
    fn over_near(&self, ground: f32, spread: f32) -> f32 {
        (f64::from(ground) + self.min_score * self.unit + (self.min_score + TAIL_NEAR) * SURE_NEAR * f64::from(spread))
            as f32
    }

    /// Number of rings for targets of up to the longest side.
    fn n_rings(&self) -> usize {
        RINGS.iter().take_while(|(inner, _)| inner * CELL <= self.max_side as usize).count()
    }
}

/// The bars of one side of a frame, by cell; keeps its memory.
#[derive(Debug, Default)]
pub struct Bars {
    columns: usize,
    /// No peak needs less.
    floor: f64,
    /// The largest ring, counted from 1, within whose inside the cell is the highest.
    leads: Vec<u8>,
    scratch: [Vec<f32>; 2],
    /// Grounds, and spreads.
    lowest: [Lowest; 2],
}

/// Clusters to which the same rings apply: the number of those that are too small for them, or none if the cells next to the peak's count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SideClass(Option<usize>);

impl SideClass {
    /// That of a cluster whose box's longer side is so long, px.
    pub fn of(side: u32) -> Self {
        let ends = |outer: usize| (CELL * outer + CELL / 2) as u32;
        Self((side > NEXT).then(|| RINGS.iter().take_while(|r| ends(r.1) < side).count()))
    }
}

/// What clusters of one peak and of some sizes need.
#[derive(Clone, Copy, Debug)]
pub struct Need {
    /// Least mean.
    pub mean: f64,
    /// Levels must lie above it.
    pub ground: f64,
}

impl Bars {
    /// Takes the bars of a frame.
    pub fn take(&mut self, cells: &Cells, bar: &Bar) {
        self.columns = cells.size().0;
        self.near(cells, bar);
        self.lead(cells, bar);
    }

    /// What a cluster whose box's longer side is of that class needs to be a target or become one, if it has grown from the peak of a cell; a peak that is not the highest of
    /// its cell leads to small ones only. `None` if it cannot. Where it is to beat a cluster that is a target already, the lowest ground and the lowest spread next to the cell count, not the
    /// third lowest: it costs nothing but time to go on for too long.
    pub fn need(
        &self,
        cells: &Cells,
        bar: &Bar,
        (cell, highest): (usize, bool),
        class: SideClass,
        is_to_beat: bool,
    ) -> Option<Need> {
        let leads = if highest { usize::from(self.leads[cell]) } else { 1 };
        let mut need = Need { mean: f64::INFINITY, ground: f64::INFINITY };
        let first = class.0.unwrap_or_else(|| {
            let [grounds, quiet] = &self.lowest;
            let mean = match is_to_beat {
                true => bar.over_near(grounds.least[cell], quiet.least[cell]),
                false => bar.over_near(grounds.third[cell], quiet.third[cell]),
            };
            need = Need { mean: f64::from(mean), ground: f64::from(grounds.least[cell]) };
            // The first ring is made of those cells.
            1
        });
        if first < leads {
            let place = (cell % self.columns, cell / self.columns);
            for &(inner, outer) in &RINGS[first..leads] {
                if let Some((mean, spread)) = cells.ring(place, inner, outer) {
                    need.mean = need.mean.min(bar.over(bar.sign * mean, spread));
                    need.ground = need.ground.min(bar.sign * mean);
                }
            }
        }
        (need.mean < f64::INFINITY).then_some(need)
    }

    /// No peak needs less, whatever its rings: their ground is a mean of cells.
    pub fn floor(&self) -> f64 {
        self.floor
    }

    /// From the third lowest ground and the third lowest spread of the cells next to each.
    fn near(&mut self, cells: &Cells, bar: &Bar) {
        let columns = cells.size().0;
        let (means, spreads) = cells.each();
        let sign = bar.sign as f32;
        let [grounds, quiet] = &mut self.lowest;
        grounds.read(means, sign, columns);
        quiet.read(spreads, 1.0, columns);
        let lowest = grounds.least.iter().copied().fold(f32::INFINITY, f32::min);
        // f32 holds means to less than a millionth of themselves.
        self.floor = f64::from(lowest) - 1e-6 * f64::from(lowest.abs()) + bar.min_score * bar.unit;
    }

    /// Finds how far around each cell none is higher: a quarter of the least box of a ring, at least one cell.
    fn lead(&mut self, cells: &Cells, bar: &Bar) {
        let (columns, rows) = cells.size();
        let [most, other] = &mut self.scratch;
        most.clear();
        most.extend(cells.highest(bar.sign < 0.0));
        self.leads.clear();
        self.leads.resize(columns * rows, 1);
        let mut reach = 0;
        for (k, &(inner, _)) in RINGS.iter().enumerate().take(bar.n_rings()).skip(1) {
            let wanted = (inner / 2).max(1);
            if wanted > reach {
                widen(most, other, columns, wanted - reach);
                reach = wanted;
            }
            let each = self.leads.iter_mut().zip(cells.highest(bar.sign < 0.0)).zip(&*most);
            for ((leads, high), most) in each {
                *leads += u8::from(usize::from(*leads) == k && high >= *most);
            }
        }
    }
}

/// The lowest, the second and the third lowest value of each cell and those next to it; of fewer the last there is.
#[derive(Debug, Default)]
struct Lowest {
    least: Vec<f32>,
    second: Vec<f32>,
    third: Vec<f32>,
    /// The values, with a cell without any around them.
    padded: Vec<f32>,
}

impl Lowest {
    /// Reads the cells of one frame times a sign; what is not a number counts for none.
    fn read(&mut self, of: &[f32], sign: f32, columns: usize) {
        let columns = columns.max(1);
        let Self { least, second, third, padded } = self;
        padded.clear();
        padded.resize(columns + 3, f32::INFINITY);
        for row in of.chunks(columns) {
            padded.extend(row.iter().map(|v| if v.is_nan() { f32::INFINITY } else { sign * v }));
            padded.extend([f32::INFINITY; 2]);
        }
        padded.resize(padded.len() + columns + 1, f32::INFINITY);
        let wide = columns + 2;
        let rows = padded.len() / wide - 2;
        for v in [&mut *least, &mut *second, &mut *third] {
            v.clear();
            v.resize(columns * rows, f32::INFINITY);
        }
        for r in 0..rows {
            let out = r * columns..(r + 1) * columns;
            let out = [&mut least[out.clone()], &mut second[out.clone()], &mut third[out]];
            lowest(&padded[r * wide..(r + 3) * wide], wide, out);
        }
    }
}

widest! {
    /// The three lowest of each three by three values, from three rows of `wide`.
    fn lowest(rows: &[f32], wide: usize, out: [&mut [f32]; 3]) {
        let n = wide - 2;
        let [a, b, c] = out.map(|v| &mut v[..n]);
        for row in rows.chunks_exact(wide) {
            for beside in 0..3 {
                let v = &row[beside..][..n];
                for i in 0..n {
                    let past_a = if a[i] > v[i] { a[i] } else { v[i] };
                    let past_b = if b[i] > v[i] { b[i] } else { v[i] };
                    a[i] = if v[i] < a[i] { v[i] } else { a[i] };
                    c[i] = if past_b < c[i] { past_b } else { c[i] };
                    b[i] = if past_a < b[i] { past_a } else { b[i] };
                }
            }
        }
        // Frames of one or two cells.
        for i in 0..n {
            b[i] = if b[i] < f32::INFINITY { b[i] } else { a[i] };
            c[i] = if c[i] < f32::INFINITY { c[i] } else { b[i] };
        }
    }
}

widest! {
    /// Replaces each value by the largest within `reach` columns and rows, of values that are the largest within as much or more already, or within none.
    fn widen(values: &mut [f32], other: &mut Vec<f32>, columns: usize, reach: usize) {
        let columns = columns.max(1);
        let rows = values.len() / columns;
        let larger = |a: f32, b: f32| if b > a { b } else { a };
        other.clear();
        other.extend_from_slice(values);
        for (row, out) in values.chunks_exact(columns).zip(other.chunks_exact_mut(columns)) {
            let n = columns.saturating_sub(reach);
            for (out, v) in out[..n].iter_mut().zip(&row[columns - n..]) {
                *out = larger(*out, *v);
            }
            for (out, v) in out[columns - n..].iter_mut().zip(&row[..n]) {
                *out = larger(*out, *v);
            }
        }
        for r in 0..rows {
            let out = &mut values[r * columns..][..columns];
            out.copy_from_slice(&other[r * columns..][..columns]);
            let beside = [r.checked_sub(reach), Some(r + reach).filter(|r| *r < rows)];
            for r in beside.into_iter().flatten() {
                for (out, v) in out.iter_mut().zip(&other[r * columns..][..columns]) {
                    *out = larger(*out, *v);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_three_lowest_are_those_of_a_sort() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for (columns, rows) in [(37, 9), (1, 1), (2, 1), (1, 3), (3, 3)] {
            let values: Vec<f32> = (0..columns * rows)
                .map(|_| if rng.random_range(0..20) == 0 { f32::NAN } else { rng.random_range(0..30) as f32 })
                .collect();
            let mut lowest = Lowest::default();
            lowest.read(&values, 1.0, columns);
            for (i, third) in lowest.third.iter().enumerate() {
                let (c, r) = (i % columns, i / columns);
                let near = |a: usize, b: usize| a.abs_diff(b) <= 1;
                let mut all: Vec<f32> = (0..values.len())
                    .filter(|j| near(j % columns, c) && near(j / columns, r))
                    .map(|j| values[j])
                    .filter(|v| !v.is_nan())
                    .collect();
                all.sort_unstable_by(f32::total_cmp);
                let at = |n: usize| all.get(n).or(all.last()).copied().unwrap_or(f32::INFINITY);
                assert_eq!((lowest.least[i], *third), (at(0), at(2)), "{columns} x {rows}, cell {i}");
            }
        }
    }

    #[test]
    fn a_peak_needs_less_over_a_quiet_ground_and_larger_ones_begin_only_at_the_highest() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        // Quiet on the left, loud on the right; one high pixel in the middle of the left half.
        let mut pixels: Vec<f32> = (0..256 * 128)
            .map(|i| 100.0 + if i % 256 < 128 { 2.0 } else { 20.0 } * (rng.random::<f32>() - 0.5))
            .collect();
        pixels[60 * 256 + 60] = 150.0;
        let mut cells = Cells::default();
        cells.read(&Image::from_vec(256, 128, pixels).unwrap());
        let bar = Bar { sign: 1.0, unit: 0.5, min_score: 4.0, max_side: 64 };
        let mut bars = Bars::default();
        bars.take(&cells, &bar);
        let cell = |x: usize, y: usize| y / CELL * 32 + x / CELL;
        let need = |x: usize, highest: bool, side: u32| {
            bars.need(&cells, &bar, (cell(x, 60), highest), SideClass::of(side), false)
        };
        let (quiet, loud) = (need(60, true, 1).unwrap().mean, need(200, true, 1).unwrap().mean);
        assert!(quiet > 102.0 && quiet < 106.0, "{quiet}");
        assert!(loud > 120.0 && loud < 150.0, "{loud}");
        assert!(need(60, true, 50).is_some());
        assert!(need(60, false, 50).is_none(), "another peak of the cell leads to small clusters only");
        let to_beat = bars.need(&cells, &bar, (cell(60, 60), true), SideClass::of(1), true).unwrap().mean;
        assert!(to_beat <= quiet, "{to_beat}: the lowest of the cells around is no higher than the third lowest");
    }
}
