//! Scans from the rows of a table: one for each frame, empty frames included, each with its time.
//!
//! Times come from the table, with frames without rows placed evenly in between; if a row has none, or a rate is given,
//! they are made from the frame numbers.

use super::detection_row::Seen;
use super::options::TableOptions;
use crate::{Error, ErrorKind, FrameIndex, Result, Scan, Timestamp};

/// A sequence of frames with a hole larger than this is taken for a wrong number, not for a pause.
const MAX_GAP_FRAMES: u64 = 400_000;

/// All holes of a table together may have this many frames, 4.4 hours of 25 a second: empty scans take memory as well, [`MAX_EMPTY_BYTES`] at most.
const MAX_EMPTY_FRAMES: u64 = 400_000;

/// What the scans of all holes may take, bytes.
const MAX_EMPTY_BYTES: usize = 300_000_000;

const _: () = assert!(MAX_EMPTY_FRAMES as usize * size_of::<Scan>() <= MAX_EMPTY_BYTES);

/// The scans of a table, before they have their times.
pub(super) struct Grouped {
    pub scans: Vec<Scan>,
    /// The time of each frame, as far as its first row has one.
    pub times: Vec<Option<Timestamp>>,
    /// What is odd about the times of the rows.
    pub warning: Option<String>,
}

/// Groups rows, sorted by frame, into one scan a frame.
/// # Errors
/// [`ErrorKind::Damaged`] for holes that no pause explains.
pub(super) fn scans_of(label: &str, seen: Vec<Seen>) -> Result<Grouped> {
    let n_frames = n_frames(label, &seen)?;
    let mut scans: Vec<Scan> = Vec::with_capacity(n_frames);
    let mut times: Vec<Option<Timestamp>> = Vec::with_capacity(n_frames);
    let (mut n_odd, mut first_odd) = (0, None);
    for one in seen {
        match scans.last_mut() {
            Some(last) if last.index.0 == one.frame => {
                if let (Some(Some(first)), Some(time)) = (times.last(), one.time)
                    && *first != time
                {
                    n_odd += 1;
                    first_odd.get_or_insert((one.frame, first.as_secs_f64(), time.as_secs_f64()));
                }
                last.detections.push(one.detection);
            }
            last => {
                let next = last.map_or(one.frame, |l| l.index.0 + 1);
                scans.extend((next..one.frame).map(|f| Scan { index: FrameIndex(f), ..Scan::default() }));
                times.resize(scans.len(), None);
                scans.push(Scan { index: FrameIndex(one.frame), detections: vec![one.detection], ..Scan::default() });
                times.push(one.time);
            }
        }
    }
    let warning = first_odd.map(|(frame, first, other)| {
        format!(
            "{label}: {n_odd} rows state another time than the first row of their frame, which was taken (frame {frame}: {first} s and {other} s)."
        )
    });
    Ok(Grouped { scans, times, warning })
}

/// Number of frames from the first row to the last; holes that no pause explains are refused before anything is made of them.
fn n_frames(label: &str, seen: &[Seen]) -> Result<usize> {
    let mut n_empty = 0;
    let mut n_with_rows = usize::from(!seen.is_empty());
    for pair in seen.windows(2) {
        let [before, frame] = [pair[0].frame, pair[1].frame];
        let hole = frame.saturating_sub(before).saturating_sub(1);
        n_empty = hole.saturating_add(n_empty);
        n_with_rows += usize::from(frame != before);
        if hole > MAX_GAP_FRAMES || n_empty > MAX_EMPTY_FRAMES {
            let what = format!(
                "frame {frame} follows frame {before}: expected holes of at most {MAX_GAP_FRAMES} frames, {MAX_EMPTY_FRAMES} in all"
            );
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(label)
                .hint("is the frame column really the frame? a table of days is read in parts"));
        }
    }
    Ok(n_with_rows + n_empty as usize)
}

/// What [`set_times`] found.
pub(super) struct Rate {
    /// Rate, frames/s.
    pub rate_hz: f64,
    /// Whether the rate was assumed, since neither the table nor anything else tells.
    pub is_assumed: bool,
}

/// Gives every scan its time: from the table, with holes filled evenly, or from a rate; `rate_beside` (frames/s) is what a
/// file beside the table says.
/// # Errors
/// [`ErrorKind::Damaged`] for times that do not rise.
pub(super) fn set_times(
    scans: &mut [Scan],
    times: &[Option<Timestamp>],
    label: &str,
    options: &TableOptions,
    rate_beside: Option<f64>,
) -> Result<Rate> {
    // The frames that have rows, with their times; `None` if one of them has no time.
    let with_rows = scans.iter().zip(times).enumerate().filter(|(_, (scan, _))| !scan.detections.is_empty());
    let timed: Option<Vec<(usize, Timestamp)>> = with_rows.map(|(i, (_, time))| time.map(|t| (i, t))).collect();
    let Some(timed) = timed.filter(|t| options.rate_hz.is_none() && !t.is_empty()) else {
        let known = options.rate_hz.or(rate_beside);
        let rate_hz = known.unwrap_or(options.assumed_rate_hz);
        for scan in scans.iter_mut() {
            scan.time = Timestamp::from_secs_f64(scan.index.0 as f64 / rate_hz);
        }
        return Ok(Rate { rate_hz, is_assumed: known.is_none() && !scans.is_empty() });
    };
    for (i, time) in &timed {
        scans[*i].time = *time;
    }
    let mut periods_s: Vec<f64> = Vec::new();
    for pair in timed.windows(2) {
        let ((a, from), (b, to)) = (pair[0], pair[1]);
        if to <= from {
            let what = format!(
                "times must grow with the frames, but frame {} is at {} s and frame {} at {} s",
                scans[a].index.0,
                from.as_secs_f64(),
                scans[b].index.0,
                to.as_secs_f64()
            );
            return Err(Error::new(ErrorKind::Damaged, what)
                .at(label)
                .hint("--rate-hz makes times from the frames' numbers"));
        }
        let n = (b - a) as i128;
        let step_ns = i128::from(to.ns) - i128::from(from.ns);
        periods_s.push(step_ns as f64 / n as f64 * 1e-9);
        for k in 1..b - a {
            scans[a + k].time = Timestamp::from_ns((i128::from(from.ns) + step_ns * k as i128 / n) as i64);
        }
    }
    periods_s.sort_by(f64::total_cmp);
    let median_s = periods_s.get(periods_s.len() / 2);
    let rate_hz = median_s.map_or_else(|| rate_beside.unwrap_or(options.assumed_rate_hz), |p| 1.0 / p);
    Ok(Rate { rate_hz, is_assumed: false })
}
