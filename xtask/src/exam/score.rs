//! One clip's figures: tracked as the command does without options, held against its truth.

use super::clips::{Clip, Near, truth};
use anyhow::Result;
use boresight::metrics::{MatchOptions, Rules, Similarity, mot_scores, preprocess};
use boresight::pipeline::{Input, run};
use boresight::{Config, PixelOrigin, Sink, TrackRow, TrackStatus, TrackTable, View, auto, track};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// A truth made by a tracker, as that of the particles, holds many pieces of a few frames: they say more of it than of a target.
pub const LONG_FRAMES: usize = 20;

/// What the tracks of a run say.
#[derive(Default)]
struct Reported {
    rows: Vec<TrackRow>,
    nis_sum: f64,
    n_nis: u64,
}

struct Collect(Arc<Mutex<Reported>>);

impl Sink for Collect {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for t in view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let m = t.kinematics.mean;
            let (frame, id) = (view.scan.index.0 as u32, t.id.0 as i64);
            seen.rows.push(TrackRow { frame, id, bbox: [m[0], m[2], 0.0, 0.0], score: 1.0, ..TrackRow::default() });
            if let Some(i) = &t.innovation {
                seen.nis_sum += i.nis;
                seen.n_nis += 1;
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

/// Mean of what is finite.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0u32);
    for v in values.filter(|v| v.is_finite()) {
        (sum, n) = (sum + v, n + 1);
    }
    (n > 0).then(|| sum / f64::from(n))
}

/// The figures of a clip.
pub struct Score {
    /// Share of the truth's rows with a reported track near.
    pub held: f64,
    /// The same of targets that are in the truth in more than [`LONG_FRAMES`] frames.
    pub held_long: Option<f64>,
    /// Share of the reported rows that are near a target.
    pub precision: Option<f64>,
    pub idf1: Option<f64>,
    /// Targets held in at least half of their rows, and all.
    pub found: [usize; 2],
    /// Reported tracks that are a target's in half of their rows or more, per target.
    pub ids_a_target: f64,
    /// The other reported tracks, in words.
    pub false_tracks: Option<Vec<String>>,
    /// Median distance of the nearest reported track from a held target, px.
    pub error_px: f64,
    pub minutes: f64,
    /// Mean normalised innovation squared: 2 is honest.
    pub nis: f64,
    pub ms_a_frame: f64,
    /// What was chosen, in the words of the choice.
    pub chosen: String,
}

/// Tracks a clip without options and scores the result.
pub fn score(clip: &Clip, sets: &[String], request: &auto::Request) -> Result<Score> {
    score_asked(clip, sets, request, None)
}

/// The same, scored before frame `until`.
pub fn score_asked(clip: &Clip, sets: &[String], request: &auto::Request, until: Option<u32>) -> Result<Score> {
    let mut truth = truth(&clip.truth, &clip.columns)?;
    truth.retain(|r| until.is_none_or(|u| r.frame < u));
    let started = std::time::Instant::now();
    let (mut source, mut choice) = auto::open_and_choose(&clip.input, &Config::default(), request)?;
    let set = |config: Config| sets.iter().try_fold(config, |config, set| config.with(set));
    let detector = auto::learn(&mut source, &mut choice, request, set)?;
    let config = choice.config;
    let tracker = track::build(&config.tracker)?;
    let seen = Arc::new(Mutex::new(Reported::default()));
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Collect(Arc::clone(&seen)))];
    let go_on = &mut |_: &boresight::pipeline::Summary| ControlFlow::Continue(());
    let (summary, broken) =
        run(Input::Frames(Box::new(source), detector), Some(tracker), sinks, go_on).all_written()?;
    if let Some(e) = broken {
        return Err(e.into());
    }
    let ms_a_frame = 1e3 * started.elapsed().as_secs_f64() / summary.frames.max(1) as f64;
    let mut seen = std::mem::take(&mut *seen.lock().unwrap_or_else(PoisonError::into_inner));
    // Beyond the last frame of the truth nothing is known.
    let last = truth.iter().map(|r| r.frame).max();
    seen.rows.retain(|r| last.is_none_or(|last| r.frame <= last));
    let near = nearness(&truth, &seen.rows, clip.near);
    let n_targets = truth.iter().map(|r| r.id).collect::<BTreeSet<_>>().len().max(1);
    Ok(Score {
        held: near.errors.len() as f64 / truth.len().max(1) as f64,
        held_long: near.held_long,
        precision: clip.whole.then(|| near.n_near as f64 / seen.rows.len().max(1) as f64),
        idf1: if clip.whole { Some(idf1(&truth, seen.rows, clip.near)?) } else { None },
        found: [near.n_found, n_targets],
        ids_a_target: near.n_true_tracks as f64 / n_targets as f64,
        false_tracks: clip.whole.then_some(near.false_tracks),
        error_px: median(near.errors),
        minutes: summary.duration_s / 60.0,
        nis: seen.nis_sum / seen.n_nis as f64,
        ms_a_frame,
        chosen: choice.reasons.iter().skip(1).find(|r| !is_of_frames(r)).cloned().unwrap_or_default(),
    })
}

