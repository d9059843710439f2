//! A scan made ready for the tracker: checked, the extra noise added, sorted into a grid; and the predicted tracks beside it.
//!
//! Method: the noise of each detection is kept as three numbers, or once for all if they are equal; a grid over the positions hands
//! out what lies in a rectangle.
//! Limits: [`MOST_LOOKED_AT`] detections are looked at for one track, so that 10⁵ detections in one pixel cost bounded time.

use super::radar_update::{Plots, RadarUpdate};
use super::score_likelihood::ScanScores;
use crate::associate::UniformGrid;
use crate::camera::CameraPath;
use crate::{Detection, Error, ErrorKind, Result, Scan};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Vector2};

/// Candidates looked at per track before the search stops.
pub const MOST_LOOKED_AT: usize = 4096;

/// A detection's covariance with the extra noise, three numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cov2 {
    /// Variance along x, px².
    pub xx: f64,
    /// Covariance, px².
    pub xy: f64,
    /// Variance along y, px².
    pub yy: f64,
}

impl Cov2 {
    /// The covariance as a matrix.
    #[inline]
    pub fn matrix(&self) -> Matrix2<f64> {
        Matrix2::new(self.xx, self.xy, self.xy, self.yy)
    }

    /// The numbers of a matrix.
    #[inline]
    pub fn of(m: &Matrix2<f64>) -> Self {
        Self { xx: m[(0, 0)], xy: m[(0, 1)], yy: m[(1, 1)] }
    }
}

/// A track's predicted position and covariance, and how far it can have come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// Position, px.
    pub x: f64,
    /// Position, px.
    pub y: f64,
    /// Covariance H P Hᵀ, px².
    pub cov: Cov2,
    /// Farthest distance from the prediction that the largest speed allows, px.
    pub reach: f64,
}

impl Predicted {
    /// What a filter predicts, and how far the target can have come, px.
    #[inline]
    pub fn of(p: &Gaussian<2>, reach: f64) -> Self {
        Self { x: p.mean.x, y: p.mean.y, cov: Cov2::of(&p.cov), reach }
    }

    fn belief(&self) -> Gaussian<2> {
        Gaussian { mean: Vector2::new(self.x, self.y), cov: self.cov.matrix() }
    }
}

/// A scan made ready for gating: checked, noise added, sorted into a grid.
#[derive(Clone, Debug, Default)]
pub struct ScanTable {
    /// Measurement noise of each detection; one for all if they are equal, so that hot loops need not fetch it.
    noise: Vec<Cov2>,
    /// Whether some detection was seen before the scan's time, and that counts.
    timed: bool,
    /// Whether some detection comes with its velocity.
    has_velocities: bool,
    /// Largest variances in the scan, px².
    max_xx: f64,
    max_yy: f64,
    /// Half of the widest and of the tallest box, px.
    pub largest_half_px: [f64; 2],
    /// What the camera did over all scans so far.
    pub camera: CameraPath,
    /// Scores, read by the tracker where they say something.
    pub(super) scores: ScanScores,
    plots: Plots,
    grid: UniformGrid,
}

impl ScanTable {
    /// Checks a scan and takes its noise; nothing else changes before the check is over.
    /// # Errors
    /// A detection with a position or covariance that is not finite, or a covariance that is not positive semi-definite.
    pub fn read(&mut self, scan: &Scan, scale: f64, extra_noise_px: f64, extra_per_height: f64) -> Result<()> {
        self.noise.clear();
        self.timed = scan.detections.iter().any(|d| d.age_ns > 0);
        self.has_velocities = scan.detections.iter().any(|d| d.velocity.is_some());
        (self.max_xx, self.max_yy) = (0.0, 0.0);
        self.largest_half_px = [0.0; 2];
        for (i, d) in scan.detections.iter().enumerate() {
            let extra = extra_noise_px * extra_noise_px + (extra_per_height * d.extent.height_px).powi(2);
            let n = Cov2 {
                xx: scale * d.cov[(0, 0)] + extra,
                xy: scale * 0.5 * (d.cov[(0, 1)] + d.cov[(1, 0)]),
                yy: scale * d.cov[(1, 1)] + extra,
            };
            let e = &d.extent;
            let sides = e.left_px + e.top_px + e.width_px + e.height_px;
            let finite = (d.position.x + d.position.y + n.xx + n.xy + n.yy + sides).is_finite();
            // Room for rounding: a covariance of rank one is a legal (if odd) measurement.
            let sound = d.cov[(0, 0)] >= 0.0 && d.cov[(1, 1)] >= 0.0 && n.xy * n.xy <= n.xx * n.yy * (1.0 + 1e-9);
            if !(finite && sound) {
                return Err(refused(scan, i, d, finite));
            }
            self.largest_half_px[0] = self.largest_half_px[0].max(0.5 * e.width_px);
            self.largest_half_px[1] = self.largest_half_px[1].max(0.5 * e.height_px);
            if self.noise.len() == 1 && self.noise[0] == n {
                continue;
            }
            self.max_xx = self.max_xx.max(n.xx);
            self.max_yy = self.max_yy.max(n.yy);
            if self.noise.len() == 1 && i > 1 {
                let same = self.noise[0];
                self.noise.resize(i, same);
            }
            self.noise.push(n);
        }
        self.camera.step(scan.camera_motion.as_ref());
        Ok(())
    }

