//! The recursion against its definition written out, its mean under noise, its moments.

use super::*;
use crate::vision::bernoulli::BernoulliConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Five or seven velocities along an axis.
fn config(speed: f64) -> BernoulliConfig {
    BernoulliConfig { max_speed_px_per_s: speed, acceleration_density_px2_per_s3: 1000.0, ..Default::default() }
}

/// The recursion written out cell by cell in f64, in the order of its definition: mixed, moved, born, weighed.
struct Twin {
    w: i64,
    h: i64,
    nv: usize,
    f: Vec<f64>,
}

impl Twin {
    fn at(&self, s: usize, vy: usize, vx: usize, y: i64, x: i64) -> usize {
        (((s * self.nv + vy) * self.nv + vx) as i64 * self.h * self.w + y * self.w + x) as usize
    }

    fn step(&mut self, motion: &Motion, ratios: &[Vec<f32>], births: f64, outside: f64, moved: [i64; 2]) {
        let (p, last) = (f64::from(motion.mixed), self.nv - 1);
        for _ in 0..motion.passes {
            for along_y in [true, false] {
                let old = self.f.clone();
                for s in 0..2 {
                    for vy in 0..self.nv {
                        for vx in 0..self.nv {
                            let near = |d: i64| {
                                let step = |v: usize| (v as i64 + d).clamp(0, last as i64) as usize;
                                if along_y { (step(vy), vx) } else { (vy, step(vx)) }
                            };
                            let (a, b) = (near(-1), near(1));
                            for y in 0..self.h {
                                for x in 0..self.w {
                                    let of = |(vy, vx): (usize, usize)| old[self.at(s, vy, vx, y, x)];
                                    let i = self.at(s, vy, vx, y, x);
                                    self.f[i] = (1.0 - p) * old[i] + 0.5 * p * (of(a) + of(b));
                                }
                            }
                        }
                    }
                }
            }
        }
        let old = self.f.clone();
        let survival = f64::from(motion.survival);
        for (s, ratios) in ratios.iter().enumerate() {
            for vy in 0..self.nv {
                for vx in 0..self.nv {
                    for y in 0..self.h {
                        for x in 0..self.w {
                            let from = [x - motion.shifts[vx] + moved[0], y - motion.shifts[vy] + moved[1]];
                            let inside = (0..self.w).contains(&from[0]) && (0..self.h).contains(&from[1]);
                            let was = if inside { old[self.at(s, vy, vx, from[1], from[0])] } else { outside };
                            let i = self.at(s, vy, vx, y, x);
                            self.f[i] = f64::from(ratios[(y * self.w + x) as usize]) * (survival * was + births);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_step_is_the_recursion_written_out_cell_by_cell() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut passes = [false; 2];
    for (speed, dts) in [(20.0, [0.04, 0.07, 0.02, 0.2]), (35.0, [0.1, 0.3, 0.01, 0.05])] {
        let mut motion = Motion::new(&config(speed), 1);
        let (w, h, nv) = (9usize, 7usize, motion.count());
        assert!(nv == 5 || nv == 7, "{nv}");
        let mut density = Density::new(w, h, [0, 0], nv, 1.0, f32::MAX);
        let mut twin = Twin { w: 9, h: 7, nv, f: vec![1.0; Density::cells(w, h, nv)] };
        for (k, dt) in dts.into_iter().cycle().take(12).enumerate() {
            motion.advance(dt);
            passes[usize::from(motion.passes > 1)] = true;
            let moved = [[0, 0], [1, -2], [-1, 0]][k % 3];
            let ratios: [Vec<f32>; 2] =
                std::array::from_fn(|_| (0..w * h).map(|_| 2.0 * rng.random::<f32>()).collect());
            let births = f64::from(1.0 - motion.survival);
            density.step(&motion, &ratios, births as f32, 1.0, moved);
            twin.step(&motion, &ratios, births, 1.0, moved);
            for y in 0..h {
                for x in 0..w {
                    let sum: f64 = (0..2)
                        .flat_map(|s| (0..nv * nv).map(move |v| (s, v)))
                        .map(|(s, v)| twin.f[twin.at(s, v / nv, v % nv, y as i64, x as i64)])
                        .sum();
                    let (is, was) = (f64::from(density.marginal[y * w + x]), sum / (2 * nv * nv) as f64);
                    // 8 bits of fraction, twelve times.
                    assert!((is / was - 1.0).abs() < 0.01, "{k} {x} {y}: {is} {was}");
                }
            }
        }
    }
    assert_eq!(passes, [true; 2], "steps of one mixing and of several");
}

#[test]
fn under_noise_the_mean_stays_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut motion = Motion::new(&config(20.0), 1);
    let (w, h) = (64usize, 64usize);
    let mut density = Density::new(w, h, [0, 0], motion.count(), 1.0, f32::MAX);
    let mut mean = 0.0;
    let n = 60;
    for _ in 0..n {
        motion.advance(0.04);
        // Independent ratios of mean 1, log-normal, weak enough that the mean is seen in so few cells.
        let ratios: [Vec<f32>; 2] = std::array::from_fn(|_| {
            (0..w * h).map(|_| (0.3 * rng.sample::<f32, _>(rand_distr::StandardNormal) - 0.045).exp()).collect()
        });
        density.step(&motion, &ratios, 1.0 - motion.survival(), 1.0, [0, 0]);
        mean += density.marginal.iter().map(|m| f64::from(*m)).sum::<f64>() / (w * h * n) as f64;
    }
    assert!((mean - 1.0).abs() < 0.03, "{mean}");
}

#[test]
fn a_point_that_moves_is_where_and_as_fast_as_it_is() {
    // Hardly any turns, so that the velocity that it has is the only one that stays on it.
    let c = BernoulliConfig { max_speed_px_per_s: 60.0, acceleration_density_px2_per_s3: 300.0, ..Default::default() };
    let mut motion = Motion::new(&c, 1);
    let (w, h) = (80usize, 40usize);
    let mut density = Density::new(w, h, [0, 0], motion.count(), 0.0, f32::MAX);
    density.fill(1.0);
    let place = |k: u32| Vector2::new(10.0 + 1.3 * f64::from(k), 20.0 - 0.4 * f64::from(k));
    for k in 0..30u32 {
        motion.advance(0.04);
        let p = place(k);
        let ratio = |i: usize| {
            let d = Vector2::new((i % w) as f64, (i / w) as f64) - p;
            (3.0 * (-d.norm_squared() / 6.8).exp() - 1.0).exp() as f32
        };
        let ratios: [Vec<f32>; 2] = std::array::from_fn(|_| (0..w * h).map(ratio).collect());
        density.step(&motion, &ratios, 0.0, 0.0, [0, 0]);
    }
    let m = density.moments(&motion);
    assert!((m.place - place(29)).norm() < 0.3, "{:?}", m.place);
    assert!((m.velocity - Vector2::new(32.5, -10.0)).norm() < 4.0, "{:?}", m.velocity);
    assert!(m.cov.cholesky().is_some() && m.velocity_cov.cholesky().is_some());
    assert!(m.cov[(0, 0)] < 2.0 && m.cross[(0, 0)] > 0.0, "{m:?}");
    // Half of the window moved over to another holds the same.
    let mut part = Density::new(41, 21, [30, 0], motion.count(), 0.0, f32::MAX);
    part.copy_from(&density);
    let of = part.moments(&motion);
    assert!((of.place - m.place).norm() < 0.05 && (of.total / m.total - 1.0).abs() < 0.05, "{of:?}");
    density.flatten([30, 0, 71, 21], 1e-30);
    part.copy_from(&density);
    assert!(part.moments(&motion).total < 1e-20);
}
