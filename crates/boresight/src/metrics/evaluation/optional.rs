//! The measures beside CLEAR, identity and HOTA: set distances, SIAP, particle, detection, state and cell measures.

use super::note::Note;
use super::options::EvaluateOptions;
use super::sequence::Sequence;
use super::states::StateMeasures;
use crate::metrics::cells::CellScores;
use crate::metrics::detection::{DetectionScores, OperatingPoint, detection, operating_curve};
use crate::metrics::multi_object::MatchOptions;
use crate::metrics::near::centre;
use crate::metrics::ospa2::ospa2;
use crate::metrics::particle::{ParticleScores, particle_scores};
use crate::metrics::set::{Gospa, SetDistance};
use crate::metrics::siap::{Siap, nearest_associations, siap};
use crate::metrics::trajectory_gospa::{TrajectoryGospa, trajectory_gospa_by_windows};
use crate::{ErrorKind, Result, TrackTable};
use serde::Serialize;

/// Levels of the score at which the operating curve is computed.
const CURVE_POINTS: usize = 25;

/// Measures beside CLEAR, identity and HOTA.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct OptionalMeasures {
    /// GOSPA of each frame.
    pub gospa: Vec<Gospa>,
    /// OSPA of each frame, px.
    pub ospa: Vec<f64>,
    /// Mean OSPA(2) of windows side by side, px.
    pub ospa2: f64,
    /// Trajectory GOSPA; `None` where it would take too long.
    pub trajectory_gospa: Option<TrajectoryGospa>,
    /// SIAP.
    pub siap: Siap,
    /// The measures of the particle tracking challenge; zeros where the truth is empty.
    pub particle: ParticleScores,
    /// Recall, false alarms, bias and scatter of the detections.
    pub detection: DetectionScores,
    /// Recall and precision over the score.
    pub curve: Vec<OperatingPoint>,
    /// Area under the precision over the recall, 0..=1.
    pub average_precision: f64,
    /// State errors and consistency; `None` where nothing matches.
    pub state: Option<StateMeasures>,
    /// DET and TRA, where label images are given.
    pub cells: Option<CellScores>,
}

impl OptionalMeasures {
    pub(super) fn of(
        s: &Sequence<'_>,
        options: &EvaluateOptions,
        matching: &MatchOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Self> {
        let (t, r, set) = (s.truth, s.result, &options.set);
        set.validate("evaluate")?;
        let (gospa, ospa) = set_distances(t, r, options);
        let ospa2 = mean_ospa2(t, r, options)?;
        let trajectory_gospa = match trajectory_gospa_by_windows(t, r, options.window_frames, &options.trajectory()) {
            Ok(g) => Some(g),
            Err(e) if e.kind() == ErrorKind::Unsupported => {
                notes.push(Note::TrajectoryGospaLeftOut(e.to_string().lines().next().unwrap_or("").to_string()));
                None
            }
            Err(e) => return Err(e),
        };
        let associations = nearest_associations(t, r, set.cutoff_px, |b| [b[0] + b[2] / 2.0, b[1] + b[3] / 2.0]);
        let siap = siap(t, r, &associations, s.dt_s(), |i, k| {
            let (p, q) = (centre(t, i), centre(r, k));
            ((p[0] - q[0]).hypot(p[1] - q[1]), 0.0)
        });
        let particle =
            if t.n_rows() > 0 { particle_scores(t, r, options.max_distance_px)? } else { ParticleScores::default() };
        let (curve, average_precision) = operating_curve(t, r, matching, CURVE_POINTS)?;
        Ok(Self {
            gospa,
            ospa,
            ospa2,
            trajectory_gospa,
            siap,
            particle,
            detection: detection(t, r, matching),
            curve,
            average_precision,
            state: StateMeasures::of(s, options, matching, notes)?,
            cells: s.cells.map(|c| c.scores()).transpose()?,
        })
    }
}

/// GOSPA and OSPA of the centres of each frame.
fn set_distances(t: &TrackTable, r: &TrackTable, options: &EvaluateOptions) -> (Vec<Gospa>, Vec<f64>) {
    let (mut distance, mut a, mut b) = (SetDistance::default(), Vec::new(), Vec::new());
    (0..t.n_frames().max(r.n_frames()))
        .map(|frame| {
            a.clear();
            a.extend(t.rows(frame).map(|k| centre(t, k)));
            b.clear();
            b.extend(r.rows(frame).map(|k| centre(r, k)));
            (distance.gospa(&a, &b, &options.set), distance.ospa(&a, &b, &options.set))
        })
        .unzip()
}

/// Mean of OSPA(2) over windows side by side; the last may be shorter.
fn mean_ospa2(t: &TrackTable, r: &TrackTable, options: &EvaluateOptions) -> Result<f64> {
    let window = options.window_frames;
    let windows: Vec<f64> = (0..t.n_frames().max(r.n_frames()))
        .step_by(window)
        .map(|from| ospa2(t, r, from, from.saturating_add(window), &options.set, options.set.order))
        .collect::<Result<_>>()?;
    Ok(windows.iter().sum::<f64>() / windows.len().max(1) as f64)
}
