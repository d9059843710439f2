//! Whether the camera's motion is followed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether the camera's motion is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraConfig {
    /// The camera stands still, or its motion is none of the tracker's business.
    #[default]
    Fixed,
    /// The background's motion is measured in every frame and taken from every position before tracking.
    Moving,
    /// The camera stays in its place but shakes or nods: frames are brought to the first one's place before anything is detected in them, so that what is made for a camera at rest (`moving`) can be used.
    Shaking,
}
