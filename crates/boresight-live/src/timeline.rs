//! Time of a run from the stamps of a stream that may be lost, come back and count from 0 again.
//!
//! Stamps of one connection keep their distances. A new connection, or a stamp that runs back, goes on from the last time by what the
//! clock says has passed since. Where a stream has no stamps, the time of arrival is taken.
//! Where stamps may come late, one that runs back by no more than that keeps its time, and what is later still is left out; but stamps that are too late one after the other,
//! over more than that time, are of a clock that began anew.

use boresight::Timestamp;
use std::time::Instant;

/// A clock that began anew is told from stamps that are too late by at least this time, ns.
const LEAST_ANEW_NS: i64 = 1_000_000_000;

/// What is added to a stamp, and what came last.
#[derive(Debug, Default)]
pub struct Timeline {
    offset_ns: i64,
    last: Option<(Timestamp, Instant)>,
    first: Option<Instant>,
    is_new: bool,
    /// The earliest of the stamps that were too late, one after the other, ns.
    too_late_since: Option<i64>,
    /// Times that the stream's stamps ran back.
    pub ran_back: u64,
}

impl Timeline {
    /// The next stamps count from a zero of their own.
    pub fn reconnected(&mut self) {
        self.is_new = self.last.is_some();
    }

    /// The time of what arrived with this stamp (`None`: it has none), which may be late by `late_ns`; `None` if it is too late.
    pub fn at_or_late(
        &mut self,
        stamp: Option<Timestamp>,
        arrived: Instant,
        late_ns: Option<i64>,
    ) -> Option<Timestamp> {
        if let (Some(stamp), Some(late_ns), Some((last, _)), false) = (stamp, late_ns, self.last, self.is_new) {
            let ns = stamp.ns.saturating_add(self.offset_ns);
            if ns <= last.ns {
                if last.ns.saturating_sub(ns) <= late_ns {
                    self.too_late_since = None;
                    return Some(Timestamp::from_ns(ns));
                }
                let since = self.too_late_since.map_or(ns, |since| since.min(ns));
                self.too_late_since = Some(since);
                if ns.saturating_sub(since) <= late_ns.max(LEAST_ANEW_NS) {
                    return None;
                }
            }
        }
        self.too_late_since = None;
        Some(self.at(stamp, arrived))
    }

    /// The time of what arrived with this stamp; `None`: it has none.
    pub fn at(&mut self, stamp: Option<Timestamp>, arrived: Instant) -> Timestamp {
        let first = *self.first.get_or_insert(arrived);
        let stamp = stamp.unwrap_or_else(|| Timestamp::from_ns(nanoseconds(first, arrived)));
        let mut ns = stamp.ns.saturating_add(self.offset_ns);
        if let Some((last, when)) = self.last
            && (self.is_new || ns <= last.ns)
        {
            self.ran_back += u64::from(!self.is_new);
            ns = last.ns.saturating_add(nanoseconds(when, arrived).max(1));
            self.offset_ns = ns.saturating_sub(stamp.ns);
        }
        self.is_new = false;
        self.last = Some((Timestamp::from_ns(ns), arrived));
        Timestamp::from_ns(ns)
    }
}

/// Nanoseconds from one instant to another, 0 if it is not later.
pub fn nanoseconds(from: Instant, to: Instant) -> i64 {
    i64::try_from(to.saturating_duration_since(from).as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn stamps_keep_their_distance_and_a_new_connection_goes_on_by_the_clock() {
        let (mut line, zero) = (Timeline::default(), Instant::now());
        let ms = |k: u64| zero + Duration::from_millis(k);
        let stamp = |k: i64| Some(Timestamp::from_ns(k * 1_000_000));
        assert_eq!(line.at(stamp(500), ms(3)).ns, 500_000_000);
        assert_eq!(line.at(stamp(540), ms(90)).ns, 540_000_000, "late, but its stamp holds");
        line.reconnected();
        assert_eq!(line.at(stamp(7), ms(1090)).ns, 1_540_000_000);
        assert_eq!(line.at(stamp(47), ms(1095)).ns, 1_580_000_000);
        assert_eq!(line.at(stamp(20), ms(1100)).ns, 1_585_000_000, "a stamp that runs back");
        assert_eq!((line.at(stamp(60), ms(1140)).ns, line.ran_back), (1_625_000_000, 1));
    }

    #[test]
    fn what_is_late_keeps_its_time_and_a_clock_that_began_anew_is_told_from_what_is_too_late() {
        let (mut line, zero) = (Timeline::default(), Instant::now());
        let mut at = |ms: i64| {
            let stamp = Some(Timestamp::from_ns(ms * 1_000_000));
            line.at_or_late(stamp, zero, Some(500_000_000)).map(|t| t.ns / 1_000_000)
        };
        assert_eq!([at(5000), at(4600), at(5040), at(4540)], [Some(5000), Some(4600), Some(5040), Some(4540)]);
        assert_eq!([at(4539), at(5040), at(5080), at(4000)], [None, Some(5040), Some(5080), None]);
        // From 0 again: for a second it is too late, then the clock has begun anew, and goes on.
        assert_eq!([at(0), at(900), at(1000), at(1040)], [None, None, None, Some(5080)]);
        assert_eq!([at(1140), at(1100)], [Some(5180), Some(5140)]);
    }

    #[test]
    fn without_stamps_the_arrival_counts() {
        let (mut line, zero) = (Timeline::default(), Instant::now());
        assert_eq!(line.at(None, zero).ns, 0);
        assert_eq!(line.at(None, zero + Duration::from_millis(5)).ns, 5_000_000);
        assert_eq!(line.at(None, zero + Duration::from_millis(5)).ns, 5_000_001, "never twice the same");
    }
}
