//! `cargo xtask detect-exam`: the detector of a stated false-alarm rate against what was asked of it, as Markdown.
//!
//! Tables: false alarms found against asked for, on ground without targets; detection on public single frames (`sirst_v1`,
//! `nudt_sirst`) at one setting for all; simulated spots against the Cramér-Rao bound; time. Scoring of the public frames is that of
//! BasicIRSTD: a target is found if the centroid of a detection lies within 3 px of its own; the pixels of detections that found no
//! target are false. Halves are the even and the odd frames. The bound of a Gaussian spot's position is σ_n √(2/π) / A on each axis.

use crate::detect_scenes::{Depth, Ground, Labelled, add_spots, ground, images, labelled, pixels, still};
use anyhow::Result;
use boresight::vision::cfar::{CfarConfig, CfarDetector};
use boresight::{Detection, Image, Pixels};
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `detect-exam`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the public data.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Simulated frames for each kind of ground.
    #[arg(long, default_value_t = 600)]
    frames: u64,
    /// Only tables whose name contains this: alarms, frames, spots, time.
    #[arg(long, default_value = "")]
    only: String,
}

/// False alarms a frame asked for.
const ASKED: [f64; 4] = [0.01, 0.1, 1.0, 10.0];
/// Settings of the curves on public frames.
const CURVE: [f64; 9] = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];

fn detector(rate: f64) -> CfarDetector {
    CfarDetector::new(&CfarConfig { false_alarms_per_frame: rate, ..CfarConfig::default() })
}

fn detect(detector: &mut CfarDetector, frame: &Pixels, out: &mut Vec<Detection>) {
    out.clear();
    match frame {
        Pixels::Gray8(i) => detector.detect(i, out),
        Pixels::Gray16(i) => detector.detect(i, out),
        Pixels::GrayF32(i) => detector.detect(i, out),
        Pixels::Rgb8(_) => {}
    }
}

/// Mean number of detections a frame at each rate asked for: stronger detections do not depend on weaker ones, so one run
/// at the largest rate holds all.
fn alarms(name: &str, mut frames: impl Iterator<Item = Result<Pixels>>) -> Result<()> {
    let mut detector = detector(10.0);
    let (mut out, mut counts, mut n) = (Vec::new(), [0usize; 4], 0);
    let mut per_frame = Vec::new();
    frames.try_for_each(|frame| {
        detect(&mut detector, &frame?, &mut out);
        for (count, asked) in counts.iter_mut().zip(ASKED) {
            *count += out.iter().filter(|d| f64::from(d.score) >= -asked.log10()).count();
        }
        per_frame.push(out.iter().filter(|d| d.score >= 0.0).count());
        n += 1;
        anyhow::Ok(())
    })?;
    let cells: Vec<String> = counts
        .iter()
        .zip(ASKED)
        .map(|(c, asked)| {
            let (mean, sd) = (*c as f64 / f64::from(n), (*c as f64).sqrt() / f64::from(n));
            format!("{mean:.3} ± {sd:.3} ({:.2})", mean / asked)
        })
        .collect();
    per_frame.sort_unstable();
    let median = per_frame.get(per_frame.len() / 2).copied().unwrap_or(0);
    println!("| {name} | {n} | {} | {median} |", cells.join(" | "));
    Ok(())
}

fn table_of_alarms(args: &Args, data: &std::path::Path) -> Result<()> {
    println!("\n## False alarms found, and their ratio to what was asked for\n");
    println!(
        "| ground | frames | 0.01 asked | 0.1 | 1 | 10 | median at 1 |\n| --- | --- | --- | --- | --- | --- | --- |"
    );
    for kind in [Ground::White, Ground::Correlated, Ground::OneOverF] {
        for depth in [Depth::Eight, Depth::Sixteen, Depth::Float] {
            let frames = (0..args.frames).map(|seed| Ok(pixels(&ground(kind, 320, 256, seed + 1), depth, 20.0)));
            alarms(&format!("{kind:?} {depth:?}, 320 x 256"), frames)?;
        }
    }
    let quiet = (0..args.frames).map(|seed| Ok(pixels(&ground(Ground::White, 320, 256, seed + 1), Depth::Eight, 0.5)));
    alarms("White Eight, deviation half a count", quiet)?;
    let names = images(&data.join("sirst_v2_empty"))?;
    alarms("sirst_v2_empty", names.iter().map(|p| Ok(Pixels::Gray8(still(p)?))))
}

