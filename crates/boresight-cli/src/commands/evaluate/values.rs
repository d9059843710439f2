//! The scores by name, of a sequence and of all together, and as JSON.

use super::measures::{Judged, Row};
use boresight::metrics::Scores;
use boresight::metrics::clear_classic::ClearClassic;
use boresight::metrics::hota::mean;

/// Whether a smaller value of this measure is better.
pub fn lower_is_better(key: &str) -> bool {
    const LOWER: [&str; 28] = [
        "FP",
        "FN",
        "IDSW",
        "Frag",
        "ML",
        "FP/frame",
        "FN/frame",
        "GOSPA",
        "OSPA",
        "OSPA2",
        "missed",
        "false",
        "location",
        "TGOSPA",
        "switch",
        "SIAP_S",
        "SIAP_PA",
        "SIAP_VA",
        "SIAP_R",
        "RMSE",
        "PFE_x",
        "PFE_y",
        "RMSPE",
        "RMSVE",
        "RMSPE/bound",
        "MSE",
        "MAE",
        "PFE",
    ];
    LOWER.contains(&key) || key.starts_with("FP/")
}

/// The measures of CLEAR, identity and HOTA by name.
pub fn mot_values(s: &Scores, classic: Option<&ClearClassic>) -> Vec<(&'static str, f64)> {
    let (h, c, i) = (&s.hota, &s.clear, &s.identity);
    // TrackEval counts no frames where one side is empty; a rate needs them all.
    let frames = (s.n_frames as f64).max(1.0);
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
        ("FP/frame", c.fp as f64 / frames),
        ("FN/frame", c.fn_ as f64 / frames),
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
        ];
        if let Some(g) = &self.trajectory_gospa {
            let n = self.gospa.len().max(1) as f64;
            v.extend([("TGOSPA", g.per_frame), ("switch", g.switch / n)]);
        }
        v.extend([
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
        ]);
        if let Some((w, h)) = self.size_px {
            v.push(("FP/Mpx", d.fp_per_megapixel(w, h)));
        }
        if let Some(rate) = self.rate_hz {
            v.push(("FP/hour", d.fp_per_hour(rate)));
        }
        if let Some(state) = &self.state {
            v.extend(state.values());
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
