//! One row of a table as a detection: position, covariance, box, and what else its columns say.
//!
//! Boxes: in MOTChallenge text the first pixel is 1; in our tables `left_px` is the pixel's edge; in all other tables
//! `left` is taken as the number of the first pixel, from 0. A position without errors gets the options' deviation; a
//! missing box is a square of the row's area, or of the options' side, around the position.

use super::columns::{Field, Layout};
use super::mot::extent_of_mot_box;
use super::number::{parse_seconds, timestamp_of_seconds};
use super::options::TableOptions;
use super::rows::{Kind, Row, Table};
use crate::{ClassId, Detection, Extent, Result, Timestamp};
use nalgebra::{Matrix2, Vector2};

/// A row's frame, time, identity and detection.
pub(super) struct Seen {
    pub frame: u64,
    pub id: u64,
    pub time: Option<Timestamp>,
    pub detection: Detection,
}

/// Reads rows; holds what is the same for all of them.
pub(super) struct RowReader<'t> {
    table: &'t Table,
    layout: &'t Layout,
    options: &'t TableOptions,
    /// From the table's left and top to pixel edges.
    edge_shift_px: f64,
    first_frame: u64,
}

impl<'t> RowReader<'t> {
    pub fn new(table: &'t Table, options: &'t TableOptions) -> Self {
        let edges =
            table.layout.column(Field::Left).and_then(|at| table.header.get(at)).is_some_and(|h| h == "left_px");
        let first_frame = options.first_frame.unwrap_or(if table.kind == Kind::Mot { 1 } else { 0 });
        Self { table, layout: &table.layout, options, edge_shift_px: if edges { 0.0 } else { -0.5 }, first_frame }
    }

    /// What kind of table it is, for the summary.
    pub fn format(&self) -> String {
        if self.table.kind == Kind::Mot {
            return "MOTChallenge".to_string();
        }
        if self.table.header.join(",") == super::detections_csv::DETECTIONS_HEADER {
            return "boresight detections".to_string();
        }
        let fields = [Field::Frame, Field::TimeS, Field::X, Field::Y, Field::Left, Field::Top];
        let used: Vec<_> = fields
            .into_iter()
            .filter_map(|f| self.table.header.get(self.layout.column(f)?))
            .map(String::as_str)
            .collect();
        format!("CSV ({})", used.join(", "))
    }

    /// Reads one row; names of classes that are new are added to `class_names`.
    /// # Errors
    /// A cell that is missing or out of range, with its line and column.
    pub fn read(&self, row: &Row<'_>, identified: bool, class_names: &mut Vec<String>) -> Result<Seen> {
        row.check_length()?;
        let id = if identified { row.need(Field::Id)? } else { 0.0 };
        if id.fract() != 0.0 || id >= 1e15 {
            return Err(row.wrong(Field::Id, row.word(Field::Id).unwrap_or_default(), "a whole number"));
        }
        let frame = row.need(Field::Frame)?;
        let first = self.first_frame as f64;
        if frame < first || frame.fract() != 0.0 || frame >= 1e15 {
            let found = row.word(Field::Frame).unwrap_or_default();
            let error = row.wrong(Field::Frame, found, &format!("a whole number from {first}"));
            return Err(if self.table.kind == Kind::Mot && frame == 0.0 {
                error.hint(
                    "MOTChallenge counts frames from 1; if this table counts from 0: --set input.table.first-frame=0",
                )
            } else {
                error
            });
        }
        let time = match (row.word(Field::TimeS), self.layout.time_scale) {
            (None, _) => None,
            (Some(text), None) => {
                Some(parse_seconds(text).ok_or_else(|| row.wrong(Field::TimeS, text, "a time in seconds"))?)
            }
            (Some(text), Some(scale)) => {
                let time = timestamp_of_seconds(row.need(Field::TimeS)? * scale);
                Some(time.ok_or_else(|| row.wrong(Field::TimeS, text, "a time within 292 years"))?)
            }
        };
        let area = row.maybe(Field::Area)?.filter(|a| *a > 0.0);
        let boxed = self.extent(row)?;
        let position = match (&boxed, self.layout.has(&[Field::X, Field::Y])) {
            (_, true) => {
                let origin = self.options.first_pixel;
                Vector2::new(row.need(Field::X)? - origin, row.need(Field::Y)? - origin)
            }
            (Some(e), false) => Vector2::new(e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0),
            (None, false) => return Err(row.bad("neither a centre nor a box")),
        };
        let extent = boxed.unwrap_or_else(|| {
            let side = area.map_or(self.options.box_px, f64::sqrt);
            Extent {
                left_px: position.x - side / 2.0,
                top_px: position.y - side / 2.0,
                width_px: side,
                height_px: side,
            }
        });
        let cov = self.cov(row, &extent)?;
        let area = area.unwrap_or(extent.width_px * extent.height_px).round().clamp(1.0, f64::from(u32::MAX)) as u32;
        let detection = Detection {
            position,
            cov,
            extent,
            area_px: area,
            peak: row.maybe(Field::Peak)?.unwrap_or(0.0) as f32,
            sum: row.maybe(Field::Sum)?.unwrap_or(0.0),
            score: row.maybe(Field::Score)?.unwrap_or(1.0) as f32,
            class: row.word(Field::Class).and_then(|word| class_of(word, class_names)),
        };
        Ok(Seen { frame: frame as u64 - self.first_frame, id: id as u64, time, detection })
    }

