//! Own ship: where the radar is and which way its bow points, from a table.
//!
//! Columns by their names: time (`t`, `time_s`), position (`x_m`, `y_m`, also `x`, `y`, `east_m`, `north_m`, in m; or `lat_deg`, `lon_deg`), heading (`heading_deg`,
//! `heading_rad`, clockwise from north; may be missing). Latitudes and longitudes become metres east and north of the first row on the WGS 84 ellipsoid
//! (its radii of curvature there: to a metre within some 10 km). Rows in order of time; of several of one time the first counts, one whose time runs back is left out and counted.
//! Limits: a flat earth; what is between two rows is straight.

use super::picture::along;
use crate::geodesy::radii_m;
use crate::io::tables::columns::Columns;
use crate::io::tables::row::Row;
use crate::io::tables::table::Table;
use crate::{Error, ErrorKind, Result};
use std::path::Path;

/// Most rows: a guard of memory (a day of a hundred a second).
const MOST_ROWS: usize = 10_000_000;

/// Positions and headings of own ship.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct OwnShip {
    /// Time (s), x east, y north (m), in order of time.
    pub path: Vec<[f64; 3]>,
    /// Time (s), cosine and sine of the heading from north, clockwise; empty where the table has none.
    headings: Vec<[f64; 3]>,
    /// Whole sentences.
    pub warnings: Vec<String>,
}

impl OwnShip {
    /// Reads a table.
    /// # Errors
    /// A file that cannot be read, columns that are missing, a row that is not of numbers (unless `skip_bad_rows`).
    pub fn read(path: &Path, skip_bad_rows: bool) -> Result<Self> {
        Self::of(&mut Table::open(path, &Columns::default())?, skip_bad_rows)
    }

    fn of(table: &mut Table, skip_bad_rows: bool) -> Result<Self> {
        let at = Places::of(&table.form.header).map_err(|e| e.at(&table.form.label))?;
        let mut out = Self::default();
        let mut first = None;
        let (mut n_back, mut n_bad) = (0u64, 0u64);
        while let Some(row) = table.next_row()? {
            match at.read(&row) {
                Ok((t, _, _)) if out.path.last().is_some_and(|p| p[0] == t) => {}
                Ok((t, _, _)) if out.path.last().is_some_and(|p| p[0] > t) => n_back += 1,
                Ok((t, place, heading)) => {
                    let zero = *first.get_or_insert(place);
                    let [x, y] = if at.on_earth { metres(place, zero) } else { place };
                    if !(x.is_finite() && y.is_finite()) {
                        n_bad += 1;
                        continue;
                    }
                    out.path.push([t, x, y]);
                    if let Some(h) = heading {
                        out.headings.push([t, h.cos(), h.sin()]);
                    }
                    if out.path.len() > MOST_ROWS {
                        return Err(row.bad(format!("more than {MOST_ROWS} rows of own ship")));
                    }
                }
                Err(_) if skip_bad_rows => n_bad += 1,
                Err(e) => return Err(e.hint("mend the row, or leave such rows out with --skip-bad-rows")),
            }
        }
        let label = &table.form.label;
        if out.path.is_empty() {
            return Err(Error::new(ErrorKind::Damaged, "says nowhere where own ship is").at(label));
        }
        let longest = out.path.windows(2).map(|w| w[1][0] - w[0][0]).fold(0.0, f64::max);
        if n_back > 0 {
            out.warnings.push(format!(
                "{label}: {n_back} rows whose time runs back were left out; the longest time without own ship's position is {longest:.0} s."
            ));
        }
        if n_bad > 0 {
            out.warnings.push(format!("{label}: {n_bad} rows were bad and left out."));
        }
        Ok(out)
    }

    /// Heading at a time, rad clockwise from north; `None` where the table has none.
    pub fn heading_at(&self, time_s: f64) -> Option<f64> {
        // Straight between the points of the circle, so that 359 and 1 degree lie side by side.
        let [c, s] = if self.headings.is_empty() { return None } else { along(&self.headings, time_s) };
        Some(s.atan2(c))
    }
}

/// Metres east and north of `zero`, both latitude and longitude in rad.
fn metres(place: [f64; 2], zero: [f64; 2]) -> [f64; 2] {
    let [along, across] = radii_m(zero[0]);
    // The short way round.
    let turn = std::f64::consts::TAU;
    let east = (place[1] - zero[1] + turn / 2.0).rem_euclid(turn) - turn / 2.0;
    [east * across * zero[0].cos(), (place[0] - zero[0]) * along]
}

