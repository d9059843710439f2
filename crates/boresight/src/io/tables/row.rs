//! One row of a table: its cells as numbers and words, its box, and what is wrong with it, by file, line and column.

use super::columns::{Field, Layout};
use super::kind::Kind;
use super::lexer::{Line, Separator};
use super::number::{parse_f64, parse_seconds, timestamp_of_seconds};
use crate::{Error, ErrorKind, Result, Timestamp, TrackStatus};
use std::borrow::Cow;

/// What is the same for all rows of a table.
pub(crate) struct Form {
    pub label: String,
    pub kind: Kind,
    pub header: Vec<String>,
    pub layout: Layout,
    pub separator: Separator,
}

/// One row.
#[derive(Clone, Copy)]
pub(crate) struct Row<'t> {
    pub form: &'t Form,
    pub line: Line<'t>,
    pub cells: &'t [(u32, u32)],
}

/// Names in a row; of very many the first ones.
pub(crate) fn list(names: &[String]) -> String {
    const SHOWN: usize = 20;
    let mut text = names.iter().take(SHOWN).map(|n| short(n)).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    text
}

/// A cell's text as far as it helps.
fn short(text: &str) -> String {
    const SHOWN: usize = 40;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

impl<'t> Row<'t> {
    /// The bytes of column `at`, if the row reaches to it.
    pub fn cell(&self, at: usize) -> Option<&'t [u8]> {
        let (begin, end) = *self.cells.get(at)?;
        self.line.text.get(begin as usize..end as usize)
    }

    fn bytes(&self, field: Field) -> Option<&'t [u8]> {
        self.form.layout.column(field).and_then(|at| self.cell(at))
    }

    /// The text of column `at`, empty where the row does not reach to it.
    pub fn text_at(&self, at: usize) -> Cow<'t, str> {
        String::from_utf8_lossy(self.cell(at).unwrap_or_default())
    }

    /// The text of a field, if its column is there and not empty.
    pub fn word(&self, field: Field) -> Option<Cow<'t, str>> {
        self.bytes(field).filter(|b| !b.is_empty()).map(String::from_utf8_lossy)
    }

    fn parse(&self, bytes: &[u8]) -> Option<f64> {
        parse_f64(bytes, self.form.separator != Separator::Byte(b','))
    }

    /// Whether the cell of a field is a number.
    pub fn is_number(&self, field: Field) -> bool {
        self.bytes(field).is_some_and(|b| self.parse(b).is_some())
    }

    /// A finite number, or `None` where the column is missing or the cell is empty or `nan`.
    /// # Errors
    /// Anything else.
    pub fn maybe(&self, field: Field) -> Result<Option<f64>> {
        let Some(at) = self.form.layout.column(field) else { return Ok(None) };
        self.number_at(at, field.expected())
    }

    /// As [`Row::maybe`] for a column by its place; `expected` names it.
    /// # Errors
    /// As [`Row::maybe`].
    pub fn number_at(&self, at: usize, expected: &str) -> Result<Option<f64>> {
        let Some(bytes) = self.cell(at).filter(|b| !b.is_empty()) else { return Ok(None) };
        match self.parse(bytes) {
            Some(v) if v.is_finite() => Ok(Some(v)),
            Some(v) if v.is_nan() => Ok(None),
            _ => Err(self.wrong_at(at, &String::from_utf8_lossy(bytes), expected)),
        }
    }

    /// As [`Row::number_at`] for a number that must be there.
    /// # Errors
    /// Anything else than a finite number.
    pub fn need_at(&self, at: usize, expected: &str) -> Result<f64> {
        let found = || String::from_utf8_lossy(self.cell(at).unwrap_or_default());
        self.number_at(at, expected)?.ok_or_else(|| self.wrong_at(at, &found(), expected))
    }

    /// A finite number that must be there.
    /// # Errors
    /// Anything else.
    pub fn need(&self, field: Field) -> Result<f64> {
        if let Some(v) = self.maybe(field)? {
            return Ok(v);
        }
        let at = self.form.layout.column(field).unwrap_or(0);
        Err(match self.cell(at) {
            Some(bytes) => self.wrong_at(at, &String::from_utf8_lossy(bytes), field.expected()),
            None => self.at_column(at, format!("expected {}, found the end of the line", field.expected())),
        })
    }

    /// The frame, counted from 0, of a table whose first frame has number `first`.
    /// # Errors
    /// Something else than a whole number from `first` on.
    pub fn frame(&self, first: u64) -> Result<u64> {
        let (number, from) = (self.need(Field::Frame)?, first as f64);
        if number >= from && number.fract() == 0.0 && number < 1e15 {
            return Ok(number as u64 - first);
        }
        let at = self.form.layout.column(Field::Frame).unwrap_or(0);
        let error = self.at_column(at, format!("frame {number}: expected a whole number from {first}"));
        Err(if self.form.kind == Kind::Mot && number == 0.0 {
            error
                .hint("MOTChallenge counts frames from 1; if this table counts from 0: --set input.table.first-frame=0")
        } else {
            error
        })
    }

    /// The track's number; `None` where the row belongs to no track.
    /// # Errors
    /// Something else than a whole number.
    pub fn id(&self) -> Result<Option<i64>> {
        if matches!(self.bytes(Field::Id), Some(b"None" | b"null")) {
            return Ok(None);
        }
        match self.maybe(Field::Id)? {
            Some(v) if v.fract() == 0.0 && v.abs() < 9e15 => Ok(Some(v as i64)),
            Some(_) => {
                let found = self.word(Field::Id).unwrap_or_default();
                Err(self.wrong(Field::Id, &found, "a track id (a whole number)"))
            }
            None => Ok(None),
        }
    }

    /// The time of the row's frame, where the table has it.
    /// # Errors
    /// Something else than a time within 292 years.
    pub fn time(&self) -> Result<Option<Timestamp>> {
        let Some(word) = self.word(Field::TimeS) else { return Ok(None) };
        let (time, expected) = match self.form.layout.time_scale {
            None => (parse_seconds(&word, self.form.separator != Separator::Byte(b',')), "a time in seconds"),
            Some(scale) => (timestamp_of_seconds(self.need(Field::TimeS)? * scale), "a time within 292 years"),
        };
        time.map(Some).ok_or_else(|| self.wrong(Field::TimeS, &word, expected))
    }

    /// The track's status, where the row has one of ours.
    pub fn status(&self) -> Option<TrackStatus> {
        match self.bytes(Field::Status)? {
            b"tentative" => Some(TrackStatus::Tentative),
            b"confirmed" => Some(TrackStatus::Confirmed),
            b"coasting" => Some(TrackStatus::Coasting),
            _ => None,
        }
    }

    /// The number of the detection that the track took.
    pub fn detection(&self) -> Option<u32> {
        std::str::from_utf8(self.bytes(Field::Detection)?).ok()?.parse().ok()
    }

    /// All of these, or `None` where one is missing.
    /// # Errors
    /// A cell that is no number.
    pub fn all<const N: usize>(&self, fields: [Field; N]) -> Result<Option<[f64; N]>> {
        if !self.form.layout.has(&fields) {
            return Ok(None);
        }
        let mut out = [0.0; N];
        for (v, field) in out.iter_mut().zip(fields) {
            let Some(found) = self.maybe(field)? else { return Ok(None) };
            *v = found;
        }
        Ok(Some(out))
    }

    /// Left, top, width and height in the table's own coordinates, px; `None` where the table has no place of a box.
    /// # Errors
    /// A cell that is missing, or a size below 0.
    pub fn bbox(&self) -> Result<Option<[f64; 4]>> {
        let layout = &self.form.layout;
        if !layout.has(&[Field::Left, Field::Top]) {
            return Ok(None);
        }
        let (left, top) = (self.need(Field::Left)?, self.need(Field::Top)?);
        if layout.has(&[Field::Width, Field::Height]) {
            let (width, height) = (self.need(Field::Width)?, self.need(Field::Height)?);
            for (field, size) in [(Field::Width, width), (Field::Height, height)] {
                if size < 0.0 {
                    let error = self.wrong(field, &size.to_string(), "a size of at least 0 px");
                    return Err(error.hint("are these right and bottom?"));
                }
            }
            return Ok(Some([left, top, width, height]));
        }
        if layout.has(&[Field::Right, Field::Bottom]) {
            let (right, bottom) = (self.need(Field::Right)?, self.need(Field::Bottom)?);
            for (field, first, last) in [(Field::Right, left, right), (Field::Bottom, top, bottom)] {
                if last < first {
                    let expected = format!("{} of at least {first}", field.expected());
                    return Err(self.wrong(field, &last.to_string(), &expected));
                }
            }
            return Ok(Some([left, top, right - left, bottom - top]));
        }
        Ok(None)
    }

    /// Width and height of a box around the row's centre, px, where the table gives sizes without places. Sizes below 0 stand for
    /// none, as many programs write -1.
    /// # Errors
    /// A cell that is no number.
    pub fn size(&self) -> Result<Option<[f64; 2]>> {
        Ok(self.all([Field::Width, Field::Height])?.filter(|size| size.iter().all(|v| *v >= 0.0)))
    }

    /// Whether the row has a cell for every column of the header, and none that says something beyond it.
    /// # Errors
    /// A row that is too short or too long.
    pub fn check_length(&self) -> Result<()> {
        let got = self.cells.len();
        let want = self.form.header.len();
        // Other rows end where the writer had no more to say: the first field that is missed is named.
        if self.form.kind != Kind::Named {
            return Ok(());
        }
        if got < want {
            return Err(self.bad(format!("{got} fields, expected {want}")));
        }
        if self.cells.iter().skip(want).any(|(begin, end)| begin < end) {
            let error = self.bad(format!("{got} fields, expected {want}"));
            // 1,5 for 1.5 in a table parted by commas would shift all behind it.
            return Err(match self.form.separator {
                Separator::Byte(b',') => error.hint("are there decimal commas? part the fields by semicolons then"),
                _ => error,
            });
        }
        Ok(())
    }

    /// File and line.
    pub fn place(&self) -> String {
        format!("{} line {}", self.form.label, self.line.number)
    }

    /// An error about this row.
    pub fn bad(&self, what: impl Into<String>) -> Error {
        Error::new(ErrorKind::Damaged, what).at(self.place())
    }

    /// An error about one cell.
    pub fn wrong(&self, field: Field, found: &str, expected: &str) -> Error {
        self.wrong_at(self.form.layout.column(field).unwrap_or(0), found, expected)
    }

    /// An error about the cell of column `at`.
    pub fn wrong_at(&self, at: usize, found: &str, expected: &str) -> Error {
        let found = if found.is_empty() { "nothing".to_string() } else { format!("\"{}\"", short(found)) };
        self.at_column(at, format!("expected {expected}, found {found}"))
    }

    fn at_column(&self, at: usize, what: String) -> Error {
        let name = match self.form.kind {
            Kind::Named => self.form.header.get(at).cloned().unwrap_or_default(),
            Kind::Mot | Kind::Kitti | Kind::Ab3dmot => (at + 1).to_string(),
        };
        self.bad(format!("column {name}: {what}"))
    }
}
