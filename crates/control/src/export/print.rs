//! Programs as C and as structured text.

use super::{Function, Given, Graph, MOVE, Node, Operator, Program, RESULTS, along_a_move};
use std::fmt::Write;

/// A language that programs are printed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C99.
    C,
    /// Structured text of IEC 61131-3.
    St,
}

/// An expression that is used once is written where it is used, up to this length.
const LONGEST: usize = 60;

impl Language {
    /// A number, to the last digit.
    fn constant(self, x: f64) -> String {
        let mut text = format!("{x:?}");
        if let (Language::St, Some((mantissa, exponent))) = (self, text.clone().split_once('e')) {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            text = format!("{mantissa}{point}E{exponent}");
        }
        if text.starts_with('-') { format!("({text})") } else { text }
    }

    fn function(self, function: Function, x: &str) -> String {
        let name = match (self, function) {
            (_, Function::Neg) => return format!("(-{x})"),
            (Language::St, Function::Tanh) => return format!("(1.0 - 2.0 / (EXP(2.0 * {x}) + 1.0))"),
            (Language::C, Function::Abs) => "fabs",
            (Language::C, Function::Ln) => "log",
            (_, Function::Ln) => "ln",
            (_, Function::Abs) => "abs",
            (_, Function::Sqrt) => "sqrt",
            (_, Function::Exp) => "exp",
            (_, Function::Sin) => "sin",
            (_, Function::Cos) => "cos",
            (_, Function::Tanh) => "tanh",
        };
        // An expression in parentheses needs no further parentheses.
        let x = x
            .strip_prefix('(')
            .and_then(|own| own.strip_suffix(')'))
            .filter(|own| is_closed(own))
            .unwrap_or(x);
        format!("{}({x})", if self == Language::C { name.into() } else { name.to_uppercase() })
    }

    fn operator(self, operator: Operator, a: &str, b: &str) -> String {
        let sign = match operator {
            Operator::Add => "+",
            Operator::Sub => "-",
            Operator::Mul => "*",
            Operator::Div => "/",
            Operator::Pow => {
                return format!("{}({a}, {b})", ["pow", "EXPT"][usize::from(self == Language::St)]);
            }
        };
        format!("({a} {sign} {b})")
    }

    fn select(self, [a, b]: [&str; 2], [yes, no]: [&str; 2]) -> String {
        match self {
            Language::C => format!("({a} < {b} ? {yes} : {no})"),
            Language::St => format!("SEL({a} < {b}, {no}, {yes})"),
        }
    }

    fn local(self, place: usize) -> String {
        match self {
            Language::C => format!("t{place}"),
            Language::St => format!("t[{place}]"),
        }
    }

    fn assign(self, local: &str, expression: &str, is_new: bool) -> String {
        let plain =
            expression.strip_prefix('(').and_then(|own| own.strip_suffix(')')).filter(|own| is_closed(own));
        let expression = plain.unwrap_or(expression);
        match self {
            Language::C if is_new => format!("    const double {local} = {expression};\n"),
            Language::C => format!("    {local} = {expression};\n"),
            Language::St => format!("{local} := {expression};\n"),
        }
    }
}

/// Whether each closing parenthesis has one that opens it before.
fn is_closed(text: &str) -> bool {
    let mut depth = 0;
    text.chars().all(|own| {
        depth += i32::from(own == '(') - i32::from(own == ')');
        depth >= 0
    })
}

/// Statements that make the results of a graph; how many locals they have.
fn statements(graph: &Graph, language: Language, inputs: &[String], results: &[String]) -> (String, usize) {
    let mut uses = vec![0; graph.nodes.len()];
    graph.nodes.iter().for_each(|node| node.each(|place| uses[place as usize] += 1));
    let (mut text, mut locals) = (String::new(), 0);
    let mut written: Vec<String> = Vec::with_capacity(graph.nodes.len());
    for (place, node) in graph.nodes.iter().enumerate() {
        let of = |place: u32| written[place as usize].as_str();
        let expression = match *node {
            Node::Constant(bits) => language.constant(f64::from_bits(bits)),
            Node::Input(input) => inputs[input].clone(),
            Node::One(function, a) => language.function(function, of(a)),
            Node::Two(operator, a, b) => language.operator(operator, of(a), of(b)),
            Node::Fma(a, b, c) => format!("({} * {} + {})", of(a), of(b), of(c)),
            Node::Select { of: [a, b], then: [yes, no] } => {
                language.select([of(a), of(b)], [of(yes), of(no)])
            }
        };
        let is_plain = matches!(node, Node::Constant(_) | Node::Input(_));
        if is_plain || (uses[place] == 1 && expression.len() <= LONGEST) {
            written.push(expression);
            continue;
        }
        let local = language.local(locals);
        locals += 1;
        text += &language.assign(&local, &expression, true);
        written.push(local);
    }
    for (result, place) in results.iter().zip(&graph.results) {
        text += &language.assign(result, &written[*place as usize], false);
    }
    (text, locals)
}

