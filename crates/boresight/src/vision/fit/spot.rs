//! Maximum-likelihood fit of spots: position, flux and width with the covariance of the Cramér-Rao bound, and how well the model explains the pixels.
//!
//! Model: m(x, y) = ground (offset, and slope if asked for) + Σ over spots of flux x pixel-integrated Gaussian; the noise is Poisson light plus read noise
//! (`pixel_terms`), least squares where it is the same for all pixels. Sources: K. I. Mortensen et al., Nat. Methods 7, 377 (2010); Smith et al. (2010) and
//! Huang et al. (2013) as named in `profile` and `pixel_terms`; equations: `docs/theory/spot-fit.md`.
//! Differs from them: a slope of the ground, joint fits, damped scoring until nothing is to be gained instead of a fixed number of steps.
//! Stated covariance: the inverse of the Fisher information at the fit, of all free parameters together, times 1 + c C / s², C the bound and s the spot's
//! deviation: errors of the next order, a tenth of the variance where the peak is 5 deviations of the noise, none of it where it is 50.
//! Limits: upright ellipses only; windows of at most 21 x 21 px; up to 4 spots; deviations of 0.3 to 8 px. Cost: about 6 µs for one spot on 9 x 9 px.

use super::goodness::Goodness;
use super::noise::SensorNoise;
use super::scoring::{Freedom, Model, Top, climb};
use super::several::{self, MOST_SPOTS, Several};
use super::single::{self, Single};
use super::solve::{Factor, HELD, Sums};
use super::stamp::Stamp;
use nalgebra::{Matrix2, Vector2};

/// Least and largest deviation of a spot, px.
const SIGMA: (f64, f64) = (0.3, 8.0);
/// What the next order adds to the mean of e² / stated variance, in units of the bound over the spot's variance: a known width, a fitted one. By simulation
/// (`cargo xtask limit positions`), for noise that is the same for all pixels and for light.
const SECOND_ORDER: [(f64, f64); 2] = [(3.0, 6.0), (1.5, 4.5)];

/// A spot of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Centre in the frame (of its path over the exposure, if it moves), px.
    pub position: Vector2<f64>,
    /// Sum over all its pixels, counts; negative for a dark spot.
    pub flux: f64,
    /// Deviations along x and y, px.
    pub sigma: Vector2<f64>,
    /// Way over the exposure, px; known, not fitted.
    pub motion: Vector2<f64>,
}

impl Spot {
    /// A round spot at rest.
    pub fn round(position: Vector2<f64>, flux: f64, sigma: f64) -> Self {
        Self { position, flux, sigma: Vector2::new(sigma, sigma), motion: Vector2::zeros() }
    }
}

/// What is known of a spot's width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// It is that of the guess.
    Known,
    /// The same along x and y.
    #[default]
    Round,
    /// One for all spots of the window: those of one optics.
    Alike,
    /// One along x and one along y.
    Elliptic,
}

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpotModel {
    /// The spots' widths.
    pub width: Width,
    /// Whether the ground may be inclined.
    pub slope: bool,
}

impl Default for SpotModel {
    fn default() -> Self {
        Self { width: Width::Round, slope: true }
    }
}

/// A fitted spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedSpot {
    /// The spot.
    pub spot: Spot,
    /// Covariance of its position, px²: the bound and what the next order adds.
    pub cov: Matrix2<f64>,
    /// The Cramér-Rao bound of the position at the fit, px².
    pub bound: Matrix2<f64>,
    /// Variance of its flux, counts².
    pub flux_variance: f64,
    /// Variance of the deviations along x and y, px²; 0 where they are known.
    pub sigma_variance: Vector2<f64>,
}

/// A fit of one or more spots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotFit {
    spots: [FittedSpot; MOST_SPOTS],
    n_spots: usize,
    /// Ground at the middle of the window, counts.
    pub ground: f64,
    /// Its slope, counts/px.
    pub slope: Vector2<f64>,
    /// How well the model explains the pixels.
    pub goodness: Goodness,
    /// Residual deviation that the noise does not explain, counts.
    pub unexplained: f64,
}

