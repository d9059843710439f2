//! The lexer of all tables: lines without their ends, fields without their separators, blanks and quotes.
//!
//! A file goes through one buffer, never whole into memory. Lines end with LF or CR LF; a byte order mark, blank lines and
//! lines that begin with # are passed over. Fields are parted by commas, semicolons, tabs or runs of blanks; quotes keep a
//! separator inside a field (a doubled quote stands for one).
//! Why not the crate `csv` 1.4: it takes no runs of blanks as a separator (KITTI) and has no limit on a record, so that one lost
//! quote takes the rest of the file into memory; 2 million fields take it 0.60 to 0.64 s, this 0.41 to 0.52 s with
//! `memchr` and 0.38 to 0.44 s with a plain loop over bytes (loaded machine): `memchr` is taken for its word, not for speed here.
//! Limits: UTF-8 or Latin text; lines of at most 1 MiB, files of at most 4 GiB.

use crate::{Error, ErrorKind, Result};
use memchr::{memchr, memchr_iter};
use std::io::Read;
use std::path::Path;

/// Longest line, bytes: what is longer is no table.
const MAX_LINE_BYTES: usize = 1 << 20;

/// Largest table, bytes: some 40 million rows.
const MAX_BYTES: u64 = 4 << 30;

/// Lines of a text, read as they are asked for.
pub(crate) struct Lines {
    source: Box<dyn Read>,
    label: String,
    buffer: Vec<u8>,
    /// Where the unread part of the buffer begins and ends.
    unread: (usize, usize),
    n_bytes: u64,
    at_end: bool,
    /// The line given last: its place in the buffer, its number, whether the text ends in it.
    last: (usize, usize, u64, bool),
    again: bool,
}

/// One line that says something.
#[derive(Clone, Copy)]
pub(crate) struct Line<'t> {
    pub text: &'t [u8],
    /// Number in the file, from 1.
    pub number: u64,
    /// Whether the file ends in this line, without an end of line.
    pub cut: bool,
}

impl Lines {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path)
            .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(path.display()).because(e))?;
        Ok(Self::new(path.display().to_string(), Box::new(file)))
    }

    /// Reads from anything; `label` names it in messages.
    pub fn new(label: String, source: Box<dyn Read>) -> Self {
        let buffer = vec![0; MAX_LINE_BYTES];
        Self { source, label, buffer, unread: (0, 0), n_bytes: 0, at_end: false, last: (0, 0, 0, false), again: false }
    }

    /// What is read, for messages.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Gives the line given last once more when the next one is asked for.
    pub fn again(&mut self) {
        self.again = true;
    }

    /// The next line that is neither blank nor a comment.
    /// # Errors
    /// A file that cannot be read, is not text, or has a line of more than 1 MiB.
    pub fn next_line(&mut self) -> Result<Option<Line<'_>>> {
        if !self.again && !self.advance()? {
            return Ok(None);
        }
        self.again = false;
        Ok(Some(self.line()))
    }

    /// The line given last.
    pub fn line(&self) -> Line<'_> {
        let (begin, end, number, cut) = self.last;
        Line { text: &self.buffer[begin..end], number, cut }
    }

    /// Goes to the next line that says something; `false` at the end.
    fn advance(&mut self) -> Result<bool> {
        let mut number = self.last.2;
        loop {
            let (begin, filled) = self.unread;
            let (end, cut) = match memchr(b'\n', &self.buffer[begin..filled]) {
                Some(k) => (begin + k, false),
                None if !self.at_end => {
                    self.refill(number)?;
                    continue;
                }
                None if begin < filled => (filled, true),
                None => return Ok(false),
            };
            self.unread.0 = (end + 1).min(filled);
            number += 1;
            let mut line = (begin, end);
            if self.buffer[begin..end].ends_with(b"\r") {
                line.1 -= 1;
            }
            if number == 1 && self.buffer[begin..line.1].starts_with(b"\xEF\xBB\xBF") {
                line.0 += 3;
            }
            if says_something(&self.buffer[line.0..line.1]) {
                self.last = (line.0, line.1, number, cut);
                return Ok(true);
            }
        }
    }

    /// Moves what is unread to the front and reads on.
    fn refill(&mut self, number: u64) -> Result<()> {
        let (begin, filled) = self.unread;
        if begin == 0 && filled == self.buffer.len() {
            return Err(Error::new(ErrorKind::Damaged, "a line of more than 1 MiB: expected a table of text")
                .at(format!("{} line {}", self.label, number + 1)));
        }
        self.buffer.copy_within(begin..filled, 0);
        let kept = filled - begin;
        let n = self
            .source
            .read(&mut self.buffer[kept..])
            .map_err(|e| Error::new(ErrorKind::Damaged, "cannot be read to its end").at(&self.label).because(e))?;
        let new = &self.buffer[kept..kept + n];
        if self.n_bytes == 0 && matches!(new, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
            return Err(Error::new(ErrorKind::Unsupported, "expected a text table in UTF-8, found UTF-16")
                .at(&self.label)
                .hint("save it as \"CSV UTF-8\", or convert it: iconv -f UTF-16 -t UTF-8"));
        }
        if memchr(0, new).is_some() {
            let what = "expected a text table (CSV, MOTChallenge), found binary data";
            return Err(Error::new(ErrorKind::Damaged, what).at(&self.label).hint("save it as UTF-8 text"));
        }
        self.n_bytes += n as u64;
        if self.n_bytes > MAX_BYTES {
            return Err(Error::new(ErrorKind::Unsupported, "a table of more than 4 GiB")
                .at(&self.label)
                .hint("split it by frames"));
        }
        self.at_end = n == 0;
        self.unread = (0, kept + n);
        Ok(())
    }
}

