//! Judges every sequence and puts the sequences together.

use super::sequences::Sequence;
use super::{Args, Convention};
use boresight::io::tracks::{Format, ReadOptions, TrackFile, ctc, read, sniff};
use boresight::metrics::cells::{CellFrame, CellScores, cell_scores};
use boresight::metrics::clear_classic::{ClearClassic, clear_classic};
use boresight::metrics::consistency::{Consistency, average, normalised_square};
use boresight::metrics::detection::{DetectionScores, OperatingPoint, detection, match_rows, operating_curve};
use boresight::metrics::doubts::doubts;
use boresight::metrics::hota::mean;
use boresight::metrics::ospa2::ospa2;
use boresight::metrics::particle::{ParticleScores, particle_scores};
use boresight::metrics::set::{Gospa, OspaAssignment, SetDistance, SetOptions};
use boresight::metrics::siap::{Siap, nearest_associations, siap};
use boresight::metrics::{Scores, evaluate, preprocess};
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
    pub siap: Siap,
    pub particle: ParticleScores,
    pub detection: DetectionScores,
    pub curve: Vec<OperatingPoint>,
    pub average_precision: f64,
    pub nees: Option<Consistency>,
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

/// Whether a smaller value of this measure is better.
pub fn lower_is_better(key: &str) -> bool {
    const LOWER: [&str; 17] = [
        "FP", "FN", "IDSW", "Frag", "ML", "FP/frame", "FN/frame", "GOSPA", "OSPA", "OSPA2", "missed", "false",
        "location", "SIAP_S", "SIAP_PA", "SIAP_R", "RMSE",
    ];
    LOWER.contains(&key) || key.starts_with("FP/")
}

fn open(args: &Args, path: &std::path::Path, truth: bool) -> Result<TrackFile> {
    let format = if truth { args.truth_format } else { args.result_format };
    let format = match format {
        Some(f) => f,
        None => sniff(path)?,
    };
    let options = ReadOptions {
        skip_bad_rows: args.skip_bad_rows,
        // Covariances are read where the table is boresight's own.
        keep_extra: !truth && matches!(format, Format::Named(_)) && !args.mot_only,
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
    let (t, r) = preprocess(&truth.table, &result.table, rules)?;
    notes.extend(doubts(&t, &r, options.similarity)?);
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
        more(args, &t, &r, &options, &mut row)?;
        if truth.format == Format::Ctc && result.format == Format::Ctc {
            row.cells = Some(cells(&s.truth, s.result.as_deref().unwrap_or(&s.truth))?);
        }
    }
    row.notes = notes;
    Ok(row)
}

fn centre(t: &TrackTable, r: usize) -> [f64; 2] {
    let e = t.extent(r);
    [e.left_px + e.width_px / 2.0, e.top_px + e.height_px / 2.0]
}

fn more(
    args: &Args,
    t: &TrackTable,
    r: &TrackTable,
    options: &boresight::metrics::MatchOptions,
    row: &mut Row,
) -> Result<()> {
    let assignment = if args.stonesoup_ospa { OspaAssignment::FirstPower } else { OspaAssignment::OrderP };
    let set = SetOptions { cutoff_px: args.cutoff, order: args.order, assignment };
    set.validate("--")?;
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
    let window = args.window.max(1);
    let windows: Vec<f64> =
        (0..n).step_by(window).map(|f| ospa2(t, r, f, f + window, &set, args.order)).collect::<Result<_>>()?;
    row.ospa2 = windows.iter().sum::<f64>() / windows.len().max(1) as f64;
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
    row.nees = nees(t, r, options)?;
    Ok(())
}

/// NEES of the positions where the result states their covariance.
fn nees(t: &TrackTable, r: &TrackTable, options: &boresight::metrics::MatchOptions) -> Result<Option<Consistency>> {
    let column = |name: &str| r.extra.iter().find(|e| e.0 == name).map(|e| &e.1);
    let (Some(xx), Some(xy), Some(yy)) = (column("var_x_px2"), column("cov_x_y_px2"), column("var_y_px2")) else {
        return Ok(None);
    };
    let mut values = Vec::new();
    match_rows(t, r, options, |i, k| {
        if let (Ok(a), Ok(b), Ok(c)) = (xx[k].parse::<f64>(), xy[k].parse::<f64>(), yy[k].parse::<f64>()) {
            let (p, q) = (centre(t, i), centre(r, k));
            let error = [p[0] - q[0], p[1] - q[1]].into();
            if let Ok(v) = normalised_square(&error, &[[a, b], [b, c]].into()) {
                values.push(v);
            }
        }
    });
    if values.is_empty() { Ok(None) } else { average(&values, 2, 0.95).map(Some) }
}

