//! Whole filters by name: each a form, a model, an innovation, and a sentence that says when to take it.
//!
//! `filter = "ud"` in a configuration, `--filter ud` and `boresight config --list filters` read this table.

use super::config::FilterConfig;
use super::form::FormConfig;
use super::innovation::{HuberConfig, InnovationConfig, StudentTConfig};
use super::model::{ModelConfig, NearlyConstantTurnConfig, SingerConfig, WhiteNoiseConfig};
use super::own_model::{Ar1Config, DisplacementConfig, ImmConfig, LmsConfig};
use schemars::{Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// A filter with a name.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// What it is, its source, when to take it.
    pub meaning: &'static str,
    filter: fn() -> FilterConfig,
}

impl Preset {
    /// The filter that the name stands for.
    pub fn filter(&self) -> FilterConfig {
        (self.filter)()
    }
}

/// Every filter that has a name, in the order of the documentation.
pub const PRESETS: [Preset; 17] = [
    Preset {
        name: "kf",
        meaning: "Kalman filter in covariance form, Joseph update (Kalman 1960): the default. Exact for linear models in f64 and \
                  the fastest: without options it is kept in place in the track.",
        filter: FilterConfig::default,
    },
    Preset {
        name: "kf-short",
        meaning: "Kalman filter with the short update P - K H P: to compare with. Saves little and loses digits first.",
        filter: || form(FormConfig::KfShort),
    },
    Preset {
        name: "ud",
        meaning: "U-D factors P = U D Uᵀ (Bierman 1977, Thornton 1976): the covariance cannot lose its sign. For tiny \
                  measurement noise beside a large first uncertainty, and as the papers' CTUDF.",
        filter: || form(FormConfig::Ud),
    },
    Preset {
        name: "srif",
        meaning: "Square-root information filter by Householder reflections (Bierman 1977): best conditioned, works without \
                  process noise; as the papers' CTSRIF.",
        filter: || form(FormConfig::Srif),
    },
    Preset {
        name: "fuzzy-srif",
        meaning: "Square-root information filter with the fuzzy-logic correlator (CTFSRIF; Parimala, Raol): the papers' filter for \
                  heavy-tailed centroids; memberships and rules stand in `innovation.fuzzy`.",
        filter: || FilterConfig { innovation: InnovationConfig::Fuzzy(Box::default()), ..form(FormConfig::Srif) },
    },
    Preset {
        name: "information",
        meaning: "Information filter P⁻¹, P⁻¹x (Maybeck 1979): measurements add up cheaply; for many sensors, few readings.",
        filter: || form(FormConfig::Information),
    },
    Preset {
        name: "square-root",
        meaning: "Square-root covariance filter (Potter 1963, in Bierman 1977): as robust as U-D, two roots more a step.",
        filter: || form(FormConfig::SquareRoot),
    },
    Preset {
        name: "ekf",
        meaning: "Extended Kalman filter (Jazwinski 1970): `kf` with a nonlinear model, the nearly constant turn, by its \
                  Jacobian. For targets that turn for seconds at moderate rates.",
        filter: || turning(FormConfig::Kf),
    },
    Preset {
        name: "ukf",
        meaning: "Unscented Kalman filter (Julier, Uhlmann 2004): the same by sigma points instead of Jacobians. For turns \
                  that are fast or seldom seen.",
        filter: || turning(FormConfig::Ukf),
    },
    Preset {
        name: "huber",
        meaning: "Kalman filter with a Huber innovation (Huber 1981): an outlier's pull is bounded.",
        filter: || innovation(InnovationConfig::Huber(HuberConfig::default())),
    },
    Preset {
        name: "student-t",
        meaning: "Kalman filter with a Student-t innovation (Roth et al. 2013): the farther a measurement, the less it counts.",
        filter: || innovation(InnovationConfig::StudentT(StudentTConfig::default())),
    },
    Preset {
        name: "constant-acceleration",
        meaning: "Kalman filter with constant acceleration (Bar-Shalom et al. 2001): for long, steady manoeuvres.",
        filter: || model(ModelConfig::ConstantAcceleration(WhiteNoiseConfig::default())),
    },
    Preset {
        name: "singer",
        meaning: "Kalman filter with an acceleration that decays (Singer 1970): for pilots' manoeuvres.",
        filter: || model(ModelConfig::Singer(SingerConfig::default())),
    },
    Preset {
        name: "imm",
        meaning: "Interacting multiple models (Blom, Bar-Shalom 1988): a quiet and a manoeuvring filter of any form side by \
                  side, weighed by likelihood. For straight flight with bouts of manoeuvre.",
        filter: || form(FormConfig::Imm(ImmConfig::default())),
    },
    Preset {
        name: "lms",
        meaning: "Time-varying Kalman filter with learnt acceleration weights (Obolensky, Erdogmus, Principe 2002): guarded by \
                  default; as printed on request, which diverges (a track whose filter does keeps its last state until it \
                  ends).",
        filter: || form(FormConfig::Lms(LmsConfig::default())),
    },
    Preset {
        name: "ar1",
        meaning: "Scalar AR(1) recursion of each coordinate (Cai, Cui 2014): the paper's baseline. Lags a steady motion and \
                  depends on the origin: to compare with.",
        filter: || form(FormConfig::Ar1(Ar1Config::default())),
    },
    Preset {
        name: "displacement",
        meaning: "Coordinate now and one frame before, [2 -1; 1 0] (Cai, Cui 2014): straight-line extrapolation with two states \
                  an axis, without the faults of `ar1`.",
        filter: || form(FormConfig::Displacement(DisplacementConfig::default())),
    },
];

