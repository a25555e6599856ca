//! Programs as C and as structured text.

use super::guard::{GUARD, STATUS};
use super::{ExportVariable, LawGraph, LawProgram, MOVE, Node, RESULTS, along_a_move};

/// Output language of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// The language C99.
    C,
    /// C99 in single precision, with the elementary functions of the C library.
    Single,
    /// Structured text of IEC 61131-3.
    St,
}

/// An expression that is used once is written where it is used, up to this length.
const LONGEST: usize = 60;

/// Returns a source with its gaps filled: `@name@` stands for a text.
///
/// # Panics
///
/// The source names a gap that has no text.
fn filled(source: &str, gaps: &[(&str, String)]) -> String {
    let gap = |name| gaps.iter().find(|own| own.0 == name).expect("a text for each gap").1.as_str();
    source.split('@').enumerate().map(|(i, text)| if i % 2 == 0 { text } else { gap(text) }).collect()
}

/// Returns an expression without the parentheses around it.
fn bare(expression: &str) -> &str {
    let is_closed = |text: &&str| {
        let mut depth = 0;
        text.chars().all(|own| {
            depth += i32::from(own == '(') - i32::from(own == ')');
            depth >= 0
        })
    };
    let inside = expression.strip_prefix('(').and_then(|own| own.strip_suffix(')'));
    inside.filter(is_closed).unwrap_or(expression)
}

impl Language {
    /// Returns a number with all digits.
    fn constant(self, x: f64) -> String {
        let mut text = format!("{x:?}");
        if let (Language::St, Some((mantissa, exponent))) = (self, text.clone().split_once('e')) {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            text = format!("{mantissa}{point}E{exponent}");
        }
        if self == Language::Single {
            text = format!("{:?}f", (x as f32).clamp(f32::MIN, f32::MAX));
        }
        if text.starts_with('-') { format!("({text})") } else { text }
    }

    fn call(self, function: &str, x: &str) -> String {
        let x = bare(x);
        match (self, function) {
            (Language::C, "sqrt") => format!("sqrt({x})"),
            (Language::C, _) => format!("pneudrive_{function}({x})"),
            (Language::Single, "abs") => format!("fabsf({x})"),
            (Language::Single, "ln") => format!("logf({x})"),
            (Language::Single, _) => format!("{function}f({x})"),
            (Language::St, "pow") => format!("EXPT({x})"),
            (Language::St, _) => format!("{}({x})", function.to_uppercase()),
        }
    }

    /// Returns the expression of an operation, given those of its arguments.
    fn expression(self, node: &Node, inputs: &[String], written: &[String]) -> String {
        let of = |place: u32| written[place as usize].as_str();
        let pair = |a: u32, sign: &str, b: u32| format!("({} {sign} {})", of(a), of(b));
        match (self, *node) {
            (_, Node::Number(bits)) => self.constant(f64::from_bits(bits)),
            (_, Node::Input(input)) => inputs[input].clone(),
            (_, Node::Negative(a)) => format!("(-{})", of(a)),
            (_, Node::Add(a, b)) => pair(a, "+", b),
            (_, Node::Subtract(a, b)) => pair(a, "-", b),
            (_, Node::Multiply(a, b)) => pair(a, "*", b),
            (_, Node::Divide(a, b)) => pair(a, "/", b),
            (_, Node::Power(a, b)) => self.call("pow", &[a, b].map(of).join(", ")),
            // The core rounds once here. Structured text has no function for it.
            (Language::St, Node::Fused(a, b, c)) => format!("({} * {} + {})", of(a), of(b), of(c)),
            (_, Node::Fused(a, b, c)) => self.call("fma", &[a, b, c].map(of).join(", ")),
            (Language::St, Node::Select(a, b, c, d)) => {
                format!("SEL({} < {}, {}, {})", of(a), of(b), of(d), of(c))
            }
            (_, Node::Select(a, b, c, d)) => format!("({} < {} ? {} : {})", of(a), of(b), of(c), of(d)),
            (Language::St, Node::Tangent(a)) => format!("(1.0 - 2.0 / (EXP(2.0 * {}) + 1.0))", of(a)),
            (_, Node::Tangent(a)) => self.call("tanh", of(a)),
            (_, Node::Size(a)) => self.call("abs", of(a)),
            (_, Node::Root(a)) => self.call("sqrt", of(a)),
            (_, Node::Exponential(a)) => self.call("exp", of(a)),
            (_, Node::Logarithm(a)) => self.call("ln", of(a)),
            (_, Node::Sine(a)) => self.call("sin", of(a)),
            (_, Node::Cosine(a)) => self.call("cos", of(a)),
            (_, Node::Parameter(_) | Node::Least(..) | Node::Greatest(..)) => {
                unreachable!("no law records it")
            }
        }
    }