    /// Takes range and azimuth of a radar's plots, if they are to correct the tracks themselves; `scale` and `extra_noise_px` as in [`ScanTable::read`].
    pub(super) fn read_plots(&mut self, scan: &Scan, update: RadarUpdate, scale: f64, extra_noise_px: f64) {
        self.plots.read(scan, update, scale, extra_noise_px * extra_noise_px);
    }

    /// Takes all detections as seen at the scan's time: what counts frames, not seconds, knows no other.
    pub fn forget_ages(&mut self) {
        self.timed = false;
    }

    /// Whether some detection comes with its velocity, and that says whose it is: at the scan's time.
    #[inline]
    pub fn has_velocities(&self) -> bool {
        self.has_velocities && !self.timed
    }

    /// Whether detections have times of their own.
    #[inline]
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// Measurement noise of a detection.
    #[inline]
    pub fn noise(&self, detection: u32) -> Cov2 {
        let at = if self.noise.len() == 1 { 0 } else { detection as usize };
        self.noise[at]
    }

    /// Where a detection at `position` counts for a track predicted there (px), and with which noise: as it stands, or a radar's plot linearised at the prediction.
    #[inline]
    pub fn measured(&self, detection: u32, position: Vector2<f64>, at: &Predicted) -> (Vector2<f64>, Cov2) {
        if !self.plots.is_empty()
            && let Some(m) = self.plots.measured(detection, &at.belief())
        {
            return (m.position, Cov2::of(&m.cov));
        }
        (position, self.noise(detection))
    }

    /// Sorts the scan's detections into the grid.
    pub fn sort(&mut self, scan: &Scan) {
        self.grid.build(scan.detections.iter().map(|d| (d.position.x, d.position.y)));
    }

    /// The grid over the detections.
    pub fn grid(&self) -> &UniformGrid {
        &self.grid
    }

    /// Half the sides of the rectangle that holds a track's gate, px.
    #[inline]
    pub(super) fn half_sides(&self, track: &Predicted, gate: f64) -> (f64, f64) {
        let half = |own: f64, largest: f64| (gate * (own + largest)).sqrt().min(track.reach);
        let halves = (half(track.cov.xx, self.max_xx), half(track.cov.yy, self.max_yy));
        if self.plots.is_empty() {
            return halves;
        }
        let linearised = self.plots.half_side(&track.belief(), gate);
        (halves.0.max(linearised), halves.1.max(linearised))
    }

    /// Fetches ahead what gating a batch of tracks will read.
    #[inline]
    pub fn touch(&self, batch: &[Predicted], gate: f64) {
        let mut sum = 0u32;
        for track in batch {
            let (half_x, half_y) = self.half_sides(track, gate);
            sum = sum.wrapping_add(self.grid.touch(track.x, track.y, half_x, half_y));
        }
        std::hint::black_box(sum);
    }
}

fn refused(scan: &Scan, i: usize, d: &Detection, finite: bool) -> Error {
    let what = if finite {
        format!("covariance {:?} is not positive semi-definite", d.cov.as_slice())
    } else {
        format!("position {:?}, covariance {:?} or box is not finite", d.position.as_slice(), d.cov.as_slice())
    };
    Error::new(ErrorKind::Damaged, what)
        .at(format!("frame {}, detection {i}", scan.index.0))
        .hint("drop such detections before tracking, or mend the detector that makes them")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RadarPlot;
    use boresight_filters::converted::Polar;

    #[test]
    fn a_plot_and_its_converted_position_get_the_square_of_the_extra_noise() {
        // 100 px to the right of the sensor, surely predicted there: variances 2² and (100 · 0.01)², and 3² more.
        let polar = Polar { range: 100.0, azimuth_rad: 0.0, range_std: 2.0, azimuth_std_rad: 0.01 };
        let plot = RadarPlot { polar, sensor: Vector2::zeros() };
        let d = Detection::at(Vector2::new(100.0, 0.0), Matrix2::new(4.0, 0.0, 0.0, 1.0)).with_plot(Some(plot));
        let (scan, mut table) = (Scan::default().with_detections(vec![d]), ScanTable::default());
        let at = Predicted { x: 100.0, y: 0.0, cov: Cov2::default(), reach: f64::INFINITY };
        for update in [RadarUpdate::Converted, RadarUpdate::Extended] {
            table.read(&scan, 1.0, 3.0, 0.0).unwrap();
            table.read_plots(&scan, update, 1.0, 3.0);
            let (position, r) = table.measured(0, scan.detections[0].position, &at);
            assert!((position - Vector2::new(100.0, 0.0)).norm() < 1e-12, "{update:?}: {position}");
            assert!((r.matrix() - Matrix2::new(13.0, 0.0, 0.0, 10.0)).norm() < 1e-12, "{update:?}: {r:?}");
        }
    }
}
