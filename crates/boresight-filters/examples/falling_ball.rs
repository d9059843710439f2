//! A falling ball in ten lines: noisy positions in, position and velocity with their uncertainty out.
//!
//! Run: `cargo run -p boresight-filters --example falling_ball`

use boresight_filters::model::ConstantAcceleration;
use boresight_filters::{FilterError, GaussianFilter, Kf, Measurement, Start};

fn main() -> Result<(), FilterError> {
    let model = ConstantAcceleration::continuous(0.01, 20.0)?; // gravity is not told: it is found
    let mut ball = Kf::<_, 6>::from_point(model, &Measurement::isotropic(0.0, 100.0, 0.5), 5.0)?;
    for k in 1..=40 {
        let t = f64::from(k) * 0.1;
        let noise = 0.5 * f64::from((k * 7919) % 13 - 6) / 6.0;
        ball.predict(0.1)?;
        ball.correct(&Measurement::isotropic(2.0 * t + noise, 100.0 - 4.905 * t * t - noise, 0.5))?;
    }
    let b = ball.belief();
    let sigma = |i: usize| b.cov[(i, i)].sqrt();
    println!("height {:.2} ± {:.2} m, falling at {:.2} ± {:.2} m/s", b.mean[3], sigma(3), -b.mean[4], sigma(4));
    println!("acceleration found: {:.2} ± {:.2} m/s² (truth -9.81)", b.mean[5], sigma(5));
    Ok(())
}
