//! Sound files of every kind, damaged in thousands of seeded ways: an error or a result, never a panic, and little memory.
//!
//! The same parsers have targets for `cargo fuzz` in `fuzz/`; this test needs no other toolchain. `BORESIGHT_MUTATIONS`
//! sets how often each file is damaged (default 60), `BORESIGHT_MUTATION_SECONDS` how long instead (each file), beginning with the seed
//! `BORESIGHT_MUTATION_SEED` (default 0).

use super::memory::peak_of;
use boresight::io::tracks::ctc_write::write_folder;
use boresight::io::tracks::{Format, ReadOptions, read, write};
use boresight::io::{
    OpenOptions, RawFormat, RawType, TableOptions, open, read_detections, read_ship_reports, read_tracks,
};
use boresight::metrics::{MatchOptions, mot_scores};
use boresight::sim::{SceneConfig, Seed, named};
use boresight::{Config, Error};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Most bytes that one input may have in use at a time. Frames are limited to 2¹⁶ pixels here and files are small; but while
/// the `tiff` crate opens a file, its own default limits hold (256 MiB, of which damage can bring half to be taken).
const MOST_BYTES: isize = 320 << 20;

/// Damages bytes: hits, cuts, doublings, numbers of extreme size.
fn damaged(sound: &[u8], seed: u64) -> Vec<u8> {
    let mut r = ChaCha8Rng::seed_from_u64(seed);
    let mut bytes = sound.to_vec();
    for _ in 0..r.random_range(1..6) {
        if bytes.is_empty() {
            break;
        }
        // Half of the hits go to the front, where sizes, offsets and headers are.
        let span = if r.random_bool(0.5) { bytes.len().min(200) } else { bytes.len() };
        let at = r.random_range(0..span);
        match r.random_range(0..8) {
            0 => bytes[at] = r.next_u32() as u8,
            1 => bytes[at] ^= 1 << r.random_range(0..8),
            2 => bytes.truncate(at),
            3 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff, b'\n', b',', b'"'][r.random_range(0..8)],
            4 => {
                let end = (at + r.random_range(1..32)).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                let end = (at + r.random_range(1..64)).min(bytes.len());
                let part = bytes[at..end].to_vec();
                bytes.splice(at..at, part);
            }
            6 => {
                const NUMBERS: [&str; 10] =
                    ["-1", "0", "99999999", "4294967296", "18446744073709551616", "1e308", "-1e-320", "NaN", "inf", ""];
                let text = NUMBERS[r.random_range(0..NUMBERS.len())];
                // In place of a number, if one is near.
                let from = (at..bytes.len()).find(|&k| bytes[k].is_ascii_digit()).unwrap_or(at);
                let to = (from..bytes.len()).find(|&k| !bytes[k].is_ascii_digit()).unwrap_or(bytes.len());
                bytes.splice(from..to.max(from), text.bytes());
            }
            _ => {
                let end = (at + 4).min(bytes.len());
                bytes[at..end].fill(0xff);
            }
        }
    }
    bytes
}

/// A number that the environment sets.
fn set<T: std::str::FromStr>(name: &str) -> Option<T> {
    std::env::var(name).ok().and_then(|n| n.parse().ok())
}

/// The seeds with which a file is damaged: a number of them, or as many as a time allows.
fn seeds() -> impl Iterator<Item = u64> {
    let first: u64 = set("BORESIGHT_MUTATION_SEED").unwrap_or(0);
    let seconds: Option<f64> = set("BORESIGHT_MUTATION_SECONDS");
    let (rounds, begun) = (set("BORESIGHT_MUTATIONS").unwrap_or(60), Instant::now());
    (0..)
        .take_while(move |k| seconds.map_or(*k < rounds, |s| begun.elapsed().as_secs_f64() < s))
        .map(move |k| first + k)
}

