//! Rows of a text table, whatever its dialect: comma, semicolon, tab or blanks; with header or MOTChallenge without one.
//!
//! Every complaint names file, line, column, what was found and what was expected.

use super::columns::{Columns, Field, Layout};
use crate::{Error, ErrorKind, Result};
use std::io::Read;
use std::path::Path;

/// Tables longer than this are refused: 4 GiB hold some 40 million rows.
const MAX_BYTES: u64 = 4 << 30;

/// How the table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A header with names.
    Named,
    /// MOTChallenge: no header, counted from 1.
    Mot,
}

/// A table held in memory, and where its columns are.
pub(crate) struct Table {
    pub label: String,
    pub kind: Kind,
    pub header: Vec<String>,
    pub layout: Layout,
    text: String,
    delimiter: Delimiter,
    /// Lines to be passed over before the first row: the header and what belongs to it.
    skip: usize,
    /// Unit of positions, where the table names one that is not the pixel.
    pub unit: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimiter {
    Char(char),
    Blank,
}

/// One row.
pub(crate) struct Row<'t> {
    table: &'t Table,
    /// Line in the file, from 1.
    pub line: usize,
    fields: Vec<&'t str>,
    /// Whether the file ends inside or right behind this row, without an end of line.
    pub cut: bool,
}

fn split<'t>(line: &'t str, delimiter: Delimiter, out: &mut Vec<&'t str>) {
    out.clear();
    match delimiter {
        Delimiter::Blank => out.extend(line.split_ascii_whitespace()),
        Delimiter::Char(c) => {
            let mut rest = line;
            loop {
                // Quotes keep delimiters inside a field together; doubled quotes stay as they are (names only).
                let trimmed = rest.trim_start_matches(' ');
                let end = match trimmed.strip_prefix('"').and_then(|inner| inner.find('"').map(|e| (inner, e))) {
                    Some((inner, e)) => {
                        out.push(&inner[..e]);
                        inner[e + 1..].find(c).map(|k| &inner[e + 1 + k + c.len_utf8()..])
                    }
                    None => match rest.split_once(c) {
                        Some((field, tail)) => {
                            out.push(field.trim());
                            Some(tail)
                        }
                        None => {
                            out.push(rest.trim());
                            None
                        }
                    },
                };
                match end {
                    Some(tail) => rest = tail,
                    None => return,
                }
            }
        }
    }
}

fn guess_delimiter(line: &str) -> Delimiter {
    let count = |c| line.matches(c).count();
    [';', '\t', ',']
        .into_iter()
        .max_by_key(|c| count(*c))
        .filter(|c| count(*c) > 0)
        .map_or(Delimiter::Blank, Delimiter::Char)
}

fn is_content(line: &str) -> bool {
    let line = line.trim();
    !line.is_empty() && !line.starts_with('#')
}

