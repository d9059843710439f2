//! Builds a [`TrackTable`] from rows in any order: by frame, identities ascending.

use super::column::Column;
use super::row::{PixelOrigin, TrackRow};
use super::state::{RowState, StateColumns};
use super::table::TrackTable;
use crate::length_unit::LengthUnit;
use crate::{Error, ErrorKind, Result};
use std::collections::HashMap;

/// Collects the rows of a [`TrackTable`].
#[derive(Debug)]
pub struct TrackTableBuilder {
    table: TrackTable,
    frames: Vec<u32>,
    of_id: HashMap<i64, u32>,
    last: (i64, u32),
    sorted: bool,
    has_states: bool,
}

impl TrackTableBuilder {
    /// An empty table.
    pub fn new(label: impl Into<String>, origin: PixelOrigin) -> Self {
        let table = TrackTable {
            label: label.into(),
            origin,
            unit: LengthUnit::Pixel,
            is_points: false,
            boxes: Vec::new(),
            tracks: Vec::new(),
            ids: Vec::new(),
            score: Column::Constant(1.0),
            class: Column::Constant(1),
            class_names: Vec::new(),
            visibility: Column::Constant(1.0),
            truncation: Column::Constant(0.0),
            occlusion: Column::Constant(0),
            ignore: Vec::new(),
            size_px: None,
            states: StateColumns::default(),
            extra: Vec::new(),
            starts: vec![0],
        };
        Self {
            table,
            frames: Vec::new(),
            of_id: HashMap::new(),
            last: (i64::MIN, u32::MAX),
            sorted: true,
            has_states: false,
        }
    }

    /// Makes room for rows to come.
    pub fn reserve(&mut self, rows: usize) {
        self.table.boxes.reserve(rows);
        self.table.tracks.reserve(rows);
        self.frames.reserve(rows);
    }

    /// Says that the rows are points.
    pub fn points(&mut self) {
        self.table.is_points = true;
    }

    /// Says what positions and sizes are counted in; pixels if nothing is said.
    pub fn unit(&mut self, unit: LengthUnit) {
        self.table.unit = unit;
    }

    /// Adds a region that does not count.
    pub fn push_ignore(&mut self, frame: u32, bbox: [f64; 4]) {
        self.table.ignore.push((frame, bbox));
    }

    /// Adds a further column; its values are given with [`TrackTableBuilder::push_extra`].
    pub fn add_extra(&mut self, name: impl Into<String>) {
        self.table.extra.push((name.into(), Vec::new()));
    }

    /// Adds the value of a further column for the row pushed last.
    pub fn push_extra(&mut self, column: usize, value: &str) {
        if let Some((_, values)) = self.table.extra.get_mut(column) {
            values.push(value.to_string());
        }
    }

    /// Number of rows so far.
    pub fn n_rows(&self) -> usize {
        self.frames.len()
    }

    /// The number, from 1, of a class that goes by a name; `None` for the thousand-and-first name: that is no class.
    pub fn class_number(&mut self, name: &str) -> Option<i32> {
        const MAX_CLASSES: usize = 1000;
        let names = &mut self.table.class_names;
        if let Some(at) = names.iter().position(|n| n == name) {
            return Some(at as i32 + 1);
        }
        if names.len() >= MAX_CLASSES {
            return None;
        }
        names.push(name.to_string());
        Some(names.len() as i32)
    }

    /// Adds a row that says nothing of its track's state.
    /// # Errors
    /// As [`TrackTableBuilder::push_with_state`].
    pub fn push(&mut self, row: &TrackRow) -> Result<()> {
        self.push_with_state(row, &RowState::default())
    }

