//! Scans from a radar's table: range and azimuth of each plot become a position with its covariance, turns of the antenna become scans.
//!
//! Source: positions by the unbiased conversion of [`boresight_filters::converted`] (Longbin, Xiaoquan, Yiyu, Kang, Bar-Shalom 1998), from where own ship is at the plot's own time.
//! x is east, y is north (m). Scans: by the table's own number of the turn, else plots of one time, else by turns of the antenna ([`super::antenna`]); turns without a plot are
//! empty scans. A scan's time is the end of its turn, or its last plot where turns are numbered; each detection keeps how long before that it was seen.
//! A plot has no size: its box is empty.

use super::columns::{RadarColumns, Scaled, Spread};
use super::options::{AzimuthFrom, RadarOptions};
use super::own_ship::OwnShip;
use super::picture::{RadarPicture, along};
use super::turns::{Plot, number};
use crate::io::tables::columns::Field;
use crate::io::tables::detection_table::DetectionTable;
use crate::io::tables::number::timestamp_of_seconds;
use crate::io::tables::options::TableOptions;
use crate::io::tables::row::Row;
use crate::io::tables::table::Table;
use crate::{Detection, Error, ErrorKind, Extent, FrameIndex, RadarPlot, Result, Scan};
use boresight_filters::converted::{Polar, converted};
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// The table of own ship that is looked for beside the plots.
const BESIDE: &str = "ownship.csv";
/// Deviations of an azimuth are not larger, rad: beyond it the conversion does not hold.
const MOST_AZIMUTH_STD_RAD: f64 = 0.5;

/// Whether a table is one of range and azimuth, without places.
/// # Errors
/// A range or azimuth without its unit.
pub(crate) fn radar_columns(table: &Table) -> Result<Option<RadarColumns>> {
    if table.is_empty || table.form.layout.has_position() {
        return Ok(None);
    }
    RadarColumns::of_header(&table.form.header).map_err(|e| e.at(&table.form.label))
}

/// Reads a radar's table; `path` is where own ship's table is looked for.
/// # Errors
/// Columns that are missing, a bad row (unless `skip_bad_rows`), an own ship's table that cannot be read, plots that no turning antenna explains.
pub(crate) fn read_radar(
    table: &mut Table,
    columns: &RadarColumns,
    path: &Path,
    options: &TableOptions,
) -> Result<DetectionTable> {
    let radar = &options.radar;
    let (mut plots, n_rows, mut lost) = rows(table, columns, options)?;
    let label = table.form.label.clone();
    let n_skipped = n_rows - plots.len() as u64;
    let mut warnings = Vec::new();
    let own = own_ship(path, options)?;
    match &own {
        Some(own) => lost.extend(own.warnings.iter().cloned()),
        None if radar.azimuth_from == AzimuthFrom::Bow => {
            return Err(Error::new(ErrorKind::NotFound, "azimuths from the bow need own ship's heading").at(&label).hint(
                format!("put {BESIDE} beside the table, or name it: --set input.table.radar.own-ship=FILE"),
            ));
        }
        None => warnings.push(format!(
            "No {BESIDE} beside {label}: the radar is taken to stand at (0, 0); --set input.table.radar.own-ship=FILE names a table of its positions."
        )),
    }
    if columns.range_spread.is_none() || columns.azimuth_spread.is_none() {
        warnings.push(format!(
            "{label} has not both deviations: {} m in range and {} degrees in azimuth were taken where they are missing.",
            radar.range_std_m, radar.azimuth_std_deg
        ));
    }
    plots.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let own = own.unwrap_or_default();
    if let (Some(first), Some(last), Some(begin), Some(end)) =
        (plots.first(), plots.last(), own.path.first(), own.path.last())
        && (first.time_s < begin[0] - 10.0 || last.time_s > end[0] + 10.0)
        && own.path.len() > 1
    {
        warnings.push(format!(
            "Own ship's positions are of {:.0} s to {:.0} s, the plots of {:.0} s to {:.0} s: beyond them it is taken to stand.",
            begin[0], end[0], first.time_s, last.time_s
        ));
    }
    let mut detections = Vec::with_capacity(plots.len());
    for plot in &plots {
        detections.push(detection(plot, radar, &own).map_err(|e| e.at(&label))?);
    }
    let (scans, turn_s) = scans(&plots, detections, options).map_err(|e| e.at(&label))?;
    let mut own_path = own.path;
    if let (Some(a), true) = (own_path.first().copied(), own_path.windows(2).all(|w| w[0][1..] == w[1][1..])) {
        own_path = vec![a];
    } else if own_path.is_empty() {
        own_path.push([0.0; 3]);
    }
    warnings.extend_from_slice(&lost);
    let longest_range = plots.iter().map(|p| p.range).fold(0.0, f64::max);
    Ok(DetectionTable {
        scans,
        rate_hz: 1.0 / turn_s,
        first_frame: 0,
        unit: columns.unit,
        format: "a radar's plots of range and azimuth".to_string(),
        class_names: Vec::new(),
        n_rows,
        n_skipped,
        warnings,
        lost,
        radar: Some(RadarPicture { unit: columns.unit, own_path, turn_s, longest_range }),
    })
}

