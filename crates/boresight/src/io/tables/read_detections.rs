//! Detections from elsewhere: our `detections.csv`, MOTChallenge text, any table with named columns, or a radar's range and azimuth.
//!
//! Rows may come in any order; rows of one frame keep theirs. Frames without rows between the first and the last one become
//! empty scans with times in between. Times come from the table unless a rate is given.

use super::columns::Field;
use super::detection_row::RowReader;
use super::detection_table::DetectionTable;
use super::dialect::named;
use super::options::TableOptions;
use super::radar::read::{radar_columns, read_radar};
use super::scan_times::{Grouped, scans_of, set_times};
use super::table::Table;
use crate::{Error, ErrorKind, Result, shown_rate};
use std::path::Path;

/// Reads detections from a table.
/// # Errors
/// A file that cannot be read, columns that are missing, or (unless `skip_bad_rows`) a bad row, with its line and column.
pub fn read_detections(path: impl AsRef<Path>, options: &TableOptions) -> Result<DetectionTable> {
    options.validate("table")?;
    let path = path.as_ref();
    let mut table = Table::open(path, &options.columns)?;
    if let Some(columns) = radar_columns(&table)? {
        return read_radar(&mut table, &columns, path, options);
    }
    detections_of(&mut table, options, super::seqinfo::SequenceInfo::beside(path).rate_hz)
}

fn detections_of(table: &mut Table, options: &TableOptions, rate_beside: Option<f64>) -> Result<DetectionTable> {
    Ok(identified_of(table, options, rate_beside, false)?.0)
}

