//! Every form of the filter for one model and belief, behind the object-safe trait: the list the tests walk.

use boresight_filters::fuzzy::Correlator;
use boresight_filters::model::{
    ConstantAcceleration, ConstantTurn, ConstantVelocity, Dense, NearlyConstantTurn, OrnsteinUhlenbeck, RandomWalk,
    Scaled, Singer,
};
use boresight_filters::{
    Adaptive, AdaptiveConfig, Ar1, Displacement, Filter, Fuzzy, FuzzySrif, Gaussian, Imm, Information, InnovationRule,
    Kf, Late, Lms, LmsRule, Measurement, OutOfSequence, Robust, SquareRoot, Srif, Start, Tracked, Ud, Ukf,
};
use nalgebra::{Matrix2, Vector2};

/// Standard deviation of the acceleration in all tests of forms, px/s².
pub const ACCELERATION_STD: f64 = 0.5;

type Named = Vec<(&'static str, Box<dyn Filter>)>;

fn cv() -> ConstantVelocity {
    ConstantVelocity::discrete(ACCELERATION_STD).unwrap()
}

/// Every exact form, started from one belief; the Joseph filter first.
pub fn exact_forms(belief: &Gaussian<4>) -> Named {
    let (cv, b) = (cv(), *belief);
    let kf = Kf::<_, 4>::start(cv, b).unwrap();
    vec![
        ("kf dense", Box::new(Tracked(Kf::start(Dense(cv), b).unwrap()))),
        ("kf", Box::new(Tracked(kf))),
        ("information", Box::new(Tracked(Information::start(cv, b).unwrap()))),
        ("square-root", Box::new(Tracked(SquareRoot::start(cv, b).unwrap()))),
        ("srif", Box::new(Tracked(Srif::start(cv, b).unwrap()))),
        ("srif dense", Box::new(Tracked(Srif::start(Dense(cv), b).unwrap()))),
        ("ud", Box::new(Tracked(Ud::start(cv, b).unwrap()))),
        ("ud dense", Box::new(Tracked(Ud::start(Dense(cv), b).unwrap()))),
        ("ukf", Box::new(Tracked(Ukf::start(cv, b).unwrap()))),
        ("imm of one", Box::new(Tracked(Imm::new([kf], [1.0]).unwrap()))),
        ("out of sequence", Box::new(Tracked(OutOfSequence::<_, ConstantVelocity, 4>::new(kf, Late::Retrodict)))),
        ("plain robust", Box::new(Tracked(Robust::new(kf, InnovationRule::Plain).unwrap()))),
    ]
}

/// Exact forms and all that are Gaussian filters of other models or with other innovations.
pub fn forms(belief: &Gaussian<4>) -> Named {
    let (cv, b) = (cv(), *belief);
    let kf = Kf::<_, 4>::start(cv, b).unwrap();
    let turns = [0.0, 0.3].map(|w| Ud::<_, 4>::start(ConstantTurn::new(w, 0.1).unwrap(), b).unwrap());
    let scaled = Kf::<_, 4>::start(Scaled::new(cv), b).unwrap();
    let acceleration = ConstantAcceleration::continuous(0.1, 1.0).unwrap();
    let steps = ConstantAcceleration::discrete(0.1, 1.0).unwrap();
    let singer = Singer::new(0.5, 3.0).unwrap();
    let turn = NearlyConstantTurn::new(0.1, 0.01, 0.1).unwrap();
    let forget = OrnsteinUhlenbeck::new(2.0, 1.5).unwrap();
    let more: Named = vec![
        ("fuzzy srif", Box::new(Tracked(FuzzySrif::<_, 4>::start(cv, b).unwrap()))),
        ("fuzzy kf", Box::new(Tracked(Fuzzy::new(kf, Correlator::default()).unwrap()))),
        ("huber", Box::new(Tracked(Robust::new(kf, InnovationRule::Huber { threshold: 2.0 }).unwrap()))),
        (
            "student-t",
            Box::new(Tracked(Robust::new(turns[0], InnovationRule::StudentT { degrees_of_freedom: 4.0 }).unwrap())),
        ),
        ("imm", Box::new(Tracked(Imm::new(turns, [4.0, 2.0]).unwrap()))),
        ("adaptive", Box::new(Tracked(Adaptive::<_, 0>::new(scaled, AdaptiveConfig::default()).unwrap()))),
        ("acceleration kf", Box::new(Tracked(Kf::from_kinematics(acceleration, &b).unwrap()))),
        ("acceleration ud", Box::new(Tracked(Ud::from_kinematics(acceleration, &b).unwrap()))),
        ("acceleration steps srif", Box::new(Tracked(Srif::from_kinematics(steps, &b).unwrap()))),
        ("singer ud", Box::new(Tracked(Ud::from_kinematics(singer, &b).unwrap()))),
        ("turn ekf", Box::new(Tracked(Kf::from_kinematics(turn, &b).unwrap()))),
        ("turn srif", Box::new(Tracked(Srif::from_kinematics(turn, &b).unwrap()))),
        ("turn ukf", Box::new(Tracked(Ukf::from_kinematics(turn, &b).unwrap()))),
        ("ornstein-uhlenbeck", Box::new(Tracked(SquareRoot::from_kinematics(forget, &b).unwrap()))),
        ("displacement", Box::new(Tracked(Displacement::from_kinematics(&b, 0.1, 0.1).unwrap()))),
    ];
    exact_forms(belief).into_iter().chain(more).collect()
}

/// Everything, also forms whose covariance is no Gaussian belief in position and velocity, and f32.
pub fn all_forms(belief: &Gaussian<4>) -> Named {
    let b = *belief;
    let first = Measurement {
        position: Vector2::new(b.mean[0], b.mean[2]),
        cov: Matrix2::new(b.cov[(0, 0)], 0.0, 0.0, b.cov[(2, 2)]),
    };
    let cv32 = ConstantVelocity::<f32>::discrete(ACCELERATION_STD as f32).unwrap();
    let b32 = b.cast::<f32>();
    let more: Named = vec![
        ("random walk", Box::new(Tracked(Kf::from_kinematics(RandomWalk::new(0.3).unwrap(), &b).unwrap()))),
        ("lms", Box::new(Lms::<5>::from_kinematics(&b, 1.0, LmsRule::Guarded).unwrap())),
        ("lms as printed", Box::new(Lms::<6>::from_kinematics(&b, 1.0, LmsRule::AsPrinted { alpha: 1e-9 }).unwrap())),
        ("ar1", Box::new(Ar1::new(&first, 0.04).unwrap())),
        ("kf f32", Box::new(Tracked(Kf::start(cv32, b32).unwrap()))),
        ("ud f32", Box::new(Tracked(Ud::start(cv32, b32).unwrap()))),
        ("srif f32", Box::new(Tracked(Srif::start(cv32, b32).unwrap()))),
    ];
    forms(belief).into_iter().chain(more).collect()
}

/// Calls `f` with every exact form.
pub fn each_form(belief: &Gaussian<4>, mut f: impl FnMut(&'static str, &mut dyn Filter)) {
    for (name, mut filter) in exact_forms(belief) {
        f(name, filter.as_mut());
    }
}
