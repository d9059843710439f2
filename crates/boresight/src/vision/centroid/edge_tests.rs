//! The edge of a region: its slope, and what its undecided pixels and the grid add, against integrals, series and shapes.

use super::tests::close;
use super::*;
use crate::vision::cluster::segment;
use crate::vision::config::ClusterConfig;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// ∫ f(t) dt over -12..12, Simpson's rule.
fn integral(f: impl Fn(f64) -> f64) -> f64 {
    let n = 4800;
    let h = 24.0 / f64::from(n);
    (0..=n).map(|i| f(-12.0 + h * f64::from(i)) * [2.0, 4.0][usize::from(i % 2 == 1)]).sum::<f64>() * h / 3.0
}

/// 1 above 0, half at 0.
fn step(t: f64) -> f64 {
    if t.abs() < 1e-9 { 0.5 } else { f64::from(u8::from(t > 0.0)) }
}

#[test]
fn undecided_pixels_of_the_edge_add_the_variance_of_what_they_put_in() {
    // Pixel t standard deviations over the threshold puts in f = (J ± σ X) [X > 0], X ~ N(t, 1), where σ² [t > 0] is already counted.
    let normal = Normal::standard();
    for (jump, sd, growth) in [(3.0, 2.0, 1.0), (3.0, 2.0, -1.0), (0.0, 1.5, 1.0), (5.0, 0.0, 1.0)] {
        let per_length = integral(|t| {
            let (p, d) = (normal.cdf(t), normal.pdf(t));
            let (x, xx) = (t * p + d, (t * t + 1.0) * p + t * d); // E X⁺, E X⁺²
            let g = growth * sd;
            let mean = jump * p + g * x;
            let square = jump * jump * p + 2.0 * jump * g * x + g * g * xx;
            square - mean * mean - sd * sd * step(t)
        });
        // At a width of 1 px the grid has no say.
        let edge = Edge { radius: 5.0, width: 1.0, slope: 0.0, sd, jump, growth };
        let (ours, want) = (edge.weighted(), 4.0 * per_length / 5.0);
        assert!((ours - want).abs() < 1e-5 * (1.0 + sd * sd), "{jump} {sd} {growth}: {ours} {want}");
        let membership = edge.membership() * 5.0 / 4.0;
        assert!(close(membership, integral(|t| normal.cdf(t) * (1.0 - normal.cdf(t))), 1e-6), "{membership}");
    }
}

#[test]
fn the_grid_shakes_a_jump_and_a_ramp_by_the_variance_of_their_sums_over_all_phases() {
    // Σ_k (J + s (k + φ)) over the pixels k = 0..K of a ramp less its integral, φ even on 0..1.
    for (jump, slope) in [(1.0, 0.0), (2.0, 3.0), (0.0, 4.0)] {
        let (n, mut sum, mut sum2) = (20_000, 0.0, 0.0);
        for i in 0..n {
            let phase = (f64::from(i) + 0.5) / f64::from(n);
            // Pixels at phase, phase + 1, ..., up to 9 + phase, then the rest of the last pixel taken out: the far end does not count.
            let f = |u: f64| jump + slope * u;
            let pixels: f64 = (0..10).map(|k| f(f64::from(k) + phase)).sum();
            let end = 10.0 + phase - 0.5;
            let covered = jump * end + 0.5 * slope * end * end;
            let d = pixels - covered;
            sum += d;
            sum2 += d * d;
        }
        let (mean, n) = (sum / f64::from(n), f64::from(n));
        let want = sum2 / n - mean * mean;
        let edge = Edge { radius: 2.0, width: 0.0, slope, sd: 0.0, jump, growth: 1.0 };
        let ours = edge.weighted() * 2.0 / PER_CROSSING;
        assert!(close(ours, want, 1e-3), "{jump} {slope}: {ours} {want}");
    }
}

#[test]
fn the_grids_variance_is_its_series() {
    for width in [0.02, 0.1, 0.2, 0.227, 0.228, 0.3, 0.6, 1.0] {
        let d: f64 = 1.1 * width;
        let series: f64 = (1..20_000)
            .map(|k| {
                let k2 = f64::from(k).powi(2) * std::f64::consts::PI.powi(2);
                (-4.0 * k2 * d * d).exp() / (2.0 * k2)
            })
            .sum();
        let edge = Edge { radius: 1.0, width, slope: 1.0, sd: 1.0, jump: 1.0, growth: 1.0 };
        assert!((edge.grid_variance() - series).abs() < 6e-4, "{width}: {} {series}", edge.grid_variance());
        let kink = (-4.0 * (std::f64::consts::PI * d).powi(2)).exp() / 720.0;
        let steep = Edge { slope: 5.0, ..edge };
        let flat = Edge { slope: 0.0, ..edge };
        let by_slope = (steep.weighted() - flat.weighted()) / PER_CROSSING;
        assert!((by_slope - 25.0 * kink).abs() < 1e-12, "{width}");
    }
}

#[test]
fn the_ramps_constant_is_its_integral() {
    let normal = Normal::standard();
    let value = integral(|u| {
        let (p, d) = (normal.cdf(u), normal.pdf(u));
        let mean = u * p + d;
        (u * u + 1.0) * p + u * d - mean * mean - step(u)
    });
    assert!((value - RAMP).abs() < 1e-6, "{value}");
}

