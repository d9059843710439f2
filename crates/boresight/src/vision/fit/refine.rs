//! The detections of a frame, each fitted as a spot on the frame as it came; what cannot be, or not well, keeps its centroid.
//!
//! A window of three deviations to each side is cut around a detection, wider where others are near; up to three of these are fitted along. Where the width found does not suit the
//! window, it is fitted once more in one that does. A fit is poor if the noise hardly leaves such residuals ([`POOR_P`]) and they are more than
//! `max-misfit` of the spot's height, or if it went further from the centroid than a spot's width. Residuals that the noise hardly leaves, but that are small beside
//! the spot, widen the covariance by χ² a degree of freedom. The result does not depend on the order of the detections.

use super::config::{FitConfig, FitWidth};
use super::noise::SensorNoise;
use super::several::MOST_SPOTS;
use super::spot::{FittedSpot, Spot, SpotFit, SpotModel, Width, fit_spots};
use super::stamp::Stamp;
use crate::vision::config::NoiseConfig;
use crate::vision::noise_level::noise_level;
use crate::vision::pixel::Pixel;
use crate::{Detection, Image, PositionFit};
use nalgebra::{Matrix2, Vector2};

/// Half side of a window in deviations of the spot, and at least and most, px.
const WINDOW: f64 = 3.0;
const HALF: (f64, f64) = (4.0, 10.0);
/// How far outside the window a neighbour still widens it, px: its light reaches in.
const BESIDE: f64 = 2.0;
/// A chance of the residuals below which the noise does not explain them.
const POOR_P: f64 = 1e-3;
/// Area of a Gaussian down to half of its height, in units of its variance: 2 π ln 2.
const HALF_AREA: f64 = 4.355;
/// Variance that no position goes below, px²: a tenth of a thousandth of a pixel.
const LEAST_VARIANCE: f64 = 1e-8;

/// Fits spots around detections; keeps its memory between frames.
#[derive(Clone, Debug)]
pub(in crate::vision) struct Fitter {
    config: FitConfig,
    samples: Vec<f32>,
    /// Positions before the fit, from top to bottom, with the number of the detection.
    places: Vec<(Vector2<f64>, usize)>,
}

impl Fitter {
    /// Builds the fitter of a checked configuration.
    pub(in crate::vision) fn new(config: FitConfig) -> Self {
        Self { config, samples: Vec::new(), places: Vec::new() }
    }

