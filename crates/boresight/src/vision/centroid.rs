//! Centroids of regions, each with the covariance that the noise of its pixels gives it.
//!
//! Source: `docs/theory/centroid.md` (mask, binary, bbox): c = Σ w p / Σ w with w = s (I - b). The covariance is ours;
//! it adds three parts. Inside: first-order propagation, Σ σ² (p - c)(p - c)ᵀ / (Σ w)².
//! Edge: noise and the pixel grid decide which pixels pass the threshold T. With the width δ = σ / slope over which
//! the edge is undecided (px), a pixel of the edge adds the variance of f = (v - b)[v >= T], per length of edge
//! δ (J²/√π + Jσ + A₁σ²), and the grid J² Q(δ) per row or column crossed; J = T - b, A₁ = ∫ Var(X⁺) - 1(u > 0) du = -0.3761 for
//! X ~ N(u, 1), Q(δ) = Σ_k exp(-4π²k²δ²) / (2π²k²) (1/12 for a sharp edge). The edge is taken as a circle stretched like the region, the
//! slope as that of a Gaussian spot with the region's area and mean height over T (a paraboloid where the ground is unknown).
//! Sides (`bbox`, `box-centre`): each side of the rectangle has the variance 1/12 + 0.75 δ²; 0.75 is fitted to simulated spots.
//! Limits: tested on spots of 1.2 to 4 px sigma and 5 to 60 times the noise: the normalised error has its mean square 2 within
//! 5 % for mask, binary and bbox weighed by intensity (box-centre: of 1.5 to 2.5 px sigma and 15 to 35 times the noise); bbox weighed above
//! the background is safe by up to 25 %. Not modelled:
//! neighbours that touch, a background that slopes under the target, noise correlated between pixels, δ above 1 px.
//! Symbols: I pixel value (counts); b background (counts, 0 for `intensity`); s = +1 bright, -1 dark; σ² variance of one pixel
//! (counts²); p pixel centre (px); r radius of the circle of the region's area (px).

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
    /// The level T at which a pixel became one of the region, counts, if there is one.
    pub level: Option<f64>,
    /// The true background around the region, counts, if it is known: it gives the slope at the region's edge.
    pub ground: Option<f64>,
}

