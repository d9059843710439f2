//! Detections from elsewhere: our `detections.csv`, MOTChallenge text, or any table with named columns.
//!
//! Boxes: in MOTChallenge text the first pixel is 1; in our tables `left_px` is the pixel's edge; in all other tables
//! `left` is taken as the number of the first pixel, from 0. Rows may come in any order; rows of one frame keep theirs.
//! Frames without rows between the first and the last one become empty scans with times in between. Times come from the
//! table unless a rate is given.

use super::columns::{Field, Layout};
use super::mot::extent_of_mot_box;
use super::number::parse_seconds;
use super::options::TableOptions;
use super::rows::{Kind, MAX_GAP_FRAMES, Row, Table};
use crate::{ClassId, Detection, Error, ErrorKind, Extent, FrameIndex, Result, Scan, Timestamp};
use nalgebra::{Matrix2, Vector2};
use std::path::Path;

/// Detections read from a table.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionTable {
    /// One scan for each frame from the first to the last, empty ones included.
    pub scans: Vec<Scan>,
    /// Rate, frames/s: given, or found from the times.
    pub rate_hz: f64,
    /// What kind of table it was, for the summary: `boresight detections`, `MOTChallenge`, `CSV (frame, x, y)`.
    pub format: String,
    /// Names of the classes, by [`ClassId`], if the table has names instead of numbers.
    pub class_names: Vec<String>,
    /// Number of rows read.
    pub n_rows: u64,
    /// Number of rows left out.
    pub n_skipped: u64,
    /// Whole sentences about what was assumed or left out.
    pub warnings: Vec<String>,
}

/// Reads detections from a table.
/// # Errors
/// A file that cannot be read, columns that are missing, or (unless `skip_bad_rows`) a bad row, with its line and column.
pub fn read_detections(path: impl AsRef<Path>, options: &TableOptions) -> Result<DetectionTable> {
    options.validate("table")?;
    let path = path.as_ref();
    let table = Table::open(path, &options.columns)?;
    detections_of(&table, options, super::seqinfo::rate_beside(path))
}

/// A row's frame, time, identity and detection.
struct Seen {
    frame: u64,
    id: u64,
    time: Option<Timestamp>,
    detection: Detection,
}

fn detections_of(table: &Table, options: &TableOptions, rate_beside: Option<f64>) -> Result<DetectionTable> {
    Ok(identified_of(table, options, rate_beside, false)?.0)
}

/// Reads the rows as detections, with the identity of each in the order of the scans; `identified` leaves out rows that
/// belong to no track (an empty or negative identity).
pub(crate) fn identified_of(
    table: &Table,
    options: &TableOptions,
    rate_beside: Option<f64>,
    identified: bool,
) -> Result<(DetectionTable, Vec<u64>)> {
    let layout = &table.layout;
    if !layout.has(&[Field::Frame]) {
        return Err(table.lacks("which frame a row belongs to"));
    }
    if !layout.has_position() {
        return Err(table.lacks("where a detection is (x and y, or a box)"));
    }
    let reader = Reader::new(table, options);
    let mut out = DetectionTable {
        scans: Vec::new(),
        rate_hz: 0.0,
        format: reader.format(),
        class_names: Vec::new(),
        n_rows: 0,
        n_skipped: 0,
        warnings: Vec::new(),
    };
    let mut seen: Vec<Seen> = Vec::new();
    let mut n_loose = 0;
    for row in table.rows() {
        out.n_rows += 1;
        if identified && row.maybe(Field::Id).is_ok_and(|id| id.is_none_or(|id| id < 0.0)) {
            n_loose += 1;
            continue;
        }
        match reader.read(&row, identified, &mut out.class_names) {
            Ok(one) => seen.push(one),
            Err(_) if options.skip_bad_rows => out.n_skipped += 1,
            // A run that was cut off leaves a last line without an end.
            Err(e) if row.cut && !seen.is_empty() => {
                out.n_skipped += 1;
                out.warnings.push(format!("The table breaks off in its last line, 1 row is lost: {e}."));
            }
            Err(e) => return Err(e.hint("mend the row, or leave bad rows out (skip-bad-rows)")),
        }
    }
    if out.n_skipped > 0 && options.skip_bad_rows {
        out.warnings.push(format!("{}: {} of {} rows were bad and left out.", table.label, out.n_skipped, out.n_rows));
    }
    if seen.is_empty() && out.n_skipped > 0 {
        return Err(
            Error::new(ErrorKind::Damaged, format!("none of its {} rows can be read", out.n_rows)).at(&table.label)
        );
    }
    if n_loose > 0 {
        out.warnings.push(format!("{}: {n_loose} rows belong to no track and were left out.", table.label));
    }
    seen.sort_by_key(|s| s.frame);
    let ids = seen.iter().map(|s| s.id).collect();
    out.scans = scans_of(table, seen)?;
    set_times(&mut out, table, options, rate_beside)?;
    if !layout.has(&[Field::VarX]) && !layout.has(&[Field::StdX]) && !out.scans.is_empty() {
        out.warnings.push(format!(
            "{} has no position errors: a standard deviation of {} px was taken.",
            table.label, options.std_px
        ));
    }
    Ok((out, ids))
}

