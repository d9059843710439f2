//! A recording's tracks reported from their first detection on.
//!
//! Source: docs/theory/track-management.md. Limits: a track that is confirmed later than the results are held back begins where they do.

use crate::Config;

/// How long results of a recording are held back, s: longer than a target takes that is seen faintly or stands at first, and short enough that its frames fit into
/// memory where they are small.
const RETROSPECTIVE_S: f64 = 10.0;
/// And for how many scans at least: as many as a radar's target of P_D 0.5 needs to be confirmed in clutter.
const RETROSPECTIVE_SCANS: f64 = 30.0;

/// Has the tracks of a recording of so many scans a second reported from their first detection on, since nobody waits for them, and says so; [`super::open_and_choose`]
/// does it for files, [`super::Choice::report_whole`] for frames that the caller has.
pub fn report_whole(rate_hz: f64, config: &mut Config, reasons: &mut Vec<String>) {
    let hold_s = RETROSPECTIVE_S.max((RETROSPECTIVE_SCANS / rate_hz.max(1e-9)).ceil());
    config.tracker.retrospective_s = hold_s;
    reasons.push(format!(
        "A confirmed track is reported from its first detection on, for {hold_s} s at most (from its confirmation on: --set tracker.retrospective-s=0)."
    ));
}
