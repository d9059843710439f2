//! A Gaussian spot fitted by least squares: position, its covariance, and whether it is a spot at all.
//!
//! Model: I(x, y) = b + gx (x - cx) + gy (y - cy) + A exp(-((x - x0)² + (y - y0)²) / (2 σ²)), c the middle of the window: seven unknowns, Levenberg's form of Gauss-Newton. A ground
//! that slopes by s counts a pixel draws a fit without slope by some 2 s σ² / A. Covariance of the
//! position: s² (JᵀJ)⁻¹, the Cramér-Rao bound for normal noise of the deviation s of the residuals (at least the rounding noise). The
//! residuals hold what the ground adds, so the covariance does too. Source: K. Mortensen et al., Nat. Methods 7, 377 (2010).
//! Limits: the pixel's own width is taken into σ, right for σ above 0.5 px; a spot cut by the border is fitted to what is seen.
//! Symbols: A height (counts), b ground (counts), g its slope (counts/px), σ deviation of the spot (px).

use super::pyramid::View;
use crate::vision::pixel::Pixel;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

const STEPS: usize = 8;
/// Half side of the window, in deviations of the spot expected.
const WINDOW: f64 = 2.7;

/// Farthest that a centre may lie beyond the middle of the outermost pixels, in deviations of the spot and px: there a sixth of the spot is seen.
const MOST_BEYOND: f64 = 1.0;
const MOST_BEYOND_PX: f64 = 2.0;

/// A fitted spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spot {
    /// Position, px of the level.
    pub(super) position: Vector2<f64>,
    /// Covariance of the position, px².
    pub(super) cov: Matrix2<f64>,
    /// Height above the ground, counts; negative for a dark spot.
    pub(super) height: f64,
    /// Deviation, px.
    pub(super) sigma: f64,
}

/// Where a fit starts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) height: f64,
    pub(super) ground: f64,
    pub(super) sigma: f64,
}

/// Unknowns: x0, y0, A, b, σ, gx, gy.
const N: usize = 7;
type State = SVector<f64, N>;

/// Normal equations and cost at a state.
struct Sums {
    normal: SMatrix<f64, N, N>,
    gradient: State,
    cost: f64,
    n: usize,
}

/// Largest half side of a window, px.
const MOST: usize = 16;

fn sums<P: Pixel>(on: View<'_, P>, [left, top, right, bottom]: [usize; 4], p: &State) -> Sums {
    let (x0, y0, a, b, s) = (p[0], p[1], p[2], p[3], p[4]);
    let middle = [0.5 * (left + right) as f64, 0.5 * (top + bottom) as f64];
    let scale = -0.5 / (s * s);
    let mut gx = [0.0; 2 * MOST + 1];
    for (g, x) in gx.iter_mut().zip(left..=right) {
        *g = (scale * (x as f64 - x0).powi(2)).exp();
    }
    let mut m = [0.0f64; N * (N + 1) / 2];
    let mut v = [0.0f64; N];
    let (mut cost, mut n) = (0.0, 0);
    for y in top..=bottom {
        let dy = y as f64 - y0;
        let gy = (scale * dy * dy).exp();
        for ((&pixel, &gx), x) in on.row(y)[left..=right].iter().zip(&gx).zip(left..) {
            let dx = x as f64 - x0;
            let g = gx * gy;
            let ag = a * g / (s * s);
            let (sx, sy) = (x as f64 - middle[0], y as f64 - middle[1]);
            let j = [ag * dx, ag * dy, g, 1.0, ag * (dx * dx + dy * dy) / s, sx, sy];
            let r = pixel.value() - b - p[5] * sx - p[6] * sy - a * g;
            let mut at = 0;
            for i in 0..N {
                v[i] += j[i] * r;
                for k in i..N {
                    m[at] += j[i] * j[k];
                    at += 1;
                }
            }
            cost += r * r;
            n += 1;
        }
    }
    let mut normal = SMatrix::<f64, N, N>::zeros();
    let mut at = 0;
    for i in 0..N {
        for k in i..N {
            normal[(i, k)] = m[at];
            normal[(k, i)] = m[at];
            at += 1;
        }
    }
    Sums { normal, gradient: State::from(v), cost, n }
}