    fn extent(&self, row: &Row<'_>) -> Result<Option<Extent>> {
        if !self.layout.has(&[Field::Left, Field::Top]) {
            // A size without a place: a box around the centre.
            if self.layout.has(&[Field::Width, Field::Height, Field::X, Field::Y])
                && let (Some(w), Some(h)) = (row.maybe(Field::Width)?, row.maybe(Field::Height)?)
                && w >= 0.0
                && h >= 0.0
            {
                let (x, y) =
                    (row.need(Field::X)? - self.options.first_pixel, row.need(Field::Y)? - self.options.first_pixel);
                return Ok(Some(Extent { left_px: x - w / 2.0, top_px: y - h / 2.0, width_px: w, height_px: h }));
            }
            return Ok(None);
        }
        let (left, top) = (row.need(Field::Left)?, row.need(Field::Top)?);
        let (width, height) = if self.layout.has(&[Field::Width, Field::Height]) {
            (row.need(Field::Width)?, row.need(Field::Height)?)
        } else if self.layout.has(&[Field::Right, Field::Bottom]) {
            (row.need(Field::Right)? - left, row.need(Field::Bottom)? - top)
        } else {
            return Ok(None);
        };
        for (field, size) in [(Field::Width, width), (Field::Height, height)] {
            if size < 0.0 {
                return Err(row.wrong(field, &size.to_string(), "a size of at least 0 px"));
            }
        }
        if self.table.kind == Kind::Mot {
            return Ok(Some(extent_of_mot_box([left, top, width, height])));
        }
        let shift = self.edge_shift_px - self.options.first_pixel;
        Ok(Some(Extent { left_px: left + shift, top_px: top + shift, width_px: width, height_px: height }))
    }

    fn cov(&self, row: &Row<'_>, extent: &Extent) -> Result<Matrix2<f64>> {
        if let (Some(xx), Some(yy)) = (row.maybe(Field::VarX)?, row.maybe(Field::VarY)?) {
            let xy = row.maybe(Field::CovXy)?.unwrap_or(0.0);
            if !(xx > 0.0 && yy > 0.0 && xx * yy > xy * xy) {
                let found = format!("{xx}, {xy}, {yy}");
                return Err(row.wrong(Field::VarX, &found, "a positive definite covariance"));
            }
            return Ok(Matrix2::new(xx, xy, xy, yy));
        }
        let side = |s: f64| (s * self.options.std_per_side).max(self.options.std_px);
        // trackpy gives 0 or less where it could not tell the error.
        let x = row.maybe(Field::StdX)?.filter(|s| *s > 0.0).unwrap_or(side(extent.width_px));
        let y = row.maybe(Field::StdY)?.filter(|s| *s > 0.0).unwrap_or(side(extent.height_px));
        Ok(Matrix2::new(x * x, 0.0, 0.0, y * y))
    }
}

/// Most names of classes that are told apart.
const MAX_CLASSES: usize = 1000;

/// A class by number, or by name in the order of appearance.
fn class_of(word: &str, names: &mut Vec<String>) -> Option<ClassId> {
    if names.is_empty()
        && let Some(number) = word.parse::<f64>().ok().filter(|v| v.fract() == 0.0 && (0.0..4e9).contains(v))
    {
        return Some(ClassId(number as u32));
    }
    if let Some(i) = names.iter().position(|n| n == word) {
        return Some(ClassId(i as u32));
    }
    if names.len() >= MAX_CLASSES {
        return None;
    }
    names.push(word.to_string());
    Some(ClassId(names.len() as u32 - 1))
}