/// Groups sorted rows into one scan a frame. Times are kept only if every row has one (`i64::MIN` marks none).
fn scans_of(table: &Table, seen: Vec<Seen>) -> Result<Vec<Scan>> {
    const NO_TIME: Timestamp = Timestamp::from_ns(i64::MIN);
    let mut scans: Vec<Scan> = Vec::new();
    for one in seen {
        let time = one.time.unwrap_or(NO_TIME);
        match scans.last_mut() {
            Some(last) if last.index.0 == one.frame => last.detections.push(one.detection),
            last => {
                let next = last.map_or(one.frame, |l| l.index.0 + 1);
                if one.frame - next > MAX_GAP_FRAMES {
                    let what = format!(
                        "frame {} follows frame {}: expected a hole of at most {MAX_GAP_FRAMES} frames",
                        one.frame,
                        next - 1
                    );
                    return Err(Error::new(ErrorKind::Damaged, what).at(&table.label));
                }
                scans.extend((next..one.frame).map(|f| Scan {
                    index: FrameIndex(f),
                    time: NO_TIME,
                    ..Scan::default()
                }));
                scans.push(Scan {
                    index: FrameIndex(one.frame),
                    time,
                    detections: vec![one.detection],
                    ..Scan::default()
                });
            }
        }
    }
    Ok(scans)
}

/// Gives every scan its time: from the table, with holes filled evenly, or from a rate.
fn set_times(out: &mut DetectionTable, table: &Table, options: &TableOptions, rate_beside: Option<f64>) -> Result<()> {
    let timed: Vec<usize> = (0..out.scans.len()).filter(|&i| !out.scans[i].detections.is_empty()).collect();
    let has_times =
        options.rate_hz.is_none() && !timed.is_empty() && timed.iter().all(|&i| out.scans[i].time.ns != i64::MIN);
    if !has_times {
        let rate = options.rate_hz.or(rate_beside);
        if rate.is_none() && !out.scans.is_empty() {
            out.warnings.push(format!("{} says nothing of time: 25 frames/s were taken.", table.label));
        }
        out.rate_hz = rate.unwrap_or(25.0);
        for scan in &mut out.scans {
            scan.time = Timestamp::from_secs_f64(scan.index.0 as f64 / out.rate_hz);
        }
        return Ok(());
    }
    let mut periods: Vec<f64> = Vec::new();
    for pair in timed.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (from, to) = (out.scans[a].time, out.scans[b].time);
        if to <= from {
            let what = format!(
                "times must grow with the frames, but frame {} is at {} s and frame {} at {} s",
                out.scans[a].index.0,
                from.as_secs_f64(),
                out.scans[b].index.0,
                to.as_secs_f64()
            );
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(&table.label)
                .hint("give a rate to make times from frame numbers"));
        }
        let n = (b - a) as i128;
        let step = i128::from(to.ns) - i128::from(from.ns);
        periods.push(step as f64 / n as f64 * 1e-9);
        for k in 1..b - a {
            out.scans[a + k].time = Timestamp::from_ns((i128::from(from.ns) + step * k as i128 / n) as i64);
        }
    }
    periods.sort_by(f64::total_cmp);
    out.rate_hz = periods.get(periods.len() / 2).map_or_else(|| rate_beside.unwrap_or(25.0), |p| 1.0 / p);
    Ok(())
}

/// What is the same for all rows.
struct Reader<'t> {
    table: &'t Table,
    layout: &'t Layout,
    options: &'t TableOptions,
    /// From the table's left and top to pixel edges.
    edge_shift_px: f64,
    first_frame: u64,
}

