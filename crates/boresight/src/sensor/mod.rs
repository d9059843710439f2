//! The sensor behind the frames: its gain and noise from the frames themselves, and what is mended before anything is detected.
//!
//! `transfer` measures variance against mean (photon transfer), `defects` finds pixels and columns that are not like their neighbours, `overlay` what is drawn on the picture, `correction` mends frames,
//! `source` does it between the reader and the detector. Equations: `docs/theory/sensor.md`.

mod config;
mod correction;
mod defects;
mod grey;
mod line;
mod mean_map;
mod overlay;
mod source;
mod transfer;

pub use config::SensorConfig;
pub use correction::{Calibration, Correction};
pub use defects::{Defects, find_defects};
pub use line::Line;
pub use mean_map::MeanMap;
pub use source::MendedSource;
pub(crate) use source::{Found, if_defective};
pub use transfer::{Level, PhotonTransfer, TransferCurve};
