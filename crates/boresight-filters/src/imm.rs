//! Interacting multiple models: R filters run side by side, mixed by the probability of each model.
//!
//! Source: H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm …", IEEE Trans. AC 33(8), 1988;
//! Bar-Shalom, Li, Kirubarajan 2001, 11.6.6.
//! Differs from it: models switch in continuous time: model i is kept for `sojourn_s[i]` seconds on average and then
//! leaves for each other model alike, so the transition matrix exp(Λ dt) fits any frame time. With weighted hypotheses
//! (PDA) model j has likelihood p0 + Σ w_i N_j(z_i)/N(z_i), N the mixture over models, and weights of its own: Bayes'
//! rule for given association weights.
//! Symbols: μ_j model probabilities; c_j predicted ones; Λ_j likelihoods. All models share the state of N entries.
//! Cost: R filters, plus R² N² for the mixing and R factorisations for square-root forms.
//! Limits: models that differ by less than their noise cannot be told apart; all must share one state layout.

use crate::check::check_weighted;
use crate::check::{check_dt, check_measurement};
use crate::gaussian::log_likelihood;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Weighted};
use nalgebra::{SMatrix, SVector};

/// Interacting multiple models over R filters of N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imm<F, const N: usize, const R: usize, T: Real = f64> {
    filters: [F; R],
    probability: SVector<T, R>,
    sojourn_s: SVector<T, R>,
}