impl SpotFit {
    /// The spots in the order of their guesses.
    pub fn spots(&self) -> &[FittedSpot] {
        &self.spots[..self.n_spots]
    }
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// Fewer pixels count than 3 more than there are parameters, or the guess is no spot.
    TooLittle,
    /// The pixels do not tell the parameters apart, or the climb did not end.
    Unsettled,
    /// A spot left the window, changed its sign, became narrower or wider than a spot may be, or its place is known no better than to its width.
    NoSpot,
}

/// Fits `guesses` (1 to 4 spots on one ground) to the pixels of a window.
///
/// Guesses should be within about a deviation of the truth, widths within a factor 2; ground and fluxes need no guess but the sign of the flux.
/// # Errors
/// Why there is no fit.
///
/// ```
/// use boresight::vision::fit::{SensorNoise, Spot, SpotModel, Stamp, fit_spots};
/// use boresight::{Image, boresight_filters::nalgebra::Vector2};
///
/// let mut frame = Image::filled(20, 20, 10.0f32);
/// frame.row_mut(9)[8..11].copy_from_slice(&[30.0, 50.0, 30.0]);
/// frame.row_mut(8)[9] = 30.0;
/// frame.row_mut(10)[9] = 30.0;
/// let noise = SensorNoise::constant(4.0);
/// let stamp = Stamp::cut(&frame, Vector2::new(9.0, 9.0), 4, &noise, None).unwrap();
/// let guess = Spot::round(Vector2::new(8.7, 9.2), 100.0, 1.0);
/// let fit = fit_spots(&stamp, &[guess], SpotModel::default()).unwrap();
/// assert!((fit.spots()[0].spot.position - Vector2::new(9.0, 9.0)).norm() < 1e-3);
/// ```
pub fn fit_spots(stamp: &Stamp, guesses: &[Spot], model: SpotModel) -> Result<SpotFit, Unfit> {
    match guesses {
        [only] if only.motion == Vector2::zeros() => {
            let to = freedom::<{ single::PARAMETERS }>(1, guesses, model, stamp)?;
            fit(stamp, &Single::new(stamp), guesses, to)
        }
        [_, ..] if guesses.len() <= MOST_SPOTS => {
            let freedom = freedom::<{ several::PARAMETERS }>(guesses.len(), guesses, model, stamp)?;
            let mut motion = [Vector2::zeros(); MOST_SPOTS];
            motion.iter_mut().zip(guesses).for_each(|(m, g)| *m = g.motion);
            fit(stamp, &Several::new(stamp, guesses.len(), motion, freedom.to), guesses, freedom)
        }
        _ => Err(Unfit::TooLittle),
    }
}

/// The map of the free parameters, and how far each may go in a step.
fn freedom<const P: usize>(n: usize, guesses: &[Spot], model: SpotModel, stamp: &Stamp) -> Result<Freedom<P>, Unfit> {
    let mut f = Freedom { to: [HELD; P], n: 0, longest: [f64::INFINITY; P] };
    let next = |f: &mut Freedom<P>, i: usize| {
        f.to[i] = f.n;
        f.n += 1;
    };
    next(&mut f, 0);
    if model.slope {
        next(&mut f, 1);
        next(&mut f, 2);
    }
    for (k, g) in guesses.iter().enumerate().take(n) {
        let possible = |s: f64| s >= SIGMA.0 && s <= SIGMA.1;
        let is_spot = possible(g.sigma.x) && possible(g.sigma.y) && g.flux != 0.0 && g.flux.is_finite();
        if !(is_spot && g.position.iter().all(|v| v.is_finite()) && g.motion.norm() < 1e3) {
            return Err(Unfit::TooLittle);
        }
        let first = 3 + 5 * k;
        (0..3).for_each(|i| next(&mut f, first + i));
        f.longest[first..first + 2].fill(g.sigma.min().max(0.5));
        f.longest[first + 3..first + 5].fill(0.4);
        match model.width {
            Width::Known => {}
            Width::Round => {
                next(&mut f, first + 3);
                f.to[first + 4] = f.to[first + 3];
            }
            Width::Alike => {
                if k == 0 {
                    next(&mut f, first + 3);
                }
                f.to[first + 3] = f.to[6];
                f.to[first + 4] = f.to[6];
            }
            Width::Elliptic => (3..5).for_each(|i| next(&mut f, first + i)),
        }
    }
    if stamp.n_seen() < f.n + 3 { Err(Unfit::TooLittle) } else { Ok(f) }
}

