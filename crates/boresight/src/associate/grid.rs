//! Uniform grid over the points of one scan: the points in a rectangle, in time that grows with what is near.
//!
//! Method: points are sorted by cell (counting sort, row-major cells, stable), so a row of cells is one contiguous slice.
//! Cells hold about one point each, whatever the density; the outer cells reach to infinity, so outliers cost nothing and
//! need no memory. The extent of the grid is taken from a sample of the points, so that one wild point cannot coarsen it.
//! Symbols: n points; cost: build O(n), query O(points in the cells touched).
//! Limits: points must be finite; coincident points share a cell, whatever its size.

/// A point and its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPoint {
    /// Position, px.
    pub x: f64,
    /// Position, px.
    pub y: f64,
    /// Number of the point in the list that was given.
    pub index: u32,
}

/// Points sorted into cells; built again for each scan, in the same memory.
#[derive(Clone, Debug, Default)]
pub struct UniformGrid {
    origin_x: f64,
    origin_y: f64,
    per_px_x: f64,
    per_px_y: f64,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    points: Vec<GridPoint>,
    cells: Vec<u32>,
}

/// Points looked at to choose the extent.
const SAMPLE: usize = 128;

impl UniformGrid {
    /// Builds an empty grid.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sorts the points anew; their numbers are their places in the list.
    pub fn build(&mut self, points: impl ExactSizeIterator<Item = (f64, f64)> + Clone) {
        let n = points.len();
        let (x0, x1) = reach(points.clone().map(|p| p.0), n);
        let (y0, y1) = reach(points.clone().map(|p| p.1), n);
        let (width, height) = ((x1 - x0).max(1e-9), (y1 - y0).max(1e-9));
        // About one point a cell; a long thin field gets long rows, never more cells than 2 n + 2.
        let side = (width * height / n.max(1) as f64).sqrt().max(width.max(height) / (n.max(1) as f64));
        self.columns = ((width / side).ceil() as usize).clamp(1, n.max(1));
        self.rows = ((height / side).ceil() as usize).clamp(1, (2 * n / self.columns).max(1));
        self.origin_x = x0;
        self.origin_y = y0;
        self.per_px_x = self.columns as f64 / width;
        self.per_px_y = self.rows as f64 / height;

        self.starts.clear();
        self.starts.resize(self.columns * self.rows + 1, 0);
        self.cells.clear();
        for (x, y) in points.clone() {
            let cell = self.row_of(y) * self.columns + self.column_of(x);
            self.cells.push(cell as u32);
            self.starts[cell + 1] += 1;
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.points.clear();
        self.points.resize(n, GridPoint { x: 0.0, y: 0.0, index: 0 });
        for (index, (x, y)) in points.enumerate() {
            let at = &mut self.starts[self.cells[index] as usize];
            self.points[*at as usize] = GridPoint { x, y, index: index as u32 };
            *at += 1;
        }
        // Each start now stands where its neighbour's was: move all by one.
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }

    #[inline]
    fn column_of(&self, x: f64) -> usize {
        // A float cast saturates: everything left of the grid is column 0.
        (((x - self.origin_x) * self.per_px_x) as usize).min(self.columns - 1)
    }

    #[inline]
    fn row_of(&self, y: f64) -> usize {
        (((y - self.origin_y) * self.per_px_y) as usize).min(self.rows - 1)
    }

    /// Fetches what [`Self::near`] will read of this rectangle into the cache and returns a number that depends on it.
    /// Called for a batch of rectangles before they are searched, it lets the fetches overlap.
    #[inline]
    pub fn touch(&self, x: f64, y: f64, half_width: f64, half_height: f64) -> u32 {
        if self.points.is_empty() {
            return 0;
        }
        let c0 = self.column_of(x - half_width);
        let (r0, r1) = (self.row_of(y - half_height), self.row_of(y + half_height));
        // A wide gate is not worth fetching ahead.
        (r0..=r1.min(r0 + 3)).fold(0, |sum: u32, r| {
            let at = self.starts[r * self.columns + c0] as usize;
            sum.wrapping_add(self.points.get(at).map_or(0, |p| p.index))
        })
    }

    /// Calls `visit` with every point of the cells that the rectangle touches (so also with some outside of it), in the
    /// order of the cells; stops early when `visit` returns `false`.
    #[inline]
    pub fn near(&self, x: f64, y: f64, half_width: f64, half_height: f64, mut visit: impl FnMut(&GridPoint) -> bool) {
        if self.points.is_empty() {
            return;
        }
        let (c0, c1) = (self.column_of(x - half_width), self.column_of(x + half_width));
        let (r0, r1) = (self.row_of(y - half_height), self.row_of(y + half_height));
        for r in r0..=r1 {
            let from = self.starts[r * self.columns + c0] as usize;
            let to = self.starts[r * self.columns + c1 + 1] as usize;
            for p in &self.points[from..to] {
                if !visit(p) {
                    return;
                }
            }
        }
    }
}

/// Where most of the values lie: the sample's extent, widened by its spacing; exact for short lists.
fn reach(mut values: impl ExactSizeIterator<Item = f64> + Clone, n: usize) -> (f64, f64) {
    let mut sample = [0.0; SAMPLE];
    let step = n.div_ceil(SAMPLE).max(1);
    let mut m = 0;
    while m < SAMPLE {
        let Some(v) = (if m == 0 { values.next() } else { values.nth(step - 1) }) else { break };
        sample[m] = v;
        m += 1;
    }
    let sample = &mut sample[..m];
    if sample.is_empty() {
        return (0.0, 1.0);
    }
    sample.sort_unstable_by(f64::total_cmp);
    let trim = m / 16;
    let (low, high) = (sample[trim], sample[m - 1 - trim]);
    let widen = (high - low) * 0.1;
    (low - widen, high + widen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn in_box(grid: &UniformGrid, x: f64, y: f64, w: f64, h: f64) -> Vec<u32> {
        let mut found = Vec::new();
        grid.near(x, y, w, h, |p| {
            if (p.x - x).abs() <= w && (p.y - y).abs() <= h {
                found.push(p.index);
            }
            true
        });
        found.sort_unstable();
        found
    }

    proptest! {
        #[test]
        fn a_query_finds_every_point_of_its_rectangle(
            points in prop::collection::vec((-1e3..1e3f64, prop::num::f64::NORMAL.prop_map(|y| y.clamp(-1e12, 1e12))), 0..200),
            x in -2e3..2e3f64, y in -2e3..2e3f64, w in 0.0..500f64, h in 0.0..1e4f64,
        ) {
            let mut grid = UniformGrid::new();
            grid.build(points.iter().copied());
            let brute: Vec<u32> = (0..points.len() as u32)
                .filter(|i| {
                    let p = points[*i as usize];
                    (p.0 - x).abs() <= w && (p.1 - y).abs() <= h
                })
                .collect();
            prop_assert_eq!(in_box(&grid, x, y, w, h), brute);
        }
    }

    #[test]
    fn one_wild_point_does_not_coarsen_the_grid() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|i| (f64::from(i % 100), f64::from(i / 100))).collect();
        points.push((1e12, -1e12));
        let mut grid = UniformGrid::new();
        grid.build(points.iter().copied());
        let mut looked_at = 0;
        grid.near(50.0, 50.0, 1.0, 1.0, |_| {
            looked_at += 1;
            true
        });
        assert!(looked_at < 60, "{looked_at} points looked at for a 2 x 2 px box at one point per px²");
        assert_eq!(in_box(&grid, 1e12, -1e12, 1.0, 1.0), [10_000]);
    }
}