impl Surroundings {
    /// Plain intensity weights, and pixels of variance 1 about which nothing else is known.
    pub fn plain() -> Self {
        Self { background: 0.0, sign: 1.0, variance: 1.0, gain: 0.0, level: None, ground: None }
    }
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
    /// Sum of the weights of a row or column at each side (left, right, top, bottom), half inside and half outside.
    sides: [f64; 4],
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
            sides: [0.0; 4],
        }
    }

    fn of_rectangle<T: Pixel>(r: &Region, image: &Image<T>, around: &Surroundings) -> Self {
        let mut sums = Self {
            n: 0.0,
            w: 0.0,
            wx: 0.0,
            wy: 0.0,
            x: 0.0,
            y: 0.0,
            xx: 0.0,
            xy: 0.0,
            yy: 0.0,
            intensity: 0.0,
            sides: [0.0; 4],
        };
        let value = |x: u32, y: u32| {
            let v = image.get(x as usize, y as usize).map_or(f64::NAN, |p| p.value());
            // A pixel without a value (NaN, or outside) has no weight, but keeps its place in the noise sums.
            if v.is_finite() { v } else { around.background }
        };
        let weight = |v: f64| around.sign * (v - around.background);
        for y in r.top..=r.bottom {
            let yf = f64::from(y);
            for x in r.left..=r.right {
                let v = value(x, y);
                let w = weight(v);
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
        // A side lies between the last row inside and the first outside; at the image's edge the inside one counts twice.
        let before = |v: u32| v.saturating_sub(1);
        let after = |v: u32, n: usize| if (v as usize) + 1 < n { v + 1 } else { v };
        for y in r.top..=r.bottom {
            sums.sides[0] += 0.5 * (weight(value(r.left, y)) + weight(value(before(r.left), y)));
            sums.sides[1] += 0.5 * (weight(value(r.right, y)) + weight(value(after(r.right, image.width()), y)));
        }
        for x in r.left..=r.right {
            sums.sides[2] += 0.5 * (weight(value(x, r.top)) + weight(value(x, before(r.top))));
            sums.sides[3] += 0.5 * (weight(value(x, r.bottom)) + weight(value(x, after(r.bottom, image.height()))));
        }
        sums
    }
}

/// The edge of a region: how undecided it is.
struct Edge {
    /// Radius of the circle of the region's area, px.
    radius: f64,
    /// Width over which membership is undecided, px.
    width: f64,
    /// Slope of the pixel values across the edge, counts/px.
    slope: f64,
    /// Standard deviation of a pixel there, counts.
    sd: f64,
    /// Jump of the weight where a pixel joins, counts.
    jump: f64,
    /// +1 if the weight grows away from the threshold, else -1.
    growth: f64,
}

/// A₁, see above.
const RAMP: f64 = -0.376_126_389_031_832_8;
/// Squares of the edge's pixels per length of edge are counted along a circle: Σ (p - c)(p - c)ᵀ = 4 / r x the region's moment.
const PER_LENGTH: f64 = 4.0;
/// The same per row or column that the circle crosses: 4√2 r crossings instead of 2π r.
const PER_CROSSING: f64 = 3.601_265;

impl Edge {
    fn of(r: &Region, around: &Surroundings) -> Self {
        let n = f64::from(r.area);
        let radius = (n / std::f64::consts::PI).sqrt();
        let mean = r.sum / n;
        let Some(level) = around.level.filter(|l| l.is_finite()) else {
            return Self { radius, width: 0.0, slope: 0.0, sd: 0.0, jump: 0.0, growth: 1.0 };
        };
        let sd = (around.variance + around.gain * level.max(0.0)).max(0.0).sqrt();
        let bright = if mean >= level { 1.0 } else { -1.0 };
        let height = (mean - level).abs().max(0.1 * sd).max(1e-12);
        let over_ground = around.ground.map_or(0.0, |g| bright * (level - g));
        let slope = if over_ground > 0.0 {
            2.0 * over_ground * log_peak_ratio(height / over_ground) / radius
        } else {
            4.0 * height / radius
        };
        Self {
            radius,
            width: (sd / slope).min(1.0),
            slope,
            sd,
            jump: (level - around.background).abs(),
            growth: bright * around.sign,
        }
    }

    /// Variance that the grid gives to the place of a sharp edge crossed once, px².
    fn grid_variance(&self) -> f64 {
        // The crossing is oblique on average.
        let d = 1.1 * self.width;
        if d < 0.25 {
            // The sum over k by Poisson's formula; what is left out grows with d to 5e-4 px² at 1/4.
            1.0 / 12.0 - d * FRAC_1_SQRT_PI + d * d
        } else {
            (-4.0 * (std::f64::consts::PI * d).powi(2)).exp() / (2.0 * std::f64::consts::PI.powi(2))
        }
    }

    /// What the edge adds to the variance of a pixel, over all the region's moment, for weights 1.
    fn membership(&self) -> f64 {
        (PER_LENGTH * self.width * FRAC_1_SQRT_PI + PER_CROSSING * self.grid_variance()) / self.radius
    }

    /// The same for weights of pixel values, counts².
    fn weighted(&self) -> f64 {
        let (j, sd) = (self.jump, self.sd);
        let noise = j * j * FRAC_1_SQRT_PI + self.growth * j * sd + RAMP * sd * sd;
        let kink = (-4.0 * (std::f64::consts::PI * 1.1 * self.width).powi(2)).exp() * self.slope * self.slope / 720.0;
        (PER_LENGTH * self.width * noise + PER_CROSSING * (j * j * self.grid_variance() + kink)) / self.radius
    }

    /// Variance of one side of the bounding rectangle, px².
    fn side_variance(&self) -> f64 {
        1.0 / 12.0 + 0.75 * self.width * self.width
    }
}

const FRAC_1_SQRT_PI: f64 = 0.564_189_583_547_756_3;

/// ln(peak / level) of a Gaussian spot whose pixels over the level have the mean height `x` (in units of the level).
fn log_peak_ratio(x: f64) -> f64 {
    // (exp(y) - 1) / y = 1 + x by Newton's method from a fit that is right to a few per cent.
    let mut y = 2.0 * x / (1.0 + 0.58 * x);
    if y < 1e-3 {
        return y;
    }
    for _ in 0..8 {
        let f = y.exp_m1() / y - 1.0 - x;
        let slope = (y.exp() * (y - 1.0) + 1.0) / (y * y);
        let step = (f / slope).clamp(-1.0, 1.0);
        y = (y - step).max(1e-3);
        if step.abs() < 1e-9 {
            break;
        }
    }
    y
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
        CentroidMethod::Mask => weighted(&Sums::of_region(region, around), region, around, false),
        CentroidMethod::Bbox => weighted(&Sums::of_rectangle(region, image, around), region, around, true),
        CentroidMethod::Binary => binary(region, around),
        CentroidMethod::BoxCentre => {
            let middle = |a: u32, b: u32| 0.5 * (f64::from(a) + f64::from(b));
            Centroid {
                position: Vector2::new(middle(region.left, region.right), middle(region.top, region.bottom)),
                cov: Matrix2::identity() * (0.5 * Edge::of(region, around).side_variance()),
                sum: f64::from(region.area),
            }
        }
    }
}

