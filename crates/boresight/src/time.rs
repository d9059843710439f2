//! Time as it is: integer nanoseconds and frame numbers, never mixed up.

use crate::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// Rate that is assumed where nothing says how fast frames follow each other, frames/s: that of European video.
pub const ASSUMED_RATE_HZ: f64 = 25.0;

/// A frame's number in its sequence, from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FrameIndex(pub u64);

/// A point in time, integer nanoseconds from the sequence's own zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Timestamp {
    /// Nanoseconds.
    pub ns: i64,
}

impl Timestamp {
    /// Builds a time from whole nanoseconds.
    pub const fn from_ns(ns: i64) -> Self {
        Self { ns }
    }

    /// Builds a time from seconds, rounded to the nearest nanosecond (saturating at about 292 years; NaN gives 0).
    pub fn from_secs_f64(s: f64) -> Self {
        Self { ns: (s * 1e9).round() as i64 }
    }

    /// Builds the exact time `ticks * num / den` seconds, rounded to the nearest nanosecond (saturating); `den` is above 0.
    pub fn from_ticks(ticks: i64, num: i64, den: i64) -> Self {
        let scaled = (i128::from(ticks) * i128::from(num)).saturating_mul(1_000_000_000);
        let den = i128::from(den.max(1));
        let ns = scaled.saturating_add(den / 2).div_euclid(den);
        Self { ns: ns.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64 }
    }

    /// Returns the time in seconds.
    pub fn as_secs_f64(self) -> f64 {
        self.ns as f64 / 1e9
    }

    /// Returns `self - earlier` in seconds (negative if `self` is the earlier one).
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (self.ns.saturating_sub(earlier.ns)) as f64 * 1e-9
    }
}

/// A rate as people read it: five significant digits, no zeros behind the point (30, 29.97, 0.4).
pub fn shown_rate(rate_hz: f64) -> String {
    let magnitude = rate_hz.abs().max(1e-9).log10().floor() as i32;
    let text = format!("{rate_hz:.*}", (4 - magnitude).clamp(0, 12) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Refuses a rate whose frames whole nanoseconds cannot tell apart, or that 64 bits of them hold only a few of.
pub(crate) fn check_rate(rate_hz: f64) -> Result<()> {
    if (1e-6..=1e9).contains(&rate_hz) {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::Config,
        "expected a rate from 1e-6 to 1e9 frames/s: times are whole nanoseconds, up to 292 years",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_a_90_khz_clock_round_to_the_nearest_nanosecond() {
        assert_eq!(Timestamp::from_ticks(3003, 1, 90_000).ns, 33_366_667);
        assert_eq!(Timestamp::from_ticks(-3003, 1, 90_000).ns, -33_366_667);
        assert_eq!(Timestamp::from_ticks(1, 1001, 30_000).ns, 33_366_667);
    }

    #[test]
    fn rates_are_shown_without_digits_that_say_nothing() {
        let rates = [30.0, 30_000.0 / 1001.0, 23.976, 0.4, 1.0 / 2.5, 1000.0, 123_456.7, 1e-6, 100.000_01];
        let shown = ["30", "29.97", "23.976", "0.4", "0.4", "1000", "123457", "0.000001", "100"];
        assert_eq!(rates.map(shown_rate), shown);
    }

    #[test]
    fn differences_of_extreme_times_do_not_overflow() {
        let late = Timestamp::from_ns(i64::MAX);
        assert!(late.seconds_since(Timestamp::from_ns(i64::MIN)) > 9e9);
        assert_eq!(Timestamp::from_ticks(i64::MAX, i64::MAX, 1), late);
    }

    #[test]
    fn rates_that_nanoseconds_do_not_hold_are_refused() {
        assert!([1e-6, 25.0, 1e9].iter().all(|r| check_rate(*r).is_ok()));
        assert!([1e-12, 1.1e9, 1e12, f64::INFINITY, f64::NAN].iter().all(|r| check_rate(*r).is_err()));
    }
}
