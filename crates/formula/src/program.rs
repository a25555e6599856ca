use crate::graph::{Graph, Id, Operation};
use crate::problem::Problem;
use math::Real;

/// Largest number of intermediate values at the same time in an evaluation.
pub const MOST_REGISTERS: usize = 256;

/// Operations on numbered registers. The first registers hold constants, followed by the used inputs. A later register
/// is reused as soon as its value is no longer needed.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<ProgramStep>,
    registers: usize,
    /// Nodes of the graph in the first registers.
    constants: Vec<usize>,
    /// Inputs in the next registers.
    inputs: Vec<usize>,
    outputs: Vec<u8>,
}

/// An operation on registers, and the register of its result.
#[derive(Clone, Copy, Debug)]
struct ProgramStep {
    operation: Operation<u8>,
    to: u8,
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
            if graph.is_input(*id) {
                continue;
            }
            let operation_on_registers = operation.map(|a| register[a.0].expect("computed before"));
            let arguments = operation.arguments().into_iter().zip(operation_on_registers.arguments());
            let mut ended: Vec<usize> = arguments
                .filter(|(a, register)| last[a.0] == id.0 && *register >= fixed)
                .map(|(_, register)| register)
                .collect();
            ended.sort_unstable();
            ended.dedup();
            free.extend(ended);
            let to = free.pop().unwrap_or_else(|| {
                next += 1;
                next - 1
            });
            register[id.0] = Some(to);
            steps.push((operation_on_registers, to));
        }
        if next > MOST_REGISTERS {
            let what = format!("the law needs {next} values at the same time, more than {MOST_REGISTERS}");
            return Err(Problem::of_all(what, "Simplify it."));
        }
        let byte = |register: usize| u8::try_from(register).expect("within MOST_REGISTERS");
        let steps = steps
            .into_iter()
            .map(|(operation, to)| ProgramStep { operation: operation.map(byte), to: byte(to) });
        let outputs = outputs.iter().map(|id| byte(register[id.0].expect("computed"))).collect();
        Ok(Program { steps: steps.collect(), registers: next, constants, inputs, outputs })
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

fn execute<S: Real>(steps: &[ProgramStep], registers: &mut [S]) {
    for ProgramStep { operation, to } in steps {
        let value =
            operation.value(|of| registers[usize::from(of)], |_| unreachable!("in its register before"));
        registers[usize::from(*to)] = value;
    }
}
