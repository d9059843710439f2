//! Tests of the filter that learns its acceleration transition.

use super::*;

fn axis(rule: LmsRule) -> LmsAxis<5> {
    LmsAxis::new(1.0, 2.0, [0.3, 0.4], 0.5, rule).unwrap()
}

/// p = 3 t² has the acceleration 6 whatever the steps; c = 2/(h2 (h1 + h2)), 2/(h1 h2), 2/(h1 (h1 + h2)).
#[test]
fn the_second_difference_of_a_parabola_is_its_acceleration() {
    let mut a = axis(LmsRule::Guarded);
    for (t, h) in [(0.0, 0.0), (0.1, 0.1), (0.3, 0.2)] {
        assert!(a.acceleration(0).is_none());
        a.remember(3.0 * t * t, h);
    }
    let (value, factor) = a.acceleration(0).unwrap();
    let want = (2.0_f64 / 0.06).powi(2) + (2.0_f64 / 0.02).powi(2) + (2.0_f64 / 0.03).powi(2);
    assert!((value - 6.0).abs() < 1e-12 && (factor - want).abs() < 1e-9, "{value} {factor} {want}");
    a.remember(3.0 * 0.25, 0.2);
    assert!((a.acceleration(1).unwrap().0 - 6.0).abs() < 1e-12);
    // Equal steps: variance 6 r / T⁴.
    let (_, factor) = {
        a.remember(0.0, 0.2);
        a.acceleration(0).unwrap()
    };
    assert!((factor - 6.0 / 0.0016).abs() < 1e-9, "{factor}");
    assert!(a.acceleration(3).is_none(), "five samples have three differences");
    a.remember(0.0, 0.0);
    a.remember(0.0, 0.0);
    assert!(a.acceleration(0).is_none(), "no time between the samples");
}

#[test]
fn three_samples_give_the_variances_of_their_differences() {
    let a = LmsAxis::<5>::from_samples([1.0, 2.0, 4.0], 0.5, 0.2, LmsRule::Guarded).unwrap();
    assert_eq!((a.state[0], a.state[1], a.state[2]), (4.0, 4.0, 0.0));
    for (i, want) in [0.04, 0.32, 3.84, 3.84, 3.84].into_iter().enumerate() {
        assert!((a.cov[(i, i)] - want).abs() < 1e-14, "{i}: {}", a.cov[(i, i)]);
    }
    assert!((a.acceleration(0).unwrap().0 - 4.0).abs() < 1e-12);
}

#[test]
fn a_start_out_of_range_is_refused() {
    let rule = LmsRule::Guarded;
    assert!(LmsAxis::<5>::new(0.0, 0.0, [0.0, 0.0], 0.0, rule).is_ok());
    assert!(LmsAxis::<4>::new(0.0, 0.0, [1.0, 1.0], 1.0, rule).is_err(), "no window");
    for (var, acceleration) in [([-1.0, 1.0], 1.0), ([1.0, -1.0], 1.0), ([1.0, 1.0], -1.0), ([1.0, f64::INFINITY], 1.0)]
    {
        assert!(LmsAxis::<5>::new(0.0, 0.0, var, acceleration, rule).is_err(), "{var:?} {acceleration}");
    }
    assert!(LmsAxis::<5>::new(f64::NAN, 0.0, [1.0, 1.0], 1.0, rule).is_err());
    assert!(LmsAxis::<5>::new(0.0, f64::INFINITY, [1.0, 1.0], 1.0, rule).is_err());
    for (alpha, fine) in [(0.0, true), (-1e-9, false), (f64::INFINITY, false), (f64::NAN, false)] {
        assert_eq!(LmsAxis::<5>::new(0.0, 0.0, [1.0, 1.0], 1.0, LmsRule::AsPrinted { alpha }).is_ok(), fine, "{alpha}");
    }
}

/// s = (p, v, a, a', a''): p + v dt, v + a dt, weights 1.
#[test]
fn a_step_moves_position_and_velocity_and_keeps_accelerations() {
    let mut a = axis(LmsRule::AsPrinted { alpha: 0.0 });
    (a.state[2], a.noise[1]) = (4.0, 0.7);
    a.predict(0.5).unwrap();
    assert_eq!((a.state[0], a.state[1], a.state[2]), (2.0, 4.0, 4.0));
    assert!((a.cov[(0, 0)] - 0.4).abs() < 1e-15 && (a.cov[(0, 1)] - 0.2).abs() < 1e-15);
    assert!((a.cov[(1, 1)] - (0.4 + 0.125 + 0.7)).abs() < 1e-15 && (a.cov[(1, 2)] - 0.25).abs() < 1e-15);
}

/// Weights of 0.7 in the row and a step that adds almost nothing: 1 + 0.99 (0.7 - 1), 0.99 * 0.6, over their sum.
#[test]
fn the_guard_leaks_to_the_start_and_limits_each_row() {
    let mut a = axis(LmsRule::Guarded);
    (a.weights[(2, 2)], a.weights[(2, 3)], a.weights[(3, 3)]) = (0.7, 0.6, 0.4);
    a.learn(&SMatrix::zeros(), 2.0, 2.0);
    let (own, next) = (1.0 + 0.99 * (0.7 - 1.0), 0.99 * 0.6);
    assert!((a.weights[(2, 2)] - own / (own + next)).abs() < 1e-15);
    assert!((a.weights[(2, 3)] - next / (own + next)).abs() < 1e-15);
    assert!((a.weights[(3, 3)] - (1.0 + 0.99 * (0.4 - 1.0))).abs() < 1e-15, "a row below 1 is left");
    assert!((a.rate - 1e-3 / 1e-6).abs() < 1e-9, "no acceleration before");
    (a.before[2], a.before[4]) = (2.0, 1.0);
    a.learn(&SMatrix::zeros(), 2.0, 2.0);
    assert!((a.rate - 1e-3 / (1e-6 + 5.0)).abs() < 1e-18);
}

/// Mean NIS 2 + (nis - 2)/20 with the limit 2 n = 4: 42 is the most that one step may bring.
#[test]
fn the_watchdog_restarts_the_weights_when_the_mean_nis_doubles() {
    let after = |nis: f64| {
        let mut a = axis(LmsRule::Guarded);
        a.weights[(3, 3)] = 0.4;
        a.learn(&SMatrix::zeros(), nis, 2.0);
        a
    };
    let calm = after(41.9);
    assert_eq!((calm.trips, calm.cov[(0, 0)]), (0, 0.3));
    assert_eq!(after(42.0).trips, 0, "the limit itself is not beyond it");
    let upset = after(42.1);
    assert_eq!((upset.trips, upset.weights), (1, SMatrix::identity()));
    assert!((upset.cov[(0, 0)] - 3.0).abs() < 1e-15 && upset.noise[2] == upset.cov[(2, 2)]);
    assert_eq!((upset.mean_nis, upset.noise[0]), (2.0, 0.0));
}
