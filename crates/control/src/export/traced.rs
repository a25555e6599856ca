//! Numbers that record each operation, from which code in another language is made.
//!
//! A comparison gives a truth value, which cannot record anything. The work therefore runs several times. In each run,
//! one binary digit of a comparison's number decides whether it is true. This shows which comparison a choice depends
//! on.

use crate::number::{Memory, Number};
use math::{Over, Real};
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Operation on numbers; places of earlier nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// Bits of a constant.
    Constant(u64),
    /// An input, by its place.
    Input(usize),
    /// Function of one number.
    One(Function, u32),
    /// Operation on two numbers.
    Two(Operator, u32, u32),
    /// `a * b + c`.
    Fma(u32, u32, u32),
    /// If `of[0] < of[1]` the first of `then`, else the second.
    Select {
        /// Compared numbers.
        of: [u32; 2],
        /// Alternatives of the choice.
        then: [u32; 2],
    },
}

/// A function of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Function {
    Neg,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tanh,
    Abs,
}

/// An operation on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Operator {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
}

#[derive(Default)]
struct Recording {
    nodes: Vec<Node>,
    known: HashMap<Node, u32>,
    comparisons: Vec<[u32; 2]>,
    /// Binary digit of a comparison's number that decides its result; `None`: always false.
    digit: Option<u32>,
    /// Results of the choices so far.
    answers: Vec<bool>,
    /// Comparison that each choice depends on, as its number plus one; 0: no comparison. `None` while the dependences
    /// are being determined.
    takes: Option<Vec<usize>>,
}

thread_local! {
    static RECORDING: RefCell<Recording> = RefCell::default();
}

/// A number that is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced(u32);

impl Recording {
    fn node(&mut self, node: Node) -> Traced {
        let node = self.simple(node);
        let next = self.nodes.len() as u32;
        let nodes = &mut self.nodes;
        Traced(*self.known.entry(node).or_insert_with(|| {
            nodes.push(node);
            next
        }))
    }

    fn value(&self, place: u32) -> Option<f64> {
        match self.nodes[place as usize] {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Folds constants, and leaves out operations that change nothing.
    fn simple(&self, node: Node) -> Node {
        let constant = |x: f64| Node::Constant(x.to_bits());
        match node {
            Node::One(function, a) => self.value(a).map_or(node, |a| constant(function.of(a))),
            Node::Two(operator, a, b) => match (operator, self.value(a), self.value(b)) {
                (_, Some(a), Some(b)) => constant(operator.of(a, b)),
                (Operator::Add, Some(0.0), _) | (Operator::Mul, Some(1.0), _) => self.nodes[b as usize],
                (Operator::Add | Operator::Sub, _, Some(0.0))
                | (Operator::Mul | Operator::Div, _, Some(1.0)) => self.nodes[a as usize],
                _ => node,
            },
            Node::Fma(a, b, c) => match (self.value(a), self.value(b), self.value(c)) {
                (Some(a), Some(b), Some(c)) => constant(a.mul_add(b, c)),
                (Some(1.0), ..) => self.simple(Node::Two(Operator::Add, b, c)),
                (_, Some(1.0), _) => self.simple(Node::Two(Operator::Add, a, c)),
                (.., Some(0.0)) => self.simple(Node::Two(Operator::Mul, a, b)),
                _ => node,
            },
            Node::Select { of: [a, b], then } => match (self.value(a), self.value(b)) {
                (Some(a), Some(b)) => self.nodes[then[if a < b { 0 } else { 1 }] as usize],
                _ if then[0] == then[1] => self.nodes[then[0] as usize],
                _ => node,
            },
            _ => node,
        }
    }
}

impl Function {
    /// Its value.
    pub fn of(self, x: f64) -> f64 {
        match self {
            Function::Neg => -x,
            Function::Sqrt => x.sqrt(),
            Function::Exp => Real::exp(x),
            Function::Ln => Real::ln(x),
            Function::Sin => Real::sin(x),
            Function::Cos => Real::cos(x),
            Function::Tanh => Real::tanh(x),
            Function::Abs => Real::abs(x),
        }
    }
}

impl Operator {
    /// Its value.
    pub fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Operator::Add => a + b,
            Operator::Sub => a - b,
            Operator::Mul => a * b,
            Operator::Div => a / b,
            Operator::Pow => Real::pow(a, b),
        }
    }
}