/// The plots of a table, the number of its rows, and what is lost of them.
fn rows(table: &mut Table, columns: &RadarColumns, options: &TableOptions) -> Result<(Vec<Plot>, u64, Vec<String>)> {
    // A lone `t` is the time here.
    let time_at =
        table.form.layout.column(Field::TimeS).or_else(|| table.form.header.iter().position(|h| h.trim() == "t"));
    let Some(time_at) = time_at else {
        return Err(table.lacks("when a plot was seen", "name it time_s, in seconds"));
    };
    let scale = table.form.layout.time_scale.unwrap_or(1.0);
    let (mut plots, mut n_rows, mut n_bad, mut lost) = (Vec::new(), 0u64, 0u64, Vec::new());
    while let Some(row) = table.next_row()? {
        n_rows += 1;
        match plot(&row, columns, time_at, scale, &options.radar) {
            Ok(plot) => plots.push(plot),
            Err(_) if options.skip_bad_rows => n_bad += 1,
            Err(e) if row.line.cut && !plots.is_empty() => {
                lost.push(format!("The table breaks off in its last line, 1 row is lost: {e}."));
            }
            Err(e) => return Err(e.hint("mend the row, or leave such rows out with --skip-bad-rows")),
        }
    }
    if n_bad > 0 {
        lost.push(format!("{}: {n_bad} of {n_rows} rows were bad and left out.", table.form.label));
    }
    if plots.is_empty() && n_rows > 0 {
        return Err(
            Error::new(ErrorKind::Damaged, format!("none of its {n_rows} rows can be read")).at(&table.form.label)
        );
    }
    Ok((plots, n_rows, lost))
}

fn plot(row: &Row<'_>, c: &RadarColumns, time_at: usize, time_scale: f64, options: &RadarOptions) -> Result<Plot> {
    row.check_length()?;
    let need = |at: usize, what: &str| row.need_at(at, what);
    let scaled = |s: Scaled, what: &str| Ok::<f64, Error>(s.scale * need(s.at, what)?);
    let time_s = time_scale * need(time_at, "a time in seconds")?;
    if timestamp_of_seconds(time_s).is_none() {
        return Err(row.wrong_at(time_at, &time_s.to_string(), "a time within 292 years"));
    }
    let range = scaled(c.range, "a range")? - options.range_bias_m;
    if !(range > 0.0 && range < 1e9) {
        return Err(row.wrong_at(c.range.at, &range.to_string(), "a range above 0, below a million km"));
    }
    let azimuth_rad = scaled(c.azimuth, "an azimuth")? - options.azimuth_bias_deg.to_radians();
    if azimuth_rad.abs() > 1e6 {
        return Err(row.wrong_at(c.azimuth.at, &azimuth_rad.to_string(), "an angle"));
    }
    let std = |spread: Option<Spread>, assumed: f64, most: f64| {
        let (at, found) = match spread {
            None => return Ok(assumed),
            Some(Spread::Std(s)) => (s.at, scaled(s, "a standard deviation")?),
            Some(Spread::Variance(s)) => (s.at, scaled(s, "a variance")?.sqrt()),
        };
        if found > 0.0 && found <= most {
            Ok(found)
        } else {
            Err(row.wrong_at(at, &found.to_string(), &format!("a deviation above 0, at most {most}")))
        }
    };
    let range_std = std(c.range_spread, options.range_std_m, 1e6)?;
    let azimuth_std = std(c.azimuth_spread, options.azimuth_std_deg.to_radians(), MOST_AZIMUTH_STD_RAD)?;
    let turn = match c.turn {
        Some(at) => {
            let number = need(at, "the number of a turn")?;
            if !(number >= 0.0 && number.fract() == 0.0 && number < 1e15) {
                return Err(row.wrong_at(at, &number.to_string(), "a whole number from 0 on"));
            }
            Some(number as u64)
        }
        None => None,
    };
    Ok(Plot { time_s, turn, range, azimuth_rad, std: [range_std, azimuth_std] })
}