/// Damages `sound` again and again and hands each wreck to `each` as a file of this name; both outcomes must occur.
fn torture(name: &str, sound: &[u8], mut each: impl FnMut(&Path) -> Result<(), Error>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, sound).unwrap();
    each(&path).unwrap_or_else(|e| panic!("{name}, undamaged: {e}"));
    let mut refused = 0;
    for seed in seeds() {
        let _ = std::fs::remove_file(&path);
        std::fs::write(&path, damaged(sound, seed)).unwrap();
        let peak = peak_of(|| {
            if let Err(e) = each(&path) {
                refused += 1;
                assert!(!e.to_string().is_empty());
            }
        });
        assert!(peak < MOST_BYTES, "{name}, seed {seed}: {peak} bytes in use");
    }
    assert!(refused > 0, "{name}: nothing was refused, the damage tests nothing");
}

fn options() -> OpenOptions {
    OpenOptions { max_pixels: 1 << 16, ..OpenOptions::default() }
}

/// Reads all frames, up to a thousand: damage can multiply the frames of an animation.
fn frames(path: &Path, options: &OpenOptions) -> Result<(), Error> {
    let mut source = open(path, options)?;
    for _ in 0..1000 {
        let Some(frame) = source.next_frame()? else { break };
        assert!(frame.pixels.width() * frame.pixels.height() <= 1 << 16);
    }
    Ok(())
}

/// Files of a folder of test data, by extension.
fn files(folder: &str, extensions: &[&str]) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut all: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    all.retain(|p| p.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)));
    all.sort();
    assert!(!all.is_empty());
    all
}

#[test]
fn damaged_stills_stacks_and_streams_are_survived() {
    // What no longer looks like itself would go to ffmpeg, which is another program: kept here are the first bytes.
    for path in files("tests/it/images", &["png", "tif", "jpg", "pgm", "ppm", "pfm", "bmp", "gif", "y4m"]) {
        let sound = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let head = if name.ends_with("bmp") { 18 } else { 9 };
        torture(&name, &sound, |p| {
            let now = std::fs::read(p).unwrap();
            if now.get(..head) == sound.get(..head) { frames(p, &options()) } else { Ok(()) }
        });
    }
}

#[test]
fn damaged_clips_are_survived() {
    for name in ["b_frames", "edit_list", "fragmented", "variable_rate"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/data/video/{name}.mp4"));
        let sound = std::fs::read(&path).unwrap();
        torture(&format!("{name}.mp4"), &sound, |p| {
            let mut source = boresight::io::video::open_mp4(p, &options())?;
            while source.next_frame()?.is_some() {}
            Ok(())
        });
    }
}

#[test]
fn raw_frames_of_any_length_are_survived() {
    let raw = RawFormat { width: 8, height: 4, pixel: RawType::U16Le };
    let raw_options = OpenOptions { raw: Some(raw), ..options() };
    let dir = tempfile::tempdir().unwrap();
    for n in [0, 1, 63, 64, 65, 200, 640] {
        let path = dir.path().join(format!("{n}.raw"));
        std::fs::write(&path, vec![7_u8; n]).unwrap();
        assert_eq!(frames(&path, &raw_options).is_ok(), n >= 64, "{n} bytes");
    }
}

/// Tables of tracks of every kind.
fn tables() -> Vec<(&'static str, String)> {
    let lines = |n: usize, of: &dyn Fn(usize) -> String| (0..n).map(of).collect::<String>();
    vec![
        ("result.txt", lines(40, &|k| format!("{},{},{}.5,20,10,30.25,0.9,-1,-1,-1\n", 1 + k / 4, 1 + k % 4, 10 * k))),
        ("gt.txt", lines(40, &|k| format!("{},{},{},20,10,30,1,{},0.5\n", 1 + k / 4, 1 + k % 4, 10 * k, 1 + k % 8))),
        (
            "kitti.txt",
            lines(30, &|k| format!("{} {} Car 0 1 -1.5 {k} 20 80 90.5 1.5 1.6 3.7 1 2 30 0.1 0.8\n", k / 3, k % 3))
                + "3 -1 DontCare -1 -1 -10 5 6 15 26 -1 -1 -1 -1 -1 -1 -1\n",
        ),
        (
            "points.csv",
            "frame,particle,x,y,mass\n".to_string() + &lines(40, &|k| format!("{},{},{k}.5,2,9\n", k / 4, k % 4)),
        ),
        (
            "spots.csv",
            "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,FRAME\nLabel,Spot ID,Track ID,Quality,X,Y,Frame\n\
Label,Spot ID,Track ID,Quality,X,Y,Frame\n,,,(quality),(pixel),(pixel),\n"
                .to_string()
                + &lines(20, &|k| format!("ID{k},{k},{},1,{k}.5,2.5,{}\n", k % 3, k / 3)),
        ),
    ]
}

