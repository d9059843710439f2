//! Fusion on real data: a ship's radar against AIS, and simulated radars on real aircraft.
//!
//! Data: MarCE trials, Solent (private test data) and OpenSky states (MIT).

use crate::needs::{data, real_tests};
use boresight::fuse::{FuseConfig, RegistrationConfig, Rule, Timeline, fuse_tables, timelines};
use boresight::sim::{Measures, PolarErrors};
use boresight::sim::{Radar, RadarConfig, Seed};
use boresight::track::{self, ConfirmationConfig, MOfNConfig, MergedMeasurementsConfig, TrackerConfig};
use boresight::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;
use boresight_filters::converted::{Polar, converted};
use nalgebra::{Matrix4, Vector2, Vector4};
use std::collections::BTreeMap;

real_tests! {
    the_solent_radars_azimuth_bias_is_found_from_ais_and_taken_away needs ["radar_maritime_solent/run_01_004"];
    two_simulated_radars_on_real_aircraft_are_better_fused_than_alone needs ["adsb_ais_stonesoup/OpenSky_Plane_States.csv"];
}

/// Columns of a CSV file by name, rows that have all of them as numbers.
fn columns<const N: usize>(path: &std::path::Path, names: [&str; N]) -> Vec<[f64; N]> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let at = names.map(|n| header.iter().position(|h| h == n).unwrap());
    reader
        .records()
        .map(|r| r.unwrap())
        .filter_map(|r| {
            let row: Vec<f64> = at.iter().filter_map(|i| r.get(*i)?.parse().ok()).collect();
            row.try_into().ok()
        })
        .collect()
}

/// Straight interpolation of `(t, x, y)`.
fn at(path: &[[f64; 3]], t: f64) -> Option<Vector2<f64>> {
    let i = path.partition_point(|p| p[0] <= t);
    let (a, b) = (path.get(i.checked_sub(1)?)?, path.get(i)?);
    let s = (t - a[0]) / (b[0] - a[0]);
    Some(Vector2::new(a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])))
}

fn point(position: Vector2<f64>, cov: nalgebra::Matrix2<f64>) -> Detection {
    Detection::at(position, cov)
}

fn run(config: &TrackerConfig, scans: &[Scan]) -> Vec<Timeline> {
    let mut tracker = track::build(config).unwrap();
    let states: Vec<_> = scans.iter().map(|s| (s.time.as_secs_f64(), tracker.step(s).unwrap().to_vec())).collect();
    timelines(states.iter().map(|(t, s)| (*t, s.as_slice())))
}

