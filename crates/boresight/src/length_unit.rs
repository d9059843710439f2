//! The unit of length of a table: pixels of a picture, or metres of a map.

/// What positions and sizes are counted in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub enum LengthUnit {
    /// Pixels; x to the right, y down.
    #[default]
    #[serde(rename = "px")]
    Pixel,
    /// Metres; x to the east, y to the north.
    #[serde(rename = "m")]
    Metre,
}

impl LengthUnit {
    /// Its sign: `px`, `m`.
    pub fn sign(self) -> &'static str {
        match self {
            Self::Pixel => "px",
            Self::Metre => "m",
        }
    }

    /// A unit that is written for pixels, in this one: `px/s` becomes `m/s`.
    pub fn of_pixels(self, unit: &'static str) -> &'static str {
        match (self, unit) {
            (Self::Metre, "px") => "m",
            (Self::Metre, "px^p") => "m^p",
            (Self::Metre, "px/s") => "m/s",
            (_, unit) => unit,
        }
    }

    /// Names of columns as they are written for pixels, in this unit: `vx_px_per_s` becomes `vx_m_per_s`.
    pub(crate) fn columns(self, names: &str) -> String {
        let mut out = String::new();
        self.push_columns(&mut out, names);
        out
    }

    /// Appends them.
    pub(crate) fn push_columns(self, out: &mut String, names: &str) {
        for (i, part) in names.split("_px").enumerate() {
            if i > 0 {
                out.push('_');
                out.push_str(self.sign());
            }
            out.push_str(part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_in_metres_name_metres() {
        assert_eq!(LengthUnit::Metre.columns("x_px,vx_px_per_s,var_x_px2"), "x_m,vx_m_per_s,var_x_m2");
        assert_eq!(LengthUnit::Pixel.columns("x_px"), "x_px");
    }
}
