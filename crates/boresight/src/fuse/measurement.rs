//! Fusion at the level of measurements: one filter takes the reports of several sensors, at their own times, late ones too.
//!
//! Source: `docs/theory/fusion.md` (Parimala and Raol, eq. 10): measurements of one time are stacked in the square-root
//! information filter and triangularised once; every other filter takes them one after the other, which is the same for
//! independent errors (linear Gaussian case). Late reports: the filter remembers its last steps, goes back before the
//! report's time and runs the rest again: the answer is that of reports in order, to the bit. Reports older than what
//! is remembered are refused and counted.
//! Symbols: t s, z 2 x 1 px (or m), R 2 x 2. Limits: associations are given; memory of `REMEMBERED` reports.

use crate::Result;
use boresight_filters::{FilterError, Gaussian, GaussianFilter, Measurement, Srif, Start, model::Model};
use std::collections::VecDeque;

/// Reports remembered for late ones.
const REMEMBERED: usize = 256;

/// A filter that takes several measurements of one time.
pub trait TakesSeveral: GaussianFilter<4, Real = f64> + Clone {
    /// Corrects by all of them.
    /// # Errors
    /// As [`GaussianFilter::correct`].
    fn correct_all(&mut self, all: &[Measurement]) -> std::result::Result<(), FilterError> {
        all.iter().try_for_each(|m| self.correct(m))
    }
}

impl<M: Model<4> + Clone> TakesSeveral for boresight_filters::Kf<M, 4> where Self: GaussianFilter<4, Real = f64> {}
impl<M: Model<4> + Clone> TakesSeveral for boresight_filters::Ud<M, 4> where Self: GaussianFilter<4, Real = f64> {}

impl<M: Model<4> + Clone> TakesSeveral for Srif<M, 4>
where
    Self: GaussianFilter<4, Real = f64>,
{
    /// Stacks pairs: `[R y; H_w1 z_w1; H_w2 z_w2]` is triangularised once (eq 10).
    fn correct_all(&mut self, all: &[Measurement]) -> std::result::Result<(), FilterError> {
        let mut pairs = all.chunks_exact(2);
        for pair in &mut pairs {
            if let [a, b] = pair {
                self.correct_both(a, b)?;
            }
        }
        pairs.remainder().iter().try_for_each(|m| self.correct(m))
    }
}

/// What became of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// In order.
    InTime,
    /// Late, brought in where it belongs.
    Late,
    /// Older than anything remembered: not used.
    TooOld,
}

#[derive(Clone, Debug)]
struct Step<F> {
    time_s: f64,
    reports: Vec<Measurement>,
    after: F,
}

/// One target's filter fed by several sensors.
#[derive(Clone, Debug)]
pub struct Central<F> {
    /// Oldest first; the first is the start.
    steps: VecDeque<Step<F>>,
}

impl<F: TakesSeveral> Central<F> {
    /// Starts at a time from a filter.
    pub fn new(time_s: f64, filter: F) -> Self {
        Self { steps: VecDeque::from([Step { time_s, reports: Vec::new(), after: filter }]) }
    }

    /// Starts a filter of a model from a belief.
    /// # Errors
    /// As [`Start::start`].
    pub fn start<M>(time_s: f64, model: M, belief: Gaussian<4>) -> Result<Self>
    where
        F: Start<M, 4>,
        M: Model<4>,
    {
        Ok(Self::new(time_s, F::start(model, belief)?))
    }

    /// Time of the newest report, s.
    pub fn time_s(&self) -> f64 {
        self.steps.back().map_or(0.0, |s| s.time_s)
    }

    /// The belief at `time_s`, predicted if that is after the newest report; none before it.
    /// # Errors
    /// A prediction that the filter refuses.
    pub fn belief(&self, time_s: f64) -> Result<Option<Gaussian<4>>> {
        let Some(last) = self.steps.back() else { return Ok(None) };
        if time_s < last.time_s {
            return Ok(None);
        }
        let mut f = last.after.clone();
        f.predict(time_s - last.time_s)?;
        Ok(Some(f.kinematics()))
    }

