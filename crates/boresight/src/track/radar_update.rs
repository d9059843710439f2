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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Detection;
    use boresight_filters::converted::Polar;

    /// One plot of a radar at (10, 20): 100 long with a deviation of 2, at `azimuth_rad` with one of 0.01; read with twice the variance and 3 px² more.
    fn plots(azimuth_rad: f64) -> Plots {
        let polar = Polar { range: 100.0, azimuth_rad, range_std: 2.0, azimuth_std_rad: 0.01 };
        let plot = RadarPlot { polar, sensor: Vector2::new(10.0, 20.0) };
        let d = Detection::at(Vector2::zeros(), Matrix2::identity()).with_plot(Some(plot));
        let mut plots = Plots::default();
        plots.read(&Scan::default().with_detections(vec![d]), RadarUpdate::Extended, 2.0, 3.0);
        plots
    }

    #[test]
    fn a_plot_of_a_sure_prediction_lies_along_and_across_its_line_of_sight() {
        // Predicted 96 to the right of the sensor: 4 more along, 96 · 0.02 across; variances 2 · 2² + 3 and 2 · (96 · 0.01)² + 3.
        let predicted = Gaussian { mean: Vector2::new(106.0, 20.0), cov: Matrix2::zeros() };
        let m = plots(0.02).measured(0, &predicted).unwrap();
        assert!((m.position - Vector2::new(110.0, 21.92)).norm() < 1e-12, "{}", m.position);
        assert!((m.cov - Matrix2::new(11.0, 0.0, 0.0, 4.8432)).norm() < 1e-12, "{}", m.cov);
        // Three deviations of the prediction away is too near; there are no plots but this one.
        let near = Gaussian { cov: Matrix2::identity() * (32.1 * 32.1), ..predicted };
        assert!(plots(0.02).measured(0, &near).is_none() && plots(0.02).measured(1, &predicted).is_none());
    }

    #[test]
    fn the_square_that_is_searched_is_the_sum_of_gate_second_order_and_shift() {
        // P of trace 6², farthest sensor 96 away: r = 2 · (2² + 0.96²) + 2 · 3 = 15.8432; second order moves by 6/3 at most; the conversion by 100 (e^(0.01²/2) − 1).
        let predicted = Gaussian { mean: Vector2::new(106.0, 20.0), cov: Matrix2::identity() * 18.0 };
        let rest = 2.0 + 0.005_000_125;
        for gate in [0.0, 9.21] {
            let want = (2.0 * gate * (1.12 * 36.0 + 15.8432_f64)).sqrt() + rest;
            assert!((plots(0.0).half_side(&predicted, gate) - want).abs() < 1e-8, "{gate}");
        }
    }
}
