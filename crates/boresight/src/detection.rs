//! A detection is a position with its covariance and what was seen there; a scan is all detections of one time.

use crate::{CameraMotion, FrameIndex, Homography, Timestamp};
use boresight_filters::converted::Polar;
use nalgebra::{Matrix2, Vector2};

/// Class of a detection, a number given by the detector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassId(pub u32);

/// A bounding box in pixel-edge coordinates: a single pixel (x, y) is `left = x - 0.5, width = 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// Left edge, px.
    pub left_px: f64,
    /// Top edge, px.
    pub top_px: f64,
    /// Width, px.
    pub width_px: f64,
    /// Height, px.
    pub height_px: f64,
}

impl Extent {
    /// A box of this size (px) around a position.
    pub fn around(centre: Vector2<f64>, width_px: f64, height_px: f64) -> Self {
        Self { left_px: centre.x - 0.5 * width_px, top_px: centre.y - 0.5 * height_px, width_px, height_px }
    }

    /// The box around the place of its middle, zoomed, its sides along the axes.
    pub(crate) fn moved(self, by: &Homography) -> Self {
        let middle = Vector2::new(self.left_px + 0.5 * self.width_px, self.top_px + 0.5 * self.height_px);
        let zoom = by.zoom_at(middle);
        Self::around(by.apply(middle), zoom * self.width_px, zoom * self.height_px)
    }
}

/// The velocity that came with a detection's position, from one fit of both over several frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedVelocity {
    /// Velocity (x, y), px/s.
    pub mean: Vector2<f64>,
    /// Its covariance, px²/s².
    pub cov: Matrix2<f64>,
    /// Covariance of position (row) with velocity (column), px²/s.
    pub with_position: Matrix2<f64>,
}

/// What a radar measured of a detection: range and azimuth, and where from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarPlot {
    /// Range and azimuth (from +x towards +y) with their deviations.
    pub polar: Polar,
    /// Where the radar stood at that time, px or m.
    pub sensor: Vector2<f64>,
}

/// How a position came about where a fit was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PositionFit {
    /// By a fitted spot.
    Spot {
        /// Squared residuals over their variances, for each degree of freedom: 1 where the noise explains them.
        chi2_per_dof: f64,
        /// Chance that the stated noise leaves as much or more, 0..=1.
        p: f64,
    },
    /// By the centroid, since the fit was poor or there was none.
    Centroid,
}

/// One detected thing in one frame; [`Detection::at`] makes one.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Detection {
    /// Centroid (x, y), px; the centre of the top-left pixel is (0, 0).
    pub position: Vector2<f64>,
    /// Covariance of the centroid, px².
    pub cov: Matrix2<f64>,
    /// Bounding box.
    pub extent: Extent,
    /// Number of pixels.
    pub area_px: u32,
    /// Strongest pixel value (for dark targets: the smallest), counts.
    pub peak: f32,
    /// Sum of the pixel weights, counts.
    pub sum: f64,
    /// Confidence; larger is surer; its scale is the detector's own.
    pub score: f32,
    /// Class, if the detector tells classes apart.
    pub class: Option<ClassId>,
    /// Velocity, if the detector looks at more than one frame; a track starts with it, and takes only positions afterwards.
    pub velocity: Option<DetectedVelocity>,
    /// How the position came about, if a fit was asked for (`detector.centroid.fit`).
    pub fit: Option<PositionFit>,
    /// How long before the scan's time it was seen, ns: of a radar whose antenna turns, each plot has its own. 0 where all of a frame is seen at once.
    pub age_ns: u64,
    /// Range and azimuth, of a radar's plot: `position` and `cov` are their conversion.
    pub plot: Option<Box<RadarPlot>>,
}

impl Detection {
    /// A point at `position` (px) with its covariance (px²): no size, one pixel, peak, sum and score 1, no class, no velocity.
    ///
    /// ```
    /// use boresight::boresight_filters::nalgebra::{Matrix2, Vector2};
    /// use boresight::{Detection, Extent};
    ///
    /// assert_eq!(Detection::point(20.5, 7.25, 0.2), Detection::at(Vector2::new(20.5, 7.25), Matrix2::identity() * (0.2 * 0.2)));
    /// let position = Vector2::new(20.5, 7.25);
    /// let d = Detection::at(position, Matrix2::identity() * 0.04).with_extent(Extent::around(position, 5.0, 3.0)).with_score(0.9);
    /// assert_eq!((d.extent.left_px, d.area_px), (18.0, 1));
    /// ```
    pub fn at(position: Vector2<f64>, cov: Matrix2<f64>) -> Self {
        let extent = Extent::around(position, 0.0, 0.0);
        Self {
            position,
            cov,
            extent,
            area_px: 1,
            peak: 1.0,
            sum: 1.0,
            score: 1.0,
            class: None,
            velocity: None,
            fit: None,
            age_ns: 0,
            plot: None,
        }
    }

    /// A point at (x, y), px, known to `std_px` along both axes; else as [`Detection::at`].
    pub fn point(x_px: f64, y_px: f64, std_px: f64) -> Self {
        Self::at(Vector2::new(x_px, y_px), Matrix2::identity() * (std_px * std_px))
    }

