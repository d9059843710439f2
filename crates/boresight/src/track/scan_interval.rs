//! The usual interval between scans, learnt from the time stamps: the median of the last nine.
//!
//! Budgets are in seconds; the interval only says what a scan is when a budget has a floor in scans, and keeps a gap
//! (dropped frames, an hour's pause) from being taken for one.

/// Intervals kept.
const KEPT: usize = 9;

/// The usual interval between scans.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ScanInterval {
    recent: [f64; KEPT],
    n: usize,
    next: usize,
    median_s: f64,
}

impl ScanInterval {
    /// Takes the newest interval, s; scans of one time (of several sensors) are one scan.
    pub fn note(&mut self, dt_s: f64) {
        if dt_s <= 0.0 {
            return;
        }
        self.recent[self.next] = dt_s;
        self.next = (self.next + 1) % KEPT;
        self.n = (self.n + 1).min(KEPT);
        let mut sorted = self.recent;
        let sorted = &mut sorted[..self.n];
        sorted.sort_unstable_by(f64::total_cmp);
        self.median_s = sorted[(self.n - 1) / 2];
    }

    /// How long `n` usual intervals last, s. Time stamps are whole nanoseconds, so an interval may be one too long: of several
    /// that must not make a scan more.
    pub fn span_s(&self, n: u32) -> f64 {
        f64::from(n) * (self.median_s - 1e-9).max(0.0)
    }

    /// The usual interval, s; 0 before two scans were seen.
    pub fn interval_s(&self) -> f64 {
        self.median_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_scans_of_a_rate_that_nanoseconds_cannot_tell_last_no_longer_than_five_scans() {
        for rate in [3.0, 6.0, 7.0, 60.0, 1024.0] {
            let time = |k: u32| crate::Timestamp::from_secs_f64(f64::from(k) / rate);
            let mut interval = ScanInterval::default();
            for k in 1..40 {
                interval.note(time(k).seconds_since(time(k - 1)));
                if k > 5 {
                    let five = time(k).seconds_since(time(k - 5));
                    assert!(
                        interval.span_s(5) <= five && five - interval.span_s(5) < 1e-7,
                        "{rate}: {} {five}",
                        interval.span_s(5)
                    );
                }
            }
        }
    }

    #[test]
    fn scans_of_several_sensors_at_one_time_are_one_scan() {
        let mut interval = ScanInterval::default();
        for _ in 0..20 {
            for dt in [5.0, 0.0, 0.0] {
                interval.note(dt);
                assert_eq!(interval.interval_s(), 5.0);
            }
        }
    }

    #[test]
    fn an_hours_pause_does_not_change_the_interval() {
        let mut interval = ScanInterval::default();
        for dt in [0.04, 0.04, 0.08, 0.04, 3600.0, 0.04] {
            interval.note(dt);
        }
        assert_eq!(interval.interval_s(), 0.04);
    }
}
