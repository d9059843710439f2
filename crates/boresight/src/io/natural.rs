//! Natural order of file names: `frame_2` before `frame_10`.
//!
//! Runs of ASCII digits compare as whole numbers of any length; everything else compares by Unicode scalar value. Names
//! that differ only in leading zeros are ordered by their text, so the order is total.
//! Why not `natord` 1.0.9: it leaves out blanks (`a 1` equals `a1`) and compares numbers with leading zeros as fractions (`f_0010`
//! before `f_01`); both tests below fail with it.

use std::cmp::Ordering;

/// Compares two names so that numbers inside them count as numbers.
///
/// ```
/// use boresight::io::natural_order;
/// let mut names = ["f10.png", "f9.png", "f1.png"];
/// names.sort_by(|a, b| natural_order(a, b));
/// assert_eq!(names, ["f1.png", "f9.png", "f10.png"]);
/// ```
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (l, r) = (left.chars().next(), right.chars().next());
        match (l, r) {
            (None, None) => return a.cmp(b),
            (None, Some(_)) => return Ordering::Less,
            (Some(_), None) => return Ordering::Greater,
            (Some(x), Some(y)) if x.is_ascii_digit() && y.is_ascii_digit() => {
                let (number_l, rest_l) = split_digits(left);
                let (number_r, rest_r) = split_digits(right);
                let order = number_l.len().cmp(&number_r.len()).then_with(|| number_l.cmp(number_r));
                if order != Ordering::Equal {
                    return order;
                }
                (left, right) = (rest_l, rest_r);
            }
            (Some(x), Some(y)) => {
                if x != y {
                    return x.cmp(&y);
                }
                left = &left[x.len_utf8()..];
                right = &right[y.len_utf8()..];
            }
        }
    }
}

/// Splits a text that starts with digits into those digits without leading zeros and the rest.
fn split_digits(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    (digits.trim_start_matches('0'), rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_of_any_length_compare_as_numbers() {
        let mut names = ["a100000000000000000000000", "a20", "a020", "a3", "b1", "a", "a3b10", "a3b9"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["a", "a3", "a3b9", "a3b10", "a020", "a20", "a100000000000000000000000", "b1"]);
    }

    proptest! {
        #[test]
        fn the_order_is_total_and_only_equal_names_are_equal(a in "[a0é1]{0,6}", b in "[a0é1]{0,6}", c in "[a0é1]{0,6}") {
            prop_assert_eq!(natural_order(&a, &b), natural_order(&b, &a).reverse());
            prop_assert_eq!(natural_order(&a, &b) == Ordering::Equal, a == b);
            if natural_order(&a, &b).is_le() && natural_order(&b, &c).is_le() {
                prop_assert!(natural_order(&a, &c).is_le());
            }
        }
    }
}
