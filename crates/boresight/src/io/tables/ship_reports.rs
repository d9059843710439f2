//! Reports of ships' positions, as AIS tables have them: who, when, where; no frames.
//!
//! Columns by name: `mmsi` (the ship's number), a time (`t`, `time_s`), `x` and `y` (m; also `x_m`, `y_m`). Reports of one ship in order of time; one whose time does not
//! grow is left out, which receivers that hear a report twice make common.
//! Limits: places in metres of one frame of reference; latitudes and longitudes are the user's to convert.

use super::columns::{Columns, Field};
use super::table::Table;
use crate::{Result, TrackId};
use std::collections::BTreeMap;
use std::path::Path;

/// One ship's reports.
#[derive(Clone, Debug, PartialEq)]
pub struct ShipReports {
    /// Its number (MMSI).
    pub id: TrackId,
    /// Time (s), x, y (m), in order of time.
    pub reports: Vec<[f64; 3]>,
}

/// Reads a table of ships' reports; `None` where it has no column `mmsi`.
/// # Errors
/// A file that cannot be read; a row that is not of numbers, unless `skip_bad_rows`.
pub fn read_ship_reports(path: impl AsRef<Path>, skip_bad_rows: bool) -> Result<Option<Vec<ShipReports>>> {
    of(&mut Table::open(path.as_ref(), &Columns::default())?, skip_bad_rows)
}

fn of(table: &mut Table, skip_bad_rows: bool) -> Result<Option<Vec<ShipReports>>> {
    let header = &table.form.header;
    let named = |name: &str| header.iter().position(|h| h.trim().eq_ignore_ascii_case(name));
    let Some(ship) = named("mmsi") else { return Ok(None) };
    let time = table.form.layout.column(Field::TimeS).or_else(|| named("t"));
    let place = [Field::X, Field::Y].map(|f| table.form.layout.column(f));
    let Some(time) = time else { return Err(table.lacks("when a report is of", "name it time_s, in seconds")) };
    let [Some(x), Some(y)] = place else { return Err(table.lacks("where a ship is", "name them x_m and y_m")) };
    let mut ships: BTreeMap<u64, Vec<[f64; 3]>> = BTreeMap::new();
    while let Some(row) = table.next_row()? {
        let read = || -> Result<(u64, [f64; 3])> {
            let id = row.need_at(ship, "a ship's number")?;
            if !((0.0..9e15).contains(&id) && id.fract() == 0.0) {
                return Err(row.wrong_at(ship, &id.to_string(), "a ship's number"));
            }
            let report =
                [row.need_at(time, "a time in seconds")?, row.need_at(x, "a position")?, row.need_at(y, "a position")?];
            Ok((id as u64, report))
        };
        match read() {
            Ok((id, report)) => {
                let of = ships.entry(id).or_default();
                if of.last().is_none_or(|last| last[0] < report[0]) {
                    of.push(report);
                }
            }
            Err(_) if skip_bad_rows => {}
            Err(e) => return Err(e.hint("mend the row, or leave it out")),
        }
    }
    Ok(Some(ships.into_iter().map(|(id, reports)| ShipReports { id: TrackId(id), reports }).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<Vec<ShipReports>>> {
        of(&mut Table::of_text("ais.csv", text.as_bytes(), &Columns::default())?, false)
    }

    #[test]
    fn reports_are_gathered_by_ship_and_echoes_left_out() {
        let ships = read("mmsi,t,x,y,heading_deg\n5,10,1,2,0\n7,10,3,4,0\n5,10,1,2,0\n5,12,2,2,0\n").unwrap().unwrap();
        assert_eq!((ships[0].id.0, ships.len()), (5, 2));
        assert_eq!(ships[0].reports, [[10.0, 1.0, 2.0], [12.0, 2.0, 2.0]]);
        assert_eq!(read("frame,track_id,x,y\n0,1,2,3\n").unwrap(), None);
        assert!(read("mmsi,x,y\n1,2,3\n").unwrap_err().to_string().contains("time_s"));
        assert!(read("mmsi,t,x,y\n1,a,2,3\n").unwrap_err().to_string().contains("line 2"));
    }
}