/// The table of own ship: the one that is named, or one beside the plots; `None` where there is neither.
fn own_ship(path: &Path, options: &TableOptions) -> Result<Option<OwnShip>> {
    let named = options.radar.own_ship.as_ref().map(PathBuf::from);
    let beside = || {
        // `harbour-polar.csv` has `harbour-ownship.csv` beside it, where several radars share a folder.
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let of_name = stem.rsplit_once('-').map(|(name, _)| format!("{name}-{BESIDE}"));
        let names = of_name.into_iter().chain([BESIDE.to_string()]);
        names.map(|n| path.with_file_name(n)).find(|p| p.is_file())
    };
    named.or_else(beside).map(|file| OwnShip::read(&file, options.skip_bad_rows)).transpose()
}

/// A plot as a position east and north with its covariance.
fn detection(plot: &Plot, options: &RadarOptions, own: &OwnShip) -> Result<Detection> {
    let [x, y] = along(&own.path, plot.time_s);
    let azimuth_rad = match options.azimuth_from {
        AzimuthFrom::North => FRAC_PI_2 - plot.azimuth_rad,
        AzimuthFrom::XAxis => plot.azimuth_rad,
        AzimuthFrom::Bow => {
            let heading = own.heading_at(plot.time_s).ok_or_else(|| {
                Error::new(
                    ErrorKind::Unsupported,
                    "azimuths from the bow need a column heading_deg of own ship's table",
                )
            })?;
            FRAC_PI_2 - (plot.azimuth_rad + heading)
        }
    };
    let [range_std, azimuth_std_rad] = plot.std;
    let polar = Polar { range: plot.range, azimuth_rad, range_std, azimuth_std_rad };
    let sensor = Vector2::new(x, y);
    let m = converted(&polar, &sensor)?;
    let mut out = Detection::at(m.position, m.cov).with_plot(Some(RadarPlot { polar, sensor }));
    out.extent = Extent { left_px: m.position.x, top_px: m.position.y, width_px: 0.0, height_px: 0.0 };
    Ok(out)
}

