//! One colour for each track number, the same in every output.
//!
//! Source: M. Okabe and K. Ito, *Color Universal Design*, 2008 (colours told apart with every kind of colour vision).
//! The dark ones are lightened, since most pictures here are dark, and black is left out. From the eighth track on the
//! hues come again in a lighter and a stronger version.

use crate::TrackId;

/// Orange, sky blue, green, yellow, blue, vermilion, purple.
const BASE: [[u8; 3]; 7] =
    [[240, 165, 20], [86, 190, 245], [20, 200, 145], [245, 232, 70], [110, 120, 255], [245, 110, 40], [230, 130, 190]];

/// The colour of a track.
pub fn track_colour(id: TrackId) -> [u8; 3] {
    let n = id.0.wrapping_sub(1);
    let base = BASE[(n % 7) as usize];
    match (n / 7) % 3 {
        0 => base,
        1 => base.map(|c| ((2 * u16::from(c) + 255) / 3) as u8),
        _ => base.map(|c| (u16::from(c) * 3 / 4) as u8),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_tracks_never_share_a_colour() {
        for n in 1..200 {
            for m in n + 1..n + 7 {
                let (a, b) = (track_colour(TrackId(n)), track_colour(TrackId(m)));
                let far: i32 = a.iter().zip(b).map(|(a, b)| (i32::from(*a) - i32::from(b)).abs()).sum();
                assert!(far > 50, "tracks {n} and {m}: {a:?} {b:?}");
            }
        }
    }
}
