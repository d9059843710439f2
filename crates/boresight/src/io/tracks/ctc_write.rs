//! Writes a Cell Tracking Challenge result: `res_track.txt` and one 16-bit label image a frame, `mask000.tif`.
//!
//! Source: as [`super::ctc`]. The format knows cells by their pixels: a box becomes the pixels whose centres lie in it, a
//! point a disc of 2 px radius; smaller ones are drawn over larger ones, and each keeps at least its centre pixel. A label
//! has no gaps in it: a track that was lost begins a new label, whose parent is the old one.
//! Limits: labels up to 65535; images up to 2²⁸ pixels.

use super::ctc::Lineage;
use super::parents::parents;
use crate::io::AtomicFolder;
use crate::io::tables::lost::lost;
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackTable};
use std::io::Write;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype::Gray16};

/// Radius of the disc that stands for a point, px.
const POINT_RADIUS_PX: f64 = 2.0;

/// What a Cell Tracking Challenge folder will hold of a table.
struct Plan {
    lineages: Vec<Lineage>,
    /// Label of each row.
    labels: Vec<u16>,
    split: usize,
    renamed: bool,
}

fn plan(table: &TrackTable) -> Result<Plan> {
    let in_place = table.ids.iter().all(|&id| (1..=65535).contains(&id));
    let mut next = if in_place { table.ids.last().map_or(1, |&id| id + 1) } else { 1 };
    let mut fresh = || {
        let label = u16::try_from(next).map_err(|_| {
            Error::new(ErrorKind::Unsupported, "more than 65535 labels, which 16-bit images cannot hold")
                .at(&table.label)
        });
        next += 1;
        label
    };
    let parent_of = parents(table);
    let mut open: Vec<Option<usize>> = vec![None; table.n_tracks()];
    let mut first: Vec<Option<u16>> = vec![None; table.n_tracks()];
    let mut p = Plan { lineages: Vec::new(), labels: vec![0; table.n_rows()], split: 0, renamed: !in_place };
    for frame in 0..table.n_frames() {
        let f = frame as u32;
        for r in table.rows(frame) {
            let t = table.tracks[r] as usize;
            let k = match open[t] {
                Some(k) if p.lineages[k].end + 1 == f => k,
                Some(k) if p.lineages[k].end == f => {
                    return Err(Error::new(
                        ErrorKind::Damaged,
                        format!(
                            "id {} stands twice in frame {frame}: expected each id at most once a frame",
                            table.ids[t]
                        ),
                    )
                    .at(&table.label));
                }
                before => {
                    let label = match before {
                        None if in_place => table.ids[t] as u16,
                        _ => fresh()?,
                    };
                    first[t].get_or_insert(label);
                    let parent = before.map_or(0, |k| p.lineages[k].label);
                    p.split += usize::from(before.is_some());
                    p.lineages.push(Lineage { label: label.into(), begin: f, end: f, parent });
                    open[t] = Some(p.lineages.len() - 1);
                    p.lineages.len() - 1
                }
            };
            p.lineages[k].end = f;
            p.labels[r] = p.lineages[k].label as u16;
        }
    }
    // The parents that the table itself names: a cell's first label comes from the last label of its parent.
    for (t, parent) in parent_of {
        let Some(last) = open[parent].map(|k| p.lineages[k].label) else { continue };
        if let Some(l) = p.lineages.iter_mut().find(|l| Some(l.label as u16) == first[t]) {
            l.parent = last;
        }
    }
    p.lineages.sort_unstable_by_key(|l| l.label);
    Ok(p)
}

