//! How a radar's plots correct a track: as positions converted once, or by the extended update with range and azimuth as they were measured.
//!
//! Source: [`boresight_filters::linearised`] (Bar-Shalom, Li, Kirubarajan 2001, 10.3.2) and [`boresight_filters::converted`]. A converted plot's ellipse lies across the line
//! of sight that was measured; far away it is long, tilted by the azimuth's error, and what it says of the range depends on that error. Linearised at the prediction it lies
//! across the predicted one, and its range counts as it was measured.
//! Symbols: γ the gate's threshold on d² (no unit). Limits: within three deviations of the sensor a plot counts as converted; merged measurements and the way
//! back before a track's first detection take converted plots.

use crate::{RadarPlot, Scan};
use boresight_filters::linearised::linearised;
use boresight_filters::{Gaussian, Measurement};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How detections that know their range and azimuth correct a track.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RadarUpdate {
    /// As positions with their covariances, converted without bias when the table was read.
    #[default]
    Converted,
    /// By range and azimuth, linearised at each track's prediction (the extended update, second order).
    Extended,
}

/// The plots of a scan, where the extended update is asked for; empty otherwise.
#[derive(Clone, Debug, Default)]
pub(super) struct Plots {
    /// With the deviations that count.
    of: Vec<Option<RadarPlot>>,
    /// Variance added on both axes, px².
    extra: f64,
    /// The rectangle of the sensors' places, px.
    sensors: [Vector2<f64>; 2],
    /// Largest deviations of range (px) and azimuth (rad).
    std: [f64; 2],
    /// Farthest that a converted position lies from where range and azimuth say, px.
    shift: f64,
}

impl Plots {
    /// Takes a scan's plots if they are wanted; `scale` and `extra` (px²) are what the noise of every detection is multiplied by and what is added to it.
    pub fn read(&mut self, scan: &Scan, update: RadarUpdate, scale: f64, extra: f64) {
        self.of.clear();
        if update == RadarUpdate::Converted || scan.detections.iter().all(|d| d.plot.is_none()) {
            return;
        }
        let std_scale = scale.sqrt();
        self.of.extend(scan.detections.iter().map(|d| {
            let mut plot = *d.plot.as_deref()?;
            plot.polar.range_std *= std_scale;
            plot.polar.azimuth_std_rad *= std_scale;
            Some(plot)
        }));
        self.extra = extra;
        self.sensors = [Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY)];
        (self.std, self.shift) = ([0.0; 2], 0.0);
        for RadarPlot { polar: p, sensor } in self.of.iter().flatten() {
            self.sensors = [self.sensors[0].inf(sensor), self.sensors[1].sup(sensor)];
            self.std = [self.std[0].max(p.range_std), self.std[1].max(p.azimuth_std_rad)];
        }
        // Converted when the table was read, with the deviations that it states.
        for p in scan.detections.iter().filter_map(|d| d.plot.as_deref()).map(|plot| plot.polar) {
            self.shift = self.shift.max(p.range * (0.5 * p.azimuth_std_rad * p.azimuth_std_rad).exp_m1());
        }
    }

    /// Whether nothing is linearised.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }

    /// Plot `j` as a position for a track predicted there (px, px²); `None` if it has to count as it was converted.
    pub fn measured(&self, j: u32, predicted: &Gaussian<2>) -> Option<Measurement> {
        let RadarPlot { polar, sensor } = (*self.of.get(j as usize)?)?;
        let m = linearised(&polar, &sensor, predicted).ok()?;
        Some(Measurement { cov: m.cov + Matrix2::identity() * self.extra, ..m })
    }

    /// Half the side of a square around the prediction that holds the converted positions of all plots in the gate `gate` that are linearised, px.
    pub fn half_side(&self, predicted: &Gaussian<2>, gate: f64) -> f64 {
        let [low, high] = self.sensors;
        let far = (predicted.mean - low).abs().sup(&(predicted.mean - high).abs()).norm();
        let p = predicted.cov.trace();
        // Linearised from three deviations on: the second order adds at most (1/18 + 1/18) P, and moves by at most √P/6 along and across.
        let r = self.std[0].powi(2) + (far * self.std[1]).powi(2) + 2.0 * self.extra;
        // |z - x̂| is at most what lies between in range and along the arc, and √2 times their root of squares.
        (2.0 * gate * (1.12 * p + r)).sqrt() + p.sqrt() / 3.0 + self.shift
    }
}
