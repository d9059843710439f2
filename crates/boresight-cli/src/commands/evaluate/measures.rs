//! Judges every sequence and puts the sequences together.

use super::sequences::Sequence;
use super::state::{StateScores, state};
use super::{Args, Convention, cells};
use boresight::io::tracks::{Format, ReadOptions, TrackFile, read, sniff};
use boresight::metrics::cells::CellScores;
use boresight::metrics::clear_classic::{ClearClassic, clear_classic};
use boresight::metrics::detection::{DetectionScores, OperatingPoint, detection, operating_curve};
use boresight::metrics::doubts::doubts;
use boresight::metrics::ospa2::ospa2;
use boresight::metrics::particle::{ParticleScores, particle_scores};
use boresight::metrics::set::{Gospa, OspaAssignment, SetDistance, SetOptions};
use boresight::metrics::siap::{Siap, nearest_associations, siap};
use boresight::metrics::trajectory_gospa::{TrajectoryGospa, TrajectoryOptions, trajectory_gospa_by_windows};
use boresight::metrics::{MatchOptions, Rules, Scores, evaluate, preprocess};
use boresight::{Error, ErrorKind, PixelOrigin, Result, TrackTable};
use rayon::prelude::*;

/// Everything said of one sequence.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Row {
    pub name: String,
    pub scores: Scores,
    pub classic: Option<ClearClassic>,
    /// GOSPA of each frame.
    pub gospa: Vec<Gospa>,
    /// OSPA of each frame.
    pub ospa: Vec<f64>,
    pub ospa2: f64,
    pub trajectory_gospa: Option<TrajectoryGospa>,
    pub siap: Siap,
    pub particle: ParticleScores,
    pub detection: DetectionScores,
    pub curve: Vec<OperatingPoint>,
    pub average_precision: f64,
    pub state: Option<StateScores>,
    pub cells: Option<CellScores>,
    pub rate_hz: Option<f64>,
    pub size_px: Option<(f64, f64)>,
    #[serde(skip)]
    pub pieces: Vec<Scores>,
    #[serde(skip)]
    notes: Vec<String>,
}

/// A result, judged.
#[derive(Debug)]
pub struct Judged {
    pub label: String,
    pub rows: Vec<Row>,
    pub combined: Scores,
    pub notes: Vec<String>,
    pub mot_only: bool,
    pub convention_classic: bool,
}

fn open(args: &Args, path: &std::path::Path, truth: bool) -> Result<TrackFile> {
    let format = if truth { args.truth_format } else { args.result_format };
    let format = match format {
        Some(f) => f,
        None => sniff(path)?,
    };
    let options = ReadOptions {
        skip_bad_rows: args.skip_bad_rows,
        // Velocities and covariances are read where the table has them.
        keep_extra: matches!(format, Format::Named(_)) && !args.mot_only,
        frames_from_zero: if truth { args.truth_from_zero } else { args.result_from_zero },
    };
    let mut file = read(path, Some(format), options, args.tentative).map_err(|e| {
        let zero = e.to_string().contains("frame 0:");
        if zero {
            e.hint(if truth {
                "frames that count from 0: --truth-from-zero"
            } else {
                "frames that count from 0: --result-from-zero"
            })
        } else {
            e
        }
    })?;
    file.table.label = path.display().to_string();
    Ok(file)
}

/// Judges all sequences of a result, side by side.
/// # Errors
/// What reading and judging fail with.
pub fn judge_all(args: &Args, label: &str, sequences: &[Sequence]) -> Result<Judged> {
    let rows: Vec<Row> = sequences.par_iter().map(|s| judge(args, s)).collect::<Result<_>>()?;
    let mut notes = Vec::new();
    for row in &rows {
        notes.extend(row.notes.iter().map(|n| if rows.len() > 1 { format!("{}: {n}", row.name) } else { n.clone() }));
    }
    let scores: Vec<Scores> = rows.iter().map(|r| r.scores.clone()).collect();
    Ok(Judged {
        label: label.to_string(),
        combined: Scores::combined(&scores),
        rows,
        notes,
        mot_only: args.mot_only,
        convention_classic: args.convention == Convention::Motmetrics,
    })
}

