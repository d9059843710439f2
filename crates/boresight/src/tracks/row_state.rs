//! A row's velocity, covariance and status, as the mathematics wants them.

use super::column::Column;
use super::state::RowState;
use super::table::TrackTable;
use crate::TrackStatus;
use nalgebra::{Matrix2, Matrix4, Vector2};

impl TrackTable {
    /// What a row says of its track's state.
    pub fn state(&self, row: usize) -> RowState {
        self.states.row(row)
    }

    /// A row's velocity, px/s, where the table has it.
    pub fn velocity(&self, row: usize) -> Option<Vector2<f64>> {
        self.states.velocity.get(row).map(Vector2::from)
    }

    /// The covariance of a row's position, px², where the table has it alone or within that of the whole state.
    pub fn position_cov(&self, row: usize) -> Option<Matrix2<f64>> {
        let [xx, xy, yy] =
            self.states.position_cov.get(row).or_else(|| self.states.cov.get(row).map(|c| [c[0], c[2], c[7]]))?;
        Some(Matrix2::new(xx, xy, xy, yy))
    }

    /// The covariance of a row's `[x, vx, y, vy]` (px, px/s), where the table has it.
    pub fn state_cov(&self, row: usize) -> Option<Matrix4<f64>> {
        let upper = self.states.cov.get(row)?;
        let mut values = upper.iter();
        let mut cov = Matrix4::zeros();
        for i in 0..4 {
            for j in i..4 {
                let v = *values.next()?;
                cov[(i, j)] = v;
                cov[(j, i)] = v;
            }
        }
        Some(cov)
    }

    /// Whether a row was updated by a detection of its frame, rather than predicted only; `None` where the table is silent.
    pub fn is_measured(&self, row: usize) -> Option<bool> {
        match (self.states.detection.get(row), self.states.status.get(row)) {
            (Some(_), _) => Some(true),
            (None, Some(status)) => Some(status != TrackStatus::Coasting),
            (None, None) => None,
        }
    }

    /// The name of a row's class, where the table names its classes.
    pub fn class_name(&self, row: usize) -> Option<&str> {
        let at = usize::try_from(self.class.get(row)).ok()?.checked_sub(1)?;
        self.class_names.get(at).map(String::as_str)
    }

    /// Whether any row has a velocity.
    pub fn has_velocity(&self) -> bool {
        self.states.velocity != Column::Constant(None)
    }

    /// Whether any row has the covariance of its position.
    pub fn has_position_cov(&self) -> bool {
        self.states.position_cov != Column::Constant(None) || self.has_state_cov()
    }

    /// Whether any row has the covariance of its whole state.
    pub fn has_state_cov(&self) -> bool {
        self.states.cov != Column::Constant(None)
    }

    /// Whether any row names the detection that it took.
    pub fn has_detections(&self) -> bool {
        self.states.detection != Column::Constant(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PixelOrigin, TrackRow, TrackTableBuilder};

    #[test]
    fn states_follow_their_rows_and_rows_without_one_have_none() {
        let mut b = TrackTableBuilder::new("t", PixelOrigin::Centre0);
        let row = |frame| TrackRow { frame, id: 1, ..TrackRow::default() };
        b.push(&row(3)).unwrap();
        let cov = Some(std::array::from_fn(|k| k as f64));
        let state = RowState { velocity: Some([1.0, 2.0]), cov, detection: Some(4), ..RowState::default() };
        b.push_with_state(&row(1), &state).unwrap();
        b.push(&row(0)).unwrap();
        let t = b.finish(0).unwrap();
        assert_eq!((t.state(0), t.state(1), t.state(2)), (RowState::default(), state, RowState::default()));
        assert_eq!(t.position_cov(1), Some(Matrix2::new(0.0, 2.0, 2.0, 7.0)));
        let p = t.state_cov(1).unwrap();
        assert_eq!((p[(1, 3)], p[(3, 1)], p[(3, 3)]), (6.0, 6.0, 9.0));
        assert_eq!((t.is_measured(0), t.is_measured(1)), (None, Some(true)));
        assert!(t.has_velocity() && t.has_state_cov() && t.filtered(|frame, _| frame == 1).has_detections());
        assert_eq!(t.filtered(|frame, _| frame == 1).state(0), state);
    }
}
