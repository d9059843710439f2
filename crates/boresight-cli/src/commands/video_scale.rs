//! The size of the annotated video beside the frames': `1`, `2` to `8` times, or `1/2` to `1/32`.

use boresight::draw::DrawOptions;

/// Larger or smaller, by a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VideoScale {
    scale: u32,
    reduce: u32,
}

/// Takes the size as it is written.
/// # Errors
/// Another text, or a number out of range.
pub fn parse(text: &str) -> Result<VideoScale, String> {
    let wrong = || "expected 1, a whole number of times to 8, or a part from 1/2 to 1/32".to_string();
    let (times, part) = text.split_once('/').unwrap_or((text, "1"));
    let whole = |t: &str, most: u32| t.parse::<u32>().ok().filter(|n| (1..=most).contains(n)).ok_or_else(wrong);
    let size = VideoScale { scale: whole(times, 8)?, reduce: whole(part, 32)? };
    if size.scale > 1 && size.reduce > 1 {
        return Err(wrong());
    }
    Ok(size)
}

/// How frames are drawn for a video of that size; without one small frames are enlarged and large ones reduced.
pub fn drawn(size: Option<VideoScale>) -> DrawOptions {
    let (scale, reduce) = size.map_or((0, 0), |s| (s.scale, s.reduce));
    DrawOptions { scale, reduce, ..DrawOptions::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_a_whole_number_of_times_or_a_part() {
        assert_eq!(parse("1"), Ok(VideoScale { scale: 1, reduce: 1 }));
        assert_eq!(
            (parse("8"), parse("1/3")),
            (Ok(VideoScale { scale: 8, reduce: 1 }), Ok(VideoScale { scale: 1, reduce: 3 }))
        );
        for wrong in ["0", "9", "1/0", "1/33", "2/3", "0.5", "", "-1", "1/"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
