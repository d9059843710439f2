//! What a row says beyond its box: time, status, detection taken, velocity and covariances, typed, each where the table has it.

use super::column::Column;
use crate::{Timestamp, TrackStatus};

/// What one row says of its track's state; `None` where the table is silent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowState {
    /// Time of the frame.
    pub time: Option<Timestamp>,
    /// Tentative, confirmed or coasting.
    pub status: Option<TrackStatus>,
    /// Number of the detection that the track took, among those of its frame.
    pub detection: Option<u32>,
    /// Velocity vx, vy, px/s.
    pub velocity: Option<[f64; 2]>,
    /// Covariance of the position: xx, xy, yy, px².
    pub position_cov: Option<[f64; 3]>,
    /// Covariance of `[x, vx, y, vy]`: its upper triangle, row by row, px and px/s.
    pub cov: Option<[f64; 10]>,
}

/// The states of a table's rows; a column that says nothing takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub struct StateColumns {
    /// Time of each row's frame.
    pub time: Column<Option<Timestamp>>,
    /// Status.
    pub status: Column<Option<TrackStatus>>,
    /// Detection taken.
    pub detection: Column<Option<u32>>,
    /// Velocity vx, vy, px/s.
    pub velocity: Column<Option<[f64; 2]>>,
    /// Covariance of the position: xx, xy, yy, px².
    pub position_cov: Column<Option<[f64; 3]>>,
    /// Covariance of `[x, vx, y, vy]`: its upper triangle, row by row.
    pub cov: Column<Option<[f64; 10]>>,
}

impl Default for StateColumns {
    fn default() -> Self {
        Self {
            time: Column::Constant(None),
            status: Column::Constant(None),
            detection: Column::Constant(None),
            velocity: Column::Constant(None),
            position_cov: Column::Constant(None),
            cov: Column::Constant(None),
        }
    }
}

impl StateColumns {
    pub(super) fn push(&mut self, state: &RowState, n_before: usize) {
        self.time.push(state.time, n_before);
        self.status.push(state.status, n_before);
        self.detection.push(state.detection, n_before);
        self.velocity.push(state.velocity, n_before);
        self.position_cov.push(state.position_cov, n_before);
        self.cov.push(state.cov, n_before);
    }

    pub(super) fn reorder(&mut self, order: &[u32]) {
        self.time.reorder(order);
        self.status.reorder(order);
        self.detection.reorder(order);
        self.velocity.reorder(order);
        self.position_cov.reorder(order);
        self.cov.reorder(order);
    }

    pub(super) fn row(&self, row: usize) -> RowState {
        RowState {
            time: self.time.get(row),
            status: self.status.get(row),
            detection: self.detection.get(row),
            velocity: self.velocity.get(row),
            position_cov: self.position_cov.get(row),
            cov: self.cov.get(row),
        }
    }
}
