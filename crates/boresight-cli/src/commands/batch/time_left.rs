//! How long the rest of a batch takes, by the bytes that are done; inputs of one kind take about as long a byte.

use std::time::Duration;

/// The time left in words: nothing before anything is done.
pub fn time_left(elapsed: Duration, done_bytes: u64, all_bytes: u64) -> Option<String> {
    if done_bytes == 0 || all_bytes <= done_bytes {
        return None;
    }
    let s = elapsed.as_secs_f64() * (all_bytes - done_bytes) as f64 / done_bytes as f64;
    Some(match s {
        s if s < 90.0 => format!("{s:.0} s left"),
        s if s < 5400.0 => format!("{:.0} min left", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h left", s / 3600.0),
        s => format!("{:.1} days left", s / 86_400.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_goes_by_bytes() {
        let left = |s, done, all| time_left(Duration::from_secs(s), done, all);
        assert_eq!(left(10, 1, 2).as_deref(), Some("10 s left"));
        assert_eq!(left(60, 1, 11).as_deref(), Some("10 min left"));
        assert_eq!(left(3600, 10, 30).as_deref(), Some("2.0 h left"));
        assert_eq!(left(86_400, 1, 11).as_deref(), Some("10.0 days left"));
        assert_eq!((left(5, 0, 3), left(5, 3, 3)), (None, None));
    }
}
