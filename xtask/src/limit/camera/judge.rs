//! What an answer is worth: how far a grid of places is from where it should be, and whether the stated covariance knew.

use super::pairs::Pair;
use nalgebra::{Matrix2, Vector2};

/// Places along each side.
const SIDE: usize = 5;
/// Farther off anywhere than this an answer is wrong, px.
const WRONG_PX: f64 = 0.5;
/// χ², 2 degrees of freedom, 1e-4: farther off than what is stated allows.
const BEYOND: f64 = 18.42;

/// Where the places of the grid are said to lie, and how surely.
pub struct Answer {
    errors: Vec<Vector2<f64>>,
    covs: Vec<Option<Matrix2<f64>>>,
}

impl Answer {
    /// By a function for the places and one for their covariances.
    pub fn of(
        pair: &Pair,
        place: impl Fn(Vector2<f64>) -> Vector2<f64>,
        cov: impl Fn(Vector2<f64>) -> Option<Matrix2<f64>>,
    ) -> Self {
        let (mut errors, mut covs) = (Vec::new(), Vec::new());
        let [w, h] = [pair.views[0].width(), pair.views[0].height()].map(|n| (n - 1) as f64);
        for i in 0..SIDE * SIDE {
            let share = |k: usize| k as f64 / (SIDE - 1) as f64;
            let p = Vector2::new(w * share(i % SIDE), h * share(i / SIDE));
            let q = pair.truth * p.push(1.0);
            let truth = Vector2::new(q.x / q.z, q.y / q.z);
            errors.push(place(p) - truth);
            covs.push(cov(truth));
        }
        Self { errors, covs }
    }
}

/// An answer judged.
pub struct Judged {
    /// Distances at the places, px; none where nothing was said.
    errors_px: Option<Vec<f64>>,
    wrong: bool,
    /// Wrong, and by more than what was stated allows: the error, and the deviation stated along it, at the place of the largest such error, px.
    pub unflagged: Option<[f64; 2]>,
    /// Mean of eᵀ C⁻¹ e over the places, where a covariance was stated.
    nees: Option<f64>,
    time_s: f64,
}

impl Judged {
    pub const HEAD: &str = "| method | pairs | answered % | error px, median | 95 % | off by > 0.5 px somewhere | of these beyond what is stated | eᵀ C⁻¹ e (2), mean | median | ms a pair, median |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |";

    pub fn of(_: &Pair, (answer, time_s): (Option<Answer>, f64)) -> Self {
        let none = Self { errors_px: None, wrong: false, unflagged: None, nees: None, time_s };
        let Some(a) = answer else { return none };
        let errors_px: Vec<f64> = a
            .errors
            .iter()
            .map(|e| if e.x.is_finite() && e.y.is_finite() { e.norm() } else { f64::INFINITY })
            .collect();
        let distance2 = |e: &Vector2<f64>, c: &Option<Matrix2<f64>>| {
            let solved = (*c)?.cholesky().map(|c| e.dot(&c.solve(e)));
            Some(solved.unwrap_or(f64::INFINITY))
        };
        let distances: Vec<Option<f64>> = a.errors.iter().zip(&a.covs).map(|(e, c)| distance2(e, c)).collect();
        let wrong = errors_px.iter().any(|e| *e > WRONG_PX);
        // Who states nothing is taken to be sure.
        let is_beyond = |i: &usize| errors_px[*i] > WRONG_PX && distances[*i].is_none_or(|d| d > BEYOND);
        let worst = (0..errors_px.len()).filter(is_beyond).max_by(|i, j| errors_px[*i].total_cmp(&errors_px[*j]));
        let unflagged = worst.map(|i| [errors_px[i], errors_px[i] / distances[i].unwrap_or(f64::INFINITY).sqrt()]);
        let stated: Vec<f64> = distances.into_iter().flatten().collect();
        let nees = (!stated.is_empty()).then(|| stated.iter().sum::<f64>() / stated.len() as f64);
        Self { errors_px: Some(errors_px), wrong, unflagged, nees, time_s }
    }
}

fn at(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    if values.is_empty() { f64::NAN } else { values[(q * (values.len() - 1) as f64).round() as usize] }
}

/// A row of the table.
pub fn row<'j>(name: &str, judged: impl Iterator<Item = &'j Judged>) -> String {
    let judged: Vec<&Judged> = judged.collect();
    let mut errors: Vec<f64> = judged.iter().filter_map(|j| j.errors_px.as_ref()).flatten().copied().collect();
    let answered = judged.iter().filter(|j| j.errors_px.is_some()).count();
    let mut nees: Vec<f64> = judged.iter().filter_map(|j| j.nees).filter(|n| n.is_finite()).collect();
    let mut times: Vec<f64> = judged.iter().map(|j| 1e3 * j.time_s).collect();
    let count = |f: &dyn Fn(&Judged) -> bool| judged.iter().filter(|j| f(j)).count();
    let (mean, median) = if nees.is_empty() {
        ("none".to_string(), String::new())
    } else {
        (format!("{:.2}", nees.iter().sum::<f64>() / nees.len() as f64), format!("{:.2}", at(&mut nees, 0.5)))
    };
    format!(
        "| {name} | {} | {:.1} | {:.3} | {:.3} | {} | {} | {mean} | {median} | {:.2} |",
        judged.len(),
        100.0 * answered as f64 / judged.len().max(1) as f64,
        at(&mut errors, 0.5),
        at(&mut errors, 0.95),
        count(&|j| j.wrong),
        count(&|j| j.unflagged.is_some()),
        at(&mut times, 0.5)
    )
}