impl Program {
    /// Names of the inputs of a piece, in their order.
    fn names(&self, language: Language, remembers: &str, memory: usize) -> Vec<String> {
        let [input, gain] = if language == Language::C { ["in->", "gains->"] } else { ["", ""] };
        let inputs = self.inputs.iter().map(|own| format!("{input}{}", own.name));
        let gains = self.gains.iter().map(|own| format!("{gain}{}", own.0.key));
        inputs.chain(gains).chain(numbered(remembers, memory)).collect()
    }

    fn pieces(&self, language: Language) -> [(String, usize); 3] {
        let [kept, seen] = self.memory;
        let result = if language == Language::C { "out->" } else { "" };
        let of_command = RESULTS.iter().map(|own| format!("{result}{}", own.0)).chain(numbered("kept", kept));
        let of_command: Vec<String> = of_command.collect();
        let of_sample: Vec<String> = numbered("seen", seen).collect();
        [
            statements(&self.begin, language, &self.names(language, "", 0), &of_sample),
            statements(&self.observe, language, &self.names(language, "kept", kept), &of_sample),
            statements(&self.command, language, &self.names(language, "seen", seen), &of_command),
        ]
    }

    /// Its name in code.
    pub fn name(&self) -> String {
        format!("pneudrive_{}", self.law.replace('-', "_"))
    }

    /// Lines that describe the code; `about` is the caller's.
    fn about(&self, about: &str) -> Vec<String> {
        let mut lines = vec![
            format!("Law {} with its observer, made by pneudrive from the equations that it runs itself.", self.law),
            format!("To be called every {} s. The reference is asked for now and {} s later.", self.period, self.ahead),
            "SI units, pressures absolute. Nothing is learned: friction and valve are those of the description.".into(),
            "It is no safety function: limits, faults of sensors and end stops are the caller's.".into(),
        ];
        lines.extend(about.lines().map(String::from));
        lines
    }

    /// Header and source, C99: nothing but `math.h` is needed, nothing is allocated.
    pub fn c(&self, about: &str) -> [String; 2] {
        let (name, [kept, seen]) = (self.name(), self.memory);
        let about: String = self.about(about).iter().map(|line| format!(" * {line}\n")).collect();
        let field = |name: &str, unit: &str, meaning: &str| {
            format!("    double {name};  /* {}: {meaning} */\n", if unit == "1" { "-" } else { unit })
        };
        let inputs: String = self.inputs.iter().map(|own| field(&own.name, own.unit, &own.meaning)).collect();
        let outputs: String = RESULTS.iter().map(|own| field(own.0, own.1, own.2)).collect();
        let gains: String = self.gains.iter().map(|(own, _)| field(own.key, own.unit, own.meaning)).collect();
        let values: Vec<String> = self.gains.iter().map(|own| Language::C.constant(own.1)).collect();
        let guard = format!("{}_H", name.to_uppercase());
        let header = format!(
            "/*\n{about} */\n#ifndef {guard}\n#define {guard}\n\n/* What it is given at a sample. */\ntypedef struct {{\n\
             {inputs}}} {name}_input;\n\ntypedef struct {{\n{outputs}}} {name}_output;\n\n\
             typedef struct {{\n{gains}}} {name}_gains;\n\n\
             /* What it remembers: zero before the first sample. */\n\
             typedef struct {{\n    double begun;\n    double kept[{kept}];\n}} {name}_memory;\n\n\
             /* Gains that follow from the description of the drive. */\n\
             extern const {name}_gains {name}_tuned;\n\n\
             void {name}_step(const {name}_gains *gains, {name}_memory *memory, const {name}_input *in, {name}_output *out);\n\n\
             /* A reference: position, velocity, acceleration and jerk of a move at a time, which stands before and behind. */\n\
             void {name}_move(double start, double target, double begin_time, double duration, double at_time, double wanted[4]);\n\n\
             #endif\n"
        );
        let [begin, observe, command] = self.pieces(Language::C).map(|own| own.0);
        let piece = |title: &str, given: &str, result: &str, text: &str| {
            let mut unused = String::new();
            for own in ["in", "gains"] {
                if !text.contains(&format!("{own}->")) {
                    let _ = writeln!(unused, "    (void){own};");
                }
            }
            format!(
                "static void {title}(const {name}_input *in, const {name}_gains *gains, {given}{result})\n{{\n{unused}{text}}}\n\n"
            )
        };
        let source = format!(
            "#include \"{name}.h\"\n#include <math.h>\n\nconst {name}_gains {name}_tuned = {{ {} }};\n\n{}{}{}\
             void {name}_step(const {name}_gains *gains, {name}_memory *memory, const {name}_input *in, {name}_output *out)\n\
             {{\n    double seen[{seen}];\n\n    if (memory->begun > 0.0) {{\n        observe(in, gains, memory->kept, seen);\n    \
             }} else {{\n        begin(in, gains, seen);\n        memory->begun = 1.0;\n    }}\n    \
             command(in, gains, seen, memory->kept, out);\n}}\n",
            values.join(", "),
            piece("begin", "", "double *seen", &begin),
            piece("observe", "const double *kept, ", "double *seen", &observe),
            piece("command", "const double *seen, ", &format!("double *kept, {name}_output *out"), &command),
        ) + &format!(
            "\nvoid {name}_move(double start, double target, double begin_time, double duration, double at_time, double wanted[4])\n\
             {{\n{}}}\n",
            a_move(Language::C, numbered("wanted", 4).collect()).0,
        );
        [header, source]
    }