impl Table {
    /// Reads a file and finds its columns.
    pub fn open(path: &Path, columns: &Columns) -> Result<Self> {
        columns.validate("columns")?;
        let label = path.display().to_string();
        let cannot =
            |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be read").at(path.display()).because(e);
        let file = std::fs::File::open(path).map_err(cannot)?;
        let mut bytes = Vec::new();
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(cannot)?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(Error::new(ErrorKind::Unsupported, "a table of more than 4 GiB")
                .at(label)
                .hint("split it by frames"));
        }
        Self::of_text(label, &bytes, columns)
    }

    /// Finds the columns of a text.
    pub fn of_text(label: String, bytes: &[u8], columns: &Columns) -> Result<Self> {
        if matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
            let what = "expected a text table in UTF-8, found UTF-16";
            return Err(Error::new(ErrorKind::Unsupported, what)
                .at(label)
                .hint("save it as \"CSV UTF-8\", or convert it: iconv -f UTF-16 -t UTF-8"));
        }
        if bytes.contains(&0) {
            let what = "expected a text table (CSV, MOTChallenge), found binary data";
            return Err(Error::new(ErrorKind::Damaged, what).at(label).hint("save it as UTF-8 text"));
        }
        let text = String::from_utf8_lossy(bytes);
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text).to_string();
        let Some((first_at, first)) = text.lines().enumerate().find(|(_, l)| is_content(l)) else {
            return Err(Error::new(ErrorKind::Damaged, "the table is empty").at(label));
        };
        let delimiter = guess_delimiter(first);
        let mut fields = Vec::new();
        split(first, delimiter, &mut fields);
        let header: Vec<String> = fields.iter().map(|f| f.to_string()).collect();
        let numeric = fields.iter().all(|f| number(f, delimiter).is_some());
        let (kind, layout, mut skip) = if !numeric {
            (Kind::Named, Layout::of_header(&header, columns).map_err(|e| e.at(&label))?, first_at + 1)
        } else if !columns.names.is_empty() {
            (Kind::Named, Layout::of_header(&header, columns).map_err(|e| e.at(&label))?, first_at)
        } else if fields.len() >= 6 {
            (Kind::Mot, Layout::mot(), first_at)
        } else {
            let what = format!("line {}: {} numbers and no header", first_at + 1, fields.len());
            return Err(Error::new(ErrorKind::Unsupported, what)
                .at(label)
                .hint("add a header such as frame,x,y; or name the columns by number: frame=1,x=2,y=3"));
        };
        // TrackMate writes three more lines of names and units below its header.
        let mut unit = None;
        if header.iter().any(|h| h == "POSITION_X") {
            let (frame, x) = (layout.column(Field::Frame), layout.column(Field::X));
            for line in text.lines().skip(skip).take(3) {
                split(line, delimiter, &mut fields);
                let is_row = frame.and_then(|at| fields.get(at)).is_some_and(|f| number(f, delimiter).is_some());
                if is_row {
                    break;
                }
                let named = x.and_then(|at| fields.get(at)).and_then(|u| u.strip_prefix('(')?.strip_suffix(')'));
                unit = named.filter(|u| !["pixel", "pixels", "px"].contains(u)).map(String::from).or(unit);
                skip += 1;
            }
        }
        Ok(Self { label, kind, header, layout, text, delimiter, skip, unit })
    }

    /// The rows in file order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let n_lines = self.text.lines().count();
        let open_end = !self.text.ends_with('\n');
        self.text.lines().enumerate().skip(self.skip).filter(|(_, l)| is_content(l)).map(move |(i, line)| {
            let mut fields = Vec::with_capacity(self.header.len());
            split(line, self.delimiter, &mut fields);
            Row { table: self, line: i + 1, fields, cut: open_end && i + 1 == n_lines }
        })
    }

    /// An error about the columns as a whole.
    pub fn lacks(&self, what: &str, mend: &str) -> Error {
        Error::new(ErrorKind::Unsupported, format!("no column says {what}"))
            .at(&self.label)
            .hint(format!("the columns are {}; {mend}", list(&self.header)))
    }
}

