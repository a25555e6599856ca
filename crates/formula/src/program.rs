use crate::graph::{Graph, Id, Operation};
use crate::problem::Problem;
use math::Real;

/// Largest number of intermediate values at the same time in an evaluation.
pub const MOST_REGISTERS: usize = 256;

/// Operations on numbered registers. The first registers hold constants, followed by the used inputs. A later register
/// is reused as soon as its value is no longer needed.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<Step>,
    registers: usize,
    /// Nodes of the graph in the first registers.
    constants: Vec<usize>,
    /// Inputs in the next registers.
    inputs: Vec<usize>,
    outputs: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    code: Code,
    to: u8,
    of: [u8; 4],
}

#[derive(Clone, Copy, Debug)]
#[repr(u8)]
enum Code {
    Negative,
    Add,
    Subtract,
    Multiply,
    Divide,
    Fused,
    Size,
    Root,
    Exponential,
    Logarithm,
    Tangent,
    Sine,
    Cosine,
    Power,
    Least,
    Greatest,
    Select,
}

impl Code {
    /// `None` for values that exist before the program runs.
    fn of(operation: &Operation) -> Option<Code> {
        Some(match operation {
            Operation::Number(_) | Operation::Parameter(_) | Operation::Input(_) => return None,
            Operation::Negative(_) => Code::Negative,
            Operation::Add(..) => Code::Add,
            Operation::Subtract(..) => Code::Subtract,
            Operation::Multiply(..) => Code::Multiply,
            Operation::Divide(..) => Code::Divide,
            Operation::Fused(..) => Code::Fused,
            Operation::Size(_) => Code::Size,
            Operation::Root(_) => Code::Root,
            Operation::Exponential(_) => Code::Exponential,
            Operation::Logarithm(_) => Code::Logarithm,
            Operation::Tangent(_) => Code::Tangent,
            Operation::Sine(_) => Code::Sine,
            Operation::Cosine(_) => Code::Cosine,
            Operation::Power(..) => Code::Power,
            Operation::Least(..) => Code::Least,
            Operation::Greatest(..) => Code::Greatest,
            Operation::Select(..) => Code::Select,
        })
    }
}

/// Returns the constants that the operations or the outputs use.
fn constants(graph: &Graph, reached: &[Id], outputs: &[Id]) -> Vec<usize> {
    let varies = |id: &Id| !graph.at(*id).constant;
    let is_used = |id: &Id| {
        let uses = |other: &Id| varies(other) && graph.at(*other).operation.arguments().contains(id);
        outputs.contains(id) || reached.iter().any(uses)
    };
    reached.iter().filter(|id| !varies(id) && is_used(id)).map(|id| id.0).collect()
}

/// Returns the last operation that uses each value; an output is used to the end.
fn last_uses(graph: &Graph, reached: &[Id], outputs: &[Id]) -> Vec<usize> {
    let mut last = vec![0; graph.nodes.len()];
    for id in reached {
        for argument in graph.at(*id).operation.arguments() {
            last[argument.0] = id.0;
        }
    }
    for id in outputs {
        last[id.0] = usize::MAX;
    }
    last
}

