//! What a format of tracks cannot hold of a table.

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
    all.into_iter().filter(|(n, says)| *says && !held.contains(n)).map(|(n, _)| n.to_string()).collect()
}
