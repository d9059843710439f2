//! The scores as JSON.

use super::judged::Judged;
use boresight::io::LengthUnit;
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
        "units": e.values().into_iter().filter(|v| !v.unit.is_empty())
            .map(|v| (v.name.to_string(), v.unit.into())).collect::<serde_json::Map<_, _>>(),
        "combined": named(e.values()),
        "hota_curves": curves(&e.combined),
        "sequences": e.sequences.iter()
            .map(|s| json!({"name": s.name, "measures": named(s.values()), "detail": in_unit(json!(s), s.unit)}))
            .collect::<Vec<_>>(),
        "notes": judged.notes,
    })
}

/// The fields named for the unit they are in: `rmse_px` becomes `rmse_m` in metres.
fn in_unit(value: serde_json::Value, unit: LengthUnit) -> serde_json::Value {
    use serde_json::Value;
    match value {
        Value::Object(fields) if unit == LengthUnit::Metre => {
            let named = |k: String| if k.ends_with("_px") { format!("{}_m", &k[..k.len() - 3]) } else { k };
            Value::Object(fields.into_iter().map(|(k, v)| (named(k), in_unit(v, unit))).collect())
        }
        Value::Array(values) => Value::Array(values.into_iter().map(|v| in_unit(v, unit)).collect()),
        value => value,
    }
}

/// HOTA and its parts over the thresholds.
fn curves(s: &MotScores) -> serde_json::Value {
    let h = &s.hota;
    json!({
        "alpha": hota::alphas(), "HOTA": h.hota(), "DetA": h.det_a(), "AssA": h.ass_a, "LocA": h.loc_a,
        "DetRe": h.det_re(), "DetPr": h.det_pr(), "AssRe": h.ass_re, "AssPr": h.ass_pr,
    })
}
