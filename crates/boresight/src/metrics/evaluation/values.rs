//! The measures by name, with unit and direction.

use super::evaluate::Evaluation;
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
        let Some(f) = &self.optional else { return Vec::new() };
        let d = &f.detection;
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
            Value::lower("SIAP_PA", f.siap.position_accuracy, "px"),
            Value::lower("SIAP_R", f.siap.rate_of_track_number_change, "1/s"),
            Value::higher("SIAP_LS", f.siap.longest_track_segment),
            Value::higher("particle_alpha", f.particle.alpha),
            Value::higher("particle_beta", f.particle.beta),
            Value::higher("JSC", f.particle.jsc),
            Value::higher("JSC_tracks", f.particle.jsc_tracks),
            Value::lower("RMSE", f.particle.rmse_px, "px"),
            Value::higher("AP", f.average_precision),
            Value::neither("bias_x", d.bias_px[0], "px"),
            Value::neither("bias_y", d.bias_px[1], "px"),
            Value::lower("scatter_x", d.scatter_px[0], "px"),
            Value::lower("scatter_y", d.scatter_px[1], "px"),
        ]);
        if let Some((w, h)) = self.size_px {
            values.push(Value::lower("FP/Mpx", d.fp_per_megapixel(w, h), "1/Mpx"));
        }
        if let Some(rate) = self.rate_hz {
            values.push(Value::lower("FP/hour", d.fp_per_hour(rate), "1/h"));
        }
        if let Some(state) = &f.state {
            values.extend(state.values());
        }
        if let Some(c) = &f.cells {
            values.extend([Value::higher("DET", c.det()), Value::higher("TRA", c.tra())]);
        }
        values
    }
}

impl StateMeasures {
    /// The measures by name.
    pub fn values(&self) -> Vec<Value> {
        let e = &self.errors;
        let mut values = vec![
            Value::lower("PFE_x", e.pfe_x, "%"),
            Value::lower("PFE_y", e.pfe_y, "%"),
            Value::lower("RMSPE", e.rmspe, "px"),
            Value::lower("RMSPE/2", e.rmspe_halved, "px"),
        ];
        if self.has_velocity {
            values.extend([Value::lower("RMSVE", e.rmsve, "px/s"), Value::lower("RMSVE/2", e.rmsve_halved, "px/s")]);
        }
        if let Some(bound) = self.bound_px {
            values.extend([Value::neither("bound", bound, "px"), Value::lower("RMSPE/bound", e.rmspe / bound, "")]);
        }
        if !self.bounded.is_empty() {
            let within = share_within(&self.bounded);
            values.extend([Value::neither("x_in_2sigma", within[0], ""), Value::neither("y_in_2sigma", within[2], "")]);
        }
        let tests: [([&str; 3], &Option<Consistency>); 3] = [
            (["ANEES", "ANEES_lower", "ANEES_upper"], &self.nees),
            (["ANEES4", "ANEES4_lower", "ANEES4_upper"], &self.nees4),
            (["ANIS", "ANIS_lower", "ANIS_upper"], &self.nis),
        ];
        for (names, test) in tests {
            if let Some(c) = test {
                let numbers = [c.average, c.lower, c.upper];
                values.extend(names.into_iter().zip(numbers).map(|(name, v)| Value::neither(name, v, "")));
            }
        }
        if let Some((index, inclination)) = self.noncredibility {
            values.extend([Value::lower("NCI", index, "dB"), Value::neither("inclination", inclination, "dB")]);
        }
        values
    }
}
