//! What every detector that can be asked for would find in an input, before anything is run: for a person who chooses by looking.
//!
//! Source: our own. How:
//! 1. the candidates: the choice without options, and each [`DetectorKind`] configured as `--detector` would, from the first frames ([`super::choose`]);
//! 2. the frames: twelve short runs over the whole input (`moments`);
//! 3. each candidate detects in them as in a run, with a clock that passes over the gaps between the runs;
//! 4. the evidence: what its detections gain by being told as chains of moving targets ([`super::evidence`]), the runs' together.
//!
//! Limits: runs are short, so a target that hardly moves within 14 frames gains nothing; `integrate` sums more frames than a run has and is not drawn.

mod moments;

use self::moments::Moments;
use super::choose::{Choice, choose_looked, looked_again};
use super::evidence::{Evidence, SURE_GAIN};
use super::first_scans::MOST_SCANS;
use super::ground::{self, Ground};
use super::open::{of_held, probed};
use super::request::{DetectorKind, Request};
use super::scene::{self, Camera};
use super::second_look::Second;
use super::shaken;
use super::sightings::Sightings;
use super::{PROBE_FRAMES, second_look};
use crate::camera::{CameraConfig, CameraMotionEstimator};
use crate::io::{Colour, MOST_BYTES, OpenOptions, Replay, frames_ahead};
use crate::report::{ContactSheet, SheetMark, SheetPicture, SheetRow};
use crate::vision::DetectorConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Error, ErrorKind, Frame, FrameSource, Homography, Result, Scan, SourceInfo, Timestamp};
use std::ffi::OsStr;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most marks drawn on a picture.
const MOST_MARKS: usize = 1500;

/// One way to detect.
struct Candidate {
    /// Options of the command beside the input's.
    options: Option<DetectorKind>,
    choice: Result<Choice>,
}

/// Looks at an input with every detector that can be asked for; the page's commands begin with `command`.
///
/// `base` says how the input is read.
/// # Errors
/// A stream, which cannot be looked at twice; an input that cannot be read.
pub fn preview(input: impl AsRef<OsStr>, base: &Config, request: &Request, command: &str) -> Result<ContactSheet> {
    let input = input.as_ref();
    if !second_look::can_be_opened_twice(input) {
        return Err(Error::new(ErrorKind::Unsupported, "a preview looks over a whole file, and a stream has none")
            .at(input.display())
            .hint("give a file or a folder, or record some seconds first: ffmpeg -i ADDRESS -t 20 -c copy some.mp4"));
    }
    // Decoding is one thread's work: the frames to show are read while the first ones are looked at.
    let (of_choice, shown) = std::thread::scope(|scope| {
        let shown = scope.spawn(|| {
            let grey = read(input, base, base.input.colour)?;
            let in_colour = base.input.colour != Colour::Gray;
            let coloured =
                in_colour.then(|| read_runs(input, base, Colour::Rgb, &firsts(&grey.moments))).transpose()?;
            Ok::<_, Error>((grey, coloured.unwrap_or_default()))
        });
        let of_choice = candidates(input, base, request);
        (of_choice, shown.join().unwrap_or_else(|e| std::panic::resume_unwind(e)))
    });
    let ((info, mut candidates, camera), (grey, mut coloured)) = (of_choice?, shown?);
    drop_same(&mut candidates);
    let wants_colour = |c: &Candidate| c.choice.as_ref().is_ok_and(|c| c.config.input.colour == Colour::Rgb);
    if candidates.iter().any(wants_colour) {
        coloured = read_runs(input, base, Colour::Rgb, &grey.moments.runs)?;
    }
    let ground = if camera == Camera::Fixed { Vec::new() } else { grounds(&grey.runs) };
    let mut sheet = ContactSheet::new(&input.to_string_lossy(), &info);
    sheet.note = reach(&grey, &info);
    let with_colours = !coloured.is_empty() && coloured.len() == grey.runs.len();
    for (k, run) in grey.runs.iter().enumerate() {
        let shown = if with_colours { &coloured[k] } else { run };
        sheet.pictures.extend(shown.first().map(SheetPicture::of));
    }
    sheet.rows = side_by_side(request.n_threads(), &candidates, |candidate| {
        let own = if wants_colour(candidate) { &coloured } else { &grey.runs };
        row(candidate, own, &ground, &info, command)
    });
    sheet.rows.sort_by_key(|row| row.refusal.is_some());
    Ok(sheet)
}