/// Counts of one setting on labelled frames.
#[derive(Clone, Copy, Default)]
struct Count {
    targets: usize,
    found: usize,
    false_objects: usize,
    false_pixels: usize,
    pixels: usize,
    both: usize,
    either: usize,
}

fn score(frame: &Labelled, found: &[(&Detection, &[boresight::vision::cfar::Cell])], count: &mut Count) {
    let (w, h) = (frame.image.width(), frame.image.height());
    count.pixels += w * h;
    count.targets += frame.targets.len();
    let near = |d: &Detection, t: &(f64, f64)| (d.position.x - t.0).hypot(d.position.y - t.1) < 3.0;
    count.found += frame.targets.iter().filter(|t| found.iter().any(|(d, _)| near(d, t))).count();
    let mut painted = Image::filled(w, h, 0u8);
    for (d, cells) in found {
        let hit = frame.targets.iter().any(|t| near(d, t));
        let mut size = 0;
        for c in *cells {
            let clip =
                |from: i32, n: usize| from.clamp(0, n as i32) as usize..(from + c.side).clamp(0, n as i32) as usize;
            for y in clip(c.top, h) {
                for v in &mut painted.row_mut(y)[clip(c.left, w)] {
                    *v = 1;
                    size += 1;
                }
            }
        }
        if !hit {
            count.false_objects += 1;
            count.false_pixels += size;
        }
    }
    for (p, m) in painted.as_slice().iter().zip(frame.mask.as_slice()) {
        count.both += usize::from(*p > 0 && *m > 127);
        count.either += usize::from(*p > 0 || *m > 127);
    }
}

fn table_of_frames(name: &str, data: &std::path::Path) -> Result<()> {
    let frames = labelled(&data.join(name))?;
    let mut counts = [[Count::default(); CURVE.len()]; 2];
    for (i, frame) in frames.iter().enumerate() {
        let mut detector = detector(10.0);
        let mut out = Vec::new();
        detector.detect(&frame.image, &mut out);
        let all: Vec<_> = out.iter().zip(detector.regions()).collect();
        for (count, rate) in counts[i % 2].iter_mut().zip(CURVE) {
            let kept: Vec<_> = all.iter().copied().filter(|(d, _)| f64::from(d.score) >= -rate.log10()).collect();
            score(frame, &kept, count);
        }
    }
    println!("\n## {name}: {} frames, all, even half, odd half\n", frames.len());
    println!("| asked a frame | P_D % | false pixels, ppm | false objects a frame | a megapixel | IoU % |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (i, rate) in CURVE.iter().enumerate() {
        let [a, b] = [counts[0][i], counts[1][i]];
        let sum = |f: fn(&Count) -> usize| f(&a) + f(&b);
        let all = Count {
            targets: sum(|c| c.targets),
            found: sum(|c| c.found),
            false_objects: sum(|c| c.false_objects),
            false_pixels: sum(|c| c.false_pixels),
            pixels: sum(|c| c.pixels),
            both: sum(|c| c.both),
            either: sum(|c| c.either),
        };
        let halves = [frames.len(), frames.len().div_ceil(2), frames.len() / 2];
        let cell = |f: &dyn Fn(&Count, f64) -> f64, digits: usize| {
            let v =
                [all, a, b].iter().zip(halves).map(|(c, n)| format!("{:.digits$}", f(c, n as f64))).collect::<Vec<_>>();
            v.join(" / ")
        };
        println!(
            "| {rate} | {} | {} | {} | {} | {} |",
            cell(&|c, _| 100.0 * c.found as f64 / c.targets as f64, 1),
            cell(&|c, _| 1e6 * c.false_pixels as f64 / c.pixels as f64, 0),
            cell(&|c, n| c.false_objects as f64 / n, 2),
            cell(&|c, _| 1e6 * c.false_objects as f64 / c.pixels as f64, 1),
            cell(&|c, _| 100.0 * c.both as f64 / c.either as f64, 1),
        );
    }
    Ok(())
}

