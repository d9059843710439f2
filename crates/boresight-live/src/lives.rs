//! Starts, updates and ends of tracks from one frame's tracks to the next, with at most so many updates a second of each track.

use crate::event::{Event, TrackReport, What, When};
use boresight::Timestamp;
use std::collections::BTreeMap;

struct Life {
    report: TrackReport,
    when: When,
    last_sent: Timestamp,
}

/// The tracks that were reported and have not ended.
pub struct Lives {
    living: BTreeMap<u64, Life>,
    /// Least time between updates of a track, s.
    interval_s: f64,
    /// Tracks that were ever started.
    pub started: u64,
}

impl Lives {
    /// At most this many updates a second for each track; infinite: every frame.
    pub fn new(updates_hz: f64) -> Self {
        // A little less than the interval, so that a rate equal to the frames' sends every frame in spite of jitter.
        let interval_s = if updates_hz.is_finite() { 0.9 / updates_hz } else { 0.0 };
        Self { living: BTreeMap::new(), interval_s, started: 0 }
    }

    /// Takes the confirmed tracks of a frame, whose number is none of those before; hands out the events.
    pub fn step(&mut self, source: &str, when: When, tracks: &[TrackReport], out: &mut Vec<Event>) {
        for t in tracks {
            let event = match self.living.get_mut(&t.track) {
                None => {
                    self.started += 1;
                    self.living.insert(t.track, Life { report: t.clone(), when, last_sent: when.time });
                    Some(What::Start)
                }
                Some(life) => {
                    (life.report, life.when) = (t.clone(), when);
                    let due = when.time.seconds_since(life.last_sent) >= self.interval_s;
                    if due {
                        life.last_sent = when.time;
                    }
                    due.then_some(What::Update)
                }
            };
            out.extend(event.map(|event| Event::of_track(event, source, when, t)));
        }
        self.living.retain(|_, life| {
            let lives = life.when.frame == when.frame;
            if !lives {
                out.push(Event::of_track(What::End, source, life.when, &life.report));
            }
            lives
        });
    }

    /// Ends all of them.
    pub fn end(&mut self, source: &str, out: &mut Vec<Event>) {
        out.extend(self.living.values().map(|life| Event::of_track(What::End, source, life.when, &life.report)));
        self.living.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_earth::OnEarth;

    fn report(track: u64, x_px: f64) -> TrackReport {
        TrackReport {
            track,
            status: "confirmed",
            x_px,
            y_px: 2.5,
            vx_px_per_s: 0.0,
            vy_px_per_s: 0.0,
            cov: [0.0; 10],
            width_px: 3.0,
            height_px: 3.0,
            score: 1.0,
            nis: None,
            on_earth: OnEarth::default(),
        }
    }

    #[test]
    fn a_track_starts_is_updated_at_its_rate_and_ends_with_its_last_state() {
        let mut lives = Lives::new(10.0);
        let mut events = Vec::new();
        for k in 0..100u64 {
            let when = When { frame: k, time: Timestamp::from_ns(k as i64 * 10_000_000), arrived_unix_s: 0.0 };
            let tracks = if k < 95 { vec![report(1, k as f64)] } else { vec![] };
            lives.step("cam", when, &tracks, &mut events);
        }
        let of = |event: &str| events.iter().filter(|e| e.json.contains(&format!("\"event\":\"{event}\""))).count();
        assert_eq!((of("start"), of("update"), of("end")), (1, 10, 1), "94 frames of 10 ms, one update in 9 of them");
        let end: serde_json::Value = serde_json::from_str(&events.last().unwrap().json).unwrap();
        assert_eq!((end["x_px"].as_f64(), end["frame"].as_u64()), (Some(94.0), Some(94)));
        assert_eq!((end["schema"].as_str(), end["time_s"].as_f64()), (Some("boresight.track/1"), Some(0.94)));
    }
}
