//! CVAT for video 1.1: each track with its boxes, all of them keyframes; where a track pauses or ends it is outside.
//!
//! Source: CVAT, *CVAT for video* format. Every box is `keyframe="1"`: what lies between keyframes CVAT makes up.
//! Coordinates: the top-left corner of the first pixel is (0, 0), so edges are 0.5 px more than boresight's. Points stay points.

use super::paths::{Paths, class, dropped, reach};
use super::xml::escaped;
use crate::tracks::Column;
use crate::{Error, ErrorKind, Result, TrackTable};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write;

/// From an edge counted from the centre of the first pixel to one counted from its corner, px.
const SHIFT_PX: f64 = 0.5;

/// Writes the annotations; the names of what they cannot hold are returned.
/// # Errors
/// A track that stands twice in a frame; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let paths = Paths::new(table)?;
    let labels: BTreeSet<String> = (0..table.n_rows()).map(|r| label(table, r)).collect();
    let [width, height] = table.size_px.map_or_else(|| reach(table), |s| s.map(u64::from));
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<annotations>\n  <version>1.1</version>\n");
    let size = table.n_frames();
    let _ = writeln!(
        xml,
        "  <meta>\n    <task>\n      <name>{}</name>\n      <size>{size}</size>\n      <mode>interpolation</mode>\n      <overlap>0</overlap>\n      \
         <start_frame>0</start_frame>\n      <stop_frame>{}</stop_frame>\n      <labels>",
        escaped(&table.label),
        size.saturating_sub(1)
    );
    for name in &labels {
        let _ = writeln!(xml, "        <label><name>{}</name><attributes></attributes></label>", escaped(name));
    }
    let _ = writeln!(
        xml,
        "      </labels>\n      <original_size><width>{width}</width><height>{height}</height></original_size>\n    </task>\n  </meta>"
    );
    let mut changes = false;
    for (t, rows) in paths.rows.iter().enumerate() {
        let Some(&first) = rows.first() else { continue };
        let name = label(table, first);
        changes |= rows.iter().any(|&r| label(table, r) != name);
        let _ = writeln!(xml, "  <track id=\"{}\" label=\"{}\" source=\"auto\">", table.ids[t], escaped(&name));
        for (k, &r) in rows.iter().enumerate() {
            let next = rows.get(k + 1).map_or(table.n_frames(), |&n| paths.frames[n] as usize);
            shape(&mut xml, table, r, paths.frames[r] as usize, false);
            let behind = paths.frames[r] as usize + 1;
            if behind < next {
                shape(&mut xml, table, r, behind, true);
            }
        }
        xml.push_str("  </track>\n");
    }
    xml.push_str("</annotations>\n");
    out.write_all(xml.as_bytes()).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let mut lost = dropped(table, &["class", "class names", "occlusion"]);
    if changes {
        lost.push("classes that change within a track (the first stays)".to_string());
    }
    if table.occlusion != Column::Constant(0) {
        lost.push("how far a box is hidden (only whether)".to_string());
    }
    Ok(lost)
}

fn shape(xml: &mut String, table: &TrackTable, r: usize, frame: usize, outside: bool) {
    let e = table.extent(r);
    let (left, top) = (e.left_px + SHIFT_PX, e.top_px + SHIFT_PX);
    let occluded = u8::from(table.occlusion.get(r) > 0);
    let common = format!("frame=\"{frame}\" keyframe=\"1\" outside=\"{}\" occluded=\"{occluded}\"", u8::from(outside));
    let _ = if table.is_points {
        writeln!(xml, "    <points {common} points=\"{left},{top}\" z_order=\"0\"></points>")
    } else {
        let (right, bottom) = (left + e.width_px, top + e.height_px);
        writeln!(
            xml,
            "    <box {common} xtl=\"{left}\" ytl=\"{top}\" xbr=\"{right}\" ybr=\"{bottom}\" z_order=\"0\"></box>"
        )
    };
}

/// The name of a row's class; a table without classes has objects.
fn label(table: &TrackTable, r: usize) -> String {
    if table.class == Column::Constant(1) && table.class_names.is_empty() {
        return "object".to_string();
    }
    class(table, r)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    #[test]
    fn a_pause_is_outside_and_the_first_pixel_begins_at_zero() {
        let row = |frame| TrackRow { frame, id: 3, bbox: [1.0, 1.0, 4.0, 6.0], ..TrackRow::default() };
        let table = TrackTable::from_rows("a<b", PixelOrigin::Pixel1, [row(0), row(3)]).unwrap();
        let mut out = Vec::new();
        assert!(write(&table, &mut out).unwrap().is_empty());
        let text = String::from_utf8(out).unwrap();
        let boxes: Vec<&str> = text.lines().filter(|l| l.contains("<box")).collect();
        assert_eq!(boxes.len(), 3, "{text}");
        assert!(boxes[0].contains("xtl=\"0\" ytl=\"0\" xbr=\"4\" ybr=\"6\"") && text.contains("a&lt;b"), "{text}");
        assert!(boxes[1].contains("frame=\"1\" keyframe=\"1\" outside=\"1\""), "{text}");
    }
}
