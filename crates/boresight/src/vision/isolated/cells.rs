//! What cells of 8 x 8 px say of a frame: their extremes, and the ground and the noise in square rings of cells around any place.
//!
//! A cell's variance is taken about its own plane, so that shading is no noise: what is left is a lower bound of the spread that a ring through the cell shows. Sums over
//! rectangles of cells come from summed-area tables (F. C. Crow, SIGGRAPH 1984), in f64.
//! Units: counts, counts²; places in cells.
//! Limits: cells at the right and lower border are smaller and keep their shading. Pixels that are not finite count for nothing.

use crate::Image;
use crate::vision::pixel::Pixel;

/// Side of a cell, px.
pub const CELL: usize = 8;

/// Σ x² over a cell of places about its middle: 8 Σ (±0.5, ±1.5, ±2.5, ±3.5)².
const PLACES2: f32 = 336.0;

/// The cells of one frame; keeps its memory.
#[derive(Debug, Default)]
pub struct Cells {
    columns: usize,
    rows: usize,
    lowest: Vec<f32>,
    highest: Vec<f32>,
    means: Vec<f32>,
    spreads: Vec<f32>,
    /// Summed-area table with a row and a column of zeros before it: pixels, values, squared deviations about each cell's plane.
    sums: Vec<[f64; 3]>,
    /// The cells of one row.
    row: Vec<Part>,
}

/// What one cell holds.
#[derive(Clone, Copy, Debug)]
struct Cell {
    low: f32,
    high: f32,
    pixels: f64,
    values: f64,
    squares: f64,
}

impl Cell {
    /// Mean of the values and of the squares. A product where it is the quotient to the bit: a division takes as long as the rest of the cell.
    fn means(&self) -> [f64; 2] {
        const WHOLE: f64 = (CELL * CELL) as f64;
        let each = [self.values, self.squares];
        if self.pixels == WHOLE { each.map(|v| v * (1.0 / WHOLE)) } else { each.map(|v| v / self.pixels) }
    }
}

impl Cells {
    /// Reads a frame.
    pub fn read<T: Pixel>(&mut self, image: &Image<T>) {
        self.columns = image.width().div_ceil(CELL);
        self.rows = image.height().div_ceil(CELL);
        let stride = self.columns + 1;
        for v in [&mut self.lowest, &mut self.highest, &mut self.means, &mut self.spreads] {
            v.clear();
            v.resize(self.columns * self.rows, 0.0);
        }
        self.sums.clear();
        self.sums.resize(stride * (self.rows + 1), [0.0; 3]);
        let mut parts = std::mem::take(&mut self.row);
        for r in 0..self.rows {
            let tall = CELL.min(image.height() - r * CELL);
            let mut rows = [image.row(r * CELL); CELL];
            rows.iter_mut().enumerate().take(tall).for_each(|(y, row)| *row = image.row(r * CELL + y));
            parts.clear();
            let of_bytes = T::STEP > 0.0 && size_of::<T>() == 1 && tall == CELL;
            let from = if of_bytes { row_of_byte_cells(&rows, &mut parts) } else { 0 };
            row_of_cells(&rows[..tall], from, &mut parts);
            let mut before = [0.0; 3];
            for (c, part) in parts.iter().enumerate() {
                let wide = CELL.min(image.width() - c * CELL);
                let cell = part.cell(wide, tall).unwrap_or_else(|| slow(image, c, r));
                self.lowest[r * self.columns + c] = cell.low;
                self.highest[r * self.columns + c] = cell.high;
                // NaN where no pixel is finite.
                let [mean, square] = cell.means();
                self.means[r * self.columns + c] = mean as f32;
                self.spreads[r * self.columns + c] = square.sqrt() as f32;
                before[0] += cell.pixels;
                before[1] += cell.values;
                before[2] += cell.squares;
                let (above, at) = (r * stride + c + 1, (r + 1) * stride + c + 1);
                let above = self.sums[above];
                self.sums[at] = [above[0] + before[0], above[1] + before[1], above[2] + before[2]];
            }
        }
        self.row = parts;
    }