#[test]
fn damaged_tables_of_tracks_are_survived_read_judged_and_written() {
    let dir = tempfile::tempdir().unwrap();
    for (name, sound) in tables() {
        let path = dir.path().join(name);
        std::fs::write(&path, &sound).unwrap();
        let truth = read(&path, None, ReadOptions::default(), false).unwrap().table;
        for skip_bad_rows in [false, true] {
            let options = ReadOptions { skip_bad_rows, keep_extra: true, ..ReadOptions::default() };
            let format = boresight::io::tracks::sniff(&path).unwrap();
            let mut n_refused = 0;
            torture(name, sound.as_bytes(), |p| {
                let read = read(p, Some(format), options, true);
                // With bad rows left out, only headers and doubled rows are refused: damage to rows counts as well.
                n_refused += u32::from(read.is_err() || read.as_ref().is_ok_and(|f| f.bad.count > 0));
                let file = read?;
                let _ = mot_scores(&truth, &file.table, &MatchOptions::default());
                for to in Format::ALL.into_iter().chain(Format::EXPORTS) {
                    let _ = write(&file.table, to, &mut Vec::new());
                }
                if skip_bad_rows && n_refused > 0 {
                    return Err(Error::new(boresight::ErrorKind::Damaged, "counted"));
                }
                Ok(())
            });
        }
    }
}

#[test]
fn damaged_tables_of_detections_are_survived() {
    let own = "frame,time_s,x_px,y_px,var_x_px2,cov_x_y_px2,var_y_px2,left_px,top_px,width_px,height_px,area_px,peak,sum,score\n"
        .to_string()
        + &(0..40).map(|k| format!("{},{}.04,{k},20,0.1,0,0.1,5,6,3,3,9,200,900,7\n", k / 4, k / 4)).collect::<String>();
    let mut all = tables();
    all.push(("detections.csv", own));
    for (name, sound) in all {
        for skip_bad_rows in [false, true] {
            let options = TableOptions { skip_bad_rows, ..TableOptions::default() };
            let mut refused = false;
            let sound_ones = |p: &Path| {
                let detections = read_detections(p, &options);
                refused |= detections.is_err() || detections.as_ref().is_ok_and(|t| t.n_skipped > 0);
                let _ = read_tracks(p, &options);
                // Not every table of tracks is one of detections: what matters is that nothing breaks.
                if refused { Err(Error::new(boresight::ErrorKind::Damaged, "refused")) } else { Ok(()) }
            };
            if matches!(name, "detections.csv" | "result.txt") {
                torture(name, sound.as_bytes(), sound_ones);
            }
        }
    }
}

