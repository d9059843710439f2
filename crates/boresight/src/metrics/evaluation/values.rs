//! The measures by name, with unit, direction and the way in which several sequences make one value.

use super::evaluate::Evaluation;
use super::pooled::{Part, Pooling};
use super::states::StateMeasures;
use crate::metrics::clear_classic::ClearClassic;
use crate::metrics::consistency::Consistency;
use crate::metrics::hota::mean;
use crate::metrics::multi_object::MotScores;
use crate::metrics::state::share_within;
use crate::metrics::value::Value;

/// The measures of CLEAR, identity and HOTA; `classic` takes the place of CLEAR where it is given.
pub fn mot_values(s: &MotScores, classic: Option<&ClearClassic>) -> Vec<Value> {
    let (h, c, i) = (&s.hota, &s.clear, &s.identity);
    // TrackEval counts no frames where one side is empty; a rate needs them all.
    let frames = (s.n_frames as f64).max(1.0);
    let mut values = vec![
        Value::higher("HOTA", mean(&h.hota())),
        Value::higher("DetA", mean(&h.det_a())),
        Value::higher("AssA", mean(&h.ass_a)),
        Value::higher("LocA", mean(&h.loc_a)),
        Value::higher("MOTA", c.mota()),
        Value::higher("MOTP", c.motp()),
        Value::higher("IDF1", i.idf1()),
        Value::higher("IDP", i.idp()),
        Value::higher("IDR", i.idr()),
        Value::higher("Recall", c.recall()),
        Value::higher("Precision", c.precision()),
        Value::lower("FP", c.fp as f64, ""),
        Value::lower("FN", c.fn_ as f64, ""),
        Value::lower("IDSW", c.idsw as f64, ""),
        Value::lower("Frag", c.frag as f64, ""),
        Value::higher("MT", c.mt as f64),
        Value::neither("PT", c.pt as f64, ""),
        Value::lower("ML", c.ml as f64, ""),
        Value::lower("FP/frame", c.fp as f64 / frames, ""),
        Value::lower("FN/frame", c.fn_ as f64 / frames, ""),
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
            if let Some(slot) = values.iter_mut().find(|v| v.name == name) {
                slot.value = value;
            }
        }
    }
    values
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_u64), |(s, n), v| (s + v, n + 1));
    sum / (n as f64).max(1.0)
}

impl Evaluation {
    /// All measures by name.
    pub fn values(&self) -> Vec<Value> {
        let mut values = self.mot_values();
        values.extend(self.optional_values());
        values
    }

    /// CLEAR, identity and HOTA by name.
    pub fn mot_values(&self) -> Vec<Value> {
        mot_values(&self.scores, self.classic.as_ref())
    }

    /// The other measures by name.
    pub fn optional_values(&self) -> Vec<Value> {
        self.parts().into_iter().map(|p| p.value).collect()
    }

    /// The other measures, each with its weight among sequences: frames, or matched rows.
    pub(super) fn parts(&self) -> Vec<Part> {
        let Some(f) = &self.optional else { return Vec::new() };
        let d = &f.detection;
        // What is not defined in a sequence weighs nothing among several.
        let by_frames = |v: Value| Part::mean(v, if v.value.is_nan() { 0.0 } else { f.gospa.len() as f64 });
        let by_rows = |v: Value| Part::mean(v, d.tp as f64);
        let mut values = vec![
            Value::lower("GOSPA", mean_of(f.gospa.iter().map(|g| g.distance)), "px"),
            Value::lower("GOSPA_location", mean_of(f.gospa.iter().map(|g| g.localisation)), "px^p"),
            Value::lower("GOSPA_missed", mean_of(f.gospa.iter().map(|g| g.missed)), "px^p"),
            Value::lower("GOSPA_false", mean_of(f.gospa.iter().map(|g| g.false_)), "px^p"),
            Value::lower("OSPA", mean_of(f.ospa.iter().copied()), "px"),
            Value::lower("OSPA2", f.ospa2, "px"),
        ];
        if let Some(g) = &f.trajectory_gospa {
            let n = f.gospa.len().max(1) as f64;
            values.extend([
                Value::lower("TGOSPA", g.per_frame, "px"),
                Value::lower("TGOSPA_switch", g.switch / n, "px^p"),
            ]);
        }
        values.extend([
            Value::higher("SIAP_C", f.siap.completeness),
            Value::neither("SIAP_A", f.siap.ambiguity, ""),
            Value::lower("SIAP_S", f.siap.spuriousness, ""),
            Value::lower("SIAP_PA", if f.siap.completeness > 0.0 { f.siap.position_accuracy } else { f64::NAN }, "px"),
            Value::lower("SIAP_R", f.siap.rate_of_track_number_change, "1/s"),
            Value::higher("SIAP_LS", f.siap.longest_track_segment),
            Value::higher("particle_alpha", f.particle.alpha),
            Value::higher("particle_beta", f.particle.beta),
            Value::higher("JSC", f.particle.jsc),
            Value::higher("JSC_tracks", f.particle.jsc_tracks),
        ]);
        let mut parts: Vec<Part> = values.into_iter().map(by_frames).collect();
        // Of nothing that matches there is no error, least of all the best one.
        let if_any = |n: u64, v: f64| if n > 0 { v } else { f64::NAN };
        let ([bias_x, bias_y], [scatter_x, scatter_y]) =
            (d.bias_px.map(|v| if_any(d.tp, v)), d.scatter_px.map(|v| if_any(d.tp, v)));
        let rmse = if_any(f.particle.n_matched, f.particle.rmse_px);
        let scatter = |name, value, mean| by_rows(Value::lower(name, value, "px")).pooled(Pooling::Spread { mean });
        parts.extend([
            Part::root_mean_square(Value::lower("RMSE", rmse, "px"), f.particle.n_matched as f64),
            by_frames(Value::higher("AP", f.average_precision)),
            by_rows(Value::neither("bias_x", bias_x, "px")),
            by_rows(Value::neither("bias_y", bias_y, "px")),
            scatter("scatter_x", scatter_x, bias_x),
            scatter("scatter_y", scatter_y, bias_y),
        ]);
        if let Some((w, h)) = self.size_px {
            parts.push(by_frames(Value::lower("FP/Mpx", d.fp_per_megapixel(w, h), "1/Mpx")));
        }
        if let Some(rate) = self.rate_hz {
            parts.push(by_frames(Value::lower("FP/hour", d.fp_per_hour(rate), "1/h")));
        }
        parts.extend(f.state.iter().flat_map(StateMeasures::parts));
        if let Some(c) = &f.cells {
            parts.extend([Value::higher("DET", c.det()), Value::higher("TRA", c.tra())].map(by_frames));
        }
        parts.iter_mut().for_each(|p| p.value.unit = self.unit.of_pixels(p.value.unit));
        parts
    }
}