/// Gathers detections, in order of time as the plots are, into scans; also the time of a turn, s.
fn scans(plots: &[Plot], detections: Vec<Detection>, options: &TableOptions) -> Result<(Vec<Scan>, f64)> {
    let of = number(plots, options.radar.turn_s)?;
    let n = of.times_s.len();
    let mut scans: Vec<Scan> = Vec::with_capacity(n);
    for (k, time_s) in of.times_s.iter().enumerate() {
        let time = timestamp_of_seconds(*time_s)
            .ok_or_else(|| Error::new(ErrorKind::Damaged, format!("scan {k} would be at {time_s} s")))?;
        if scans.last().is_some_and(|l| l.time >= time) {
            return Err(Error::new(
                ErrorKind::Damaged,
                format!("scan {k} is not later than the one before it ({time_s} s)"),
            )
            .hint("do the turns' numbers grow with time?"));
        }
        scans.push(Scan::at(FrameIndex(of.first + k as u64), time));
    }
    for ((k, d), plot) in of.turn_of.iter().zip(detections).zip(plots) {
        let scan = &mut scans[*k as usize];
        let seen = timestamp_of_seconds(plot.time_s).unwrap_or(scan.time);
        let age_ns = scan.time.ns.saturating_sub(seen.ns).max(0).unsigned_abs();
        scan.detections.push(d.with_age_ns(age_ns));
    }
    Ok((scans, of.turn_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, options: &TableOptions) -> Result<DetectionTable> {
        let mut table = Table::of_text("plots.csv", text.as_bytes(), &options.columns)?;
        let columns = radar_columns(&table)?.expect("a radar's table");
        read_radar(&mut table, &columns, Path::new("/nowhere/plots.csv"), options)
    }

    fn plain(text: &str) -> DetectionTable {
        read(text, &TableOptions::default()).unwrap()
    }

    #[test]
    fn azimuths_turn_clockwise_from_north_and_the_covariance_lies_across() {
        let t = plain(
            "time_s,range_nm,azimuth_deg,range_std_m,azimuth_std_deg\n0,1,90,20,0.1\n0,1,0,20,0.1\n1,1,180,20,0.1\n1,2,270,20,0.1\n",
        );
        let at = |k: usize, j: usize| t.scans[k].detections[j].position;
        assert!((at(0, 0) - Vector2::new(1852.0, 0.0)).norm() < 0.01, "{}", at(0, 0));
        assert!((at(0, 1) - Vector2::new(0.0, 1852.0)).norm() < 0.01);
        assert!((at(1, 0) - Vector2::new(0.0, -1852.0)).norm() < 0.01);
        assert!((at(1, 1) - Vector2::new(-3704.0, 0.0)).norm() < 0.02);
        // 0.1 degree at 1852 m is 3.23 m.
        let cov = t.scans[0].detections[0].cov;
        assert!((cov[(0, 0)].sqrt() - 20.0).abs() < 0.01 && (cov[(1, 1)].sqrt() - 3.232).abs() < 0.01, "{cov}");
        assert_eq!(t.scans[0].detections[0].extent.width_px, 0.0);
        let radar = t.radar.unwrap();
        assert_eq!((radar.unit.sign(), radar.turn_s, radar.own_path.len()), ("m", 1.0, 1));
        assert!(t.warnings[0].contains("taken to stand at (0, 0)"));
    }

    #[test]
    fn the_reference_and_the_biases_are_the_options() {
        let text = "scan,time_s,range_m,azimuth_rad\n0,0,100,0.1\n1,1,100,0.1\n";
        let mut options = TableOptions::default();
        options.radar.azimuth_from = AzimuthFrom::XAxis;
        options.radar.azimuth_std_deg = 1e-3;
        let at = |o: &TableOptions| read(text, o).unwrap().scans[0].detections[0].position;
        assert!((at(&options) - 100.0 * Vector2::new(0.1f64.cos(), 0.1f64.sin())).norm() < 1e-6);
        options.radar.range_bias_m = 10.0;
        options.radar.azimuth_bias_deg = 0.1f64.to_degrees();
        assert!((at(&options) - Vector2::new(90.0, 0.0)).norm() < 1e-6);
        options.radar.azimuth_from = AzimuthFrom::Bow;
        assert!(read(text, &options).unwrap_err().to_string().contains("heading"));
    }

    #[test]
    fn own_ship_is_found_beside_the_table_and_turns_what_is_seen_from_the_bow() {
        let dir = tempfile::tempdir().unwrap();
        let plots = dir.path().join("plots.csv");
        std::fs::write(&plots, "scan,t,range_m,azimuth_deg\n0,0,100,0\n1,10,100,0\n").unwrap();
        std::fs::write(dir.path().join("ownship.csv"), "t,x,y,heading_deg\n0,0,0,90\n10,50,0,180\n").unwrap();
        let mut options = TableOptions::default();
        let read = |o: &TableOptions| crate::io::read_detections(&plots, o).unwrap();
        let north = read(&options);
        assert!((north.scans[1].detections[0].position - Vector2::new(50.0, 100.0)).norm() < 0.1);
        assert!(north.warnings.iter().all(|w| !w.contains("ownship")), "{:?}", north.warnings);
        options.radar.azimuth_from = AzimuthFrom::Bow;
        let bow = read(&options);
        assert!((bow.scans[0].detections[0].position - Vector2::new(100.0, 0.0)).norm() < 0.1);
        assert!((bow.scans[1].detections[0].position - Vector2::new(50.0, -100.0)).norm() < 0.1);
        assert_eq!(bow.radar.unwrap().own_at(5.0), [25.0, 0.0]);
    }

    #[test]
    fn a_scan_ends_with_its_last_plot_and_each_plot_keeps_how_long_before_it_was_seen() {
        let t = plain("scan,t,range_m,az_deg\n3,10.5,100,10\n3,11.25,200,120\n4,12.75,100,20\n6,18,100,30\n");
        let of = |s: &Scan| (s.time.ns, s.detections.iter().map(|d| d.age_ns).collect::<Vec<_>>());
        let want = [(11_250_000_000, vec![750_000_000, 0]), (12_750_000_000, vec![0]), (15_375_000_000, vec![])];
        assert_eq!(t.scans[..3].iter().map(of).collect::<Vec<_>>(), want);
        // An antenna of 2.5 s that begins its turns at 0 s: turns end at whole multiples, plots are an azimuth's part of a turn before that.
        let rows = (0..400u32).map(|k| (0.31 * f64::from(k), 100.0 + f64::from(k % 7)));
        let rows = rows.filter(|(t, _)| (0.1..2.4).contains(&t.rem_euclid(2.5)));
        let text: String = rows.map(|(t, r)| format!("{t},{r},{}\n", 360.0 * t.rem_euclid(2.5) / 2.5)).collect();
        let t = plain(&format!("time_s,range_m,azimuth_deg\n{text}"));
        assert!(t.scans.len() == 50, "{}", t.scans.len());
        for s in &t.scans {
            for d in &s.detections {
                let azimuth =
                    d.position.x.atan2(d.position.y).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
                let seen_s = s.time.as_secs_f64() - d.age_ns as f64 * 1e-9;
                assert!((seen_s.rem_euclid(2.5) / 2.5 - azimuth).abs() < 1e-6, "{seen_s} s at {azimuth}");
                assert!(d.age_ns < 2_600_000_000);
            }
        }
    }

    #[test]
    fn empty_turns_are_scans_and_bad_rows_are_named() {
        let t = plain("t,range_m,az_deg\n0,100,1\n0,200,2\n0,300,3\n1,100,1\n1,200,2\n3,100,1\n3,90,1\n");
        let times: Vec<f64> = t.scans.iter().map(|s| s.time.as_secs_f64()).collect();
        assert_eq!(times, [0.0, 1.0, 2.0, 3.0]);
        assert!(t.scans[2].detections.is_empty());
        for (row, word) in [
            ("1,-5,2", "a range above 0"),
            ("1,x,2", "column range_m"),
            ("1,nan,2", "range"),
            ("1e300,5,2", "292 years"),
        ] {
            let text = format!("t,range_m,az_deg\n0,100,1\n0,200,2\n{row}\n2,5,5\n");
            let e = read(&text, &TableOptions::default()).unwrap_err().to_string();
            assert!(e.contains("line 4") && e.contains(word), "{e}");
            let skip = TableOptions { skip_bad_rows: true, ..TableOptions::default() };
            let mut skip = skip;
            skip.radar.turn_s = Some(1.0);
            let t = read(&text, &skip).unwrap();
            assert_eq!((t.n_skipped, t.n_rows), (1, 4));
        }
        assert!(read("range_m,az_deg\n1,1\n", &TableOptions::default()).unwrap_err().to_string().contains("time_s"));
        let far = read("scan,t,range_m,az_deg\n0,0,1,1\n999999999999,1,1,1\n", &TableOptions::default());
        assert!(far.unwrap_err().to_string().contains("scans between"));
    }
}