/// The source's facts, the candidates, and whether the camera stands.
fn candidates(input: &OsStr, base: &Config, request: &Request) -> Result<(SourceInfo, Vec<Candidate>, Camera)> {
    let beside = (base.input.colour != Colour::Rgb).then(second_look::beside);
    let options = OpenOptions { colours_beside: beside.clone(), ..base.input.open_options() };
    let source = base.input.mend(crate::io::open(input, &options)?)?;
    let n = frames_ahead(source.info(), MOST_SCANS, MOST_BYTES);
    let mut first = Replay::new(source, n.min(PROBE_FRAMES)).up_to(n);
    let info = first.info().clone();
    let seen = scene::look(probed(first.ahead()), &info)?;
    let shaken = shaken::look_on(&seen, &mut first)?;
    let camera = seen.camera;
    // As for a run: frames held say it, or those of another reading; for a detector that is asked for always the latter.
    let beside = beside.filter(|_| camera != Camera::Moving);
    let kept = beside.and_then(|beside| second_look::from_beside(&beside, &mut first));
    let alone = Request { threads: NonZeroUsize::new(1), ..*request };
    let chosen = match &kept {
        Some(held @ second_look::Read::Coloured(_)) => of_held(held, &mut first, &seen, shaken.as_ref(), base, &alone)?,
        _ => None,
    };
    let second = match kept {
        Some(second_look::Read::All(frames)) => frames,
        _ if camera == Camera::Moving => Vec::new(),
        _ => second_look::frames(input, base, PROBE_FRAMES),
    };
    let held = first.ahead();
    let second = Second::of(&second).with(shaken.as_ref(), held);
    let frames = probed(held);
    let seen = looked_again(seen, &second, &info)?;
    let of_all = chosen.is_none().then_some(None);
    let kinds: Vec<_> = of_all.into_iter().chain(DetectorKind::ALL.into_iter().map(Some)).collect();
    let mut candidates = side_by_side(request.n_threads(), &kinds, |kind| {
        let asked = Request { detector: *kind, ..alone };
        Candidate { options: *kind, choice: choose_looked(frames, &seen, &second, &info, base, &asked) }
    });
    if let Some(chosen) = chosen {
        candidates.insert(0, Candidate { options: None, choice: Ok(chosen) });
    }
    Ok((info.clone(), candidates, camera))
}

/// The results of a function for each of some things, in their order, made on several threads.
fn side_by_side<T: Sync, R: Send>(n_threads: usize, things: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut own = Vec::new();
        while let Some((i, thing)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, things.get(i)?)))
        {
            own.push((i, f(thing)));
        }
        own
    };
    let mut all: Vec<(usize, R)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..n_threads.min(things.len())).map(|_| scope.spawn(work)).collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e))
        };
        workers.into_iter().flat_map(join).collect()
    });
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, r)| r).collect()
}

/// Leaves out what the choice without options is itself.
fn drop_same(candidates: &mut Vec<Candidate>) {
    let of = |c: &Candidate| c.choice.as_ref().ok().map(|c| c.config.detector.clone());
    let Some(chosen) = candidates.first().and_then(of) else { return };
    candidates.retain(|c| c.options.is_none() || of(c).is_none_or(|d| d != chosen));
}

/// What was read.
struct Read {
    moments: Moments,
    runs: Vec<Vec<Frame>>,
}

/// The runs of an input.
fn read(input: &OsStr, base: &Config, colour: Colour) -> Result<Read> {
    let mut source = open(input, base, colour)?;
    let info = source.info().clone();
    let px = (info.width * info.height).max(1) as u64;
    let n = match info.n_frames {
        Some(n) => n,
        // Read once to know how many there are.
        None => {
            let mut n = 0;
            while n < Moments::most_read(px) {
                let Ok(Some(frame)) = source.next_frame() else { break };
                n += 1;
                source.recycle(frame);
            }
            n
        }
    };
    let entries = source.entries();
    let last = entries.last().map_or(0, |e| e + 1);
    let moments = Moments::choose(n.max(last), px, px * info.kind.bytes() as u64, &entries);
    drop(source);
    let runs = read_runs(input, base, colour, &moments.runs)?;
    Ok(Read { moments, runs })
}

fn open(input: &OsStr, base: &Config, colour: Colour) -> Result<Box<dyn FrameSource>> {
    let options = crate::io::OpenOptions { colour, ..base.input.open_options() };
    let source = crate::io::open(input, &options)?;
    if source.info().kind == crate::PixelKind::Rgb8 { Ok(source) } else { base.input.mend(source) }
}

/// The first frame of each run.
fn firsts(moments: &Moments) -> Vec<Vec<u64>> {
    moments.runs.iter().map(|run| run.iter().copied().take(1).collect()).collect()
}