/// Whether a line is neither blank nor a comment.
fn says_something(line: &[u8]) -> bool {
    line.iter().find(|b| !b.is_ascii_whitespace()).is_some_and(|b| *b != b'#')
}

/// What parts the fields of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    /// This byte.
    Byte(u8),
    /// Runs of blanks.
    Blanks,
}

impl Separator {
    /// The separator of a line: the most frequent of semicolon, tab and comma outside of quotes, else blanks. In a line of
    /// numbers a semicolon or tab wins over commas, which are decimal points then.
    pub fn of(line: &[u8]) -> Self {
        // A quote that is never closed is none.
        let closed = line.iter().filter(|b| **b == b'"').count() % 2 == 0;
        let mut counts = [(b';', 0), (b'\t', 0), (b',', 0)];
        let mut quoted = false;
        for &b in line {
            quoted ^= closed && b == b'"';
            counts.iter_mut().filter(|c| !quoted && c.0 == b).for_each(|c| c.1 += 1);
        }
        let numbers = !line.iter().any(|b| b.is_ascii_alphabetic() && !b"eEnNaA".contains(b));
        let most = counts.iter().map(|c| if numbers { c.1.min(1) } else { c.1 }).max().unwrap_or(0);
        let found = counts.iter().find(|c| most > 0 && c.1 >= most);
        found.map_or(Self::Blanks, |c| Self::Byte(c.0))
    }
}

/// Places of the fields in a line, without the blanks and quotes around them.
pub(crate) fn split(line: &[u8], separator: Separator, out: &mut Vec<(u32, u32)>) {
    out.clear();
    match separator {
        Separator::Blanks => {
            let mut at = 0;
            while let Some(begin) = line[at..].iter().position(|b| !b.is_ascii_whitespace()).map(|k| at + k) {
                let end = line[begin..].iter().position(u8::is_ascii_whitespace).map_or(line.len(), |k| begin + k);
                out.push((begin as u32, end as u32));
                at = end;
            }
        }
        Separator::Byte(b) if memchr(b'"', line).is_none() => {
            let mut begin = 0;
            for end in memchr_iter(b, line) {
                out.push(trimmed(line, begin, end));
                begin = end + 1;
            }
            out.push(trimmed(line, begin, line.len()));
        }
        Separator::Byte(b) => split_quoted(line, b, out),
    }
}

