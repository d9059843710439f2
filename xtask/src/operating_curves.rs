//! Operating curves: false tracks an hour allowed (`--false-tracks-per-hour`) against what came, the delay of confirmation and the share held.
//!
//! Scene: 640 x 512 px, 25 scans/s; targets come at six a minute, stay ten seconds on average and fly at 30 px/s with turns of density 25 px²/s³; they are seen
//! with 0.9 to 0.5 px; false detections are uniform. The choice learns from the first thousand scans, as `boresight track` does without options.
//! False: a reported track that is within 5 px of a target in fewer than half of its reported scans. Delay: scans from a target's coming to its first report.

use anyhow::Result;
use boresight::{Config, Detection, FrameIndex, Scan, Timestamp, TrackStatus, auto, track};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use std::collections::BTreeMap;
use std::fmt::Write as _;

#[derive(clap::Args)]
pub struct Args {
    /// Minutes of the scene.
    #[arg(long, default_value_t = 20.0)]
    minutes: f64,
    /// Seed of the scene.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

const FIELD: [f64; 2] = [640.0, 512.0];
const RATE_HZ: f64 = 25.0;
const P_D: f64 = 0.9;
const SIGMA: f64 = 0.5;
const SPEED: f64 = 30.0;
const DENSITY: f64 = 25.0;
const PER_MINUTE: f64 = 6.0;
const LIFE_S: f64 = 10.0;
const NEAR: f64 = 5.0;
/// False detections a scan of each curve.
const CLUTTER: [f64; 3] = [3.0, 30.0, 300.0];
const ALLOWED: [f64; 5] = [0.1, 1.0, 10.0, 100.0, 1000.0];

struct Target {
    born: usize,
    /// Position of each scan.
    way: Vec<Vector2<f64>>,
}

struct Point {
    false_per_hour: f64,
    delay: f64,
    held: f64,
    n_targets: usize,
}

fn scene(clutter: f64, args: &Args) -> Result<(Vec<Target>, Vec<Scan>)> {
    let mut rng = ChaCha12Rng::seed_from_u64(args.seed);
    let n = (args.minutes * 60.0 * RATE_HZ) as usize;
    let dt = 1.0 / RATE_HZ;
    let mut targets = Vec::new();
    for born in 0..n {
        if rng.random::<f64>() >= PER_MINUTE / 60.0 * dt {
            continue;
        }
        let mut normal = || Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let (mut v, middle) = (normal() * SPEED / 1.41, normal());
        let mut at = Vector2::new(320.0 + 100.0 * middle.x, 256.0 + 80.0 * middle.y);
        let mut way = Vec::new();
        let life = -LIFE_S * (1.0 - rng.random::<f64>()).ln();
        while (way.len() as f64) * dt < life.max(2.0)
            && born + way.len() < n
            && (0..2).all(|i| at[i] > 0.0 && at[i] < FIELD[i])
        {
            way.push(at);
            v += Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) * (DENSITY * dt).sqrt();
            at += v * dt;
        }
        targets.push(Target { born, way });
    }
    let n_false = Poisson::new(clutter)?;
    let mut places: Vec<Vec<Vector2<f64>>> = (0..n)
        .map(|_| {
            let k = n_false.sample(&mut rng) as usize;
            (0..k).map(|_| Vector2::new(FIELD[0] * rng.random::<f64>(), FIELD[1] * rng.random::<f64>())).collect()
        })
        .collect();
    for t in &targets {
        for (k, at) in t.way.iter().enumerate() {
            if rng.random::<f64>() < P_D {
                places[t.born + k].push(at + SIGMA * Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)));
            }
        }
    }
    let scan = |(k, places): (usize, &Vec<Vector2<f64>>)| {
        let d = places.iter().map(|p| Detection::at(*p, Matrix2::identity() * SIGMA * SIGMA)).collect();
        Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64 * dt)).with_detections(d)
    };
    Ok((targets, places.iter().enumerate().map(scan).collect()))
}

fn point(targets: &[Target], scans: &[Scan], allowed: f64, args: &Args) -> Result<Point> {
    let mut config = Config::default();
    auto::for_detections(scans, RATE_HZ, boresight::io::LengthUnit::Pixel, Some(allowed), &mut config, &mut Vec::new());
    let mut tracker = track::build(&config.tracker)?;
    let mut first: Vec<Option<usize>> = vec![None; targets.len()];
    let (mut held, mut all) = (0usize, 0usize);
    // Reported scans of each track, and those near a target.
    let mut tracks: BTreeMap<u64, [usize; 2]> = BTreeMap::new();
    for (k, scan) in scans.iter().enumerate() {
        let states = tracker.step(scan)?;
        let alive: Vec<(usize, Vector2<f64>)> =
            targets.iter().enumerate().filter_map(|(i, t)| Some((i, *t.way.get(k.checked_sub(t.born)?)?))).collect();
        all += alive.len();
        let mut seen = vec![false; alive.len()];
        for s in states.iter().filter(|s| s.status != TrackStatus::Tentative) {
            let at = Vector2::new(s.kinematics.mean[0], s.kinematics.mean[2]);
            let t = tracks.entry(s.id.0).or_default();
            t[0] += 1;
            let mut near = false;
            for (n, (i, target)) in alive.iter().enumerate() {
                if (target - at).norm() <= NEAR {
                    (near, seen[n]) = (true, true);
                    first[*i].get_or_insert(k);
                }
            }
            t[1] += usize::from(near);
        }
        held += seen.iter().filter(|s| **s).count();
    }
    let n_false = tracks.values().filter(|t| 2 * t[1] < t[0]).count();
    let mut delays: Vec<usize> = targets.iter().zip(&first).filter_map(|(t, f)| Some((*f)? - t.born)).collect();
    delays.sort_unstable();
    Ok(Point {
        false_per_hour: n_false as f64 * 60.0 / args.minutes,
        delay: delays.get(delays.len() / 2).map_or(f64::NAN, |d| *d as f64),
        held: held as f64 / all.max(1) as f64,
        n_targets: targets.len(),
    })
}

