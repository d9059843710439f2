//! A region: what is kept of a cluster of pixels while rows go by, enough for its centroid and that centroid's covariance.

use super::pixel::{Pixel, RunSums};
use crate::Extent;
use crate::union_find::Node;

/// Moments of a cluster of pixels. Coordinates are whole pixels; sums of whole-number pixels are exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Union-find: the region this one was joined to, or itself.
    pub(crate) parent: u32,
    /// Number of pixels.
    pub area: u32,
    /// Leftmost column.
    pub left: u32,
    /// Rightmost column.
    pub right: u32,
    /// Topmost row.
    pub top: u32,
    /// Lowest row.
    pub bottom: u32,
    /// Smallest value, counts.
    pub min: f32,
    /// Largest value, counts.
    pub max: f32,
    /// Σ I, counts.
    pub sum: f64,
    /// Σ I x and Σ I y, counts px.
    pub sum_x: f64,
    /// See `sum_x`.
    pub sum_y: f64,
    /// Σ x, Σ y, px.
    pub x: f64,
    /// See `x`.
    pub y: f64,
    /// Σ x², Σ x y, Σ y², px².
    pub xx: f64,
    /// See `xx`.
    pub xy: f64,
    /// See `xx`.
    pub yy: f64,
}

/// Σ x and Σ x² of the columns start..=end, exact.
#[inline(always)]
fn column_sums(start: u32, end: u32) -> (f64, f64) {
    if start == end {
        let a = f64::from(start);
        return (a, a * a);
    }
    let n = u64::from(end - start) + 1;
    let middle = 0.5 * (f64::from(start) + f64::from(end));
    let x = n as f64 * middle;
    // Σ (x - middle)² = n (n² - 1) / 12; the product is divisible by 6.
    (x, x * middle + 0.5 * (n * (n * n - 1) / 6) as f64)
}

impl Node for Region {
    fn parent(&self) -> u32 {
        self.parent
    }
    fn set_parent(&mut self, parent: u32) {
        self.parent = parent;
    }
}

impl Region {
    /// The box around its pixels.
    pub fn extent(&self) -> Extent {
        Extent {
            left_px: f64::from(self.left) - 0.5,
            top_px: f64::from(self.top) - 0.5,
            width_px: f64::from(self.right - self.left + 1),
            height_px: f64::from(self.bottom - self.top + 1),
        }
    }

    /// The moments of the run of pixels `start..=end` of row `y`.
    #[inline(always)]
    pub(crate) fn of_run<T: Pixel>(parent: u32, y: u32, start: u32, end: u32, row: &[T]) -> Self {
        let RunSums { sum, sum_i, min, max } = T::run_sums(row.get(start as usize..=end as usize).unwrap_or(&[]));
        let area = end - start + 1;
        let (n, yf) = (f64::from(area), f64::from(y));
        let (x, xx) = column_sums(start, end);
        Self {
            parent,
            area,
            left: start,
            right: end,
            top: y,
            bottom: y,
            min,
            max,
            sum,
            sum_x: sum_i + sum * f64::from(start),
            sum_y: sum * yf,
            x,
            y: n * yf,
            xx,
            xy: x * yf,
            yy: n * yf * yf,
        }
    }

    /// Adds the run of pixels `start..=end` of row `y`, which is not above the region's lowest row.
    #[inline(always)]
    pub(crate) fn add_run<T: Pixel>(&mut self, y: u32, start: u32, end: u32, row: &[T]) {
        let RunSums { sum, sum_i, min, max } = T::run_sums(row.get(start as usize..=end as usize).unwrap_or(&[]));
        let area = end - start + 1;
        let (n, yf) = (f64::from(area), f64::from(y));
        let (x, xx) = column_sums(start, end);
        self.area += area;
        self.left = self.left.min(start);
        self.right = self.right.max(end);
        self.bottom = y;
        self.min = self.min.min(min);
        self.max = self.max.max(max);
        self.sum += sum;
        self.sum_x += sum_i + sum * f64::from(start);
        self.sum_y += sum * yf;
        self.x += x;
        self.y += n * yf;
        self.xx += xx;
        self.xy += x * yf;
        self.yy += n * yf * yf;
    }

    /// Adds another region's pixels.
    #[inline(always)]
    pub(crate) fn absorb(&mut self, other: &Self) {
        self.area += other.area;
        self.left = self.left.min(other.left);
        self.right = self.right.max(other.right);
        self.top = self.top.min(other.top);
        self.bottom = self.bottom.max(other.bottom);
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.sum += other.sum;
        self.sum_x += other.sum_x;
        self.sum_y += other.sum_y;
        self.x += other.x;
        self.y += other.y;
        self.xx += other.xx;
        self.xy += other.xy;
        self.yy += other.yy;
    }
}
