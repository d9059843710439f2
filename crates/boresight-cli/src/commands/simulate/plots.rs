//! Radars of a scene to disk: `NAME.csv` (a table of detections), `NAME-plots.csv` (range, azimuth, arrival, origin) and, of those that measure range and azimuth, what a
//! ship's radar writes: `NAME-polar.csv` with `NAME-ownship.csv`. There the truth's frame is read as metres, x east and y north, and azimuths count clockwise from north.

use boresight::io::{DetectionsCsv, write_whole};
use boresight::sim::{Measures, PolarErrors, Radar, RadarConfig, Seed};
use boresight::{Error, ErrorKind, Sink, TrackState, View};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A file with `[[radars]]`.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RadarFile {
    radars: Vec<RadarConfig>,
}

/// Reads the radars of a TOML file.
pub fn read_radars(path: &Path) -> boresight::Result<Vec<RadarConfig>> {
    let place = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(&place).because(e))?;
    let file: RadarFile = toml::from_str(&text).map_err(|e| {
        Error::new(ErrorKind::Config, e.to_string().trim_end().to_string())
            .at(&place)
            .hint("expected [[radars]] tables")
    })?;
    for (i, r) in file.radars.iter().enumerate() {
        r.validate(&format!("radars[{i}]")).map_err(|e| e.at(&place))?;
    }
    Ok(file.radars)
}

/// Names of a radar's files: its detections, its plots, range and azimuth as a ship's radar writes them, and where it stands.
pub fn names(radar: &str) -> [String; 4] {
    ["", "-plots", "-polar", "-ownship"].map(|end| format!("{radar}{end}.csv"))
}

/// Range and azimuth as a ship's radar writes them.
struct Polar {
    errors: PolarErrors,
    position: [f64; 2],
    text: String,
}

struct Station {
    name: String,
    radar: Radar,
    table: DetectionsCsv,
    plots: String,
    polar: Option<Polar>,
}

/// The radars at work, each with its files.
pub struct Radars {
    dir: PathBuf,
    stations: Vec<Station>,
}

impl Radars {
    /// Creates the files of all radars.
    pub fn create(dir: &Path, configs: &[RadarConfig], seed: Seed) -> boresight::Result<Self> {
        let stations = configs.iter().enumerate().map(|(i, c)| {
            Ok(Station {
                name: c.name.clone(),
                radar: Radar::new(c, seed, i as u64)?,
                table: DetectionsCsv::create(dir.join(&names(&c.name)[0]))?,
                polar: match &c.measures {
                    Measures::RangeAzimuth(errors) => Some(Polar {
                        errors: errors.clone(),
                        position: c.position_px,
                        text: String::from("time_s,range_m,azimuth_deg,range_std_m,azimuth_std_deg\n"),
                    }),
                    Measures::Position(_) => None,
                },
                plots: String::from("frame,time_s,arrival_s,range_px,azimuth_rad,x_px,y_px,target\n"),
            })
        });
        Ok(Self { dir: dir.to_path_buf(), stations: stations.collect::<boresight::Result<_>>()? })
    }

    /// Takes the truth of the next frame.
    pub fn see(&mut self, time_s: f64, truth: &[TrackState]) -> boresight::Result<()> {
        for s in &mut self.stations {
            for scan in s.radar.see(time_s, truth)? {
                s.table.put(&View { frame: None, scan: &scan.scan, tracks: &[] })?;
                let (t, arrival) = (scan.scan.time.as_secs_f64(), scan.arrival.as_secs_f64());
                for (d, p) in scan.scan.detections.iter().zip(&scan.plots) {
                    let target = p.target.map_or(String::new(), |id| id.0.to_string());
                    let ([r, a], z) = (p.polar, d.position);
                    if let Some(polar) = &mut s.polar {
                        let (e, azimuth) = (&polar.errors, (90.0 - a.to_degrees()).rem_euclid(360.0));
                        let _ = writeln!(polar.text, "{t},{r},{azimuth},{},{}", e.range_std_px, e.azimuth_std_deg);
                    }
                    let _ = writeln!(s.plots, "{},{t},{arrival},{r},{a},{},{},{target}", scan.scan.index.0, z.x, z.y);
                }
            }
        }
        Ok(())
    }

    /// Ends the files; returns their names.
    pub fn finish(self) -> boresight::Result<Vec<String>> {
        let mut names = Vec::new();
        for s in self.stations {
            Box::new(s.table).finish()?;
            let [table, plots, polar, ownship] = self::names(&s.name);
            write_whole(self.dir.join(&plots), s.plots.as_bytes())?;
            names.extend([table, plots]);
            if let Some(Polar { text, position: [x, y], .. }) = s.polar {
                write_whole(self.dir.join(&polar), text.as_bytes())?;
                let own = format!("time_s,x_m,y_m,heading_deg\n0,{x},{y},0\n");
                write_whole(self.dir.join(&ownship), own.as_bytes())?;
                names.extend([polar, ownship]);
            }
        }
        Ok(names)
    }
}