/// Runs the curves, prints them and writes `docs/operating-curves.md` and its picture.
pub fn run(args: &Args) -> Result<()> {
    let mut text = format!(
        "# Operating curves\n\n\
         What `--false-tracks-per-hour` gives: `cargo xtask operating-curves` writes this page. The scene: 640 x 512 px, 25 scans/s, {} minutes; targets come at {PER_MINUTE} a minute, \
         stay {LIFE_S} s on average and fly at {SPEED} px/s, seen with {P_D} to {SIGMA} px. Everything is learnt from the first 40 s, as without options. *False*: reported, and near (5 px) a \
         target in fewer than half of its scans. *Delay*: median of the scans from a target's coming to its first report. *Held*: share of the targets' scans with a reported track near. \
         The number asked for is a bound (docs/theory/track-management.md): fewer should come, and a rate below {:.0} an hour cannot be seen in {} minutes.\n\n\
         ![Delay against false tracks an hour](images/operating-curves.svg)\n\n\
         | false detections a scan | allowed an hour | false tracks an hour | delay, scans | held |\n| --- | --- | --- | --- | --- |\n",
        args.minutes,
        60.0 / args.minutes,
        args.minutes
    );
    let mut curves = Vec::new();
    for clutter in CLUTTER {
        let (targets, scans) = scene(clutter, args)?;
        let mut curve = Vec::new();
        for allowed in ALLOWED {
            let p = point(&targets, &scans, allowed, args)?;
            let row = format!(
                "| {clutter} | {allowed} | {:.0} | {:.0} | {:.1} % |\n",
                p.false_per_hour,
                p.delay,
                100.0 * p.held
            );
            print!("{row}");
            text += &row;
            curve.push((allowed, p.delay));
            anyhow::ensure!(p.n_targets > 0, "no targets in {} minutes: give more", args.minutes);
        }
        curves.push((clutter, curve));
    }
    let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs");
    std::fs::write(format!("{docs}/operating-curves.md"), text)?;
    std::fs::write(format!("{docs}/images/operating-curves.svg"), picture(&curves)?)?;
    Ok(())
}

/// Delay over the number allowed, one line for each density of clutter.
fn picture(curves: &[(f64, Vec<(f64, f64)>)]) -> Result<String> {
    let most = curves.iter().flat_map(|c| &c.1).map(|p| p.1).fold(1.0, f64::max).ceil() + 1.0;
    let x = |allowed: f64| 70.0 + 120.0 * (allowed.log10() + 1.0);
    let y = |delay: f64| 300.0 - 260.0 * delay / most;
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 680 360\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"680\" height=\"360\" fill=\"white\"/>\n",
    );
    for allowed in ALLOWED {
        writeln!(svg, "<line x1=\"{0}\" y1=\"40\" x2=\"{0}\" y2=\"300\" stroke=\"#ddd\"/>", x(allowed))?;
        writeln!(svg, "<text x=\"{}\" y=\"320\" text-anchor=\"middle\">{allowed}</text>", x(allowed))?;
    }
    for delay in (0..most as u32).step_by(2) {
        let at = y(f64::from(delay));
        writeln!(svg, "<line x1=\"70\" y1=\"{at:.1}\" x2=\"550\" y2=\"{at:.1}\" stroke=\"#ddd\"/>")?;
        writeln!(svg, "<text x=\"60\" y=\"{:.1}\" text-anchor=\"end\">{delay}</text>", at + 5.0)?;
    }
    for ((clutter, curve), colour) in curves.iter().zip(["#1b6ca8", "#2a9d5c", "#c8553d"]) {
        let points: Vec<String> = curve.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
        writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            points.join(" ")
        )?;
        let last = curve.last().map_or(0.0, |p| y(p.1));
        writeln!(svg, "<text x=\"560\" y=\"{:.1}\" fill=\"{colour}\">{clutter} a scan</text>", last + 5.0)?;
    }
    writeln!(svg, "<text x=\"310\" y=\"348\" text-anchor=\"middle\">false tracks allowed an hour</text>")?;
    writeln!(svg, "<text x=\"70\" y=\"24\">median delay of confirmation, scans</text>")?;
    svg += "</svg>\n";
    Ok(svg)
}
