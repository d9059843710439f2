//! GEFF 1.3: a folder that holds the tracks as a graph, a node a row and an edge from each row to the next of its track.
//!
//! Source: *Graph Exchange File Format*, specification 1.3 (live-image-tracking-tools). Axes are `t` (the frame), `y`, `x` (px); the
//! ellipsoid of a node is the covariance of its position in the order of the axes, [[yy, yx], [xy, xx]] px²; `state_covariance` is that
//! of `[x, vx, y, vy]`. A parent's last row has edges to the first rows of its children. What some rows lack is marked as missing.
//! The folder appears whole; another store of this kind under the name is replaced, anything else is refused.

use super::paths::{Paths, centre, dropped};
use super::zarr::{Store, Values};
use crate::io::tables::COVARIANCE_COLUMNS;
use crate::io::tracks::parents::parents;
use crate::{Error, ErrorKind, Result, TrackStatus, TrackTable};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Columns that the graph holds beside positions and [`COVARIANCE_COLUMNS`].
const HELD: [&str; 10] =
    ["score", "class", "parent", "time_s", "status", "detection", "vx_px_per_s", "vy_px_per_s", "var_xy", "cov_xy_px2"];

/// Properties of nodes that are written, with what is said of them.
struct Nodes<'a> {
    store: &'a Store,
    about: Map<String, Value>,
}

impl Nodes<'_> {
    /// Writes a property; `missing` marks rows that lack it, if any do.
    fn put(
        &mut self,
        name: &str,
        unit: Option<&str>,
        shape: &[usize],
        values: &Values<'_>,
        missing: &[bool],
    ) -> Result<()> {
        self.store.group(&format!("nodes/props/{name}"), None)?;
        self.store.array(&format!("nodes/props/{name}/values"), shape, values)?;
        if missing.contains(&true) {
            self.store.array(&format!("nodes/props/{name}/missing"), &shape[..1], &Values::Bool(missing))?;
        }
        let mut about = json!({ "identifier": name, "dtype": values.name(), "varlength": false });
        if let Some(unit) = unit {
            about["unit"] = unit.into();
        }
        self.about.insert(name.to_string(), about);
        Ok(())
    }

    /// Writes a property of `N` numbers a row where any row has it.
    fn maybe<const N: usize>(
        &mut self,
        name: &str,
        unit: Option<&str>,
        inner: &[usize],
        fill: [f64; N],
        rows: &[Option<[f64; N]>],
    ) -> Result<bool> {
        if rows.iter().all(Option::is_none) {
            return Ok(false);
        }
        let values: Vec<f64> = rows.iter().flat_map(|v| v.unwrap_or(fill)).collect();
        let missing: Vec<bool> = rows.iter().map(Option::is_none).collect();
        let shape: Vec<usize> = std::iter::once(rows.len()).chain(inner.iter().copied()).collect();
        self.put(name, unit, &shape, &Values::F64(&values), &missing)?;
        Ok(true)
    }
}

/// Writes a folder, which appears whole; the names of what it cannot hold are returned. Without a folder nothing is written, only said.
/// # Errors
/// Something else under the name; a track that stands twice in a frame; files that cannot be written.
pub(crate) fn write_folder(table: &TrackTable, folder: Option<&Path>) -> Result<Vec<String>> {
    let paths = Paths::new(table)?;
    let Some(folder) = folder else { return Ok(dropped(table, &[HELD, COVARIANCE_COLUMNS].concat())) };
    let failed = |what: &str, e: std::io::Error| Error::new(ErrorKind::Output, what).at(folder.display()).because(e);
    if folder.exists() && !is_geff(folder) {
        return Err(Error::new(ErrorKind::Output, "something else than a GEFF store is in the way")
            .at(folder.display())
            .hint("choose another name"));
    }
    let mut name = folder.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let part = folder.with_file_name(name);
    // What a killed run left.
    let _ = std::fs::remove_dir_all(&part);
    let whole = store(table, &paths, &part).and_then(|()| {
        if folder.exists() {
            std::fs::remove_dir_all(folder).map_err(|e| failed("the earlier store cannot be replaced", e))?;
        }
        std::fs::rename(&part, folder).map_err(|e| failed("cannot be written", e))
    });
    if let Err(e) = whole {
        let _ = std::fs::remove_dir_all(&part);
        return Err(e);
    }
    Ok(dropped(table, &[HELD, COVARIANCE_COLUMNS].concat()))
}