fn the_solent_radars_azimuth_bias_is_found_from_ais_and_taken_away() {
    let dir = data("radar_maritime_solent/run_01_004");
    let own: Vec<[f64; 3]> = columns(&dir.join("ownship.csv"), ["t", "x", "y"]).to_vec();
    let plots = columns(&dir.join("plots.csv"), ["t", "azimuth_rad", "range_m", "var_az", "var_r"]);
    // Everything relative to the own ship, x east, y north: a heading error is a turn about the origin.
    let start = plots[0][0];
    let mut scans: Vec<Scan> = Vec::new();
    for [t, azimuth, range, var_azimuth, var_range] in plots {
        // The antenna turns once in about 2.4 s; all plots of a turn make a scan.
        let k = ((t - start) / 2.4).floor();
        if scans.last().is_none_or(|s| s.index.0 != k as u64) {
            let time = Timestamp::from_secs_f64(start + 2.4 * (k + 0.5));
            scans.push(Scan::at(FrameIndex(k as u64), time));
        }
        // Azimuth runs clockwise from north.
        let polar = Polar {
            range,
            azimuth_rad: std::f64::consts::FRAC_PI_2 - azimuth,
            range_std: var_range.sqrt(),
            azimuth_std_rad: var_azimuth.sqrt(),
        };
        let m = converted(&polar, &Vector2::zeros()).unwrap();
        scans.last_mut().unwrap().detections.push(point(m.position, m.cov));
    }
    let tracker = TrackerConfig {
        acceleration_std_px_per_s2: Some(0.05),
        extra_noise_px: 0.1,
        max_speed_px_per_s: 25.0,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 5, scans: 8, tentative_s: 60.0 }),
        coast_s: 15.0,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    };
    let radar = run(&tracker, &scans);
    // AIS of the one ship that the data's own notes call well seen: bias -0.038 rad in the radar's sense.
    let mut ships: BTreeMap<u64, Vec<[f64; 3]>> = BTreeMap::new();
    for [mmsi, t, x, y] in columns(&dir.join("ais.csv"), ["mmsi", "t", "x", "y"]) {
        let path = ships.entry(mmsi as u64).or_default();
        if path.last().is_none_or(|p| p[0] < t)
            && let Some(o) = at(&own, t)
        {
            path.push([t, x - o.x, y - o.y]);
        }
    }
    let ship = &ships[&227_023_100];
    let ais: Vec<_> = scans
        .iter()
        .filter_map(|s| {
            let t = s.time.as_secs_f64();
            let (p, before, after) = (at(ship, t)?, at(ship, t - 5.0)?, at(ship, t + 5.0)?);
            let v = (after - before) / 10.0;
            // "Good to some tens of metres."
            let cov = Matrix4::from_diagonal(&Vector4::new(900.0, 1.0, 900.0, 1.0));
            Some((t, Gaussian { mean: Vector4::new(p.x, v.x, p.y, v.y), cov }))
        })
        .collect();
    let ais = [Timeline { id: TrackId(227_023_100), points: ais, size: [0.0; 2] }];
    let config = FuseConfig {
        rule: Rule::CovarianceIntersection,
        density: 0.01,
        max_gap_s: 10.0,
        // A heading error turns everything about the own ship.
        registration: Some(RegistrationConfig {
            rotation: true,
            pivot_px: Some([0.0; 2]),
            ..RegistrationConfig::default()
        }),
        ..FuseConfig::default()
    };
    let f = fuse_tables(&ais, &radar, &config).unwrap();
    let r = f.registration;
    println!("Solent: {} radar tracks, {r:?}, pairs {:?}", radar.len(), f.pairs);
    // Azimuth measured too small clockwise is too large anticlockwise: the correction turns back, by 0.038 rad.
    assert!((r.rotation_rad + 0.038).abs() < 0.012, "{r:?}");
    assert!(r.mean_d2[1] < 0.5 * r.mean_d2[0], "{r:?}");
    assert_eq!(f.pairs.len(), 1);
}

/// Truth of the OpenSky aircraft near a place as frames every 10 s, metres east and south of it.
fn aircraft(path: &std::path::Path) -> Vec<(f64, Vec<TrackState>)> {
    let (lat0, lon0) = (52.0_f64, -1.5_f64);
    let metres = 6_371_000.0_f64.to_radians();
    let mut ids: BTreeMap<String, u64> = BTreeMap::new();
    let mut frames: BTreeMap<i64, Vec<TrackState>> = BTreeMap::new();
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let col = |n: &str| header.iter().position(|h| h == n).unwrap();
    let (time, icao, lat, lon, vx, vy) =
        (col("time"), col("icao24"), col("lat"), col("lon"), col("x_speed"), col("y_speed"));
    for row in reader.records().map(|r| r.unwrap()) {
        let n = |i: usize| row[i].parse::<f64>().ok();
        let (Some(t), Some(la), Some(lo), Some(vx), Some(vy)) = (n(time), n(lat), n(lon), n(vx), n(vy)) else {
            continue;
        };
        let (x, y) = ((lo - lon0) * metres * lat0.to_radians().cos(), -(la - lat0) * metres);
        if x.hypot(y) > 90_000.0 {
            continue;
        }
        let next = ids.len() as u64 + 1;
        let id = *ids.entry(row[icao].to_string()).or_insert(next);
        frames.entry(t as i64 - 1_626_098_400).or_default().push(TrackState {
            id: TrackId(id),
            status: TrackStatus::Confirmed,
            // y grows to the south here, as in an image.
            kinematics: Gaussian { mean: Vector4::new(x, vx, y, -vy), cov: Matrix4::zeros() },
            extent: Extent::default(),
            detection: None,
            innovation: None,
            score: 1.0,
        });
    }
    frames.into_iter().map(|(t, s)| (t as f64, s)).collect()
}

