//! Maximum-weight matching of a sparse bipartite graph by shortest augmenting paths, with a test of uniqueness.
//!
//! Source: J. Munkres' primal-dual scheme with Dijkstra's search (see R. Burkard, M. Dell'Amico, S. Martello, *Assignment
//! Problems*, SIAM 2009, ch. 4), for matchings that may leave vertices free. Dual values u (rows) and v (columns) are
//! ≥ 0, u_i + v_j ≥ w_ij, with equality on matched pairs, and 0 on free vertices: that proves the optimum.
//! Symbols: w weight > 0; slack s_ij = u_i + v_j − w_ij.
//! Limits: weights > 0. Cost: a row's search touches only what is closer than its way out, mostly a few pairs.

use super::NONE;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Weighted pairs, row by row.
#[derive(Clone, Debug, Default)]
pub struct Edges {
    starts: Vec<u32>,
    cols: Vec<u32>,
    weights: Vec<f64>,
}

impl Edges {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.starts.clear();
        self.cols.clear();
        self.weights.clear();
    }

    /// Begins the next row.
    pub fn next_row(&mut self) {
        self.starts.push(self.cols.len() as u32);
    }

    /// Adds a pair to the row begun last.
    pub fn push(&mut self, col: u32, weight: f64) {
        self.cols.push(col);
        self.weights.push(weight);
    }

    /// Ends the last row.
    pub fn close(&mut self) {
        self.starts.push(self.cols.len() as u32);
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.starts[i] as usize..self.starts[i + 1] as usize
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    dist: f64,
    col: u32,
}
impl Eq for Step {}
impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Step {
    fn cmp(&self, other: &Self) -> Ordering {
        // A heap gives the greatest: turn it round; ties by column keep the order fixed.
        other.dist.total_cmp(&self.dist).then(other.col.cmp(&self.col))
    }
}

/// The solver and its memory.
#[derive(Debug, Default)]
pub struct SparseMatcher {
    /// The pair of each row in the last solution, or [`NONE`].
    pub row_edge: Vec<u32>,
    row_of: Vec<u32>,
    u: Vec<f64>,
    v: Vec<f64>,
    dist: Vec<f64>,
    from: Vec<u32>,
    touched: Vec<u32>,
    done: Vec<bool>,
    heap: BinaryHeap<Step>,
    seen_rows: Vec<(u32, f64)>,
    mark: Vec<u8>,
    stack: Vec<(u32, u32)>,
}

fn fit<T: Clone>(v: &mut Vec<T>, n: usize, value: T) {
    v.clear();
    v.resize(n, value);
}

impl SparseMatcher {
    /// Finds a matching of greatest weight; [`SparseMatcher::row_edge`] holds it.
    pub fn solve(&mut self, g: &Edges, n_cols: usize) {
        let n = g.n_rows();
        fit(&mut self.row_edge, n, NONE);
        fit(&mut self.u, n, 0.0);
        fit(&mut self.row_of, n_cols, NONE);
        fit(&mut self.v, n_cols, 0.0);
        fit(&mut self.dist, n_cols, f64::INFINITY);
        fit(&mut self.from, n_cols, NONE);
        fit(&mut self.done, n_cols, false);
        for i in 0..n {
            let mut best = (0.0, NONE);
            for e in g.row(i) {
                if g.weights[e] > best.0 {
                    best = (g.weights[e], e as u32);
                }
            }
            self.u[i] = best.0;
            if best.1 == NONE {
                continue;
            }
            let j = g.cols[best.1 as usize] as usize;
            if self.row_of[j] == NONE && self.v[j] == 0.0 {
                self.row_of[j] = i as u32;
                self.row_edge[i] = best.1;
            } else {
                self.augment(g, i);
            }
        }
    }

    fn augment(&mut self, g: &Edges, start: usize) {
        self.heap.clear();
        self.touched.clear();
        self.seen_rows.clear();
        let (mut row, mut reached) = (start, 0.0);
        let mut way_out = (f64::INFINITY, NONE);
        let (total, sink) = loop {
            self.seen_rows.push((row as u32, reached));
            // The row itself may go free: that costs its dual value.
            if reached + self.u[row] < way_out.0 {
                way_out = (reached + self.u[row], row as u32);
            }
            for e in g.row(row) {
                let j = g.cols[e] as usize;
                if self.done[j] {
                    continue;
                }
                let d = reached + (self.u[row] + self.v[j] - g.weights[e]).max(0.0);
                if d < self.dist[j] && d < way_out.0 {
                    if self.dist[j] == f64::INFINITY {
                        self.touched.push(j as u32);
                    }
                    self.dist[j] = d;
                    self.from[j] = e as u32;
                    self.heap.push(Step { dist: d, col: j as u32 });
                }
            }
            let next = loop {
                match self.heap.pop() {
                    Some(s) if self.done[s.col as usize] => {}
                    other => break other,
                }
            };
            match next {
                Some(s) if s.dist < way_out.0 => {
                    reached = s.dist;
                    self.done[s.col as usize] = true;
                    match self.row_of[s.col as usize] {
                        NONE => break (reached, s.col),
                        i => row = i as usize,
                    }
                }
                _ => break (way_out.0, NONE),
            }
        };
        for &(i, d) in &self.seen_rows {
            self.u[i as usize] -= total - d;
        }
        for &j in &self.touched {
            let j = j as usize;
            if self.done[j] && j as u32 != sink {
                self.v[j] += total - self.dist[j];
            }
        }
        // Along the path back to the start every row takes the column that led to the next one.
        let mut j = sink;
        if sink == NONE {
            let free = way_out.1 as usize;
            self.u[free] = 0.0;
            let old = self.row_edge[free];
            self.row_edge[free] = NONE;
            j = if old == NONE { NONE } else { g.cols[old as usize] };
        }
        while j != NONE {
            let e = self.from[j as usize];
            let i = self.row_of_edge(g, e);
            let old = self.row_edge[i];
            self.row_edge[i] = e;
            self.row_of[j as usize] = i as u32;
            if i == start {
                break;
            }
            j = if old == NONE { NONE } else { g.cols[old as usize] };
        }
        for &j in &self.touched {
            self.dist[j as usize] = f64::INFINITY;
            self.done[j as usize] = false;
        }
    }