/// Recorded operations.
#[derive(Clone, Debug)]
pub struct Graph {
    /// Nodes in an order in which each one depends on earlier nodes only.
    pub nodes: Vec<Node>,
    /// Places of the results.
    pub results: Vec<u32>,
}

/// Binary digits that identify comparisons.
const DIGITS: u32 = 16;

/// Records the operations of `work` on this number of inputs, and its results.
///
/// Panics if the work depends on a comparison other than by a choice.
pub fn record(inputs: usize, work: impl Fn(&[Traced]) -> Vec<Traced>) -> Graph {
    let run = |digit: Option<u32>, takes: Option<Vec<usize>>| {
        RECORDING.set(Recording { digit, takes, ..Recording::default() });
        let given: Vec<Traced> =
            (0..inputs).map(|place| RECORDING.with_borrow_mut(|own| own.node(Node::Input(place)))).collect();
        let results = work(&given);
        (RECORDING.take(), results)
    };
    let (first, _) = run(None, None);
    assert!(first.comparisons.len() < 1 << (DIGITS - 1), "more comparisons than can be distinguished");
    let mut takes = vec![0; first.answers.len()];
    for digit in 0..DIGITS {
        let (seen, _) = run(Some(digit), None);
        assert!(
            seen.answers.len() == takes.len() && seen.comparisons.len() == first.comparisons.len(),
            "the work branches on a number"
        );
        takes.iter_mut().zip(seen.answers).for_each(|(own, yes)| *own |= usize::from(yes) << digit);
    }
    let (last, results) = run(None, Some(takes));
    Graph { nodes: last.nodes, results: results.iter().map(|own| own.0).collect() }.needed()
}

impl Graph {
    /// Returns the results for these inputs.
    pub fn run(&self, inputs: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let of = |place: u32| values[place as usize];
            let value = match *node {
                Node::Constant(bits) => f64::from_bits(bits),
                Node::Input(place) => inputs[place],
                Node::One(function, a) => function.of(of(a)),
                Node::Two(operator, a, b) => operator.of(of(a), of(b)),
                Node::Fma(a, b, c) => of(a).mul_add(of(b), of(c)),
                Node::Select { of: [a, b], then: [yes, no] } => of(if of(a) < of(b) { yes } else { no }),
            };
            values.push(value);
        }
        self.results.iter().map(|&place| values[place as usize]).collect()
    }

    /// Removes nodes that no result depends on.
    fn needed(self) -> Graph {
        let mut used = vec![false; self.nodes.len()];
        self.results.iter().for_each(|&place| used[place as usize] = true);
        for place in (0..self.nodes.len()).rev() {
            if used[place] {
                self.nodes[place].each(|before| used[before as usize] = true);
            }
        }
        let mut places = vec![0; self.nodes.len()];
        let mut nodes = Vec::new();
        for (place, mut node) in self.nodes.into_iter().enumerate().filter(|own| used[own.0]) {
            node.each_mut(|before| *before = places[*before as usize]);
            places[place] = nodes.len() as u32;
            nodes.push(node);
        }
        Graph { nodes, results: self.results.iter().map(|&place| places[place as usize]).collect() }
    }
}

impl Node {
    fn each_mut(&mut self, mut see: impl FnMut(&mut u32)) {
        match self {
            Node::Constant(_) | Node::Input(_) => (),
            Node::One(_, a) => see(a),
            Node::Two(_, a, b) => [a, b].into_iter().for_each(see),
            Node::Fma(a, b, c) => [a, b, c].into_iter().for_each(see),
            Node::Select { of, then } => of.iter_mut().chain(then).for_each(see),
        }
    }