/// Whether a folder is a store that was written here, or one like it, or empty.
fn is_geff(folder: &Path) -> bool {
    let mut inside = match std::fs::read_dir(folder) {
        Ok(inside) => inside,
        Err(_) => return false,
    };
    inside.next().is_none()
        || std::fs::read_to_string(folder.join(".zattrs")).is_ok_and(|text| text.contains("\"geff_version\""))
}

fn store(table: &TrackTable, paths: &Paths, root: &Path) -> Result<()> {
    let n = table.n_rows();
    let store = Store::create(root)?;
    for group in ["nodes", "nodes/props", "edges", "edges/props"] {
        store.group(group, None)?;
    }
    let ids: Vec<u64> = (0..n as u64).collect();
    store.array("nodes/ids", &[n], &Values::U64(&ids))?;
    let edges = edges(table, paths);
    store.array("edges/ids", &[edges.len() / 2, 2], &Values::U64(&edges))?;
    let mut nodes = Nodes { store: &store, about: Map::new() };
    let t: Vec<i64> = paths.frames.iter().map(|f| i64::from(*f)).collect();
    let at: Vec<[f64; 4]> = (0..n).map(|r| centre(table, r)).collect();
    let column = |k: usize| at.iter().map(|c| c[k]).collect::<Vec<f64>>();
    let (x, y) = (column(0), column(1));
    nodes.put("t", None, &[n], &Values::I64(&t), &[])?;
    nodes.put("y", Some("pixel"), &[n], &Values::F64(&y), &[])?;
    nodes.put("x", Some("pixel"), &[n], &Values::F64(&x), &[])?;
    let of_track: Vec<i64> = table.tracks.iter().map(|t| table.ids[*t as usize]).collect();
    nodes.put("track_id", None, &[n], &Values::I64(&of_track), &[])?;
    if !table.is_points {
        nodes.put("width", Some("pixel"), &[n], &Values::F64(&column(2)), &[])?;
        nodes.put("height", Some("pixel"), &[n], &Values::F64(&column(3)), &[])?;
    }
    let score: Vec<f64> = (0..n).map(|r| table.score.get(r)).collect();
    nodes.put("score", None, &[n], &Values::F64(&score), &[])?;
    let class: Vec<i64> = (0..n).map(|r| table.class.get(r).into()).collect();
    nodes.put("class", None, &[n], &Values::I64(&class), &[])?;
    let states: Vec<_> = (0..n).map(|r| table.state(r)).collect();
    let time: Vec<_> = states.iter().map(|s| s.time.map(|t| [t.as_secs_f64()])).collect();
    nodes.maybe("time_s", Some("second"), &[], [0.0], &time)?;
    let velocity = |k: usize| states.iter().map(|s| s.velocity.map(|v| [v[k]])).collect::<Vec<_>>();
    nodes.maybe("vx", Some("pixel/second"), &[], [0.0], &velocity(0))?;
    nodes.maybe("vy", Some("pixel/second"), &[], [0.0], &velocity(1))?;
    let cov: Vec<Option<[f64; 16]>> =
        (0..n).map(|r| table.state_cov(r).map(|p| std::array::from_fn(|k| p[(k / 4, k % 4)]))).collect();
    nodes.maybe("state_covariance", None, &[4, 4], [0.0; 16], &cov)?;
    let ellipse = |r: usize| {
        let p = table.position_cov(r)?;
        // A reader draws it: only a covariance that can be drawn is one.
        (p[(0, 0)] > 0.0 && p.determinant() > 0.0).then(|| [p[(1, 1)], p[(0, 1)], p[(0, 1)], p[(0, 0)]])
    };
    let ellipses: Vec<_> = (0..n).map(ellipse).collect();
    let has_ellipses = nodes.maybe("covariance2d", Some("pixel^2"), &[2, 2], [1.0, 0.0, 0.0, 1.0], &ellipses)?;
    let word = |s: TrackStatus| match s {
        TrackStatus::Tentative => 0,
        TrackStatus::Confirmed => 1,
        TrackStatus::Coasting => 2,
    };
    if states.iter().any(|s| s.status.is_some()) {
        let status: Vec<u8> = states.iter().map(|s| s.status.map_or(0, word)).collect();
        let missing: Vec<bool> = states.iter().map(|s| s.status.is_none()).collect();
        nodes.put("status", None, &[n], &Values::U8(&status), &missing)?;
        nodes.about["status"]["description"] = "0 tentative, 1 confirmed, 2 coasting (predicted)".into();
    }
    if table.has_detections() {
        let detection: Vec<i64> = states.iter().map(|s| s.detection.map_or(-1, i64::from)).collect();
        let missing: Vec<bool> = states.iter().map(|s| s.detection.is_none()).collect();
        nodes.put("detection", None, &[n], &Values::I64(&detection), &missing)?;
    }
    let range = |v: &[f64]| v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let frames: Vec<f64> = t.iter().map(|t| *t as f64).collect();
    let axis = |name: &str, kind: &str, unit: &str, values: &[f64]| {
        let (min, max) = range(values);
        let mut axis = json!({ "name": name, "type": kind, "unit": unit });
        if min <= max {
            (axis["min"], axis["max"]) = (min.into(), max.into());
        }
        axis
    };
    let mut geff = json!({
        "geff_version": "1.3", "directed": true,
        "axes": [axis("t", "time", "frame", &frames), axis("y", "space", "pixel", &y), axis("x", "space", "pixel", &x)],
        "node_props_metadata": nodes.about, "edge_props_metadata": {},
        "display_hints": { "display_horizontal": "x", "display_vertical": "y", "display_time": "t" },
        "extra": { "written_by": format!("boresight {}", env!("CARGO_PKG_VERSION")), "classes": table.class_names },
    });
    if has_ellipses {
        geff["ellipsoid"] = "covariance2d".into();
    }
    // With parents a track may be a piece of a longer unbranched path, which is no tracklet.
    if parents(table).is_empty() {
        geff["track_node_props"] = json!({ "tracklet": "track_id", "lineage": "track_id" });
    }
    store.group("", Some(json!({ "geff": geff })))
}

