//! The tempo of a sequence: how much longer than in video a second lasts, where frames are taken so slowly or so fast that nobody would call them video.
//!
//! Source: our own. Seconds suit what moves before a camera at the rates of video: how soon a target turns, how long it is hidden, how fast it crosses. Who takes a frame every ten minutes, or
//! ten thousand a second, has chosen the interval by what moves, and the frames are the same as those of another thing at another interval. So beyond [`SLOWEST_S`] and below
//! [`FASTEST_S`] what is assumed in seconds is stretched as the interval is, and equal frames give equal tracks whatever the interval; between the two seconds are seconds.
//! Symbols: τ seconds of the sequence that stand for one of video.
//! Limits: what a person sets is in seconds and stays. Times are whole nanoseconds: from a frame in a microsecond on they are no longer even.

use crate::Scan;
#[cfg(any(feature = "draw", feature = "encode"))]
use crate::Timestamp;

/// Three frames a second are the slowest that are watched as they happen, s.
const SLOWEST_S: f64 = 1.0 / 3.0;
/// 120 are the most that a usual camera takes without calling it slow motion, s.
const FASTEST_S: f64 = 1.0 / 120.0;

/// See the head of the file: τ, above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tempo(f64);

impl Tempo {
    /// Seconds are seconds.
    pub const VIDEO: Self = Self(1.0);

    /// Of frames that far apart, s; of video where that is not known.
    pub fn of(interval_s: f64) -> Self {
        let known = interval_s.is_finite() && interval_s > 0.0;
        Self(if known { interval_s / interval_s.clamp(FASTEST_S, SLOWEST_S) } else { 1.0 })
    }

    /// Of scans at these times in their order, s: by the gap that a quarter of the gaps are shorter than, since some are left out.
    pub fn of_times(times_s: impl IntoIterator<Item = f64>) -> Self {
        let mut before = None;
        let gaps = times_s.into_iter().filter_map(|t| before.replace(t).map(|b| t - b));
        let mut gaps: Vec<f64> = gaps.filter(|g| *g > 0.0).collect();
        gaps.sort_by(f64::total_cmp);
        Self::of(gaps.get(gaps.len() / 4).copied().unwrap_or(0.0))
    }

    /// The same of scans.
    pub fn of_scans(scans: &[Scan]) -> Self {
        Self::of_times(scans.iter().map(|s| s.time.as_secs_f64()))
    }

    /// The time that lasts as long here as that in video, s.
    pub fn stretched(self, video_s: f64) -> f64 {
        self.0 * video_s
    }

    /// The time of video that lasts as long as that here, s.
    #[cfg(feature = "encode")]
    pub fn in_video(self, here_s: f64) -> f64 {
        here_s / self.0
    }

    /// A speed that is as fast here as that in video, px/s.
    pub fn speed(self, video: f64) -> f64 {
        video / self.0
    }

    /// Density of an acceleration that changes as much here as that in video, px²/s³.
    pub fn density(self, video: f64) -> f64 {
        video / self.0.powi(3)
    }
}

/// The tempo of what comes one after the other, by its first [`Pace::KEPT`] frames.
#[cfg(any(feature = "draw", feature = "encode"))]
#[derive(Clone, Debug, Default)]
pub(crate) struct Pace {
    times_s: Vec<f64>,
    tempo: Option<Tempo>,
}

#[cfg(any(feature = "draw", feature = "encode"))]
impl Pace {
    /// Frames that it is told by.
    const KEPT: usize = 10;

    /// Takes the next frame's time.
    pub fn note(&mut self, time: Timestamp) {
        if self.times_s.len() < Self::KEPT {
            self.times_s.push(time.as_secs_f64());
            self.tempo = Some(Tempo::of_times(self.times_s.iter().copied()));
        }
    }

    /// Whether it will change no more.
    #[cfg(feature = "encode")]
    pub fn is_settled(&self) -> bool {
        self.times_s.len() == Self::KEPT
    }

    /// As far as it is known.
    pub fn tempo(&self) -> Tempo {
        self.tempo.unwrap_or(Tempo::VIDEO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_stretched_as_the_interval_is_beyond_the_rates_of_video_and_not_between() {
        for rate in [3.0, 10.0, 25.0, 120.0] {
            assert!((Tempo::of(1.0 / rate).stretched(2.0) - 2.0).abs() < 1e-12, "{rate}");
        }
        // Two seconds at three frames a second are six frames, at 120 they are 240.
        for interval_s in [1.0, 10.0, 600.0, 86_400.0] {
            assert!((Tempo::of(interval_s).stretched(2.0) / interval_s - 6.0).abs() < 1e-9, "{interval_s}");
        }
        for interval_s in [1e-3, 1e-6] {
            assert!((Tempo::of(interval_s).stretched(2.0) / interval_s - 240.0).abs() < 1e-6, "{interval_s}");
        }
        for unknown in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Tempo::of(unknown), Tempo::VIDEO);
        }
        // A pixel a frame stays one, and its change as well.
        let slow = Tempo::of(60.0);
        assert!(
            (slow.speed(3.0) * 60.0 - 1.0).abs() < 1e-12 && (slow.density(27.0) * 60f64.powi(3) - 1.0).abs() < 1e-9
        );
    }

    #[test]
    fn the_tempo_of_scans_is_that_of_most_of_them() {
        let minutes = |n: u32| (0..n).map(|k| f64::from(k * k.max(4)));
        assert_eq!(Tempo::of_times([]), Tempo::VIDEO);
        assert_eq!(Tempo::of_times([4.0, 4.0]), Tempo::VIDEO, "two of one time");
        assert_eq!(Tempo::of_times(minutes(6)), Tempo::of(4.0), "gaps that grow");
    }

    #[cfg(feature = "encode")]
    #[test]
    fn the_first_frames_tell_the_pace() {
        let mut pace = Pace::default();
        assert_eq!(pace.tempo(), Tempo::VIDEO);
        (0..20).for_each(|k| pace.note(Timestamp::from_ns(k * 60_000_000_000 + i64::from(k > 12) * 3_600_000_000_000)));
        assert!(pace.is_settled() && pace.tempo() == Tempo::of(60.0));
    }
}