    /// Replaces positions and covariances by those of fits where these are good.
    pub(in crate::vision) fn refine<T: Pixel>(
        &mut self,
        image: &Image<T>,
        noise: &NoiseConfig,
        detections: &mut [Detection],
    ) {
        if detections.is_empty() {
            return;
        }
        let rounding = f64::from(T::STEP).powi(2) / 12.0;
        let noise = match noise {
            NoiseConfig::Given(g) => SensorNoise {
                read_variance: g.read_counts * g.read_counts + rounding,
                gain: g.gain,
                offset: g.offset_counts,
            },
            NoiseConfig::Estimated => SensorNoise::constant(noise_level(image, &mut self.samples).powi(2)),
        };
        self.places.clear();
        self.places.extend(detections.iter().enumerate().map(|(i, d)| (d.position, i)));
        self.places.sort_unstable_by(|(a, i), (b, j)| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)).then(i.cmp(j)));
        for i in 0..detections.len() {
            let found = self.fit(image, &noise, &detections[i]);
            let d = &mut detections[i];
            d.fit = Some(match found {
                Some((spot, fit)) => {
                    d.position = spot.spot.position;
                    let is_explained = fit.goodness.p >= POOR_P;
                    let wider = if is_explained { 1.0 } else { fit.goodness.per_dof().max(1.0) };
                    d.cov = spot.cov * wider + Matrix2::identity() * LEAST_VARIANCE;
                    PositionFit::Spot { chi2_per_dof: fit.goodness.per_dof(), p: fit.goodness.p }
                }
                None => PositionFit::Centroid,
            });
        }
    }

    /// The fit of a detection, if it is good.
    fn fit<T: Pixel>(&self, image: &Image<T>, noise: &SensorNoise, d: &Detection) -> Option<(FittedSpot, SpotFit)> {
        let sigma = self.config.sigma_px.unwrap_or((f64::from(d.area_px) / HALF_AREA).sqrt().max(0.6));
        let mut half = (WINDOW * sigma).ceil().max(HALF.0);
        if half > HALF.1 {
            return None;
        }
        let (mut spot, mut fit) = self.fit_in(image, noise, d.position, sigma, half)?;
        let suits = (WINDOW * spot.spot.sigma.amax()).ceil().clamp(HALF.0, HALF.1);
        if (suits - half).abs() > 1.0 {
            half = suits;
            (spot, fit) = self.fit_in(image, noise, d.position, spot.spot.sigma.amax().min(HALF.1 / WINDOW), half)?;
        }
        let s = spot.spot;
        let height = s.flux.abs() / (std::f64::consts::TAU * s.sigma.x * s.sigma.y);
        let is_explained = fit.goodness.p >= POOR_P || fit.unexplained <= self.config.max_misfit * height;
        let is_near = (s.position - d.position).amax() <= 1.5 * sigma.max(s.sigma.amax()) + 0.7;
        (is_explained && is_near).then_some((spot, fit))
    }

    /// The fit in a window of this half side, with the neighbours inside it if there are any, else alone.
    fn fit_in<T: Pixel>(
        &self,
        image: &Image<T>,
        noise: &SensorNoise,
        at: Vector2<f64>,
        sigma: f64,
        half: f64,
    ) -> Option<(FittedSpot, SpotFit)> {
        let motion = Vector2::from(self.config.motion_px);
        let reach = (half + (0.5 * motion.amax()).ceil()).min(HALF.1);
        let near = self.neighbours(at, (reach + BESIDE).min(HALF.1 - 1.0));
        let farthest = near.iter().flatten().map(|p| (p - at).amax()).fold(0.0, f64::max);
        let stamp = Stamp::cut(image, at, reach.max(farthest.ceil() + 1.0) as usize, noise, None)?;
        let guess = |position: Vector2<f64>| Spot {
            motion,
            ..Spot::round(position, stamp.contrast_at(position).signum(), sigma)
        };
        let mut guesses = [guess(at); MOST_SPOTS];
        let mut n = 1;
        for p in near.into_iter().flatten().filter(|p| stamp.contrast_at(*p) != 0.0) {
            guesses[n] = guess(p);
            n += 1;
        }
        let model = |n: usize| SpotModel {
            width: match self.config.width {
                FitWidth::Known => Width::Known,
                FitWidth::Elliptic => Width::Elliptic,
                FitWidth::Round if n > 1 => Width::Alike,
                FitWidth::Round => Width::Round,
            },
            slope: self.config.slope,
        };
        let together = fit_spots(&stamp, &guesses[..n], model(n));
        let fit = if n > 1 { together.or_else(|_| fit_spots(&stamp, &guesses[..1], model(1))) } else { together };
        let fit = fit.ok()?;
        Some((*fit.spots().first()?, fit))
    }

    /// The positions within `reach` of a place along both axes but not at it, the nearest ones.
    fn neighbours(&self, at: Vector2<f64>, reach: f64) -> [Option<Vector2<f64>>; MOST_SPOTS - 1] {
        let mut nearest: [Option<(f64, Vector2<f64>)>; MOST_SPOTS - 1] = [None; MOST_SPOTS - 1];
        let from = self.places.partition_point(|(p, _)| p.y < at.y - reach);
        for (p, _) in self.places[from..].iter().take_while(|(p, _)| p.y <= at.y + reach) {
            let d = (p - at).norm();
            // What lies closer than a pixel is the same, found twice.
            if (p.x - at.x).abs() > reach || d < 1.0 {
                continue;
            }
            let mut new = Some((d, *p));
            for place in &mut nearest {
                if let Some((d, _)) = new
                    && place.is_none_or(|(e, _)| d < e)
                {
                    std::mem::swap(place, &mut new);
                }
            }
        }
        nearest.map(|n| n.map(|(_, p)| p))
    }
}
