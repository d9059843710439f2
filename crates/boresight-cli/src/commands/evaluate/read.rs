//! Reads the tables of a sequence and judges them.

use super::arguments::{Args, RulesArg};
use super::sequences;
use boresight::io::tracks::{Format, ReadOptions, TrackFile, ctc, read, sniff};
use boresight::io::{TableOptions, read_detections};
use boresight::metrics::cells::{CellFrame, CellSequence};
use boresight::metrics::evaluation::{Evaluation, Note, Sequence};
use boresight::metrics::{KittiClass, Rules, SanityWarning};
use boresight::{Error, ErrorKind, Result, Scan, TrackTable};
use std::path::Path;

fn open(args: &Args, path: &Path, truth: bool) -> Result<TrackFile> {
    let format = if truth { args.truth_format } else { args.result_format };
    let format = match format {
        Some(f) => f,
        None => sniff(path)?,
    };
    let options =
        ReadOptions { skip_bad_rows: args.skip_bad_rows, keep_extra: false, first_frame: first_frame(args, truth) };
    let mut file = read(path, Some(format), options, args.tentative).map_err(|e| {
        // A table that is sound once its frames count from 0 is one that does.
        let from_zero = ReadOptions { first_frame: Some(0), ..options };
        if options.first_frame.is_none() && read(path, Some(format), from_zero, args.tentative).is_ok() {
            let flag = if truth { "--truth-from-zero" } else { "--result-from-zero" };
            return e.hint(format!("frames that count from 0: {flag}"));
        }
        e
    })?;
    file.table.label = path.display().to_string();
    Ok(file)
}

/// What a table calls its first frame, where it is said.
fn first_frame(args: &Args, truth: bool) -> Option<u64> {
    let [zero, one] =
        if truth { [args.truth_from_zero, args.truth_from_one] } else { [args.result_from_zero, args.result_from_one] };
    if zero { Some(0) } else { one.then_some(1) }
}

/// The option that moves one of the tables as a shift by one frame asks for it; `later`: the result is a frame late.
fn mend_of_shift(args: &Args, truth: &TrackFile, result: &TrackFile, later: bool) -> Option<&'static str> {
    // Only MOTChallenge's count from 1.
    let from_one = |f: &TrackFile, truth| match first_frame(args, truth) {
        Some(first) => first == 1,
        None => matches!(f.format, Format::Mot | Format::MotTruth),
    };
    match (later, from_one(truth, true), from_one(result, false)) {
        // The result's numbers are one too high, or the truth's one too low.
        (true, _, false) => Some("--result-from-one"),
        (true, true, _) => Some("--truth-from-zero"),
        (false, false, _) => Some("--truth-from-one"),
        (false, _, true) => Some("--result-from-zero"),
        _ => None,
    }
}

/// Reads and judges a sequence; the notes come with it.
/// # Errors
/// What reading and judging fail with.
pub fn judge(args: &Args, s: &sequences::Sequence) -> Result<(Evaluation, Vec<String>)> {
    let mut notes = Vec::new();
    let mut truth = open(args, &s.truth, true)?;
    let result = match &s.result {
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
        refuse_rows_beyond(n, [&truth.table, &result.table])?;
        truth.table.extend_to(n);
    }
    let options = args.options(&truth.table, truth.format);
    if options.rules == Rules::Kitti(KittiClass::Car) && args.rules == RulesArg::Auto {
        notes.push("cars are judged; --rules kitti-pedestrian judges pedestrians".to_string());
    }
    let place = args.detections.as_ref().map(|p| p.replace("{seq}", &s.name)).filter(|_| !args.mot_only);
    let detections = place.as_ref().map(|p| scans(p)).transpose()?;
    let both_ctc = truth.format == Format::Ctc && result.format == Format::Ctc && !args.mot_only;
    let cells = both_ctc.then(|| cells(&s.truth, s.result.as_deref().unwrap_or(&s.truth))).transpose()?;
    let mut sequence = Sequence::new(&truth.table, &result.table);
    sequence.name = &s.name;
    sequence.rate_hz = args.rate.or(s.info.rate_hz);
    sequence.size_px = args.size.or(s.info.size_px);
    sequence.detections = detections.as_deref();
    sequence.cells = cells.as_ref();
    let evaluation = sequence.evaluate(&options)?;
    let place = place.as_deref().unwrap_or_default();
    notes.extend(evaluation.notes.iter().map(|note| match note {
        Note::Sanity(SanityWarning::ShiftedFrames { later, .. }) => {
            let mend = mend_of_shift(args, &truth, &result, *later);
            mend.map_or(note.to_string(), |option| format!("{note} try {option}"))
        }
        note => sentence(note, place),
    }));
    Ok((evaluation, notes))
}

/// A note as the command says it: with the option that helps, and the file.
fn sentence(note: &Note, detections: &str) -> String {
    match note {
        Note::TrajectoryGospaLeftOut(_) => format!("{note}; --max-unknowns allows more"),
        Note::NisRowsLeftOut(n) => format!(
            "NIS leaves out {n} rows: no such detection in {detections}, one seen before its frame's time, or a state no better known than its detection"
        ),
        note => note.to_string(),
    }
}

fn refuse_rows_beyond(n_frames: usize, tables: [&TrackTable; 2]) -> Result<()> {
    match tables.into_iter().find(|t| t.n_frames() > n_frames) {
        None => Ok(()),
        Some(t) => Err(Error::new(
            ErrorKind::Damaged,
            format!("has rows in frame {}, seqinfo.ini says {n_frames} frames", t.n_frames()),
        )
        .at(&t.label)
        .hint("is it of another sequence? frames count from 1 in MOTChallenge tables")),
    }
}

fn scans(path: &str) -> Result<Vec<Scan>> {
    Ok(read_detections(path, &TableOptions::default())?.scans)
}

/// The label images of two Cell Tracking Challenge folders.
fn cells(truth: &Path, result: &Path) -> Result<CellSequence> {
    let (t, r) = (ctc::CtcFolder::open(truth)?, ctc::CtcFolder::open(result)?);
    let mut out = CellSequence::default();
    for frame in 0..t.n_frames().max(r.n_frames()) {
        let (a, b) = (t.labels(frame)?, r.labels(frame)?);
        let both = CellFrame::of_images(a.as_ref(), b.as_ref()).map_err(|e| e.at(format!("frame {frame}")))?;
        out.frames.push(both);
    }
    let parents =
        |f: &ctc::CtcFolder| f.lineages.iter().filter(|l| l.parent != 0).map(|l| (l.label, l.parent)).collect();
    (out.truth_parents, out.result_parents) = (parents(&t), parents(&r));
    Ok(out)
}