fn fit<const P: usize>(
    stamp: &Stamp,
    model: &impl Model<P>,
    guesses: &[Spot],
    freedom: Freedom<P>,
) -> Result<SpotFit, Unfit> {
    let mut p = [0.0; P];
    p[0] = stamp.border_mean();
    let n_px = (stamp.width * stamp.height) as f64;
    let above: f64 =
        stamp.value[..stamp.width * stamp.height].iter().zip(&stamp.seen).map(|(v, s)| s * (v - p[0])).sum();
    for (k, g) in guesses.iter().enumerate() {
        let q = &mut p[3 + 5 * k..8 + 5 * k];
        let guessed = if above * g.flux > 0.0 { above / guesses.len() as f64 } else { g.flux };
        // A flux of nothing would say nothing about its place.
        let flux = guessed.abs().max(1e-6 * n_px).copysign(g.flux);
        let at = g.position - Vector2::new(stamp.left, stamp.top);
        q.copy_from_slice(&[at.x, at.y, flux, g.sigma.x.ln(), g.sigma.y.ln()]);
    }
    if guesses.len() > 1 {
        p = linear_start(model, p, &freedom, guesses);
    }
    let top = climb(model, p, &freedom).ok_or(Unfit::Unsettled)?;
    read(stamp, guesses, &freedom, &top)
}

/// The ground and the fluxes that suit best at the guessed places and widths: one step, since the model is linear in them.
fn linear_start<const P: usize>(
    model: &impl Model<P>,
    p: [f64; P],
    freedom: &Freedom<P>,
    guesses: &[Spot],
) -> [f64; P] {
    let mut linear = Freedom { to: [HELD; P], n: 0, longest: freedom.longest };
    let is_linear = |i: usize| i < 3 || (i - 3) % 5 == 2;
    for i in (0..P).filter(|&i| is_linear(i) && freedom.to[i] != HELD) {
        linear.to[i] = linear.n;
        linear.n += 1;
    }
    let sums: Sums<P> = model.sums(&p).free(&linear.to, linear.n);
    let Some(factor) = Factor::of(&sums, 1e-9) else { return p };
    let step = factor.solve(&sums.vector);
    let mut next = p;
    for i in (0..P).filter(|&i| linear.to[i] != HELD) {
        next[i] += step[linear.to[i]];
    }
    let keeps_signs = guesses.iter().enumerate().all(|(k, g)| next[5 + 5 * k] * g.flux > 0.0);
    if keeps_signs && next.iter().all(|v| v.is_finite()) { next } else { p }
}