/// Writes a folder, which appears whole (an earlier result in it goes then, other files stay); says what it cannot hold. `size_px` is the size of the images; without it they reach to the last row.
/// Without a folder nothing is written, only said.
/// # Errors
/// More than 65535 labels; an id twice in a frame; an image too large; files that cannot be written.
pub fn write_folder(table: &TrackTable, folder: Option<&Path>, size_px: Option<(usize, usize)>) -> Result<Vec<String>> {
    let mut table = std::borrow::Cow::Borrowed(table);
    if table.origin != PixelOrigin::Centre0 {
        table.to_mut().set_origin(PixelOrigin::Centre0);
    }
    let table = table.as_ref();
    let plan = plan(table)?;
    let (width, height) = size_px.unwrap_or_else(|| reach(table));
    if width == 0 || height == 0 || (width as u64).saturating_mul(height as u64) > 1 << 28 {
        return Err(Error::new(ErrorKind::Unsupported, format!("label images of {width} x {height} px"))
            .at(&table.label)
            .hint("give the size of the images, for instance --size 640x512"));
    }
    let failed = |place: &Path, e: Box<dyn std::error::Error + Send + Sync>| {
        Error::new(ErrorKind::Output, "cannot be written").at(place.display()).because(e)
    };
    let folder = folder.map(|folder| AtomicFolder::create(folder, is_result)).transpose()?;
    if let Some(folder) = &folder {
        let path = folder.part_path().join("res_track.txt");
        let lines: Vec<String> =
            plan.lineages.iter().map(|l| format!("{} {} {} {}\n", l.label, l.begin, l.end, l.parent)).collect();
        std::fs::write(&path, lines.concat()).map_err(|e| failed(&path, e.into()))?;
    }
    let mut image = vec![0_u16; width * height];
    let (mut n_hidden, mut n_outside) = (0, 0);
    for frame in 0..table.n_frames() {
        image.fill(0);
        let mut rows: Vec<usize> = table.rows(frame).collect();
        rows.sort_by(|&a, &b| (area(table, b)).total_cmp(&area(table, a)).then(a.cmp(&b)));
        let centre = |r: usize| centre_pixel(table, r, width, height);
        for &r in &rows {
            draw(table, r, plan.labels[r], &mut image, width, height);
        }
        // Whoever vanished under others gets its centre pixel back.
        let mut seen = vec![false; 1 << 16];
        image.iter().for_each(|&v| seen[v as usize] = true);
        for &r in rows.iter().filter(|&&r| !seen[plan.labels[r] as usize]) {
            match centre(r) {
                Some(at) => {
                    n_hidden += 1;
                    image[at] = plan.labels[r];
                }
                None => n_outside += 1,
            }
        }
        let Some(folder) = &folder else { continue };
        let path = folder.part_path().join(format!("mask{frame:03}.tif"));
        let file = std::fs::File::create(&path).map_err(|e| failed(&path, e.into()))?;
        let mut file = std::io::BufWriter::new(file);
        TiffEncoder::new(&mut file)
            .and_then(|mut e| e.write_image::<Gray16>(width as u32, height as u32, &image))
            .map_err(|e| failed(&path, e.into()))?;
        file.flush().map_err(|e| failed(&path, e.into()))?;
    }
    folder.map_or(Ok(()), AtomicFolder::finish)?;
    Ok(dropped(table, &plan, n_hidden, n_outside))
}

/// Whether a file has the name of a part of a result.
fn is_result(name: &str) -> bool {
    let number = name.strip_prefix("mask").and_then(|n| n.strip_suffix(".tif"));
    name == "res_track.txt" || number.is_some_and(|n| n.len() >= 3 && n.bytes().all(|b| b.is_ascii_digit()))
}

fn dropped(table: &TrackTable, plan: &Plan, n_hidden: usize, n_outside: usize) -> Vec<String> {
    let mut out = Vec::new();
    if table.is_points {
        out.push("positions between pixels (a point is a disc of 2 px radius)".to_string());
    } else if table.boxes.iter().any(|b| {
        let whole = [b[0] + 0.5, b[1] + 0.5, b[2], b[3]];
        whole.iter().any(|v| v.fract() != 0.0)
    }) {
        out.push("edges of boxes between pixels".to_string());
    }
    if plan.split > 0 {
        out.push(format!("gaps ({} tracks go on as a new label whose parent is the old one)", plan.split));
    }
    if plan.renamed {
        out.push("ids (labels count from 1 to 65535)".to_string());
    }
    if n_hidden > 0 {
        out.push(format!("overlaps ({n_hidden} rows lie under others and keep one pixel)"));
    }
    if n_outside > 0 {
        out.push(format!("{n_outside} rows outside of the images"));
    }
    out.extend(lost(table, &[]));
    out.extend(table.extra.iter().map(|e| e.0.clone()).filter(|n| n != "parent"));
    out
}

