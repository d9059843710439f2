//! Tracks that come from nowhere and go nowhere: begun and ended in the middle of the field.
//!
//! Source: our own. A target comes and goes over the border of the field, or by way of something that hides it; what flares up and vanishes (glitter, waves, noise that a codec repeats, what goes out of
//! focus) does so anywhere, and of a target that is lost again and again there is a track for each time. Of a field whose rim is a twentieth of its shorter side 81 % and more are middle.
//! Limits: a track of the first [`CONFIRMING`] frames may have come before the run, and one that is there at its end goes after it: they are not counted; doors and trees are the middle of the field too.

use crate::TrackState;

/// Share of the shorter side that is the rim.
const RIM: f64 = 0.05;
/// Frames that a target takes to be a track, and to be missed: so long before or after it is seen it may have crossed the border, and so long a run takes to find those that were there before.
const CONFIRMING: u64 = 10;
/// Fewer tracks that came and went say nothing.
const LEAST: u64 = 10;

/// Where a track was.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Passage {
    /// Frame in which it was reported first, and whether that was within the field.
    began: Option<(u64, bool)>,
    /// Whether it is there now.
    is_within: bool,
}

impl Passage {
    /// Takes the next row of the track, in a field of that size, px; frames come at that interval, s.
    pub fn note(&mut self, frame: u64, track: &TrackState, [width, height]: [f64; 2], interval_s: f64) {
        let [x, vx, y, vy] = [0, 1, 2, 3].map(|i| track.kinematics.mean[i]);
        let half = 0.5 * track.extent.width_px.max(track.extent.height_px);
        let rim = RIM * width.min(height) + CONFIRMING as f64 * interval_s * vx.hypot(vy) + half;
        self.is_within = x.min(y).min(width - x).min(height - y) > rim;
        self.began.get_or_insert((frame, self.is_within));
    }
}

/// How many of the tracks that came and went did so within the field.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Within {
    all: u64,
    within: u64,
}

impl Within {
    /// Counts a track that has ended before the run did.
    pub fn end(&mut self, passage: &Passage) {
        if let Some((_, began_within)) = passage.began.filter(|(frame, _)| *frame > CONFIRMING) {
            self.all += 1;
            self.within += u64::from(began_within && passage.is_within);
        }
    }

    /// What is to be said if that is most of them.
    pub fn doubt(&self) -> Option<String> {
        (self.all >= LEAST && 2 * self.within > self.all).then(|| {
            format!(
                "{} of {} tracks that came and went did so in the middle of the field: things that flare up and vanish (glitter, waves, what blinks or goes out of focus), or targets that are lost again and again",
                self.within,
                self.all
            )
        })
    }
}