    /// Columns and rows of cells.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// The highest value of each cell, or the lowest ones negated if `dark`; minus infinity where no pixel is finite.
    pub fn highest(&self, dark: bool) -> impl Iterator<Item = f32> {
        let (of, sign) = if dark { (&self.lowest, -1.0) } else { (&self.highest, 1.0) };
        of.iter().map(move |v| sign * v)
    }

    /// Mean and spread of each cell; NaN where no pixel is finite.
    pub fn each(&self) -> (&[f32], &[f32]) {
        (&self.means, &self.spreads)
    }

    /// Mean and spread within the ring of cells around a cell, `(column, row)`: all within `outer` cells of it, but not those within `inner`; `None` for it to hold no pixel.
    pub fn ring(&self, place: (usize, usize), inner: usize, outer: usize) -> Option<(f64, f64)> {
        let (all, middle) = (self.rectangle(place, outer), self.rectangle(place, inner));
        let (n, sum, squares) = (all[0] - middle[0], all[1] - middle[1], all[2] - middle[2]);
        (n > 0.5).then(|| (sum / n, (squares / n).max(0.0).sqrt()))
    }

    /// Pixels, values and squared deviations of the cells within `reach` of a place.
    fn rectangle(&self, (column, row): (usize, usize), reach: usize) -> [f64; 3] {
        let (x0, x1) = (column.saturating_sub(reach), (column + reach + 1).min(self.columns));
        let (y0, y1) = (row.saturating_sub(reach), (row + reach + 1).min(self.rows));
        let stride = self.columns + 1;
        let at = |x: usize, y: usize| self.sums[y * stride + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        [d[0] - b[0] - c[0] + a[0], d[1] - b[1] - c[1] + a[1], d[2] - b[2] - c[2] + a[2]]
    }
}

/// Sums over the pixels of a cell; differences are taken from its first pixel, so that f32 holds their squares.
#[derive(Clone, Copy, Debug)]
struct Part {
    base: f32,
    low: f32,
    high: f32,
    sum: f32,
    /// Weighted with the pixel's place about the middle.
    along: f32,
    down: f32,
    square: f32,
}

impl Part {
    /// The cell; `None` if a pixel of it is not finite.
    fn cell(&self, wide: usize, tall: usize) -> Option<Cell> {
        if !self.square.is_finite() {
            return None;
        }
        let n = (wide * tall) as f32;
        let mut squares = self.square - self.sum * self.sum / n;
        if wide == CELL && tall == CELL {
            squares -= (self.along * self.along + self.down * self.down) / PLACES2;
        }
        Some(Cell {
            low: self.low,
            high: self.high,
            pixels: f64::from(n),
            values: f64::from(self.sum) + f64::from(n) * f64::from(self.base),
            squares: f64::from(squares.max(0.0)),
        })
    }
}

/// Columns that are summed side by side: two cells, as many as the widest vectors hold. The order of adding is the same on every machine.
const LANES: usize = 2 * CELL;

/// The sums of so many columns.
struct Columns<const N: usize> {
    base: [f32; N],
    low: [f32; N],
    high: [f32; N],
    sum: [f32; N],
    down: [f32; N],
    square: [f32; N],
}

impl<const N: usize> Columns<N> {
    /// No pixel yet, about these values.
    #[inline(always)]
    fn about(base: [f32; N]) -> Self {
        let (low, high) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        Self { base, low, high, sum: [0.0; N], down: [0.0; N], square: [0.0; N] }
    }

    /// Adds a pixel to column `l`, that far below the middle.
    #[inline(always)]
    fn add(&mut self, l: usize, v: f32, place: f32) {
        let d = v - self.base[l];
        self.low[l] = if v < self.low[l] { v } else { self.low[l] };
        self.high[l] = if v > self.high[l] { v } else { self.high[l] };
        self.sum[l] += d;
        self.down[l] += place * d;
        self.square[l] += d * d;
    }

