//! Formulas that a user writes, checked before they run.
//!
//!   `text -> expression with places -> graph (names, dimensions, ranges) -> program -> values`
//!
//! A graph rejects wrong dimensions, possible divisions by zero, and unknown names, each with its place. A program is a
//! flat list of operations on numbered registers, evaluated over any [`math::Real`]. Only these operations are
//! executed.
//!
//! Rounding rules of a formula. They give the bits of the same law written in Rust:
//!
//! * Operations run as written: from left to right, * and / before + and -, and ^ before both.
//! * `a*b + c` and `c + a*b` are rounded once (fused). With two products, the right one is fused. `a - b*c` is not fused.
//! * x/p is x times 1/p if p consists of parameters and numbers only and x does not.
//! * x^2, x^3, ... are products. x^0.5 is a square root.
//! * A name defined by `let` is rounded to a separate number.

#![warn(missing_docs)]

mod dimension;
mod graph;
mod lower;
mod parse;
mod problem;
mod program;
mod range;
mod token;

pub use dimension::Dimension;
pub use graph::{Graph, Id, Operation, Scope};
pub use parse::{Expression, MOST_CHARACTERS, parse};
pub use problem::{Place, Problem, nearest};
pub use program::{MOST_REGISTERS, Program};
pub use range::Range;