    /// Adds a row with what it says of its track's state.
    /// # Errors
    /// A box or score that is not finite; more rows than 2³² − 1.
    pub fn push_with_state(&mut self, row: &TrackRow, state: &RowState) -> Result<()> {
        if !row.bbox.iter().all(|v| v.is_finite()) {
            return Err(Error::new(ErrorKind::Damaged, "expected finite coordinates"));
        }
        let n = self.frames.len();
        if n >= u32::MAX as usize {
            return Err(Error::new(ErrorKind::Unsupported, "more than 4 294 967 295 rows"));
        }
        self.sorted &= self.frames.last().is_none_or(|&f| f <= row.frame);
        if self.last.0 != row.id || self.last.1 == u32::MAX {
            let next = self.table.ids.len() as u32;
            let t = *self.of_id.entry(row.id).or_insert(next);
            if t == next {
                self.table.ids.push(row.id);
            }
            self.last = (row.id, t);
        }
        self.frames.push(row.frame);
        self.table.tracks.push(self.last.1);
        self.table.boxes.push(row.bbox);
        self.table.score.push(row.score, n);
        self.table.class.push(row.class, n);
        self.table.visibility.push(row.visibility, n);
        self.table.truncation.push(row.truncation, n);
        self.table.occlusion.push(row.occlusion, n);
        // Most tables have boxes only: they pay nothing for states.
        if self.has_states || *state != RowState::default() {
            self.has_states = true;
            self.table.states.push(state, n);
        }
        Ok(())
    }

    /// Sorts the rows by frame and the ids by number; the table is at least `min_frames` long.
    /// # Errors
    /// A frame number that no sequence of so few rows reaches and that would eat the memory: above 10⁶ + 1000 a row, or 10⁸.
    pub fn finish(mut self, min_frames: usize) -> Result<TrackTable> {
        let n_frames = self.frames.iter().max().map_or(0, |&f| f as usize + 1).max(min_frames);
        let most = self.frames.len().saturating_mul(1000).saturating_add(1_000_000).min(100_000_000);
        if n_frames > most {
            let what = format!(
                "frame number {} in a table of {} rows: expected at most {most}",
                n_frames - 1,
                self.frames.len()
            );
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(&self.table.label)
                .hint("is the frame column really the frame?"));
        }
        let mut starts = vec![0_u32; n_frames + 1];
        for &f in &self.frames {
            starts[f as usize + 1] += 1;
        }
        for f in 0..n_frames {
            starts[f + 1] += starts[f];
        }
        let t = &mut self.table;
        if !self.sorted {
            let mut next = starts.clone();
            let mut order = vec![0_u32; self.frames.len()];
            for (i, &f) in self.frames.iter().enumerate() {
                order[next[f as usize] as usize] = i as u32;
                next[f as usize] += 1;
            }
            t.boxes = order.iter().map(|&i| t.boxes[i as usize]).collect();
            t.tracks = order.iter().map(|&i| t.tracks[i as usize]).collect();
            t.score.reorder(&order);
            t.class.reorder(&order);
            t.visibility.reorder(&order);
            t.truncation.reorder(&order);
            t.occlusion.reorder(&order);
            t.states.reorder(&order);
            for (_, v) in &mut t.extra {
                *v = order.iter().map(|&i| std::mem::take(&mut v[i as usize])).collect();
            }
        }
        let mut by_id: Vec<u32> = (0..t.ids.len() as u32).collect();
        by_id.sort_unstable_by_key(|&i| t.ids[i as usize]);
        let mut rank = vec![0_u32; by_id.len()];
        for (new, &old) in by_id.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        t.ids.sort_unstable();
        for track in &mut t.tracks {
            *track = rank[*track as usize];
        }
        t.starts = starts;
        Ok(self.table)
    }
}

impl TrackTable {
    /// Builds a table from rows in any order (rows of one frame keep theirs).
    /// # Errors
    /// A number that is not finite; more rows than 2³² − 1.
    pub fn from_rows(
        label: impl Into<String>,
        origin: PixelOrigin,
        rows: impl IntoIterator<Item = TrackRow>,
    ) -> Result<Self> {
        let mut b = TrackTableBuilder::new(label, origin);
        for row in rows {
            b.push(&row)?;
        }
        b.finish(0)
    }
}