    fn row_of_edge(&self, g: &Edges, e: u32) -> usize {
        g.starts.partition_point(|&s| s <= e) - 1
    }

    /// Whether the last solution is the only one within `tol` of the greatest weight.
    ///
    /// Another one exists exactly if along pairs without slack there is a cycle of exchanges, or a chain that begins
    /// where a row can move for nothing (to a free column, or out) and ends where nobody needs what it leaves.
    pub fn is_unique(&mut self, g: &Edges, tol: f64) -> bool {
        let n = g.n_rows();
        // takers[c]: rows that could take the matched column c for nothing; built as row -> tight columns, walked backwards:
        // row k takes the column of row i means an arrow k -> i ("k pushes i out").
        fit(&mut self.mark, n, 0);
        for i in 0..n {
            let mine = self.row_edge[i];
            if mine == NONE {
                // A free row that pushes somebody out for nothing, or finds a free column for nothing.
                if !self.chain_is_harmless(g, i, tol) {
                    return false;
                }
                continue;
            }
            let c = g.cols[mine as usize] as usize;
            if self.v[c] <= tol {
                // Nobody needs this column: its row leaving it for nothing would be another optimum.
                if self.u[i] <= tol || !self.chain_is_harmless(g, i, tol) {
                    return false;
                }
            }
        }
        fit(&mut self.mark, n, 0);
        (0..n).all(|i| self.mark[i] != 0 || self.no_cycle(g, i, tol))
    }

    /// From row `start` (free, or holding a column that may be left): can it push along tight pairs to a loose end?
    fn chain_is_harmless(&mut self, g: &Edges, start: usize, tol: f64) -> bool {
        self.stack.clear();
        self.stack.push((start as u32, 0));
        self.mark.fill(0);
        self.mark[start] = 1;
        while let Some((i, _)) = self.stack.pop() {
            let i = i as usize;
            for e in g.row(i) {
                let j = g.cols[e] as usize;
                if e as u32 == self.row_edge[i] || self.u[i] + self.v[j] - g.weights[e] > tol {
                    continue;
                }
                match self.row_of[j] {
                    NONE => return false,
                    k => {
                        let k = k as usize;
                        if self.u[k] <= tol {
                            return false;
                        }
                        if self.mark[k] == 0 {
                            self.mark[k] = 1;
                            self.stack.push((k as u32, 0));
                        }
                    }
                }
            }
        }
        true
    }

    /// Depth-first search along "k pushes i out"; marks 1 = on the path, 2 = done.
    fn no_cycle(&mut self, g: &Edges, start: usize, tol: f64) -> bool {
        self.stack.clear();
        self.stack.push((start as u32, g.starts[start]));
        self.mark[start] = 1;
        while let Some((i, e)) = self.stack.last_mut() {
            let (row, edge) = (*i as usize, *e as usize);
            if edge == g.starts[row + 1] as usize {
                self.mark[row] = 2;
                self.stack.pop();
                continue;
            }
            *e += 1;
            let j = g.cols[edge] as usize;
            let k = self.row_of[j];
            if k == NONE || edge as u32 == self.row_edge[row] || self.u[row] + self.v[j] - g.weights[edge] > tol {
                continue;
            }
            match self.mark[k as usize] {
                0 => {
                    self.mark[k as usize] = 1;
                    self.stack.push((k, g.starts[k as usize]));
                }
                1 => return false,
                _ => {}
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn graph(n: usize, m: usize, cells: &[u8]) -> Edges {
        let mut g = Edges::default();
        for r in 0..n {
            g.next_row();
            for c in 0..m {
                let w = cells[(r * m + c) % cells.len()];
                if w > 120 {
                    g.push(c as u32, f64::from(w - 120));
                }
            }
        }
        g.close();
        g
    }

    /// Best weight and how many matchings reach it, by trying all.
    fn try_all(g: &Edges, row: usize, used: &mut Vec<bool>) -> (f64, u64) {
        if row == g.n_rows() {
            return (0.0, 1);
        }
        let mut best = try_all(g, row + 1, used);
        for e in g.row(row) {
            let j = g.cols[e] as usize;
            if used[j] {
                continue;
            }
            used[j] = true;
            let (w, n) = try_all(g, row + 1, used);
            used[j] = false;
            match (w + g.weights[e]).total_cmp(&best.0) {
                Ordering::Greater => best = (w + g.weights[e], n),
                Ordering::Equal => best.1 += n,
                Ordering::Less => {}
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_weight_is_the_greatest_and_uniqueness_is_told_right(
            n in 1_usize..6, m in 1_usize..6, coarse in any::<bool>(), cells in proptest::collection::vec(any::<u8>(), 1..26),
        ) {
            let cells: Vec<u8> = cells.iter().map(|&c| if coarse { c / 32 * 32 } else { c }).collect();
            let g = graph(n, m, &cells);
            let mut s = SparseMatcher::default();
            s.solve(&g, m);
            let weight: f64 = s.row_edge.iter().filter(|&&e| e != NONE).map(|&e| g.weights[e as usize]).sum();
            let (best, count) = try_all(&g, 0, &mut vec![false; m]);
            prop_assert_eq!(weight, best);
            prop_assert_eq!(s.is_unique(&g, 1e-9), count == 1);
        }
    }
}
