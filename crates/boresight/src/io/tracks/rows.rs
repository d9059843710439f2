//! Rows of each dialect as rows of a [`crate::TrackTable`].

use super::options::BadRows;
use crate::io::tables::columns::Field;
use crate::io::tables::dialect::{kitti, mot};
use crate::io::tables::row::Row;
use crate::io::tables::table::Table;
use crate::tracks::RowState;
use crate::{Result, TrackRow, TrackStatus, TrackTableBuilder};

/// Whether a column has a place in a [`TrackRow`].
pub(super) fn has_place(column: usize, source: &Table) -> bool {
    use Field::{
        Bottom, Class, Frame, Height, Id, Left, Occlusion, Right, Score, Top, Truncation, Visibility, Width, X, Y,
    };
    [Frame, Id, X, Y, Left, Top, Right, Bottom, Width, Height, Score, Class, Visibility, Truncation, Occlusion]
        .into_iter()
        .any(|f| source.form.layout.column(f) == Some(column))
}

/// What is the same for all rows.
pub(super) struct Rows {
    pub tentative: bool,
    pub keep_extra: bool,
    pub first_frame: u64,
    pub edge_shift_px: f64,
    pub has_state: bool,
    /// Columns kept as text.
    pub kept: Vec<usize>,
}

impl Rows {
    fn frame(&self, row: &Row<'_>) -> Result<u32> {
        let frame = row.frame(self.first_frame)?;
        u32::try_from(frame).map_err(|_| row.bad(format!("frame {frame}: expected at most {}", u32::MAX)))
    }

    /// Adds a row of a table with named columns.
    pub fn named(&self, row: &Row<'_>, table: &mut TrackTableBuilder, bad: &mut BadRows) -> Result<()> {
        let status = row.status();
        if !self.tentative && status == Some(TrackStatus::Tentative) {
            return Ok(());
        }
        row.check_length()?;
        let Some(id) = row.id()? else {
            bad.without_track += 1;
            return Ok(());
        };
        let bbox = match row.bbox()? {
            Some([left, top, width, height]) => [left + self.edge_shift_px, top + self.edge_shift_px, width, height],
            None => {
                let (x, y) = (row.need(Field::X)?, row.need(Field::Y)?);
                let [width, height] = row.size()?.unwrap_or([0.0; 2]);
                [x - width / 2.0, y - height / 2.0, width, height]
            }
        };
        let class = match row.word(Field::Class) {
            None => 1,
            Some(word) => match word.parse::<f64>() {
                Ok(number) if number.is_finite() => number as i32,
                Ok(_) => 1,
                Err(_) => table
                    .class_number(&word)
                    .ok_or_else(|| row.wrong(Field::Class, &word, "one of at most 1000 names of classes"))?,
            },
        };
        let one = TrackRow {
            frame: self.frame(row)?,
            id,
            bbox,
            score: row.maybe(Field::Score)?.unwrap_or(1.0),
            class,
            visibility: row.maybe(Field::Visibility)?.unwrap_or(1.0),
            truncation: row.maybe(Field::Truncation)?.unwrap_or(0.0),
            occlusion: row.maybe(Field::Occlusion)?.unwrap_or(0.0) as i32,
        };
        let state = if self.has_state { state(row)? } else { RowState::default() };
        table.push_with_state(&one, &state).map_err(|e| e.at(row.place()))?;
        self.kept.iter().enumerate().for_each(|(k, &at)| table.push_extra(k, &row.text_at(at)));
        Ok(())
    }

    /// Adds a row of a MOTChallenge table.
    pub fn mot(&self, row: &Row<'_>, table: &mut TrackTableBuilder) -> Result<()> {
        let frame = self.frame(row)?;
        let id = certain_id(row)?;
        let bbox = row.bbox()?.unwrap_or_default();
        let score = row.maybe(Field::Score)?.unwrap_or(1.0);
        let mot::Behind { class, visibility, world } = mot::behind(row)?;
        let (class, visibility) = (class.unwrap_or(1), visibility.unwrap_or(1.0));
        let one = TrackRow { frame, id, bbox, score, class, visibility, ..TrackRow::default() };
        table.push(&one).map_err(|e| e.at(row.place()))?;
        if self.keep_extra {
            world.iter().enumerate().for_each(|(k, v)| table.push_extra(k, &v.to_string()));
        }
        Ok(())
    }

    /// Adds a row of KITTI labels.
    pub fn kitti(&self, row: &Row<'_>, table: &mut TrackTableBuilder) -> Result<()> {
        let frame = self.frame(row)?;
        let id = certain_id(row)?;
        let truncation = row.need(Field::Truncation)?;
        let occlusion = row.need(Field::Occlusion)? as i32;
        let bbox = row.bbox()?.unwrap_or_default();
        let class = match kitti::of(row)? {
            kitti::Of::Class(class) => class,
            kitti::Of::DontCare => {
                table.push_ignore(frame, bbox);
                return Ok(());
            }
        };
        let mut extra = [const { String::new() }; kitti::EXTRA.len()];
        for (text, (name, at)) in extra.iter_mut().zip(kitti::EXTRA) {
            *text = row.number_at(at, name)?.map_or(String::new(), |v| v.to_string());
        }
        let score = row.maybe(Field::Score)?.unwrap_or(1.0);
        if id < 0 {
            return Ok(());
        }
        let one = TrackRow { frame, id, bbox, score, class, visibility: 1.0, truncation, occlusion };
        table.push(&one).map_err(|e| e.at(row.place()))?;
        extra.iter().enumerate().filter(|_| self.keep_extra).for_each(|(k, v)| table.push_extra(k, v));
        Ok(())
    }
}

/// The track's number, which must be there.
fn certain_id(row: &Row<'_>) -> Result<i64> {
    match row.id()? {
        Some(id) => Ok(id),
        None => row.need(Field::Id).map(|v| v as i64),
    }
}

fn state(row: &Row<'_>) -> Result<RowState> {
    let cov = row.all(Field::COV)?;
    let variance = if cov.is_none() { row.all([Field::VarX, Field::VarY])? } else { None };
    let xy = if variance.is_some() { row.maybe(Field::CovXy)?.unwrap_or(0.0) } else { 0.0 };
    Ok(RowState {
        // A column of this name in another program's table may hold anything.
        time: row.time().ok().flatten(),
        status: row.status(),
        detection: row.detection(),
        velocity: row.all(Field::VELOCITY)?,
        position_cov: variance.map(|[xx, yy]| [xx, xy, yy]),
        cov,
    })
}
