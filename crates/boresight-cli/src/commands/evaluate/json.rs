//! The scores as JSON.

use super::judged::Judged;
use boresight::metrics::evaluation::Value;
use boresight::metrics::{MotScores, hota};
use serde_json::json;

/// A result: combined, by sequence, with curves.
pub fn result(judged: &Judged) -> serde_json::Value {
    let named =
        |v: Vec<Value>| v.into_iter().map(|v| (v.name.to_string(), v.value.into())).collect::<serde_json::Map<_, _>>();
    let e = &judged.evaluation;
    json!({
        "result": e.label,
        "combined": named(e.values()),
        "hota_curves": curves(&e.combined),
        "sequences": e.sequences.iter()
            .map(|s| json!({"name": s.name, "measures": named(s.values()), "detail": s}))
            .collect::<Vec<_>>(),
        "notes": judged.notes,
    })
}

/// HOTA and its parts over the thresholds.
fn curves(s: &MotScores) -> serde_json::Value {
    let h = &s.hota;
    json!({
        "alpha": hota::alphas(), "HOTA": h.hota(), "DetA": h.det_a(), "AssA": h.ass_a, "LocA": h.loc_a,
        "DetRe": h.det_re(), "DetPr": h.det_pr(), "AssRe": h.ass_re, "AssPr": h.ass_pr,
    })
}
