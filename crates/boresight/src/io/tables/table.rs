//! A table being read, whatever its dialect: told by its first line, then given row by row.

use super::coco;
use super::columns::{Columns, Field, Layout};
use super::dialect::{ab3dmot, kitti, mot, named};
use super::kind::Kind;
use super::lexer::{Lines, Separator, split};
use super::number::parse_f64;
use super::row::{Form, Row, list};
use crate::io::sniff::{SNIFF_BYTES, read_up_to};
use crate::{Error, ErrorKind, Result};
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

/// A table, its form known, its rows still to come.
pub(crate) struct Table {
    pub form: Form,
    /// Whether the text has no line that says anything.
    pub is_empty: bool,
    /// Unit of positions, where the table names one that is not the pixel; known once the first row is read.
    pub unit: Option<String>,
    lines: Lines,
    cells: Vec<(u32, u32)>,
    /// Lines of names and units that may still come before the first row.
    heads_left: u8,
}

impl Table {
    /// Opens a file and finds its form by its look.
    /// # Errors
    /// A file that cannot be read or looks like no table; columns that are named but not there.
    pub fn open(path: &Path, columns: &Columns) -> Result<Self> {
        columns.validate("columns")?;
        let label = path.display().to_string();
        let cannot = |e: std::io::Error| Error::new(ErrorKind::NotFound, "cannot be opened").at(&label).because(e);
        let mut file = File::open(path).map_err(cannot)?;
        let mut head = read_up_to(&mut file, SNIFF_BYTES).map_err(cannot)?;
        if coco::looks_like(&head) {
            file.read_to_end(&mut head).map_err(cannot)?;
            let rows = coco::as_table(&head, &label)?;
            return Self::begin(Lines::new(label, Box::new(Cursor::new(rows.into_bytes()))), columns, None);
        }
        Self::begin(Lines::new(label, Box::new(Cursor::new(head).chain(file))), columns, None)
    }

    /// Opens a file that is said to be of this kind.
    /// # Errors
    /// As [`Table::open`].
    pub fn open_as(path: &Path, kind: Kind) -> Result<Self> {
        Self::begin(Lines::open(path)?, &Columns::default(), Some(kind))
    }

    /// Finds the form of a text.
    #[cfg(test)]
    pub fn of_text(label: &str, text: &[u8], columns: &Columns) -> Result<Self> {
        let source = Box::new(std::io::Cursor::new(text.to_vec()));
        Self::begin(Lines::new(label.to_string(), source), columns, None)
    }

    fn begin(mut lines: Lines, columns: &Columns, said: Option<Kind>) -> Result<Self> {
        let label = lines.label().to_string();
        let mut cells = Vec::new();
        let Some(first) = lines.next_line()? else {
            // An empty table: a tracker that found nothing.
            let kind = said.unwrap_or(Kind::Mot);
            let layout = fixed_layout(kind);
            let form = Form { label, kind, header: Vec::new(), layout, separator: Separator::Blanks };
            return Ok(Self { form, is_empty: true, unit: None, lines, cells, heads_left: 0 });
        };
        let mut separator = Separator::of(first.text);
        split(first.text, separator, &mut cells);
        let text = |c: &(u32, u32)| String::from_utf8_lossy(&first.text[c.0 as usize..c.1 as usize]).into_owned();
        let header: Vec<String> = cells.iter().map(|c| text(c).replace("\"\"", "\"")).collect();
        let look = match said {
            Some(Kind::Named) => Ok((Kind::Named, true)),
            Some(kind) => Ok((kind, false)),
            None => look_of(first.text, separator, &header, columns),
        };
        let (kind, has_header) = look.map_err(|e| e.at(&label))?;
        if kind == Kind::Kitti {
            separator = Separator::Blanks;
        }
        let layout = match kind {
            Kind::Named => Layout::of_header(&header, columns).map_err(|e| e.at(&label))?,
            kind => fixed_layout(kind),
        };
        let heads_left = if kind == Kind::Named && named::is_trackmate(&header) { named::TRACKMATE_LINES } else { 0 };
        if !has_header {
            lines.again();
        }
        let form = Form { label, kind, header, layout, separator };
        Ok(Self { form, is_empty: false, unit: None, lines, cells, heads_left })
    }

