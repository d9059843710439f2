//! What is mended of a sensor's frames.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is mended before anything is detected; `boresight sensor INPUT` says what is worth it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SensorConfig {
    /// Frames taken without light (a file, a folder, a pattern): their mean is taken off, their level stays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark: Option<String>,
    /// Frames of even light: unequal response is divided out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flat: Option<String>,
    /// Whether pixels unlike their neighbours are looked for, in the dark frames or else in the first 32, and filled from these. A point sharper than half a pixel
    /// that never moves is taken for one. Left out: where a configuration is chosen, in grey frames that are no coded video; where one is given, not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bad_pixels: Option<bool>,
    /// Whether fixed offsets of columns are looked for, in the dark frames or else in the first 32, and taken off. An upright edge longer than half the
    /// frame's height that never moves is taken for one. Left out: as bad pixels, where the scene moves over the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column_noise: Option<bool>,
    /// Whether what a camera or a recorder draws on the picture (a cross, a clock, text) is looked for in the first 400 frames, 48 where their number is not known, or as many as 128 MB hold, and filled from around:
    /// what stands still to a tenth of a pixel while the scene moves, and digits that change. Left out: where a configuration is chosen, in grey frames of 8 bits; where one is given, not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlay: Option<bool>,
}

impl SensorConfig {
    /// Whether anything is mended.
    pub fn is_active(&self) -> bool {
        self.dark.is_some() || self.flat.is_some() || self.fills() || self.levels_columns() || self.fills_overlay()
    }

    /// Whether offsets of columns are taken off.
    pub fn levels_columns(&self) -> bool {
        self.column_noise == Some(true)
    }

    /// Whether bad pixels are filled.
    pub fn fills(&self) -> bool {
        self.bad_pixels == Some(true)
    }

    /// Whether what is drawn on the picture is filled.
    pub fn fills_overlay(&self) -> bool {
        self.overlay == Some(true)
    }
}