    /// Returns the type of a number.
    fn real(self) -> &'static str {
        match self {
            Language::C => "double",
            Language::Single => "float",
            Language::St => "LREAL",
        }
    }

    fn local(self, place: usize) -> String {
        match self {
            Language::St => format!("t[{place}]"),
            _ => format!("t{place}"),
        }
    }

    fn assign(self, local: &str, expression: &str, is_new: bool) -> String {
        let expression = bare(expression);
        match self {
            Language::St => format!("{local} := {expression};\n"),
            _ if is_new => format!("    const {} {local} = {expression};\n", self.real()),
            _ => format!("    {local} = {expression};\n"),
        }
    }

    /// Returns the declaration of a variable, with a start value if there is one.
    fn variable(self, (name, unit, meaning): &ExportVariable, start: Option<f64>) -> String {
        let unit = if *unit == "1" { "-" } else { unit };
        let start = start.map(|value| format!(" := {}", bare(&self.constant(value)))).unwrap_or_default();
        match self {
            Language::St => format!("    {name} : LREAL{start};  (* {unit}: {meaning} *)\n"),
            _ => format!("    {} {name};  /* {unit}: {meaning} */\n", self.real()),
        }
    }
}

/// Statements, and their number of locals.
type Piece = (String, usize);

/// Returns the statements that compute the results of a graph.
fn statements(graph: &LawGraph, language: Language, inputs: &[String], results: &[String]) -> Piece {
    let mut uses = vec![0; graph.nodes.len()];
    graph.nodes.iter().flat_map(Node::arguments).for_each(|place| uses[place as usize] += 1);
    let (mut text, mut locals) = (String::new(), 0);
    let mut written: Vec<String> = Vec::with_capacity(graph.nodes.len());
    for (node, uses) in graph.nodes.iter().zip(uses) {
        let mut expression = language.expression(node, inputs, &written);
        let is_plain = matches!(node, Node::Number(_) | Node::Input(_));
        if !is_plain && (uses != 1 || expression.len() > LONGEST) {
            let local = language.local(locals);
            locals += 1;
            text += &language.assign(&local, &expression, true);
            expression = local;
        }
        written.push(expression);
    }
    for (result, place) in results.iter().zip(&graph.results) {
        text += &language.assign(result, &written[*place as usize], false);
    }
    (text, locals)
}

impl LawProgram {
    /// Names of inputs, parameters and stored numbers of a piece, in their order.
    fn names(&self, language: Language, is_checked: bool, remembers: (&str, usize)) -> Vec<String> {
        let [input, parameter] = match (language, is_checked) {
            (Language::St, false) => ["", ""],
            (Language::St, true) => ["checked_", ""],
            _ => ["in->", "parameters->"],
        };
        let inputs = self.inputs.iter().map(|own| format!("{input}{}", own.0));
        let parameters = self.parameters.iter().map(|(own, _)| format!("{parameter}{}", own.0));
        inputs.chain(parameters).chain(numbered(remembers.0, remembers.1)).collect()
    }

    /// Returns the pieces of a step: check, begin, observe, command.
    fn pieces(&self, language: Language) -> [Piece; 4] {
        let [kept, seen] = self.memory;
        let [result, checked, to] = match language {
            Language::St => ["", "", "checked_"],
            _ => ["out->", "checked->", "checked->in."],
        };
        let flags = [format!("{checked}opens"), format!("{checked}begins"), format!("{result}status")];
        let inputs = self.inputs.iter().map(|own| format!("{to}{}", own.0));
        let of_check: Vec<String> = flags.into_iter().chain(inputs).chain(numbered("guard", GUARD)).collect();
        let of_command = RESULTS.iter().map(|own| format!("{result}{}", own.0)).chain(numbered("kept", kept));
        let of_command: Vec<String> = of_command.collect();
        let of_sample: Vec<String> = numbered("seen", seen).collect();
        let piece = |graph: &LawGraph, is_checked: bool, remembers: (&str, usize), results: &[String]| {
            statements(graph, language, &self.names(language, is_checked, remembers), results)
        };
        [
            piece(&self.check, false, ("before", GUARD + 1), &of_check),
            piece(&self.begin, true, ("kept", kept), &of_sample),
            piece(&self.observe, true, ("kept", kept), &of_sample),
            piece(&self.command, true, ("seen", seen), &of_command),
        ]
    }