    /// Takes a report of any sensor made at `time_s`.
    /// # Errors
    /// A measurement that the filter refuses; nothing is changed then.
    pub fn take(&mut self, time_s: f64, report: &Measurement) -> Result<Taken> {
        // The last step at or before the report.
        let Some(at) = self.steps.iter().rposition(|s| s.time_s <= time_s) else { return Ok(Taken::TooOld) };
        let late = at + 1 < self.steps.len();
        // Steps before the report stay; its own step and all after are run again.
        let joins = self.steps.get(at).is_some_and(|s| s.time_s == time_s);
        let base = if joins { at.checked_sub(1) } else { Some(at) };
        let Some(base) = base else {
            // At the start's own time: correct the start itself.
            return self.rerun_from_start(report, late);
        };
        let mut again: Vec<(f64, Vec<Measurement>)> =
            self.steps.iter().skip(base + 1).map(|s| (s.time_s, s.reports.clone())).collect();
        match again.first_mut() {
            Some((t, reports)) if *t == time_s => reports.push(*report),
            _ => again.insert(0, (time_s, vec![*report])),
        }
        let Some(mut filter) = self.steps.get(base).map(|s| (s.time_s, s.after.clone())) else {
            return Ok(Taken::TooOld);
        };
        let mut fresh = Vec::with_capacity(again.len());
        for (t, reports) in again {
            filter.1.predict(t - filter.0)?;
            filter.1.correct_all(&reports)?;
            filter.0 = t;
            fresh.push(Step { time_s: t, reports, after: filter.1.clone() });
        }
        self.steps.truncate(base + 1);
        self.steps.extend(fresh);
        while self.steps.len() > REMEMBERED {
            self.steps.pop_front();
        }
        Ok(if late { Taken::Late } else { Taken::InTime })
    }

    fn rerun_from_start(&mut self, report: &Measurement, late: bool) -> Result<Taken> {
        if late {
            return Ok(Taken::TooOld);
        }
        if let Some(first) = self.steps.front_mut() {
            let mut f = first.after.clone();
            f.correct_all(std::slice::from_ref(report))?;
            first.after = f;
        }
        Ok(Taken::InTime)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use boresight_filters::model::ConstantVelocity;
    use boresight_filters::{Kf, Ud};
    use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

    fn start() -> Gaussian<4> {
        Gaussian { mean: Vector4::new(10.0, 1.0, 5.0, -1.0), cov: Matrix4::identity() }
    }

    /// Two sensors: one every second, one every 0.7 s and at the same time every 7 s; positions of no meaning but fixed.
    fn reports() -> Vec<(f64, Measurement)> {
        let z = |t: f64, s: f64, r: f64| Measurement {
            position: Vector2::new(10.0 + t + (3.0 * t + s).sin(), 5.0 - t + (2.0 * t - s).cos()),
            cov: Matrix2::new(r, 0.1, 0.1, 2.0 * r),
        };
        let mut all: Vec<_> = (1..30).map(|k| (f64::from(k), z(f64::from(k), 0.0, 1.0))).collect();
        all.extend((1..40).map(|k| (f64::from(7 * k) / 10.0, z(f64::from(7 * k) / 10.0, 1.0, 0.5))));
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all
    }

    fn model() -> ConstantVelocity {
        ConstantVelocity::continuous(0.1).unwrap()
    }

    fn run<F: TakesSeveral + Start<ConstantVelocity, 4>>(reports: &[(f64, Measurement)]) -> Gaussian<4> {
        let mut c: Central<F> = Central::start(0.0, model(), start()).unwrap();
        reports.iter().for_each(|(t, m)| assert_ne!(c.take(*t, m).unwrap(), Taken::TooOld));
        c.belief(40.0).unwrap().unwrap()
    }

    #[test]
    fn stacked_and_sequential_fusion_agree() {
        let (k, u, s) = (run::<Kf<_, 4>>(&reports()), run::<Ud<_, 4>>(&reports()), run::<Srif<_, 4>>(&reports()));
        for other in [u, s] {
            assert!((k.mean - other.mean).amax() < 1e-9 && (k.cov - other.cov).amax() < 1e-9);
        }
    }

    #[test]
    fn late_reports_give_the_answer_of_reports_in_order() {
        let in_order = reports();
        let mut late = in_order.clone();
        // Every fifth report arrives up to twelve reports late.
        for i in (0..late.len() - 13).step_by(5) {
            let r = late.remove(i);
            late.insert(i + 3 + i % 10, r);
        }
        let mut c: Central<Kf<_, 4>> = Central::start(0.0, model(), start()).unwrap();
        let taken: Vec<_> = late.iter().map(|(t, m)| c.take(*t, m).unwrap()).collect();
        assert!(taken.contains(&Taken::Late) && !taken.contains(&Taken::TooOld));
        let (a, b) = (c.belief(40.0).unwrap().unwrap(), run::<Kf<_, 4>>(&in_order));
        assert!((a.mean - b.mean).amax() < 1e-12 && (a.cov - b.cov).amax() < 1e-12);
    }

    #[test]
    fn what_is_older_than_the_start_is_not_used() {
        let mut c: Central<Kf<_, 4>> = Central::start(5.0, model(), start()).unwrap();
        let before = c.belief(5.0).unwrap();
        let report = reports()[0].1;
        assert_eq!(c.take(1.0, &report).unwrap(), Taken::TooOld);
        assert_eq!(c.belief(5.0).unwrap(), before);
        assert_eq!(c.belief(4.0).unwrap(), None);
    }
}