/// Reads the spots off the top, or says why they are none.
fn read<const P: usize>(stamp: &Stamp, guesses: &[Spot], freedom: &Freedom<P>, top: &Top<P>) -> Result<SpotFit, Unfit> {
    let factor = Factor::of(&top.sums, 0.0).ok_or(Unfit::Unsettled)?;
    let nothing = FittedSpot {
        spot: Spot::round(Vector2::zeros(), 0.0, 1.0),
        cov: Matrix2::zeros(),
        bound: Matrix2::zeros(),
        flux_variance: 0.0,
        sigma_variance: Vector2::zeros(),
    };
    let mut spots = [nothing; MOST_SPOTS];
    let (known, fitted) = SECOND_ORDER[usize::from(stamp.gain > 0.0)];
    let second_order = if freedom.to[6] == HELD { known } else { fitted };
    let corner = Vector2::new(stamp.left, stamp.top);
    for (k, (out, guess)) in spots.iter_mut().zip(guesses).enumerate() {
        let (first, p) = (3 + 5 * k, &top.p[3 + 5 * k..8 + 5 * k]);
        let (sigma, at) = (Vector2::new(p[3].exp(), p[4].exp()), Vector2::new(p[0], p[1]));
        let wide = |s: f64| s >= SIGMA.0 && s <= SIGMA.1;
        let inside = |v: f64, n: usize| v > -0.5 && v < n as f64 - 0.5;
        let is_spot = wide(sigma.x) && wide(sigma.y) && p[2] * guess.flux > 0.0;
        if !(is_spot && inside(at.x, stamp.width) && inside(at.y, stamp.height)) {
            return Err(Unfit::NoSpot);
        }
        let [x, y, f] = [0, 1, 2].map(|i| freedom.to[first + i]);
        let (of_x, of_y) = (factor.inverse_column(x), factor.inverse_column(y));
        let cross = 0.5 * (of_x[y] + of_y[x]);
        let bound = Matrix2::new(of_x[x], cross, cross, of_y[y]);
        let relative = 0.5 * (bound[(0, 0)] / (sigma.x * sigma.x) + bound[(1, 1)] / (sigma.y * sigma.y));
        let width_variance = |i: usize| match freedom.to[first + i] {
            HELD => 0.0,
            to => factor.inverse_column(to)[to] * p[i].exp().powi(2),
        };
        *out = FittedSpot {
            spot: Spot { position: at + corner, flux: p[2], sigma, motion: guess.motion },
            cov: bound * (1.0 + second_order * relative),
            bound,
            flux_variance: factor.inverse_column(f)[f],
            sigma_variance: Vector2::new(width_variance(3), width_variance(4)),
        };
        if !out.cov.iter().all(|c| c.is_finite()) {
            return Err(Unfit::Unsettled);
        }
        if out.cov[(0, 0)] > sigma.x * sigma.x || out.cov[(1, 1)] > sigma.y * sigma.y {
            return Err(Unfit::NoSpot);
        }
    }
    let per_px = |n: usize| 2.0 / (n.max(2) - 1) as f64;
    let n_seen = stamp.n_seen() as f64;
    let dof = n_seen - freedom.n as f64;
    let (mean_variance, kurtosis) = light(stamp, top.p[0]);
    let goodness = Goodness::of(top.sums.chi2, dof, kurtosis * n_seen);
    Ok(SpotFit {
        spots,
        n_spots: guesses.len(),
        ground: top.p[0],
        slope: Vector2::new(top.p[1] * per_px(stamp.width), top.p[2] * per_px(stamp.height)),
        goodness,
        unexplained: ((goodness.per_dof() - 1.0).max(0.0) * mean_variance).sqrt(),
    })
}

/// The mean variance of a pixel, counts², and what its light's kurtosis adds to the variance of X² a pixel, from the values themselves.
fn light(stamp: &Stamp, ground: f64) -> (f64, f64) {
    let (mut sum, mut kurtosis, mut n) = (0.0, 0.0, 0.0);
    for i in 0..stamp.width * stamp.height {
        // The mean of a dark pixel is better known from the ground than from itself.
        let mean = 0.5 * (stamp.value[i] + ground);
        let variance = SensorNoise::variance(stamp.gain, stamp.offset, stamp.read[i], mean);
        sum += stamp.seen[i] * variance;
        kurtosis += stamp.seen[i] * stamp.gain.powi(3) * (mean - stamp.offset).max(0.0) / (variance * variance);
        n += stamp.seen[i];
    }
    (sum / f64::max(n, 1.0), kurtosis / f64::max(n, 1.0))
}

#[cfg(test)]
mod tests;
