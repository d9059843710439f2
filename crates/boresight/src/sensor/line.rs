//! A straight line through points with errors, by weighted least squares; points far off are left out.
//!
//! Up to five rounds; a point counts if it lies within four of its deviations of the line of the round before. The first line is that of the medians of slopes
//! (P. K. Sen, J. Am. Stat. Assoc. 63, 1379 (1968)), which a quarter of bad points does not move far.

/// y = intercept + slope x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Value at x = 0.
    pub intercept: f64,
    /// Slope.
    pub slope: f64,
    /// Standard deviation of the intercept.
    pub intercept_sd: f64,
    /// Standard deviation of the slope.
    pub slope_sd: f64,
    /// Points that count.
    pub n: usize,
}

fn median(v: &mut [f64]) -> Option<f64> {
    v.sort_unstable_by(f64::total_cmp);
    v.get(v.len() / 2).copied()
}

/// The line through (x, y, deviation of y); `None` from fewer than two places.
pub(super) fn fit(points: &[[f64; 3]]) -> Option<Line> {
    let pairs = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| (a, b)));
    let mut slopes: Vec<f64> =
        pairs.filter(|(a, b)| a[0] != b[0]).map(|(a, b)| (a[1] - b[1]) / (a[0] - b[0])).collect();
    let slope = median(&mut slopes)?;
    let mut rests: Vec<f64> = points.iter().map(|p| p[1] - slope * p[0]).collect();
    let mut line = Line { intercept: median(&mut rests)?, slope, intercept_sd: 0.0, slope_sd: 0.0, n: 0 };
    // The first line is not the best one, so points may be further from it.
    for limit in [8.0, 4.0, 4.0, 4.0, 4.0] {
        let near = |p: &&[f64; 3]| (p[1] - line.intercept - line.slope * p[0]).abs() <= limit * p[2];
        let [mut w, mut x, mut y, mut xx, mut xy, mut n] = [0.0; 6];
        for p in points.iter().filter(near) {
            let weight = 1.0 / (p[2] * p[2]);
            w += weight;
            x += weight * p[0];
            y += weight * p[1];
            xx += weight * p[0] * p[0];
            xy += weight * p[0] * p[1];
            n += 1.0;
        }
        let det = w * xx - x * x;
        if det.is_nan() || det <= 1e-12 * w * xx || n < 2.0 {
            return None;
        }
        line = Line {
            intercept: (xx * y - x * xy) / det,
            slope: (w * xy - x * y) / det,
            intercept_sd: (xx / det).sqrt(),
            slope_sd: (w / det).sqrt(),
            n: n as usize,
        };
    }
    Some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_beside_points_that_lie_far_off() {
        let mut points: Vec<[f64; 3]> = (0..12).map(|i| [f64::from(i), 3.0 + 0.5 * f64::from(i), 0.1]).collect();
        points[2][1] = 40.0;
        points[9][1] = 70.0;
        let line = fit(&points).unwrap();
        assert!((line.intercept - 3.0).abs() < 1e-9 && (line.slope - 0.5).abs() < 1e-9 && line.n == 10, "{line:?}");
        assert_eq!(fit(&points[..1]), None);
        assert_eq!(fit(&[[2.0, 1.0, 1.0], [2.0, 3.0, 1.0]]), None);
    }

    #[test]
    fn its_deviations_are_those_of_weighted_least_squares() {
        // y known to 1 at x = 0 and to 2 at x = 1: the slope's variance is 1 + 4.
        let line = fit(&[[0.0, 1.0, 1.0], [1.0, 2.0, 2.0]]).unwrap();
        assert!((line.slope_sd - 5f64.sqrt()).abs() < 1e-12 && (line.intercept_sd - 1.0).abs() < 1e-12);
    }
}