fn table_of_spots(args: &Args) {
    println!("\n## Ten spots of deviation 1.3 px a frame, 320 x 256, 16 bit, 0.1 false alarms asked for\n");
    println!("| peak / noise | found % | false a frame | rms x, y px | bound px | ratio | NEES (2) |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for snr in [3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 16.0, 25.0, 40.0] {
        let mut detector = detector(0.1);
        let mut out = Vec::new();
        let (mut n, mut found, mut wrong) = (0usize, 0usize, 0usize);
        let (mut squares, mut nees) = ([0.0f64; 2], 0.0);
        let frames = args.frames.min(200);
        for seed in 0..frames {
            let mut image = ground(Ground::White, 320, 256, 1000 + seed);
            let places = add_spots(&mut image, 10, snr, 1.3, seed);
            detect(&mut detector, &pixels(&image, Depth::Sixteen, 40.0), &mut out);
            n += places.len();
            let mut used = vec![false; out.len()];
            for p in &places {
                let distance = |d: &Detection| (d.position.x - p.0).hypot(d.position.y - p.1);
                let best = (0..out.len())
                    .filter(|i| !used[*i])
                    .min_by(|a, b| distance(&out[*a]).total_cmp(&distance(&out[*b])));
                if let Some(i) = best.filter(|i| distance(&out[*i]) < 3.0) {
                    used[i] = true;
                    found += 1;
                    let e = out[i].position - nalgebra::Vector2::new(p.0, p.1);
                    squares[0] += e.x * e.x;
                    squares[1] += e.y * e.y;
                    nees += out[i].cov.cholesky().map_or(f64::NAN, |c| e.dot(&c.solve(&e)));
                }
            }
            wrong += used.iter().filter(|u| !**u).count();
        }
        let f = found.max(1) as f64;
        let rms = squares.map(|s| (s / f).sqrt());
        let bound = (2.0 / std::f64::consts::PI).sqrt() / snr;
        println!(
            "| {snr} | {:.1} | {:.3} | {:.4}, {:.4} | {bound:.4} | {:.2} | {:.2} |",
            100.0 * found as f64 / n as f64,
            wrong as f64 / frames as f64,
            rms[0],
            rms[1],
            (rms[0] + rms[1]) / 2.0 / bound,
            nees / f,
        );
    }
}

fn table_of_time() {
    println!("\n## Time of a frame, one thread, median of 15\n");
    println!("| frame | spots | found | ms |\n| --- | --- | --- | --- |");
    for (w, h) in [(320, 256), (640, 512), (1920, 1080)] {
        for spots in [0, 1, 50, 1000] {
            let mut image = ground(Ground::White, w, h, 7);
            let placed = add_spots(&mut image, spots, 10.0, 1.3, 3).len();
            for (name, frame) in
                [("8 bit", pixels(&image, Depth::Eight, 8.0)), ("float", pixels(&image, Depth::Float, 8.0))]
            {
                let mut detector = detector(0.1);
                let mut out = Vec::new();
                let mut times: Vec<f64> = (0..15)
                    .map(|_| {
                        let start = Instant::now();
                        detect(&mut detector, &frame, &mut out);
                        start.elapsed().as_secs_f64() * 1e3
                    })
                    .collect();
                times.sort_by(f64::total_cmp);
                println!("| {w} x {h}, {name} | {placed} | {} | {:.2} |", out.len(), times[7]);
            }
        }
    }
}

pub fn run(args: &Args) -> Result<()> {
    let data = args.data.clone().unwrap_or_else(crate::data::test_data);
    let wanted = |name: &str| name.contains(&args.only);
    if wanted("time") {
        table_of_time();
    }
    if wanted("spots") {
        table_of_spots(args);
    }
    if wanted("frames") {
        table_of_frames("sirst_v1", &data)?;
        table_of_frames("nudt_sirst", &data)?;
    }
    if wanted("alarms") {
        table_of_alarms(args, &data)?;
    }
    Ok(())
}
