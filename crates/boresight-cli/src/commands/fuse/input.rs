//! What `fuse` reads: tracks as they are, detections through the tracker, and each table's frame of reference.

use crate::console::say;
use boresight::fuse::{MapKind, REPORT_STD_M, Timeline, plots_taken, timeline_of_reports, timelines};
use boresight::fuse::{PlaneMap, common_points};
use boresight::io::{
    LengthUnit, RadarPicture, ShipReports, TableOptions, read_detections, read_ship_reports, read_tracks,
};
use boresight::{Config, Error, ErrorKind, Result, Scan, TrackId, TrackState, track};
use nalgebra::Vector2;
use std::path::Path;

/// One sensor's table.
pub struct Sensor {
    /// Its tracks, from the table or made from its detections.
    pub tracks: Vec<Timeline>,
    /// Its detections, if the table has no tracks.
    pub scans: Option<Vec<Scan>>,
    /// Rate of its scans, 1/s.
    pub rate_hz: f64,
    /// Whether these are ships' own reports, which come seldom.
    pub is_reports: bool,
    /// Where the radar was, of a radar's plots.
    pub radar: Option<RadarPicture>,
    /// Of a radar's plots those that each of its tracks took, in the order of the tracks: their errors are independent.
    pub plots: Vec<Timeline>,
    /// Number and time (s) of its first frame.
    pub first: (u64, f64),
}

impl Sensor {
    /// Numbers the times (s) as this sensor's frames; from 0 on where they are not all frames of their own of its clock.
    pub fn number(&self, times: &[f64]) -> (Vec<u64>, bool) {
        let (k0, t0) = self.first;
        let at = |t: &f64| k0 as f64 + ((t - t0) * self.rate_hz).round();
        let near = |t: &f64| ((t - t0) * self.rate_hz - ((t - t0) * self.rate_hz).round()).abs() < 0.25;
        let numbers: Vec<f64> = times.iter().map(at).collect();
        let fine =
            times.iter().all(near) && numbers.iter().all(|k| *k >= 0.0) && numbers.windows(2).all(|w| w[0] < w[1]);
        if fine {
            (numbers.iter().map(|k| *k as u64).collect(), true)
        } else {
            ((0..times.len() as u64).collect(), false)
        }
    }
}

/// Reads a table of tracks, or one of detections and tracks them with `config` (chosen from the table if none is given).
pub fn read(path: &Path, config: Option<&Config>, map: &PlaneMap) -> anyhow::Result<Sensor> {
    if let Some(ships) = ships(path, map)? {
        return Ok(ships);
    }
    // What a configuration says of the table holds for one of a radar; other tables are read as they are.
    let mut options = TableOptions::default();
    if let Some(config) = config {
        options.radar = config.input.table.radar.clone();
    }
    let options = options;
    let warn = |all: &[String]| all.iter().for_each(|w| say!("warning: {}: {w}", path.display()));
    let tracks = read_tracks(path, &options);
    if let Ok(table) = &tracks
        && table.frames.iter().any(|f| !f.tracks.is_empty())
    {
        warn(&table.warnings);
        let lines = timelines(table.frames.iter().map(|f| (f.time.as_secs_f64(), f.tracks.as_slice())));
        let tracks = lines.iter().map(|t| map.timeline(t)).filter(|t| !t.points.is_empty()).collect();
        let first = table.frames.first().map_or((0, 0.0), |f| (f.index.0, f.time.as_secs_f64()));
        return Ok(Sensor {
            tracks,
            scans: None,
            rate_hz: table.rate_hz,
            is_reports: false,
            radar: None,
            plots: Vec::new(),
            first,
        });
    }
    let table = match (tracks, read_detections(path, &options)) {
        // A bad row in a table of tracks does not make detections of them.
        (Err(e), _) if e.kind() != ErrorKind::Unsupported => return Err(e.into()),
        (_, Ok(table)) => table,
        // No column names tracks, and none says where: the first is the better answer; a bad row tells of itself.
        (Err(e), Err(bad)) if bad.kind() == ErrorKind::Unsupported => return Err(e.into()),
        (_, Err(e)) => return Err(e.into()),
    };
    warn(&table.warnings);
    // Noise and speeds are those of the common frame.
    let scans: Vec<Scan> = table
        .scans
        .into_iter()
        .map(|s| {
            let detections = s.detections.iter().filter_map(|d| map.detection(d)).collect();
            s.with_detections(detections)
        })
        .collect();
    let turn = table.radar.as_ref().map(|r| (r.turn_s, r.unit));
    let config = tracker_of(&scans, table.rate_hz, turn, config);
    let states = run_tracker(&config, &scans)?;
    let tracks = timelines(states.iter().map(|(t, s)| (*t, s.as_slice())));
    let plots = match turn {
        Some(_) => plots_taken(&tracks, &states, &scans, config.tracker.detection_covariance_scale),
        None => Vec::new(),
    };
    say!(
        "{}: {} detections in {} scans, {} tracks",
        path.display(),
        scans.iter().map(|s| s.detections.len()).sum::<usize>(),
        scans.len(),
        tracks.len()
    );
    let first = scans.first().map_or((0, 0.0), |s| (s.index.0, s.time.as_secs_f64()));
    Ok(Sensor {
        tracks,
        scans: Some(scans),
        rate_hz: table.rate_hz,
        is_reports: false,
        radar: table.radar,
        plots,
        first,
    })
}

