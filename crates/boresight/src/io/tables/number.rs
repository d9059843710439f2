//! Numbers as text: shortest digits that read back to the same bits, and exact seconds.
//!
//! Read by `fast-float2`, to the same bits as the standard parser: 2 million numbers of a MOTChallenge table in 0.26 s at best, the
//! standard parser 0.76 s, a reader by hand (Clinger's fast path) 0.44 s. Three runs on a loaded machine: in one of them the reader by
//! hand was faster (0.44 against 0.57 s), so the gain over it is not settled; the library is taken because it is not ours to keep.
//! Written by `zmij` and `itoa`, the same text as the standard library's but where two are as short and as near (test): its own formatting was half of the time in which a table of a thousand
//! tracks is written.

use crate::Timestamp;
use std::borrow::Cow;
use std::fmt::Write;

/// A number as the standard parser reads it; with `decimal_comma` a comma may stand for the point.
pub(crate) fn parse_f64(field: &[u8], decimal_comma: bool) -> Option<f64> {
    fast_float2::parse(field).ok().or_else(|| {
        let at = memchr::memchr(b',', field).filter(|_| decimal_comma)?;
        let mut point = field.to_vec();
        point[at] = b'.';
        fast_float2::parse(&point).ok()
    })
}

/// Appends the shortest text that reads back as exactly this number; an infinite or missing value as `inf`, `NaN`.
pub(crate) fn push_f64(out: &mut String, v: f64) {
    if v.abs() < PLAIN.end {
        push_shortest(out, zmij::Buffer::new().format_finite(v));
    } else {
        push_standard(out, v);
    }
}

/// As [`push_f64`], with the shortest digits of a 32-bit number.
pub(crate) fn push_f32(out: &mut String, v: f32) {
    // Of two texts that are as short and as near the library takes the other one; numbers of 32 bits often lie between such.
    push_standard(out, v);
}

/// Numbers outside have an exponent.
const PLAIN: std::ops::Range<f64> = 1e-5..1e16;

/// Whole numbers without a point.
fn push_shortest(out: &mut String, text: &str) {
    out.push_str(text.strip_suffix(".0").unwrap_or(text));
}

/// As the standard library writes it.
fn push_standard<T: Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp>(out: &mut String, v: T) {
    let size = v.into().abs();
    // Writing to a String cannot fail.
    let _ = if size.is_finite() && !PLAIN.contains(&size) { write!(out, "{v:e}") } else { write!(out, "{v}") };
}

/// Appends a whole number.
pub(crate) fn push_int(out: &mut String, v: impl itoa::Integer) {
    out.push_str(itoa::Buffer::new().format(v));
}

/// Appends the seconds of a time with all its nanoseconds and no zeros behind: `-0.04`, `12`, `3.003`.
pub(crate) fn push_seconds(out: &mut String, time: Timestamp) {
    let ns = time.ns.unsigned_abs();
    if time.ns < 0 {
        out.push('-');
    }
    push_int(out, ns / 1_000_000_000);
    let part = ns % 1_000_000_000;
    if part != 0 {
        let start = out.len();
        let _ = write!(out, ".{part:09}");
        let kept = out[start..].trim_end_matches('0').len();
        out.truncate(start + kept);
    }
}

/// Reads seconds exactly to the nanosecond where they are written as plain decimals, else through f64; with `decimal_comma` a comma may stand for the point.
pub(crate) fn parse_seconds(text: &str, decimal_comma: bool) -> Option<Timestamp> {
    let text = if decimal_comma && text.contains(',') { Cow::from(text.replacen(',', ".", 1)) } else { text.into() };
    let text = text.trim();
    let (negative, digits) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if !whole.is_empty() && whole.len() <= 9 && part.len() <= 9 && plain(whole) && plain(part) {
        let seconds: i64 = whole.parse().ok()?;
        let ns: i64 = if part.is_empty() { 0 } else { format!("{part:0<9}").parse().ok()? };
        let ns = seconds * 1_000_000_000 + ns;
        return Some(Timestamp::from_ns(if negative { -ns } else { ns }));
    }
    timestamp_of_seconds(text.parse().ok()?)
}

/// A time in seconds, if an i64 holds its nanoseconds (about 292 years).
pub(crate) fn timestamp_of_seconds(s: f64) -> Option<Timestamp> {
    (s.abs() < 9.2e9).then(|| Timestamp::from_secs_f64(s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_time_may_have_a_decimal_comma_where_the_table_has_another_separator() {
        assert_eq!(parse_seconds(" 1,04", true), Some(Timestamp::from_ns(1_040_000_000)));
        assert_eq!(parse_seconds("-0.04", true), Some(Timestamp::from_ns(-40_000_000)));
        assert_eq!([parse_seconds("1,04", false), parse_seconds("1,0,4", true)], [None; 2]);
    }

    #[test]
    fn extreme_numbers_stay_short() {
        let text = |v| {
            let mut s = String::new();
            push_f64(&mut s, v);
            s
        };
        assert_eq!(text(1e-300), "1e-300");
        assert_eq!(text(0.1), "0.1");
        assert_eq!(text(-0.0), "-0");
        assert_eq!(text(2.0), "2");
    }

    proptest! {
        #[test]
        fn numbers_are_read_as_the_standard_parser_reads_them(text in "[-+]?([0-9]{0,21}(\\.[0-9]{0,24})?(e-?[0-9]{1,3})?|nan|inf)") {
            let ours = parse_f64(text.as_bytes(), false);
            prop_assert_eq!(ours.map(f64::to_bits), text.parse::<f64>().ok().map(f64::to_bits));
        }

        #[test]
        fn numbers_are_written_as_the_standard_library_writes_them(bits: u64, digits in 0u64..1_000_000_000, places in 0i32..30, whole: i64) {
            let text = |v: f64| {
                let plain = v == 0.0 || (1e-5..1e16).contains(&v.abs()) || !v.is_finite();
                if plain { format!("{v}") } else { format!("{v:e}") }
            };
            for v in [f64::from_bits(bits), digits as f64 / 10f64.powi(places), -(digits as f64), 0.0, -0.0] {
                let mut s = String::new();
                push_f64(&mut s, v);
                let want = text(v);
                // Of two that are as short and as near the other one.
                let is_as_good = s.len() == want.len() && s.parse::<f64>().is_ok_and(|back| back == v);
                prop_assert!(s == want || is_as_good, "{s}, not {want}");
            }
            let mut s = String::new();
            push_int(&mut s, whole);
            prop_assert_eq!(s, whole.to_string());
        }

        #[test]
        fn numbers_read_back_to_the_same_bits(bits: u64) {
            let v = f64::from_bits(bits);
            prop_assume!(!v.is_nan());
            let mut s = String::new();
            push_f64(&mut s, v);
            prop_assert_eq!(s.parse::<f64>().unwrap().to_bits(), v.to_bits());
            prop_assert!(s.len() <= 25);
        }

        #[test]
        fn times_read_back_to_the_same_nanosecond(ns in -999_999_999_999_999_999i64..999_999_999_999_999_999) {
            let mut s = String::new();
            push_seconds(&mut s, Timestamp::from_ns(ns));
            prop_assert_eq!(parse_seconds(&s, false), Some(Timestamp::from_ns(ns)));
        }
    }
}