impl Program {
    /// Computes `outputs`.
    pub fn new(graph: &Graph, outputs: &[Id]) -> Result<Self, Problem> {
        let reached = graph.reached(outputs);
        let varies = |id: &Id| !graph.at(*id).constant;
        let constants = constants(graph, &reached, outputs);
        let mut register = vec![None; graph.nodes.len()];
        let mut inputs = Vec::new();
        let mut next = 0;
        for id in &constants {
            register[*id] = Some(next);
            next += 1;
        }
        for id in &reached {
            if let Operation::Input(k) = graph.at(*id).operation {
                inputs.push(k);
                register[id.0] = Some(next);
                next += 1;
            }
        }
        let fixed = next;
        let last = last_uses(graph, &reached, outputs);
        let (mut free, mut steps) = (Vec::new(), Vec::new());
        for id in reached.iter().filter(|id| varies(id)) {
            let operation = graph.at(*id).operation;
            let Some(code) = Code::of(&operation) else { continue };
            let arguments = operation.arguments();
            let of: Vec<usize> = arguments.iter().map(|a| register[a.0].expect("computed before")).collect();
            let mut ended: Vec<usize> = arguments
                .iter()
                .zip(&of)
                .filter(|(a, register)| last[a.0] == id.0 && **register >= fixed)
                .map(|(_, register)| *register)
                .collect();
            ended.sort_unstable();
            ended.dedup();
            free.extend(ended);
            let to = free.pop().unwrap_or_else(|| {
                next += 1;
                next - 1
            });
            register[id.0] = Some(to);
            steps.push((code, to, of));
        }
        if next > MOST_REGISTERS {
            let what = format!("the law needs {next} values at the same time, more than {MOST_REGISTERS}");
            return Err(Problem::of_all(what, "Simplify it."));
        }
        let byte = |register: usize| u8::try_from(register).expect("within MOST_REGISTERS");
        let steps = steps.into_iter().map(|(code, to, of)| {
            let of = std::array::from_fn(|i| of.get(i).map_or(0, |register| byte(*register)));
            Step { code, to: byte(to), of }
        });
        let outputs = outputs.iter().map(|id| byte(register[id.0].expect("computed"))).collect();
        Ok(Program { steps: steps.collect(), registers: next, constants, inputs, outputs })
    }

    /// Returns the number of operations.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Returns whether the program is empty.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Returns the constants of this program, from all of [`Graph::constants`].
    pub fn own<P: Real>(&self, constants: &[P]) -> Vec<P> {
        self.constants.iter().map(|id| constants[*id]).collect()
    }

    /// Runs with its constants, lifted by `lift`, and the inputs. Writes the outputs.
    #[inline]
    pub fn run<P: Real, S: Real>(
        &self,
        own: &[P],
        lift: impl Fn(P) -> S,
        input: impl Fn(usize) -> S,
        out: &mut [S],
    ) {
        match self.registers {
            0..=16 => self.run_in::<16, P, S>(own, lift, input, out),
            17..=64 => self.run_in::<64, P, S>(own, lift, input, out),
            _ => self.run_in::<MOST_REGISTERS, P, S>(own, lift, input, out),
        }
    }

    #[inline]
    fn run_in<const N: usize, P: Real, S: Real>(
        &self,
        own: &[P],
        lift: impl Fn(P) -> S,
        input: impl Fn(usize) -> S,
        out: &mut [S],
    ) {
        let mut registers = [S::zero(); N];
        for (register, constant) in registers.iter_mut().zip(own) {
            *register = lift(*constant);
        }
        for (register, k) in registers[own.len()..].iter_mut().zip(&self.inputs) {
            *register = input(*k);
        }
        execute(&self.steps, &mut registers);
        for (out, register) in out.iter_mut().zip(&self.outputs) {
            *out = registers[usize::from(*register)];
        }
    }
}

fn execute<S: Real>(steps: &[Step], r: &mut [S]) {
    for step in steps {
        let [a, b, c, d] = step.of.map(usize::from);
        r[usize::from(step.to)] = match step.code {
            Code::Negative => -r[a],
            Code::Add => r[a] + r[b],
            Code::Subtract => r[a] - r[b],
            Code::Multiply => r[a] * r[b],
            Code::Divide => r[a] / r[b],
            Code::Fused => r[a].fma(r[b], r[c]),
            Code::Size => r[a].abs(),
            Code::Root => r[a].sqrt(),
            Code::Exponential => r[a].exp(),
            Code::Logarithm => r[a].ln(),
            Code::Tangent => r[a].tanh(),
            Code::Sine => r[a].sin(),
            Code::Cosine => r[a].cos(),
            Code::Power => r[a].pow(r[b]),
            Code::Least => r[a].min(r[b]),
            Code::Greatest => r[a].max(r[b]),
            Code::Select => S::select(r[a].lt(r[b]), r[c], r[d]),
        };
    }
}
