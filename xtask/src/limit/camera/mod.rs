//! The camera's motion between two views of one ground: errors, honesty and time of what measures it here, beside OpenCV's on the same images.

mod judge;
mod pairs;
mod peers;

use anyhow::Result;
use boresight::camera::{CameraMotionEstimator, PlaneFollower};
use boresight::{Image, Pixels};
use judge::{Answer, Judged};
use pairs::{KINDS, Pair, Source};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// Frames of 1920 x 1080 px whose time is taken.
const FILM: usize = 30;

/// An estimator by name: what it says of the second of two views, and the time for both, s.
type Estimator = (&'static str, fn(&Pair) -> (Option<Answer>, f64));

const OURS: [Estimator; 2] = [("camera (runs)", similar), ("plane (steadied)", plane)];

fn similar(pair: &Pair) -> (Option<Answer>, f64) {
    let [before, after] = [0, 1].map(|i| Pixels::Gray8(pair.views[i].clone()));
    let start = Instant::now();
    let mut camera = CameraMotionEstimator::default();
    camera.step(&before);
    let motion = camera.step(&after);
    let time = start.elapsed().as_secs_f64();
    (motion.map(|m| Answer::of(pair, |p| m.now_from_before.apply(p), |p| Some(m.cov_at(p)))), time)
}

fn plane(pair: &Pair) -> (Option<Answer>, f64) {
    let [mut before, now] = [0, 1].map(|i| working(&pair.views[i]));
    let start = Instant::now();
    let mut follower = PlaneFollower::default();
    follower.step(&before);
    follower.keep(&mut before);
    let found = follower.step(&now);
    let time = start.elapsed().as_secs_f64();
    (found.map(|f| Answer::of(pair, |p| f.to_from.apply(p), |_| None)), time)
}

/// As the steadied detector prepares its images: smoothed by [1 2 1]/4 both ways.
fn working(image: &Image<u8>) -> Image<f32> {
    let (w, h) = (image.width(), image.height());
    let at =
        |x: i64, y: i64| f32::from(image.row(y.clamp(0, h as i64 - 1) as usize)[x.clamp(0, w as i64 - 1) as usize]);
    let mut out = Image::filled(w, h, 0.0);
    for y in 0..h {
        for x in 0..w {
            let (x, y) = (x as i64, y as i64);
            let across = |y: i64| 0.25 * (at(x - 1, y) + 2.0 * at(x, y) + at(x + 1, y));
            out.row_mut(y as usize)[x as usize] = 0.25 * (across(y - 1) + 2.0 * across(y) + across(y + 1));
        }
    }
    out
}

pub fn table((n, set): (usize, u32), data: &Path, python: Option<&Path>, wrong: bool, page: &mut String) -> Result<()> {
    let sources = pairs::sources(data)?;
    if sources.len() < 2 {
        writeln!(page, "No data.")?;
        return Ok(());
    }
    let pairs: Vec<Pair> = (0..n).into_par_iter().map(|k| pairs::pair(&sources, set, k)).collect::<Result<_>>()?;
    writeln!(page, "{} pairs of {} images.\n", pairs.len(), sources.len())?;
    writeln!(page, "{}", Judged::HEAD)?;
    let mut ours = Vec::new();
    for (name, estimator) in OURS {
        // One after the other: the time is one thread's.
        let judged: Vec<Judged> = pairs.iter().map(|pair| Judged::of(pair, estimator(pair))).collect();
        writeln!(page, "{}", judge::row(name, judged.iter()))?;
        ours.push((name, judged));
    }
    let film = pairs::film(&sources, FILM)?;
    let peers = python.map(|python| peers::run(python, &pairs, &film)).transpose()?.unwrap_or_default();
    for (name, judged) in &peers.pairs {
        writeln!(page, "{}", judge::row(name, judged.iter().flatten()))?;
    }
    times(&film, &peers.film, page)?;
    for (name, judged) in &ours {
        details(name, &pairs, judged, &sources, page)?;
        if wrong {
            list_wrong(name, &pairs, judged, &sources, page)?;
        }
    }
    if python.is_none() {
        writeln!(page, "\nOpenCV was not measured: `cargo xtask limit camera --python PATH` does.")?;
    }
    Ok(())
}

/// By kind of motion, with and without things that move by themselves, and by image.
fn details(name: &str, pairs: &[Pair], judged: &[Judged], sources: &[Source], page: &mut String) -> Result<()> {
    writeln!(page, "\n{name}:\n\n{}", Judged::HEAD.replacen("method", "pairs", 1))?;
    for (title, looked_at) in [("half that is looked at", true), ("half that is only reported", false)] {
        let of = judged.iter().enumerate().filter(|(k, _)| pairs::is_looked_at(sources, *k) == looked_at);
        writeln!(page, "{}", judge::row(title, of.map(|(_, j)| j)))?;
    }
    let mut row = |title: &str, fits: &dyn Fn(&Pair) -> bool| {
        let of = pairs.iter().zip(judged).filter(|(p, _)| fits(p)).map(|(_, j)| j);
        writeln!(page, "{}", judge::row(title, of))
    };
    for (kind, title) in KINDS.iter().enumerate() {
        row(title, &|p| p.kind == kind)?;
    }
    row("nothing moves by itself", &|p| p.patched == 0.0)?;
    row("up to a sixth moves by itself", &|p| p.patched > 0.0 && p.patched <= 1.0 / 6.0)?;
    row("a sixth to a third moves by itself", &|p| p.patched > 1.0 / 6.0)?;
    let mut shown: Vec<&str> = sources.iter().map(|s| s.shows).collect();
    shown.dedup();
    for shows in shown {
        row(shows, &|p| sources[p.source].shows == shows)?;
    }
    Ok(())
}

/// The pairs whose answer is wrong and not flagged, of the half that is looked at.
fn list_wrong(name: &str, pairs: &[Pair], judged: &[Judged], sources: &[Source], page: &mut String) -> Result<()> {
    writeln!(page, "\n{name}, wrong and not flagged:\n")?;
    writeln!(
        page,
        "| pair | image | kind | shift px | turn deg | zoom % | affine % | perspective % | noise | moves by itself % | error px | stated px |"
    )?;
    writeln!(page, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for (k, (pair, j)) in pairs.iter().zip(judged).enumerate().filter(|(k, _)| pairs::is_looked_at(sources, *k)) {
        let Some([error, stated]) = j.unflagged else { continue };
        let [dx, dy, turn, zoom, a, b, g, h] = pair.numbers;
        let percent = |v: f64| 100.0 * v;
        writeln!(
            page,
            "| {k} | {} | {} | {dx:.1}, {dy:.1} | {:.2} | {:.2} | {:.2}, {:.2} | {:.2}, {:.2} | {} | {:.0} | {error:.2} | {stated:.3} |",
            sources[pair.source].shows,
            KINDS[pair.kind],
            turn.to_degrees(),
            percent(zoom),
            percent(a),
            percent(b),
            percent(g),
            percent(h),
            pair.noise,
            percent(pair.patched)
        )?;
    }
    Ok(())
}

fn times(film: &[Image<u8>], peers: &[(String, f64)], page: &mut String) -> Result<()> {
    let frames: Vec<Pixels> = film.iter().map(|f| Pixels::Gray8(f.clone())).collect();
    let mut best = Vec::new();
    for _ in 0..5 {
        let mut camera = CameraMotionEstimator::default();
        let times = frames.iter().map(|f| {
            let start = Instant::now();
            std::hint::black_box(camera.step(f));
            start.elapsed().as_secs_f64()
        });
        let mut times: Vec<f64> = times.skip(1).collect();
        times.sort_by(f64::total_cmp);
        best.push([times[times.len() / 2], times[times.len() - 1]]);
    }
    best.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [median, most] = best[best.len() / 2];
    writeln!(page, "\n| 1920 x 1080, frame to frame | ms a frame, median |\n| --- | --- |")?;
    writeln!(page, "| {} | {:.2} (longest {:.2}) |", OURS[0].0, 1e3 * median, 1e3 * most)?;
    for (name, time) in peers {
        writeln!(page, "| {name} | {:.2} |", 1e3 * time)?;
    }
    Ok(())
}
