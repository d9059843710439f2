//! A region: what is kept of a cluster of pixels while rows go by, enough for its centroid and that centroid's covariance.

use super::pixel::Pixel;

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
    /// Number of run ends that have a neighbour inside the image.
    pub n_edges: u32,
    /// Sum over those run ends of |I inside - I outside|, counts.
    pub edge_step: f32,
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

impl Region {
    /// The moments of the run of pixels `start..=end` of row `y`.
    #[inline]
    pub(crate) fn of_run<T: Pixel>(parent: u32, y: u32, start: u32, end: u32, row: &[T]) -> Self {
        let (mut sum, mut sum_i, mut min, mut max) = (0.0f64, 0.0f64, f32::INFINITY, f32::NEG_INFINITY);
        let pixels = row.get(start as usize..=end as usize).unwrap_or(&[]);
        for (i, &p) in pixels.iter().enumerate() {
            let v = p.value();
            sum += v;
            sum_i += v * i as f64;
            let v = p.value_f32();
            min = min.min(v);
            max = max.max(v);
        }
        let (mut n_edges, mut edge_step) = (0, 0.0);
        let mut edge = |inside: Option<&T>, outside: Option<&T>| {
            if let (Some(a), Some(b)) = (inside, outside) {
                let step = (a.value_f32() - b.value_f32()).abs();
                if step.is_finite() {
                    n_edges += 1;
                    edge_step += step;
                }
            }
        };
        edge(row.get(start as usize), (start as usize).checked_sub(1).and_then(|i| row.get(i)));
        edge(row.get(end as usize), row.get(end as usize + 1));
        let n = f64::from(end - start + 1);
        let (a, b) = (f64::from(start), f64::from(end));
        let x = n * (a + b) / 2.0;
        let xx = n * (n * n - 1.0) / 12.0 + x * x / n;
        let yf = f64::from(y);
        Self {
            parent,
            area: end - start + 1,
            left: start,
            right: end,
            top: y,
            bottom: y,
            n_edges,
            edge_step,
            min,
            max,
            sum,
            sum_x: sum_i + sum * a,
            sum_y: sum * yf,
            x,
            y: n * yf,
            xx,
            xy: x * yf,
            yy: n * yf * yf,
        }
    }

    /// Adds the run of pixels `start..=end` of row `y`.
    #[inline]
    pub(crate) fn add_run<T: Pixel>(&mut self, y: u32, start: u32, end: u32, row: &[T]) {
        self.absorb(&Self::of_run(0, y, start, end, row));
    }

    /// Adds another region's pixels.
    #[inline]
    pub(crate) fn absorb(&mut self, other: &Self) {
        self.area += other.area;
        self.left = self.left.min(other.left);
        self.right = self.right.max(other.right);
        self.top = self.top.min(other.top);
        self.bottom = self.bottom.max(other.bottom);
        self.n_edges += other.n_edges;
        self.edge_step += other.edge_step;
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