/// A line in which quotes may keep the separator inside of fields.
fn split_quoted(line: &[u8], separator: u8, out: &mut Vec<(u32, u32)>) {
    let mut begin = 0;
    loop {
        let first = begin + line[begin..].iter().take_while(|b| **b == b' ').count();
        let (field, from) = match closing_quote(line, first) {
            Some(close) => ((first as u32 + 1, close as u32), close + 1),
            None => {
                let end = memchr(separator, &line[begin..]).map_or(line.len(), |k| begin + k);
                (trimmed(line, begin, end), end)
            }
        };
        out.push(field);
        match memchr(separator, &line[from..]) {
            Some(k) => begin = from + k + 1,
            None => return,
        }
    }
}

/// Where the quoted field that begins at `open` is closed, if one begins there.
fn closing_quote(line: &[u8], open: usize) -> Option<usize> {
    if line.get(open) != Some(&b'"') {
        return None;
    }
    let mut at = open + 1;
    while let Some(k) = memchr(b'"', &line[at..]) {
        if line.get(at + k + 1) != Some(&b'"') {
            return Some(at + k);
        }
        at += k + 2;
    }
    None
}

fn trimmed(line: &[u8], begin: usize, end: usize) -> (u32, u32) {
    let field = &line[begin..end];
    let front = field.len() - field.trim_ascii_start().len();
    (begin as u32 + front as u32, (begin + front + field.trim_ascii().len()) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(line: &str) -> Vec<String> {
        let mut out = Vec::new();
        split(line.as_bytes(), Separator::of(line.as_bytes()), &mut out);
        out.iter().map(|(a, b)| line[*a as usize..*b as usize].to_string()).collect()
    }

    #[test]
    fn fields_are_parted_by_the_lines_own_separator() {
        assert_eq!(fields(" 1, 2.5 ,,x"), ["1", "2.5", "", "x"]);
        assert_eq!(fields("1,5; 2;3,4,5"), ["1,5", "2", "3,4,5"]);
        assert_eq!(fields("0  -1   Car"), ["0", "-1", "Car"]);
        assert_eq!(fields("frame\tx, px\ty"), ["frame", "x, px", "y"]);
        assert_eq!(fields("1,5;2,5;3,5"), ["1,5", "2,5", "3,5"]);
    }

    #[test]
    fn quotes_keep_separators_and_doubled_quotes_do_not_end_a_field() {
        assert_eq!(fields("\"frame\", \"y, down\" ,\"a \"\"b\"\", c\",d"), ["frame", "y, down", "a \"\"b\"\", c", "d"]);
        assert_eq!(fields("\"open,b"), ["\"open", "b"]);
    }

    #[test]
    fn lines_come_with_their_numbers_whatever_ends_them() {
        let text = b"\xEF\xBB\xBFa\r\n\n# no\n b\r\nlast".to_vec();
        let mut lines = Lines::new("t".into(), Box::new(std::io::Cursor::new(text)));
        let mut seen = Vec::new();
        while let Some(line) = lines.next_line().unwrap() {
            seen.push((String::from_utf8_lossy(line.text).into_owned(), line.number, line.cut));
        }
        let want = [("a", 1, false), (" b", 4, false), ("last", 5, true)].map(|(t, n, c)| (t.to_string(), n, c));
        assert_eq!(seen, want);
    }

    #[test]
    fn an_endless_line_and_binary_data_are_refused_by_name() {
        let of = |bytes: Vec<u8>| {
            let mut lines = Lines::new("t".into(), Box::new(std::io::Cursor::new(bytes)));
            lines.next_line().map(|_| ()).unwrap_err().to_string()
        };
        assert!(of(vec![b'1'; 3 << 20]).contains("t line 1: a line of more than 1 MiB"));
        assert!(of(b"1,2\n\0".repeat(9)).contains("binary"));
        assert!(of(b"\xff\xfef\0".to_vec()).contains("UTF-16"));
    }
}