/// A picture of f(distance from (20.3, 19.6)) and its region over `level`.
fn round(f: impl Fn(f64) -> f64, level: f32) -> Region {
    let mut image = Image::filled(41, 41, 0.0f32);
    for y in 0..41 {
        for x in 0..41 {
            image.row_mut(y)[x] = f((x as f64 - 20.3).hypot(y as f64 - 19.6)) as f32;
        }
    }
    segment(&image, level, f32::MAX, &ClusterConfig::default()).into_iter().max_by_key(|r| r.area).unwrap()
}

#[test]
fn the_slope_at_the_edge_is_that_of_the_shape() {
    let around = Surroundings { variance: 4.0, gain: 0.5, level: Some(30.0), ..Surroundings::plain() };
    // A paraboloid of height 50 over the level 30, radius 12: slope 2 x 50 / 12 at its edge.
    let edge = Edge::of(&round(|r| 30.0 + 50.0 * (1.0 - r * r / 144.0), 30.0), &around);
    assert!(close(edge.slope, 100.0 / 12.0, 0.02) && close(edge.radius, 12.0, 0.01), "{} {}", edge.slope, edge.radius);
    assert!(close(edge.sd, 19f64.sqrt(), 1e-12) && close(edge.width, edge.sd / edge.slope, 1e-12));
    assert_eq!((edge.jump, edge.growth), (30.0, 1.0));
    // A Gaussian spot of height 100, sigma 5 over a ground of 10: it crosses 30 at r = 5 √(2 ln 5) with the slope 20 r / 25.
    let known = Surroundings { ground: Some(10.0), background: 10.0, ..around };
    let edge = Edge::of(&round(|r| 10.0 + 100.0 * (-r * r / 50.0).exp(), 30.0), &known);
    let radius = 5.0 * (2.0 * 5f64.ln()).sqrt();
    assert!(close(edge.radius, radius, 0.01) && close(edge.slope, 20.0 * radius / 25.0, 0.02), "{}", edge.slope);
    assert_eq!((edge.jump, edge.growth), (20.0, 1.0));
    // The ground at the level or over it says nothing: a paraboloid again.
    let at_level =
        Edge::of(&round(|r| 30.0 + 50.0 * (1.0 - r * r / 144.0), 30.0), &Surroundings { ground: Some(30.0), ..around });
    assert!(close(at_level.slope, 100.0 / 12.0, 0.02));
}

#[test]
fn the_edge_of_a_dark_region_grows_towards_its_inside() {
    let dark = |sign| {
        let around =
            Surroundings { background: 90.0, sign, level: Some(70.0), ground: Some(90.0), ..Surroundings::plain() };
        let mut region = round(|r| 100.0 - r, 0.0);
        // Mean 50, below the level.
        (region.area, region.sum) = (100, 5000.0);
        Edge::of(&region, &around)
    };
    let (as_dark, as_bright) = (dark(-1.0), dark(1.0));
    assert_eq!((as_dark.growth, as_bright.growth, as_dark.jump), (1.0, -1.0, 20.0));
    // Depth over the ground 20, mean depth over the level 20: ln(peak / level) of x = 1 is the root of (eʸ - 1) / y = 2.
    let y = 1.256_431_208_626_17;
    assert!(close(as_dark.slope, 2.0 * 20.0 * y / as_dark.radius, 1e-6), "{}", as_dark.slope);
}

#[test]
fn an_edge_that_is_undecided_over_more_than_a_pixel_counts_as_one_pixel() {
    let around = Surroundings { variance: 1e6, level: Some(30.0), ..Surroundings::plain() };
    let edge = Edge::of(&round(|r| 40.0 - r, 30.0), &around);
    assert_eq!(edge.width, 1.0);
    // The height counts as a tenth of the noise at least.
    assert!(close(edge.slope, 4.0 * 0.1 * 1000.0 / edge.radius, 1e-9), "{}", edge.slope);
    let none = Edge::of(&round(|r| 40.0 - r, 30.0), &Surroundings { level: None, ..around });
    assert_eq!((none.width, none.slope, none.sd, none.jump), (0.0, 0.0, 0.0, 0.0));
    let nan = Edge::of(&round(|r| 40.0 - r, 30.0), &Surroundings { level: Some(f64::NAN), ..around });
    assert_eq!(nan.width, 0.0);
    // At a level below 0 there is no shot noise.
    let cold = Surroundings { variance: 9.0, gain: 5.0, level: Some(-20.0), ..Surroundings::plain() };
    assert!(close(Edge::of(&round(|r| 40.0 - r, 30.0), &cold).sd, 3.0, 1e-12));
}

#[test]
fn the_peak_ratio_solves_its_equation() {
    for y in [0.01, 0.5, 1.0, 2.0, 4.0, 8.0f64] {
        let x = y.exp_m1() / y - 1.0;
        assert!((log_peak_ratio(x) - y).abs() < 1e-6 * y.max(1.0), "{y}: {}", log_peak_ratio(x));
    }
    // Next to nothing over the level: ln(1 + 2 x) = 2 x.
    assert!(close(log_peak_ratio(1e-4), 2e-4, 1e-3) && log_peak_ratio(0.0) == 0.0);
}

#[test]
fn a_sharp_edge_has_the_variance_of_rounding_and_both_forms_meet() {
    let edge = |width| Edge { radius: 1.0, width, slope: 1.0, sd: 1.0, jump: 1.0, growth: 1.0 };
    assert!((edge(0.0).grid_variance() - 1.0 / 12.0).abs() < 1e-15);
    let (below, above) = (edge(0.2499 / 1.1).grid_variance(), edge(0.2501 / 1.1).grid_variance());
    assert!((below - above).abs() < 1e-3, "{below} {above}");
}