    /// Returns the texts of all gaps that do not depend on the pieces. The caller supplies `about`.
    fn gaps(&self, language: Language, about: &str) -> Vec<(&'static str, String)> {
        let (name, [kept, seen]) = (&self.name, self.memory);
        let lines = [
            format!("Controller {} with its observer, made by pneudrive from its own equations.", self.law),
            format!("Call it every {} s. It needs the reference now and {} s later.", self.period, self.ahead),
            "SI units, pressures absolute. The learned values stay when the drive is disabled. Set the memory to zeros to forget them.".into(),
            "Sensors and reference are checked. It is not a safety function, and it does not brake before an end stop.".into(),
        ];
        let status = STATUS.iter().map(|(value, meaning)| format!("status {value}: {meaning}"));
        let lines = lines.into_iter().chain(status).chain(about.lines().map(String::from));
        let comment = |line: String| match language {
            Language::St => format!("(* {line} *)\n"),
            _ => format!(" * {line}\n"),
        };
        vec![
            ("NAME", name.to_uppercase()),
            ("name", name.clone()),
            ("real", language.real().into()),
            ("about", lines.map(comment).collect()),
            ("inputs", self.inputs.iter().map(|own| language.variable(own, None)).collect()),
            (
                "parameters",
                self.parameters.iter().map(|(own, value)| language.variable(own, Some(*value))).collect(),
            ),
            ("outputs", RESULTS.iter().map(|own| language.variable(own, None)).collect()),
            ("checks", (GUARD + 1).to_string()),
            ("last_check", GUARD.to_string()),
            ("kept", kept.to_string()),
            ("last_kept", (kept - 1).to_string()),
            ("seen", seen.to_string()),
            ("last_seen", (seen - 1).to_string()),
        ]
    }

    /// C99 files, name and text each: header, source, and elementary functions. They allocate nothing and open no file. In double
    /// precision, they need two functions of a C library, `fma` and `sqrt`, which IEEE 754 rounds correctly.
    ///
    /// # Panics
    ///
    /// The language is structured text.
    pub fn c(&self, language: Language, about: &str) -> [(String, String); 3] {
        let (name, mut gaps) = (&self.name, self.gaps(language, about));
        let values: Vec<String> = self.parameters.iter().map(|own| language.constant(own.1)).collect();
        for (piece, (text, _)) in
            ["check", "begin", "observe", "command"].into_iter().zip(self.pieces(language))
        {
            let unused = ["in", "parameters"].into_iter().filter(|own| !text.contains(&format!("{own}->")));
            let unused: String = unused.map(|own| format!("    (void){own};\n")).collect();
            gaps.push((piece, unused + &text));
        }
        gaps.extend([
            ("values", values.join(", ")),
            ("rests", RESULTS.iter().map(|own| format!("        out->{} = 0;\n", own.0)).collect()),
            ("move", a_move(language, numbered("wanted", 4).collect()).0),
        ]);
        let functions = match language {
            Language::C => include_str!("elementary.h"),
            Language::Single => "#include <math.h>\n",
            Language::St => unreachable!("a language of C"),
        };
        [
            (format!("{name}.h"), filled(include_str!("step.h"), &gaps)),
            (format!("{name}.c"), filled(include_str!("step.c"), &gaps)),
            ("pneudrive_math.h".into(), functions.into()),
        ]
    }

    /// Function blocks in structured text of IEC 61131-3: the controller, and a move of a reference.
    pub fn st(&self, about: &str) -> String {
        let mut gaps = self.gaps(Language::St, about);
        let pieces = self.pieces(Language::St);
        let locals = pieces.iter().map(|own| own.1).max().unwrap_or(0);
        let indented = |text: &str, by: usize| {
            text.lines().map(|line| format!("{}{line}\n", "    ".repeat(by))).collect::<String>()
        };
        let [check, begin, observe, command] = pieces.map(|own| own.0);
        let (a_move, locals_of_move) = a_move(Language::St, WANTED.map(String::from).to_vec());
        let list =
            |names: &[&str]| names.iter().map(|own| format!("    {own} : LREAL;\n")).collect::<String>();
        gaps.extend([
            ("check", check),
            ("begin", indented(&begin, 2)),
            ("observe", indented(&observe, 2)),
            ("command", indented(&command, 1)),
            ("checked", self.inputs.iter().map(|own| format!("    checked_{} : LREAL;\n", own.0)).collect()),
            ("copied", (0..=GUARD).map(|place| format!("before[{place}] := guard[{place}];\n")).collect()),
            ("rests", RESULTS.iter().map(|own| format!("    {} := 0.0;\n", own.0)).collect()),
            ("last_local", (locals.max(1) - 1).to_string()),
            ("move_inputs", list(&MOVE)),
            ("wanted", list(&WANTED)),
            ("last_local_of_move", (locals_of_move.max(1) - 1).to_string()),
            ("move", a_move),
        ]);
        filled(include_str!("step.st"), &gaps)
    }
}

/// Results of a move, in this order.
const WANTED: [&str; 4] = ["position", "velocity", "acceleration", "jerk"];

fn a_move(language: Language, results: Vec<String>) -> Piece {
    statements(&along_a_move(), language, &MOVE.map(String::from), &results)
}

/// `name[0]`, `name[1]`, and so on.
fn numbered(name: &str, count: usize) -> impl Iterator<Item = String> + '_ {
    (0..count).map(move |place| format!("{name}[{place}]"))
}