impl<'t> Reader<'t> {
    fn new(table: &'t Table, options: &'t TableOptions) -> Self {
        let edges =
            table.layout.column(Field::Left).and_then(|at| table.header.get(at)).is_some_and(|h| h == "left_px");
        let first_frame = options.first_frame.unwrap_or(if table.kind == Kind::Mot { 1 } else { 0 });
        Self { table, layout: &table.layout, options, edge_shift_px: if edges { 0.0 } else { -0.5 }, first_frame }
    }

    fn format(&self) -> String {
        if self.table.kind == Kind::Mot {
            return "MOTChallenge".to_string();
        }
        if self.table.header.join(",") == super::detections_csv::DETECTIONS_HEADER {
            return "boresight detections".to_string();
        }
        let fields = [Field::Frame, Field::TimeS, Field::X, Field::Y, Field::Left, Field::Top];
        let used: Vec<_> = fields
            .into_iter()
            .filter_map(|f| self.table.header.get(self.layout.column(f)?))
            .map(String::as_str)
            .collect();
        format!("CSV ({})", used.join(", "))
    }

    fn read(&self, row: &Row<'_>, identified: bool, class_names: &mut Vec<String>) -> Result<Seen> {
        row.check_length()?;
        let id = if identified { row.need(Field::Id)? } else { 0.0 };
        if id.fract() != 0.0 || id >= 1e15 {
            return Err(row.wrong(Field::Id, row.word(Field::Id).unwrap_or_default(), "a whole number"));
        }
        let frame = row.need(Field::Frame)?;
        let first = self.first_frame as f64;
        if frame < first || frame.fract() != 0.0 || frame >= 1e15 {
            let found = row.word(Field::Frame).unwrap_or_default();
            return Err(row.wrong(Field::Frame, found, &format!("a whole number from {first}")));
        }
        let time = match (row.word(Field::TimeS), self.layout.time_scale) {
            (None, _) => None,
            (Some(text), None) => {
                Some(parse_seconds(text).ok_or_else(|| row.wrong(Field::TimeS, text, "a time in seconds"))?)
            }
            (Some(_), Some(scale)) => Some(Timestamp::from_secs_f64(row.need(Field::TimeS)? * scale)),
        };
        let area = row.maybe(Field::Area)?.filter(|a| *a > 0.0);
        let boxed = self.extent(row)?;
        let position = match (&boxed, self.layout.has(&[Field::X, Field::Y])) {
            (_, true) => {
                let origin = self.options.first_pixel;
                Vector2::new(row.need(Field::X)? - origin, row.need(Field::Y)? - origin)
            }
            (Some(e), false) => Vector2::new(e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0),
            (None, false) => return Err(row.bad("neither a centre nor a box")),
        };
        let extent = boxed.unwrap_or_else(|| {
            let side = area.map_or(self.options.box_px, f64::sqrt);
            Extent {
                left_px: position.x - side / 2.0,
                top_px: position.y - side / 2.0,
                width_px: side,
                height_px: side,
            }
        });
        let cov = self.cov(row, &extent)?;
        let area = area.unwrap_or(extent.width_px * extent.height_px).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        let detection = Detection {
            position,
            cov,
            extent,
            area_px: area,
            peak: row.maybe(Field::Peak)?.unwrap_or(0.0) as f32,
            sum: row.maybe(Field::Sum)?.unwrap_or(0.0),
            score: row.maybe(Field::Score)?.unwrap_or(1.0) as f32,
            class: row.word(Field::Class).and_then(|word| class_of(word, class_names)),
        };
        Ok(Seen { frame: frame as u64 - self.first_frame, id: id as u64, time, detection })
    }

    fn extent(&self, row: &Row<'_>) -> Result<Option<Extent>> {
        if !self.layout.has(&[Field::Left, Field::Top]) {
            // A size without a place: a box around the centre.
            if self.layout.has(&[Field::Width, Field::Height, Field::X, Field::Y])
                && let (Some(w), Some(h)) = (row.maybe(Field::Width)?, row.maybe(Field::Height)?)
                && w >= 0.0
                && h >= 0.0
            {
                let (x, y) =
                    (row.need(Field::X)? - self.options.first_pixel, row.need(Field::Y)? - self.options.first_pixel);
                return Ok(Some(Extent { left_px: x - w / 2.0, top_px: y - h / 2.0, width_px: w, height_px: h }));
            }
            return Ok(None);
        }
        let (left, top) = (row.need(Field::Left)?, row.need(Field::Top)?);
        let (width, height) = if self.layout.has(&[Field::Width, Field::Height]) {
            (row.need(Field::Width)?, row.need(Field::Height)?)
        } else if self.layout.has(&[Field::Right, Field::Bottom]) {
            (row.need(Field::Right)? - left, row.need(Field::Bottom)? - top)
        } else {
            return Ok(None);
        };
        for (field, size) in [(Field::Width, width), (Field::Height, height)] {
            if size < 0.0 {
                return Err(row.wrong(field, &size.to_string(), "a size of at least 0 px"));
            }
        }
        if self.table.kind == Kind::Mot {
            return Ok(Some(extent_of_mot_box([left, top, width, height])));
        }
        let shift = self.edge_shift_px - self.options.first_pixel;
        Ok(Some(Extent { left_px: left + shift, top_px: top + shift, width_px: width, height_px: height }))
    }

