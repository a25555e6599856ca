//! What a formula means: its value to the bit, its derivative, its unit, and the one message for what cannot
//! be meant, with its place.

use formula::{Dimension, Graph, Id, Problem, Program, Range, Scope, parse};
use math::{Dual, Lanes, Real};

/// v and z run; Fc, Fs and the rest are parameters, all above zero; n lies between 0.5 and 3.
const INPUTS: [(&str, &str); 3] = [("v", "m/s"), ("z", "m"), ("x", "m")];
const PARAMETERS: [(&str, &str); 6] =
    [("Fc", "N"), ("Fs", "N"), ("vs", "m/s"), ("k", "N/m"), ("n", "-"), ("any", "N")];

fn graph() -> (Graph, Scope) {
    let (mut graph, mut scope) = (Graph::default(), Scope::new());
    for (name, unit) in INPUTS {
        let id = graph.input(Dimension::of_unit(unit).expect("a unit"), Range::ALL);
        scope.insert(name.into(), id);
    }
    for (name, unit) in PARAMETERS {
        let range = match name {
            "n" => Range::closed(0.5, 3.0),
            "any" => Range::ALL,
            _ => Range::new(0.0, f64::INFINITY, [false; 2]),
        };
        let id = graph.parameter(Dimension::of_unit(unit).expect("a unit"), range);
        scope.insert(name.into(), id);
    }
    (graph, scope)
}

fn lowered(formula: &str) -> Result<(Graph, Id), Problem> {
    let (mut graph, scope) = graph();
    let id = graph.lower(&parse(formula)?, &scope)?;
    Ok((graph, id))
}

const VALUES: [f64; 6] = [30.0, 45.0, 0.02, 1e5, 1.3, -7.0];

fn value<S: Real>(formula: &str, inputs: [S; 3], lift: impl Fn(f64) -> S) -> S {
    let (graph, id) = lowered(formula).unwrap_or_else(|problem| panic!("{formula}: {problem}"));
    let program = Program::new(&graph, &[id]).expect("small");
    let mut out = [S::zero()];
    program.run(&program.own(&graph.constants(&VALUES)), lift, |k| inputs[k], &mut out);
    out[0]
}

fn refusal(formula: &str) -> Problem {
    match lowered(formula) {
        Ok(_) => panic!("{formula} is taken"),
        Err(problem) => problem,
    }
}

