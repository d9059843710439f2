//! One row of a table as a detection: position, covariance, box, and what else its columns say.
//!
//! Boxes: in MOTChallenge text the first pixel is 1; in our tables `left_px` is the pixel's edge; in all other tables
//! `left` is taken as the number of the first pixel, from 0. A position without errors gets the options' deviation; a
//! missing box is a square of the row's area, or of the options' side, around the position.

use super::columns::Field;
use super::detections_csv::DETECTIONS_HEADER;
use super::dialect::{kitti, named};
use super::kind::Kind;
use super::options::TableOptions;
use super::row::{Form, Row};
use crate::{ClassId, Detection, Extent, PixelOrigin, Result, Timestamp};
use nalgebra::{Matrix2, Vector2};

/// A row's frame, time, identity and detection.
pub(super) struct Seen {
    pub frame: u64,
    pub id: Option<i64>,
    pub time: Option<Timestamp>,
    pub detection: Detection,
}

/// Reads rows; holds what is the same for all of them.
pub(super) struct RowReader<'o> {
    options: &'o TableOptions,
    kind: Kind,
    /// From the table's left and top to pixel edges, before the options' first pixel.
    edge_shift_px: f64,
    first_frame: u64,
    has_centre: bool,
}

impl<'o> RowReader<'o> {
    pub fn new(form: &Form, first_frame: u64, options: &'o TableOptions) -> Self {
        let edge_shift_px = match form.kind {
            Kind::Named => named::edge_shift_px(&form.header, &form.layout),
            Kind::Mot => -PixelOrigin::Pixel1.edge_shift_px(),
            Kind::Kitti | Kind::Ab3dmot => -PixelOrigin::Pixel0.edge_shift_px(),
        };
        let has_centre = form.layout.has(&[Field::X, Field::Y]);
        let first_frame = options.first_frame.unwrap_or(first_frame);
        Self { options, kind: form.kind, edge_shift_px, first_frame, has_centre }
    }

    /// What kind of table it is, for the summary.
    pub fn format(form: &Form) -> String {
        match form.kind {
            Kind::Mot => return "MOTChallenge".to_string(),
            Kind::Kitti => return "KITTI".to_string(),
            Kind::Ab3dmot => return "AB3DMOT's detections on KITTI".to_string(),
            Kind::Named if form.header.join(",").starts_with(DETECTIONS_HEADER) => {
                return "boresight detections".to_string();
            }
            Kind::Named => {}
        }
        let fields = [Field::Frame, Field::TimeS, Field::X, Field::Y, Field::Left, Field::Top];
        let used: Vec<_> =
            fields.into_iter().filter_map(|f| form.header.get(form.layout.column(f)?)).map(String::as_str).collect();
        format!("CSV ({})", used.join(", "))
    }

    /// Reads one row; names of classes that are new are added to `class_names`. `None` where the row is of no target (KITTI's
    /// DontCare).
    /// # Errors
    /// A cell that is missing or out of range, with its line and column.
    pub fn read(&self, row: &Row<'_>, identified: bool, class_names: &mut Vec<String>) -> Result<Option<Seen>> {
        row.check_length()?;
        let id = if identified { row.id()? } else { None };
        let frame = row.frame(self.first_frame)?;
        let time = row.time()?;
        if self.kind == Kind::Kitti && kitti::of(row)? == kitti::Of::DontCare {
            return Ok(None);
        }
        let area = row.maybe(Field::Area)?.filter(|a| *a > 0.0);
        let origin = self.options.first_pixel;
        let centre = if self.has_centre {
            Some(Vector2::new(row.need(Field::X)? - origin, row.need(Field::Y)? - origin))
        } else {
            None
        };
        let boxed = self.extent(row, centre)?;
        let position = match (&boxed, centre) {
            (_, Some(centre)) => centre,
            (Some(e), None) => Vector2::new(e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0),
            (None, None) => return Err(row.bad("neither a centre nor a box")),
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
            class: row.word(Field::Class).and_then(|word| class_of(&word, class_names)),
            velocity: None,
            fit: None,
            age_ns: age_ns(row)?,
            plot: None,
        };
        Ok(Some(Seen { frame, id, time, detection }))
    }

    fn extent(&self, row: &Row<'_>, centre: Option<Vector2<f64>>) -> Result<Option<Extent>> {
        if let Some([left, top, width_px, height_px]) = row.bbox()? {
            // MOTChallenge text always counts from 1.
            let origin = if self.kind == Kind::Mot { 0.0 } else { self.options.first_pixel };
            let shift = self.edge_shift_px - origin;
            return Ok(Some(Extent { left_px: left + shift, top_px: top + shift, width_px, height_px }));
        }
        // A size without a place: a box around the centre.
        Ok(centre.zip(row.size()?).map(|(c, [width_px, height_px])| Extent {
            left_px: c.x - width_px / 2.0,
            top_px: c.y - height_px / 2.0,
            width_px,
            height_px,
        }))
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

/// How long before its scan's time a row was seen, ns, if it says.
fn age_ns(row: &Row<'_>) -> Result<u64> {
    match row.maybe(Field::Age)? {
        None => Ok(0),
        Some(s) if (0.0..=1e9).contains(&s) => Ok((s * 1e9).round() as u64),
        Some(s) => Err(row.wrong(Field::Age, &s.to_string(), "a time in seconds from 0 on, before that of the frame")),
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