    fn cov(&self, row: &Row<'_>, extent: &Extent) -> Result<Matrix2<f64>> {
        if let (Some(xx), Some(yy)) = (row.maybe(Field::VarX)?, row.maybe(Field::VarY)?) {
            let xy = row.maybe(Field::CovXy)?.unwrap_or(0.0);
            if !(xx > 0.0 && yy > 0.0 && xx * yy > xy * xy) {
                let found = format!("{xx}, {xy}, {yy}");
                return Err(row.wrong(Field::VarX, &found, "a positive definite covariance"));
            }
            return Ok(Matrix2::new(xx, xy, xy, yy));
        }
        let side = |s: f64| (s * self.options.std_per_side).max(self.options.std_px);
        // trackpy gives 0 or less where it could not tell the error.
        let x = row.maybe(Field::StdX)?.filter(|s| *s > 0.0).unwrap_or(side(extent.width_px));
        let y = row.maybe(Field::StdY)?.filter(|s| *s > 0.0).unwrap_or(side(extent.height_px));
        Ok(Matrix2::new(x * x, 0.0, 0.0, y * y))
    }
}

/// Most names of classes that are told apart.
const MAX_CLASSES: usize = 1000;

/// A class by number, or by name in the order of appearance.
fn class_of(word: &str, names: &mut Vec<String>) -> Option<ClassId> {
    if names.is_empty()
        && let Some(number) = word.parse::<f64>().ok().filter(|v| v.fract() == 0.0 && (0.0..4e9).contains(v))
    {
        return Some(ClassId(number as u32));
    }
    if let Some(i) = names.iter().position(|n| n == word) {
        return Some(ClassId(i as u32));
    }
    if names.len() >= MAX_CLASSES {
        return None;
    }
    names.push(word.to_string());
    Some(ClassId(names.len() as u32 - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{DetectionsCsv, Output};
    use crate::{Sink, View};
    use proptest::prelude::*;

    fn read(text: &str, options: &TableOptions) -> Result<DetectionTable> {
        detections_of(&Table::of_text("t.csv".into(), text.as_bytes(), &options.columns)?, options, None)
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
    fn bad_rows_are_errors_with_their_place_or_counted() {
        for (row, word) in [
            ("1,nan,2", "column x"),
            ("1,inf,2", "column x"),
            ("-1,1,2", "column frame"),
            ("1.5,1,2", "column frame"),
            ("1,1", "2 fields"),
            ("1,one,2", "'one'"),
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

    fn detection() -> impl Strategy<Value = Detection> {
        let n = || -1e6..1e6f64;
        (n(), n(), 1e-9..1e3f64, 1e-9..1e3f64, -0.99..0.99f64, 0.0..1e4f64, 1u32..100, any::<f32>(), n()).prop_map(
            |(x, y, vx, vy, rho, size, area_px, peak, sum)| {
                let xy = rho * (vx * vy).sqrt();
                let peak = if peak.is_finite() { peak } else { 0.0 };
                Detection {
                    position: Vector2::new(x, y),
                    cov: Matrix2::new(vx, xy, xy, vy),
                    extent: Extent { left_px: x - 0.3, top_px: y - 0.7, width_px: size, height_px: size / 3.0 },
                    area_px,
                    peak,
                    sum,
                    score: peak,
                    class: None,
                }
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn our_own_table_comes_back_to_the_last_bit(
            scans in proptest::collection::vec(proptest::collection::vec(detection(), 1..4), 1..5), step in 1i64..1_000_000_000_000
        ) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("detections.csv");
            let mut sink = Box::new(DetectionsCsv::to(Output::file(&path).unwrap()).unwrap());
            let scans: Vec<Scan> = scans
                .into_iter()
                .enumerate()
                .map(|(i, detections)| {
                    Scan { index: FrameIndex(i as u64), time: Timestamp::from_ns(i as i64 * step), detections, ..Scan::default() }
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
