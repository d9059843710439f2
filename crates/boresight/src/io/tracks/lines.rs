//! Lines of numbers, read fast and with a place for every mistake: file, line, column, what was expected.
//!
//! The file goes through one buffer, never whole into memory. Numbers of up to 15 digits with up to 22 decimals are
//! exact by one multiplication or division (W. Clinger, *How to read floating point numbers accurately*, PLDI 1990);
//! all others go to the standard parser, which is exact as well.

use crate::{Error, ErrorKind, Result};
use std::io::Read;
use std::path::Path;

/// How tables are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Leave out malformed rows and count them, instead of failing at the first.
    pub skip_bad_rows: bool,
    /// Keep columns that have no place in a [`crate::TrackTable`] as text (for conversion).
    pub keep_extra: bool,
    /// MOTChallenge tables: frames in the file count from 0 instead of 1.
    pub frames_from_zero: bool,
}

/// Rows that were left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadRows {
    /// How many.
    pub count: u64,
    /// What was wrong with the first of them.
    pub first: Option<String>,
}

impl BadRows {
    /// Takes note of a malformed row, or fails where that is not allowed.
    /// # Errors
    /// The mistake itself unless bad rows are skipped.
    pub fn note(&mut self, options: ReadOptions, e: Error) -> Result<()> {
        if !options.skip_bad_rows {
            return Err(e.hint("--skip-bad-rows leaves such rows out and counts them"));
        }
        self.count += 1;
        self.first.get_or_insert_with(|| e.to_string());
        Ok(())
    }
}

/// Calls `each(line number from 1, line)` for the lines of a file, without their ends; empty lines and those that begin with
/// # are left out.
/// # Errors
/// A file that cannot be read; a line of more than 1 MiB; what `each` fails with.
pub fn each_line(path: &Path, mut each: impl FnMut(u64, &[u8]) -> Result<()>) -> Result<()> {
    let mut file = std::fs::File::open(path)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(path.display()).because(e))?;
    const BUFFER: usize = 1 << 20;
    let mut buffer = vec![0_u8; BUFFER];
    let (mut filled, mut number) = (0, 0);
    loop {
        let n = file
            .read(&mut buffer[filled..])
            .map_err(|e| Error::new(ErrorKind::Damaged, "cannot be read to its end").at(path.display()).because(e))?;
        let end = filled + n;
        let mut begin = 0;
        while let Some(k) = find_newline(&buffer[begin..end]) {
            number += 1;
            call(&mut each, number, &buffer[begin..begin + k])?;
            begin += k + 1;
        }
        if n == 0 {
            if begin < end {
                number += 1;
                call(&mut each, number, &buffer[begin..end])?;
            }
            return Ok(());
        }
        if begin == 0 && end == BUFFER {
            return Err(Error::new(ErrorKind::Damaged, "a line of more than 1 MiB: expected a table of text")
                .at(format!("{} line {}", path.display(), number + 1)));
        }
        buffer.copy_within(begin..end, 0);
        filled = end - begin;
    }
}

fn call(each: &mut impl FnMut(u64, &[u8]) -> Result<()>, number: u64, line: &[u8]) -> Result<()> {
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let line = if number == 1 { line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line) } else { line };
    if is_content(line) { each(number, line) } else { Ok(()) }
}

/// Whether a line says anything: neither blank nor a comment.
pub fn is_content(line: &[u8]) -> bool {
    line.iter().find(|b| !b.is_ascii_whitespace()).is_some_and(|b| *b != b'#')
}

fn find_newline(bytes: &[u8]) -> Option<usize> {
    // Eight bytes at a time: a byte equals '\n' where the xor with it is 0.
    let mut k = 0;
    for chunk in bytes.chunks_exact(8) {
        let x = u64::from_le_bytes(chunk.try_into().unwrap_or([0; 8])) ^ 0x0A0A_0A0A_0A0A_0A0A;
        let hit = x.wrapping_sub(0x0101_0101_0101_0101) & !x & 0x8080_8080_8080_8080;
        if hit != 0 {
            return Some(k + hit.trailing_zeros() as usize / 8);
        }
        k += 8;
    }
    bytes[k..].iter().position(|&b| b == b'\n').map(|p| k + p)
}

/// Splits a line into fields at commas, semicolons, tabs or blanks.
#[derive(Clone, Copy, Debug)]
pub struct Fields<'a> {
    rest: &'a [u8],
    separator: Option<u8>,
    column: u32,
    ended: bool,
}

/// The separator of a line: semicolon or tab if it has one (commas are decimal points then), else comma, else blanks (`None`).
pub fn separator(line: &[u8]) -> Option<u8> {
    [b';', b'\t', b','].into_iter().find(|s| line.contains(s))
}

impl<'a> Fields<'a> {
    /// The fields of a line; `None` separates by runs of blanks.
    pub fn new(line: &'a [u8], separator: Option<u8>) -> Self {
        Self { rest: line, separator, column: 0, ended: false }
    }

