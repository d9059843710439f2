//! Apache Parquet: a row for each track and frame, with the columns of `tracks.csv` where the table has them, and its score and class.
//!
//! Source: *Apache Parquet format* 2; the crate `parquet`, without Arrow and without compression. Columns that no row fills are left
//! out; what some rows lack is null. Row groups of 2^20 rows. Positions are centres, px.

use super::paths::{centre, class, dropped};
use crate::io::atomic::AtomicFile;
use crate::io::tables::{COVARIANCE_COLUMNS, status_word};
use crate::{Error, ErrorKind, PixelOrigin, Result, TrackTable};
use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Rows of a group.
const GROUP: usize = 1 << 20;

type Of<'a, T> = Box<dyn Fn(usize) -> Option<T> + 'a>;

/// What a column holds for each row.
enum Column<'a> {
    Whole(Of<'a, i64>),
    Double(Of<'a, f64>),
    Text(Of<'a, String>),
}

/// Writes the columns that any row fills; the names of what is lost are returned.
/// # Errors
/// What the writer fails with.
pub(crate) fn write(table: &TrackTable, out: &mut (impl Write + Send)) -> Result<Vec<String>> {
    let mut columns = columns(table, None);
    columns.retain(|(_, column)| says(table, column));
    begin(&columns, out)
        .and_then(|mut file| rows(&mut file, table, &columns).and_then(|()| file.close()))
        .map_err(failed)?;
    let held: Vec<&str> = columns.iter().map(|c| c.0).chain(["class names"]).collect();
    Ok(dropped(table, &held))
}

/// Writes the tables of several inputs to one file, which appears whole, behind a column `input`; returns the number of rows.
/// # Errors
/// What a table fails with; a file that cannot be written.
pub fn write_parquet(
    path: impl AsRef<Path>,
    tables: impl Iterator<Item = Result<(String, TrackTable)>>,
) -> Result<u64> {
    let mut out = AtomicFile::create(path.as_ref())?;
    let none = TrackTable::from_rows("", PixelOrigin::Centre0, [])?;
    let mut file = begin(&columns(&none, Some("")), &mut out).map_err(failed)?;
    let mut n_rows = 0;
    for table in tables {
        let (input, table) = table?;
        rows(&mut file, &table, &columns(&table, Some(&input))).map_err(failed)?;
        n_rows += table.n_rows() as u64;
    }
    file.close().map_err(failed)?;
    out.finish()?;
    Ok(n_rows)
}

fn failed(e: ParquetError) -> Error {
    Error::new(ErrorKind::Output, "cannot be written as Parquet").because(e)
}

/// Begins a file with these columns.
fn begin<W: Write + Send>(columns: &[(&str, Column<'_>)], out: W) -> parquet::errors::Result<SerializedFileWriter<W>> {
    let fields =
        columns.iter().map(|(name, column)| field(name, column)).collect::<parquet::errors::Result<Vec<_>>>()?;
    let schema = Arc::new(Type::group_type_builder("tracks").with_fields(fields).build()?);
    let properties = WriterProperties::builder().set_created_by(format!("boresight {}", env!("CARGO_PKG_VERSION")));
    SerializedFileWriter::new(out, schema, Arc::new(properties.build()))
}

/// Appends all rows of a table.
fn rows<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    table: &TrackTable,
    columns: &[(&str, Column<'_>)],
) -> parquet::errors::Result<()> {
    for begin in (0..table.n_rows()).step_by(GROUP) {
        let rows = begin..(begin + GROUP).min(table.n_rows());
        let mut group = file.next_row_group()?;
        for (_, column) in columns {
            match column {
                Column::Whole(of) => put::<Int64Type>(&mut group, rows.clone(), of)?,
                Column::Double(of) => put::<DoubleType>(&mut group, rows.clone(), of)?,
                Column::Text(of) => {
                    put::<ByteArrayType>(&mut group, rows.clone(), &|r| {
                        of(r).map(|s| ByteArray::from(s.into_bytes()))
                    })?;
                }
            }
        }
        group.close()?;
    }
    Ok(())
}

/// Whether any row fills a column; an empty table keeps them all.
fn says(table: &TrackTable, column: &Column<'_>) -> bool {
    table.n_rows() == 0
        || (0..table.n_rows()).any(|r| match column {
            Column::Whole(of) => of(r).is_some(),
            Column::Double(of) => of(r).is_some(),
            Column::Text(of) => of(r).is_some(),
        })
}

/// All columns; with an input's name that of the inputs first.
fn columns<'a>(table: &'a TrackTable, input: Option<&'a str>) -> Vec<(&'static str, Column<'a>)> {
    let mut frames = vec![0_i64; table.n_rows()];
    (0..table.n_frames()).for_each(|f| table.rows(f).for_each(|r| frames[r] = f as i64));
    let mut all: Vec<(&str, Column<'_>)> = vec![
        ("frame", Column::Whole(Box::new(move |r| Some(frames[r])))),
        ("time_s", Column::Double(Box::new(|r| table.state(r).time.map(|t| t.as_secs_f64())))),
        ("track_id", Column::Whole(Box::new(|r| Some(table.ids[table.tracks[r] as usize])))),
        ("status", Column::Text(Box::new(|r| table.state(r).status.map(|s| status_word(s).to_string())))),
        ("x_px", Column::Double(Box::new(|r| Some(centre(table, r)[0])))),
        ("y_px", Column::Double(Box::new(|r| Some(centre(table, r)[1])))),
        ("vx_px_per_s", Column::Double(Box::new(|r| table.velocity(r).map(|v| v.x)))),
        ("vy_px_per_s", Column::Double(Box::new(|r| table.velocity(r).map(|v| v.y)))),
    ];
    for (k, name) in COVARIANCE_COLUMNS.into_iter().enumerate() {
        let of = move |r: usize| match (table.state(r).cov, table.state(r).position_cov) {
            (Some(cov), _) => Some(cov[k]),
            // Variances of x and y, and between them, may stand alone.
            (None, Some([xx, xy, yy])) => [(0, xx), (2, xy), (7, yy)].iter().find(|p| p.0 == k).map(|p| p.1),
            (None, None) => None,
        };
        all.push((name, Column::Double(Box::new(of))));
    }
    let size = |k: usize| move |r: usize| (!table.is_points).then(|| centre(table, r)[k]);
    all.push(("width_px", Column::Double(Box::new(size(2)))));
    all.push(("height_px", Column::Double(Box::new(size(3)))));
    all.push(("detection", Column::Whole(Box::new(|r| table.state(r).detection.map(i64::from)))));
    all.push(("score", Column::Double(Box::new(|r| Some(table.score.get(r))))));
    all.push(("class", Column::Text(Box::new(|r| Some(class(table, r))))));
    if let Some(input) = input {
        all.insert(0, ("input", Column::Text(Box::new(move |_| Some(input.to_string())))));
    }
    all
}

fn field(name: &str, column: &Column<'_>) -> parquet::errors::Result<Arc<Type>> {
    let physical = match column {
        Column::Whole(_) => Physical::INT64,
        Column::Double(_) => Physical::DOUBLE,
        Column::Text(_) => Physical::BYTE_ARRAY,
    };
    let builder = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
    let builder = match column {
        Column::Text(_) => {
            builder.with_converted_type(ConvertedType::UTF8).with_logical_type(Some(LogicalType::String))
        }
        _ => builder,
    };
    builder.build().map(Arc::new)
}

/// Writes the next column of a group.
fn put<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
    rows: Range<usize>,
    of: &dyn Fn(usize) -> Option<T::T>,
) -> parquet::errors::Result<()> {
    let Some(mut writer) = group.next_column()? else { return Ok(()) };
    let values: Vec<Option<T::T>> = rows.map(of).collect();
    let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    writer.typed::<T>().write_batch(&values, Some(&levels), None)?;
    writer.close()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RowState, TrackRow, TrackTableBuilder};
    use parquet::file::reader::{FileReader, SerializedFileReader};

    #[test]
    fn rows_are_read_back_and_what_some_lack_is_null() {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        let row = |frame| TrackRow { frame, id: 3, bbox: [0.0, 0.0, 2.0, 4.0], ..TrackRow::default() };
        b.push(&row(0)).unwrap();
        b.push_with_state(&row(2), &RowState { velocity: Some([2.0, 0.5]), ..RowState::default() }).unwrap();
        let mut bytes = Vec::new();
        assert!(write(&b.finish(0).unwrap(), &mut bytes).unwrap().is_empty());
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        let file = SerializedFileReader::new(file).unwrap();
        let rows: Vec<String> = file.get_row_iter(None).unwrap().map(|r| r.unwrap().to_string()).collect();
        assert!(rows[0].starts_with("{frame: 0, track_id: 3, x_px: 1.0, y_px: 2.0, vx_px_per_s: null"), "{rows:?}");
        assert!(rows[1].contains("vx_px_per_s: 2.0") && !rows[1].contains("var_x_px2"), "{rows:?}");
    }
}
