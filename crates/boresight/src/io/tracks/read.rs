//! Reads a table of tracks in any format into a [`TrackTable`].
//!
//! Coordinates stay as the file holds them; velocities, covariances, status and times become typed columns. Rows whose status is
//! tentative are left out unless wanted. A malformed row fails, a cut last line too: nobody is to be judged by half a table.

use super::ctc;
use super::format::Format;
use super::options::{BadRows, ReadOptions};
use super::rows::{Rows, has_place};
use crate::io::tables::Columns;
use crate::io::tables::Dialect;
use crate::io::tables::columns::Field;
use crate::io::tables::dialect::{kitti, mot, named};
use crate::io::tables::kind::Kind;
use crate::io::tables::table::Table;
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackTable, TrackTableBuilder};
use std::path::Path;

/// A table as read.
#[derive(Clone, Debug)]
pub struct TrackFile {
    /// The table.
    pub table: TrackTable,
    /// Its format.
    pub format: Format,
    /// Rows that were left out.
    pub bad: BadRows,
}

/// Finds the format of a file or folder by its look.
/// # Errors
/// A path that is not there; a look that is none of the formats'.
pub fn sniff(path: &Path) -> Result<Format> {
    if path.is_dir() {
        return if ctc::is_ctc(path) {
            Ok(Format::Ctc)
        } else {
            Err(Error::new(ErrorKind::Unsupported, "is a folder without man_track.txt or res_track.txt")
                .at(path.display())
                .hint("name the table itself, or write {seq} where the names of the sequences stand"))
        };
    }
    format_of(Table::open(path, &Columns::default())?.form.kind).map_err(|e| e.at(path.display()))
}

fn format_of(kind: Kind) -> Result<Format> {
    match kind {
        Kind::Named => Ok(Format::Named(Dialect::Plain)),
        Kind::Mot => Ok(Format::Mot),
        Kind::Kitti => Ok(Format::Kitti),
        Kind::Ab3dmot => {
            Err(Error::new(ErrorKind::Unsupported, "holds AB3DMOT's detections, which belong to no tracks yet")
                .hint("track them first: boresight track FILE"))
        }
    }
}

/// Reads a table in a given format, or in that of its look; `tentative` keeps rows whose status is tentative.
/// # Errors
/// A file that cannot be read or is no table of tracks; a malformed row (file, line, column, what was expected) unless such rows
/// are skipped.
pub fn read(path: &Path, format: Option<Format>, options: ReadOptions, tentative: bool) -> Result<TrackFile> {
    if format == Some(Format::Ctc) || format.is_none() && path.is_dir() {
        if format.is_none() {
            sniff(path)?;
        }
        let table = ctc::CtcFolder::open(path)?.table(path.display().to_string(), options.keep_extra)?;
        return Ok(TrackFile { table, format: Format::Ctc, bad: BadRows::default() });
    }
    if let Some(format) = format.filter(|f| Format::EXPORTS.contains(f)) {
        return Err(Error::new(ErrorKind::Unsupported, format!("{} is written, not read", format.name()))
            .at(path.display())
            .hint("keep the table it was made from"));
    }
    let source = match format {
        Some(Format::Mot | Format::MotTruth) => Table::open_as(path, Kind::Mot)?,
        Some(Format::Kitti) => Table::open_as(path, Kind::Kitti)?,
        Some(_) => Table::open_as(path, Kind::Named)?,
        None => Table::open(path, &Columns::default())?,
    };
    let format = match format {
        Some(format) => format,
        None => format_of(source.form.kind).map_err(|e| e.at(path.display()))?,
    };
    let n_bytes = std::fs::metadata(path).map_or(0, |meta| meta.len());
    let (table, bad) = read_rows(source, options, tentative, n_bytes)?;
    Ok(TrackFile { table, format, bad })
}

