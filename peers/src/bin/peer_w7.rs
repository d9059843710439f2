//! Worker for the comparison with peers, workload W7: linear assignment, dense and sparse.

use boresight::associate::assignment::{Csr, Dense};
use peers::{Fault, Job};

struct DenseJob {
    n: usize,
    cost: Vec<f64>,
    solver: Dense,
    columns: Vec<u32>,
}

impl Job for DenseJob {
    fn run(&mut self) {
        self.columns.clear();
        if let Ok(columns) = self.solver.solve(self.n, &self.cost) {
            self.columns.extend_from_slice(columns);
        }
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        pairs(&self.columns)
    }

    fn units(&self) -> f64 {
        1.0
    }
}

struct SparseJob {
    n_columns: usize,
    starts: Vec<u32>,
    indices: Vec<u32>,
    cost: Vec<f64>,
    solver: Csr,
    columns: Vec<u32>,
}

impl Job for SparseJob {
    fn run(&mut self) {
        self.columns.clear();
        if let Ok(columns) = self.solver.solve(self.n_columns, &self.starts, &self.indices, &self.cost) {
            self.columns.extend_from_slice(columns);
        }
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        pairs(&self.columns)
    }

    fn units(&self) -> f64 {
        1.0
    }
}

fn pairs(columns: &[u32]) -> (Vec<f64>, usize) {
    (columns.iter().enumerate().flat_map(|(i, j)| [i as f64, f64::from(*j)]).collect(), 2)
}

fn load(message: &serde_json::Value) -> Result<Box<dyn Job>, Fault> {
    if let Some(path) = message["inputs"]["csr"].as_str() {
        let bytes = std::fs::read(path)?;
        let whole = |name: &str| -> Result<Vec<u32>, Fault> {
            Ok(peers::read_npz(&bytes, name)?.0.iter().map(|v| *v as u32).collect())
        };
        let shape = whole("shape")?;
        return Ok(Box::new(SparseJob {
            n_columns: *shape.get(1).ok_or("no shape")? as usize,
            starts: whole("indptr")?,
            indices: whole("indices")?,
            cost: peers::read_npz(&bytes, "data")?.0,
            solver: Csr::default(),
            columns: Vec::new(),
        }));
    }
    let (cost, shape) = peers::read_npy(&std::fs::read(message["inputs"]["cost"].as_str().ok_or("no cost")?)?)?;
    let n = *shape.first().ok_or("no shape")?;
    Ok(Box::new(DenseJob { n, cost, solver: Dense::default(), columns: Vec::new() }))
}

fn main() -> Result<(), Fault> {
    peers::serve(load)
}