/// Reads runs of frames; what is lost of the input is lost of its run.
fn read_runs(input: &OsStr, base: &Config, colour: Colour, runs: &[Vec<u64>]) -> Result<Vec<Vec<Frame>>> {
    let mut source = open(input, base, colour)?;
    let wanted: std::collections::BTreeSet<u64> = runs.iter().flatten().copied().collect();
    let last = wanted.last().copied().unwrap_or(0);
    let set = wanted.clone();
    source.want_only(Box::new(move |k| set.contains(&k)));
    let mut out: Vec<Vec<Frame>> = runs.iter().map(|_| Vec::new()).collect();
    while let Ok(Some(frame)) = source.next_frame() {
        let k = frame.index.0;
        if wanted.contains(&k) && frame.pixels.width() > 0 {
            let run = runs.iter().position(|run| run.contains(&k));
            run.and_then(|r| out.get_mut(r)).into_iter().for_each(|run| run.push(frame.clone()));
        }
        source.recycle(frame);
        if k >= last {
            break;
        }
    }
    out.retain(|run| !run.is_empty());
    if out.is_empty() {
        return Err(Error::new(ErrorKind::Damaged, "no frame of it can be read").at(input.display()));
    }
    Ok(out)
}

/// Where the first frame's ground of each run lies in its frames.
fn grounds(runs: &[Vec<Frame>]) -> Vec<Vec<Ground>> {
    let of = |run: &Vec<Frame>| {
        let mut motion = CameraMotionEstimator::default();
        let step = |f: &Frame| motion.step(&f.pixels).map_or(Homography::identity(), |s| s.now_from_before);
        let steps: Vec<Homography> = run.iter().map(step).collect();
        ground::follow(&run.iter().collect::<Vec<_>>(), &steps)
    };
    runs.iter().map(of).collect()
}

/// How far the look reached, where it is not the whole input.
fn reach(read: &Read, info: &SourceInfo) -> String {
    let (first, last) = (read.runs.first().and_then(|r| r.first()), read.runs.last().and_then(|r| r.first()));
    let span = match (first, last) {
        (Some(a), Some(b)) => format!("{:.1} s to {:.1} s", a.time.as_secs_f64(), b.time.as_secs_f64()),
        _ => String::new(),
    };
    let n = read.moments.n_reached;
    match info.n_frames {
        Some(all) if n < all => format!(
            "{} moments of the first {n} of {all} frames ({span}): later ones cannot be reached without decoding all before them.",
            read.runs.len()
        ),
        None if n >= Moments::most_read((info.width * info.height).max(1) as u64) => {
            format!("{} moments of the first {n} frames ({span}).", read.runs.len())
        }
        _ => format!("{} moments of the whole input ({span}).", read.runs.len()),
    }
}

/// What a candidate finds.
fn row(
    candidate: &Candidate,
    runs: &[Vec<Frame>],
    ground: &[Vec<Ground>],
    info: &SourceInfo,
    command: &str,
) -> SheetRow {
    let mut row = SheetRow {
        number: candidate.options.map_or(1, DetectorKind::candidate),
        name: candidate.options.map_or_else(|| "the choice without options".to_string(), |k| k.to_string()),
        purpose: candidate.options.map_or(String::new(), |k| k.purpose().to_string()),
        command: candidate.options.map_or_else(|| command.to_string(), |k| format!("{command} --detector {k}")),
        ..SheetRow::default()
    };
    let choice = match &candidate.choice {
        Ok(choice) => choice,
        Err(e) => {
            row.refusal = Some(e.to_string().lines().next().unwrap_or_default().to_string());
            return row;
        }
    };
    if candidate.options.is_none() {
        row.purpose = format!("chosen: {}", choice.config.detector.threshold.name());
    }
    if let ThresholdConfig::Integrate(c) = &choice.config.detector.threshold {
        row.refusal = Some(format!("It sums {} frames and more in a row: single moments do not show it.", c.frames));
        return row;
    }
    if matches!(choice.config.detector.threshold, ThresholdConfig::Bernoulli(_)) {
        row.refusal =
            Some("It carries what may be there from frame to frame: single moments do not show it.".to_string());
        return row;
    }
    match detect(&choice.config.detector, runs, info) {
        Ok(scans) => found(&mut row, runs, &scans, ground, (info.width * info.height).max(1) as f64),
        Err(e) => row.refusal = Some(e.to_string().lines().next().unwrap_or_default().to_string()),
    }
    row
}