/// Returns Π(dt) = exp(Λ dt) with Λ_ij = 1/(τ_i (R - 1)): row i, the chances to be in each model after dt.
fn transition<T: Real, const R: usize>(sojourn_s: &SVector<T, R>, dt_s: T) -> SMatrix<T, R, R> {
    if R == 1 {
        return SMatrix::identity();
    }
    // exp(A) = exp(A / 2^k)^(2^k); every factor is a stochastic matrix, so nothing can cancel.
    let mut fastest = T::zero();
    for i in 0..R {
        fastest = fastest.max(dt_s / sojourn_s[i]);
    }
    let (mut halvings, mut scale) = (0, T::one());
    while fastest * scale > T::of(0.25) && halvings < 60 {
        scale *= T::of(0.5);
        halvings += 1;
    }
    let mut rate = SMatrix::<T, R, R>::zeros();
    for i in 0..R {
        let leave = dt_s * scale / sojourn_s[i];
        for j in 0..R {
            rate[(i, j)] = if i == j { -leave } else { leave / T::of((R - 1) as f64) };
        }
    }
    let mut term = SMatrix::<T, R, R>::identity();
    let mut p = term;
    // 0.5¹⁴/14! is below the rounding of f64.
    for k in 1..14 {
        term = term * rate / T::of(f64::from(k));
        p += term;
    }
    for _ in 0..halvings {
        p *= p;
    }
    for i in 0..R {
        let sum = p.row(i).sum();
        for j in 0..R {
            p[(i, j)] /= sum;
        }
    }
    p
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, const R: usize, T: Real> Imm<F, N, R, T> {
    /// Joins filters that stand for different models of one target, all equally likely at first; `sojourn_s[i]` is how
    /// long model i lasts on average (s).
    /// # Errors
    /// [`FilterError::OutOfRange`] for no model, or a time that is not above 0.
    pub fn new(filters: [F; R], sojourn_s: [T; R]) -> Result<Self, FilterError> {
        if R == 0 {
            return Err(FilterError::OutOfRange("at least one model"));
        }
        if !sojourn_s.iter().all(|s| *s > T::zero() && *s <= T::MAX) {
            return Err(FilterError::OutOfRange("sojourn times above 0 s"));
        }
        let probability = SVector::repeat(T::one() / T::of(R as f64));
        Ok(Self { filters, probability, sojourn_s: SVector::from(sojourn_s) })
    }

    /// Returns the filter with other first probabilities of the models.
    /// # Errors
    /// [`FilterError::OutOfRange`] if they are negative or do not sum to 1.
    pub fn with_probabilities(mut self, probability: [T; R]) -> Result<Self, FilterError> {
        let p = SVector::from(probability);
        if !p.iter().all(|v| *v >= T::zero()) || !((p.sum() - T::one()).abs() <= T::EPSILON * T::of(16.0)) {
            return Err(FilterError::OutOfRange("model probabilities of at least 0 that sum to 1"));
        }
        self.probability = p;
        Ok(self)
    }

    /// Returns the probability of each model.
    pub fn probabilities(&self) -> [T; R] {
        self.probability.into()
    }

    /// Returns the filters of the models.
    pub fn filters(&self) -> &[F; R] {
        &self.filters
    }

    /// Sets the probabilities to prior times e^(log-likelihood).
    fn reweigh(&mut self, log: &[T; R]) -> Result<(), FilterError> {
        let mut largest = -T::MAX;
        for (p, l) in self.probability.iter().zip(log) {
            if *p > T::zero() {
                largest = largest.max(*l);
            }
        }
        let mut next = self.probability;
        for (p, l) in next.iter_mut().zip(log) {
            // A model of no probability may fit so much better that the factor overflows.
            if *p > T::zero() {
                *p *= (*l - largest).exp();
            }
        }
        let sum = next.sum();
        if !(sum > T::zero() && sum <= T::MAX) {
            return Err(FilterError::NotFinite("the model likelihoods"));
        }
        self.probability = next / sum;
        Ok(())
    }
}

/// Returns the Gaussian with the mean and covariance of Σ w_i N(b_i).
pub(crate) fn moment_match<T: Real, const N: usize, const R: usize>(
    beliefs: &[Gaussian<N, T>; R],
    weight: impl Fn(usize) -> T,
) -> Gaussian<N, T> {
    let mut mean = SVector::<T, N>::zeros();
    for (i, b) in beliefs.iter().enumerate() {
        mean += b.mean * weight(i);
    }
    let mut cov = SMatrix::<T, N, N>::zeros();
    for (i, b) in beliefs.iter().enumerate() {
        let off = b.mean - mean;
        cov += (b.cov + off * off.transpose()) * weight(i);
    }
    crate::linalg::symmetrize(&mut cov);
    Gaussian { mean, cov }
}

impl<F: GaussianFilter<N, Real = T>, const N: usize, const R: usize, T: Real> GaussianFilter<N> for Imm<F, N, R, T> {
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let pi = transition(&self.sojourn_s, dt_s);
        let c = pi.transpose() * self.probability;
        let beliefs = self.filters.each_ref().map(|f| f.belief());
        let mut next = self.clone();
        for (j, f) in next.filters.iter_mut().enumerate() {
            // A model of probability 0 that nothing leads to keeps its own belief.
            if R > 1 && c[j] > T::zero() {
                f.set_belief(&moment_match(&beliefs, |i| pi[(i, j)] * self.probability[i] / c[j]))?;
            }
            f.predict(dt_s)?;
        }
        next.probability = c / c.sum();
        *self = next;
        Ok(())
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        let mut next = self.clone();
        let mut log = [T::zero(); R];
        for (f, l) in next.filters.iter_mut().zip(&mut log) {
            *l = f.log_likelihood(m)?;
            f.correct(m)?;
        }
        next.reweigh(&log)?;
        *self = next;
        Ok(())
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let (sum, n) = check_weighted(hypotheses.clone())?;
        if n == 0 {
            return Ok(());
        }
        let p0 = (T::one() - sum).max(T::zero());
        let predicted = self.filters.each_ref().map(|f| f.predicted());
        // Ratio of a model's density at z to that of the mixture; all densities of one z in one scale.
        let probability = self.probability;
        let ratio = move |j: usize, m: &Measurement<T>| -> Result<T, FilterError> {
            let own = log_likelihood(&predicted[j], m)?;
            let mut mixture = T::zero();
            for (p, w) in predicted.iter().zip(probability.iter()) {
                if *w > T::zero() {
                    mixture += *w * (log_likelihood(p, m)? - own).exp();
                }
            }
            Ok(T::one() / mixture)
        };
        let mut next = self.clone();
        let mut log = [T::zero(); R];
        for j in 0..R {
            // A model of no probability has no share in the mixture: by itself it takes the weights as they are.
            if !(probability[j] > T::zero()) {
                next.filters[j].correct_weighted(hypotheses.clone())?;
                continue;
            }
            let mut total = p0;
            for h in hypotheses.clone() {
                if h.weight > T::zero() {
                    total += h.weight * ratio(j, &h.measurement)?;
                }
            }
            // 0 only where every z is impossible under this model and p0 is 0: it keeps a trace of belief.
            let total = total.max(T::EPSILON * T::EPSILON);
            log[j] = total.ln();
            let (ratio, limit) = (&ratio, T::one());
            next.filters[j].correct_weighted(hypotheses.clone().map(move |h| Weighted {
                measurement: h.measurement,
                weight: (h.weight * ratio(j, &h.measurement).unwrap_or(T::zero()) / total).min(limit),
            }))?;
        }
        next.reweigh(&log)?;
        *self = next;
        Ok(())
    }

    fn belief(&self) -> Gaussian<N, T> {
        moment_match(&self.filters.each_ref().map(|f| f.belief()), |i| self.probability[i])
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        let mut next = self.clone();
        for f in &mut next.filters {
            f.set_belief(belief)?;
        }
        *self = next;
        Ok(())
    }

    fn position_at(&self) -> [usize; 2] {
        self.filters.first().map_or([0, 0], |f| f.position_at())
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        moment_match(&self.filters.each_ref().map(|f| f.kinematics()), |i| self.probability[i])
    }

    fn predicted(&self) -> Gaussian<2, T> {
        moment_match(&self.filters.each_ref().map(|f| f.predicted()), |i| self.probability[i])
    }

    fn log_likelihood(&self, m: &Measurement<T>) -> Result<T, FilterError> {
        check_measurement(m)?;
        let mut log = [T::zero(); R];
        let mut largest = -T::MAX;
        for ((f, l), p) in self.filters.iter().zip(&mut log).zip(self.probability.iter()) {
            *l = f.log_likelihood(m)?;
            if *p > T::zero() {
                largest = largest.max(*l);
            }
        }
        let weighed = log.iter().zip(self.probability.iter()).filter(|(_, p)| **p > T::zero());
        let sum = weighed.fold(T::zero(), |s, (l, p)| s + *p * (*l - largest).exp());
        Ok(largest + sum.ln())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ConstantTurn, ConstantVelocity, Model};
    use crate::{Kf, Start, Ud};

    type Cv = ConstantVelocity<f64>;

    fn at_rest() -> Measurement {
        Measurement::isotropic(0.0, 0.0, 1.0)
    }

    #[test]
    fn transition_probabilities_compose_over_time() {
        let tau = SVector::<f64, 3>::new(1.0, 5.0, 0.2);
        let (a, b, both) = (transition(&tau, 0.3), transition(&tau, 1.1), transition(&tau, 1.4));
        assert!((a * b - both).norm() < 1e-13);
        // Two models of rate 1/τ: p(stay) = (1 + e^(-2 t/τ))/2.
        let p = transition(&SVector::<f64, 2>::new(4.0, 4.0), 1.0);
        assert!((p[(0, 0)] - 0.5 * (1.0 + libm::exp(-0.5))).abs() < 1e-15);
    }

    #[test]
    fn equal_models_are_one_filter() {
        let cv = Cv::discrete(0.5).unwrap();
        let one = Kf::<_, 4>::from_point(cv, &at_rest(), 3.0).unwrap();
        let mut imm = Imm::new([one, one], [2.0, 7.0]).unwrap();
        let mut kf = one;
        for k in 0..20 {
            let z = Measurement::isotropic(f64::from(k) * 1.1, f64::from(k % 3), 1.0);
            for f in [0, 1] {
                if f == 0 {
                    kf.predict(0.4).unwrap();
                    kf.correct(&z).unwrap();
                } else {
                    imm.predict(0.4).unwrap();
                    imm.correct(&z).unwrap();
                }
            }
        }
        assert!((kf.belief().mean - imm.belief().mean).norm() < 1e-12);
        assert!((kf.belief().cov - imm.belief().cov).norm() < 1e-12);
    }

    #[test]
    fn a_turning_target_is_told_from_a_straight_one() {
        let models = [0.0, 0.8, -0.8].map(|w| ConstantTurn::new(w, 0.01).unwrap());
        let start = models.map(|m| Ud::<_, 4>::from_point(m, &at_rest(), 12.0).unwrap());
        let mut imm = Imm::new(start, [10.0; 3]).unwrap();
        let mut truth = SVector::<f64, 4>::new(0.0, 10.0, 0.0, 0.0);
        for k in 0..60 {
            let leg = usize::from(k >= 30);
            truth = models[leg].moved(0.2, &truth);
            imm.predict(0.2).unwrap();
            imm.correct(&Measurement::isotropic(truth[0], truth[2], 0.5)).unwrap();
            if k == 29 {
                assert!(imm.probabilities()[0] > 0.9, "straight: {:?}", imm.probabilities());
            }
        }
        assert!(imm.probabilities()[1] > 0.9, "turning: {:?}", imm.probabilities());
        assert!((imm.belief().mean - truth).norm() < 1.0);
    }

    #[test]
    fn a_model_of_no_probability_has_no_say_however_well_it_fits() {
        let models = [0.001, 100.0].map(|q| Cv::continuous(q).unwrap());
        let start = models.map(|m| Kf::<_, 4>::from_point(m, &Measurement::isotropic(0.0, 0.0, 0.1), 0.1).unwrap());
        let mut imm = Imm::new(start, [1.0; 2]).unwrap();
        imm.predict(1.0).unwrap();
        let imm = imm.with_probabilities([1.0, 0.0]).unwrap();
        // Hundreds of standard deviations off for the one, a few for the other: the likelihoods' ratio overflows.
        let z = Measurement::isotropic(60.0, 0.0, 0.1);
        let mut alone = imm.filters[0];
        assert_eq!(imm.log_likelihood(&z).unwrap(), alone.log_likelihood(&z).unwrap());
        alone.correct(&z).unwrap();
        let (mut plain, mut doubtful) = (imm, imm);
        plain.correct(&z).unwrap();
        assert_eq!(plain.probabilities(), [1.0, 0.0]);
        assert_eq!(plain.belief().mean, alone.belief().mean);
        doubtful.correct_weighted([Weighted { measurement: z, weight: 0.5 }].into_iter()).unwrap();
        assert_eq!(doubtful.probabilities(), [1.0, 0.0]);
        let half = (imm.filters[0].belief().mean + alone.belief().mean) * 0.5;
        assert!((doubtful.belief().mean - half).norm() < 1e-12);
    }

    #[test]
    fn a_sure_hypothesis_is_the_plain_update_and_a_doubtful_one_follows_bayes() {
        let models = [0.2, 3.0].map(|s| Cv::discrete(s).unwrap());
        let mut imm = Imm::new(models.map(|m| Kf::<_, 4>::from_point(m, &at_rest(), 1.0).unwrap()), [5.0; 2]).unwrap();
        imm.predict(1.0).unwrap();
        let z = Measurement::isotropic(3.0, 1.0, 0.7);
        let (mut plain, mut sure, mut doubtful) = (imm, imm, imm);
        plain.correct(&z).unwrap();
        // Two halves of one measurement are the whole measurement.
        let half = Weighted { measurement: z, weight: 0.5 };
        sure.correct_weighted([half, half].into_iter()).unwrap();
        assert!((plain.belief().cov - sure.belief().cov).norm() < 1e-12);
        assert!((plain.probability - sure.probability).norm() < 1e-12);
        doubtful.correct_weighted([half].into_iter()).unwrap();
        // By the law of total probability: half the time the prior, half the time the posterior.
        let want = (imm.probability + plain.probability) * 0.5;
        assert!((doubtful.probability - want).norm() < 1e-12);
        let mean = (imm.belief().mean + plain.belief().mean) * 0.5;
        assert!((doubtful.belief().mean - mean).norm() < 1e-12);
    }
}
