//! Programs as C and as structured text.

use super::guard::{GUARD, STATUS};
use super::{Function, Given, Graph, MOVE, Node, Operator, Program, RESULTS, along_a_move};

/// Output language of a program.
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
    /// Returns a number with all digits.
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
            (Language::C, Function::Sqrt) => "sqrt",
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
        match self {
            Language::C if name == "sqrt" => format!("sqrt({x})"),
            Language::C => format!("pneudrive_{name}({x})"),
            Language::St => format!("{}({x})", name.to_uppercase()),
        }
    }

    fn operator(self, operator: Operator, a: &str, b: &str) -> String {
        let sign = match operator {
            Operator::Add => "+",
            Operator::Sub => "-",
            Operator::Mul => "*",
            Operator::Div => "/",
            Operator::Pow => {
                return format!("{}({a}, {b})", ["pneudrive_pow", "EXPT"][usize::from(self == Language::St)]);
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

/// Returns whether each closing parenthesis follows an opening one.
fn is_closed(text: &str) -> bool {
    let mut depth = 0;
    text.chars().all(|own| {
        depth += i32::from(own == '(') - i32::from(own == ')');
        depth >= 0
    })
}

/// Returns the statements that compute the results of a graph, and their number of locals.
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
            // The core rounds once here. Structured text has no function for it.
            Node::Fma(a, b, c) if language == Language::C => format!("fma({}, {}, {})", of(a), of(b), of(c)),
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

/// Statements of a piece, and their number of locals.
type Piece = (String, usize);

/// Pieces of a step.
struct Pieces {
    check: Piece,
    begin: Piece,
    observe: Piece,
    command: Piece,
}

impl Program {
    /// Names of inputs, parameters and stored numbers of a piece, in their order.
    fn names(&self, language: Language, is_checked: bool, remembers: (&str, usize)) -> Vec<String> {
        let [input, parameter] = match (language, is_checked) {
            (Language::C, _) => ["in->", "parameters->"],
            (Language::St, false) => ["", ""],
            (Language::St, true) => ["checked_", ""],
        };
        let inputs = self.inputs.iter().map(|own| format!("{input}{}", own.name));
        let parameters = self.parameters.iter().map(|own| format!("{parameter}{}", own.0.name));
        inputs.chain(parameters).chain(numbered(remembers.0, remembers.1)).collect()
    }

    fn pieces(&self, language: Language) -> Pieces {
        let [kept, seen] = self.memory;
        let [result, checked] = if language == Language::C { ["out->", "checked->"] } else { ["", ""] };
        let to = if language == Language::C { "checked->in." } else { "checked_" };
        let flags = [format!("{checked}opens"), format!("{checked}begins"), format!("{result}status")];
        let inputs = self.inputs.iter().map(|own| format!("{to}{}", own.name));
        let of_check: Vec<String> = flags.into_iter().chain(inputs).chain(numbered("guard", GUARD)).collect();
        let of_command = RESULTS.iter().map(|own| format!("{result}{}", own.0)).chain(numbered("kept", kept));
        let of_command: Vec<String> = of_command.collect();
        let of_sample: Vec<String> = numbered("seen", seen).collect();
        let piece = |graph: &Graph, is_checked: bool, remembers: (&str, usize), results: &[String]| {
            statements(graph, language, &self.names(language, is_checked, remembers), results)
        };
        Pieces {
            check: piece(&self.check, false, ("before", GUARD + 1), &of_check),
            begin: piece(&self.begin, true, ("", 0), &of_sample),
            observe: piece(&self.observe, true, ("kept", kept), &of_sample),
            command: piece(&self.command, true, ("seen", seen), &of_command),
        }
    }

    /// Name in the code.
    pub fn name(&self) -> String {
        format!("pneudrive_{}", self.law.replace('-', "_"))
    }

    /// Returns the lines that describe the code. The caller supplies `about`.
    fn about(&self, about: &str) -> Vec<String> {
        let mut lines = vec![
            format!("Controller {} with its observer, made by pneudrive from its own equations.", self.law),
            format!("Call it every {} s. It needs the reference now and {} s later.", self.period, self.ahead),
            "SI units, pressures absolute. Nothing is learned: friction and valve are those of the description.".into(),
            "Sensors and reference are checked. It is not a safety function, and it does not brake before an end stop.".into(),
        ];
        lines.extend(STATUS.iter().map(|(value, meaning)| format!("status {value}: {meaning}")));
        lines.extend(about.lines().map(String::from));
        lines
    }

    /// C99 files, name and text each: header, source, and elementary functions. They allocate nothing, open no file, and
    /// need two functions of a C library, `fma` and `sqrt`, which IEEE 754 rounds correctly.
    pub fn c(&self, about: &str) -> [(String, String); 3] {
        let name = self.name();
        [
            (format!("{name}.h"), self.c_header(about)),
            (format!("{name}.c"), self.c_source()),
            ("pneudrive_math.h".into(), include_str!("elementary.h").into()),
        ]
    }

    fn c_header(&self, about: &str) -> String {
        let (name, kept) = (self.name(), self.memory[0]);
        let about: String = self.about(about).iter().map(|line| format!(" * {line}\n")).collect();
        let field = |name: &str, unit: &str, meaning: &str| {
            format!("    double {name};  /* {}: {meaning} */\n", if unit == "1" { "-" } else { unit })
        };
        let given = |own: &Given| field(&own.name, own.unit, &own.meaning);
        let inputs: String = self.inputs.iter().map(given).collect();
        let outputs: String = RESULTS.iter().map(|own| field(own.0, own.1, own.2)).collect();
        let parameters: String = self.parameters.iter().map(|own| given(&own.0)).collect();
        let guard = format!("{}_H", name.to_uppercase());
        format!(
            "/*\n{about} */\n#ifndef {guard}\n#define {guard}\n\n/* Inputs of a sample. */\ntypedef struct {{\n\
             {inputs}}} {name}_input;\n\ntypedef struct {{\n{outputs}    double status;  /* -: see above */\n}} {name}_output;\n\n\
             typedef struct {{\n{parameters}}} {name}_parameters;\n\n\
             /* State: all zero before the first sample. */\n\
             typedef struct {{\n    double guard[{}];\n    double kept[{kept}];\n}} {name}_memory;\n\n\
             /* Parameters that follow from the description of the drive. */\n\
             extern const {name}_parameters {name}_tuned;\n\n\
             void {name}_step(const {name}_parameters *parameters, {name}_memory *memory, const {name}_input *in, {name}_output *out);\n\n\
             /* A reference: position, velocity, acceleration and jerk of a move at a time. It rests before and after. */\n\
             void {name}_move(double start, double target, double begin_time, double duration, double at_time, double wanted[4]);\n\n\
             #endif\n",
            GUARD + 1
        )
    }

    fn c_source(&self) -> String {
        let (name, [_, seen]) = (self.name(), self.memory);
        let values: Vec<String> = self.parameters.iter().map(|own| Language::C.constant(own.1)).collect();
        let Pieces { check, begin, observe, command } = self.pieces(Language::C);
        let piece = |title: &str, given: &str, result: &str, (text, _): &Piece| {
            let unused: String = ["in", "parameters"]
                .iter()
                .filter(|own| !text.contains(&format!("{own}->")))
                .map(|own| format!("    (void){own};\n"))
                .collect();
            format!(
                "static void {title}(const {name}_input *in, const {name}_parameters *parameters, {given}{result})\n{{\n{unused}{text}}}\n\n"
            )
        };
        format!(
            "#include \"{name}.h\"\n#include \"pneudrive_math.h\"\n\nconst {name}_parameters {name}_tuned = {{ {} }};\n\n\
             typedef struct {{\n    {name}_input in;\n    double opens;\n    double begins;\n}} {name}_checked;\n\n{}{}{}{}",
            values.join(", "),
            piece(
                "check",
                "const double *before, ",
                &format!("{name}_checked *checked, double *guard, {name}_output *out"),
                &check
            ),
            piece("begin", "", "double *seen", &begin),
            piece("observe", "const double *kept, ", "double *seen", &observe),
            piece("command", "const double *seen, ", &format!("double *kept, {name}_output *out"), &command),
        ) + &format!(
            "void {name}_step(const {name}_parameters *parameters, {name}_memory *memory, const {name}_input *in, {name}_output *out)\n\
             {{\n    {name}_checked checked;\n    double before[{0}];\n    double seen[{seen}];\n    int i;\n\n    \
             for (i = 0; i < {0}; i++) {{\n        before[i] = memory->guard[i];\n    }}\n    \
             check(in, parameters, before, &checked, memory->guard, out);\n    if (0.5 < checked.opens) {{\n        \
             if (0.5 < checked.begins) {{\n            begin(&checked.in, parameters, seen);\n        }} else {{\n            \
             observe(&checked.in, parameters, memory->kept, seen);\n        }}\n        \
             command(&checked.in, parameters, seen, memory->kept, out);\n    }} else {{\n{1}    }}\n    \
             memory->guard[{2}] = out->velocity;\n}}\n\n\
             void {name}_move(double start, double target, double begin_time, double duration, double at_time, double wanted[4])\n\
             {{\n{3}}}\n",
            GUARD + 1,
            RESULTS.iter().map(|own| format!("        out->{} = 0.0;\n", own.0)).collect::<String>(),
            GUARD,
            a_move(Language::C, numbered("wanted", 4).collect()).0,
        )
    }

    /// A function block in structured text of IEC 61131-3.
    pub fn st(&self, about: &str) -> String {
        let [kept, seen] = self.memory;
        let about: String = self.about(about).iter().map(|line| format!("(* {line} *)\n")).collect();
        let variable = |name: &str, of: &str, unit: &str, meaning: &str| {
            format!("    {name} : {of};  (* {}: {meaning} *)\n", if unit == "1" { "-" } else { unit })
        };
        let inputs: String =
            self.inputs.iter().map(|own| variable(&own.name, "LREAL", own.unit, &own.meaning)).collect();
        let parameters: String = (self.parameters.iter())
            .map(|(own, value)| {
                let value = Language::St.constant(*value);
                let value = value.trim_matches(['(', ')']);
                variable(&own.name, &format!("LREAL := {value}"), own.unit, &own.meaning)
            })
            .collect();
        let outputs: String = RESULTS.iter().map(|own| variable(own.0, "LREAL", own.1, own.2)).collect();
        let checked: String =
            self.inputs.iter().map(|own| format!("    checked_{} : LREAL;\n", own.name)).collect();
        let Pieces { check, begin, observe, command } = self.pieces(Language::St);
        let locals =
            [&check, &begin, &observe, &command].map(|own| own.1).into_iter().max().unwrap_or(0).max(1);
        let indented = |text: &str, by: usize| {
            text.lines().map(|line| format!("{}{line}\n", "    ".repeat(by))).collect::<String>()
        };
        let rests: String = RESULTS.iter().map(|own| format!("    {} := 0.0;\n", own.0)).collect();
        let copied: String =
            (0..=GUARD).map(|place| format!("before[{place}] := guard[{place}];\n")).collect();
        format!(
            "{about}FUNCTION_BLOCK {}\nVAR_INPUT\n{inputs}{parameters}END_VAR\nVAR_OUTPUT\n{outputs}    status : LREAL;  (* -: see above *)\n\
             END_VAR\nVAR\n    guard : ARRAY[0..{GUARD}] OF LREAL;\n    kept : ARRAY[0..{}] OF LREAL;\nEND_VAR\nVAR_TEMP\n{checked}    \
             opens : LREAL;\n    begins : LREAL;\n    before : ARRAY[0..{GUARD}] OF LREAL;\n    seen : ARRAY[0..{}] OF LREAL;\n    \
             t : ARRAY[0..{}] OF LREAL;\nEND_VAR\n\n{copied}{}IF 0.5 < opens THEN\n    IF 0.5 < begins THEN\n{}    ELSE\n{}    END_IF;\n\
             {}ELSE\n{rests}END_IF;\nguard[{GUARD}] := velocity;\nEND_FUNCTION_BLOCK\n",
            self.name().to_uppercase(),
            kept - 1,
            seen - 1,
            locals - 1,
            check.0,
            indented(&begin.0, 2),
            indented(&observe.0, 2),
            indented(&command.0, 1),
        ) + &self.st_move()
    }

    /// A function block that computes a move of a reference.
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