/// From each row to the next of its track, and from a parent's last to its children's first.
fn edges(table: &TrackTable, paths: &Paths) -> Vec<u64> {
    let mut edges: Vec<u64> = Vec::with_capacity(2 * table.n_rows());
    for rows in &paths.rows {
        rows.windows(2).for_each(|pair| edges.extend(pair.iter().map(|r| *r as u64)));
    }
    for (child, parent) in parents(table) {
        if let (Some(&from), Some(&to)) = (paths.rows[parent].last(), paths.rows[child].first())
            && paths.frames[from] < paths.frames[to]
        {
            edges.extend([from as u64, to as u64]);
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, RowState, TrackRow, TrackTableBuilder};

    #[test]
    fn the_store_appears_whole_and_replaces_only_its_like() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.geff");
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        let row = |frame| TrackRow { frame, id: 3, bbox: [0.0, 0.0, 2.0, 4.0], ..TrackRow::default() };
        b.push(&row(0)).unwrap();
        b.push_with_state(&row(2), &RowState { position_cov: Some([2.0, 0.5, 3.0]), ..RowState::default() }).unwrap();
        let table = b.finish(0).unwrap();
        for _ in 0..2 {
            assert!(write_folder(&table, Some(&path)).unwrap().is_empty());
        }
        let read = |name: &str| std::fs::read(path.join(name)).unwrap();
        let doubles = |name: &str| -> Vec<f64> {
            read(name).chunks(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect()
        };
        assert_eq!(doubles("nodes/props/covariance2d/values/0.0.0"), [1.0, 0.0, 0.0, 1.0, 3.0, 0.5, 0.5, 2.0]);
        assert_eq!(read("nodes/props/covariance2d/missing/0"), [1, 0]);
        assert_eq!(read("edges/ids/0.0"), [0_u64, 1].map(u64::to_le_bytes).concat());
        assert!(!dir.path().join("t.geff.part").exists());
        let mine = dir.path().join("mine");
        std::fs::create_dir(&mine).unwrap();
        std::fs::write(mine.join("notes"), "x").unwrap();
        assert!(write_folder(&table, Some(&mine)).unwrap_err().to_string().contains("in the way"));
        write_folder(&TrackTable::from_rows("t", PixelOrigin::Centre0, []).unwrap(), Some(&path)).unwrap();
    }
}
