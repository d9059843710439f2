//! Centroids of regions, each with the covariance that the noise of its pixels gives it.
//!
//! Source: SPEC C.6 (mask, binary, bbox); covariance: first-order propagation, c = Σ w p / Σ w with w = s (I - b),
//! cov = Σ σ² (p - c)(p - c)ᵀ / (Σ w)². Symbols: I pixel value (counts); b background (counts, 0 for `intensity`); s = +1 bright, -1
//! dark; σ² variance of one pixel (counts²); p pixel centre (px).

use super::config::CentroidMethod;
use super::pixel::Pixel;
use super::region::Region;
use crate::Image;
use nalgebra::{Matrix2, Vector2};

/// What is known of a region's surroundings when its centroid is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// The background b that is taken from every pixel, counts; 0 weighs by plain intensity.
    pub background: f64,
    /// +1 for targets brighter than b, -1 for darker ones.
    pub sign: f64,
    /// Variance of one pixel at intensity 0, counts².
    pub variance: f64,
    /// Growth of that variance with intensity, counts.
    pub gain: f64,
}

/// A centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centroid {
    /// Position, px.
    pub position: Vector2<f64>,
    /// Covariance, px².
    pub cov: Matrix2<f64>,
    /// Sum of the weights, counts (pixels for `binary` and `box-centre`).
    pub sum: f64,
}

/// Sums over the pixels that a centroid is taken from.
struct Sums {
    n: f64,
    w: f64,
    wx: f64,
    wy: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    intensity: f64,
}

impl Sums {
    fn of_region(r: &Region, around: &Surroundings) -> Self {
        let (b, s) = (around.background, around.sign);
        let n = f64::from(r.area);
        Self {
            n,
            w: s * (r.sum - b * n),
            wx: s * (r.sum_x - b * r.x),
            wy: s * (r.sum_y - b * r.y),
            x: r.x,
            y: r.y,
            xx: r.xx,
            xy: r.xy,
            yy: r.yy,
            intensity: r.sum,
        }
    }

    fn of_rectangle<T: Pixel>(r: &Region, image: &Image<T>, around: &Surroundings) -> Self {
        let mut sums =
            Self { n: 0.0, w: 0.0, wx: 0.0, wy: 0.0, x: 0.0, y: 0.0, xx: 0.0, xy: 0.0, yy: 0.0, intensity: 0.0 };
        for y in r.top..=r.bottom {
            let row = image.row(y as usize);
            let yf = f64::from(y);
            for x in r.left..=r.right {
                let v = row.get(x as usize).map_or(0.0, |p| p.value());
                // A pixel without a value (NaN) has no weight, but keeps its place in the noise sums.
                let v = if v.is_finite() { v } else { around.background };
                let w = around.sign * (v - around.background);
                let xf = f64::from(x);
                sums.n += 1.0;
                sums.intensity += v;
                sums.w += w;
                sums.wx += w * xf;
                sums.wy += w * yf;
                sums.x += xf;
                sums.y += yf;
                sums.xx += xf * xf;
                sums.xy += xf * yf;
                sums.yy += yf * yf;
            }
        }
        sums
    }
}

/// Returns the centroid of a region by the chosen method.
///
/// Weights whose sum is not above 0, or that put the centroid outside the bounding box, say nothing about the position: the
/// region's binary centroid is returned instead.
pub fn centroid<T: Pixel>(
    region: &Region,
    image: &Image<T>,
    method: CentroidMethod,
    around: &Surroundings,
) -> Centroid {
    match method {
        CentroidMethod::Mask => weighted(&Sums::of_region(region, around), region, around),
        CentroidMethod::Bbox => weighted(&Sums::of_rectangle(region, image, around), region, around),
        CentroidMethod::Binary => binary(region),
        CentroidMethod::BoxCentre => {
            let middle = |a: u32, b: u32| 0.5 * (f64::from(a) + f64::from(b));
            Centroid {
                position: Vector2::new(middle(region.left, region.right), middle(region.top, region.bottom)),
                // Each side lies anywhere in its pixel: variance 1/12, and the middle halves the sum of two.
                cov: Matrix2::identity() / 24.0,
                sum: f64::from(region.area),
            }
        }
    }
}

fn weighted(sums: &Sums, region: &Region, around: &Surroundings) -> Centroid {
    let position = Vector2::new(sums.wx / sums.w, sums.wy / sums.w);
    let inside = |v: f64, a: u32, b: u32| v >= f64::from(a) && v <= f64::from(b);
    if !(sums.w > 0.0 && inside(position.x, region.left, region.right) && inside(position.y, region.top, region.bottom))
    {
        return binary(region);
    }
    let variance = around.variance + around.gain * (sums.intensity / sums.n).max(0.0);
    let cov = second_moment(sums, position) * (variance / (sums.w * sums.w));
    Centroid { position, cov: cov + floor(), sum: sums.w }
}

fn binary(r: &Region) -> Centroid {
    let n = f64::from(r.area);
    let position = Vector2::new(r.x / n, r.y / n);
    Centroid { position, cov: Matrix2::identity() / (12.0 * n), sum: n }
}

/// Σ (p - c)(p - c)ᵀ, px².
fn second_moment(s: &Sums, c: Vector2<f64>) -> Matrix2<f64> {
    let xx = s.xx - 2.0 * c.x * s.x + s.n * c.x * c.x;
    let yy = s.yy - 2.0 * c.y * s.y + s.n * c.y * c.y;
    let xy = s.xy - c.x * s.y - c.y * s.x + s.n * c.x * c.y;
    Matrix2::new(xx.max(0.0), xy, xy, yy.max(0.0))
}

/// The least variance of any centroid, px²: keeps the covariance invertible for one-pixel clusters.
fn floor() -> Matrix2<f64> {
    Matrix2::identity() * 1e-4
}
