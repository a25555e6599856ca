//! Formulas that a user writes, checked before they run.
//!
//!   text -> expression with places -> graph (names, dimensions, ranges) -> program -> values
//!
//! A graph refuses what has the wrong dimension, what could divide by zero, and names that it does not
//! know, each with its place. A program is a flat list of operations on numbered registers, evaluated
//! over any [`math::Real`]; nothing is executed but these operations.
//!
//! How a formula is rounded, so that it gives the bits of the same law written in Rust:
//!
//! - Operations run as they are written: from left to right, * and / before + and -, ^ before both.
//! - a*b + c and c + a*b are rounded once (fused); of two products the right one is. a - b*c is not fused.
//! - x/p, with p made of parameters and numbers alone and x not, is x times 1/p.
//! - x^2, x^3, ... are products; x^0.5 is a square root.
//! - A name that `let` gives is rounded to a number of its own.

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
pub use graph::{Graph, Id, Scope};
pub use parse::{Expression, MOST_CHARACTERS, parse};
pub use problem::{Place, Problem, nearest};
pub use program::{MOST_REGISTERS, Program};
pub use range::Range;