/// Which frames were looked at: the first reason, or the second where they are later ones.
fn is_of_frames(reason: &str) -> bool {
    reason.contains("frames/s (")
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
}

struct Nearness {
    /// Of each held target in each frame, px.
    errors: Vec<f64>,
    held_long: Option<f64>,
    n_found: usize,
    n_near: usize,
    n_true_tracks: usize,
    false_tracks: Vec<String>,
}

fn is_near(r: &TrackRow, t: &TrackRow, near: Near) -> bool {
    let (dx, dy) = ((r.bbox[0] - t.bbox[0]).abs(), (r.bbox[1] - t.bbox[1]).abs());
    match near {
        Near::Px(px) => dx.hypot(dy) <= px,
        Near::Box(px) => dx <= 0.5 * t.bbox[2] + px && dy <= 0.5 * t.bbox[3] + px,
    }
}

fn by_frame(rows: &[TrackRow]) -> BTreeMap<u32, Vec<&TrackRow>> {
    let mut out: BTreeMap<u32, Vec<&TrackRow>> = BTreeMap::new();
    for r in rows {
        out.entry(r.frame).or_default().push(r);
    }
    out
}

fn at<'a, 'r>(rows: &'a BTreeMap<u32, Vec<&'r TrackRow>>, frame: u32) -> &'a [&'r TrackRow] {
    rows.get(&frame).map_or(&[], Vec::as_slice)
}

/// Who is near whom, without pairing one to one: a second track on one target is no false one, it costs IDF1.
fn nearness(truth: &[TrackRow], result: &[TrackRow], near: Near) -> Nearness {
    let (results, truths) = (by_frame(result), by_frame(truth));
    let distance = |r: &TrackRow, t: &TrackRow| (r.bbox[0] - t.bbox[0]).hypot(r.bbox[1] - t.bbox[1]);
    let nearest = |t: &TrackRow| {
        let here = at(&results, t.frame).iter().filter(|r| is_near(r, t, near));
        here.map(|r| distance(r, t)).min_by(f64::total_cmp)
    };
    let (mut errors, mut of_target) = (Vec::new(), BTreeMap::<i64, [usize; 2]>::new());
    for t in truth {
        let found = nearest(t);
        let of = of_target.entry(t.id).or_default();
        *of = [of[0] + 1, of[1] + usize::from(found.is_some())];
        errors.extend(found);
    }
    let long = of_target.values().filter(|[rows, _]| *rows > LONG_FRAMES);
    let [rows, held] = long.fold([0, 0], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
    let held_long = (rows > 0).then(|| held as f64 / rows as f64);
    let n_found = of_target.values().filter(|[rows, held]| 2 * held >= *rows).count();
    let mut tracks: BTreeMap<i64, (usize, Vec<&TrackRow>)> = BTreeMap::new();
    for r in result {
        let hit = at(&truths, r.frame).iter().any(|t| is_near(r, t, near));
        let track = tracks.entry(r.id).or_default();
        track.0 += usize::from(hit);
        track.1.push(r);
    }
    let n_near = tracks.values().map(|t| t.0).sum();
    let (true_tracks, false_tracks): (Vec<_>, Vec<_>) =
        tracks.iter().partition(|(_, (hits, rows))| 2 * hits >= rows.len());
    let in_words = |(id, (_, rows)): (&i64, &(usize, Vec<&TrackRow>))| {
        let place = |r: &TrackRow| format!("frame {} ({:.0}, {:.0})", r.frame, r.bbox[0], r.bbox[1]);
        let ends = rows.first().zip(rows.last()).map(|(a, b)| format!("{} to {}", place(a), place(b)));
        format!("false track {id}: {}", ends.unwrap_or_default())
    };
    Nearness {
        errors,
        held_long,
        n_found,
        n_near,
        n_true_tracks: true_tracks.len(),
        false_tracks: false_tracks.into_iter().map(in_words).collect(),
    }
}

/// IDF1 by positions; a target's reach is one for the whole clip: half the median diagonal of its boxes and what they grow by.
fn idf1(truth: &[TrackRow], result: Vec<TrackRow>, near: Near) -> Result<f64> {
    let reach = match near {
        Near::Px(px) => px,
        Near::Box(px) => 0.5 * median(truth.iter().map(|t| t.bbox[2].hypot(t.bbox[3])).collect()) + px,
    };
    let point = |r: &TrackRow| TrackRow { bbox: [r.bbox[0], r.bbox[1], 0.0, 0.0], ..*r };
    let truth = TrackTable::from_rows("truth", PixelOrigin::Centre0, truth.iter().map(point))?;
    let result = TrackTable::from_rows("boresight", PixelOrigin::Centre0, result)?;
    let (truth, result) = preprocess(&truth, &result, Rules::None)?;
    let similarity = Similarity::Centre { zero_distance_px: 2.0 * reach };
    Ok(mot_scores(&truth, &result, &MatchOptions { similarity, threshold: 0.5 })?.identity.idf1())
}
