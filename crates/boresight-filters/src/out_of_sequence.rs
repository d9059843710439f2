//! Late measurements on any covariance form: retrodiction (one-step lag and longer), or an exact replay.
//!
//! Source: Y. Bar-Shalom, "Update with out-of-sequence measurements in tracking: exact solution", IEEE Trans. AES 38(3),
//! 2002 (algorithm A1); Y. Bar-Shalom, H. Chen, M. Mallick, "One-step solution for the multistep out-of-sequence-
//! measurement problem in tracking", IEEE Trans. AES 40(1), 2004 (all updates since the lag as one equivalent update).
//! Now is the time of the newest update; a filter that was predicted beyond it is predicted there again.
//! With x⁻, P⁻ predicted from the last update before τ to now without the updates since: b = P⁻⁻¹ (x - x⁻),
//! B = P⁻⁻¹ (P⁻ - P) P⁻⁻¹ are HᵀS⁻¹ν and HᵀS⁻¹H of that equivalent update; Q = Q(now, τ);
//! x_τ = F (x - Q b), P_τ = F [P + (Q - Q B Q) - (Q - P⁻ B Q) - (..)ᵀ] Fᵀ, P_xz = [P - (Q - P⁻ B Q)] Fᵀ Hᵀ, F = Phi(now→τ).
//! Exact for one lag; for more it is the published approximation. Replay keeps the measurements and runs them again:
//! exact for every lag inside the ring. Limits: K updates are remembered; a model whose noise does not compose over
//! time (discrete white acceleration) is exact in neither. Cost: retrodiction about 10 N³, replay a step per update.
//! Symbols: τ, now s; x, b N x 1; P, Q, B N x N.

use crate::check::check_weighted;
use crate::check::{check_dt, check_measurement};
use crate::linalg::{Cholesky, invert_pair, mul, mul_transposed, symmetrize};
use crate::model::Model;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start, Weighted};
use nalgebra::{SMatrix, SVector};

/// How a late measurement is brought in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Late {
    /// Move the belief back, update across time: one step, whatever the lag.
    #[default]
    Retrodict,
    /// Run all updates since again, in order. After a PDA update in between it falls back to retrodiction.
    Replay,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry<F, T: Real> {
    /// The filter after the update.
    after: F,
    /// Its measurement; `None` for the start and for PDA updates.
    measurement: Option<Measurement<T>>,
    /// How long ago it was, s.
    age_s: T,
}

/// A filter that also takes measurements from the past; K updates are remembered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfSequence<F, M, const K: usize, T: Real = f64> {
    filter: F,
    model: M,
    late: Late,
    /// Newest first.
    past: [Option<Entry<F, T>>; K],
}

impl<F: Clone, M, const K: usize, T: Real> OutOfSequence<F, M, K, T> {
    /// Wraps a filter of a model; `late` says how late measurements are brought in.
    pub fn new<const N: usize>(filter: F, late: Late) -> Self
    where
        F: Start<M, N> + GaussianFilter<N, Real = T>,
        M: Model<N, T>,
    {
        let mut past = [const { None }; K];
        if let Some(first) = past.first_mut() {
            *first = Some(Entry { after: filter.clone(), measurement: None, age_s: T::zero() });
        }
        Self { model: filter.model().clone(), filter, late, past }
    }

    /// Returns the filter inside.
    pub fn inner(&self) -> &F {
        &self.filter
    }

    fn note(&mut self, after: F, measurement: Option<Measurement<T>>, age_s: T) {
        self.past.rotate_right(1);
        if let Some(first) = self.past.first_mut() {
            *first = Some(Entry { after, measurement, age_s });
        }
    }

