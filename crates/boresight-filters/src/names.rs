//! The names of all filters and models with one sentence each, for listings such as `boresight config --list filters`.

/// Every filter: name, and when to take it.
pub const FILTERS: &[(&str, &str)] = &[
    ("kf", "Kalman filter in covariance form (Joseph): the default; fast, exact for linear models in f64."),
    ("kf-short", "Kalman filter with the short covariance update P - K H P: for comparison; loses digits first."),
    ("ud", "Bierman-Thornton U-D factors: keeps the covariance positive by construction; the choice in f32."),
    ("srif", "Square-root information filter: best conditioned; singular process noise, several sensors a scan."),
    ("fuzzy-srif", "Square-root information filter with a fuzzy-logic correlator on the innovation (CTFSRIF)."),
    ("information", "Information filter: adds measurements cheaply; for many sensors and few readings of the state."),
    ("square-root", "Square-root covariance filter (Potter): as robust as U-D, two roots more per step."),
    ("ukf", "Unscented filter: sigma points instead of Jacobians, for turning targets and radar measurements."),
    ("imm", "Interacting multiple models: straight and manoeuvring flight side by side, weighed by likelihood."),
    ("lms", "Time-varying Kalman filter whose acceleration weights are learnt by guarded LMS (as printed on request)."),
    ("ar1", "Scalar AR(1) recursion per coordinate: the paper's baseline; lags, and depends on the origin."),
    (
        "displacement",
        "Coordinate now and one frame before with [2 -1; 1 0]: straight-line extrapolation, two states an axis.",
    ),
];

/// Options that go around any Gaussian filter: name, and when to take it.
pub const INNOVATIONS: &[(&str, &str)] = &[
    ("plain", "Every measurement counts as its covariance says."),
    ("huber", "Beyond a threshold in standard deviations a measurement's pull no longer grows."),
    ("student-t", "Heavy-tailed measurements: the farther, the less weight."),
    ("fuzzy", "Fuzzy-logic correlator on innovation and its difference; saturates at two standard deviations."),
];

/// Every motion model: name, and when to take it.
pub const MODELS: &[(&str, &str)] = &[
    ("constant-velocity", "Straight motion with white acceleration, discrete or continuous: the default."),
    ("constant-acceleration", "White jerk or acceleration steps: for long, steady manoeuvres."),
    ("constant-turn", "A known turn rate: the building block of an IMM."),
    ("nearly-constant-turn", "The turn rate is a state: for vehicles and aircraft that turn for seconds."),
    ("singer", "Acceleration that fades with a time constant: for pilots' manoeuvres."),
    ("ornstein-uhlenbeck", "Velocity that fades with a time constant: for cells, pedestrians, long gaps."),
    ("random-walk", "Position that diffuses: for particles and slow drift."),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_kebab_case_and_explained_by_a_sentence() {
        for table in [FILTERS, INNOVATIONS, MODELS] {
            for (i, (name, text)) in table.iter().enumerate() {
                assert!(name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-'), "{name}");
                assert!(text.ends_with('.') && text.len() > 20, "{name}");
                assert!(table[..i].iter().all(|(other, _)| other != name), "{name} twice");
            }
        }
    }
}