fn cells(truth: &std::path::Path, result: &std::path::Path) -> Result<CellScores> {
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

/// The measures of CLEAR, identity and HOTA by name.
pub fn mot_values(s: &Scores, classic: Option<&ClearClassic>) -> Vec<(&'static str, f64)> {
    let (h, c, i) = (&s.hota, &s.clear, &s.identity);
    let mut v = vec![
        ("HOTA", mean(&h.hota())),
        ("DetA", mean(&h.det_a())),
        ("AssA", mean(&h.ass_a)),
        ("LocA", mean(&h.loc_a)),
        ("MOTA", c.mota()),
        ("MOTP", c.motp()),
        ("IDF1", i.idf1()),
        ("IDP", i.idp()),
        ("IDR", i.idr()),
        ("Recall", c.recall()),
        ("Precision", c.precision()),
        ("FP", c.fp as f64),
        ("FN", c.fn_ as f64),
        ("IDSW", c.idsw as f64),
        ("Frag", c.frag as f64),
        ("MT", c.mt as f64),
        ("PT", c.pt as f64),
        ("ML", c.ml as f64),
        ("FP/frame", c.fp_per_frame()),
        ("FN/frame", c.fn_per_frame()),
    ];
    if let Some(k) = classic {
        let of_classic = [
            ("MOTA", k.mota()),
            ("MOTP", k.motp()),
            ("FP", k.false_positives as f64),
            ("FN", k.misses as f64),
            ("IDSW", k.switches as f64),
            ("Frag", k.fragmentations as f64),
            ("MT", k.mostly_tracked as f64),
            ("PT", k.partially_tracked as f64),
            ("ML", k.mostly_lost as f64),
        ];
        for (name, value) in of_classic {
            if let Some(slot) = v.iter_mut().find(|s| s.0 == name) {
                slot.1 = value;
            }
        }
    }
    v
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
    sum / (n as f64).max(1.0)
}

impl Row {
    /// The other measures by name.
    pub fn more_values(&self) -> Vec<(&'static str, f64)> {
        let d = &self.detection;
        let mut v = vec![
            ("GOSPA", mean_of(self.gospa.iter().map(|g| g.distance))),
            ("location", mean_of(self.gospa.iter().map(|g| g.localisation))),
            ("missed", mean_of(self.gospa.iter().map(|g| g.missed))),
            ("false", mean_of(self.gospa.iter().map(|g| g.false_))),
            ("OSPA", mean_of(self.ospa.iter().copied())),
            ("OSPA2", self.ospa2),
            ("SIAP_C", self.siap.completeness),
            ("SIAP_A", self.siap.ambiguity),
            ("SIAP_S", self.siap.spuriousness),
            ("SIAP_PA", self.siap.position_accuracy),
            ("SIAP_R", self.siap.rate_of_track_number_change),
            ("SIAP_LS", self.siap.longest_track_segment),
            ("alpha", self.particle.alpha),
            ("beta", self.particle.beta),
            ("JSC", self.particle.jsc),
            ("JSC_tracks", self.particle.jsc_tracks),
            ("RMSE", self.particle.rmse_px),
            ("AP", self.average_precision),
            ("bias_x", d.bias_px[0]),
            ("bias_y", d.bias_px[1]),
            ("scatter_x", d.scatter_px[0]),
            ("scatter_y", d.scatter_px[1]),
        ];
        if let Some((w, h)) = self.size_px {
            v.push(("FP/Mpx", d.fp_per_megapixel(w, h)));
        }
        if let Some(rate) = self.rate_hz {
            v.push(("FP/hour", d.fp_per_hour(rate)));
        }
        if let Some(n) = &self.nees {
            v.extend([("ANEES", n.average), ("ANEES_lower", n.lower), ("ANEES_upper", n.upper)]);
        }
        if let Some(c) = &self.cells {
            v.extend([("DET", c.det()), ("TRA", c.tra())]);
        }
        v
    }
}

impl Judged {
    /// The combined measures by name: CLEAR, identity and HOTA as TrackEval combines them; the rest as the mean of the
    /// sequences, weighted by their frames.
    pub fn combined_values(&self) -> Vec<(&'static str, f64)> {
        let classics: Vec<ClearClassic> = self.rows.iter().filter_map(|r| r.classic).collect();
        let classic = self.convention_classic.then(|| ClearClassic::combined(&classics));
        let mut v = mot_values(&self.combined, classic.as_ref());
        if !self.mot_only {
            v.extend(self.combined_more());
        }
        v
    }

    /// The other measures, combined.
    pub fn combined_more(&self) -> Vec<(&'static str, f64)> {
        let mut out: Vec<(&'static str, f64, f64)> = Vec::new();
        for row in &self.rows {
            let weight = row.gospa.len() as f64;
            for (k, x) in row.more_values() {
                match out.iter_mut().find(|o| o.0 == k) {
                    Some(o) => {
                        o.1 += x * weight;
                        o.2 += weight;
                    }
                    None => out.push((k, x * weight, weight)),
                }
            }
        }
        out.into_iter().map(|(k, sum, w)| (k, sum / w.max(1.0))).collect()
    }

    /// All as JSON.
    pub fn to_json(&self) -> serde_json::Value {
        let named = |v: Vec<(&str, f64)>| {
            v.into_iter().map(|(k, x)| (k.to_string(), x.into())).collect::<serde_json::Map<_, _>>()
        };
        serde_json::json!({
            "result": self.label,
            "combined": named(self.combined_values()),
            "hota_curves": curves(&self.combined),
            "sequences": self.rows.iter().map(|r| {
                let mut v = mot_values(&r.scores, r.classic.as_ref());
                if !self.mot_only {
                    v.extend(r.more_values());
                }
                serde_json::json!({"name": r.name, "measures": named(v), "detail": r})
            }).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }
}

/// HOTA and its parts over the thresholds.
pub fn curves(s: &Scores) -> serde_json::Value {
    let h = &s.hota;
    serde_json::json!({
        "alpha": boresight::metrics::hota::alphas(), "HOTA": h.hota(), "DetA": h.det_a(), "AssA": h.ass_a, "LocA": h.loc_a,
        "DetRe": h.det_re(), "DetPr": h.det_pr(), "AssRe": h.ass_re, "AssPr": h.ass_pr,
    })
}