    /// Corrects by a measurement made `age_s` seconds before now.
    /// # Errors
    /// [`FilterError::OutOfRange`] if it is older than all remembered updates; otherwise as [`GaussianFilter::correct`].
    /// The state is then unchanged.
    pub fn correct_late<const N: usize>(&mut self, age_s: T, m: &Measurement<T>) -> Result<(), FilterError>
    where
        F: GaussianFilter<N, Real = T>,
        M: Model<N, T>,
    {
        check_dt(age_s)?;
        check_measurement(m)?;
        if age_s == T::zero() {
            return self.correct(m);
        }
        let find = |e: &Option<Entry<F, T>>| e.as_ref().is_some_and(|e| e.age_s >= age_s);
        let Some(at) = self.past.iter().position(find) else {
            return Err(FilterError::OutOfRange(
                "a late measurement that is younger than the oldest remembered update",
            ));
        };
        let replayable = self.past[..at].iter().all(|e| e.as_ref().is_some_and(|e| e.measurement.is_some()));
        // With no update since, there is nothing to go back over.
        let replays = at == 0 || (self.late == Late::Replay && replayable);
        if replays { self.replay(at, age_s, m) } else { self.retrodict(at, age_s, m) }
    }

    fn replay<const N: usize>(&mut self, at: usize, age_s: T, m: &Measurement<T>) -> Result<(), FilterError>
    where
        F: GaussianFilter<N, Real = T>,
    {
        let Some(Some(base)) = self.past.get(at) else { return Ok(()) };
        let mut f = base.after.clone();
        f.predict(base.age_s - age_s)?;
        f.correct(m)?;
        let mut next = self.past.clone();
        let (mut age, late) = (age_s, Entry { after: f.clone(), measurement: Some(*m), age_s });
        for e in next[..at].iter_mut().rev().flatten() {
            f.predict(age - e.age_s)?;
            if let Some(z) = &e.measurement {
                f.correct(z)?;
            }
            (age, e.after) = (e.age_s, f.clone());
        }
        f.predict(age)?;
        // The late update takes its place in the ring; the oldest one falls off.
        if at < K {
            next[at..].rotate_right(1);
            next[at] = Some(late);
        }
        self.filter = f;
        self.past = next;
        Ok(())
    }

    fn retrodict<const N: usize>(&mut self, at: usize, age_s: T, m: &Measurement<T>) -> Result<(), FilterError>
    where
        F: GaussianFilter<N, Real = T>,
        M: Model<N, T>,
    {
        let (Some(Some(base)), Some(Some(newest))) = (self.past.get(at), self.past.first()) else { return Ok(()) };
        // All is done at the time of the newest update: process noise after it is not correlated with any innovation.
        let (ahead_s, age_s) = (newest.age_s, age_s - newest.age_s);
        let mut updated = newest.after.clone();
        let now = updated.belief();
        let mut blind = base.after.clone();
        blind.predict(base.age_s - ahead_s)?;
        let blind = blind.belief();
        let chol = Cholesky::new(&blind.cov, "the predicted covariance")?;
        let b: SVector<T, N> = chol.solve(&(now.mean - blind.mean));
        let big = chol.solve(&chol.solve(&(blind.cov - now.cov)).transpose());
        let q = self.model.process_noise(age_s);
        let f = self.model.inverse_transition(age_s, &now.mean)?;
        let bq = mul(&big, &q);
        let p_xv = q - mul(&blind.cov, &bq);
        let mut p_tau = now.cov + q - mul(&q, &bq) - p_xv - p_xv.transpose();
        symmetrize(&mut p_tau);
        let mut p_tau = mul_transposed(&mul(&f, &p_tau), &f);
        symmetrize(&mut p_tau);
        let x_tau = mul(&f, &(now.mean - mul(&q, &b)));
        let cross = mul_transposed(&(now.cov - p_xv), &f);
        let [i, j] = M::POSITION;
        let past = crate::gaussian::position_of(&Gaussian { mean: x_tau, cov: p_tau }, [i, j]);
        let s = past.cov + m.cov;
        let pair = invert_pair(&s, "the innovation covariance")?;
        let mut p_xz = SMatrix::<T, N, 2>::zeros();
        for r in 0..N {
            p_xz[(r, 0)] = cross[(r, i)];
            p_xz[(r, 1)] = cross[(r, j)];
        }
        let gain = mul(&p_xz, &SMatrix::<T, 2, 2>::from(pair.inverse));
        let mut cov = now.cov - mul_transposed(&gain, &p_xz);
        symmetrize(&mut cov);
        let belief = Gaussian { mean: now.mean + gain * (m.position - past.mean), cov };
        if !(crate::real::all_finite(&belief.mean) & crate::real::all_finite(&belief.cov)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        updated.set_belief(&belief)?;
        let mut filter = updated.clone();
        filter.predict(ahead_s)?;
        self.filter = filter;
        // A new anchor: it holds the late measurement too, and cannot be replayed through.
        self.note(updated, None, ahead_s);
        Ok(())
    }
}

impl<F, M, const N: usize, const K: usize, T: Real> GaussianFilter<N> for OutOfSequence<F, M, K, T>
where
    F: GaussianFilter<N, Real = T>,
    M: Model<N, T>,
{
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        self.filter.predict(dt_s)?;
        for e in self.past.iter_mut().flatten() {
            e.age_s += dt_s;
        }
        Ok(())
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        self.filter.correct(m)?;
        self.note(self.filter.clone(), Some(*m), T::zero());
        Ok(())
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let (_, n) = check_weighted(hypotheses.clone())?;
        self.filter.correct_weighted(hypotheses)?;
        if n > 0 {
            self.note(self.filter.clone(), None, T::zero());
        }
        Ok(())
    }