/// A table of ships' reports as a sensor; `None` where it is another table.
fn ships(path: &Path, map: &PlaneMap) -> anyhow::Result<Option<Sensor>> {
    let Some(ships) = read_ship_reports(path, false)? else { return Ok(None) };
    let of = |ship: &ShipReports| map.timeline(&timeline_of_reports(ship.id, &ship.reports));
    let mut tracks: Vec<Timeline> = ships.iter().map(of).collect();
    tracks.retain(|t| !t.points.is_empty());
    let first = tracks.iter().map(|t| t.points[0].0).fold(f64::INFINITY, f64::min);
    say!("{}: reports of {} ships, taken as right to {REPORT_STD_M} m", path.display(), tracks.len());
    let first = (0, if first.is_finite() { first } else { 0.0 });
    Ok(Some(Sensor { tracks, scans: None, rate_hz: 1.0, is_reports: true, radar: None, plots: Vec::new(), first }))
}

/// The given configuration, or one chosen for the detections; `turn` is the time of a turn and the unit of length, of a radar's plots.
pub fn tracker_of(scans: &[Scan], rate_hz: f64, turn: Option<(f64, LengthUnit)>, given: Option<&Config>) -> Config {
    given.cloned().unwrap_or_else(|| {
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        match turn {
            Some((turn_s, unit)) => boresight::auto::for_radar(scans, turn_s, unit, &mut config, &mut reasons),
            None => boresight::auto::for_detections(scans, rate_hz, LengthUnit::Pixel, None, &mut config, &mut reasons),
        }
        reasons.iter().for_each(|r| say!("  {r}"));
        config
    })
}

/// Tracks detections; returns the tracks of each scan.
pub fn run_tracker(config: &Config, scans: &[Scan]) -> Result<Vec<(f64, Vec<TrackState>)>> {
    let mut tracker = track::build(&config.tracker)?;
    scans.iter().map(|s| Ok((s.time.as_secs_f64(), tracker.step(s)?.to_vec()))).collect()
}

/// A map: 6 or 9 numbers, or a file that holds them; `affine:POINTS` or `homography:POINTS`, a table `x,y,X,Y` of points in both
/// frames. `affine` and `homography` alone are estimated later, from common tracks.
pub enum MapSpec {
    /// Known.
    Known(PlaneMap),
    /// To be estimated from common tracks.
    FromTracks(MapKind),
}

