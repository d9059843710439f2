//! A form with an innovation rule and a learner of its noise around it.
//!
//! Both need only the predicted position, so they are one wrapper around the boxed form, not a type for each combination.

use super::innovation::InnovationConfig;
use super::learning::LearningConfig;
use super::tracked_filter::TrackFilter;
use boresight_filters::{
    Filter, FilterError, FuzzyInnovation, Gaussian, GaussianFilter, InnovationRule, NoiseLearner, ScaleNoise, Tracked,
    Weighted,
};
use nalgebra::Vector2;

/// A form whose process noise can be scaled.
pub(super) trait ScaledFilter: TrackFilter {
    fn set_noise_scale(&mut self, scale: f64) -> Result<(), FilterError>;
    fn scaled_clone(&self) -> Box<dyn ScaledFilter>;
}

impl<F, const N: usize> ScaledFilter for Tracked<F, N>
where
    F: GaussianFilter<N> + ScaleNoise<f64> + Send + Sync + 'static,
{
    fn set_noise_scale(&mut self, scale: f64) -> Result<(), FilterError> {
        self.0.set_noise_scale(scale)
    }
    fn scaled_clone(&self) -> Box<dyn ScaledFilter> {
        Box::new(self.clone())
    }
}

/// Puts the innovation rule and the learner around a form; a plain form without a learner stays as it is.
pub(super) fn conditioned(
    filter: Box<dyn ScaledFilter>,
    innovation: &InnovationConfig,
    adaptive: Option<&LearningConfig>,
) -> Result<Box<dyn TrackFilter>, FilterError> {
    let innovation = match innovation {
        InnovationConfig::Plain {} => Rule::Robust(InnovationRule::Plain),
        InnovationConfig::Huber(c) => Rule::Robust(c.innovation()),
        InnovationConfig::StudentT(c) => Rule::Robust(c.innovation()),
        InnovationConfig::Fuzzy(c) => Rule::Fuzzy(Box::new(FuzzyInnovation::new(c.correlator())?)),
    };
    let learner = adaptive.map(|c| NoiseLearner::new(c.config()).map(Box::new)).transpose()?;
    if learner.is_none() && innovation == Rule::Robust(InnovationRule::Plain) {
        return Ok(filter);
    }
    Ok(Box::new(Conditioned { filter, innovation, learner, scratch: Vec::new() }))
}

/// How innovations are held back.
#[derive(Clone, Debug, PartialEq)]
enum Rule {
    Robust(InnovationRule),
    Fuzzy(Box<FuzzyInnovation>),
}

/// A form with a rule for its innovations and, if wanted, a learner of its noise.
struct Conditioned {
    filter: Box<dyn ScaledFilter>,
    innovation: Rule,
    /// The window of a windowed memory holds 64 updates.
    learner: Option<Box<NoiseLearner<64>>>,
    scratch: Vec<Weighted>,
}

impl Clone for Conditioned {
    fn clone(&self) -> Self {
        Self {
            filter: (*self.filter).scaled_clone(),
            innovation: self.innovation.clone(),
            learner: self.learner.clone(),
            scratch: Vec::new(),
        }
    }
}

impl Filter for Conditioned {
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        self.filter.predict(dt_s)
    }

    fn predicted(&self) -> Gaussian<2> {
        self.filter.predicted()
    }

    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        let predicted = self.filter.predicted();
        self.scratch.clear();
        for h in hypotheses {
            let mut m = h.measurement;
            if let Some(learner) = &self.learner {
                m = learner.with_learnt_noise(&m);
            }
            m = match &self.innovation {
                Rule::Robust(rule) => rule.soften(&predicted, &m)?,
                Rule::Fuzzy(f) => f.moved(&predicted, &m)?,
            };
            self.scratch.push(Weighted { measurement: m, weight: h.weight });
        }
        self.filter.update(&self.scratch)?;
        let sum: f64 = hypotheses.iter().map(|h| h.weight).sum();
        if let Rule::Fuzzy(f) = &mut self.innovation
            && sum > 0.0
        {
            let add = |v: Vector2<f64>, h: &Weighted| v + (h.measurement.position - predicted.mean) * (h.weight / sum);
            f.remember(hypotheses.iter().fold(Vector2::zeros(), add));
        }
        // Several hypotheses mix in clutter: only a sure one teaches.
        if let (Some(learner), [only]) = (&mut self.learner, hypotheses)
            && only.weight == 1.0
        {
            let used = learner.with_learnt_noise(&only.measurement);
            learner.learn(&predicted, &used)?;
            self.filter.set_noise_scale(learner.noise_scale())?;
        }
        Ok(())
    }

    fn kinematics(&self) -> Gaussian<4> {
        self.filter.kinematics()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use boresight_filters::fuzzy::Correlator;
    use boresight_filters::model::{ConstantVelocity, Scaled};
    use boresight_filters::{Fuzzy, Kf, Measurement, Start};
    use nalgebra::{Matrix2, Matrix4, Vector4};

    #[test]
    fn the_fuzzy_rule_around_a_form_is_the_fuzzy_filter() {
        let start = Gaussian { mean: Vector4::new(5.0, 1.0, 6.0, -1.0), cov: Matrix4::identity() };
        let kf = Kf::<_, 4>::from_kinematics(Scaled::new(ConstantVelocity::continuous(0.1).unwrap()), &start).unwrap();
        let mut ours = conditioned(Box::new(Tracked(kf)), &InnovationConfig::Fuzzy(Box::default()), None).unwrap();
        let mut twin = Fuzzy::new(kf, Correlator::default()).unwrap();
        let (r, weights) = (Matrix2::identity() * 0.5, [&[1.0][..], &[0.6, 0.3], &[], &[1.0], &[0.4]]);
        for (k, weights) in weights.into_iter().enumerate() {
            let at = |i: usize| Vector2::new(6.5 + k as f64 - 2.0 * i as f64, 4.0 - 0.5 * k as f64 + i as f64);
            let hypothesis = |(i, &weight)| Weighted { measurement: Measurement { position: at(i), cov: r }, weight };
            let seen: Vec<Weighted> = weights.iter().enumerate().map(hypothesis).collect();
            ours.predict(1.0).unwrap();
            ours.update(&seen).unwrap();
            twin.predict(1.0).unwrap();
            twin.correct_weighted(seen.iter().copied()).unwrap();
            let off = (ours.predicted().mean - twin.predicted().mean).norm();
            assert!(off < 1e-9, "update {k}: {off}");
        }
    }
}