    /// The next row in file order.
    /// # Errors
    /// A file that cannot be read to its end.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>> {
        loop {
            let Some(line) = self.lines.next_line()? else { return Ok(None) };
            split(line.text, self.form.separator, &mut self.cells);
            if self.heads_left == 0 {
                break;
            }
            let row = Row { form: &self.form, line, cells: &self.cells };
            if row.is_number(Field::Frame) {
                self.heads_left = 0;
                break;
            }
            let unit = row.word(Field::X).and_then(|cell| named::trackmate_unit(&cell));
            self.unit = unit.or(self.unit.take());
            self.heads_left -= 1;
        }
        Ok(Some(Row { form: &self.form, line: self.lines.line(), cells: &self.cells }))
    }

    /// The number of its first frame, unless told otherwise.
    pub fn first_frame(&self) -> u64 {
        u64::from(self.form.kind == Kind::Mot)
    }

    /// An error about the columns as a whole.
    pub fn lacks(&self, what: &str, mend: &str) -> Error {
        Error::new(ErrorKind::Unsupported, format!("no column says {what}"))
            .at(&self.form.label)
            .hint(format!("the columns are {}; {mend}", list(&self.form.header)))
    }

    /// Whether it says which frame and where in it.
    /// # Errors
    /// Columns that are missing, with the option that names them.
    pub fn check_place(&self) -> Result<()> {
        if !self.form.layout.has(&[Field::Frame]) {
            return Err(self.lacks("which frame a row belongs to", "name it: --columns frame=NAME"));
        }
        if !self.form.layout.has_position() {
            return Err(self.lacks("where a detection is (x and y, or a box)", "name them: --columns x=NAME,y=NAME"));
        }
        Ok(())
    }

    /// Whether it says which track.
    /// # Errors
    /// A column that is missing.
    pub fn check_track(&self) -> Result<()> {
        if self.form.layout.has(&[Field::Id]) {
            return Ok(());
        }
        Err(self.lacks("which track a row belongs to", "rename the one that does to track_id"))
    }
}

fn fixed_layout(kind: Kind) -> Layout {
    match kind {
        Kind::Named => Layout::default(),
        Kind::Mot => mot::layout(),
        Kind::Kitti => kitti::layout(),
        Kind::Ab3dmot => ab3dmot::layout(),
    }
}

