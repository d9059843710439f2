//! Some of many, evenly spread: what the looks of the automatic choice take.

/// At most `n` of the items, evenly spread, the first among them.
pub fn spread<T>(items: &[T], n: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(n).max(1))
}

/// Gaps between the frames of a look at motion: they grow as the time behind them does, so that a place extrapolated from it stays as sure, and what leaves
/// the frame soon and what hardly moves both show.
const GAPS: [usize; 11] = [1, 1, 1, 1, 1, 2, 3, 5, 7, 11, 14];

/// Places of at most twelve of `n` frames in the order of time, at gaps that grow.
pub fn growing(n: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..n.min(1)).collect();
    for gap in GAPS {
        places.extend(places.last().map(|p| p + gap).filter(|p| *p < n));
    }
    // Of few frames the last one as well.
    if places.len() <= GAPS.len() && places.last().is_some_and(|p| p + 1 < n) {
        places.push(n - 1);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_grow_and_every_place_is_a_frame() {
        assert_eq!(growing(48), [0, 1, 2, 3, 4, 5, 7, 10, 15, 22, 33, 47]);
        for n in 0..60 {
            let places = growing(n);
            assert!(places.iter().all(|p| *p < n) && places.windows(2).all(|w| w[0] < w[1]), "{n}: {places:?}");
            assert!(places.len() >= n.min(6) && places.len() <= 12, "{n}: {places:?}");
        }
    }

    #[test]
    fn no_more_than_asked_for_and_never_none_of_some() {
        for len in 0..50usize {
            let items: Vec<usize> = (0..len).collect();
            let taken: Vec<usize> = spread(&items, 12).copied().collect();
            assert!(taken.len() <= 12 && taken.first() == items.first() && (len < 12 || taken.len() >= 6), "{taken:?}");
        }
    }
}
