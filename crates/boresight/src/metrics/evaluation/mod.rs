//! The whole evaluation of a result: every measure of this room of one sequence, of several, and of several results.
//!
//! [`evaluate`] judges one sequence; [`ResultEvaluation`] puts the sequences of a result together; [`compare`] puts results
//! beside each other with bootstrap intervals. [`Value`] names a number, its unit and which way it is better.

mod comparison;
mod evaluate;
mod note;
mod optional;
mod options;
mod pooled;
mod result;
mod sequence;
mod states;
mod values;

pub use crate::metrics::value::{Better, Value};
pub use comparison::{Comparison, compare};
pub use evaluate::{Evaluation, evaluate};
pub use note::Note;
pub use optional::OptionalMeasures;
pub use options::{BoundModel, ClearConvention, EvaluateOptions, Matching, MeasureSet};
pub use result::ResultEvaluation;
pub use sequence::Sequence;
pub use states::{NeesOverRuns, StateMeasures, nees_over_runs};
pub use values::mot_values;