/// Reads the rows as detections, with the identity of each in the order of the scans; `identified` leaves out rows that
/// belong to no track (an empty or negative identity).
pub(crate) fn identified_of(
    table: &mut Table,
    options: &TableOptions,
    rate_beside: Option<f64>,
    identified: bool,
) -> Result<(DetectionTable, Vec<u64>)> {
    if table.is_empty {
        return Err(Error::new(ErrorKind::Damaged, "the table is empty").at(&table.form.label));
    }
    table.check_place()?;
    let reader = RowReader::new(&table.form, table.first_frame(), options);
    let mut out = DetectionTable {
        scans: Vec::new(),
        rate_hz: 0.0,
        first_frame: options.first_frame.unwrap_or_else(|| table.first_frame()),
        unit: options.unit.or(named::unit(&table.form.header, &table.form.layout)).unwrap_or_default(),
        format: RowReader::format(&table.form),
        class_names: Vec::new(),
        n_rows: 0,
        n_skipped: 0,
        warnings: Vec::new(),
        lost: Vec::new(),
        radar: None,
    };
    let mut seen = Vec::new();
    let (mut n_loose, mut n_weak) = (0, 0);
    let least_score = options.min_score.unwrap_or(f32::NEG_INFINITY);
    while let Some(row) = table.next_row()? {
        out.n_rows += 1;
        if identified && row.id().is_ok_and(|id| id.is_none_or(|id| id < 0)) {
            n_loose += 1;
            continue;
        }
        match reader.read(&row, identified, &mut out.class_names) {
            Ok(Some(one)) if one.detection.score < least_score => n_weak += 1,
            Ok(one) => seen.extend(one),
            Err(_) if options.skip_bad_rows => out.n_skipped += 1,
            // A run that was cut off leaves a last line without an end.
            Err(e) if row.line.cut && !seen.is_empty() => {
                out.n_skipped += 1;
                out.lost.push(format!("The table breaks off in its last line, 1 row is lost: {e}."));
            }
            Err(e) => return Err(e.hint("mend the row, or leave such rows out with --skip-bad-rows")),
        }
    }
    let (label, layout) = (&table.form.label, &table.form.layout);
    if out.n_skipped > 0 && options.skip_bad_rows {
        out.lost.push(format!("{label}: {} of {} rows were bad and left out.", out.n_skipped, out.n_rows));
    }
    if n_weak > 0 {
        out.warnings.push(format!(
            "{label}: {n_weak} of {} rows have a score below {least_score} and were left out.",
            out.n_rows
        ));
    }
    if seen.is_empty() && out.n_skipped > 0 {
        return Err(Error::new(ErrorKind::Damaged, format!("none of its {} rows can be read", out.n_rows)).at(label));
    }
    if let Some(unit) = table.unit.as_ref().filter(|_| options.unit.is_none()) {
        out.warnings.push(format!(
            "{}: positions are in {unit}, and were taken as pixels: export them in pixels, or read all results in {unit}.",
            label
        ));
    }
    if n_loose > 0 {
        out.lost.push(format!("{}: {n_loose} rows belong to no track and were left out.", label));
    }
    out.warnings.extend_from_slice(&out.lost);
    seen.sort_by_key(|s| s.frame);
    let ids = seen.iter().map(|s| s.id.unwrap_or_default().unsigned_abs()).collect();
    let Grouped { mut scans, times, warning } = scans_of(label, seen)?;
    out.warnings.extend(warning);
    let rate = set_times(&mut scans, &times, label, options, rate_beside)?;
    (out.scans, out.rate_hz) = (scans, rate.rate_hz);
    if rate.is_assumed {
        out.warnings.push(format!("{} says nothing of time: {} frames/s were taken.", label, shown_rate(rate.rate_hz)));
    }
    if !layout.has(&[Field::VarX]) && !layout.has(&[Field::StdX]) && !out.scans.is_empty() {
        out.warnings.push(format!(
            "{} has no position errors: a standard deviation of {} {} was taken.",
            label,
            options.std_px,
            out.unit.sign()
        ));
    }
    Ok((out, ids))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{DetectionsCsv, Output};
    use crate::{Detection, Extent, FrameIndex, Scan, Sink, Timestamp, View};
    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;

    fn read(text: &str, options: &TableOptions) -> Result<DetectionTable> {
        detections_of(&mut Table::of_text("t.csv", text.as_bytes(), &options.columns)?, options, None)
    }

    fn plain(text: &str) -> DetectionTable {
        read(text, &TableOptions::default()).unwrap()
    }

    #[test]
    fn a_mot_box_of_the_first_pixel_lies_around_the_origin() {
        let table = plain("1,-1,1,1,1,1,0.5,-1,-1,-1\n3,-1,11,21,4,2,7\n");
        assert_eq!(table.scans.len(), 3);
        assert_eq!(table.scans[0].index, FrameIndex(0));
        assert_eq!(table.scans[0].detections[0].position, Vector2::new(0.0, 0.0));
        assert!(table.scans[1].detections.is_empty());
        let d = &table.scans[2].detections[0];
        assert_eq!((d.position, d.score, d.area_px), (Vector2::new(11.5, 20.5), 7.0, 8));
    }

    #[test]
    fn a_zero_based_box_covers_whole_pixels_and_a_one_based_one_too() {
        let d = |text, first_pixel| {
            read(text, &TableOptions { first_pixel, ..TableOptions::default() }).unwrap().scans[0].detections[0].clone()
        };
        let zero = d("frame,bb_left,bb_top,bb_width,bb_height\n0,64,153,9,9\n", 0.0);
        assert_eq!(zero.position, Vector2::new(68.0, 157.0)); // pixels 64..=72
        let one = d("frame,xmin,ymin,xmax,ymax\n0,65,154,74,163\n", 1.0);
        assert_eq!(one.extent, zero.extent);
    }

    #[test]
    fn a_table_in_micrometres_is_said_to_be_one() {
        let of = |unit: &str| {
            format!(
                "LABEL,TRACK_ID,POSITION_X,POSITION_Y,FRAME\nLabel,Track ID,X,Y,Frame\nLabel,Track ID,X,Y,Frame\n,,({unit}),({unit}),\nID1,0,1.5,2,0\n"
            )
        };
        assert!(plain(&of("micron")).warnings.iter().any(|w| w.contains("in micron")));
        assert!(!plain(&of("pixel")).warnings.iter().any(|w| w.contains("positions are")));
    }

    #[test]
    fn kitti_labels_and_detections_as_ab3dmot_has_them_are_boxes_from_frame_0() {
        // The same box: corners (10, 20) and (30, 60), whose first pixel is 10, 20.
        let labels = "0 0 Car 0 0 1.5 10 20 30 60 1.5 1.6 3.7 1 2 30 0.1\n2 0 Car 0 0 1.5 10 20 30 60 1.5 1.6 3.7 1 2 30 0.1\n\
2 -1 DontCare -1 -1 -10 5 6 15 26 -1000 -1000 -1000 -10 -1 -1 -1\n";
        let results = labels.replace(" 0.1\n", " 0.1 7.5\n");
        let detections =
            "0,2,10,20,30,60,7.5,1.5,1.6,3.7,1,2,30,0.1,1.5\n2,2,10,20,30,60,7.5,1.5,1.6,3.7,1,2,30,0.1,1.5\n";
        for (text, score) in [(labels, 1.0), (&results, 7.5), (detections, 7.5)] {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), text).unwrap();
            let table = read_detections(file.path(), &TableOptions::default()).unwrap();
            assert_eq!((table.scans.len(), table.first_frame), (3, 0), "{text}");
            let [one] = &table.scans[2].detections[..] else { panic!("{text}") };
            let e = one.extent;
            assert_eq!([e.left_px, e.top_px, e.width_px, e.height_px], [9.5, 19.5, 20.0, 40.0], "{text}");
            assert_eq!(one.score, score, "{text}");
        }
    }

    #[test]
    fn a_mot_table_counted_from_zero_is_named_as_one_and_read_when_told_so() {
        let text = "0,-1,1,1,1,1,0.5,-1,-1,-1\n1,-1,11,21,4,2,7\n";
        let error = read(text, &TableOptions::default()).unwrap_err().to_string();
        assert!(error.contains("line 1") && error.contains("first-frame=0"), "{error}");
        let told = TableOptions { first_frame: Some(0), ..TableOptions::default() };
        assert_eq!(read(text, &told).unwrap().scans.len(), 2);
    }

    #[test]
    fn holes_get_times_in_between_and_backward_times_are_refused() {
        let table = plain("frame,time_s,x,y\n4,1.0,0,0\n1,0.1,0,0\n2,0.4,5,5\n2,0.4,6,6\n");
        let times: Vec<i64> = table.scans.iter().map(|s| s.time.ns / 1_000_000).collect();
        assert_eq!(times, [100, 400, 700, 1000]);
        assert_eq!(table.scans[1].detections[1].position.x, 6.0);
        assert!(read("frame,time_s,x,y\n0,1,0,0\n1,0.5,0,0\n", &TableOptions::default()).is_err());
        let given = TableOptions { rate_hz: Some(10.0), ..TableOptions::default() };
        assert_eq!(read("frame,time_s,x,y\n0,1,0,0\n1,0.5,0,0\n", &given).unwrap().scans[1].time.ns, 100_000_000);
    }

    #[test]
    fn rows_of_one_frame_that_state_different_times_are_said() {
        let table = plain("frame,time_s,x,y\n0,0,1,1\n0,0.5,2,2\n1,1,1,1\n1,1,2,2\n");
        assert!(table.warnings[0].contains("1 rows state another time") && table.warnings[0].contains("0 s and 0.5 s"));
        assert_eq!(table.scans[0].time.ns, 0);
    }

    #[test]
    fn bad_rows_are_errors_with_their_place_or_counted() {
        for (row, word) in [
            ("1,nan,2", "column x"),
            ("1,inf,2", "column x"),
            ("-1,1,2", "column frame"),
            ("1.5,1,2", "column frame"),
            ("1,1", "2 fields"),
            ("1,one,2", "\"one\""),
        ] {
            let text = format!("frame,x,y\n0,1,1\n{row}\n2,3,3\n");
            let error = read(&text, &TableOptions::default()).unwrap_err().to_string();
            assert!(error.contains("line 3") && error.contains(word), "{error}");
            let skip = TableOptions { skip_bad_rows: true, ..TableOptions::default() };
            let table = read(&text, &skip).unwrap();
            assert_eq!((table.n_rows, table.n_skipped, table.scans.len()), (3, 1, 3));
        }
        let far = read("frame,x,y\n0,1,1\n999999999999,1,1\n", &TableOptions::default());
        assert!(far.unwrap_err().to_string().contains("hole"));
        let wild = read("frame,x,y,time_ns\n0,1,1,0\n1,1,1,1e30\n", &TableOptions::default());
        assert!(
            wild.unwrap_err().to_string().contains("column time_ns: expected a time within 292 years, found \"1e30\"")
        );
    }

    #[test]
    fn many_holes_are_refused_before_they_take_the_memory() {
        let rows: String = (0..100).map(|k| format!("{},1,1\n", k * 150_000)).collect();
        let error = read(&format!("frame,x,y\n{rows}"), &TableOptions::default()).unwrap_err().to_string();
        assert!(error.contains("frame 450000 follows frame 300000") && error.contains("400000 in all"), "{error}");
    }

    #[test]
    fn a_last_line_that_breaks_off_is_left_out_with_a_warning() {
        let table = plain("frame,x,y\n0,1,1\n1,2");
        assert_eq!(table.scans.len(), 1);
        assert!(table.warnings[0].contains("1 row is lost"));
    }

    #[test]
    fn a_covariance_that_is_none_is_refused_and_a_missing_one_is_said() {
        assert!(read("frame,x,y,var_x,cov_xy,var_y\n0,1,1,1,2,1\n", &TableOptions::default()).is_err());
        let table = plain("frame,x,y,ep\n0,1,1,0.5\n1,1,1,nan\n");
        assert_eq!(table.scans[0].detections[0].cov, Matrix2::new(0.25, 0.0, 0.0, 0.25));
        assert_eq!(table.scans[1].detections[0].cov, Matrix2::identity());
        assert!(plain("frame,x,y\n0,1,1\n").warnings.iter().any(|w| w.contains("standard deviation of 1 px")));
    }

    #[test]
    fn what_a_table_does_not_say_is_taken_as_the_options_say() {
        let first = |text: &str, options: &TableOptions| read(text, options).unwrap().scans[0].detections[0].clone();
        let usual = TableOptions::default();
        let d = first("frame,x,y\n0,10,20\n", &usual);
        assert_eq!(d.extent, Extent { left_px: 7.5, top_px: 17.5, width_px: 5.0, height_px: 5.0 });
        assert_eq!((d.area_px, d.peak, d.sum, d.score, d.class), (25, 0.0, 0.0, 1.0, None));
        assert_eq!(d.cov, Matrix2::identity());
        let d = first("frame,x,y,area\n0,10,20,16\n", &usual);
        assert_eq!((d.extent.left_px, d.extent.width_px, d.area_px), (8.0, 4.0, 16));
        let d = first("frame,left,top,width,height\n0,10,20,0.1,0.1\n", &usual);
        assert_eq!(d.area_px, 1, "no detection is smaller than a pixel");
        let d = first("frame,x,y,w,h\n0,10,20,-1,-1\n", &usual);
        assert_eq!(d.extent.width_px, 5.0, "a size below 0 stands for none");
        let shares = TableOptions { std_per_side: 0.1, ..usual.clone() };
        let d = first("frame,left,top,width,height\n0,10,20,30,4\n", &shares);
        assert_eq!((d.cov[(0, 0)], d.cov[(1, 1)]), (9.0, 1.0), "the larger of the two");
        let d = first("frame,x,y,ep\n0,10,20,-1\n", &usual);
        assert_eq!(d.cov[(0, 0)], 1.0, "trackpy's unknown error");
        let d = first("frame,x,y,std_x,std_y\n0,10,20,2,3\n", &usual);
        assert_eq!((d.cov[(0, 0)], d.cov[(0, 1)], d.cov[(1, 1)]), (4.0, 0.0, 9.0));
        let table = plain("frame,x,y\n2,1,1\n");
        assert_eq!((table.rate_hz, table.scans[0].time.ns), (25.0, 80_000_000));
        assert!(table.warnings.iter().any(|w| w.contains("25 frames/s were taken")));
        let slow = TableOptions { assumed_rate_hz: 10.0, ..usual.clone() };
        assert_eq!(read("frame,x,y\n2,1,1\n", &slow).unwrap().scans[0].time.ns, 200_000_000);
        assert_eq!(read("frame,x,y,time_s\n2,1,1,0.5\n", &slow).unwrap().scans[0].time.ns, 500_000_000);
    }

    #[test]
    fn options_out_of_range_are_refused_by_name() {
        let of = |change: fn(&mut TableOptions)| {
            let mut options = TableOptions::default();
            change(&mut options);
            options.validate("table").map_err(|e| e.to_string())
        };
        assert!(of(|_| {}).is_ok());
        for (change, name) in [
            ((|o| o.rate_hz = Some(0.0)) as fn(&mut TableOptions), "table.rate-hz"),
            (|o| o.rate_hz = Some(f64::INFINITY), "table.rate-hz"),
            (|o| o.std_px = 0.0, "table.std-px"),
            (|o| o.std_px = f64::NAN, "table.std-px"),
            (|o| o.std_per_side = 1.01, "table.std-per-side"),
            (|o| o.std_per_side = -0.01, "table.std-per-side"),
            (|o| o.box_px = -1.0, "table.box-px"),
            (|o| o.first_pixel = f64::NAN, "table.first-pixel"),
        ] {
            assert!(of(change).unwrap_err().contains(name), "{name}");
        }
        assert!(of(|o| (o.box_px, o.std_per_side, o.first_pixel) = (0.0, 1.0, 1.0)).is_ok());
    }

    fn detection() -> impl Strategy<Value = Detection> {
        let n = || -1e6..1e6f64;
        let one = (n(), n(), 1e-9..1e3f64, 1e-9..1e3f64, -0.99..0.99f64, 0.0..1e4f64, 1u32..100, any::<f32>(), n());
        (one, 0..10_000_000_000u64).prop_map(|((x, y, vx, vy, rho, size, area_px, peak, sum), age_ns)| {
            let xy = rho * (vx * vy).sqrt();
            let peak = if peak.is_finite() { peak } else { 0.0 };
            Detection::at(Vector2::new(x, y), Matrix2::new(vx, xy, xy, vy))
                .with_extent(Extent { left_px: x - 0.3, top_px: y - 0.7, width_px: size, height_px: size / 3.0 })
                .with_area_px(area_px)
                .with_peak(peak)
                .with_sum(sum)
                .with_score(peak)
                .with_age_ns(age_ns)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn our_own_table_comes_back_to_the_last_bit(
            scans in proptest::collection::vec(proptest::collection::vec(detection(), 1..4), 1..5), step in 1i64..1_000_000_000_000
        ) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("detections.csv");
            let mut sink = Box::new(DetectionsCsv::to(Output::file(&path).unwrap()).unwrap().with_ages(true));
            let scans: Vec<Scan> = scans
                .into_iter()
                .enumerate()
                .map(|(i, detections)| {
                    Scan::at(FrameIndex(i as u64), Timestamp::from_ns(i as i64 * step)).with_detections(detections)
                })
                .collect();
            for scan in &scans {
                sink.put(&View { frame: None, scan, tracks: &[] }).unwrap();
            }
            sink.finish().unwrap();
            let table = read_detections(&path, &TableOptions::default()).unwrap();
            prop_assert_eq!(&table.scans, &scans);
            prop_assert_eq!(table.format, "boresight detections");
        }

        #[test]
        fn any_text_is_read_or_refused_without_panic(text in "[-0-9a-z,;. \t\n\"#é]{0,200}") {
            let _ = read(&text, &TableOptions::default());
            let _ = read(&format!("frame,x,y,left,top,width,height,time\n{text}"), &TableOptions::default());
        }
    }
}
