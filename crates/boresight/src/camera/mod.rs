//! Camera motion: measured from pixels, added up over scans, and taken out of positions so that tracks live on steady ground.
//!
//! [`CameraMotionEstimator`] says in every frame how far the background moved ([`crate::Scan::camera_shift_px`]), [`CameraPath`] keeps what
//! the camera did since the first scan, and [`SteadyGround`] turns detections into the coordinates of the first scan's background
//! and tracks back into the image's. A translation is all that is known of the motion.

mod estimate;
mod motion;
mod steady;

pub use estimate::{CameraConfig, CameraMotionEstimator};
pub use motion::CameraPath;
pub use steady::SteadyGround;