/// The scans of the runs, on a clock in which a run follows the one before without a gap.
fn detect(config: &DetectorConfig, runs: &[Vec<Frame>], info: &SourceInfo) -> Result<Vec<Scan>> {
    let mut config = config.clone();
    if config.camera == CameraConfig::Moving {
        config.camera = CameraConfig::Fixed;
    }
    let kind = runs.iter().flatten().next().map_or(info.kind, |f| f.pixels.kind());
    let mut detector = crate::vision::build(&config, &SourceInfo { kind, ..info.clone() })?;
    if detector.prime_s() > 0.0 {
        let firsts: Vec<Frame> = runs.iter().filter_map(|r| r.first().cloned()).collect();
        detector.prime(&firsts)?;
    }
    let mut scans = Vec::new();
    let mut ahead_ns = 0;
    for run in runs {
        let Some(first) = run.first().map(|f| f.time.ns) else { continue };
        let frame = |f: &Frame| Frame { time: Timestamp::from_ns(f.time.ns - first + ahead_ns), ..f.clone() };
        let run: Vec<Frame> = run.iter().map(frame).collect();
        for frame in &run {
            let mut scan = Scan::default();
            detector.detect(frame, &mut scan)?;
            scans.push(scan);
        }
        let step = run.get(1).map_or(40_000_000, |f| f.time.ns - ahead_ns);
        ahead_ns = run.last().map_or(ahead_ns, |f| f.time.ns) + step.max(1);
    }
    Ok(scans)
}

/// Counts, evidence and marks.
fn found(row: &mut SheetRow, runs: &[Vec<Frame>], scans: &[Scan], ground: &[Vec<Ground>], area_px2: f64) {
    let counts: Vec<usize> = scans.iter().map(|s| s.detections.len()).collect();
    row.per_frame = counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64;
    row.range = [counts.iter().min().copied().unwrap_or(0), counts.iter().max().copied().unwrap_or(0)];
    let (mut rest, mut gain) = (scans, 0.0);
    for (k, run) in runs.iter().enumerate() {
        let (own, later) = rest.split_at(run.len().min(rest.len()));
        rest = later;
        let seen = own.iter().enumerate().map(|(i, s)| Sightings::of(s, ground.get(k).and_then(|g| g.get(i))));
        let evidence = Evidence::of(&seen.collect::<Vec<_>>(), area_px2);
        gain += evidence.gain();
        let mut marks: Vec<SheetMark> =
            own.first().into_iter().flat_map(|s| &s.detections).map(|d| SheetMark::of(&d.extent, d.position)).collect();
        marks.truncate(MOST_MARKS);
        row.marks.push(marks);
    }
    (row.gain, row.is_sure) = (Some(gain), gain > SURE_GAIN);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_their_things_for_any_number_of_threads() {
        let things: Vec<u64> = (0..37).collect();
        for n_threads in [1, 2, 5, 100] {
            assert_eq!(side_by_side(n_threads, &things, |k| k * k), things.iter().map(|k| k * k).collect::<Vec<_>>());
        }
        assert!(side_by_side(4, &[0u8; 0], |k| *k).is_empty());
    }

    #[cfg(feature = "video")]
    #[test]
    fn the_drone_of_the_sample_clip_is_marked_by_the_choice_and_moves() {
        let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
        let truth = std::fs::read_to_string(clip.replace(".mp4", ".gt.txt")).unwrap();
        let sheet = preview(clip, &Config::default(), &Request::default(), "boresight track clip").unwrap();
        assert_eq!((sheet.pictures.len(), sheet.size_px), (moments::RUNS, [320, 256]));
        let chosen = &sheet.rows[0];
        assert!(chosen.is_sure && chosen.command == "boresight track clip", "{chosen:?}");
        let mut hit = 0;
        for (picture, marks) in sheet.pictures.iter().zip(&chosen.marks) {
            // frame, id, left, top, width, height; frames and pixels from 1
            let boxes: Vec<Vec<f64>> = truth
                .lines()
                .map(|l| l.split(',').map(|v| v.trim().parse().unwrap_or(0.0)).collect())
                .filter(|r: &Vec<f64>| r[0] as u64 == picture.frame + 1)
                .collect();
            let near = |b: &Vec<f64>| {
                let (x, y) = (b[2] - 1.0 + b[4] / 2.0, b[3] - 1.0 + b[5] / 2.0);
                marks.iter().any(|SheetMark([l, t, w, h])| (l + w / 2.0 - x).hypot(t + h / 2.0 - y) < 8.0)
            };
            hit += usize::from(boxes.iter().all(near));
        }
        assert!(hit >= 11, "{hit} of 12");
        let colour = sheet.rows.iter().find(|r| r.name == "colour").unwrap();
        assert!(colour.refusal.is_some() && colour.command.ends_with("--detector colour"));
    }
}
