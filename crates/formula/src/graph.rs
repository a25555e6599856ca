use crate::dimension::Dimension;
use crate::range::Range;
use math::Real;
use std::collections::{BTreeMap, HashMap};

/// A node of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub(crate) usize);

/// Largest number of nodes of a graph.
pub(crate) const MOST_NODES: usize = 2000;

/// An operation on values: nodes of a graph, or registers of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation<A = Id> {
    /// Bits of a number.
    Number(u64),
    /// A parameter, by its index.
    Parameter(usize),
    /// An input, by its index.
    Input(usize),
    /// Negative of a.
    Negative(A),
    /// a + b.
    Add(A, A),
    /// a - b.
    Subtract(A, A),
    /// a b.
    Multiply(A, A),
    /// a / b.
    Divide(A, A),
    /// a b + c, rounded once.
    Fused(A, A, A),
    /// Size of a.
    Size(A),
    /// Square root of a.
    Root(A),
    /// Exponential function of a.
    Exponential(A),
    /// Natural logarithm of a.
    Logarithm(A),
    /// Hyperbolic tangent of a.
    Tangent(A),
    /// Sine of a.
    Sine(A),
    /// Cosine of a.
    Cosine(A),
    /// a to the power b.
    Power(A, A),
    /// Smaller one of a and b.
    Least(A, A),
    /// Greater one of a and b.
    Greatest(A, A),
    /// c if a < b, else d.
    Select(A, A, A, A),
}

impl<A: Copy> Operation<A> {
    /// Returns the same operation on other values.
    pub fn map<B>(&self, mut of: impl FnMut(A) -> B) -> Operation<B> {
        use Operation::*;
        match *self {
            Number(bits) => Number(bits),
            Parameter(index) => Parameter(index),
            Input(index) => Input(index),
            Negative(a) => Negative(of(a)),
            Add(a, b) => Add(of(a), of(b)),
            Subtract(a, b) => Subtract(of(a), of(b)),
            Multiply(a, b) => Multiply(of(a), of(b)),
            Divide(a, b) => Divide(of(a), of(b)),
            Fused(a, b, c) => Fused(of(a), of(b), of(c)),
            Size(a) => Size(of(a)),
            Root(a) => Root(of(a)),
            Exponential(a) => Exponential(of(a)),
            Logarithm(a) => Logarithm(of(a)),
            Tangent(a) => Tangent(of(a)),
            Sine(a) => Sine(of(a)),
            Cosine(a) => Cosine(of(a)),
            Power(a, b) => Power(of(a), of(b)),
            Least(a, b) => Least(of(a), of(b)),
            Greatest(a, b) => Greatest(of(a), of(b)),
            Select(a, b, c, d) => Select(of(a), of(b), of(c), of(d)),
        }
    }

    /// Returns its arguments in order.
    pub fn arguments(&self) -> Vec<A> {
        let mut all = Vec::new();
        self.map(|argument| all.push(argument));
        all
    }

    /// Returns the value, given the values of the arguments. `given` has the values of parameters and inputs.
    #[inline(always)]
    pub fn value<S: Real>(&self, of: impl Fn(A) -> S, given: impl Fn(&Self) -> S) -> S {
        use Operation::*;
        match *self {
            Number(bits) => S::c(f64::from_bits(bits)),
            Parameter(_) | Input(_) => given(self),
            Negative(a) => -of(a),
            Add(a, b) => of(a) + of(b),
            Subtract(a, b) => of(a) - of(b),
            Multiply(a, b) => of(a) * of(b),
            Divide(a, b) => of(a) / of(b),
            Fused(a, b, c) => of(a).fma(of(b), of(c)),
            Size(a) => of(a).abs(),
            Root(a) => of(a).sqrt(),
            Exponential(a) => of(a).exp(),
            Logarithm(a) => of(a).ln(),
            Tangent(a) => of(a).tanh(),
            Sine(a) => of(a).sin(),
            Cosine(a) => of(a).cos(),
            Power(a, b) => of(a).pow(of(b)),
            Least(a, b) => of(a).min(of(b)),
            Greatest(a, b) => of(a).max(of(b)),
            Select(a, b, c, d) => S::select(of(a).lt(of(b)), of(c), of(d)),
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub operation: Operation,
    /// `None` for the number zero, which has every dimension.
    pub dimension: Option<Dimension>,
    pub range: Range,
    /// Whether it consists of parameters and numbers only.
    pub constant: bool,
}

/// The values that formulas compute, each once, in an order in which they can be computed.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    pub(crate) nodes: Vec<Node>,
    known: HashMap<Operation, Id>,
    parameters: usize,
    inputs: usize,
}

/// Meanings of names.
pub type Scope = BTreeMap<String, Id>;

impl Graph {
    /// A constant of the law. Parameters are numbered in the order of creation.
    pub fn parameter(&mut self, dimension: Dimension, range: Range) -> Id {
        self.parameters += 1;
        let operation = Operation::Parameter(self.parameters - 1);
        self.node(Node { operation, dimension: Some(dimension), range, constant: true })
    }

    /// A variable of an evaluation. Inputs are numbered in the order of creation.
    pub fn input(&mut self, dimension: Dimension, range: Range) -> Id {
        self.inputs += 1;
        let operation = Operation::Input(self.inputs - 1);
        self.node(Node { operation, dimension: Some(dimension), range, constant: false })
    }

    /// Returns the existing node of the same value, or adds it.
    pub(crate) fn node(&mut self, node: Node) -> Id {
        if let Some(id) = self.known.get(&node.operation) {
            return *id;
        }
        let id = Id(self.nodes.len());
        self.known.insert(node.operation, id);
        self.nodes.push(node);
        id
    }

    pub(crate) fn at(&self, id: Id) -> &Node {
        &self.nodes[id.0]
    }

    /// Returns the dimension of a node, or `None` if it is open.
    pub fn dimension(&self, id: Id) -> Option<Dimension> {
        self.at(id).dimension
    }

    /// Returns whether a node is an input.
    pub fn is_input(&self, id: Id) -> bool {
        matches!(self.at(id).operation, Operation::Input(_))
    }

    /// Returns the number of a constant node.
    pub fn number(&self, id: Id) -> Option<f64> {
        match self.at(id).operation {
            Operation::Number(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns all nodes that these values are computed from, including themselves, in order.
    pub fn reached(&self, from: &[Id]) -> Vec<Id> {
        let mut needed = vec![false; self.nodes.len()];
        for id in from {
            needed[id.0] = true;
        }
        for i in (0..self.nodes.len()).rev() {
            if needed[i] {
                for argument in self.nodes[i].operation.arguments() {
                    needed[argument.0] = true;
                }
            }
        }
        (0..self.nodes.len()).filter(|i| needed[*i]).map(Id).collect()
    }

    /// Returns the values of all nodes that consist of parameters and numbers only. Others are zero.
    pub fn constants<P: Real>(&self, parameters: &[P]) -> Vec<P> {
        let mut values = vec![P::zero(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().filter(|(_, node)| node.constant) {
            let given = |operation: &Operation| match operation {
                Operation::Parameter(k) => parameters[*k],
                _ => unreachable!("a constant has no inputs"),
            };
            values[i] = node.operation.value(|id| values[id.0], given);
        }
        values
    }
}
