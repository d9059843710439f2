//! Solves the linear programmes of trajectory GOSPA by the interior point method of the crate `clarabel`.
//!
//! Minimise cᵀx subject to A x ≤ b. Without the feature `trajectory-gospa` the solver is not built in, and a programme is
//! refused; tracks without rivals need none.

use crate::{Error, ErrorKind, Result};

/// A linear programme; A is given by columns: column k holds `values[i]` in `rows[i]` for i in `starts[k]..starts[k + 1]`.
#[derive(Debug)]
#[cfg_attr(not(feature = "trajectory-gospa"), allow(dead_code))] // only the solver reads it
pub struct LinearProgramme {
    /// c.
    pub cost: Vec<f64>,
    /// Where the columns of A begin.
    pub starts: Vec<usize>,
    /// Row numbers of the entries.
    pub rows: Vec<usize>,
    /// The entries.
    pub values: Vec<f64>,
    /// b.
    pub bound: Vec<f64>,
}

/// The x of least cost.
/// # Errors
/// [`ErrorKind::Numeric`] if the solver does not finish; [`ErrorKind::Unsupported`] where it is not built in.
#[cfg(feature = "trajectory-gospa")]
pub fn solve(programme: LinearProgramme) -> Result<Vec<f64>> {
    use clarabel::algebra::CscMatrix;
    use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
    let LinearProgramme { cost, starts, rows, values, bound } = programme;
    let settings = DefaultSettings {
        verbose: false,
        max_threads: 1,
        tol_gap_abs: 1e-11,
        tol_gap_rel: 1e-12,
        tol_feas: 1e-11,
        ..DefaultSettings::default()
    };
    let failed = |why: String| Error::new(ErrorKind::Numeric, format!("trajectory GOSPA: {why}"));
    let constraints = CscMatrix::new(bound.len(), cost.len(), starts, rows, values);
    let quadratic = CscMatrix::zeros((cost.len(), cost.len()));
    let cones = [NonnegativeConeT(bound.len())];
    let mut solver = DefaultSolver::new(&quadratic, &cost, &constraints, &bound, &cones, settings)
        .map_err(|e| failed(format!("the linear programme is refused: {e}")))?;
    solver.solve();
    match solver.solution.status {
        // The solver stops where the last digits no longer improve; 1e-8 of a gap is then guaranteed.
        SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(std::mem::take(&mut solver.solution.x)),
        other => Err(failed(format!("the linear programme ends as {other:?}"))),
    }
}

/// There is no solver.
/// # Errors
/// Always [`ErrorKind::Unsupported`].
#[cfg(not(feature = "trajectory-gospa"))]
pub fn solve(programme: LinearProgramme) -> Result<Vec<f64>> {
    let n = programme.cost.len();
    Err(Error::new(ErrorKind::Unsupported, format!("a linear programme of {n} unknowns needs a solver"))
        .hint("build with the feature trajectory-gospa"))
}
