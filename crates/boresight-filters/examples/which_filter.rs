//! Choosing the filter at run time, and the table of the chapter "Which filter?": error and honesty by situation.
//!
//! Five situations, every filter over 200 seeded runs of 100 frames at 25 frames/s; rms position error after the first
//! 20 frames (px), its mean normalised squared error (NEES/2 of the position: 1 is honest, above 1 over-confident).
//! Run: `cargo run --release -p boresight-filters --example which_filter` (all), or with names: `… -- kf imm`

use boresight_filters::fuzzy::Correlator;
use boresight_filters::model::{ConstantTurn, ConstantVelocity, NearlyConstantTurn, OrnsteinUhlenbeck, Singer};
use boresight_filters::{
    Ar1, Displacement, Filter, FilterError, Fuzzy, Gaussian, Imm, Information, InnovationRule, Kf, Lms, LmsRule,
    Measurement, Robust, SquareRoot, Srif, Start, Tracked, Ud, Ukf, Weighted,
};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const DT: f64 = 0.04;
const FRAMES: usize = 100;
const RUNS: u64 = 200;

/// Measurement noise the filters are told, px.
const STD: f64 = 0.5;

/// Makes a filter from its name.
fn make(name: &str, first: &Gaussian<4>) -> Result<Option<Box<dyn Filter>>, FilterError> {
    let cv = ConstantVelocity::continuous(100.0)?;
    let turns = [(0.0, 4.0), (1.2, 4.0), (-1.2, 4.0)].map(|(w, q)| ConstantTurn::new(w, q));
    Ok(Some(match name {
        "kf" => Box::new(Tracked(Kf::from_kinematics(cv, first)?)),
        "ud" => Box::new(Tracked(Ud::from_kinematics(cv, first)?)),
        "srif" => Box::new(Tracked(Srif::from_kinematics(cv, first)?)),
        "information" => Box::new(Tracked(Information::from_kinematics(cv, first)?)),
        "square-root" => Box::new(Tracked(SquareRoot::from_kinematics(cv, first)?)),
        "fuzzy-srif" => {
            Box::new(Tracked(Fuzzy::new(Srif::<_, 4>::from_kinematics(cv, first)?, Correlator::default())?))
        }
        "huber" => {
            let kf = Kf::<_, 4>::from_kinematics(cv, first)?;
            Box::new(Tracked(Robust::new(kf, InnovationRule::Huber { threshold: 2.0 })?))
        }
        "student-t" => {
            let kf = Kf::<_, 4>::from_kinematics(cv, first)?;
            Box::new(Tracked(Robust::new(kf, InnovationRule::StudentT { degrees_of_freedom: 4.0 })?))
        }
        "kf stiff" => Box::new(Tracked(Kf::from_kinematics(ConstantVelocity::continuous(1.0)?, first)?)),
        "kf singer" => Box::new(Tracked(Kf::from_kinematics(Singer::new(30.0, 1.0)?, first)?)),
        "kf forgetting" => Box::new(Tracked(Kf::from_kinematics(OrnsteinUhlenbeck::new(30.0, 0.5)?, first)?)),
        "ukf" => Box::new(Tracked(Ukf::from_kinematics(NearlyConstantTurn::new(4.0, 1.0, 1.0)?, first)?)),
        "imm" => {
            let [a, b, c] = turns;
            let f = [
                Kf::<_, 4>::from_kinematics(a?, first)?,
                Kf::from_kinematics(b?, first)?,
                Kf::from_kinematics(c?, first)?,
            ];
            Box::new(Tracked(Imm::new(f, [2.0, 1.0, 1.0])?))
        }
        "lms" => Box::new(Lms::<5>::from_kinematics(first, 30.0, LmsRule::Guarded)?),
        "ar1" => {
            let cov = Matrix2::identity() * (STD * STD);
            Box::new(Ar1::new(&Measurement { position: Vector2::new(first.mean[0], first.mean[2]), cov }, DT)?)
        }
        "displacement" => Box::new(Tracked(Displacement::from_kinematics(first, 0.01, DT)?)),
        _ => return Ok(None),
    }))
}