impl StateMeasures {
    /// The measures by name.
    pub fn values(&self) -> Vec<Value> {
        self.parts().into_iter().map(|p| p.value).collect()
    }

    fn parts(&self) -> Vec<Part> {
        let (e, n) = (&self.errors, self.n_rows as f64);
        let rms = |name, value| Part::root_mean_square(Value::lower(name, value, "px"), n);
        let mut parts = vec![
            Part::root_mean_square(Value::lower("PFE_x", e.pfe_x, "%"), self.norm2[0]),
            Part::root_mean_square(Value::lower("PFE_y", e.pfe_y, "%"), self.norm2[1]),
            rms("RMSPE", e.rmspe),
            rms("RMSPE/2", e.rmspe_halved),
        ];
        if self.has_velocity {
            let rms = |name, value| Part::root_mean_square(Value::lower(name, value, "px/s"), n);
            parts.extend([rms("RMSVE", e.rmsve), rms("RMSVE/2", e.rmsve_halved)]);
        }
        if let Some(bound) = self.bound_px {
            // √(Σ n error² / Σ n bound²) is the root mean square of the ratios, weighted by n bound².
            let ratio = Value::lower("RMSPE/bound", e.rmspe / bound, "");
            parts.push(Part::root_mean_square(Value::neither("bound", bound, "px"), n));
            parts.push(Part::root_mean_square(ratio, n * bound * bound));
        }
        if !self.bounded.is_empty() {
            let (within, n) = (share_within(&self.bounded), self.bounded.len() as f64);
            let shares = [("x_in_2sigma", within[0]), ("y_in_2sigma", within[2])];
            parts.extend(shares.map(|(name, share)| Part::mean(Value::neither(name, share, ""), n)));
        }
        let tests: [([&str; 3], &Option<Consistency>); 3] = [
            (["ANEES", "ANEES_lower", "ANEES_upper"], &self.nees),
            (["ANEES4", "ANEES4_lower", "ANEES4_upper"], &self.nees4),
            (["ANIS", "ANIS_lower", "ANIS_upper"], &self.nis),
        ];
        for (names, test) in tests {
            let Some(c) = test else { continue };
            let dimension = c.expected as usize;
            let part = |name, v| Part::mean(Value::neither(name, v, ""), c.n as f64);
            parts.extend([
                part(names[0], c.average),
                part(names[1], c.lower).pooled(Pooling::LowerBound { dimension }),
                part(names[2], c.upper).pooled(Pooling::UpperBound { dimension }),
            ]);
        }
        if let Some((index, inclination)) = self.noncredibility {
            let n = self.nees.map_or(0.0, |c| c.n as f64);
            parts.push(Part::mean(Value::lower("NCI", index, "dB"), n));
            parts.push(Part::mean(Value::neither("inclination", inclination, "dB"), n));
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::state::BoundedError;

    #[test]
    fn shares_within_two_deviations_are_given_where_variances_are_stated() {
        let row = |x, y| BoundedError { error: [x, 0.0, y, 0.0], bound: [2.0, 1.0, 4.0, 1.0] };
        // x within 2: three of four; y within 4: one of four.
        let bounded = vec![row(1.0, 5.0), row(-1.9, -4.1), row(2.1, 3.9), row(0.0, 9.0)];
        let shares = |s: StateMeasures| -> Vec<(&str, f64)> {
            let is_share = |v: &Value| v.name.ends_with("2sigma");
            s.values().into_iter().filter(is_share).map(|v| (v.name, v.value)).collect()
        };
        let stated = StateMeasures { bounded, ..StateMeasures::default() };
        assert_eq!(shares(stated), [("x_in_2sigma", 0.75), ("y_in_2sigma", 0.25)]);
        assert!(shares(StateMeasures::default()).is_empty());
    }
}
