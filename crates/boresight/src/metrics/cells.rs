//! Cell Tracking Challenge: DET and TRA, the cost of mending the result's graph of cells until it is the truth's.
//!
//! Source: P. Matula et al., *Cell tracking accuracy measurement based on comparison of acyclic oriented graphs*, PLoS ONE
//! 10(12), 2015. A result cell S is matched to a truth cell R of its frame if it covers more than half of R; S may match
//! several R. Costs: splitting a cell 5, adding one 10, removing one 1, removing a link 1, adding one 1.5, mending its
//! kind 1. DET = 1 − min(cost of cells, c₀) / c₀ with c₀ the cost of adding all cells; TRA the same with links.
//! Symbols: links join the same label in following frames ("track") or a parent's last cell to a child's first ("parent").
//! Limits: a track that pauses is linked over its pause.

use crate::{Error, ErrorKind, Image, Result};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// What a frame's two label images have in common.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellFrame {
    /// Area of each truth label, px.
    pub truth: BTreeMap<u32, u64>,
    /// Area of each result label, px.
    pub result: BTreeMap<u32, u64>,
    /// Common area of (truth, result), px.
    pub common: BTreeMap<(u32, u32), u64>,
}

impl CellFrame {
    /// Compares the label images of a frame; a side without an image has no cells in it.
    /// # Errors
    /// As [`CellFrame::of`].
    pub fn of_images(truth: Option<&Image<u16>>, result: Option<&Image<u16>>) -> Result<Self> {
        let n = truth.or(result).map_or(0, |image| image.as_slice().len());
        let background = vec![0; n];
        let pixels = |image: Option<&'_ Image<u16>>| image.map_or(background.clone(), |i| i.as_slice().to_vec());
        Self::of(&pixels(truth), &pixels(result))
    }

    /// Compares two label images of the same size, row-major; 0 is the background.
    /// # Errors
    /// Images of different sizes.
    pub fn of(truth: &[u16], result: &[u16]) -> Result<Self> {
        if truth.len() != result.len() {
            let what = format!("truth of {} pixels, result of {}: expected the same size", truth.len(), result.len());
            return Err(Error::new(ErrorKind::Damaged, what));
        }
        let mut f = Self::default();
        for (&t, &r) in truth.iter().zip(result) {
            if t != 0 {
                *f.truth.entry(u32::from(t)).or_default() += 1;
            }
            if r != 0 {
                *f.result.entry(u32::from(r)).or_default() += 1;
            }
            if t != 0 && r != 0 {
                *f.common.entry((u32::from(t), u32::from(r))).or_default() += 1;
            }
        }
        Ok(f)
    }
}

/// The label images of a truth and a result compared frame by frame, and who is whose parent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellSequence {
    /// What the images of each frame have in common.
    pub frames: Vec<CellFrame>,
    /// (child, parent) labels of the truth.
    pub truth_parents: Vec<(u32, u32)>,
    /// (child, parent) labels of the result.
    pub result_parents: Vec<(u32, u32)>,
}

impl CellSequence {
    /// Compares the two graphs of cells.
    /// # Errors
    /// As [`cell_scores`].
    pub fn scores(&self) -> Result<CellScores> {
        cell_scores(&self.frames, &self.truth_parents, &self.result_parents)
    }
}

/// Counts of what must be mended, and the measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CellScores {
    /// Cells to be split.
    pub splits: u64,
    /// Cells to be added.
    pub missed: u64,
    /// Cells to be removed.
    pub false_: u64,
    /// Links to be removed.
    pub links_wrong: u64,
    /// Links to be added.
    pub links_missed: u64,
    /// Links of the wrong kind.
    pub links_kind: u64,
    /// Cells of the truth.
    pub n_cells: u64,
    /// Links of the truth.
    pub n_links: u64,
}

impl CellScores {
    fn cells_cost(&self) -> f64 {
        5.0 * self.splits as f64 + 10.0 * self.missed as f64 + self.false_ as f64
    }
    /// Detection, 0..=1.
    pub fn det(&self) -> f64 {
        let all = 10.0 * self.n_cells as f64;
        1.0 - self.cells_cost().min(all) / all
    }
    /// Tracking, 0..=1.
    pub fn tra(&self) -> f64 {
        let links = self.links_wrong as f64 + 1.5 * self.links_missed as f64 + self.links_kind as f64;
        let all = 10.0 * self.n_cells as f64 + 1.5 * self.n_links as f64;
        1.0 - (self.cells_cost() + links).min(all) / all
    }
}

/// A cell: frame, label.
type Cell = (u32, u32);

/// Links of a graph: (from, to) -> whether it is a parent's.
fn links(cells: &BTreeMap<u32, Vec<u32>>, parents: &[(u32, u32)]) -> BTreeMap<(Cell, Cell), bool> {
    let mut out = BTreeMap::new();
    for (&label, frames) in cells {
        for w in frames.windows(2) {
            out.insert(((w[0], label), (w[1], label)), false);
        }
    }
    for &(child, parent) in parents {
        if let (Some(c), Some(p)) =
            (cells.get(&child).and_then(|f| f.first()), cells.get(&parent).and_then(|f| f.last()))
        {
            out.insert(((*p, parent), (*c, child)), true);
        }
    }
    out
}