    fn belief(&self) -> Gaussian<N, T> {
        self.filter.belief()
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        self.filter.set_belief(belief)?;
        self.past = [const { None }; K];
        self.note(self.filter.clone(), None, T::zero());
        Ok(())
    }

    fn position_at(&self) -> [usize; 2] {
        self.filter.position_at()
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        self.filter.kinematics()
    }

    fn predicted(&self) -> Gaussian<2, T> {
        self.filter.predicted()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ConstantVelocity;
    use crate::{Kf, Ud};

    type Cv = ConstantVelocity<f64>;

    fn start() -> (Cv, Measurement) {
        (Cv::continuous(0.4).unwrap(), Measurement::isotropic(0.0, 0.0, 1.0))
    }

    fn z(k: i32) -> Measurement {
        Measurement::isotropic(f64::from(k) * 1.3 + f64::from(k * k % 5), f64::from(k * 7 % 3), 0.8)
    }

    fn late(before: i32) -> Measurement {
        Measurement::isotropic(f64::from(before) * 1.3 + 1.5, 0.7, 0.8)
    }

    /// Steps of 0.5 s with measurement k at step k; `late` comes after step 6, taken 0.2 s after step `before`.
    fn run<F: Start<Cv, 4> + GaussianFilter<4, Real = f64>>(how: Late, before: i32) -> (Gaussian<4>, Gaussian<4>) {
        run_ahead::<F>(how, before, 0.0)
    }

    /// [`run`] with the filter predicted `ahead_s` beyond its last update before the late measurement comes.
    fn run_ahead<F: Start<Cv, 4> + GaussianFilter<4, Real = f64>>(
        how: Late,
        before: i32,
        ahead_s: f64,
    ) -> (Gaussian<4>, Gaussian<4>) {
        let (cv, first) = start();
        let fresh = F::from_point(cv, &first, 2.0).unwrap();
        let mut in_order = fresh.clone();
        let mut wrapped = OutOfSequence::<F, Cv, 8>::new(fresh, how);
        for k in 1..=6 {
            if k - 1 == before {
                in_order.predict(0.2).unwrap();
                in_order.correct(&late(before)).unwrap();
                in_order.predict(0.3).unwrap();
            } else {
                in_order.predict(0.5).unwrap();
            }
            in_order.correct(&z(k)).unwrap();
            wrapped.predict(0.5).unwrap();
            wrapped.correct(&z(k)).unwrap();
        }
        if before == 6 {
            in_order.predict(0.2).unwrap();
            in_order.correct(&late(before)).unwrap();
            in_order.predict(ahead_s - 0.2).unwrap();
        } else {
            in_order.predict(ahead_s).unwrap();
        }
        wrapped.predict(ahead_s).unwrap();
        wrapped.correct_late(ahead_s + 0.5 * f64::from(6 - before) - 0.2, &late(before)).unwrap();
        (in_order.belief(), wrapped.belief())
    }

    fn same(pair: (Gaussian<4>, Gaussian<4>), tolerance: f64) {
        let (a, b) = pair;
        assert!((a.mean - b.mean).norm() < tolerance && (a.cov - b.cov).norm() < tolerance, "{a:?} {b:?}");
    }

    #[test]
    fn one_step_late_is_as_good_as_in_time() {
        same(run::<Kf<Cv, 4>>(Late::Retrodict, 5), 1e-11);
        same(run::<Ud<Cv, 4>>(Late::Retrodict, 5), 1e-11);
    }

    #[test]
    fn one_step_late_is_as_good_as_in_time_when_the_filter_has_been_predicted_on() {
        for how in [Late::Retrodict, Late::Replay] {
            // Before the last update, and after it.
            for before in [5, 6] {
                same(run_ahead::<Kf<Cv, 4>>(how, before, 0.3), 1e-11);
                same(run_ahead::<Ud<Cv, 4>>(how, before, 0.3), 1e-11);
            }
        }
    }

    #[test]
    fn a_replay_is_exact_for_every_lag() {
        for before in 0..6 {
            same(run::<Kf<Cv, 4>>(Late::Replay, before), 1e-11);
            same(run::<Ud<Cv, 4>>(Late::Replay, before), 1e-11);
        }
    }

    #[test]
    fn several_steps_late_is_close_and_never_over_confident_by_much() {
        let (exact, approximate) = run::<Kf<Cv, 4>>(Late::Retrodict, 2);
        assert!((exact.mean - approximate.mean).norm() < 0.1, "{exact:?} {approximate:?}");
        assert!((exact.cov - approximate.cov).norm() < 0.02 * exact.cov.norm());
    }

    /// One measurement of weight 1 is that measurement, none at all is no update.
    #[test]
    fn a_weighted_update_stands_in_the_history_and_one_of_no_weight_does_not() {
        let (cv, first) = start();
        let fresh = Kf::<Cv, 4>::from_point(cv, &first, 2.0).unwrap();
        let mut in_order = fresh;
        for (dt_s, m) in [(0.5, z(1)), (0.2, late(1)), (0.3, z(2))] {
            in_order.predict(dt_s).unwrap();
            in_order.correct(&m).unwrap();
        }
        for how in [Late::Retrodict, Late::Replay] {
            let mut wrapped = OutOfSequence::<_, Cv, 8>::new(fresh, how);
            wrapped.predict(0.5).unwrap();
            wrapped.correct(&z(1)).unwrap();
            wrapped.predict(0.5).unwrap();
            let before = wrapped;
            wrapped.correct_weighted([Weighted { measurement: z(9), weight: 0.0 }].into_iter()).unwrap();
            assert_eq!(wrapped, before);
            wrapped.correct_weighted([Weighted { measurement: z(2), weight: 1.0 }].into_iter()).unwrap();
            // It cannot be run again, so both ways go back over it: exact for one update.
            wrapped.correct_late(0.3, &late(1)).unwrap();
            same((in_order.belief(), wrapped.belief()), 1e-11);
        }
    }

    #[test]
    fn too_old_a_measurement_is_refused_and_changes_nothing() {
        let (cv, first) = start();
        let kf = Kf::<_, 4>::from_point(cv, &first, 2.0).unwrap();
        let mut f = OutOfSequence::<_, Cv, 2>::new(kf, Late::Retrodict);
        for k in 1..5 {
            f.predict(0.5).unwrap();
            f.correct(&z(k)).unwrap();
        }
        let before = f;
        assert!(f.correct_late(5.0, &z(9)).is_err());
        assert_eq!(f, before);
    }
}
