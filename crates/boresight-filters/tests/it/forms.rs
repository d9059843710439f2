//! Every form of the filter for one model and belief, behind the object-safe trait: the list the tests walk.

use boresight_filters::model::{ConstantVelocity, Dense};
use boresight_filters::{Filter, Gaussian, Information, Kf, SquareRoot, Srif, Start, Tracked, Ud};

/// Standard deviation of the acceleration in all tests of forms, px/s².
pub const ACCELERATION_STD: f64 = 0.5;

/// Every exact form, started from one belief.
pub fn forms(belief: &Gaussian<4>) -> Vec<(&'static str, Box<dyn Filter>)> {
    let cv = ConstantVelocity::discrete(ACCELERATION_STD).unwrap();
    vec![
        ("kf", Box::new(Tracked(Kf::start(cv, *belief).unwrap()))),
        ("kf dense", Box::new(Tracked(Kf::start(Dense(cv), *belief).unwrap()))),
        ("information", Box::new(Tracked(Information::start(cv, *belief).unwrap()))),
        ("square-root", Box::new(Tracked(SquareRoot::start(cv, *belief).unwrap()))),
        ("srif", Box::new(Tracked(Srif::start(cv, *belief).unwrap()))),
        ("ud", Box::new(Tracked(Ud::start(cv, *belief).unwrap()))),
    ]
}

/// Calls `f` with every exact form.
pub fn each_form(belief: &Gaussian<4>, mut f: impl FnMut(&'static str, &mut dyn Filter)) {
    for (name, mut filter) in forms(belief) {
        f(name, filter.as_mut());
    }
}
