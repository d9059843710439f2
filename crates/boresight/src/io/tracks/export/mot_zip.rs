//! The archive of MOT that CVAT and Datumaro take: `gt/gt.txt` (MOTChallenge, counted from 1) and `gt/labels.txt`, a name of a class a line.
//!
//! Source: CVAT, *MOT format*. The classes of the table are renumbered from 1 in the order of the names.

use super::paths::{class, dropped};
use super::zip::archive;
use crate::io::tables::dialect::mot;
use crate::tracks::Column;
use crate::{Error, ErrorKind, Result, TrackTable};
use std::collections::BTreeSet;
use std::io::Write;

/// Writes the archive; the names of what it cannot hold are returned.
/// # Errors
/// More than 4 GiB; what the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut impl Write) -> Result<Vec<String>> {
    let names: Vec<String> =
        (0..table.n_rows()).map(|r| label(table, r)).collect::<BTreeSet<_>>().into_iter().collect();
    let mut numbered = table.clone();
    // In the archive the seventh column says whether the row counts.
    numbered.score = Column::Constant(1.0);
    let number = |r| names.binary_search(&label(table, r)).map_or(1, |k| k as i32 + 1);
    numbered.class = Column::Values((0..table.n_rows()).map(number).collect());
    let mut rows = Vec::new();
    mot::write(&numbered, true, &mut rows)?;
    let labels: String = names.iter().map(|n| format!("{n}\n")).collect();
    let bytes = archive(&[("gt/gt.txt", &rows), ("gt/labels.txt", labels.as_bytes())])?;
    out.write_all(&bytes).map_err(|e| Error::new(ErrorKind::Output, "cannot be written").because(e))?;
    let mut lost = dropped(table, &["class", "class names", "visibility"]);
    if table.is_points {
        lost.push("that rows are points (they become boxes without size)".to_string());
    }
    Ok(lost)
}

/// The name of a row's class; a table without classes has objects. An end of line would end the name.
fn label(table: &TrackTable, r: usize) -> String {
    if table.class == Column::Constant(1) && table.class_names.is_empty() {
        return "object".to_string();
    }
    class(table, r).replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow};

    #[test]
    fn rows_count_and_carry_the_number_of_their_label() {
        let row = |frame, class| TrackRow {
            frame,
            id: 3,
            bbox: [1.0, 1.0, 4.0, 6.0],
            score: 0.5,
            class,
            ..TrackRow::default()
        };
        let table = TrackTable::from_rows("t", PixelOrigin::Pixel1, [row(0, 7), row(1, 5)]).unwrap();
        let mut out = Vec::new();
        assert_eq!(write(&table, &mut out).unwrap(), ["score"]);
        let text = String::from_utf8_lossy(&out);
        assert!(text.contains("1,3,1,1,4,6,1,2,1\n2,3,1,1,4,6,1,1,1\n") && text.contains("5\n7\n"), "{text}");
    }
}
