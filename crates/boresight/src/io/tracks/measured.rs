//! The rows of tracks that were measured, as programs that link what they locate have them: no predicted rows, and the mass of what was found.

use crate::{Scan, TrackStatus, TrackTable};

/// The rows of frames in which their tracks took a detection; a table that does not say so keeps all.
#[must_use]
pub fn measured_rows(table: &TrackTable) -> TrackTable {
    let states = &table.states;
    let names_detections = (0..table.n_rows()).any(|r| states.detection.get(r).is_some());
    table.filtered(|_, r| {
        let is_predicted = states.status.get(r) == Some(TrackStatus::Coasting);
        !is_predicted && (!names_detections || states.detection.get(r).is_some())
    })
}

/// Adds a column `mass`, the sum of the pixel weights of the detection that each row's track took, empty where it took none; `scans` are the detections of the
/// run that made the table. Returns whether the table names detections that are there.
pub fn add_mass(table: &mut TrackTable, scans: &[Scan]) -> bool {
    if table.extra.iter().any(|(name, _)| name == "mass") {
        return true;
    }
    let mut masses = vec![String::new(); table.n_rows()];
    let mut n = 0;
    for frame in 0..table.n_frames() {
        let Ok(at) = scans.binary_search_by_key(&(frame as u64), |s| s.index.0) else { continue };
        for r in table.rows(frame) {
            let taken = table.states.detection.get(r).and_then(|d| scans[at].detections.get(d as usize));
            if let Some(d) = taken {
                masses[r] = d.sum.to_string();
                n += 1;
            }
        }
    }
    if n > 0 {
        table.extra.push(("mass".to_string(), masses));
    }
    n > 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tracks::{ReadOptions, read};
    use crate::{Detection, FrameIndex, Timestamp};

    /// A track of three frames that coasts in the second, as `tracks.csv` says it.
    fn table() -> TrackTable {
        let text = "frame,time_s,track_id,status,x_px,y_px,detection\n0,0,1,confirmed,5,6,1\n1,0.1,1,coasting,6,6,\n2,0.2,1,confirmed,7,6,0\n";
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), text).unwrap();
        read(f.path(), None, ReadOptions::default(), false).unwrap().table
    }

    #[test]
    fn what_was_predicted_goes_and_the_rest_has_the_mass_of_its_detection() {
        let scan = |k: u64, sums: &[f64]| {
            let all = sums.iter().map(|s| Detection::point(0.0, 0.0, 1.0).with_sum(*s)).collect();
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64)).with_detections(all)
        };
        let mut all = table();
        assert!(add_mass(&mut all, &[scan(0, &[7.0, 30.5]), scan(1, &[]), scan(2, &[41.0])]));
        let measured = measured_rows(&all);
        assert_eq!((all.n_rows(), measured.n_rows()), (3, 2));
        assert_eq!(measured.extra[0], ("mass".to_string(), vec!["30.5".to_string(), "41".to_string()]));
    }

    #[test]
    fn a_table_that_says_nothing_of_detections_stays_as_it_is() {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), "frame,particle,x,y,mass\n0,3,1.5,2.5,9\n2,3,4,5,8\n").unwrap();
        let options = ReadOptions { keep_extra: true, ..ReadOptions::default() };
        let mut table = read(f.path(), None, options, false).unwrap().table;
        assert_eq!(measured_rows(&table).n_rows(), 2);
        assert!(add_mass(&mut table, &[]) && table.extra.len() == 1, "it has its own mass");
    }
}