/// The kind of a table by its first line, and whether that line is a header.
fn look_of(line: &[u8], separator: Separator, fields: &[String], columns: &Columns) -> Result<(Kind, bool)> {
    let comma = separator != Separator::Byte(b',');
    let is_number = |f: &str| parse_f64(f.as_bytes(), comma).is_some();
    let numbers = fields.iter().any(|f| is_number(f)) && fields.iter().all(|f| f.is_empty() || is_number(f));
    if !columns.names.is_empty() {
        return Ok((Kind::Named, !numbers));
    }
    if numbers {
        let values: Vec<Option<f64>> = fields.iter().map(|f| parse_f64(f.as_bytes(), comma)).collect();
        if ab3dmot::looks_like(&values) {
            return Ok((Kind::Ab3dmot, false));
        }
        if fields.len() >= mot::LEAST_COLUMNS {
            return Ok((Kind::Mot, false));
        }
        let what = format!("{} numbers in its first line and no header", fields.len());
        return Err(Error::new(ErrorKind::Unsupported, what)
            .hint("add a header such as frame,x,y; or name the columns by number: --columns frame=1,x=2,y=3"));
    }
    let layout = Layout::of_header(fields, columns)?;
    if layout.has(&[Field::Frame]) && layout.has_position() {
        return Ok((Kind::Named, true));
    }
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    let (first, third) = (words.next(), words.nth(1));
    let begins_with_number =
        fields.first().is_some_and(|f| is_number(f)) || first.is_some_and(|w| parse_f64(w, false).is_some());
    if begins_with_number && third.is_some_and(|t| t[0].is_ascii_alphabetic()) {
        return Ok((Kind::Kitti, false));
    }
    let begins_with_name =
        line.trim_ascii_start().first().is_some_and(|b| b.is_ascii_alphabetic() || b"\"_".contains(b) || !b.is_ascii());
    if begins_with_name && fields.len() > 1 {
        // Names of columns, but not those that are needed: the reader says which.
        return Ok((Kind::Named, true));
    }
    let shown: String = String::from_utf8_lossy(line).trim().chars().take(60).collect();
    Err(Error::new(ErrorKind::Unsupported, format!("begins with \"{shown}\": no table of tracks known here"))
        .hint("known are MOTChallenge, KITTI, COCO, CSV with named columns (frame, track_id, x, y ..) and Cell Tracking Challenge folders"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<Table> {
        Table::of_text("t.csv", text.as_bytes(), &Columns::default())
    }

    /// Calls `each` for all rows.
    fn rows<T>(text: &str, mut each: impl FnMut(&Row<'_>) -> T) -> Vec<T> {
        let mut table = table(text).unwrap();
        let mut out = Vec::new();
        while let Some(row) = table.next_row().unwrap() {
            out.push(each(&row));
        }
        out
    }

    fn xs(text: &str) -> Vec<f64> {
        rows(text, |r| r.need(Field::X).unwrap())
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
        let errors = rows("frame,x,y\n0,1,2\n1,abc,3\n", |r| r.need(Field::X).map_err(|e| e.to_string()));
        assert_eq!(errors[1], Err("t.csv line 3: column x: expected a position x, found \"abc\"".to_string()));
        let errors = rows("1,1,1,1,5,5,1\n1,2,1\n", |r| r.bbox().map_err(|e| e.to_string()));
        assert_eq!(
            errors[1],
            Err("t.csv line 2: column 4: expected a top edge, found the end of the line".to_string())
        );
    }

    #[test]
    fn a_row_with_more_cells_than_the_header_is_refused_unless_they_are_empty() {
        let length = |text: &str| rows(text, |r| r.check_length()).pop().unwrap();
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
        let long = format!("frame,x,y\n0,{},3\n", "z".repeat(100_000));
        assert!(rows(&long, |r| r.need(Field::X).unwrap_err().to_string())[0].len() < 200);
    }

    #[test]
    fn tables_are_known_by_their_look() {
        let look = |text: &str| table(text).map(|t| t.form.kind).map_err(|e| e.to_string());
        assert_eq!(look("1,-1,5,6,7,8,0.9\n"), Ok(Kind::Mot));
        assert_eq!(look("1,2,3,4,5,6,1,-1,-1,-1\n"), Ok(Kind::Mot));
        assert_eq!(look("1;-1;5;6,5;7;8\n"), Ok(Kind::Mot));
        assert_eq!(look("0 1 Car 0 0 0 1 2 3 4\n"), Ok(Kind::Kitti));
        assert_eq!(look("0,2,10,20,30,40,5,1,1,4,-4,1,30,0,0\n"), Ok(Kind::Ab3dmot));
        assert_eq!(look("frame,particle,x,y\n"), Ok(Kind::Named));
        assert_eq!(look(",frame,particle,x,y\n"), Ok(Kind::Named), "the index of a data frame has no name");
        assert_eq!(look("\u{feff}# by hand\nframe;particle;x;y\n"), Ok(Kind::Named));
        assert_eq!(look("frame\tx\ty\n"), Ok(Kind::Named), "no KITTI label");
        assert!(look("1,2,3\n").unwrap_err().contains("no header"));
        assert!(look("\0\0").unwrap_err().contains("binary"));
        assert!(look("<html>hello</html>").unwrap_err().contains("no table of tracks known here"));
        assert!(table("").unwrap().is_empty);
    }
}
