//! A feed that is played by the clock: what it gives is handed out when its stamp says.

use super::feed::{Content, Feed};
use boresight::{Result, SourceInfo, Timestamp};
use std::time::{Duration, Instant};

/// A pause in the stamps longer than this is cut, s: nobody waits for it.
const LONGEST_S: f64 = 10.0;

/// A feed played by the clock.
pub struct Paced {
    feed: Box<dyn Feed>,
    last: Option<(Timestamp, Instant)>,
}

impl Paced {
    /// Plays this feed.
    pub fn new(feed: Box<dyn Feed>) -> Self {
        Self { feed, last: None }
    }
}

impl Feed for Paced {
    fn next(&mut self) -> Result<Option<Content>> {
        let Some(content) = self.feed.next()? else { return Ok(None) };
        let stamp = content.stamp();
        let is_late = |last: Timestamp| {
            self.feed.late_ns().is_some_and(|late| stamp < last && last.ns.saturating_sub(stamp.ns) <= late)
        };
        let due = match self.last {
            // Its time is over: it is handed out at once, and those behind it keep theirs.
            Some((last, _)) if is_late(last) => return Ok(Some(content)),
            Some((last, when)) => when + Duration::from_secs_f64(stamp.seconds_since(last).clamp(0.0, LONGEST_S)),
            None => Instant::now(),
        };
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        self.last = Some((stamp, due));
        Ok(Some(content))
    }

    fn has_stamps(&self) -> bool {
        self.feed.has_stamps()
    }

    fn late_ns(&self) -> Option<i64> {
        self.feed.late_ns()
    }

    fn info(&self) -> Option<&SourceInfo> {
        self.feed.info()
    }

    fn bad_lines(&self) -> u64 {
        self.feed.bad_lines()
    }

    fn warnings(&self) -> &[String] {
        self.feed.warnings()
    }
}
