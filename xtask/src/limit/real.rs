//! Real clips of contrast below 3, tracked with no option but the detector, scored as the exam does.

use crate::exam::clips::clips;
use crate::exam::score::score_asked;
use anyhow::Result;
use boresight::auto::{DetectorKind, Request};
use std::fmt::Write as _;
use std::path::Path;

/// The clips, and the frame before which they are scored where not all of it is dim.
const CLIPS: [(&str, Option<u32>); 4] =
    [("IR_AIRPLANE_027", None), ("IR_DRONE_152", None), ("IR_HELICOPTER_049", None), ("IR_HELICOPTER_001", Some(66))];

pub fn table(data: &Path, sets: &[String], page: &mut String) -> Result<()> {
    writeln!(
        page,
        "| clip | detector | held % | false tracks a minute | ids | median error px | ms a frame |\n| --- | --- | --- | --- | --- | --- | --- |"
    )?;
    for detector in [None, Some(DetectorKind::Cfar), Some(DetectorKind::Integrate), Some(DetectorKind::Bernoulli)] {
        let (mut held, mut false_tracks, mut minutes, mut n) = (0.0, 0usize, 0.0, 0);
        let name = detector.map_or("as chosen", DetectorKind::name);
        for clip in clips(data)? {
            let Some((_, until)) = CLIPS.iter().find(|c| c.0 == clip.name) else { continue };
            let request = Request { detector, ..Request::default() };
            let s = score_asked(
                &clip,
                if detector == Some(DetectorKind::Integrate) { sets } else { &[] },
                &request,
                *until,
            )?;
            let n_false = s.false_tracks.as_ref().map_or(0, Vec::len);
            let minutes_of = if until.is_some() { 66.0 / 30.0 / 60.0 } else { s.minutes };
            writeln!(
                page,
                "| {} | {name} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} |",
                clip.name,
                100.0 * s.held,
                n_false as f64 / minutes_of,
                s.ids_a_target,
                s.error_px,
                s.ms_a_frame
            )?;
            held += s.held;
            false_tracks += n_false;
            minutes += minutes_of;
            n += 1;
        }
        if n > 0 {
            writeln!(
                page,
                "| all | {name} | {:.1} | {:.2} | | | |",
                100.0 * held / f64::from(n),
                false_tracks as f64 / minutes
            )?;
        }
    }
    Ok(())
}
