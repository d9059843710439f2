//! Which track comes from which.

use crate::TrackTable;

/// The pairs (track, its parent's track) that a column `parent` names.
pub(super) fn parents(table: &TrackTable) -> Vec<(usize, usize)> {
    let Some((_, values)) = table.extra.iter().find(|e| e.0 == "parent") else { return Vec::new() };
    let mut out: Vec<(usize, usize)> = Vec::new();
    for (r, v) in values.iter().enumerate() {
        let named = v.parse::<i64>().ok().and_then(|id| table.ids.binary_search(&id).ok());
        out.extend(named.map(|parent| (table.tracks[r] as usize, parent)));
    }
    out.sort_unstable();
    out.dedup();
    out
}