impl MapSpec {
    /// Reads what stands behind `--map-a` or `--map-b`.
    pub fn read(text: &str) -> Result<Self> {
        let kind = |name: &str| match name {
            "affine" => Some(MapKind::Affine),
            "homography" => Some(MapKind::Homography),
            _ => None,
        };
        if let Some(kind) = kind(text) {
            return Ok(Self::FromTracks(kind));
        }
        if let Some((name, path)) = text.split_once(':')
            && let Some(kind) = kind(name)
        {
            let points: Vec<_> = numbers_of_file(path)?
                .chunks(4)
                .map(|c| match c {
                    [x, y, u, v] => Ok((Vector2::new(*x, *y), Vector2::new(*u, *v))),
                    _ => Err(Error::new(ErrorKind::Damaged, "expected four numbers a line: x, y, X, Y").at(path)),
                })
                .collect::<Result<_>>()?;
            let found = PlaneMap::estimate(&points, kind).map_err(|e| e.at(path))?;
            say!("{name} map from {} points of {path}: rms {:.3}", found.n_points, found.rms);
            return Ok(Self::Known(found.map));
        }
        let rows = match numbers(text) {
            Some(rows) => rows,
            None => numbers_of_file(text)?,
        };
        Ok(Self::Known(PlaneMap::from_rows(&rows).map_err(|e| e.at(text))?))
    }
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split(|c: char| c == ',' || c == ';' || c.is_whitespace())
        .filter(|w| !w.is_empty())
        .map(|w| w.parse().ok())
        .collect()
}

/// All numbers of a file; a first line of names is left out.
fn numbers_of_file(path: &str) -> Result<Vec<f64>> {
    let text = std::fs::read_to_string(path).map_err(|e| {
        Error::new(ErrorKind::NotFound, "is neither 6 or 9 numbers nor a file that can be read").at(path).because(e)
    })?;
    let mut all = Vec::new();
    for (i, line) in text.lines().enumerate() {
        match numbers(line) {
            Some(row) => all.extend(row),
            None if i == 0 => {}
            None => return Err(Error::new(ErrorKind::Damaged, "expected numbers").at(format!("{path}:{}", i + 1))),
        }
    }
    Ok(all)
}

/// Pairs of track numbers `A=B,A=B`.
pub fn common_tracks(text: &str) -> Result<Vec<(TrackId, TrackId)>> {
    let bad = || {
        Error::new(ErrorKind::Config, "expected pairs of track numbers")
            .at(format!("--common {text}"))
            .hint("--common 3=7,4=9: track 3 of the first sensor is track 7 of the second")
    };
    let id = |w: &str| w.trim().parse().map(TrackId).map_err(|_| bad());
    text.split(',').map(|p| p.split_once('=').ok_or_else(bad).and_then(|(a, b)| Ok((id(a)?, id(b)?)))).collect()
}

/// Estimates the map from the second sensor to the first one from tracks that are known to be common.
pub fn map_from_tracks(
    kind: MapKind,
    a: &[Timeline],
    b: &[Timeline],
    pairs: &[(TrackId, TrackId)],
    max_gap_s: f64,
) -> Result<PlaneMap> {
    if pairs.is_empty() {
        let e = Error::new(ErrorKind::Config, "a map is estimated from common tracks, and none are named");
        return Err(e.at("--map-b").hint("name them: --common 3=7,4=9; or give points: --map-b affine:points.csv"));
    }
    let find = |all: &[Timeline], id: TrackId, which: &str| {
        let found = all.iter().find(|t| t.id == id).cloned();
        found.ok_or_else(|| {
            Error::new(ErrorKind::NotFound, format!("the {which} sensor has no track {}", id.0)).at("--common")
        })
    };
    let mut points = Vec::new();
    for (i, j) in pairs {
        // From the second frame to the first.
        points.extend(common_points(&find(a, *i, "first")?, &find(b, *j, "second")?, max_gap_s));
    }
    let found = PlaneMap::estimate(&points, kind)?;
    say!(
        "map from {} common points: rms {:.3}; rows {:?}",
        found.n_points,
        found.rms,
        found.map.matrix().transpose().as_slice()
    );
    Ok(found.map)
}