fn frames_of(frames: &[CellFrame], side: impl Fn(&CellFrame) -> &BTreeMap<u32, u64>) -> BTreeMap<u32, Vec<u32>> {
    let mut out: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (k, f) in frames.iter().enumerate() {
        for &label in side(f).keys() {
            out.entry(label).or_default().push(k as u32);
        }
    }
    out
}

/// Compares two graphs of cells; `truth_parents` and `result_parents` are (child, parent) labels.
/// # Errors
/// A truth without cells.
pub fn cell_scores(
    frames: &[CellFrame],
    truth_parents: &[(u32, u32)],
    result_parents: &[(u32, u32)],
) -> Result<CellScores> {
    let mut s = CellScores::default();
    // Truth cell -> result cell, and the result cells that match exactly one.
    let mut of_truth: BTreeMap<Cell, Cell> = BTreeMap::new();
    let mut of_result: BTreeMap<Cell, Cell> = BTreeMap::new();
    let mut shared: BTreeSet<Cell> = BTreeSet::new();
    for (k, f) in frames.iter().enumerate() {
        let k = k as u32;
        s.n_cells += f.truth.len() as u64;
        for (&(t, r), &common) in &f.common {
            if 2 * common > f.truth.get(&t).copied().unwrap_or(u64::MAX / 2) {
                of_truth.insert((k, t), (k, r));
                if of_result.insert((k, r), (k, t)).is_some() {
                    shared.insert((k, r));
                    s.splits += 1;
                }
            }
        }
        s.missed += f.truth.keys().filter(|&&t| !of_truth.contains_key(&(k, t))).count() as u64;
        s.false_ += f.result.keys().filter(|&&r| !of_result.contains_key(&(k, r))).count() as u64;
    }
    if s.n_cells == 0 {
        return Err(Error::new(ErrorKind::Damaged, "the truth has no cells: DET and TRA are not defined"));
    }
    let truth_links = links(&frames_of(frames, |f| &f.truth), truth_parents);
    let result_links = links(&frames_of(frames, |f| &f.result), result_parents);
    s.n_links = truth_links.len() as u64;
    let only = |c: &Cell| if shared.contains(c) { None } else { of_result.get(c) };
    for (a, b) in result_links.keys() {
        if let (Some(&ta), Some(&tb)) = (only(a), only(b)) {
            s.links_wrong += u64::from(!truth_links.contains_key(&(ta, tb)));
        }
    }
    for ((a, b), kind) in &truth_links {
        let found = match (of_truth.get(a), of_truth.get(b)) {
            (Some(ra), Some(rb)) if !shared.contains(ra) && !shared.contains(rb) => result_links.get(&(*ra, *rb)),
            _ => None,
        };
        match found {
            None => s.links_missed += 1,
            Some(k) => s.links_kind += u64::from(k != kind),
        }
    }
    Ok(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(truth: &[&[u16]], result: &[&[u16]]) -> Vec<CellFrame> {
        truth.iter().zip(result).map(|(t, r)| CellFrame::of(t, r).unwrap()).collect()
    }

    #[test]
    fn a_perfect_result_scores_one_and_an_empty_one_nothing() {
        let t: [&[u16]; 2] = [&[1, 1, 0, 2], &[1, 1, 0, 2]];
        let s = cell_scores(&frames(&t, &t), &[], &[]).unwrap();
        assert_eq!((s.det(), s.tra(), s.n_links), (1.0, 1.0, 2));
        let s = cell_scores(&frames(&t, &[&[0; 4], &[0; 4]]), &[], &[]).unwrap();
        assert_eq!((s.det(), s.tra(), s.missed, s.links_missed), (0.0, 0.0, 4, 2));
    }

    #[test]
    fn merging_two_cells_costs_a_split_and_their_links() {
        // One result over both cells in frame 1: a split (5); both links are missing (2 × 1.5).
        let s = cell_scores(&frames(&[&[1, 2], &[1, 2]], &[&[1, 2], &[1, 1]]), &[], &[]).unwrap();
        assert_eq!((s.splits, s.links_missed, s.links_wrong), (1, 2, 0));
        assert!((s.det() - (1.0 - 5.0 / 40.0)).abs() < 1e-15);
        assert!((s.tra() - (1.0 - 8.0 / 43.0)).abs() < 1e-15);
    }

    #[test]
    fn a_division_told_as_a_track_is_of_the_wrong_kind() {
        // Truth: 1 becomes 2 (parent link); result: one track throughout.
        let s = cell_scores(&frames(&[&[1], &[2]], &[&[7], &[7]]), &[(2, 1)], &[]).unwrap();
        assert_eq!((s.links_kind, s.links_missed, s.links_wrong), (1, 0, 0));
    }
}
