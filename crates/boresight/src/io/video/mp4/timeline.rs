//! From composition times and edit lists to what is decoded, what is shown, and when.
//!
//! Source: ISO/IEC 14496-12, 8.6.6. An edit shows the media from `media_time` for `duration`; an empty edit (-1) is a
//! pause. Pictures before `media_time` are decoded (others need them) and not shown.
//! Departures, both as ffmpeg does (`mov_fix_index`), so that frames and times agree with it: the first picture of the
//! first edit is shown at the edit's start even if the edit begins inside the picture before; in fragmented files the
//! edit list only shifts time.

use super::boxes::Cursor;
use super::sample::{Sample, damaged};
use crate::Result;

/// One row of an edit list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edit {
    /// Movie ticks; 0 = to the end.
    pub duration: u64,
    /// Media ticks; -1 = empty edit.
    pub media_time: i64,
}

/// One picture to decode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    /// Which sample.
    pub sample: u32,
    /// Presentation time, media ticks.
    pub pts: i64,
    /// Whether it is shown or only decoded.
    pub shown: bool,
}

/// Reads `elst`.
pub(super) fn read_edits(mut elst: Cursor<'_>) -> Option<Vec<Edit>> {
    let version = elst.version_flags()?.0;
    let count = elst.u32()?;
    let _ = elst.rows(count, if version == 1 { 20 } else { 12 })?;
    let mut edits = Vec::new();
    for _ in 0..count {
        let (duration, media_time) =
            if version == 1 { (elst.u64()?, elst.i64()?) } else { (u64::from(elst.u32()?), i64::from(elst.i32()?)) };
        elst.skip(4)?; // rate
        edits.push(Edit { duration, media_time });
    }
    Some(edits)
}

/// `v * to / from`, rounded to nearest, as ffmpeg rescales times.
fn rescale(v: u64, to: u32, from: u32) -> i64 {
    let from = u128::from(from.max(1));
    let ticks = (u128::from(v) * u128::from(to) + from / 2) / from;
    i64::try_from(ticks).unwrap_or(i64::MAX)
}

/// Lists the pictures in decoding order with their times on the presentation's clock.
/// # Errors
/// When an edit list repeats the media so often that the list would not fit in memory.
pub(super) fn steps(
    samples: &[Sample],
    edits: &[Edit],
    timescale: u32,
    movie_timescale: u32,
    fragmented: bool,
) -> Result<Vec<Step>> {
    let plain = |shift: i64| {
        let step = |(i, s): (usize, &Sample)| Step { sample: i as u32, pts: s.cts.saturating_sub(shift), shown: true };
        Ok(samples.iter().enumerate().map(step).collect())
    };
    let movie_timescale = if movie_timescale == 0 { timescale } else { movie_timescale };
    let scaled = |duration: u64| rescale(duration, timescale, movie_timescale);
    if !edits.iter().any(|e| e.media_time >= 0) {
        return plain(0);
    }
    if fragmented {
        let pause = edits.first().filter(|e| e.media_time < 0).map_or(0, |e| scaled(e.duration));
        let start = edits.iter().find(|e| e.media_time >= 0).map_or(0, |e| e.media_time);
        return plain(start.saturating_sub(pause));
    }
    let mut out: Vec<Step> = Vec::with_capacity(samples.len());
    let mut at = 0i64; // presentation time of the edit's start
    let mut late = None; // by how much the first picture of the first edit lies behind its start
    for edit in edits {
        let length = scaled(edit.duration);
        if edit.media_time < 0 {
            at = at.saturating_add(length);
            continue;
        }
        let end = if length == 0 { i64::MAX } else { edit.media_time.saturating_add(length) };
        let from = out.len();
        push_edit(samples, edit.media_time, end, at, &mut out);
        if out.len() > samples.len() * 4 + 1024 {
            return Err(damaged(format!("its edit list ({} rows) repeats the video again and again", edits.len())));
        }
        let first = out.get(from..).and_then(|new| new.iter().filter(|s| s.shown).map(|s| s.pts).min());
        if let (None, Some(first)) = (late, first) {
            late = Some(first.saturating_sub(at));
        }
        at = at.saturating_add(length);
    }
    let late = late.unwrap_or(0);
    out.iter_mut().for_each(|s| s.pts = s.pts.saturating_sub(late));
    if !out.iter().any(|s| s.shown) {
        return Err(damaged("its edit list shows none of its frames"));
    }
    Ok(out)
}