fn read_rows(mut source: Table, options: ReadOptions, tentative: bool, n_bytes: u64) -> Result<(TrackTable, BadRows)> {
    let kind = source.form.kind;
    let (label, layout) = (&source.form.label, &source.form.layout);
    let origin = match kind {
        Kind::Named => PixelOrigin::Centre0,
        Kind::Mot => PixelOrigin::Pixel1,
        Kind::Kitti | Kind::Ab3dmot => PixelOrigin::Pixel0,
    };
    let mut table = TrackTableBuilder::new(label.as_str(), origin);
    let (mut boxes, mut kept) = (true, Vec::new());
    match kind {
        Kind::Named => {
            if source.is_empty {
                return Err(Error::new(ErrorKind::Damaged, "is empty: expected a header with column names").at(label));
            }
            source.check_place()?;
            source.check_track()?;
            table.unit(named::unit(&source.form.header, layout).unwrap_or_default());
            boxes = layout.has(&[Field::Width, Field::Height])
                || layout.has(&[Field::Left, Field::Top, Field::Right, Field::Bottom]);
            let header = source.form.header.iter().enumerate();
            kept = header.filter(|(k, _)| options.keep_extra && !has_place(*k, &source)).map(|(k, _)| k).collect();
            kept.iter().for_each(|&k| table.add_extra(source.form.header[k].as_str()));
        }
        Kind::Mot => {
            // About 40 bytes a row; a wrong guess only costs a move.
            table.reserve((n_bytes / 48).min(1 << 24) as usize);
            mot::WORLD.iter().filter(|_| options.keep_extra).for_each(|n| table.add_extra(*n));
        }
        Kind::Kitti => kitti::EXTRA.iter().filter(|_| options.keep_extra).for_each(|e| table.add_extra(e.0)),
        // It has no tracks and is refused above.
        Kind::Ab3dmot => source.check_track()?,
    }
    let reader = Rows {
        tentative,
        keep_extra: options.keep_extra,
        first_frame: options.first_frame.unwrap_or(source.first_frame()),
        edge_shift_px: named::edge_shift_px(&source.form.header, layout),
        has_state: [Field::TimeS, Field::Status, Field::Detection, Field::Vx, Field::VarX]
            .into_iter()
            .any(|f| layout.column(f).is_some()),
        kept,
    };
    let mut bad = BadRows::default();
    while let Some(row) = source.next_row()? {
        let pushed = match kind {
            Kind::Named => reader.named(&row, &mut table, &mut bad),
            Kind::Mot => reader.mot(&row, &mut table),
            Kind::Kitti | Kind::Ab3dmot => reader.kitti(&row, &mut table),
        };
        pushed.or_else(|e| bad.note(options, e))?;
    }
    if !boxes {
        table.points();
    }
    let mut table = table.finish(0)?;
    if kind == Kind::Named && boxes && table.boxes.iter().all(|b| b[2] == 0.0 && b[3] == 0.0) {
        table.is_points = true;
    }
    // Columns that say "unknown" throughout are no loss to another format; the writers put them back.
    let unknown = |name: &str| match kind {
        Kind::Named | Kind::Ab3dmot => None,
        Kind::Mot => Some("-1"),
        Kind::Kitti => kitti::EXTRA.iter().position(|e| e.0 == name).map(|k| kitti::UNKNOWN[k]),
    };
    if kind == Kind::Mot && table.extra.iter().all(|(_, values)| values.iter().all(|v| v == "-1")) {
        table.extra.clear();
    } else if kind == Kind::Kitti {
        table.extra.retain(|(name, values)| values.iter().any(|v| !v.is_empty() && Some(v.as_str()) != unknown(name)));
    }
    Ok((table, bad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrackStatus;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), text).unwrap();
        f
    }

    fn of(path: &Path, format: Format, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
        read(path, Some(format), options, false).map(|f| (f.table, f.bad))
    }

    fn read_text(text: &str, options: ReadOptions) -> Result<(TrackTable, BadRows)> {
        read(file(text).path(), None, options, false).map(|f| (f.table, f.bad))
    }

    #[test]
    fn formats_are_known_by_their_look() {
        let f = tempfile::NamedTempFile::new().unwrap();
        let look = |text: &str| {
            std::fs::write(f.path(), text).unwrap();
            sniff(f.path())
        };
        assert_eq!(look("1,2,3,4,5,6,1,-1,-1,-1\n").unwrap(), Format::Mot);
        assert_eq!(look("0 1 Car 0 0 0 1 2 3 4\n").unwrap(), Format::Kitti);
        assert_eq!(look("frame,particle,x,y\n").unwrap(), Format::Named(Dialect::Plain));
        assert_eq!(look("").unwrap(), Format::Mot);
        assert_eq!(look("\u{feff}# by hand\nframe;particle;x;y\n").unwrap(), Format::Named(Dialect::Plain));
        assert_eq!(look("frame\tx\ty\n").unwrap(), Format::Named(Dialect::Plain), "no KITTI label");
        std::fs::write(f.path(), b"\xff\xfef\0").unwrap();
        assert!(sniff(f.path()).unwrap_err().to_string().contains("UTF-16"));
        assert!(look("<html>hello</html>").unwrap_err().to_string().contains("no table of tracks known here"));
    }

    #[test]
    fn what_is_written_is_read_back() {
        let f = file("2,5,10.25,20,30,40.5,0,8,0.25\n1,7,1,1,3,3,1,1,1\n");
        let (t, _) = of(f.path(), Format::Mot, ReadOptions::default()).unwrap();
        assert_eq!(
            (t.ids.as_slice(), t.n_frames(), t.class.get(1), t.visibility.get(1)),
            ([5, 7].as_slice(), 2, 8, 0.25)
        );
        let mut out = Vec::new();
        mot::write(&t, true, &mut out).unwrap();
        let again = file(std::str::from_utf8(&out).unwrap());
        let (mut u, _) = of(again.path(), Format::Mot, ReadOptions::default()).unwrap();
        u.label = t.label.clone();
        assert_eq!(t, u);
    }

    #[test]
    fn a_malformed_row_is_named_by_line_and_column_or_counted() {
        let f = file("1,1,1,1,5,5,1\n1,2,1,x,5,5,1\n");
        let e = of(f.path(), Format::Mot, ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 2: column 4: expected a top edge, found \"x\""), "{e}");
        let (t, bad) =
            of(f.path(), Format::Mot, ReadOptions { skip_bad_rows: true, ..ReadOptions::default() }).unwrap();
        assert_eq!((t.n_rows(), bad.count), (1, 1));
    }

    #[test]
    fn frame_zero_is_refused_with_the_likely_cause() {
        let f = file("0,1,1,1,5,5,1\n");
        assert!(of(f.path(), Format::Mot, ReadOptions::default()).unwrap_err().to_string().contains("column 1"));
    }

    #[test]
    fn world_coordinates_of_mot15_are_no_class() {
        let text = "1,1,1,1,5,5,1,3,14.2,0\n1,2,1,1,5,5,1,-1,-1,-1\n";
        let f = file(text);
        let (t, _) = of(f.path(), Format::Mot, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        let mut out = Vec::new();
        mot::write(&t, false, &mut out).unwrap();
        assert_eq!(std::str::from_utf8(&out).unwrap(), text);
        assert_eq!((t.class.get(0), t.class.get(1), t.visibility.get(0)), (1, 1, 1.0));
    }

    #[test]
    fn a_label_file_is_read_with_its_dont_care_regions() {
        let f = tempfile::NamedTempFile::new().unwrap();
        let text = "0 -1 DontCare -1 -1 -10 5 6 15 26 -1 -1 -1 -1 -1 -1 -1\n\
0 2 Van 1 2 0.5 10 20 30 60 1.5 1.6 3.7 1 2 3 0.1\n1 2 Van 0 0 0.5 11 20 30 60 1.5 1.6 3.7 1 2 3 0.1 0.9\n";
        std::fs::write(f.path(), text).unwrap();
        let (t, _) = of(f.path(), Format::Kitti, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!(t.ignore, [(0, [5.0, 6.0, 10.0, 20.0])]);
        assert_eq!(
            (t.boxes[0], t.class.get(0), t.occlusion.get(0), t.score.get(1)),
            ([10.0, 20.0, 20.0, 40.0], 2, 2, 0.9)
        );
        let mut out = Vec::new();
        assert!(kitti::write(&t, &mut out).unwrap().is_empty());
        std::fs::write(f.path(), &out).unwrap();
        let (u, _) = of(f.path(), Format::Kitti, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!(t, u);
    }

    #[test]
    fn an_unknown_type_is_named() {
        let f = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(f.path(), "0 1 Bus 0 0 0 1 2 3 4\n").unwrap();
        let e = of(f.path(), Format::Kitti, ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 1: column 3: expected a KITTI type (Car, Pedestrian ..), found \"Bus\""), "{e}");
    }

    #[test]
    fn the_tables_of_four_programs_give_the_same_points() {
        let trackpy = "frame,particle,x,y,mass\n0,3,1.5,2.5,9\n2,3,4,5,9\n";
        let btrack = "ID,t,y,x\n3.0,0.0,2.5,1.5\n3.0,2.0,5,4\n";
        let ultrack = "track_id,t,z,y,x\n3,0,0,2.5,1.5\n3,2,0,5,4\n";
        let trackmate = "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,FRAME\nLabel,Spot ID,Track ID,Quality,X,Y,Frame\n\
Label,Spot ID,Track ID,Quality,X,Y,Frame\n,,,(quality),(pixel),(pixel),\nID1,1,3,1,1.5,2.5,0\nID2,2,,1,9,9,0\nID3,3,3,1,4,5,2\n";
        for text in [trackpy, btrack, ultrack, trackmate] {
            let (t, _) = read_text(text, ReadOptions::default()).unwrap();
            assert_eq!(t.ids, [3], "{text}");
            assert_eq!(t.boxes, [[1.5, 2.5, 0.0, 0.0], [4.0, 5.0, 0.0, 0.0]], "{text}");
            assert!(t.is_points && t.n_frames() == 3);
        }
    }

    #[test]
    fn boresights_own_table_gives_boxes_around_the_state_and_leaves_tentative_rows() {
        let text = "frame,time_s,track_id,status,x_px,y_px,width_px,height_px\n4,0.1,1,confirmed,10,20,4,6\n4,0.1,2,tentative,0,0,1,1\n";
        let (t, _) = read_text(text, ReadOptions { keep_extra: true, ..ReadOptions::default() }).unwrap();
        assert_eq!((t.boxes.as_slice(), t.n_frames()), ([[8.0, 17.0, 4.0, 6.0]].as_slice(), 5));
        assert_eq!(t.extra[0], ("time_s".to_string(), vec!["0.1".to_string()]));
    }

    #[test]
    fn a_box_is_the_same_by_its_size_its_corners_or_its_centre() {
        for text in [
            "frame,id,left,top,width,height\n0,3,10,20,4,6\n",
            "# corners\nframe,id,x1,y1,x2,y2\n0,3,10,20,14,26\n",
            "frame,id,left_px,top_px,width_px,height_px\n0,3,9.5,19.5,4,6\n",
            "frame,id,x,y,w,h\n# centre\n0,3,11.5,22.5,4,6,\n",
        ] {
            let (t, _) = read_text(text, ReadOptions::default()).unwrap();
            assert_eq!((t.boxes.as_slice(), t.is_points), ([[9.5, 19.5, 4.0, 6.0]].as_slice(), false), "{text}");
        }
    }

    #[test]
    fn a_row_that_says_more_than_its_header_is_refused() {
        let e = read_text("frame,id,x,y\n0,3,1,5,2,5\n", ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("line 2") && e.contains("decimal commas"), "{e}");
    }

    #[test]
    fn a_header_without_a_position_is_refused_by_name() {
        let e = read_text("frame,track_id,mass\n0,1,2\n", ReadOptions::default()).unwrap_err().to_string();
        assert!(e.contains("no column says where") && e.contains("frame, track_id, mass"), "{e}");
    }

    #[test]
    fn classes_may_go_by_name_and_rows_without_a_track_are_counted() {
        let text =
            "frame,bb_left,bb_top,bb_width,bb_height,class,id\n1,3,4,6,5,DRONE,1\n1,3,4,6,5,BIRD,2\n2,3,4,6,5,DRONE,\n";
        let (t, bad) = read_text(text, ReadOptions::default()).unwrap();
        assert_eq!(
            (t.class.get(0), t.class.get(1), t.class_names.as_slice()),
            (1, 2, ["DRONE", "BIRD"].map(String::from).as_slice())
        );
        assert_eq!((t.n_rows(), bad.without_track, bad.count), (2, 1, 0));
        let mut out = Vec::new();
        crate::io::tracks::write(&t, Format::Named(Dialect::Plain), &mut out).unwrap();
        assert!(String::from_utf8_lossy(&out).contains(",BIRD\n"));
        let lost = crate::io::tracks::write(&t, Format::MotTruth, &mut Vec::new()).unwrap();
        assert_eq!(lost, ["class names"]);
    }

    #[test]
    fn states_come_as_typed_columns() {
        let header = crate::io::tables::TRACKS_HEADER;
        let text = format!(
            "{header}\n7,0.5,3,coasting,1,2,3,4,1,0,0.5,0,2,0,0,3,0,4,6,8,\n8,0.6,3,confirmed,1,2,3,4,1,0,0,0,2,0,0,3,0,4,6,8,5\n"
        );
        let (t, _) = read_text(&text, ReadOptions::default()).unwrap();
        let state = t.state(0);
        assert_eq!(
            (state.velocity, state.status, state.detection),
            (Some([3.0, 4.0]), Some(TrackStatus::Coasting), None)
        );
        assert_eq!(state.time.map(|t| t.ns), Some(500_000_000));
        assert_eq!(t.position_cov(0).map(|p| p[(0, 1)]), Some(0.5));
        assert_eq!((t.is_measured(0), t.is_measured(1), t.state(1).detection), (Some(false), Some(true), Some(5)));
    }

    #[test]
    fn results_in_kitti_labels_have_boxes_ids_and_scores_and_detections_are_no_tracks() {
        let text = "0 3 Car 0 0 1.5 10 20 30 60 1.5 1.6 3.7 1 2 30 0.1 7.5\n1 3 Car 0 0 1.5 11 20 31 60 1.5 1.6 3.7 1 2 30 0.1 7.25\n";
        let read = read_text(text, ReadOptions::default()).unwrap().0;
        assert_eq!((read.boxes[1], read.ids[0], read.score.get(1)), ([11.0, 20.0, 20.0, 40.0], 3, 7.25));
        assert_eq!(read.n_frames(), 2, "frames count from 0");
        let detections = "0,2,10,20,30,60,7.5,1.5,1.6,3.7,1,2,30,0.1,1.5\n";
        let error = read_text(detections, ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("no tracks yet") && error.contains("boresight track"), "{error}");
    }
}
