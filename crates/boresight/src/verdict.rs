//! The verdict on a run: one sentence that says what was found and whether its own statistics believe it, and what to try where they do not.
//!
//! Source: our own. A sink counts while the run goes on; the first of these that holds is said:
//! nothing was detected; nothing was tracked; only things at rest were tracked; the boxes are as large as a ground; tracks last for moments; the innovations
//! are not as large as the filter says; tracks come and go in the middle of the field; the run is too short to know a background. Otherwise the tracks are believed, and their covariances called right if the innovations are as large as stated and each is
//! a surprise: of a filter that lags, or of errors that last, they are alike from scan to scan, whatever their size.
//! Limits: it sees no truth. What moves like a target and is none (a branch, a reflection) is believed.

mod next;
mod within;

use crate::pipeline::Summary;
use crate::track::{ConfirmationConfig, Report};
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Result, Sink, TrackStatus, View};
use nalgebra::Vector2;
use next::{another_detector, is_of_spots, more_sensitive, noise_scaled};
use std::collections::BTreeMap;
use within::{Passage, Within};

/// A thing that was followed for so many detections and never reported stands still, or nearly.
const FOLLOWED_HITS: u32 = 10;
/// A box of this share of the frame is no target before its surroundings, but the surroundings.
const LARGE_SHARE: f64 = 0.25;
/// Tracks that last shorter than this in the mean follow moments, s: a person needs longer to see one.
const SHORT_S: f64 = 1.0;
/// They are doubted if there are at least so many, in a run at least so many times as long.
const SHORT_TRACKS: u64 = 10;
/// Mean normalised innovations squared (2 expected) from which on the covariances are wrong by more than a factor 2.
const HONEST_NIS: [f64; 2] = [1.0, 4.0];
/// Within these they are called right: a fifth off.
const RIGHT_NIS: [f64; 2] = [1.6, 2.4];
/// Correlation of innovations of scans in a row (0 expected) up to which they are surprises: 0.2 changes the variance of a mean of many by half.
const WHITE: f64 = 0.2;
/// A background is known from a run at least so many times as long as the time it is learnt in: then what stays in its place for half of that time is seen to come or go.
const LEAST_STARTS: f64 = 2.0;
/// Share of the detections that start tracks below which that is why there is none.
const FEW_START: f64 = 0.05;
/// Share of them that is proposed to start some: three of four.
const STARTING: f64 = 0.75;
/// Scores are counted in so many steps to the double, from a sixteenth on.
const STEPS_TO_DOUBLE: f32 = 8.0;
const N_STEPS: usize = 128;
/// Fewer innovations say nothing.
const LEAST_NIS: u64 = 50;

/// One track that lives.
#[derive(Clone, Copy, Debug, Default)]
struct Life {
    hits: u32,
    first_ns: Option<i64>,
    last_ns: i64,
    seen_at: u64,
    /// Innovation in the frame `seen_at`, in its deviations.
    innovation: Option<Vector2<f64>>,
    passage: Passage,
}

/// What is counted of a run beside its [`Summary`], in memory that does not grow with it.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    frames: u64,
    /// Time of the first frame.
    began_ns: Option<i64>,
    frames_with_tracks: u64,
    lives: BTreeMap<u64, Life>,
    ended: u64,
    ended_s: f64,
    followed: u64,
    rows: u64,
    large_rows: u64,
    /// Size of a frame, px, where there are frames.
    frame_px: Option<[f64; 2]>,
    within: Within,
    /// Products of innovations in a row and squares, both axes, in their deviations; number of the products.
    products: f64,
    squares: f64,
    n_products: u64,
    scores: Scores,
}

/// How many detections have which score.
#[derive(Clone, Debug)]
struct Scores([u64; N_STEPS]);

impl Default for Scores {
    fn default() -> Self {
        Self([0; N_STEPS])
    }
}

impl Scores {
    fn put(&mut self, score: f32) {
        let step = STEPS_TO_DOUBLE * (score.max(f32::MIN_POSITIVE).log2() + 4.0);
        self.0[(step.max(0.0) as usize).min(N_STEPS - 1)] += 1;
    }

    /// Share of detections that score as much, to a step.
    fn share_from(&self, score: f64) -> f64 {
        let (mut from, mut all) = (0, 0);
        for (k, n) in self.0.iter().enumerate() {
            all += n;
            from += if Self::begins_at(k) >= score { *n } else { 0 };
        }
        from as f64 / (all as f64).max(1.0)
    }

    /// The score that this share of them reaches, to a step.
    fn reached_by(&self, share: f64) -> f64 {
        (0..N_STEPS).rev().find(|k| self.share_from(Self::begins_at(*k)) >= share).map_or(0.0, Self::begins_at)
    }

