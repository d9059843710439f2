//! Tests of the whole crate from outside: golden vectors, conformance of every form, numerics.

mod forms;
mod golden;
