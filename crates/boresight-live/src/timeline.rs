//! Time of a run from the stamps of a stream that may be lost, come back and count from 0 again.
//!
//! Stamps of one connection keep their distances. A new connection, or a stamp that runs back, goes on from the last time by what the
//! clock says has passed since. Where a stream has no stamps, the time of arrival is taken.

use boresight::Timestamp;
use std::time::Instant;

/// What is added to a stamp, and what came last.
#[derive(Debug, Default)]
pub struct Timeline {
    offset_ns: i64,
    last: Option<(Timestamp, Instant)>,
    first: Option<Instant>,
    is_new: bool,
    /// Times that the stream's stamps ran back.
    pub ran_back: u64,
}

impl Timeline {
    /// The next stamps count from a zero of their own.
    pub fn reconnected(&mut self) {
        self.is_new = self.last.is_some();
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
    fn without_stamps_the_arrival_counts() {
        let (mut line, zero) = (Timeline::default(), Instant::now());
        assert_eq!(line.at(None, zero).ns, 0);
        assert_eq!(line.at(None, zero + Duration::from_millis(5)).ns, 5_000_000);
        assert_eq!(line.at(None, zero + Duration::from_millis(5)).ns, 5_000_001, "never twice the same");
    }
}
