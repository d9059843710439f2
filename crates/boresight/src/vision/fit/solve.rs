//! Normal equations of a few parameters on the stack: their sums, which parameters are free, and their solution.
//!
//! Parameters that share a value (the two deviations of a round spot) or are held are told by a map from all parameters to the free ones; sums over
//! all become sums over the free ones by adding rows and columns. Solved by Cholesky's factors, in the unit of each diagonal.

/// Mark of a parameter that is held.
pub(super) const HELD: usize = usize::MAX;

/// Sums at a state of at most `P` parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums<const P: usize> {
    /// Number of parameters.
    pub(super) n: usize,
    /// Fisher information Σ J Jᵀ / variance; the lower triangle.
    pub(super) matrix: [[f64; P]; P],
    /// Σ J (value - mean) / variance.
    pub(super) vector: [f64; P],
    /// Deviance up to a constant.
    pub(super) cost: f64,
    /// Σ (value - mean)² / variance.
    pub(super) chi2: f64,
}

impl<const P: usize> Sums<P> {
    pub(super) fn new(n: usize) -> Self {
        Self { n: n.min(P), matrix: [[0.0; P]; P], vector: [0.0; P], cost: 0.0, chi2: 0.0 }
    }

    /// The sums over the free parameters.
    pub(super) fn free(&self, to: &[usize; P], n_free: usize) -> Self {
        let mut out = Self { cost: self.cost, chi2: self.chi2, ..Self::new(n_free) };
        for i in (0..self.n).filter(|&i| to[i] != HELD) {
            let a = to[i];
            out.vector[a] += self.vector[i];
            for j in (0..=i).filter(|&j| to[j] != HELD) {
                let b = to[j];
                // Two that share a value stand in both triangles.
                let twice = if a == b && i != j { 2.0 } else { 1.0 };
                out.matrix[a.max(b)][a.min(b)] += twice * self.matrix[i][j];
            }
        }
        out
    }
}

/// The factor of a positive matrix, its rows scaled to a diagonal of 1.
pub(super) struct Factor<const P: usize> {
    n: usize,
    lower: [[f64; P]; P],
    scale: [f64; P],
}

impl<const P: usize> Factor<P> {
    /// Factors the matrix with its diagonal enlarged by the share `damping`; `None` if it is not surely positive.
    pub(super) fn of(sums: &Sums<P>, damping: f64) -> Option<Self> {
        let n = sums.n;
        let mut f = Self { n, lower: [[0.0; P]; P], scale: [0.0; P] };
        for i in 0..n {
            let d = sums.matrix[i][i];
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            f.scale[i] = 1.0 / d.sqrt();
        }
        for i in 0..n {
            for j in 0..=i {
                let mut v = sums.matrix[i][j] * f.scale[i] * f.scale[j];
                if i == j {
                    v += damping;
                }
                for k in 0..j {
                    v -= f.lower[i][k] * f.lower[j][k];
                }
                if i == j {
                    // Below this, parameters cannot be told apart in f64.
                    if v.is_nan() || v <= 1e-12 {
                        return None;
                    }
                    f.lower[i][i] = v.sqrt();
                } else {
                    f.lower[i][j] = v / f.lower[j][j];
                }
            }
        }
        Some(f)
    }

    /// Solves for a right side.
    pub(super) fn solve(&self, right: &[f64; P]) -> [f64; P] {
        let mut x = [0.0; P];
        for i in 0..self.n {
            let sum: f64 = (0..i).map(|k| self.lower[i][k] * x[k]).sum();
            x[i] = (right[i] * self.scale[i] - sum) / self.lower[i][i];
        }
        for i in (0..self.n).rev() {
            let sum: f64 = (i + 1..self.n).map(|k| self.lower[k][i] * x[k]).sum();
            x[i] = (x[i] - sum) / self.lower[i][i];
        }
        for i in 0..self.n {
            x[i] *= self.scale[i];
        }
        x
    }

    /// Column `i` of the inverse.
    pub(super) fn inverse_column(&self, i: usize) -> [f64; P] {
        let mut unit = [0.0; P];
        unit[i] = 1.0;
        self.solve(&unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    #[test]
    fn solutions_are_those_of_a_general_solver_whatever_the_units() {
        let full = Matrix4::new(4e8, 3e4, 1.0, 2e3, 3e4, 9.0, 1e-4, 0.1, 1.0, 1e-4, 1e-6, 1e-4, 2e3, 0.1, 1e-4, 0.5);
        let mut sums = Sums::<5>::new(4);
        for i in 0..4 {
            for j in 0..=i {
                sums.matrix[i][j] = full[(i, j)];
            }
        }
        sums.vector = [1e3, -2.0, 1e-4, 0.3, 0.0];
        let x = Factor::of(&sums, 0.0).unwrap().solve(&sums.vector);
        let y = full.full_piv_lu().solve(&Vector4::new(1e3, -2.0, 1e-4, 0.3)).unwrap();
        for i in 0..4 {
            assert!((x[i] / y[i] - 1.0).abs() < 1e-9, "{x:?} {y}");
        }
    }

    #[test]
    fn shared_parameters_add_up_as_a_projection_does() {
        let mut sums = Sums::<3>::new(3);
        sums.matrix = [[2.0, 0.0, 0.0], [0.5, 3.0, 0.0], [0.25, -1.0, 4.0]];
        sums.vector = [1.0, 2.0, 4.0];
        let free = sums.free(&[HELD, 0, 0], 1);
        // (0 1 1) M (0 1 1)ᵀ = 3 + 4 - 2.
        assert_eq!((free.matrix[0][0], free.vector[0]), (5.0, 6.0));
        let free = sums.free(&[1, 0, 1], 2);
        // Parameter 0 is the second, 1 the first and third together.
        assert_eq!((free.matrix[0][0], free.matrix[1][0], free.matrix[1][1]), (3.0, -0.5, 6.5));
    }

    #[test]
    fn a_matrix_that_is_not_positive_is_refused() {
        let mut sums = Sums::<2>::new(2);
        sums.matrix = [[1.0, 0.0], [1.0, 1.0]];
        assert!(Factor::of(&sums, 0.0).is_none() && Factor::of(&sums, 1e-3).is_some());
        sums.matrix[0][0] = f64::NAN;
        assert!(Factor::of(&sums, 1.0).is_none());
    }
}