/// A radar's plots of an antenna that turns in 2.5 s, own ship, and ships' reports.
fn radar_tables() -> [(&'static str, String); 3] {
    let plots = (0..60u32).map(|k| {
        let (turn, part) = (k / 3, 0.2 + 0.3 * f64::from(k % 3));
        let t = 2.5 * (f64::from(turn) + part);
        format!("{t},{},{},0.0004,900\n", std::f64::consts::TAU * part, 900 + 10 * k)
    });
    let own = (0..30u32).map(|k| format!("{},{},-{k}.5,{}\n", 2 * k, 3 * k, 350 + k));
    let ships = (0..40u32).map(|k| format!("23500{},{},{},50,90,-1.1,50.7\n", k % 4, 3 * k, 10 * k));
    [
        ("plots.csv", "t,azimuth_rad,range_m,var_az,var_r\n".to_string() + &plots.collect::<String>()),
        ("ownship.csv", "t,x,y,heading_deg\n".to_string() + &own.collect::<String>()),
        ("ais.csv", "mmsi,t,x,y,heading_deg,lon,lat\n".to_string() + &ships.collect::<String>()),
    ]
}

#[test]
fn damaged_tables_of_a_radar_its_ship_and_other_ships_are_survived() {
    let [plots, own, ships] = radar_tables();
    for (name, sound) in [&plots, &own] {
        for skip_bad_rows in [false, true] {
            let mut options = TableOptions { skip_bad_rows, ..TableOptions::default() };
            options.radar.azimuth_from = boresight::io::AzimuthFrom::Bow;
            let mut refused = false;
            torture(name, sound.as_bytes(), |p| {
                let other = if *name == plots.0 { &own } else { &plots };
                std::fs::write(p.with_file_name(other.0), &other.1).unwrap();
                let read = read_detections(p.with_file_name(plots.0), &options);
                refused |= read.as_ref().map_or(true, |t| t.n_skipped > 0 || !t.lost.is_empty());
                if let Ok(table) = &read {
                    let n: usize = table.scans.iter().map(|s| s.detections.len()).sum();
                    assert_eq!(n as u64, table.n_rows - table.n_skipped);
                    assert!(table.scans.windows(2).all(|w| w[0].time < w[1].time));
                    let finite =
                        |d: &boresight::Detection| d.position.iter().chain(d.cov.iter()).all(|v| v.is_finite());
                    assert!(table.scans.iter().flat_map(|s| &s.detections).all(finite));
                }
                if refused { Err(Error::new(boresight::ErrorKind::Damaged, "refused")) } else { Ok(()) }
            });
        }
    }
    torture(ships.0, ships.1.as_bytes(), |p| read_ship_reports(p, false).map(|_| ()));
}

#[test]
fn damaged_configurations_and_scenes_are_survived() {
    let config = toml::to_string(&Config::default()).unwrap();
    torture("config.toml", config.as_bytes(), |p| {
        let text = String::from_utf8_lossy(&std::fs::read(p).unwrap()).into_owned();
        Config::from_toml(&text, "config.toml").map(|_| ())
    });
    let seed = Seed::new(1);
    // The second has a radar.
    for name in ["ds2", "imager-radar"] {
        let scene = toml::to_string(&named(name, seed).unwrap()).unwrap();
        torture(&format!("{name}.toml"), scene.as_bytes(), |p| {
            let text = String::from_utf8_lossy(&std::fs::read(p).unwrap()).into_owned();
            let scene = SceneConfig::from_toml(&text)?;
            scene.build(seed).map(|_| ())
        });
    }
}

#[test]
fn damaged_folders_of_cells_are_survived() {
    let rows = "frame,track_id,x,y,width,height\n0,1,5,5,4,4\n0,2,15,9,4,4\n1,1,6,5,4,4\n2,1,7,5,4,4\n";
    let made = tempfile::tempdir().unwrap();
    std::fs::write(made.path().join("t.csv"), rows).unwrap();
    let table = read(&made.path().join("t.csv"), None, ReadOptions::default(), false).unwrap().table;
    write_folder(&table, Some(&made.path().join("RES")), Some((32, 24))).unwrap();
    for damaged in ["res_track.txt", "mask001.tif"] {
        let sound = std::fs::read(made.path().join("RES").join(damaged)).unwrap();
        torture(damaged, &sound, |p| {
            let folder = p.parent().unwrap();
            for entry in std::fs::read_dir(made.path().join("RES")).unwrap().map(|e| e.unwrap()) {
                if entry.file_name() != damaged {
                    std::fs::copy(entry.path(), folder.join(entry.file_name())).unwrap();
                }
            }
            read(folder, None, ReadOptions::default(), false).map(|_| ())
        });
    }
}

#[test]
fn a_damaged_seqinfo_is_passed_over() {
    let sound = b"[Sequence]\nname=MOT16-02\nimDir=img1\nframeRate=14\nseqLength=600\nimWidth=1920\n";
    torture("seqinfo.ini", sound, |p| {
        let table = p.with_file_name("det.txt");
        std::fs::write(&table, "1,-1,10,20,5,5,1,-1,-1,-1\n2,-1,11,20,5,5,1,-1,-1,-1\n").unwrap();
        let rate_hz = read_detections(&table, &TableOptions::default()).unwrap().rate_hz;
        assert!(rate_hz > 0.0 && rate_hz.is_finite());
        if rate_hz == 14.0 { Ok(()) } else { Err(Error::new(boresight::ErrorKind::Damaged, "another rate")) }
    });
}
