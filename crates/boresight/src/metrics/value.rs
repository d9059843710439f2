//! A measure's value with its name, unit and direction.

use serde::Serialize;

/// Which way a measure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Better {
    /// Larger values.
    Higher,
    /// Smaller values.
    Lower,
    /// Neither: a target in between, or no target.
    Neither,
}

/// A measure's value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Value {
    /// The measure's name, as tables show it.
    pub name: &'static str,
    /// The value; NaN where it is not defined.
    pub value: f64,
    /// Its unit; empty for shares and counts.
    pub unit: &'static str,
    /// Which way it is better.
    pub better: Better,
}

impl Value {
    pub(super) fn new(name: &'static str, value: f64, unit: &'static str, better: Better) -> Self {
        Self { name, value, unit, better }
    }

    pub(super) fn higher(name: &'static str, value: f64) -> Self {
        Self::new(name, value, "", Better::Higher)
    }

    pub(super) fn lower(name: &'static str, value: f64, unit: &'static str) -> Self {
        Self::new(name, value, unit, Better::Lower)
    }

    pub(super) fn neither(name: &'static str, value: f64, unit: &'static str) -> Self {
        Self::new(name, value, unit, Better::Neither)
    }
}
