//! What an evaluation counts, how it matches, and the parameters of its measures.

use crate::metrics::multi_object::MatchOptions;
use crate::metrics::overlap::Similarity;
use crate::metrics::preprocess::Rules;
use crate::metrics::set::SetOptions;
use crate::metrics::trajectory_gospa::TrajectoryOptions;
use crate::{Error, ErrorKind, Result};

/// What makes a truth and a result match.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Matching {
    /// Intersection over union of the boxes. Tables of points are matched by their centres all the same.
    #[default]
    Overlap,
    /// Distance of the centres.
    Centre,
}

/// How CLEAR counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClearConvention {
    /// As TrackEval.
    #[default]
    TrackEval,
    /// As py-motmetrics and the MATLAB kit.
    MotMetrics,
}

/// Which measures are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MeasureSet {
    /// CLEAR, identity and HOTA only.
    Mot,
    /// All.
    #[default]
    All,
}

/// Model of a constant-velocity target for the posterior Cramér-Rao bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundModel {
    /// Variance of a measurement per axis, px², above 0.
    pub measurement_var_px2: f64,
    /// Density of the white acceleration, px²/s³, from 0 on.
    pub acceleration_density_px2_per_s3: f64,
    /// Probability of detection, in (0, 1].
    pub p_detection: f64,
}

/// What an evaluation counts and how.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct EvaluateOptions {
    /// Rows that are left out before counting.
    pub rules: Rules,
    /// What makes a truth and a result match.
    pub matching: Matching,
    /// Overlap from which a pair matches, in (0, 1].
    pub min_overlap: f64,
    /// Distance up to which centres match, and gate of the particle measures, px, above 0.
    pub max_distance_px: f64,
    /// How CLEAR counts.
    pub convention: ClearConvention,
    /// Which measures are computed.
    pub measures: MeasureSet,
    /// Cutoff and order of OSPA and GOSPA; the cutoff is the gate of SIAP's associations, too.
    pub set: SetOptions,
    /// Window of OSPA(2) and of trajectory GOSPA, frames, at least 1.
    pub window_frames: usize,
    /// Switch cost of trajectory GOSPA, px, above 0; half the cutoff if not given.
    pub switch_px: Option<f64>,
    /// Unknowns of a window up to which trajectory GOSPA is computed; with more it takes long.
    pub max_unknowns: usize,
    /// Standard deviation of the noise that the tracker added to the detections' own, px, for the NIS.
    pub extra_noise_px: f64,
    /// The part of it in proportion to the detection's box: box height × this, for the NIS.
    pub extra_noise_per_height: f64,
    /// Model whose posterior Cramér-Rao bound the position errors are held against.
    pub bound: Option<BoundModel>,
    /// Whether pieces of the sequence are judged as well, from which [`super::compare`] draws where there are few sequences.
    pub keep_pieces: bool,
}

impl Default for EvaluateOptions {
    fn default() -> Self {
        Self {
            rules: Rules::None,
            matching: Matching::Overlap,
            min_overlap: 0.5,
            max_distance_px: 5.0,
            convention: ClearConvention::TrackEval,
            measures: MeasureSet::All,
            set: SetOptions::default(),
            window_frames: 50,
            switch_px: None,
            max_unknowns: TrajectoryOptions::default().max_unknowns,
            extra_noise_px: 0.0,
            extra_noise_per_height: 0.0,
            bound: None,
            keep_pieces: false,
        }
    }
}

impl EvaluateOptions {
    /// Checks what no measure checks by itself.
    pub(super) fn validate(&self) -> Result<()> {
        if !(self.max_distance_px > 0.0 && self.max_distance_px.is_finite()) {
            let place = format!("max-distance-px = {}", self.max_distance_px);
            return Err(Error::new(ErrorKind::Config, "expected a distance above 0 px").at(place));
        }
        if self.window_frames == 0 {
            return Err(Error::new(ErrorKind::Config, "expected a window of at least 1 frame").at("window-frames = 0"));
        }
        Ok(())
    }

    /// How rows are matched; `points` if one of the tables has no boxes.
    pub(super) fn match_options(&self, points: bool) -> MatchOptions {
        if points || self.matching == Matching::Centre {
            // Similarity 1 − d / d₀ reaches one half at half of d₀.
            let similarity = Similarity::Centre { zero_distance_px: 2.0 * self.max_distance_px };
            return MatchOptions { similarity, threshold: 0.5 };
        }
        MatchOptions { similarity: Similarity::Iou, threshold: self.min_overlap }
    }

    pub(super) fn trajectory(&self) -> TrajectoryOptions {
        TrajectoryOptions {
            set: self.set,
            switch_px: self.switch_px.unwrap_or(self.set.cutoff_px / 2.0),
            max_unknowns: self.max_unknowns,
        }
    }
}
