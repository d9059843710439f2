//! The time of every frame of a table, also of those without rows.

use crate::TrackTable;
use crate::time::ASSUMED_RATE_HZ;

/// Times by frame.
pub(super) struct FrameTimes {
    /// Frames whose time the table tells, ascending, with the time, ns.
    known: Vec<(usize, i64)>,
}

impl FrameTimes {
    /// Takes them from the rows.
    pub fn new(table: &TrackTable) -> Self {
        let of_frame = |f: usize| table.rows(f).find_map(|r| table.state(r).time).map(|t| (f, t.ns));
        Self { known: (0..table.n_frames()).filter_map(of_frame).collect() }
    }

    /// A frame's time, ns: its own; else as if frames followed each other evenly between those that have one, or as at their ends.
    pub fn ns(&self, frame: usize) -> i64 {
        let assumed = 1e9 / ASSUMED_RATE_HZ;
        let at = self.known.partition_point(|k| k.0 < frame);
        if let Some(k) = self.known.get(at).filter(|k| k.0 == frame) {
            return k.1;
        }
        let n = self.known.len();
        let Some(&from) = self.known.get(at.saturating_sub(1)) else { return (frame as f64 * assumed).round() as i64 };
        let pair = match (at, n) {
            (_, 1) => None,
            (0, _) => Some((self.known[0], self.known[1])),
            (at, n) if at == n => Some((self.known[n - 2], self.known[n - 1])),
            (at, _) => Some((self.known[at - 1], self.known[at])),
        };
        let step = pair.map_or(assumed, |(a, b)| (b.1 as f64 - a.1 as f64) / (b.0 - a.0) as f64);
        from.1.saturating_add(((frame as f64 - from.0 as f64) * step).round() as i64)
    }

    /// Frames with rows, and the first without behind them: a player must hear that nothing is there.
    pub fn frames_to_tell<'a>(&self, table: &'a TrackTable) -> impl Iterator<Item = usize> + 'a {
        let has = |f: usize| !table.rows(f).is_empty();
        (0..table.n_frames()).filter(move |&f| has(f) || f > 0 && has(f - 1))
    }

    /// What is said where the table has no times.
    pub fn lost(&self) -> Option<String> {
        self.known.is_empty().then(|| format!("times (the table has none: {ASSUMED_RATE_HZ} frames/s)"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, RowState, Timestamp, TrackRow, TrackTableBuilder};

    #[test]
    fn frames_without_rows_lie_evenly_between_their_neighbours() {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        for (frame, ns) in [(1, 100), (3, 300), (4, 700)] {
            let state = RowState { time: Some(Timestamp::from_ns(ns)), ..RowState::default() };
            b.push_with_state(&TrackRow { frame, id: 1, ..TrackRow::default() }, &state).unwrap();
        }
        let table = b.finish(8).unwrap();
        let times = FrameTimes::new(&table);
        assert_eq!((0..7).map(|f| times.ns(f)).collect::<Vec<_>>(), [0, 100, 200, 300, 700, 1100, 1500]);
        assert_eq!(times.frames_to_tell(&table).collect::<Vec<_>>(), [1, 2, 3, 4, 5]);
        let none = TrackTable::from_rows("t", PixelOrigin::Centre0, [TrackRow::default()]).unwrap();
        assert_eq!(FrameTimes::new(&none).ns(3), 120_000_000);
        assert!(times.lost().is_none() && FrameTimes::new(&none).lost().is_some());
    }
}
