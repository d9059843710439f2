//! What a format of tracks cannot hold of a table.

use super::tracks_csv::COVARIANCE_COLUMNS;
use crate::TrackTable;

/// What a format is said to lose that has no regions.
pub(crate) const REGIONS: &str = "regions that do not count";

/// The columns of a table that say anything and are not among those that a format holds.
pub(crate) fn lost(table: &TrackTable, held: &[&str]) -> Vec<String> {
    use crate::tracks::Column::Constant;
    let all = [
        ("score", table.score != Constant(1.0)),
        ("class", table.class != Constant(1)),
        ("class names", !table.class_names.is_empty()),
        ("visibility", table.visibility != Constant(1.0)),
        ("truncation", table.truncation != Constant(0.0)),
        ("occlusion", table.occlusion != Constant(0)),
        (REGIONS, !table.ignore.is_empty()),
    ];
    // A table that was read keeps its columns of states as further ones, by the names of the file.
    let states = if table.extra.is_empty() { state_columns(table) } else { Vec::new() };
    let says = all.into_iter().filter(|(_, says)| *says).map(|(n, _)| n).chain(states);
    says.filter(|n| !held.contains(n)).map(str::to_string).collect()
}

/// The columns of `tracks.csv` that a table has as states.
fn state_columns(table: &TrackTable) -> Vec<&'static str> {
    use crate::tracks::Column::Constant;
    let s = &table.states;
    let all: [(bool, &[&str]); 6] = [
        (s.time != Constant(None), &["time_s"]),
        (s.status != Constant(None), &["status"]),
        (s.detection != Constant(None), &["detection"]),
        (s.velocity != Constant(None), &["vx_px_per_s", "vy_px_per_s"]),
        (s.cov != Constant(None), &COVARIANCE_COLUMNS),
        (s.cov == Constant(None) && s.position_cov != Constant(None), &["var_x_px2", "cov_x_y_px2", "var_y_px2"]),
    ];
    all.into_iter().filter(|(has, _)| *has).flat_map(|(_, names)| names.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, RowState, TrackRow, TrackTableBuilder};

    #[test]
    fn states_are_lost_by_a_format_without_them_once() {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        let state = RowState { velocity: Some([1.0, 2.0]), position_cov: Some([1.0, 0.0, 1.0]), ..RowState::default() };
        b.push_with_state(&TrackRow::default(), &state).unwrap();
        let mut table = b.finish(0).unwrap();
        let want = ["vy_px_per_s", "var_x_px2", "cov_x_y_px2", "var_y_px2"];
        assert_eq!(lost(&table, &["vx_px_per_s"]), want);
        table.extra.push(("vx".into(), vec!["1".into()]));
        assert!(lost(&table, &[]).is_empty(), "the further columns are named by who writes");
    }
}