    /// The cell of the eight columns from `at` on.
    #[inline(always)]
    fn part(&self, at: usize) -> Part {
        let sum = eight(&self.sum, at);
        let mut along = sum;
        for i in 0..CELL {
            along[i] *= i as f32 - 3.5;
        }
        let (mut low, mut high) = (self.low[at], self.high[at]);
        for i in at + 1..at + CELL {
            low = if self.low[i] < low { self.low[i] } else { low };
            high = if self.high[i] > high { self.high[i] } else { high };
        }
        Part {
            base: self.base[at],
            low,
            high,
            sum: sum_of(sum),
            along: sum_of(along),
            down: sum_of(eight(&self.down, at)),
            square: sum_of(eight(&self.square, at)),
        }
    }
}

/// Eight of some values.
#[inline(always)]
fn eight(v: &[f32], at: usize) -> [f32; CELL] {
    let mut out = [0.0; CELL];
    out.copy_from_slice(&v[at..at + CELL]);
    out
}

/// The sum of eight values: of pairs, pairs of these, and the last two.
#[inline(always)]
fn sum_of(v: [f32; CELL]) -> f32 {
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}

/// Columns of bytes that are summed side by side.
const BYTE_LANES: usize = 4 * CELL;

widest! {
    /// Appends the cells of eight rows of bytes in whole numbers, which are those of [`row_of_cells`] to the bit, since f32 holds all its sums of bytes exactly; returns the column from
    /// which on pixels are left.
    fn row_of_byte_cells<T: Pixel>(rows: &[&[T]; CELL], out: &mut Vec<Part>) -> usize {
        let whole = rows[0].len() / BYTE_LANES * BYTE_LANES;
        for x in (0..whole).step_by(BYTE_LANES) {
            let (mut low, mut high) = ([u16::MAX; BYTE_LANES], [0u16; BYTE_LANES]);
            // Twice the place below the middle is a whole number.
            let (mut sum, mut down, mut square) = ([0u16; BYTE_LANES], [0i16; BYTE_LANES], [0u32; BYTE_LANES]);
            for (y, row) in rows.iter().enumerate() {
                let Some(row) = row[x..].first_chunk::<BYTE_LANES>() else { continue };
                for l in 0..BYTE_LANES {
                    let v = row[l].index() as u16;
                    low[l] = low[l].min(v);
                    high[l] = high[l].max(v);
                    sum[l] += v;
                    down[l] += (2 * y as i16 - 7) * v as i16;
                    square[l] += u32::from(v * v);
                }
            }
            for at in (0..BYTE_LANES).step_by(CELL) {
                let (mut s, mut q, mut along, mut below) = (0i32, 0i32, 0i32, 0i32);
                let (mut least, mut most) = (u16::MAX, 0);
                for i in 0..CELL {
                    s += i32::from(sum[at + i]);
                    q += square[at + i] as i32;
                    along += (2 * i as i32 - 7) * i32::from(sum[at + i]);
                    below += i32::from(down[at + i]);
                    least = least.min(low[at + i]);
                    most = most.max(high[at + i]);
                }
                let base = rows[0][x + at].index() as i32;
                let n = (CELL * CELL) as i32;
                out.push(Part {
                    base: base as f32,
                    low: f32::from(least),
                    high: f32::from(most),
                    sum: (s - n * base) as f32,
                    along: 0.5 * along as f32,
                    down: 0.5 * below as f32,
                    square: (q - 2 * base * s + n * base * base) as f32,
                });
            }
        }
        whole
    }
}

widest! {
    /// Appends the cells of up to eight rows of pixels from a column on.
    fn row_of_cells<T: Pixel>(rows: &[&[T]], from: usize, out: &mut Vec<Part>) {
        let width = rows[0].len();
        let whole = from + (width - from) / LANES * LANES;
        for x in (from..whole).step_by(LANES) {
            let mut base = [rows[0][x].value_f32(); LANES];
            base[CELL..].fill(rows[0][x + CELL].value_f32());
            let mut columns = Columns::about(base);
            for (y, row) in rows.iter().enumerate() {
                let Some(row) = row[x..].first_chunk::<LANES>() else { continue };
                for l in 0..LANES {
                    columns.add(l, row[l].value_f32(), y as f32 - 3.5);
                }
            }
            out.extend([columns.part(0), columns.part(CELL)]);
        }
        // A cell and a part of one, or less.
        for x in (whole..width).step_by(CELL) {
            let mut columns = Columns::<CELL>::about([rows[0][x].value_f32(); CELL]);
            for (y, row) in rows.iter().enumerate() {
                for (l, v) in row[x..].iter().take(CELL).enumerate() {
                    columns.add(l, v.value_f32(), y as f32 - 3.5);
                }
            }
            out.push(columns.part(0));
        }
    }
}

/// A cell of which some pixels are not finite, from those that are.
#[cold]
fn slow<T: Pixel>(image: &Image<T>, column: usize, row: usize) -> Cell {
    let rows = row * CELL..((row + 1) * CELL).min(image.height());
    let columns = column * CELL..((column + 1) * CELL).min(image.width());
    let pixels = rows.flat_map(|y| image.row(y)[columns.clone()].iter().map(|p| p.value()));
    let mut cell = Cell { low: f32::INFINITY, high: f32::NEG_INFINITY, pixels: 0.0, values: 0.0, squares: 0.0 };
    for v in pixels.filter(|v| v.is_finite()) {
        cell.low = cell.low.min(v as f32);
        cell.high = cell.high.max(v as f32);
        cell.pixels += 1.0;
        cell.values += v;
    }
    cell
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_ring_tells_ground_and_noise_whatever_the_shading_and_the_offset() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for (offset, gain) in [(0.0, 1.0), (60_000.0, 1.0), (1e6, 30.0)] {
            let pixels: Vec<f32> = (0..200 * 160)
                .map(|i| {
                    let noise: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                    (offset + gain * (noise + 0.5 * (i % 200) as f64 + 0.2 * (i / 200) as f64)) as f32
                })
                .collect();
            let mut cells = Cells::default();
            cells.read(&Image::from_vec(200, 160, pixels).unwrap());
            assert_eq!(cells.size(), (25, 20));
            let (mean, spread) = cells.ring((12, 9), 1, 3).unwrap();
            // The plane in the middle of the cell: column 99.5, row 75.5.
            let plane = offset + gain * (0.5 * 99.5 + 0.2 * 75.5);
            assert!((mean - plane).abs() < 0.1 * gain + 1e-7 * offset, "{mean} {plane}");
            // 61 of 64 degrees of freedom of a cell are left.
            assert!((spread / gain / (61f64 / 64.0).sqrt() - 1.0).abs() < 0.04, "{spread}");
        }
    }