    /// A function block in structured text of IEC 61131-3.
    pub fn st(&self, about: &str) -> String {
        let [kept, seen] = self.memory;
        let about: String = self.about(about).iter().map(|line| format!("(* {line} *)\n")).collect();
        let variable = |name: &str, of: &str, unit: &str, meaning: &str| {
            format!("    {name} : {of};  (* {}: {meaning} *)\n", if unit == "1" { "-" } else { unit })
        };
        let inputs: String = self
            .inputs
            .iter()
            .map(|Given { name, unit, meaning }| variable(name, "LREAL", unit, meaning))
            .collect();
        let gains: String = (self.gains.iter())
            .map(|(own, value)| {
                let value = Language::St.constant(*value);
                let value = value.trim_matches(['(', ')']);
                variable(own.key, &format!("LREAL := {value}"), own.unit, own.meaning)
            })
            .collect();
        let outputs: String = RESULTS.iter().map(|own| variable(own.0, "LREAL", own.1, own.2)).collect();
        let pieces = self.pieces(Language::St);
        let locals = pieces.iter().map(|own| own.1).max().unwrap_or(0).max(1);
        let indented = |text: &str| text.lines().map(|line| format!("    {line}\n")).collect::<String>();
        format!(
            "{about}FUNCTION_BLOCK {}\nVAR_INPUT\n{inputs}{gains}END_VAR\nVAR_OUTPUT\n{outputs}END_VAR\nVAR\n    begun : BOOL;\n    \
             kept : ARRAY[0..{}] OF LREAL;\nEND_VAR\nVAR_TEMP\n    seen : ARRAY[0..{}] OF LREAL;\n    t : ARRAY[0..{}] OF LREAL;\n\
             END_VAR\n\nIF begun THEN\n{}ELSE\n{}    begun := TRUE;\nEND_IF;\n{}END_FUNCTION_BLOCK\n",
            self.name().to_uppercase(),
            kept - 1,
            seen - 1,
            locals - 1,
            indented(&pieces[1].0),
            indented(&pieces[0].0),
            pieces[2].0,
        ) + &self.st_move()
    }

    /// A function block that gives a move of a reference.
    fn st_move(&self) -> String {
        let (text, locals) = a_move(Language::St, WANTED.map(String::from).to_vec());
        let list =
            |names: &[&str]| names.iter().map(|own| format!("    {own} : LREAL;\n")).collect::<String>();
        format!(
            "\n(* A reference: a move at a time, which stands before and behind. *)\nFUNCTION_BLOCK {}_MOVE\nVAR_INPUT\n{}END_VAR\n\
             VAR_OUTPUT\n{}END_VAR\nVAR_TEMP\n    t : ARRAY[0..{}] OF LREAL;\nEND_VAR\n\n{text}END_FUNCTION_BLOCK\n",
            self.name().to_uppercase(),
            list(&MOVE),
            list(&WANTED),
            locals.max(1) - 1,
        )
    }
}

/// Results of a move, in this order.
const WANTED: [&str; 4] = ["position", "velocity", "acceleration", "jerk"];

fn a_move(language: Language, results: Vec<String>) -> (String, usize) {
    statements(&along_a_move(), language, &MOVE.map(String::from), &results)
}

/// `name[0]`, `name[1]`, and so on.
fn numbered(name: &str, count: usize) -> impl Iterator<Item = String> + '_ {
    (0..count).map(move |place| format!("{name}[{place}]"))
}
