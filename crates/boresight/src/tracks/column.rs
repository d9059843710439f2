//! A column that takes no memory while all its values are equal.

/// A column of values that takes no memory while all of them are equal.
#[derive(Clone, Debug, PartialEq)]
pub enum Column<T> {
    /// Every row holds this value.
    Constant(T),
    /// One value a row.
    Values(Vec<T>),
}

impl<T: Copy + PartialEq> Column<T> {
    /// The value of a row.
    pub fn get(&self, row: usize) -> T {
        match self {
            Self::Constant(v) => *v,
            Self::Values(v) => v[row],
        }
    }

    /// Adds a row's value; `n_before` is the number of rows already there.
    pub fn push(&mut self, value: T, n_before: usize) {
        match self {
            Self::Constant(v) if n_before == 0 => *v = value,
            Self::Constant(v) if *v == value => {}
            Self::Constant(v) => {
                let mut all = vec![*v; n_before];
                all.push(value);
                *self = Self::Values(all);
            }
            Self::Values(all) => all.push(value),
        }
    }

    pub(super) fn reorder(&mut self, order: &[u32]) {
        if let Self::Values(v) = self {
            *v = order.iter().map(|&i| v[i as usize]).collect();
        }
    }

    pub(super) fn keep(&mut self, rows: &[u32]) {
        self.reorder(rows);
    }
}