    /// Moves it with its covariance, box and velocity.
    pub(crate) fn move_by(&mut self, by: &Homography) {
        if let Some(v) = &mut self.velocity {
            let a = by.linear_at(self.position);
            v.mean = by.turn_at(self.position, v.mean);
            v.cov = by.turn_cov_at(self.position, &v.cov);
            v.with_position = a * v.with_position * a.transpose();
        }
        self.cov = by.turn_cov_at(self.position, &self.cov);
        self.extent = self.extent.moved(by);
        self.position = by.apply(self.position);
    }

    /// With this bounding box.
    pub fn with_extent(self, extent: Extent) -> Self {
        Self { extent, ..self }
    }

    /// With this number of pixels.
    pub fn with_area_px(self, area_px: u32) -> Self {
        Self { area_px, ..self }
    }

    /// With this strongest pixel value, counts.
    pub fn with_peak(self, peak: f32) -> Self {
        Self { peak, ..self }
    }

    /// With this sum of the pixel weights, counts.
    pub fn with_sum(self, sum: f64) -> Self {
        Self { sum, ..self }
    }

    /// With this confidence.
    pub fn with_score(self, score: f32) -> Self {
        Self { score, ..self }
    }

    /// With this class, or none.
    pub fn with_class(self, class: Option<ClassId>) -> Self {
        Self { class, ..self }
    }

    /// With this velocity, or none.
    pub fn with_velocity(self, velocity: Option<DetectedVelocity>) -> Self {
        Self { velocity, ..self }
    }

    /// As seen so long before the scan's time, ns.
    pub fn with_age_ns(self, age_ns: u64) -> Self {
        Self { age_ns, ..self }
    }

    /// As this plot of a radar, or none.
    pub fn with_plot(self, plot: Option<RadarPlot>) -> Self {
        Self { plot: plot.map(Box::new), ..self }
    }
}

/// All detections of one frame; [`Scan::at`] makes one.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Scan {
    /// Number of the frame.
    pub index: FrameIndex,
    /// Time of the frame.
    pub time: Timestamp,
    /// The detections, in the detector's order.
    pub detections: Vec<Detection>,
    /// How the background moved in the image since the scan before; `None` if it is unknown or was not looked at.
    pub camera_motion: Option<CameraMotion>,
    /// Whether nothing could be detected in this frame, whatever it shows: the detector gathers frames and reports later. That no
    /// target is detected then says nothing.
    pub blind: bool,
}

impl Scan {
    /// A scan without detections.
    pub fn at(index: FrameIndex, time: Timestamp) -> Self {
        Self { index, time, detections: Vec::new(), camera_motion: None, blind: false }
    }

    /// With these detections.
    pub fn with_detections(self, detections: Vec<Detection>) -> Self {
        Self { detections, ..self }
    }

    /// With how the background moved since the scan before.
    pub fn with_camera_motion(self, camera_motion: Option<CameraMotion>) -> Self {
        Self { camera_motion, ..self }
    }

    /// Whether another view begins with it: of what was known before nothing holds any more.
    pub fn is_cut(&self) -> bool {
        self.camera_motion.is_some_and(|m| m.is_cut())
    }

    /// As one in which nothing could be detected, or not.
    pub fn with_blind(self, blind: bool) -> Self {
        Self { blind, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Similarity;

    #[test]
    fn what_is_moved_by_a_quarter_turn_and_doubled_is_turned_and_doubled_in_all_its_parts() {
        let velocity = DetectedVelocity {
            mean: Vector2::new(3.0, 1.0),
            cov: Matrix2::new(4.0, 1.0, 1.0, 2.0),
            with_position: Matrix2::new(0.1, 0.2, 0.3, 0.4),
        };
        let at = Vector2::new(10.0, 20.0);
        let mut d = Detection::at(at, Matrix2::new(1.0, 0.0, 0.0, 9.0))
            .with_extent(Extent::around(at, 4.0, 4.0))
            .with_velocity(Some(velocity));
        // (x, y) -> 2 (-y, x) about (10, 20), and 5 px on: by hand.
        let by = Similarity::about(at, Vector2::new(5.0, 0.0), std::f64::consts::FRAC_PI_2, 2.0);
        d.move_by(&Homography::of_similarity(&by));
        let v = d.velocity.unwrap();
        let near = |a: Matrix2<f64>, b: Matrix2<f64>| (a - b).norm() < 1e-9;
        assert!(
            (d.position - Vector2::new(15.0, 20.0)).norm() < 1e-9 && (v.mean - Vector2::new(-2.0, 6.0)).norm() < 1e-9
        );
        assert!(near(d.cov, Matrix2::new(36.0, 0.0, 0.0, 4.0)));
        assert!(near(v.cov, Matrix2::new(8.0, -4.0, -4.0, 16.0)));
        assert!(near(v.with_position, Matrix2::new(1.6, -1.2, -0.8, 0.4)), "{}", v.with_position);
        assert!((d.extent.left_px - 11.0).abs() < 1e-9 && (d.extent.width_px - 8.0).abs() < 1e-9);
    }
}
