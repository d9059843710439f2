//! What a reproduced table or figure is: the paper's value beside ours, the reading, a sentence; and how all are listed.

use super::score::Spread;
use super::study::Options;
use boresight::Result;
use serde::Serialize;

/// One number of a paper beside ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Case within the table (`Vn=1`, `fused`).
    pub case: String,
    /// Which number (`RMSPE`), with its unit where it is not one of the papers' four.
    pub measure: String,
    /// What the paper prints.
    pub paper: Option<f64>,
    /// Our mean, standard deviation, percentile of the paper's value.
    pub ours: Spread,
    /// The reference: an independent Monte Carlo (mean, standard deviation, runs) for the same reading and tuning.
    pub reference: Option<(f64, f64, usize)>,
    /// Runs lost and left out.
    pub lost: usize,
}

impl Row {
    /// Difference of our mean from the reference's in standard errors of that difference; none without a reference.
    pub fn standard_errors_off(&self) -> Option<f64> {
        let (mean, std, n) = self.reference?;
        let error = (std * std / n as f64 + self.ours.std * self.ours.std / self.ours.n.max(1) as f64).sqrt();
        let off = (self.ours.mean - mean).abs();
        // The reference is printed with four decimals.
        Some(if off <= 5e-5 { 0.0 } else { off / error.max(1e-12) })
    }
}

/// A table under one reading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Section {
    /// The item's name on the command line.
    pub item: &'static str,
    /// The paper's table.
    pub title: String,
    /// Reading and tuning used.
    pub reading: String,
    /// The numbers.
    pub rows: Vec<Row>,
    /// What it means.
    pub sentence: String,
}

/// A line of a figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// Points (x, y).
    pub points: Vec<[f64; 2]>,
    /// Drawn as marks instead of a line.
    pub marks: bool,
}

/// A figure of a paper drawn from our data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The item's name on the command line.
    pub item: &'static str,
    /// The paper's caption, in our words.
    pub caption: String,
    /// Name and unit of the axes.
    pub axes: [String; 2],
    /// The lines.
    pub lines: Vec<Line>,
    /// A grey picture instead of lines: width, height, levels.
    pub picture: Option<(usize, usize, Vec<u8>)>,
    /// What it shows, honestly.
    pub sentence: String,
}

/// What an item gives.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Output {
    /// Tables.
    pub sections: Vec<Section>,
    /// Figures.
    pub figures: Vec<Figure>,
}

/// A table or figure that can be reproduced.
pub struct Item {
    /// Name on the command line.
    pub name: &'static str,
    /// Where it stands in the papers.
    pub what: &'static str,
    /// Studies of `runs` runs that it makes, for the progress bar.
    pub studies: u64,
    /// Makes it.
    pub make: fn(&Options<'_>) -> Result<Output>,
}