/// Fits a spot on a level near a guess; `least_variance` is that of a pixel at least, counts². `None` if what is there is no spot.
pub(super) fn fit<P: Pixel>(on: View<'_, P>, guess: &Guess, least_variance: f64) -> Option<Spot> {
    let half = ((WINDOW * guess.sigma).ceil() as usize).clamp(3, MOST);
    let (cx, cy) = (guess.x.round().max(0.0) as usize, guess.y.round().max(0.0) as usize);
    let window = [
        cx.saturating_sub(half),
        cy.saturating_sub(half),
        (cx + half).min(on.width - 1),
        (cy + half).min(on.height - 1),
    ];
    let mut p = State::from([guess.x, guess.y, guess.height, guess.ground, guess.sigma, 0.0, 0.0]);
    let mut now = sums(on, window, &p);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut normal = now.normal;
        for i in 0..N {
            normal[(i, i)] *= 1.0 + damping;
        }
        let step = normal.cholesky()?.solve(&now.gradient);
        let mut tried = p + step;
        tried[4] = tried[4].clamp(0.3, 3.0 * guess.sigma);
        let then = sums(on, window, &tried);
        if then.cost < now.cost {
            let small = step[0].abs() + step[1].abs() < 1e-3;
            (p, now, damping) = (tried, then, damping * 0.2);
            if small {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    let reach = 1.5 * guess.sigma + 0.7;
    let near = (p[0] - guess.x).abs() <= reach && (p[1] - guess.y).abs() <= reach;
    let sized = p[4] > 0.3001 && p[4] < 2.5 * guess.sigma;
    let beyond = |at: f64, n: usize| (-at).max(at - (n - 1) as f64);
    let is_seen = beyond(p[0], on.width).max(beyond(p[1], on.height)) <= (MOST_BEYOND * p[4]).min(MOST_BEYOND_PX);
    if !near || !is_seen || !sized || p[2] * guess.height <= 0.0 || now.n < 12 {
        return None;
    }
    let variance = (now.cost / (now.n - N) as f64).max(least_variance);
    let inverse = now.normal.cholesky()?.inverse();
    let cov = inverse.fixed_view::<2, 2>(0, 0) * variance;
    let cov = 0.5 * (cov + cov.transpose());
    // A height lost in the residuals, or a position unknown by more than the spot, is no spot.
    let known = cov.trace() < p[4] * p[4] && cov.iter().all(|c| c.is_finite()) && p[2].powi(2) > variance;
    known.then(|| Spot { position: Vector2::new(p[0], p[1]), cov, height: p[2], sigma: p[4] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    #[test]
    fn a_clean_spot_is_found_to_a_thousandth_of_a_pixel() {
        for (x0, y0, height, sigma) in [(10.3, 9.6, 40.0, 1.3), (9.8, 10.45, -25.0, 2.0), (1.2, 10.0, 30.0, 1.0)] {
            let value = |i: usize| {
                let (x, y) = ((i % 21) as f64, (i / 21) as f64);
                100.0 + height * (-((x - x0).powi(2) + (y - y0).powi(2)) / (2.0 * sigma * sigma)).exp()
            };
            let image = Image::from_vec(21, 21, (0..441).map(|i| value(i) as f32).collect()).unwrap();
            let guess = Guess { x: f64::round(x0), y: f64::round(y0), height: height * 0.6, ground: 98.0, sigma: 1.6 };
            let spot = fit(View::of(&image), &guess, 1e-6).unwrap();
            assert!((spot.position - Vector2::new(x0, y0)).norm() < 1e-3, "{spot:?}");
            assert!((spot.sigma - sigma).abs() < 1e-2 && (spot.height - height).abs() < 0.1);
        }
    }

    #[test]
    fn a_spot_on_a_slope_is_where_it_is() {
        let value = |i: usize| {
            let (x, y) = ((i % 21) as f64, (i / 21) as f64);
            let spot = 40.0 * (-((x - 10.3).powi(2) + (y - 9.6).powi(2)) / (2.0 * 1.5 * 1.5)).exp();
            100.0 + 4.0 * x - 2.5 * y + spot
        };
        let image = Image::from_vec(21, 21, (0..441).map(|i| value(i) as f32).collect()).unwrap();
        let guess = Guess { x: 11.0, y: 9.0, height: 25.0, ground: 115.0, sigma: 1.6 };
        let spot = fit(View::of(&image), &guess, 1e-6).unwrap();
        assert!((spot.position - Vector2::new(10.3, 9.6)).norm() < 1e-3, "{spot:?}");
    }

    #[test]
    fn an_even_ground_is_no_spot() {
        let image = Image::filled(21, 21, 7u8);
        assert_eq!(
            fit(View::of(&image), &Guess { x: 10.0, y: 10.0, height: 3.0, ground: 7.0, sigma: 1.5 }, 1.0 / 12.0),
            None
        );
    }
}