/// What the target does and how well it is seen.
struct Situation {
    name: &'static str,
    /// Velocity after a step, from frame and velocity.
    motion: fn(usize, Vector2<f64>, &mut ChaCha8Rng) -> Vector2<f64>,
    outliers: f64,
    missed: f64,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

fn straight(_: usize, v: Vector2<f64>, _: &mut ChaCha8Rng) -> Vector2<f64> {
    v
}

fn turning(k: usize, v: Vector2<f64>, _: &mut ChaCha8Rng) -> Vector2<f64> {
    let w = if (30..70).contains(&k) { 1.2 * DT } else { 0.0 };
    Vector2::new(v[0] * w.cos() - v[1] * w.sin(), v[0] * w.sin() + v[1] * w.cos())
}

fn erratic(_: usize, v: Vector2<f64>, rng: &mut ChaCha8Rng) -> Vector2<f64> {
    // Velocity that forgets itself within 0.5 s.
    let keep = (-DT / 0.5_f64).exp();
    let kick = 30.0 * (1.0 - keep * keep).sqrt();
    v * keep + Vector2::new(normal(rng), normal(rng)) * kick
}

/// Every filter that [`make`] knows.
const ALL: [&str; 16] = [
    "kf",
    "ud",
    "srif",
    "information",
    "square-root",
    "kf stiff",
    "kf singer",
    "kf forgetting",
    "huber",
    "student-t",
    "fuzzy-srif",
    "ukf",
    "imm",
    "lms",
    "ar1",
    "displacement",
];

const SITUATIONS: [Situation; 5] = [
    Situation { name: "straight", motion: straight, outliers: 0.0, missed: 0.0 },
    Situation { name: "turn", motion: turning, outliers: 0.0, missed: 0.0 },
    Situation { name: "outliers", motion: straight, outliers: 0.1, missed: 0.0 },
    Situation { name: "erratic", motion: erratic, outliers: 0.0, missed: 0.0 },
    Situation { name: "missed 60 %", motion: erratic, outliers: 0.0, missed: 0.6 },
];

/// Returns rms position error (px) and mean NEES/2.
fn run(name: &str, s: &Situation) -> Result<Option<(f64, f64)>, FilterError> {
    let (mut sum2, mut nees, mut n) = (0.0, 0.0, 0.0);
    for seed in 0..RUNS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut x = Vector2::new(100.0, 80.0);
        let mut v = Vector2::new(normal(&mut rng), normal(&mut rng)) * 30.0;
        let see = |x: &Vector2<f64>, rng: &mut ChaCha8Rng| {
            let wide = if rng.random::<f64>() < s.outliers { 8.0 } else { 1.0 };
            Measurement::isotropic(x[0] + wide * STD * normal(rng), x[1] + wide * STD * normal(rng), STD)
        };
        let first = boresight_filters::model::kinematics_from_point(&see(&x, &mut rng), 30.0)?;
        let Some(mut filter) = make(name, &first)? else { return Ok(None) };
        for k in 0..FRAMES {
            v = (s.motion)(k, v, &mut rng);
            x += v * DT;
            let z = see(&x, &mut rng);
            filter.predict(DT)?;
            if rng.random::<f64>() >= s.missed {
                filter.update(&[Weighted::sure(z)])?;
            }
            if k >= 20 {
                let p = filter.predicted();
                let e = x - p.mean;
                sum2 += e.norm_squared();
                nees += p.cov.try_inverse().map_or(f64::NAN, |i| (e.transpose() * i * e)[0] / 2.0);
                n += 1.0;
            }
        }
    }
    Ok(Some(((sum2 / n).sqrt(), nees / n)))
}

fn main() -> Result<(), FilterError> {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let names: Vec<&str> = if asked.is_empty() { ALL.to_vec() } else { asked.iter().map(String::as_str).collect() };
    print!("| filter |");
    SITUATIONS.iter().for_each(|s| print!(" {} |", s.name));
    print!("\n| --- |");
    SITUATIONS.iter().for_each(|_| print!(" --- |"));
    println!();
    for name in names {
        print!("| {name} |");
        for s in &SITUATIONS {
            match run(name, s)? {
                Some((rms, nees)) => print!(" {rms:.2} ({nees:.2}) |"),
                None => {
                    println!("\nno filter {name:?}; there are:");
                    println!("  {}", ALL.join(", "));
                    return Ok(());
                }
            }
        }
        println!();
    }
    Ok(())
}
