//! From names to filters: every form around every model, and the options that stand around a form.
//!
//! The options need only the predicted position, so they are one wrapper around the boxed form, not a type for each
//! combination. A plain form is boxed as it is.

use super::config::TrackFilter;
use super::innovation::{FormConfig, InnovationConfig};
use super::model::ModelConfig;
use boresight_filters::model::{
    ConstantAcceleration, ConstantTurn, ConstantVelocity, NearlyConstantTurn, OrnsteinUhlenbeck, RandomWalk, Scaled,
    Singer,
};
use boresight_filters::{
    CovarianceForm, Filter, FilterError, FuzzyInnovation, Gaussian, GaussianFilter, Information, Innovation, Kf,
    NoiseLearner, ScaleNoise, SquareRoot, Srif, Start, Tracked, Ud, Ukf, Weighted,
};
use nalgebra::Vector2;

/// The forms of the filter that take any model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Kf,
    KfShort,
    Ud,
    Srif,
    Information,
    SquareRoot,
    Ukf,
}

/// A form whose process noise can be scaled.
trait ScaledFilter: TrackFilter {
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

/// Builds a form with its options from a first belief; `acceleration_std` is σ (px/s²).
pub(in crate::track) fn build(
    form: Form,
    config: &FormConfig,
    start: &Gaussian<4>,
    acceleration_std: f64,
) -> Result<Box<dyn TrackFilter>, FilterError> {
    let innovation = match &config.innovation {
        InnovationConfig::Plain {} => Rule::Robust(Innovation::Plain),
        InnovationConfig::Huber(c) => Rule::Robust(c.innovation()),
        InnovationConfig::StudentT(c) => Rule::Robust(c.innovation()),
        InnovationConfig::Fuzzy(c) => Rule::Fuzzy(Box::new(FuzzyInnovation::new(c.correlator())?)),
    };
    let learner = config.adaptive.as_ref().map(|c| NoiseLearner::new(c.config()).map(Box::new)).transpose()?;
    let filter = around(form, &config.model, start, acceleration_std)?;
    if learner.is_none() && innovation == Rule::Robust(Innovation::Plain) {
        return Ok(filter);
    }
    Ok(Box::new(Optioned { filter, innovation, learner, scratch: Vec::new() }))
}

/// Builds a form around a model.
fn around(
    form: Form,
    model: &ModelConfig,
    start: &Gaussian<4>,
    std: f64,
) -> Result<Box<dyn ScaledFilter>, FilterError> {
    macro_rules! form {
        ($n:literal, $model:expr) => {{
            let m = Scaled::new($model);
            match form {
                Form::Kf => boxed(Kf::<_, $n>::from_kinematics(m, start)?),
                Form::KfShort => boxed(Kf::<_, $n>::from_kinematics(m, start)?.with_form(CovarianceForm::Short)),
                Form::Ud => boxed(Ud::<_, $n>::from_kinematics(m, start)?),
                Form::Srif => boxed(Srif::<_, $n>::from_kinematics(m, start)?),
                Form::Information => boxed(Information::<_, $n>::from_kinematics(m, start)?),
                Form::SquareRoot => boxed(SquareRoot::<_, $n>::from_kinematics(m, start)?),
                Form::Ukf => boxed(Ukf::<_, $n>::from_kinematics(m, start)?),
            }
        }};
    }
    let var = std * std;
    Ok(match model {
        ModelConfig::ConstantVelocity(c) => form!(
            4,
            match c.hold_s {
                None => ConstantVelocity::discrete(std)?,
                Some(s) => ConstantVelocity::continuous(var * s)?,
            }
        ),
        ModelConfig::ConstantAcceleration(c) => form!(
            6,
            match c.hold_s {
                None => ConstantAcceleration::discrete(std, std)?,
                Some(s) => ConstantAcceleration::continuous(var / s, std)?,
            }
        ),
        ModelConfig::ConstantTurn(c) => form!(4, ConstantTurn::new(c.rate_rad_per_s, var * c.hold_s)?),
        ModelConfig::NearlyConstantTurn(c) => {
            let drift = c.rate_drift_rad_per_s * c.rate_drift_rad_per_s;
            form!(5, NearlyConstantTurn::new(var * c.hold_s, drift, c.start_rate_std_rad_per_s)?)
        }
        ModelConfig::Singer(c) => form!(6, Singer::new(std, c.manoeuvre_s)?),
        ModelConfig::OrnsteinUhlenbeck(c) => form!(4, OrnsteinUhlenbeck::new(c.speed_std_px_per_s, c.memory_s)?),
        ModelConfig::RandomWalk(c) => form!(2, RandomWalk::new(c.diffusion_px2_per_s)?),
    })
}

fn boxed<F, const N: usize>(filter: F) -> Box<dyn ScaledFilter>
where
    F: GaussianFilter<N> + ScaleNoise<f64> + Send + Sync + 'static,
{
    Box::new(Tracked(filter))
}

/// How innovations are held back.
#[derive(Clone, Debug, PartialEq)]
enum Rule {
    Robust(Innovation),
    Fuzzy(Box<FuzzyInnovation>),
}

/// A form with a rule for its innovations and, if wanted, a learner of its noise.
struct Optioned {
    filter: Box<dyn ScaledFilter>,
    innovation: Rule,
    /// The window of a windowed memory holds 64 updates.
    learner: Option<Box<NoiseLearner<64>>>,
    scratch: Vec<Weighted>,
}

impl Clone for Optioned {
    fn clone(&self) -> Self {
        Self {
            filter: (*self.filter).scaled_clone(),
            innovation: self.innovation.clone(),
            learner: self.learner.clone(),
            scratch: Vec::new(),
        }
    }
}

impl Filter for Optioned {
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
