//! Camera motion: measured from pixels, added up over scans, and taken out of positions so that tracks live on steady ground.
//!
//! [`CameraMotionEstimator`] says in every frame how the background moved ([`crate::CameraMotion`]: shift, turn and zoom with their covariance,
//! measured or held), [`CameraPath`] keeps what the camera did since the first scan, and [`SteadyGround`] turns detections into the
//! coordinates of the first scan's background and tracks back into the image's.

mod apart;
mod course;
mod cover;
mod estimate;
mod find_patch;
mod fine;
mod fit;
mod follow_plane;
mod found;
mod key_frame;
mod light;
mod mixed;
mod motion;
mod other_view;
mod plane;
mod plane_cov;
mod reduce;
mod register;
mod rest;
mod scales;
mod searches;
mod steady;
mod wide;
mod wide_search;

pub use estimate::{CameraConfig, CameraMotionEstimator};
pub use follow_plane::PlaneFollower;
pub use motion::CameraPath;
pub(crate) use register::PlanePatches;
pub use register::Registration;
pub use steady::SteadyGround;
