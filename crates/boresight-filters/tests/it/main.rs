//! Tests of the whole crate from outside: golden vectors, conformance of every form, numerics.

mod conformance;
mod forms;
mod golden;
mod nonlinear;
mod numerics;