/// Names in a row; of very many the first ones.
fn list(names: &[String]) -> String {
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

/// A number; a comma serves as decimal point where it does not part the fields.
fn number(text: &str, delimiter: Delimiter) -> Option<f64> {
    text.parse().ok().or_else(|| {
        let comma = delimiter != Delimiter::Char(',') && text.matches(',').count() == 1;
        comma.then(|| text.replace(',', ".").parse().ok()).flatten()
    })
}

impl<'t> Row<'t> {
    fn text(&self, field: Field) -> Option<&'t str> {
        self.table.layout.column(field).and_then(|at| self.fields.get(at).copied())
    }

    /// The text of a field, if its column is there and not empty.
    pub fn word(&self, field: Field) -> Option<&'t str> {
        self.text(field).filter(|t| !t.is_empty())
    }

    /// The text of column `at`.
    pub fn cell(&self, at: usize) -> Option<&'t str> {
        self.fields.get(at).copied()
    }

    /// A finite number, or `None` where the column is missing or the cell is empty or `nan`.
    pub fn maybe(&self, field: Field) -> Result<Option<f64>> {
        let Some(text) = self.word(field) else { return Ok(None) };
        match number(text, self.table.delimiter) {
            Some(v) if v.is_finite() => Ok(Some(v)),
            Some(v) if v.is_nan() => Ok(None),
            _ => Err(self.wrong(field, text, "a finite number")),
        }
    }

    /// A finite number that must be there.
    pub fn need(&self, field: Field) -> Result<f64> {
        self.maybe(field)?.ok_or_else(|| self.wrong(field, self.text(field).unwrap_or(""), "a finite number"))
    }

    /// Whether the row has a cell for every column of the header, and none that says something beyond it.
    pub fn check_length(&self) -> Result<()> {
        let (got, want) = (self.fields.len(), self.table.header.len());
        // MOTChallenge rows end where the writer had no more to say.
        let mot = self.table.kind == Kind::Mot;
        let least = if mot { 6 } else { want };
        if got < least {
            return Err(self.bad(format!("{got} fields, expected {least}")));
        }
        if !mot && self.fields.iter().skip(want).any(|f| !f.is_empty()) {
            let error = self.bad(format!("{got} fields, expected {want}"));
            // 1,5 for 1.5 in a table parted by commas would shift all behind it.
            return Err(match self.table.delimiter {
                Delimiter::Char(',') => error.hint("are there decimal commas? part the fields by semicolons then"),
                _ => error,
            });
        }
        Ok(())
    }

    /// An error about this row.
    pub fn bad(&self, what: impl Into<String>) -> Error {
        Error::new(ErrorKind::Damaged, what).at(format!("{}: line {}", self.table.label, self.line))
    }

    /// An error about one cell.
    pub fn wrong(&self, field: Field, found: &str, expected: &str) -> Error {
        let at = self.table.layout.column(field).unwrap_or(0);
        let name = match self.table.kind {
            Kind::Named => self.table.header.get(at).cloned().unwrap_or_default(),
            Kind::Mot => format!("{} ({field:?})", at + 1).to_lowercase(),
        };
        let found = if found.is_empty() { "nothing".to_string() } else { format!("'{}'", short(found)) };
        self.bad(format!("column {name}: found {found}, expected {expected}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<Table> {
        Table::of_text("t.csv".into(), text.as_bytes(), &Columns::default())
    }

    fn xs(text: &str) -> Vec<f64> {
        table(text).unwrap().rows().map(|r| r.need(Field::X).unwrap()).collect()
    }

    #[test]
    fn dialects_give_the_same_numbers() {
        let want = [1.5, -2.0];
        assert_eq!(xs("frame,x,y\n0,1.5,2\n1,-2,3\n"), want);
        assert_eq!(xs("\u{feff}frame;x;y\r\n0;1,5;2\r\n1;-2;3\r\n"), want);
        assert_eq!(xs("# made by hand\nframe\tx\ty\n0\t1.5\t2\n\n1\t-2\t3"), want);
        assert_eq!(xs("frame x y\n0   1.5 2\n1 -2 3\n"), want);
        assert_eq!(xs("\"frame\",\"x\",\"y, down\"\n0,\"1.5\",2\n1,-2,3\n"), want);
    }

    #[test]
    fn a_wrong_cell_is_named_by_file_line_and_column() {
        let t = table("frame,x,y\n0,1,2\n1,abc,3\n").unwrap();
        let error = t.rows().nth(1).unwrap().need(Field::X).unwrap_err();
        assert_eq!(error.to_string(), "t.csv: line 3: column x: found 'abc', expected a finite number");
    }

    #[test]
    fn a_row_with_more_cells_than_the_header_is_refused_unless_they_are_empty() {
        let length = |text: &str| table(text).unwrap().rows().last().unwrap().check_length();
        assert!(length("frame,x,y\n0,1,2,,\n").is_ok());
        // Decimal commas: 1.5 and 2.5.
        let error = length("frame,x,y\n0,1,5,2,5\n").unwrap_err().to_string();
        assert!(error.contains("line 2: 5 fields, expected 3") && error.contains("decimal commas"), "{error}");
        assert!(length("frame;x;y\n0;1,5;2,5\n").is_ok());
    }

    #[test]
    fn messages_about_endless_lines_stay_short() {
        let header: Vec<String> = (0..5000).map(|i| format!("c{i}")).collect();
        let wide = table(&format!("{}\n", header.join(","))).unwrap();
        assert!(wide.lacks("where it is", "x").to_string().len() < 300);
        let t = table(&format!("frame,x,y\n0,{},3\n", "z".repeat(100_000))).unwrap();
        assert!(t.rows().next().unwrap().need(Field::X).unwrap_err().to_string().len() < 200);
    }

    #[test]
    fn numbers_without_a_header_are_mot_or_need_names() {
        assert_eq!(table("1,-1,5,6,7,8,0.9\n").unwrap().kind, Kind::Mot);
        assert!(table("1,2,3\n").is_err());
        assert!(table("").is_err());
        assert!(table("\0\0").is_err());
    }
}