fn two_simulated_radars_on_real_aircraft_are_better_fused_than_alone() {
    let path = data("adsb_ais_stonesoup/OpenSky_Plane_States.csv");
    let truth = aircraft(&path);
    assert!(truth.len() > 100, "{}", truth.len());
    let radar = |name: &str, position: [f64; 2], first: f64| RadarConfig {
        name: name.into(),
        position_px: position,
        measures: Measures::RangeAzimuth(PolarErrors {
            range_std_px: 100.0,
            azimuth_std_deg: 0.15,
            ..PolarErrors::default()
        }),
        scan_period_s: 10.0,
        first_scan_s: first,
        detection_probability: 0.95,
        clutter_per_scan: 3.0,
        range_px: [1000.0, 150_000.0],
        ..RadarConfig::default()
    };
    // Crossed lines of sight; scans at times of their own, between the states.
    let sensors = [radar("west", [-60_000.0, 0.0], 2.0), radar("north", [0.0, -60_000.0], 7.0)];
    let tracker = TrackerConfig {
        acceleration_std_px_per_s2: Some(1.0),
        extra_noise_px: 1.0,
        max_speed_px_per_s: 320.0,
        clutter_density_per_px2: 5e-11,
        detection_probability: 0.95,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 4, scans: 6, tentative_s: 1e3 }),
        coast_s: 40.0,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    };
    let tracks: Vec<Vec<Timeline>> = sensors
        .iter()
        .enumerate()
        .map(|(i, c)| {
            let mut radar = Radar::new(c, Seed::new(1), i as u64).unwrap();
            let scans: Vec<Scan> = truth.iter().flat_map(|(t, s)| radar.see(*t, s).unwrap()).map(|s| s.scan).collect();
            run(&tracker, &scans)
        })
        .collect();
    let config = FuseConfig { rule: Rule::Independent, density: 1.0, max_gap_s: 25.0, ..FuseConfig::default() };
    let fused = fuse_tables(&tracks[0], &tracks[1], &config).unwrap();
    // Error against the true paths at the states' own times; a target counts if something is within 2 km.
    let score = |tracks: &dyn Fn(f64) -> Vec<Vector2<f64>>| {
        let (mut sum, mut n, mut all) = (0.0, 0.0, 0.0);
        for (t, states) in truth.iter().filter(|(t, _)| *t >= 120.0) {
            let here = tracks(*t);
            for s in states {
                let p = Vector2::new(s.kinematics.mean[0], s.kinematics.mean[2]);
                let off = here.iter().map(|q| (q - p).norm_squared()).fold(f64::INFINITY, f64::min);
                all += 1.0;
                if off < 2000.0 * 2000.0 {
                    sum += off;
                    n += 1.0;
                }
            }
        }
        (f64::sqrt(sum / n), n / all)
    };
    let alone = |lines: &[Timeline], t: f64| -> Vec<Vector2<f64>> {
        let place = |b: Gaussian<4>| Vector2::new(b.mean[0], b.mean[2]);
        lines.iter().filter_map(|l| l.at(t, 1.0, 25.0).map(place)).collect()
    };
    let fused_lines = timelines(fused.frames.iter().map(|(t, s)| (*t, s.as_slice())));
    let (west, north) = (score(&|t| alone(&tracks[0], t)), score(&|t| alone(&tracks[1], t)));
    let both = score(&|t| alone(&fused_lines, t));
    println!(
        "aircraft: west {west:?}, north {north:?}, fused {both:?} (rms m, share seen), {} pairs",
        fused.pairs.len()
    );
    assert!(fused.pairs.len() >= 20, "{}", fused.pairs.len());
    assert!(both.0 < 0.9 * west.0.min(north.0), "rms: west {west:?}, north {north:?}, fused {both:?}");
    assert!(both.1 >= west.1.min(north.1), "share: west {west:?}, north {north:?}, fused {both:?}");
}
