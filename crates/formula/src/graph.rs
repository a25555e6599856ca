use crate::dimension::Dimension;
use crate::range::Range;
use math::Real;
use std::collections::{BTreeMap, HashMap};

/// A node of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub(crate) usize);

/// Largest number of nodes of a graph.
pub(crate) const MOST_NODES: usize = 2000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operation {
    /// Bits of a number.
    Number(u64),
    Parameter(usize),
    Input(usize),
    Negative(Id),
    Add(Id, Id),
    Subtract(Id, Id),
    Multiply(Id, Id),
    Divide(Id, Id),
    /// a b + c, rounded once.
    Fused(Id, Id, Id),
    Size(Id),
    Root(Id),
    Exponential(Id),
    Logarithm(Id),
    Tangent(Id),
    Sine(Id),
    Cosine(Id),
    Power(Id, Id),
    Least(Id, Id),
    Greatest(Id, Id),
    /// c if a < b, else d.
    Select(Id, Id, Id, Id),
}

impl Operation {
    pub(crate) fn arguments(&self) -> Vec<Id> {
        use Operation::*;
        match *self {
            Number(_) | Parameter(_) | Input(_) => vec![],
            Negative(a) | Size(a) | Root(a) | Exponential(a) | Logarithm(a) | Tangent(a) | Sine(a)
            | Cosine(a) => {
                vec![a]
            }
            Add(a, b)
            | Subtract(a, b)
            | Multiply(a, b)
            | Divide(a, b)
            | Power(a, b)
            | Least(a, b)
            | Greatest(a, b) => vec![a, b],
            Fused(a, b, c) => vec![a, b, c],
            Select(a, b, c, d) => vec![a, b, c, d],
        }
    }

    /// Returns the value, given the values of the arguments. `given` has the values of parameters and inputs.
    #[inline(always)]
    pub(crate) fn value<S: Real>(&self, of: impl Fn(Id) -> S, given: impl Fn(&Operation) -> S) -> S {
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
