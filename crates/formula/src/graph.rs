use crate::dimension::Dimension;
use crate::range::Range;
use math::Real;
use std::collections::{BTreeMap, HashMap};

/// A node of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub(crate) usize);

/// Largest number of nodes of a graph.
pub(crate) const MOST_NODES: usize = 2000;

/// Lists the operations, each with its value from those of its arguments `A`, and its meaning.
macro_rules! operations {
    ($($name:ident($($argument:ident: $type:ident),*) = $value:expr, $meaning:literal;)*) => {
        /// An operation on values: nodes of a graph, or registers of a program.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Operation<A = Id> {
            /// Bits of a number.
            Number(u64),
            /// A parameter, by its index.
            Parameter(usize),
            /// An input, by its index.
            Input(usize),
            $(#[doc = $meaning] $name($($type),*),)*
        }

        impl<A: Copy> Operation<A> {
            /// Returns the same operation on other values.
            pub fn map<B>(&self, mut of: impl FnMut(A) -> B) -> Operation<B> {
                match *self {
                    Operation::Number(bits) => Operation::Number(bits),
                    Operation::Parameter(index) => Operation::Parameter(index),
                    Operation::Input(index) => Operation::Input(index),
                    $(Operation::$name($($argument),*) => Operation::$name($(of($argument)),*),)*
                }
            }

            /// Returns the value, given the values of the arguments. `given` has the values of parameters and inputs.
            #[inline(always)]
            pub fn value<S: Real>(&self, of: impl Fn(A) -> S, given: impl Fn(&Self) -> S) -> S {
                match *self {
                    Operation::Number(bits) => S::c(f64::from_bits(bits)),
                    Operation::Parameter(_) | Operation::Input(_) => given(self),
                    $(Operation::$name($($argument),*) => {
                        $(let $argument = of($argument);)*
                        $value
                    })*
                }
            }
        }
    };
}

operations! {
    Negative(a: A) = -a, "Negative of a.";
    Add(a: A, b: A) = a + b, "a + b.";
    Subtract(a: A, b: A) = a - b, "a - b.";
    Multiply(a: A, b: A) = a * b, "a b.";
    Divide(a: A, b: A) = a / b, "a / b.";
    Fused(a: A, b: A, c: A) = a.fma(b, c), "a b + c, rounded once.";
    Size(a: A) = a.abs(), "Size of a.";
    Root(a: A) = a.sqrt(), "Square root of a.";
    Exponential(a: A) = a.exp(), "Exponential function of a.";
    Logarithm(a: A) = a.ln(), "Natural logarithm of a.";
    Tangent(a: A) = a.tanh(), "Hyperbolic tangent of a.";
    Sine(a: A) = a.sin(), "Sine of a.";
    Cosine(a: A) = a.cos(), "Cosine of a.";
    Power(a: A, b: A) = a.pow(b), "a to the power b.";
    Least(a: A, b: A) = a.min(b), "Smaller one of a and b.";
    Greatest(a: A, b: A) = a.max(b), "Greater one of a and b.";
    Select(a: A, b: A, c: A, d: A) = S::select(a.lt(b), c, d), "c if a < b, else d.";
}

impl<A: Copy> Operation<A> {
    /// Returns its arguments in order.
    pub fn arguments(&self) -> Vec<A> {
        let mut all = Vec::new();
        self.map(|argument| all.push(argument));
        all
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