fn judge(args: &Args, s: &Sequence) -> Result<Row> {
    let mut notes = Vec::new();
    let mut truth = open(args, &s.truth, true)?;
    let mut result = match &s.result {
        Some(path) => open(args, path, false)?,
        None => {
            notes.push("the result has no table for this sequence: it counts as empty".to_string());
            let table = TrackTable::from_rows(format!("no result for {}", s.name), truth.table.origin, [])?;
            TrackFile { table, format: Format::Mot, bad: Default::default() }
        }
    };
    for f in [&truth, &result] {
        if let Some(first) = &f.bad.first {
            notes.push(format!("{} malformed rows left out of {}; the first: {first}", f.bad.count, f.table.label));
        }
    }
    if let Some(n) = s.info.n_frames {
        for t in [&truth.table, &result.table] {
            if t.n_frames() > n {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("has rows in frame {}, seqinfo.ini says {n} frames", t.n_frames()),
                )
                .at(&t.label)
                .hint("is it of another sequence? frames count from 1 in MOTChallenge tables"));
            }
        }
        truth.table.extend_to(n);
    }
    if truth.table.origin != result.table.origin {
        truth.table.set_origin(PixelOrigin::Centre0);
        result.table.set_origin(PixelOrigin::Centre0);
    }
    let points = truth.table.is_points || result.table.is_points;
    let options = args.match_options(points);
    let rules = args.rules(&truth.table, truth.format);
    if rules == Rules::Kitti(boresight::metrics::KittiClass::Car) && args.rules == super::RulesArg::Auto {
        notes.push("cars are judged; --rules kitti-pedestrian judges pedestrians".to_string());
    }
    let (t, r) = preprocess(&truth.table, &result.table, rules)?;
    notes.extend(doubts(&t, &r, options.similarity, args.size.or(s.info.size_px))?);
    let scores = evaluate(&t, &r, &options)?;
    let mut row = Row { name: s.name.clone(), scores, ..Row::default() };
    if args.convention == Convention::Motmetrics {
        row.classic = Some(clear_classic(&t, &r, &options)?);
    }
    row.rate_hz = args.rate.or(s.info.rate_hz);
    row.size_px = args.size.or(s.info.size_px);
    if !args.compare.is_empty() {
        row.pieces = super::compare::pieces(&t, &r, &options)?;
    }
    if !args.mot_only {
        more(args, &t, &r, &options, &mut row, &mut notes)?;
        row.state = state(args, s, &t, &r, &options, row.rate_hz, &mut notes)?;
        if truth.format == Format::Ctc && result.format == Format::Ctc {
            row.cells = Some(cells::cells(&s.truth, s.result.as_deref().unwrap_or(&s.truth))?);
        }
    }
    row.notes = notes;
    Ok(row)
}

/// Centre of a row, px.
pub fn centre(t: &TrackTable, r: usize) -> [f64; 2] {
    let e = t.extent(r);
    [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0]
}

fn more(
    args: &Args,
    t: &TrackTable,
    r: &TrackTable,
    options: &MatchOptions,
    row: &mut Row,
    notes: &mut Vec<String>,
) -> Result<()> {
    let assignment = if args.stonesoup_ospa { OspaAssignment::FirstPower } else { OspaAssignment::OrderP };
    let set = SetOptions { cutoff_px: args.cutoff, order: args.order, assignment };
    set.validate("evaluate")?;
    let (mut distance, mut a, mut b) = (SetDistance::default(), Vec::new(), Vec::new());
    let n = t.n_frames().max(r.n_frames());
    for frame in 0..n {
        a.clear();
        a.extend(t.rows(frame).map(|k| centre(t, k)));
        b.clear();
        b.extend(r.rows(frame).map(|k| centre(r, k)));
        row.gospa.push(distance.gospa(&a, &b, &set));
        row.ospa.push(distance.ospa(&a, &b, &set));
    }
    // Windows side by side; the last may be shorter.
    let window = args.window.get();
    let windows: Vec<f64> = (0..n)
        .step_by(window)
        .map(|f| ospa2(t, r, f, f.saturating_add(window), &set, args.order))
        .collect::<Result<_>>()?;
    row.ospa2 = windows.iter().sum::<f64>() / windows.len().max(1) as f64;
    let trajectory = TrajectoryOptions {
        set,
        switch_px: args.switch_cost.unwrap_or(args.cutoff / 2.0),
        max_unknowns: args.max_unknowns,
    };
    row.trajectory_gospa = match trajectory_gospa_by_windows(t, r, window, &trajectory) {
        Ok(g) => Some(g),
        Err(e) if e.kind() == ErrorKind::Unsupported => {
            let e = e.to_string();
            notes.push(format!("TGOSPA is left out: {}; --max-unknowns allows more", e.lines().next().unwrap_or("")));
            None
        }
        Err(e) => return Err(e),
    };
    let associations = nearest_associations(t, r, args.cutoff, |b| [b[0] + b[2] / 2.0, b[1] + b[3] / 2.0]);
    let dt_s = 1.0 / row.rate_hz.unwrap_or(25.0);
    row.siap = siap(t, r, &associations, dt_s, |i, k| {
        let (p, q) = (centre(t, i), centre(r, k));
        ((p[0] - q[0]).hypot(p[1] - q[1]), 0.0)
    });
    if t.n_rows() > 0 {
        row.particle = particle_scores(t, r, args.distance)?;
    }
    row.detection = detection(t, r, options);
    (row.curve, row.average_precision) = operating_curve(t, r, options, 25)?;
    Ok(())
}