#[test]
fn a_formula_has_the_bits_of_its_rule() {
    let [fc, fs, vs, k, n, any] = VALUES;
    let (v, z, x) = (0.0137, -2.3e-4, 0.31);
    let weight = Real::exp(-((v * (1.0 / vs)) * (v * (1.0 / vs))));
    let cases: [(&str, f64); 26] = [
        ("1 + 2*3", 7.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("7 - 2 - 1", 4.0),
        ("8/4/2", 1.0),
        ("1.5e-3*v", 1.5e-3 * v),
        ("Fc + (Fs - Fc)*exp(-(v/vs)^2)", (fs - fc).mul_add(weight, fc)),
        ("(Fs - Fc)*exp(-(v/vs)^2) + Fc", (fs - fc).mul_add(weight, fc)),
        ("k*z + any", k.mul_add(z, any)),
        ("k*z + k*x", k.mul_add(x, k * z)),
        ("any - k*z", any - k * z),
        ("k*z/Fs*2", (k * z) * (1.0 / fs) * 2.0),
        ("Fc/(abs(v) + vs)", fc / (v + vs)),
        ("v^3", (v * v) * v),
        ("v^4", (v * v) * (v * v)),
        ("(v^2 + vs^2)^0.5", v.mul_add(0.0, v * v + vs * vs).sqrt()),
        ("max(abs(v)/vs, 1e-12)^n", Real::pow(v * (1.0 / vs), n)),
        ("abs(z)", -z),
        ("sign(v) + 10*sign(z) + 100*sign(x - x)", 10.0_f64.mul_add(-1.0, 1.0)),
        ("min(v, vs)", v),
        ("if(v < vs and not z > 0, Fc, Fs)", fc),
        ("if(v >= vs or x <= z, Fc, Fs)", fs),
        ("fma(k, z, any)", k.mul_add(z, any)),
        ("tanh(v/vs) + ln(n) + sin(n) + cos(n) + sqrt(n)", {
            Real::tanh(v * (1.0 / vs)) + Real::ln(n) + Real::sin(n) + Real::cos(n) + n.sqrt()
        }),
        ("max(0, -Fc)", 0.0),
    ];
    for (formula, expected) in cases {
        let found = value(formula, [v, z, x], |p| p);
        assert_eq!(found.to_bits(), expected.to_bits(), "{formula}: {found} {expected}");
    }
}

#[test]
fn derivatives_belong_to_the_values_and_lanes_are_scalars() {
    let formulas = [
        "Fc + (Fs - Fc)*exp(-(v/vs)^2)",
        "max(abs(v)/vs, 1e-12)^n*k*z",
        "tanh(v/vs)*sqrt(v^2 + vs^2)/(1 + (v/vs)^2)",
        "ln(1 + abs(v)/vs)*cos(x*k/Fs*1e-3) + sin(k*z/Fc)",
        "min(k*z, Fc*tanh(v/vs)) - max(k*z, any)*0.3",
    ];
    let points = [[0.0137, -2.3e-4, 0.31], [-0.3, 1e-4, 0.05], [1e-3, 2e-4, 0.4], [-2e-4, -5e-5, 0.11]];
    for formula in formulas {
        for point in points {
            for i in 0..3 {
                let inputs =
                    std::array::from_fn(|j| Dual { re: point[j], eps: [f64::from(u8::from(i == j))] });
                let dual: Dual<f64, 1> = value(formula, inputs, Dual::from);
                let h = 1e-6 * point[i].abs();
                let moved = |h: f64| {
                    value(formula, std::array::from_fn(|j| point[j] + if i == j { h } else { 0.0 }), |p| p)
                };
                let difference = (moved(h) - moved(-h)) / (2.0 * h);
                let bound = 1e-6 * difference.abs() + 1e-14 * dual.re.abs().max(1.0) / h;
                assert!(
                    (dual.eps[0] - difference).abs() < bound,
                    "{formula} by {i}: {} {difference}",
                    dual.eps[0]
                );
            }
        }
        let lanes = value(
            formula,
            std::array::from_fn(|j| Lanes(std::array::from_fn::<f64, 4, _>(|l| points[l][j]))),
            Lanes::c,
        );
        for (l, point) in points.into_iter().enumerate() {
            assert_eq!(lanes.0[l].to_bits(), value(formula, point, |p| p).to_bits(), "{formula}");
        }
    }
}

#[test]
fn what_cannot_be_meant_has_one_message_with_its_place() {
    // formula, piece under the caret, what the message says, what the remedy says
    let cases = [
        ("Fc + vz*k", "vz", "the name 'vz' is unknown", "Did you mean 'v'?"),
        ("Fc*exq(1)", "exq", "the function 'exq' is unknown", "Did you mean 'exp'?"),
        ("Fc + v", "Fc + v", "+ needs the same unit on both sides, not N and m/s", ""),
        ("Fc - 1", "Fc - 1", "- needs the same unit on both sides, not N and a pure number", ""),
        ("Fc + k*v", "Fc + k*v", "not N and N/s", ""),
        ("exp(v)", "v", "exp needs a pure number, not m/s", "Divide by a parameter"),
        ("v^n", "v", "not m/s", "Divide by a parameter"),
        ("2^v", "v", "an exponent needs a pure number, not m/s", ""),
        ("max(v, z)", "v, z", "max needs the same unit", ""),
        ("Fc/v", "v", "this divisor can be zero: its known range is any number", "max(x, 0.01*coulomb)"),
        ("1/(Fs - Fc)", "(Fs - Fc)", "this divisor can be zero", "above = 0"),
        ("if(v > 0, 1/v, 0)", "v", "this divisor can be zero", "Both sides of an if are always computed"),
        ("v^-2", "v", "this divisor can be zero", ""),
        ("ln(abs(v)/vs)", "abs(v)/vs", "ln needs a value above zero", "max(x, 1e-12)"),
        ("(abs(v)/vs)^n", "(abs(v)/vs)", "needs a value above zero", ""),
        ("sqrt(v^2)", "v^2", "sqrt needs a value above zero", "sqrt(v^2 + v0^2)"),
        ("2 v", "v", "a sign is missing before this", "2*v"),
        ("2v", "2v", "\"2v\" is neither a number nor a name", "2*v"),
        ("1 mm", "mm", "a sign is missing", ""),
        ("(v + v", "(", "this ( is not closed", "Add a )."),
        ("v + v)", ")", "this ) has no matching (", ""),
        ("v +", "", "the formula ends too early", "missing here"),
        ("v + * z", "*", "a value is missing before *", ""),
        ("v**2", "**", "a power is written ^", "x^2"),
        ("v = 2", "=", "the character '=' has no meaning here", "Conditions"),
        ("v < z", "v < z", "a condition is not a value", "if(condition"),
        ("if(v, 1, 2)", "v", "this is not a condition", "Compare"),
        ("if(v < 0 < z, 1, 2)", "v < 0", "comparisons are not chained", "a < b and b < c"),
        ("min(v)", "min(v)", "min takes 2 arguments, not 1", ""),
        ("exp + 1", "exp", "'exp' is a function", "Write exp(...)."),
        ("Fc(1)", "Fc", "'Fc' is not a function", "A product needs its sign"),
        ("1e999", "1e999", "too large", ""),
        ("v²", "²", "has no meaning", "^2"),
    ];
    for (formula, piece, what, remedy) in cases {
        let problem = refusal(formula);
        assert!(problem.what.contains(what), "{formula}: {}", problem.what);
        assert!(problem.remedy.contains(remedy), "{formula}: {}", problem.remedy);
        let place = problem.place.expect("a place");
        let found: String = formula.chars().skip(place.start).take(place.end - place.start).collect();
        assert_eq!(found, piece, "{formula}");
    }
    let deep = format!("{}v{}", "(".repeat(70), ")".repeat(70));
    assert!(refusal(&deep).what.contains("nested deeper than 60"));
    assert!(refusal(&"v + ".repeat(2000)).what.contains("8000 characters, more than the limit 4000"));
    assert!(refusal(" \n ").what.contains("empty"));
    let (line, column, text, caret) =
        refusal("Fc +\n  Fs*vv + 1").shown("Fc +\n  Fs*vv + 1").expect("a place");
    assert_eq!((line, column, &*text, &*caret), (2, 6, "  Fs*vv + 1", "     ^^"));
}

#[test]
fn what_stays_away_from_zero_is_seen_to() {
    for divisor in [
        "Fc",
        "Fc + Fs",
        "Fc + (Fs - Fc)*exp(-(v/vs)^2)",
        "(Fs - Fc)*(1/(1 + (v/vs)^2)) + Fc",
        "Fs*exp(-(v/vs)^2) + Fc*(1 - exp(-(v/vs)^2))",
        "max(any, 0.01*Fc)",
        "-Fc - abs(k*z)",
        "1 + v^2/vs^2",
        "2 + sin(k*z/Fc)",
        "if(v < 0, Fc, Fs)",
        "Fc*(1.5 + tanh(v/vs))",
        "sqrt(v^2 + vs^2)",
        "n - 0.4",
        "n*Fc",
    ] {
        lowered(&format!("1/({divisor})")).unwrap_or_else(|problem| panic!("{divisor}: {problem}"));
    }
    for divisor in [
        "Fc + (Fs - Fc)*tanh(v/vs)",
        "any",
        "n - 0.5",
        "exp(-(v/vs)^2)",
        "sign(v)",
        "Fc*sin(n)",
        "min(Fc, any)",
    ] {
        assert!(refusal(&format!("1/({divisor})")).what.contains("can be zero"), "{divisor}");
    }
}

#[test]
fn units_are_read_and_named() {
    let same = [
        ("N", "kg m/s2"),
        ("Pa", "N/m2"),
        ("W/(m2 K)", "kg/s^3/K"),
        ("N s/m", "kg/s"),
        ("1/s", "Hz"),
        ("-", "rad"),
        ("m^2", "m·m"),
        ("1/Pa", "m2/N"),
    ];
    for (a, b) in same {
        assert_eq!(Dimension::of_unit(a), Dimension::of_unit(b), "{a} {b}");
    }
    assert_ne!(Dimension::of_unit("N"), Dimension::of_unit("N/m"));
    for unit in ["mm", "bar", "N//m", "m^x", "s/", "N m)"] {
        assert!(Dimension::of_unit(unit).is_err(), "{unit}");
    }
    let shown = |unit: &str| Dimension::of_unit(unit).expect("a unit").to_string();
    assert_eq!([shown("kg m/s2"), shown("-"), shown("kg m3/(s K2)")], ["N", "a pure number", "m3 kg/(s K2)"]);
}

/// A random text: pieces of formulas, or any characters at all.
fn random_text(state: &mut u64) -> String {
    const PIECES: [&str; 38] = [
        "v", "z", "x", "Fc", "Fs", "vs", "k", "n", "any", "0", "1", "2.5", "1e-3", ".5", "+", "-", "*", "/",
        "^", "(", ")", ",", "<", ">=", " and ", " or ", "not ", "if(", "exp(", "ln(", "sqrt(", "max(",
        "abs(", "pow(", "fma(", "sign(", "é", "\n",
    ];
    let mut next = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as usize
    };
    let length = next() % 24;
    let wild = next().is_multiple_of(8);
    (0..length)
        .map(|_| match wild {
            true => char::from_u32((next() % 0x300) as u32).unwrap_or('?').to_string(),
            false => PIECES[next() % PIECES.len()].to_string(),
        })
        .collect()
}

