//! Positions at the Cramér-Rao bound: spots fitted by maximum likelihood, with the covariance and the goodness of the fit.
//!
//! A window of a frame with the noise of its pixels (`stamp`, `noise`), the sums of one spot (`single`, from `profile`) or of several and moving ones
//! (`several`), the climb (`scoring`, `solve`), what is left (`goodness`); `refine` fits around the
//! detections of a frame. Figures: `docs/limit.md`.

mod config;
mod goodness;
mod noise;
mod pixel_terms;
mod profile;
mod refine;
mod scoring;
mod several;
mod single;
mod solve;
mod spot;
mod stamp;

pub use config::{FitConfig, FitWidth};
pub use goodness::Goodness;
pub use noise::SensorNoise;
pub(super) use refine::Fitter;
pub use several::MOST_SPOTS;
pub use spot::{FittedSpot, Spot, SpotFit, SpotModel, Unfit, Width, fit_spots};
pub use stamp::Stamp;