    /// Visits the places of the operands.
    pub fn each(mut self, mut see: impl FnMut(u32)) {
        self.each_mut(|place| see(*place));
    }
}

fn recorded(node: Node) -> Traced {
    RECORDING.with_borrow_mut(|own| own.node(node))
}

macro_rules! operators {
    ($($trait:ident $method:ident $assign:ident $assigning:ident $operator:ident;)*) => {$(
        impl $trait for Traced {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                recorded(Node::Two(Operator::$operator, self.0, other.0))
            }
        }
        operators!(assign $trait $method $assign $assigning);
    )*};
    (assign Div $($rest:ident)*) => {};
    (assign $trait:ident $method:ident $assign:ident $assigning:ident) => {
        impl $assign for Traced {
            fn $assigning(&mut self, other: Self) {
                *self = $trait::$method(*self, other);
            }
        }
    };
}
operators! {
    Add add AddAssign add_assign Add;
    Sub sub SubAssign sub_assign Sub;
    Mul mul MulAssign mul_assign Mul;
    Div div DivAssign div_assign Div;
}

impl Neg for Traced {
    type Output = Self;
    fn neg(self) -> Self {
        recorded(Node::One(Function::Neg, self.0))
    }
}

impl From<f64> for Traced {
    fn from(x: f64) -> Self {
        recorded(Node::Constant(x.to_bits()))
    }
}

impl Over<f64> for Traced {}

impl Real for Traced {
    type Mask = bool;

    fn c(x: f64) -> Self {
        Traced::from(x)
    }
    fn fma(self, a: Self, b: Self) -> Self {
        recorded(Node::Fma(self.0, a.0, b.0))
    }
    fn sqrt(self) -> Self {
        recorded(Node::One(Function::Sqrt, self.0))
    }
    fn exp(self) -> Self {
        recorded(Node::One(Function::Exp, self.0))
    }
    fn ln(self) -> Self {
        recorded(Node::One(Function::Ln, self.0))
    }
    fn pow(self, exponent: Self) -> Self {
        recorded(Node::Two(Operator::Pow, self.0, exponent.0))
    }
    fn sin(self) -> Self {
        recorded(Node::One(Function::Sin, self.0))
    }
    fn cos(self) -> Self {
        recorded(Node::One(Function::Cos, self.0))
    }
    fn tanh(self) -> Self {
        recorded(Node::One(Function::Tanh, self.0))
    }
    fn abs(self) -> Self {
        recorded(Node::One(Function::Abs, self.0))
    }
    fn lt(self, other: Self) -> bool {
        RECORDING.with_borrow_mut(|own| {
            own.comparisons.push([self.0, other.0]);
            // Numbers begin at one: zero is a mask that does not come from a comparison.
            own.digit.is_some_and(|digit| own.comparisons.len() >> digit & 1 == 1)
        })
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        RECORDING.with_borrow_mut(|own| {
            own.answers.push(mask);
            let place = own.answers.len() - 1;
            match own.takes.as_ref().map(|takes| takes[place]) {
                // Each choice gets a separate node, so that nothing is left out while comparisons are identified.
                None => own.node(Node::Input(usize::MAX - place)),
                Some(0) => b,
                Some(number) => own.node(Node::Select { of: own.comparisons[number - 1], then: [a.0, b.0] }),
            }
        })
    }
}

impl Number for Traced {
    fn either<M: Memory<Self>>(
        mask: bool,
        memory: &mut M,
        a: impl FnOnce(&mut M) -> Self,
        b: impl FnOnce(&mut M) -> Self,
    ) -> Self {
        let mut other = memory.clone();
        let (of_a, of_b) = (a(memory), b(&mut other));
        let mut others = Vec::new();
        other.each(&mut |own| others.push(*own));
        let mut place = 0;
        memory.each(&mut |own| {
            *own = Traced::select(mask, *own, others[place]);
            place += 1;
        });
        Traced::select(mask, of_a, of_b)
    }
}
