//! A detection is a position with its covariance and what was seen there; a scan is all detections of one time.

use crate::{FrameIndex, Timestamp};
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

/// One detected thing in one frame.
#[derive(Clone, Debug, PartialEq)]
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
}

/// All detections of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// Number of the frame.
    pub index: FrameIndex,
    /// Time of the frame.
    pub time: Timestamp,
    /// The detections, in the detector's order.
    pub detections: Vec<Detection>,
    /// How far the background moved in the image since the scan before (camera motion), px; `None` if it was not looked at.
    pub camera_shift_px: Option<Vector2<f64>>,
}
