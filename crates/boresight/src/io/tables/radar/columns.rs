//! The columns of a radar's table by the words of their names: what they hold, and in which unit.
//!
//! A name is a row of words parted by what is neither letter nor digit: `range_m`, `azimuth_deg`, `range_std_nm`, `var_az`. Every word must be known, or
//! the column is none of these. A deviation without a unit has that of its quantity.

use crate::length_unit::LengthUnit;
use crate::{Error, ErrorKind, Result};

/// A column and the factor to m (px), rad, m² or rad².
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scaled {
    pub at: usize,
    pub scale: f64,
}

/// Where a deviation stands: as itself, or as its square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Spread {
    Std(Scaled),
    Variance(Scaled),
}

/// The columns of a table of plots.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RadarColumns {
    pub range: Scaled,
    pub azimuth: Scaled,
    pub range_spread: Option<Spread>,
    pub azimuth_spread: Option<Spread>,
    /// Number of the turn of the antenna, where the table has it.
    pub turn: Option<usize>,
    pub unit: LengthUnit,
}

#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Range,
    Azimuth,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Value,
    Std,
    Variance,
}

/// Metres of a nautical mile.
const NAUTICAL_MILE_M: f64 = 1852.0;

/// Factor of a unit's word, and whether it is one of length, in pixels, squared.
fn unit_of(word: &str) -> Option<(f64, Quantity, bool, bool)> {
    let (plain, squared) = word.strip_suffix('2').map_or((word, false), |w| (w, true));
    let (factor, of, px) = match plain {
        "m" | "metre" | "metres" | "meter" | "meters" => (1.0, Quantity::Range, false),
        "km" => (1000.0, Quantity::Range, false),
        "nm" | "nmi" => (NAUTICAL_MILE_M, Quantity::Range, false),
        "px" => (1.0, Quantity::Range, true),
        "rad" => (1.0, Quantity::Azimuth, false),
        "mrad" => (1e-3, Quantity::Azimuth, false),
        "deg" | "degree" | "degrees" => (1f64.to_radians(), Quantity::Azimuth, false),
        _ => return None,
    };
    Some((factor, of, px, squared))
}

/// One column of range or azimuth.
struct Named {
    quantity: Quantity,
    kind: Kind,
    /// Factor, in pixels, squared.
    unit: Option<(f64, bool, bool)>,
}

fn named(name: &str) -> Option<Named> {
    let lower = name.to_lowercase();
    let (mut quantity, mut kind, mut unit) = (None, Kind::Value, None);
    for word in lower.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()) {
        match word {
            "range" | "rng" | "r" if quantity.is_none() => quantity = Some(Quantity::Range),
            "azimuth" | "az" | "bearing" | "brg" if quantity.is_none() => quantity = Some(Quantity::Azimuth),
            "std" | "sd" | "sigma" | "stdev" if kind == Kind::Value => kind = Kind::Std,
            "var" | "variance" if kind == Kind::Value => kind = Kind::Variance,
            _ => unit = Some(unit_of(word).filter(|_| unit.is_none())?),
        }
    }
    let quantity = quantity?;
    if unit.is_some_and(|(_, of, _, squared)| of != quantity || squared != (kind == Kind::Variance)) {
        return None;
    }
    // A lone letter is a radius or a colour as well.
    if unit.is_none() && kind == Kind::Value && lower.trim().len() < 2 {
        return None;
    }
    Some(Named { quantity, kind, unit: unit.map(|(f, _, px, squared)| (f, px, squared)) })
}