fn form(form: FormConfig) -> FilterConfig {
    FilterConfig { form, ..FilterConfig::default() }
}

fn model(model: ModelConfig) -> FilterConfig {
    FilterConfig { model, ..FilterConfig::default() }
}

fn innovation(innovation: InnovationConfig) -> FilterConfig {
    FilterConfig { innovation, ..FilterConfig::default() }
}

fn turning(form: FormConfig) -> FilterConfig {
    FilterConfig { form, ..model(ModelConfig::NearlyConstantTurn(NearlyConstantTurnConfig::default())) }
}

/// Reads a filter: its name, or a table of its four parts.
pub(in crate::track) fn name_or_parts<'de, D: Deserializer<'de>>(from: D) -> Result<FilterConfig, D::Error> {
    struct NameOrParts;
    impl<'de> Visitor<'de> for NameOrParts {
        type Value = FilterConfig;
        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("the name of a filter, or a table of form, model, innovation and adaptive")
        }
        fn visit_str<E: Error>(self, name: &str) -> Result<FilterConfig, E> {
            const NAMES: [&str; PRESETS.len()] = {
                let mut names = [""; PRESETS.len()];
                let mut i = 0;
                while i < names.len() {
                    names[i] = PRESETS[i].name;
                    i += 1;
                }
                names
            };
            let found = PRESETS.iter().find(|p| p.name == name);
            found.map(Preset::filter).ok_or_else(|| E::unknown_variant(name, &NAMES))
        }
        fn visit_map<A: MapAccess<'de>>(self, parts: A) -> Result<FilterConfig, A::Error> {
            FilterConfig::deserialize(MapAccessDeserializer::new(parts))
        }
    }
    from.deserialize_any(NameOrParts)
}

/// The schema of a filter: its name, or a table of its four parts.
pub(in crate::track) fn schema(generator: &mut SchemaGenerator) -> Schema {
    let names = PRESETS.map(|p| p.name);
    json_schema!({ "anyOf": [generator.subschema_for::<FilterConfig>(), { "type": "string", "enum": names }] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    /// What each name stands for, written out; an empty line of a part is its default.
    const SPELLED: [(&str, &str); 17] = [
        ("kf", "form = 'kf'"),
        ("kf-short", "form = 'kf-short'"),
        ("ud", "form = 'ud'"),
        ("srif", "form = 'srif'"),
        (
            "fuzzy-srif",
            "form = 'srif'\ninnovation.fuzzy = { innovation-scale = 3.0, difference-scale = 12.0, output-scale = 3.0 }",
        ),
        ("information", "form = 'information'"),
        ("square-root", "form = 'square-root'"),
        (
            "ekf",
            "form = 'kf'\nmodel.nearly-constant-turn = { start-rate-std-rad-per-s = 0.5, rate-drift-rad-per-s = 0.5, hold-s = 0.04 }",
        ),
        (
            "ukf",
            "form = 'ukf'\nmodel.nearly-constant-turn = { start-rate-std-rad-per-s = 0.5, rate-drift-rad-per-s = 0.5, hold-s = 0.04 }",
        ),
        ("huber", "innovation.huber.threshold = 2.0"),
        ("student-t", "innovation.student-t.degrees-of-freedom = 4.0"),
        ("constant-acceleration", "model.constant-acceleration = {}"),
        ("singer", "model.singer.manoeuvre-s = 2.0"),
        ("imm", "form.imm = { form = 'kf', manoeuvre-factor = 10.0, quiet-s = 5.0, manoeuvre-s = 1.0 }"),
        ("lms", "form.lms = { window = 2, rule = { guarded = {} } }"),
        ("ar1", "form.ar1.frame-s = 0.04"),
        ("displacement", "form.displacement.frame-s = 0.04"),
    ];

    #[test]
    fn every_name_is_the_filter_that_is_spelled_out() {
        for (preset, (name, parts)) in PRESETS.iter().zip(SPELLED) {
            assert_eq!(preset.name, name);
            let read = |text: &str| Config::from_toml(text, "my.toml").unwrap().tracker.filter;
            assert_eq!(read(&format!("[tracker]\nfilter = '{name}'\n")), preset.filter(), "{name}");
            assert_eq!(read(&format!("[tracker.filter]\n{parts}\n")), preset.filter(), "{name}: {parts}");
            assert_eq!(
                Config::default().with(&format!("tracker.filter={name}")).unwrap().tracker.filter,
                preset.filter()
            );
            preset.filter().validate("tracker.filter").unwrap();
        }
    }

    #[test]
    fn no_two_names_are_one_filter() {
        for (i, a) in PRESETS.iter().enumerate() {
            assert!(PRESETS[..i].iter().all(|b| b.name != a.name && b.filter() != a.filter()), "{}", a.name);
        }
    }

    #[test]
    fn a_form_with_a_model_of_its_own_takes_no_other() {
        for more in ["model.singer = {}", "innovation.huber = {}", "adaptive = {}"] {
            let text = format!("[tracker.filter]\nform.imm = {{}}\n{more}\n");
            let e = Config::from_toml(&text, "my.toml").unwrap_err().to_string();
            assert!(e.contains("tracker.filter.form") && e.contains("model of their own"), "{e}");
        }
    }

    #[test]
    fn the_schema_knows_the_names() {
        let schema = crate::config::schema();
        let names = &schema["$defs"]["TrackerConfig"]["properties"]["filter"]["anyOf"][1]["enum"];
        assert_eq!(names.as_array().map(Vec::len), Some(PRESETS.len()), "{schema}");
    }
}
