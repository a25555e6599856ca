//! Numbers that record each operation, from which code in another language is made.
//!
//! A comparison gives a truth value, which cannot record anything. The work therefore runs several times. In each run,
//! one binary digit of a comparison's number decides whether it is true. This shows which comparison a choice depends
//! on.

use crate::number::{Memory, Number};
use formula::Operation;
use math::{Over, Real};
use std::cell::RefCell;
use std::collections::HashMap;

/// An operation on numbers, by the indices of earlier nodes.
pub type Node = Operation<u32>;

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
            Node::Number(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Folds constants, and leaves out operations that change nothing.
    fn simple(&self, node: Node) -> Node {
        let value = |place: u32| self.value(place);
        let is = |place: u32, number: f64| value(place) == Some(number);
        let same = |place: u32| self.nodes[place as usize];
        let arguments = node.arguments();
        if !arguments.is_empty() && arguments.iter().all(|own| value(*own).is_some()) {
            let number = node.value(|own| value(own).expect("a constant"), |_| unreachable!("no argument"));
            return Node::Number(number.to_bits());
        }
        match node {
            Node::Add(a, b) if is(a, 0.0) => same(b),
            Node::Multiply(a, b) if is(a, 1.0) => same(b),
            Node::Add(a, b) | Node::Subtract(a, b) if is(b, 0.0) => same(a),
            Node::Multiply(a, b) | Node::Divide(a, b) if is(b, 1.0) => same(a),
            Node::Fused(a, b, c) if is(a, 1.0) => self.simple(Node::Add(b, c)),
            Node::Fused(a, b, c) if is(b, 1.0) => self.simple(Node::Add(a, c)),
            Node::Fused(a, b, c) if is(c, 0.0) => self.simple(Node::Multiply(a, b)),
            Node::Select(a, b, c, d) => match value(a).zip(value(b)) {
                Some((a, b)) => same(if a < b { c } else { d }),
                None if c == d => same(c),
                None => node,
            },
            _ => node,
        }
    }
}

/// Recorded operations.
#[derive(Clone, Debug)]
pub struct LawGraph {
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
pub fn record(inputs: usize, work: impl Fn(&[Traced]) -> Vec<Traced>) -> LawGraph {
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
    LawGraph { nodes: last.nodes, results: results.iter().map(|own| own.0).collect() }.needed()
}

impl LawGraph {
    /// Returns the results for these inputs.
    pub fn run(&self, inputs: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.nodes.len());
        let input = |node: &Node| match node {
            Node::Input(place) => inputs[*place],
            _ => unreachable!("no parameters are recorded"),
        };
        for node in &self.nodes {
            values.push(node.value(|place: u32| values[place as usize], input));
        }
        self.results.iter().map(|&place| values[place as usize]).collect()
    }

    /// Removes nodes that no result depends on.
    fn needed(self) -> LawGraph {
        let mut used = vec![false; self.nodes.len()];
        self.results.iter().for_each(|&place| used[place as usize] = true);
        for place in (0..self.nodes.len()).rev() {
            if used[place] {
                self.nodes[place].arguments().into_iter().for_each(|before| used[before as usize] = true);
            }
        }
        let mut places = vec![0; self.nodes.len()];
        let mut nodes = Vec::new();
        for (place, node) in self.nodes.into_iter().enumerate().filter(|own| used[own.0]) {
            places[place] = nodes.len() as u32;
            nodes.push(node.map(|before| places[before as usize]));
        }
        LawGraph { nodes, results: self.results.iter().map(|&place| places[place as usize]).collect() }
    }
}

fn recorded(node: Node) -> Traced {
    RECORDING.with_borrow_mut(|own| own.node(node))
}

math::operators!([] Traced, |a, b|
    +: recorded(Node::Add(a.0, b.0)),
    -: recorded(Node::Subtract(a.0, b.0)),
    *: recorded(Node::Multiply(a.0, b.0)),
    /: recorded(Node::Divide(a.0, b.0)),
    neg: recorded(Node::Negative(a.0)),
);

macro_rules! functions {
    ($($name:ident $operation:ident),*) => {
        $(fn $name(self) -> Self {
            recorded(Node::$operation(self.0))
        })*
    };
}

impl From<f64> for Traced {
    fn from(x: f64) -> Self {
        recorded(Node::Number(x.to_bits()))
    }
}

impl Over<f64> for Traced {}

impl Default for Traced {
    fn default() -> Self {
        Traced::from(0.0)
    }
}

impl Real for Traced {
    type Mask = bool;

    fn c(x: f64) -> Self {
        Traced::from(x)
    }
    fn fma(self, a: Self, b: Self) -> Self {
        recorded(Node::Fused(self.0, a.0, b.0))
    }
    fn pow(self, exponent: Self) -> Self {
        recorded(Node::Power(self.0, exponent.0))
    }
    functions! { sqrt Root, exp Exponential, ln Logarithm, sin Sine, cos Cosine, tanh Tangent, abs Size }
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
                Some(number) => {
                    let [low, high] = own.comparisons[number - 1];
                    own.node(Node::Select(low, high, a.0, b.0))
                }
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
        let mut others = others.into_iter();
        memory
            .each(&mut |own| *own = Traced::select(mask, *own, others.next().expect("a number of the copy")));
        Traced::select(mask, of_a, of_b)
    }
}