impl RadarColumns {
    /// Finds the columns by their header; `None` where there is not both a range and an azimuth.
    /// # Errors
    /// A range or an azimuth without a unit.
    pub fn of_header(header: &[String]) -> Result<Option<Self>> {
        let all: Vec<(usize, Named)> = header.iter().enumerate().filter_map(|(i, h)| Some((i, named(h)?))).collect();
        let find = |q: Quantity, k: Kind| all.iter().find(|(_, n)| n.quantity == q && n.kind == k);
        let (Some(range), Some(azimuth)) = (find(Quantity::Range, Kind::Value), find(Quantity::Azimuth, Kind::Value))
        else {
            return Ok(None);
        };
        let value = |(at, n): &(usize, Named), units: &str| match n.unit {
            Some((scale, px, _)) => Ok((Scaled { at: *at, scale }, px)),
            None => Err(Error::new(ErrorKind::Unsupported, format!("column {} names no unit", header[*at]))
                .hint(format!("rename it: {units}"))),
        };
        let (range, px) = value(range, "range_m, range_km or range_nm (nautical miles)")?;
        let (azimuth, _) = value(azimuth, "azimuth_deg, azimuth_rad or azimuth_mrad")?;
        let spread = |q: Quantity, own: f64| {
            let scaled = |at: usize, n: &Named, own: f64| {
                let scale = n.unit.map_or(own, |(f, _, squared)| if squared { f * f } else { f });
                Scaled { at, scale }
            };
            let std = find(q, Kind::Std).map(|(at, n)| Spread::Std(scaled(*at, n, own)));
            std.or_else(|| find(q, Kind::Variance).map(|(at, n)| Spread::Variance(scaled(*at, n, own * own))))
        };
        let turn = header.iter().position(|h| {
            ["frame", "scan", "turn", "scannumber", "scanno"]
                .contains(&h.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "").as_str())
        });
        Ok(Some(Self {
            range_spread: spread(Quantity::Range, range.scale),
            azimuth_spread: spread(Quantity::Azimuth, azimuth.scale),
            range,
            azimuth,
            turn,
            unit: if px { LengthUnit::Pixel } else { LengthUnit::Metre },
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(header: &str) -> Result<Option<RadarColumns>> {
        RadarColumns::of_header(&header.split(',').map(String::from).collect::<Vec<_>>())
    }

    #[test]
    fn units_stand_in_the_names_and_deviations_take_those_of_their_quantity() {
        let c = of("t,azimuth_rad,range_m,var_az,cov_az_r,cov_r_az,var_r").unwrap().unwrap();
        assert_eq!((c.azimuth.at, c.range.at, c.range.scale), (1, 2, 1.0));
        assert_eq!(c.azimuth_spread, Some(Spread::Variance(Scaled { at: 3, scale: 1.0 })));
        assert_eq!(c.range_spread, Some(Spread::Variance(Scaled { at: 6, scale: 1.0 })));
        let c = of("scan,time_s,Range (nm),Bearing [deg],range_sd_m,azimuth_deg_std").unwrap().unwrap();
        assert_eq!((c.range.scale, c.turn, c.unit), (1852.0, Some(0), LengthUnit::Metre));
        assert_eq!(c.range_spread, Some(Spread::Std(Scaled { at: 4, scale: 1.0 })));
        let degree = std::f64::consts::PI / 180.0;
        assert_eq!(c.azimuth_spread, Some(Spread::Std(Scaled { at: 5, scale: degree })));
        let c = of("range_nm,az_deg,range_var").unwrap().unwrap();
        assert_eq!(c.range_spread, Some(Spread::Variance(Scaled { at: 2, scale: 1852.0 * 1852.0 })));
        assert_eq!(of("range_px,azimuth_rad").unwrap().unwrap().unit, LengthUnit::Pixel);
    }

    #[test]
    fn other_tables_are_none_and_a_missing_unit_is_said() {
        assert_eq!(of("frame,x,y,r,g,b").unwrap(), None);
        assert_eq!(of("range_m,y").unwrap(), None);
        assert_eq!(of("range_deg,azimuth_m").unwrap(), None);
        assert_eq!(of("dynamic_range_m,azimuth_deg").unwrap(), None, "a word that is not known");
        let e = of("range,azimuth_deg").unwrap_err().to_string();
        assert!(e.contains("range names no unit") && e.contains("range_nm"), "{e}");
    }
}