fn area(table: &TrackTable, r: usize) -> f64 {
    table.boxes[r][2] * table.boxes[r][3]
}

/// Width and height that hold all rows, px.
fn reach(table: &TrackTable) -> (usize, usize) {
    let margin = if table.is_points { POINT_RADIUS_PX } else { 0.0 };
    let most = |k: usize| table.boxes.iter().map(|b| b[k] + b[k + 2] + margin + 0.5).fold(1.0, f64::max);
    (most(0).ceil() as usize, most(1).ceil() as usize)
}

fn centre_pixel(table: &TrackTable, r: usize, width: usize, height: usize) -> Option<usize> {
    let b = table.boxes[r];
    let (x, y) = ((b[0] + b[2] / 2.0).round(), (b[1] + b[3] / 2.0).round());
    let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
    inside.then(|| y as usize * width + x as usize)
}

fn draw(table: &TrackTable, r: usize, label: u16, image: &mut [u16], width: usize, height: usize) {
    let [left, top, w, h] = table.boxes[r];
    let reach = if table.is_points { POINT_RADIUS_PX } else { 0.0 };
    // Pixels whose centres lie at or behind the left edge and before the right one.
    let span = |from: f64, to: f64, n: usize| {
        let first = from.ceil().clamp(0.0, n as f64) as usize;
        let end = if reach > 0.0 { to.floor() + 1.0 } else { to.ceil() };
        first..(end.clamp(0.0, n as f64) as usize).max(first)
    };
    for y in span(top - reach, top + h + reach, height) {
        for x in span(left - reach, left + w + reach, width) {
            let far = (x as f64 - left).hypot(y as f64 - top) > POINT_RADIUS_PX;
            if !(table.is_points && far) {
                image[y * width + x] = label;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ctc::CtcFolder;
    use super::*;
    use crate::TrackRow;

    fn row(frame: u32, id: i64, bbox: [f64; 4]) -> TrackRow {
        TrackRow { frame, id, bbox, ..TrackRow::default() }
    }

    #[test]
    fn boxes_on_whole_pixels_come_back_as_they_were() {
        let rows = [row(0, 7, [1.5, 2.5, 3.0, 4.0]), row(0, 9, [10.5, 0.5, 2.0, 2.0]), row(1, 7, [2.5, 2.5, 3.0, 4.0])];
        let table = TrackTable::from_rows("t", PixelOrigin::Centre0, rows).unwrap();
        let folder = tempfile::tempdir().unwrap();
        assert!(write_folder(&table, Some(folder.path()), None).unwrap().is_empty());
        let back = CtcFolder::open(folder.path()).unwrap().table("t", false).unwrap();
        assert_eq!((back.ids.as_slice(), &back.boxes), ([7_i64, 9].as_slice(), &table.boxes));
    }

    #[test]
    fn a_gap_begins_a_child_and_a_hidden_box_keeps_a_pixel() {
        let rows = [row(0, 1, [0.5, 0.5, 4.0, 4.0]), row(0, 2, [0.5, 0.5, 4.0, 4.0]), row(3, 1, [0.5, 0.5, 4.0, 4.0])];
        let table = TrackTable::from_rows("t", PixelOrigin::Centre0, rows).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let dropped = write_folder(&table, Some(folder.path()), Some((8, 8))).unwrap().join("; ");
        assert!(dropped.contains("gaps (1 tracks") && dropped.contains("1 rows lie under others"), "{dropped}");
        let ctc = CtcFolder::open(folder.path()).unwrap();
        assert_eq!(ctc.lineages[2], Lineage { label: 3, begin: 3, end: 3, parent: 1 });
        assert_eq!(ctc.table("t", true).unwrap().extra[0].1, ["", "", "1"]);
    }
}
