//! Numbers in the names of a sequence's files: where frames are missing, the frames behind the hole have later numbers and times.
//!
//! Source: our own. Names that differ in one number only, which rises by the same step nearly everywhere, are numbered frames;
//! a rise by several steps is a hole. Names of any other form, or with more holes than frames, say nothing, nor do clock times, which rise by 41 from one minute to the next.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// More kinds of names than this are dates or other words, no sequences side by side.
const MOST_SEQUENCES: usize = 8;

/// What the numbers in the names say.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Numbering {
    /// Each file's place in the full sequence, from 0.
    pub places: Vec<u64>,
    /// Number of missing files.
    pub n_missing: u64,
    /// The files before and behind the first hole.
    pub first_hole: (usize, usize),
}

impl Numbering {
    /// A file's place in the full sequence.
    pub fn place(&self, file: u64) -> Option<u64> {
        usize::try_from(file).ok().and_then(|i| self.places.get(i)).copied()
    }
}

/// Finds holes in the numbering of files in natural order; `None` if there are none, or no numbering.
pub(crate) fn holes(files: &[PathBuf]) -> Option<Numbering> {
    let numbers = numbers(files)?;
    if are_clock_times(files, &numbers) {
        return None;
    }
    let rises: Vec<u64> = numbers.windows(2).map(|w| w[1] - w[0]).collect();
    let step = *rises.iter().min()?;
    if rises.iter().any(|r| r % step != 0) || rises.iter().filter(|r| **r == step).count() * 2 < rises.len() {
        return None;
    }
    let places: Vec<u64> = numbers.iter().map(|n| (n - numbers[0]) / step).collect();
    let n_missing = places.last()? + 1 - places.len() as u64;
    let at = rises.iter().position(|r| *r > step)?;
    (n_missing <= places.len() as u64).then_some(Numbering { places, n_missing, first_hole: (at, at + 1) })
}

/// Whether the numbers are written as clock times, hhmmss or behind a date, and where they rise otherwise than seconds do they are one step apart in seconds.
fn are_clock_times(files: &[PathBuf], numbers: &[u64]) -> bool {
    let n_digits = |f: &PathBuf| split(&f.file_stem()?.to_string_lossy()).map(|(_, digits, _)| digits.len());
    let seconds = |n: &u64| {
        let [s, m, h] = [n % 100, n / 100 % 100, n / 10_000 % 100];
        (s < 60 && m < 60 && h < 24).then_some(s + 60 * (m + 60 * h))
    };
    let Some(times) = numbers.iter().map(seconds).collect::<Option<Vec<u64>>>() else { return false };
    let is_written_so = files.iter().all(|f| matches!(n_digits(f), Some(6 | 14)));
    let rises = || times.windows(2).zip(numbers.windows(2)).map(|(t, n)| (t[1].checked_sub(t[0]), n[1] - n[0]));
    let Some(step) = rises().map(|r| r.1).min() else { return false };
    // From one minute, hour or day to the next.
    let turns = || rises().filter(|r| r.0 != Some(r.1));
    is_written_so && turns().count() > 0 && turns().all(|r| r.0.is_none_or(|seconds| seconds == step))
}

/// The numbers of files in natural order, which must rise; `None` for names of any other form.
pub(crate) fn numbers(files: &[PathBuf]) -> Option<Vec<u64>> {
    let name = |f: &PathBuf| f.file_stem().map(|s| s.to_string_lossy().into_owned());
    let names: Vec<String> = files.iter().map(name).collect::<Option<_>>()?;
    let (head, tail) = split(names.first()?).map(|(head, _, tail)| (head.to_string(), tail.to_string()))?;
    let number =
        |n: &String| split(n).filter(|(h, _, t)| *h == head && *t == tail).and_then(|(_, d, _)| d.parse().ok());
    let numbers: Vec<u64> = names.iter().map(number).collect::<Option<_>>()?;
    numbers.windows(2).all(|w| w[0] < w[1]).then_some(numbers)
}

/// The beginnings of names that make several numbered sequences, each of two files or more; `None` if all are one, or hardly any.
pub(crate) fn several(files: &[PathBuf]) -> Option<Vec<String>> {
    let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
    for file in files {
        let name = file.file_stem()?.to_string_lossy().into_owned();
        let (head, _, tail) = split(&name)?;
        *counts.entry((head.to_string(), tail.to_string())).or_default() += 1;
        if counts.len() > MOST_SEQUENCES {
            return None;
        }
    }
    (counts.len() > 1 && counts.values().all(|n| *n > 1)).then(|| counts.into_keys().map(|(head, _)| head).collect())
}

/// Splits a name at its last number.
fn split(name: &str) -> Option<(&str, &str, &str)> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |i| i + name[i..].chars().next().map_or(1, char::len_utf8));
    Some((&name[..start], &name[start..end], &name[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> Option<Numbering> {
        holes(&names.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn a_hole_delays_what_stands_behind_it() {
        let found = of(&["é1_t003.png", "é1_t004.png", "é1_t005.png", "é1_t009.png", "é1_t010.png"]).unwrap();
        assert_eq!(found, Numbering { places: vec![0, 1, 2, 6, 7], n_missing: 3, first_hole: (2, 3) });
        assert_eq!(of(&["a/10.png", "a/20.png", "a/40.png"]).unwrap().places, [0, 1, 3]);
    }

    #[test]
    fn sequences_side_by_side_are_told_from_one() {
        let of = |names: &[&str]| several(&names.iter().map(PathBuf::from).collect::<Vec<_>>());
        let two = ["a/cam1_01.png", "a/cam1_02.png", "a/cam2_01.png", "a/cam2_02.png"];
        assert_eq!(of(&two).unwrap(), ["cam1_", "cam2_"]);
        assert_eq!(of(&two[..2]), None);
        assert_eq!(of(&two[..3]), None, "a file beside a sequence");
        assert_eq!(of(&["2026-11-01.png", "2026-11-02.png", "2026-12-01.png", "x.png"]), None);
    }

    #[test]
    fn names_that_are_no_numbering_say_nothing() {
        assert_eq!(of(&["f1.png", "f2.png", "f3.png"]), None);
        assert_eq!(of(&["f1.png", "g2.png", "f5.png"]), None, "two sequences");
        assert_eq!(of(&["f1.png", "f2.png", "f900.png"]), None, "more holes than frames");
        assert_eq!(of(&["f1.png", "f2.tif", "f2.png", "f4.png"]), None, "a number twice");
        assert_eq!(of(&["f1.png", "f4.png", "f6.png", "f11.png"]), None, "times in the names");
        assert_eq!(of(&["a.png", "b.png"]), None);
        assert_eq!(of(&["c_235857.png", "c_235858.png", "c_235859.png", "c_235900.png"]), None, "clock times");
        let dated = ["20261126105958.png", "20261126105959.png", "20261126110000.png", "20261126110001.png"];
        assert_eq!(of(&dated), None, "with a date");
        // What could be a clock but for its steps: from 59 to 110 are eleven seconds.
        let hole: Vec<String> = (10..60).chain(110..130).map(|k| format!("t{k:06}.png")).collect();
        let hole: Vec<&str> = hole.iter().map(String::as_str).collect();
        assert_eq!(of(&hole).map(|n| n.n_missing), Some(50));
        assert_eq!(
            of(&["t000057.png", "t000058.png", "t000061.png"]).map(|n| n.n_missing),
            Some(2),
            "no minute has 61"
        );
        assert_eq!(of(&["99999999999999999999999.png", "3.png"]), None);
        assert_eq!(of(&[]), None);
    }
}