/// A random formula that is one.
fn random_formula(next: &mut impl FnMut() -> usize, depth: usize) -> String {
    let leaf = ["v/vs", "k*z/Fc", "n", "0.3", "2", "x*k/Fs", "any/Fc"];
    if depth == 0 || next().is_multiple_of(4) {
        return leaf[next() % leaf.len()].into();
    }
    let (a, b) = (random_formula(next, depth - 1), random_formula(next, depth - 1));
    match next() % 12 {
        0 | 1 => format!("({a} + {b})"),
        2 => format!("({a} - {b})"),
        3 | 4 => format!("({a})*({b})"),
        5 => format!("({a})/(1 + ({b})^2)"),
        6 => format!("tanh({a})"),
        7 => format!("max({a}, {b})"),
        8 => format!("sqrt(0.1 + abs({a}))"),
        9 => format!("if({a} < {b}, {b}, {a})"),
        10 => format!("sin({a})"),
        _ => format!("({a})^3"),
    }
}

#[test]
fn no_text_brings_it_down() {
    let mut state = 1;
    let mut taken = 0;
    for _ in 0..100_000 {
        let text = random_text(&mut state);
        match lowered(&text) {
            Ok((graph, id)) => {
                let program = Program::new(&graph, &[id]).expect("small");
                let mut out = [0.0];
                program.run(
                    &program.own(&graph.constants(&VALUES)),
                    |p| p,
                    |k| [0.01, 1e-4, 0.2][k],
                    &mut out,
                );
                taken += 1;
            }
            Err(problem) => drop(problem.shown(&text)),
        }
    }
    assert!(taken > 1000, "{taken} were formulas");
}

/// What is proved not to be zero is none, wherever it is looked at; registers are not mixed up, as a graph that
/// is computed node by node gives the same bits.
#[test]
fn random_formulas_keep_to_their_range() {
    let mut state: u64 = 7;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut proved = 0;
    for _ in 0..3000 {
        let formula = random_formula(&mut next, 4);
        if lowered(&formula).is_err() {
            continue;
        }
        let not_zero = lowered(&format!("1/({formula})")).is_ok();
        proved += usize::from(not_zero);
        for point in [[0.0, 0.0, 0.0], [0.0137, -2.3e-4, 0.31], [-3.0, 1e-3, -0.2]] {
            let found = value(&formula, point, |p| p);
            assert!(!not_zero || found != 0.0, "{formula} at {point:?}");
            let negative = value(&format!("-({formula}) + 0"), point, |p| p);
            assert!(found.is_nan() || found == -negative, "{formula}: {found} {negative}");
        }
    }
    assert!(proved > 100, "{proved}");
}
