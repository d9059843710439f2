//! DET and TRA of two Cell Tracking Challenge folders.

use boresight::Result;
use boresight::io::tracks::ctc;
use boresight::metrics::cells::{CellFrame, CellScores, cell_scores};

/// Scores the label images of a result against those of the truth.
/// # Errors
/// Folders or images that cannot be read; images of different sizes.
pub fn cells(truth: &std::path::Path, result: &std::path::Path) -> Result<CellScores> {
    let (t, r) = (ctc::CtcFolder::open(truth)?, ctc::CtcFolder::open(result)?);
    let mut frames = Vec::new();
    for frame in 0..t.n_frames().max(r.n_frames()) {
        let (a, b) = (t.labels(frame)?, r.labels(frame)?);
        let empty = vec![0; a.as_ref().or(b.as_ref()).map_or(0, |i| i.as_slice().len())];
        let pixels = |i: &Option<boresight::Image<u16>>| i.as_ref().map_or(empty.clone(), |i| i.as_slice().to_vec());
        frames.push(CellFrame::of(&pixels(&a), &pixels(&b)).map_err(|e| e.at(format!("frame {frame}")))?);
    }
    let parents = |f: &ctc::CtcFolder| {
        f.lineages.iter().filter(|l| l.parent != 0).map(|l| (l.label, l.parent)).collect::<Vec<_>>()
    };
    cell_scores(&frames, &parents(&t), &parents(&r))
}
