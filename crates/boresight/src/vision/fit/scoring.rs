//! The climb to the likelihood's top: Fisher's scoring with Levenberg's damping.
//!
//! A step solves (F + λ diag F) δ = score; it is taken if the deviance falls, else λ grows. It ends with the step that promises less than
//! [`ENOUGH`] of deviance, which is three hundredths of a standard deviation; what is left after it is a few thousandths. Source: D. W. Marquardt, SIAM J. 11, 431 (1963), with the expected in place of
//! the observed information (R. A. Fisher, *Statistical Methods for Research Workers*, 1925).

use super::solve::{Factor, Sums};

/// Most evaluations of the sums.
const EVALUATIONS: usize = 30;
/// Deviance that a last step may promise.
const ENOUGH: f64 = 1e-3;
/// The same as a share of the deviance, where rounding ends the climb.
const ROUNDING: f64 = 1e-13;
const FIRST_DAMPING: f64 = 1e-3;

/// What has sums at a state.
pub(super) trait Model<const P: usize> {
    fn sums(&self, p: &[f64; P]) -> Sums<P>;
}

/// Which parameters move, and how far in one step.
pub(super) struct Freedom<const P: usize> {
    /// The free parameter of each, or [`super::solve::HELD`].
    pub(super) to: [usize; P],
    /// Number of free parameters.
    pub(super) n: usize,
    /// Largest step of each parameter.
    pub(super) longest: [f64; P],
}

/// The end of a climb.
pub(super) struct Top<const P: usize> {
    pub(super) p: [f64; P],
    /// Sums over the free parameters, a last short step before.
    pub(super) sums: Sums<P>,
}

/// Climbs from a state; `None` if the sums are no numbers or say nothing about a parameter, or if it does not end.
pub(super) fn climb<const P: usize>(model: &impl Model<P>, start: [f64; P], freedom: &Freedom<P>) -> Option<Top<P>> {
    let mut p = start;
    let mut now = model.sums(&p).free(&freedom.to, freedom.n);
    let mut damping = FIRST_DAMPING;
    for _ in 0..EVALUATIONS {
        if !now.cost.is_finite() {
            return None;
        }
        let step = Factor::of(&now, damping)?.solve(&now.vector);
        let promised: f64 = step[..freedom.n].iter().zip(&now.vector).map(|(s, v)| s * v).sum();
        let mut next = p;
        for (i, &to) in freedom.to.iter().enumerate() {
            if let Some(s) = step.get(to) {
                next[i] += s.clamp(-freedom.longest[i], freedom.longest[i]);
            }
        }
        if promised <= ENOUGH.max(ROUNDING * now.cost.abs()) {
            // So short a step changes the information by nothing that counts.
            return Some(Top { p: next, sums: now });
        }
        let then = model.sums(&next).free(&freedom.to, freedom.n);
        if then.cost < now.cost {
            (p, now) = (next, then);
            damping = (damping * 0.1).max(1e-9);
        } else {
            damping *= 10.0;
        }
    }
    None
}