    /// The score at which a step begins.
    fn begins_at(k: usize) -> f64 {
        2f64.powf(k as f64 / f64::from(STEPS_TO_DOUBLE) - 4.0)
    }
}

/// What is thought of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Verdict {
    /// One sentence.
    pub sentence: String,
    /// Whether the run's own statistics speak against its result.
    pub is_doubtful: bool,
    /// Options of `boresight track` to try next.
    pub next: Option<String>,
    /// Whether a look at what each detector finds (`boresight preview`) may help to choose another one.
    pub is_to_be_looked_at: bool,
}

/// Counts what a verdict needs; writes nothing.
#[derive(Debug)]
pub struct ObservedSink<'a>(&'a mut Observed);

impl Observed {
    /// Of frames of this size, px.
    pub fn of_frames(width: usize, height: usize) -> Self {
        Self { frame_px: Some([width as f64, height as f64]), ..Self::default() }
    }

    /// The sink through which a run is seen.
    pub fn sink(&mut self) -> ObservedSink<'_> {
        ObservedSink(self)
    }

    fn put(&mut self, view: &View<'_>) {
        let now = view.scan.time.ns;
        let began = *self.began_ns.get_or_insert(now);
        let interval_s = now.saturating_sub(began) as f64 * 1e-9 / self.frames.max(1) as f64;
        self.frames += 1;
        let frame_px = self.frame_px;
        // Scores say only why there is no track.
        if self.frames_with_tracks == 0 {
            view.scan.detections.iter().for_each(|d| self.scores.put(d.score));
        }
        let mut is_there = false;
        for t in view.tracks {
            let life = self.lives.entry(t.id.0).or_default();
            let innovation = t.innovation.as_ref().filter(|_| t.status != TrackStatus::Tentative);
            let innovation = innovation.map(|i| i.innovation.component_div(&i.cov.diagonal().map(f64::sqrt)));
            if let Some(now) = innovation.filter(|i| i.iter().all(|v| v.is_finite())) {
                self.squares += now.norm_squared();
                if let Some(before) = life.innovation.filter(|_| life.seen_at + 1 == self.frames) {
                    self.products += now.dot(&before);
                    self.n_products += 1;
                }
            }
            life.innovation = innovation;
            (life.seen_at, life.hits) = (self.frames, life.hits + u32::from(t.detection.is_some()));
            if t.status == TrackStatus::Tentative {
                continue;
            }
            is_there = true;
            life.first_ns.get_or_insert(now);
            life.last_ns = now;
            self.rows += 1;
            let box_px2 = t.extent.width_px * t.extent.height_px;
            if let Some([width, height]) = frame_px {
                self.large_rows += u64::from(box_px2 > LARGE_SHARE * width * height);
                life.passage.note(self.frames, t, [width, height], interval_s);
            }
        }
        self.frames_with_tracks += u64::from(is_there);
        let seen_at = self.frames;
        let mut gone = std::mem::take(&mut self.lives);
        gone.retain(|_, life| {
            let lives = life.seen_at == seen_at;
            if !lives {
                self.end(life);
                self.within.end(&life.passage);
            }
            lives
        });
        self.lives = gone;
    }

    /// Correlation of innovations of frames in a row; none of too few.
    fn correlation(&self) -> Option<f64> {
        (self.n_products >= LEAST_NIS && self.squares > 0.0).then(|| self.products / self.squares)
    }

    fn end(&mut self, life: &Life) {
        match life.first_ns {
            Some(first) => {
                self.ended += 1;
                self.ended_s += (life.last_ns - first) as f64 * 1e-9;
            }
            None => self.followed += u64::from(life.hits >= FOLLOWED_HITS),
        }
    }

    /// The verdict on a run with that configuration and that outcome.
    pub fn verdict(&self, config: &Config, summary: &Summary) -> Verdict {
        let mut all = self.clone();
        std::mem::take(&mut all.lives).values().for_each(|life| all.end(life));
        let doubt = |sentence: String, next: Option<String>| {
            // Another detector is a matter of looking, another parameter is not.
            let is_to_be_looked_at =
                summary.detections == 0 || next.as_ref().is_some_and(|n| n.starts_with("--detector"));
            Verdict { sentence, is_doubtful: true, next, is_to_be_looked_at }
        };
        let frames = counted(summary.frames, "frame");
        if summary.detections == 0 {
            return doubt(format!("no track: nothing was detected in {frames}."), more_sensitive(config));
        }
        if all.ended == 0 {
            let per_frame = summary.detections as f64 / summary.frames.max(1) as f64;
            if config.tracker.report == Report::Moving && all.followed > 0 {
                let things = counted(all.followed, "thing");
                return doubt(
                    format!(
                        "no track: {things} could be followed, but none moved farther than a thing at rest seems to."
                    ),
                    Some("--set tracker.report=all".to_string()),
                );
            }
            let least = config.tracker.min_initiation_score;
            let starting = all.scores.share_from(least);
            if least > 0.0 && starting < FEW_START {
                return doubt(
                    format!(
                        "no track: of {per_frame:.2} detections a frame {:.0} % have the score of {least} from which on one starts a track.",
                        100.0 * starting,
                    ),
                    Some(format!("--set tracker.min-initiation-score={:.1}", all.scores.reached_by(STARTING))),
                );
            }
            let next = match &config.tracker.confirmation {
                ConfirmationConfig::Existence(_) => "--false-tracks-per-hour 1000".to_string(),
                _ => format!("--set tracker.max-speed-px-per-s={}", 2.0 * config.tracker.max_speed_px_per_s),
            };
            return doubt(
                format!("no track: of {per_frame:.2} detections a frame none comes again as one of a target would."),
                Some(next),
            );
        }
        let mean_s = all.ended_s / all.ended as f64;
        let nis = summary.mean_nis.filter(|(mean, n)| *n >= LEAST_NIS && mean.is_finite()).map(|(mean, _)| mean);
        if 2 * self.large_rows > self.rows {
            return doubt(
                format!("most boxes cover more than {:.0} % of the frame: ground, not targets.", 100.0 * LARGE_SHARE),
                another_detector(config),
            );
        }
        if all.ended >= SHORT_TRACKS && mean_s < SHORT_S && summary.duration_s > SHORT_TRACKS as f64 * mean_s {
            // A track that is lost and found again comes in pieces under one number.
            let tracks = counted(summary.confirmed_tracks.min(all.ended), "track");
            let pieces =
                if all.ended > summary.confirmed_tracks { format!("{tracks} in {} pieces", all.ended) } else { tracks };
            return doubt(
                format!(
                    "{pieces} of {mean_s:.2} s in the mean: moments of clutter, or targets that are lost again and again."
                ),
                another_detector(config),
            );
        }
        if let Some(nis) = nis.filter(|n| !(HONEST_NIS[0]..=HONEST_NIS[1]).contains(n)) {
            let words = if nis > 2.0 { "too small" } else { "too large" };
            return doubt(
                format!(
                    "{}, but the stated covariances are {words}: mean NIS {nis:.2}, 2 is honest.",
                    self.found(mean_s, summary)
                ),
                Some(noise_scaled(&config.tracker, nis / 2.0)),
            );
        }
        if let Some(words) = all.within.doubt() {
            let next = another_detector(config).filter(|_| !is_of_spots(config));
            return doubt(format!("{}, but {words}.", self.found(mean_s, summary)), next);
        }
        if let ThresholdConfig::Moving(background) = &config.detector.threshold
            && summary.duration_s < LEAST_STARTS * background.start_s
        {
            return doubt(
                format!(
                    "{}, but {:.1} s show little of the ground: what covers a place for half of the first {} s is taken for it, and what it leaves for a target.",
                    self.found(mean_s, summary),
                    summary.duration_s,
                    background.start_s,
                ),
                another_detector(config),
            );
        }
        let honest = nis.map_or(String::new(), |n| {
            let words = match n {
                n if n < RIGHT_NIS[0] => "somewhat too large",
                n if n > RIGHT_NIS[1] => "somewhat too small",
                _ => "right",
            };
            let alike = all.correlation().filter(|c| c.abs() > WHITE);
            match (alike, words) {
                (Some(c), "right") => format!(
                    "; the innovations are as large as stated (mean NIS {n:.2}, 2 is honest) but alike from frame to frame (correlation {c:.2}, 0 is honest): the \
                     covariances of the means are not to be trusted"
                ),
                _ => format!("; the covariances are {words} (mean NIS {n:.2}, 2 is honest)"),
            }
        });
        Verdict {
            sentence: format!("{}{honest}.", self.found(mean_s, summary)),
            is_doubtful: false,
            next: None,
            is_to_be_looked_at: false,
        }
    }

    /// What was found, without the opinion.
    fn found(&self, mean_s: f64, summary: &Summary) -> String {
        let share = 100.0 * self.frames_with_tracks as f64 / self.frames.max(1) as f64;
        format!(
            "up to {} at once, one or more in {share:.0} % of the frames, followed for {mean_s:.1} s in the mean",
            counted(summary.most_at_once, "target")
        )
    }
}

impl Sink for ObservedSink<'_> {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.0.put(view);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// A number with its thing, in the plural where it is not one.
fn counted(n: u64, thing: &str) -> String {
    format!("{n} {thing}{}", if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests;
