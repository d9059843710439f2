//! Some of many, evenly spread: what the looks of the automatic choice take.

/// At most `n` of the items, evenly spread, the first among them.
pub fn spread<T>(items: &[T], n: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(n).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_than_asked_for_and_never_none_of_some() {
        for len in 0..50usize {
            let items: Vec<usize> = (0..len).collect();
            let taken: Vec<usize> = spread(&items, 12).copied().collect();
            assert!(taken.len() <= 12 && taken.first() == items.first() && (len < 12 || taken.len() >= 6), "{taken:?}");
        }
    }
}