/// Where the columns stand.
struct Places {
    time: usize,
    place: [usize; 2],
    on_earth: bool,
    heading: Option<(usize, f64)>,
}

impl Places {
    fn of(header: &[String]) -> Result<Self> {
        let plain = |h: &str| h.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
        let names: Vec<String> = header.iter().map(|h| plain(h)).collect();
        let find = |known: &[&str]| known.iter().find_map(|k| names.iter().position(|n| n == k));
        let lacks = |what: &str, hint: &str| {
            let have = crate::io::tables::row::list(header);
            Error::new(ErrorKind::Unsupported, format!("own ship's table: no column says {what}"))
                .hint(format!("the columns are {have}; {hint}"))
        };
        let time =
            find(&["times", "t", "time", "seconds", "timestamp"]).ok_or_else(|| lacks("when", "name it time_s"))?;
        let east = find(&["xm", "x", "eastm", "eastingm", "xpx"]).zip(find(&["ym", "y", "northm", "northingm", "ypx"]));
        let earth = find(&["latdeg", "latitudedeg", "lat", "latitude"]).zip(find(&[
            "londeg",
            "longitudedeg",
            "lon",
            "lng",
            "longitude",
        ]));
        let on_earth = east.is_none();
        let (a, b) = east.or(earth).ok_or_else(|| lacks("where", "name them x_m and y_m, or lat_deg and lon_deg"))?;
        let heading = find(&["headingdeg", "heading", "hdgdeg", "hdg"])
            .map(|i| (i, 1f64.to_radians()))
            .or_else(|| find(&["headingrad", "hdgrad"]).map(|i| (i, 1.0)));
        Ok(Self { time, place: [a, b], on_earth, heading })
    }

    /// Time (s), place (m, or latitude and longitude in rad) and heading (rad) of a row.
    fn read(&self, row: &Row<'_>) -> Result<(f64, [f64; 2], Option<f64>)> {
        let need = |at: usize, what: &str| row.need_at(at, what);
        let t = need(self.time, "a time in seconds")?;
        let mut place = [need(self.place[0], "a position")?, need(self.place[1], "a position")?];
        if self.on_earth {
            if place[0].abs() > 90.0 {
                return Err(row.wrong_at(self.place[0], &place[0].to_string(), "a latitude within 90 degrees"));
            }
            place = place.map(f64::to_radians);
        }
        let heading = match self.heading {
            Some((at, scale)) => row.number_at(at, "a heading")?.map(|h| h * scale),
            None => None,
        };
        Ok((t, place, heading))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(text: &str) -> Result<OwnShip> {
        OwnShip::of(&mut Table::of_text("ownship.csv", text.as_bytes(), &Columns::default()).unwrap(), false)
    }

    #[test]
    fn headings_go_the_short_way_round_and_a_clock_that_runs_back_is_said() {
        let own = own("t,x,y,heading_deg\n0,0,0,359\n10,100,50,1\n5,0,0,90\n20,200,50,1\n").unwrap();
        assert!((own.heading_at(5.0).unwrap()).abs() < 1e-9);
        assert_eq!(along(&own.path, 5.0), [50.0, 25.0]);
        assert!(own.warnings[0].contains("1 rows whose time runs back"), "{:?}", own.warnings);
    }

    #[test]
    fn degrees_become_metres_on_the_ellipsoid() {
        // A degree of latitude at 50 degrees is 111 229 m, one of longitude 71 696 m (published tables of WGS 84).
        let own = own("time_s,lat_deg,lon_deg\n0,50,-1\n1,50.01,-1\n2,50,-0.99\n").unwrap();
        assert!((own.path[1][2] - 1112.29).abs() < 0.05 && own.path[1][1] == 0.0, "{:?}", own.path);
        assert!((own.path[2][1] - 716.96).abs() < 0.05, "{:?}", own.path);
        assert_eq!(own.heading_at(1.0), None);
    }

    #[test]
    fn a_table_that_is_none_says_what_it_lacks() {
        assert!(own("t,heading_deg\n0,1\n").unwrap_err().to_string().contains("says where"));
        assert!(own("t,x,y\n").unwrap_err().to_string().contains("nowhere"));
        let e = own("t,x,y\n0,1,2\n1,abc,2\n").unwrap_err().to_string();
        assert!(e.contains("line 3") && e.contains("abc"), "{e}");
    }
}