    /// The next field without blanks around it.
    pub fn field(&mut self) -> Option<&'a [u8]> {
        if self.ended {
            return None;
        }
        let field = match self.separator {
            Some(s) => match self.rest.iter().position(|&b| b == s) {
                Some(k) => {
                    let f = &self.rest[..k];
                    self.rest = &self.rest[k + 1..];
                    f
                }
                None => {
                    self.ended = true;
                    self.rest
                }
            },
            None => {
                let line = self.rest.trim_ascii_start();
                let k = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
                self.rest = &line[k..];
                if k == 0 {
                    self.ended = true;
                    return None;
                }
                &line[..k]
            }
        };
        self.column += 1;
        Some(field.trim_ascii())
    }

    /// The next field as a number.
    /// # Errors
    /// A missing field or something else than a finite number: column and what was expected (`what`).
    pub fn number(&mut self, what: &str) -> Result<f64> {
        let Some(field) = self.field() else {
            return Err(Error::new(ErrorKind::Damaged, format!("expected {what}, found the end of the line"))
                .at(format!("column {}", self.column + 1)));
        };
        self.value(field).ok_or_else(|| self.expected(what, field))
    }

    /// A finite number; a comma serves as decimal point where it does not part the fields.
    fn value(&self, field: &[u8]) -> Option<f64> {
        number(field).or_else(|| {
            let at = field.iter().position(|b| *b == b',').filter(|_| self.separator != Some(b','))?;
            let mut point = field.to_vec();
            point[at] = b'.';
            number(&point)
        })
    }

    /// The next field as a whole number ("7" or "7.0").
    /// # Errors
    /// As [`Fields::number`].
    pub fn integer(&mut self, what: &str) -> Result<i64> {
        let v = self.number(what)?;
        if v.fract() == 0.0 && v.abs() < 9e15 {
            return Ok(v as i64);
        }
        Err(Error::new(ErrorKind::Damaged, format!("expected {what} (a whole number), found {v}"))
            .at(format!("column {}", self.column)))
    }

    /// The next field as a number if there is one and it is not empty.
    /// # Errors
    /// Something else than a finite number.
    pub fn optional(&mut self, what: &str) -> Result<Option<f64>> {
        match self.field() {
            None | Some(b"") => Ok(None),
            Some(field) => self.value(field).map(Some).ok_or_else(|| self.expected(what, field)),
        }
    }

    fn expected(&self, what: &str, field: &[u8]) -> Error {
        let found: String = String::from_utf8_lossy(field).chars().take(30).collect();
        Error::new(ErrorKind::Damaged, format!("expected {what}, found \"{found}\""))
            .at(format!("column {}", self.column))
    }
}

const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// A finite number, exactly as the standard parser reads it.
pub fn number(field: &[u8]) -> Option<f64> {
    let (minus, digits) = match field.first() {
        Some(b'-') => (true, &field[1..]),
        Some(b'+') => (false, &field[1..]),
        _ => (false, field),
    };
    let (mut mantissa, mut n_digits, mut decimals, mut point) = (0_u64, 0, 0, false);
    for &b in digits {
        match b {
            b'0'..=b'9' => {
                // Leading zeros do not count as digits of the mantissa.
                n_digits += usize::from(mantissa != 0 || b != b'0');
                decimals += usize::from(point);
                if n_digits > 18 {
                    return slow(field);
                }
                mantissa = mantissa * 10 + u64::from(b - b'0');
            }
            b'.' if !point => point = true,
            _ => return slow(field),
        }
    }
    if digits.len() == usize::from(point) || mantissa >= 1 << 53 || decimals > 22 {
        return slow(field);
    }
    let v = mantissa as f64 / TENS[decimals];
    Some(if minus { -v } else { v })
}

fn slow(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_are_read_as_the_standard_parser_reads_them(text in "[-+]?[0-9]{0,21}(\\.[0-9]{0,24})?(e-?[0-9]{1,3})?") {
            let ours = number(text.as_bytes());
            let std = text.parse::<f64>().ok().filter(|v| v.is_finite());
            prop_assert_eq!(ours.map(f64::to_bits), std.map(f64::to_bits));
        }
    }

    #[test]
    fn fields_are_split_at_commas_or_at_runs_of_blanks() {
        let mut f = Fields::new(b" 1, 2.5 ,,x", separator(b"1,2"));
        assert_eq!(f.integer("a frame").unwrap(), 1);
        assert_eq!(f.number("a width").unwrap(), 2.5);
        assert_eq!(f.optional("a score").unwrap(), None);
        assert_eq!(f.number("a height").unwrap_err().to_string(), "column 4: expected a height, found \"x\"");
        assert_eq!(f.number("more").unwrap_err().to_string(), "column 5: expected more, found the end of the line");
        let mut f = Fields::new(b"1,5; 2;3,4,5", separator(b"1,5; 2;3,4,5"));
        assert_eq!((f.number("x").unwrap(), f.number("y").unwrap()), (1.5, 2.0));
        assert!(f.number("z").is_err(), "two commas");
        let mut f = Fields::new(b"0  -1   Car", separator(b"0  -1   Car"));
        assert_eq!(
            (f.field(), f.field(), f.field(), f.field()),
            (Some(&b"0"[..]), Some(&b"-1"[..]), Some(&b"Car"[..]), None)
        );
    }
}