fn weighted(sums: &Sums, region: &Region, around: &Surroundings, rectangle: bool) -> Centroid {
    let position = Vector2::new(sums.wx / sums.w, sums.wy / sums.w);
    let inside = |v: f64, a: u32, b: u32| v >= f64::from(a) && v <= f64::from(b);
    if !(sums.w > 0.0 && inside(position.x, region.left, region.right) && inside(position.y, region.top, region.bottom))
    {
        return binary(region, around);
    }
    let edge = Edge::of(region, around);
    let variance = (around.variance + around.gain * (sums.intensity / sums.n).max(0.0)).max(0.0);
    let per_pixel = variance + if rectangle { 0.0 } else { edge.weighted().max(-0.5 * variance) };
    let mut cov = second_moment(sums, position) * (per_pixel / (sums.w * sums.w));
    if rectangle {
        let side = edge.side_variance();
        let lever = |sum: f64, at: f64| (sum * at / sums.w).powi(2);
        let [left, right, top, bottom] = sums.sides;
        cov[(0, 0)] += side
            * (lever(left, position.x - f64::from(region.left) + 0.5)
                + lever(right, f64::from(region.right) - position.x + 0.5));
        cov[(1, 1)] += side
            * (lever(top, position.y - f64::from(region.top) + 0.5)
                + lever(bottom, f64::from(region.bottom) - position.y + 0.5));
    }
    Centroid { position, cov: cov + floor(), sum: sums.w }
}

fn binary(r: &Region, around: &Surroundings) -> Centroid {
    let sums = Sums::of_region(r, around);
    let n = f64::from(r.area);
    let position = Vector2::new(r.x / n, r.y / n);
    let cov = second_moment(&sums, position) * (Edge::of(r, around).membership() / (n * n));
    Centroid { position, cov: cov + floor(), sum: n }
}

/// Σ (p - c)(p - c)ᵀ over the area of the pixels, each a unit square of second moment 1/12, px².
fn second_moment(s: &Sums, c: Vector2<f64>) -> Matrix2<f64> {
    let xx = s.xx - 2.0 * c.x * s.x + s.n * c.x * c.x;
    let yy = s.yy - 2.0 * c.y * s.y + s.n * c.y * c.y;
    let xy = s.xy - c.x * s.y - c.y * s.x + s.n * c.x * c.y;
    Matrix2::new(xx.max(0.0) + s.n / 12.0, xy, xy, yy.max(0.0) + s.n / 12.0)
}

/// The least variance of any centroid, px²: keeps the covariance invertible where no noise is known.
fn floor() -> Matrix2<f64> {
    Matrix2::identity() * 1e-6
}

#[cfg(test)]
mod edge_tests;
#[cfg(test)]
mod tests;