/// Says how many pictures behind the first shown one are never shown: an edit list that cuts them off, or times that are damaged.
/// Those before it are how every decoder starts, and a list of several edits repeats and skips as it likes.
pub(super) fn hidden(steps: &[Step], edits: &[Edit]) -> Option<String> {
    if edits.iter().filter(|e| e.media_time >= 0).count() > 1 {
        return None;
    }
    let first = steps.iter().filter(|s| s.shown).map(|s| s.pts).min()?;
    let n = steps.iter().filter(|s| !s.shown && s.pts > first).count();
    (n > 0).then(|| {
        format!("{n} of {} frames lie outside of what the file's edit list shows and are left out", steps.len())
    })
}

/// Appends the pictures of one edit: from the sync sample before its start to a sync sample after its end.
fn push_edit(samples: &[Sample], start: i64, end: i64, at: i64, out: &mut Vec<Step>) {
    // Media time is composition time; the sync sample is looked for by it.
    let first = samples.iter().rposition(|s| s.sync && s.cts <= start).unwrap_or(0);
    // In an open group of pictures, those coded after a sync sample may be shown before it: then one more is waited for.
    let mut syncs_to_pass = if samples.iter().any(|s| s.cts != s.dts) { 2 } else { 1 };
    for (i, s) in samples.iter().enumerate().skip(first) {
        let shown = s.cts >= start && s.cts < end;
        out.push(Step { sample: i as u32, pts: s.cts.saturating_sub(start).saturating_add(at), shown });
        if s.sync && s.cts.saturating_add(i64::from(s.duration)) >= end {
            syncs_to_pass -= 1;
            if syncs_to_pass == 0 {
                break;
            }
        }
    }
    // Pictures after the last shown one need not be decoded.
    while out.last().is_some_and(|s| !s.shown) && out.len() > 1 {
        out.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight pictures, 10 ticks apart, a sync sample every four.
    fn media() -> Vec<Sample> {
        (0..8i64)
            .map(|i| Sample {
                offset: 0,
                size: 1,
                cts: i * 10,
                dts: i * 10,
                duration: 10,
                sync: i % 4 == 0,
                description: 0,
            })
            .collect()
    }

    fn shown(steps: &[Step]) -> Vec<(u32, i64)> {
        steps.iter().filter(|s| s.shown).map(|s| (s.sample, s.pts)).collect()
    }

    #[test]
    fn an_empty_edit_delays_and_a_media_time_cuts_the_front_off() {
        let edits = [Edit { duration: 500, media_time: -1 }, Edit { duration: 30, media_time: 50 }];
        let steps = steps(&media(), &edits, 100, 1000, false).unwrap();
        assert_eq!(shown(&steps), [(5, 50)]); // 30 ms of the movie are 3 ticks of the media
        assert_eq!(steps[0].sample, 4, "decoding starts at the sync sample before");
    }

    #[test]
    fn two_edits_may_show_the_same_pictures_twice() {
        let edits = [Edit { duration: 20, media_time: 0 }, Edit { duration: 20, media_time: 0 }];
        let steps = steps(&media(), &edits, 100, 100, false).unwrap();
        assert_eq!(shown(&steps), [(0, 0), (1, 10), (0, 20), (1, 30)]);
    }

    #[test]
    fn a_list_that_would_fill_memory_is_refused() {
        let edits = vec![Edit { duration: 0, media_time: 0 }; 100_000];
        let err = steps(&media(), &edits, 100, 100, false).unwrap_err();
        assert!(err.to_string().contains("again and again"), "{err}");
    }

    #[test]
    fn fragmented_files_are_only_shifted() {
        let edits = [Edit { duration: 0, media_time: 20 }];
        let steps = steps(&media(), &edits, 100, 100, true).unwrap();
        assert_eq!(shown(&steps)[0], (0, -20));
    }
}