    #[test]
    fn bytes_give_what_floats_give() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for (w, h) in [(32, 8), (101, 27), (320, 16)] {
            for range in [0..=255u8, 250..=255, 7..=7, 0..=1] {
                let bytes: Vec<u8> = (0..w * h).map(|_| rng.random_range(range.clone())).collect();
                let floats = bytes.iter().map(|v| f32::from(*v)).collect();
                let [mut a, mut b] = [Cells::default(), Cells::default()];
                a.read(&Image::from_vec(w, h, bytes).unwrap());
                b.read(&Image::<f32>::from_vec(w, h, floats).unwrap());
                assert_eq!(format!("{a:?}").split("row:").next(), format!("{b:?}").split("row:").next());
            }
        }
    }

    #[test]
    fn extremes_are_those_of_finite_pixels_and_cells_at_the_border_are_whole() {
        let mut image = Image::filled(21, 11, 5.0f32);
        image.row_mut(10)[20] = 9.0;
        image.row_mut(9)[20] = f32::NAN;
        image.row_mut(0)[0] = f32::INFINITY;
        image.row_mut(1)[1] = -3.0;
        let mut cells = Cells::default();
        cells.read(&image);
        assert_eq!(cells.highest(false).collect::<Vec<_>>(), [5.0, 5.0, 5.0, 5.0, 5.0, 9.0]);
        assert_eq!(cells.highest(true).next(), Some(3.0));
        let (mean, spread) = cells.ring((1, 0), 0, 1).unwrap();
        // 231 - 64 pixels without the middle cell, less two that are not finite; their sum is 5 each, but for -3 and 9.
        assert!((mean - (5.0 * 165.0 - 8.0 + 4.0) / 165.0).abs() < 1e-6, "{mean}");
        assert_eq!(spread, 0.0);
        cells.read(&Image::filled(0, 0, 1u8));
        assert_eq!((cells.size(), cells.highest(true).count()), ((0, 0), 0));
        cells.read(&Image::filled(5, 5, 7u16));
        assert_eq!(cells.ring((0, 0), 0, 1), None);
    }
}
