//! Translation of an expression to nodes of a graph: names, dimensions, ranges, rounding.

use crate::dimension::Dimension;
use crate::graph::{Graph, Id, MOST_NODES, Node, Operation, Scope};
use crate::parse::{Expression, Kind};
use crate::problem::{Place, Problem, nearest};
use crate::range::Range;

/// Functions and their numbers of arguments.
const FUNCTIONS: [(&str, usize); 14] = [
    ("abs", 1),
    ("sign", 1),
    ("sqrt", 1),
    ("exp", 1),
    ("ln", 1),
    ("tanh", 1),
    ("sin", 1),
    ("cos", 1),
    ("min", 2),
    ("max", 2),
    ("pow", 2),
    ("fma", 3),
    ("if", 3),
    ("select", 3),
];

/// Powers up to this one are products.
const MOST_FACTORS: f64 = 32.0;

type Lowered = Result<Id, Problem>;

impl Graph {
    /// Returns the value of an expression.
    pub fn lower(&mut self, expression: &Expression, scope: &Scope) -> Lowered {
        if self.nodes.len() > MOST_NODES {
            let what = format!("the law has more than {MOST_NODES} operations");
            return Err(Problem::new(what, expression.place, "Simplify it."));
        }
        let place = expression.place;
        match &expression.kind {
            Kind::Number(value) => Ok(self.constant(*value)),
            Kind::Name(name) => named(name, scope, place),
            Kind::Negative(of) => {
                let of = self.lower(of, scope)?;
                Ok(self.negative(of))
            }
            Kind::Pair("+", sides) => self.sum(sides, scope),
            Kind::Pair(sign @ ("-" | "*" | "/" | "^"), sides) => {
                let [a, b] = self.both(sides, scope)?;
                match *sign {
                    "-" => {
                        self.alike(a, b, "-", sides)?;
                        Ok(self.subtract(a, b))
                    }
                    "*" => Ok(self.multiply(a, b)),
                    "/" => self.divide(a, b, sides[1].place),
                    _ => self.power(a, b, [sides[0].place, sides[1].place]),
                }
            }
            Kind::Pair(..) | Kind::Not(_) => {
                let remedy = "Write if(condition, value where it holds, value where it does not).";
                Err(Problem::new("a condition is not a value", place, remedy))
            }
            Kind::Call(name, arguments) => self.call(name, arguments, place, scope),
        }
    }

    fn both(&mut self, sides: &[Expression; 2], scope: &Scope) -> Result<[Id; 2], Problem> {
        Ok([self.lower(&sides[0], scope)?, self.lower(&sides[1], scope)?])
    }

    /// a*b + c and c + a*b are rounded once.
    fn sum(&mut self, sides: &[Expression; 2], scope: &Scope) -> Lowered {
        let factors = |side: &'_ Expression| match &side.kind {
            Kind::Pair("*", factors) => Some((**factors).clone()),
            _ => None,
        };
        let [left, right] = sides;
        let (product, other) = match (factors(left), factors(right)) {
            (_, Some(product)) => (product, left),
            (Some(product), None) => (product, right),
            (None, None) => {
                let [a, b] = self.both(sides, scope)?;
                self.alike(a, b, "+", sides)?;
                return Ok(self.add(a, b));
            }
        };
        let c = self.lower(other, scope)?;
        let [a, b] = self.both(&product, scope)?;
        let whole = self.multiplied(a, b);
        let (first, second) =
            if std::ptr::eq(other, left) { (self.dimension(c), whole) } else { (whole, self.dimension(c)) };
        same(first, second, "+", sides)?;
        Ok(self.fused(a, b, c))
    }

    fn call(&mut self, name: &str, arguments: &[Expression], place: Place, scope: &Scope) -> Lowered {
        let Some((_, count)) = FUNCTIONS.iter().find(|(known, _)| *known == name) else {
            let function = Place { start: place.start, end: place.start + name.chars().count() };
            if scope.contains_key(name) {
                let what = format!("'{name}' is not a function");
                return Err(Problem::new(what, function, "A product needs its sign: a*(b + c)."));
            }
            let remedy = nearest(name, FUNCTIONS.iter().map(|(known, _)| *known));
            return Err(Problem::new(format!("the function '{name}' is unknown"), function, remedy));
        };
        if arguments.len() != *count {
            let plural = if *count == 1 { "" } else { "s" };
            let what = format!("{name} takes {count} argument{plural}, not {}", arguments.len());
            return Err(Problem::new(what, place, ""));
        }
        if matches!(name, "if" | "select") {
            let a = self.lower(&arguments[1], scope)?;
            let b = self.lower(&arguments[2], scope)?;
            self.alike(a, b, name, &[arguments[1].clone(), arguments[2].clone()])?;
            return self.choose(&arguments[0], a, b, scope);
        }
        let values =
            arguments.iter().map(|argument| self.lower(argument, scope)).collect::<Result<Vec<_>, _>>()?;
        self.function(name, &values, arguments)
    }

    fn function(&mut self, name: &str, values: &[Id], arguments: &[Expression]) -> Lowered {
        let a = values[0];
        let place = arguments[0].place;
        let range = self.at(a).range;
        match name {
            "abs" => Ok(self.make(Operation::Size(a), self.dimension(a), range.size())),
            "sign" => {
                let [one, zero, minus] = [1.0, 0.0, -1.0].map(|x| self.constant(x));
                let positive = self.select(zero, a, one, zero);
                Ok(self.select(a, zero, minus, positive))
            }
            "sqrt" => self.root(a, place),
            "min" | "max" => {
                self.alike(a, values[1], name, &[arguments[0].clone(), arguments[1].clone()])?;
                let dimension = self.dimension(a).or(self.dimension(values[1]));
                let other = self.at(values[1]).range;
                Ok(match name {
                    "min" => self.make(Operation::Least(a, values[1]), dimension, range.min(other)),
                    _ => self.make(Operation::Greatest(a, values[1]), dimension, range.max(other)),
                })
            }
            "pow" => self.power(a, values[1], [place, arguments[1].place]),
            "fma" => {
                let (product, c) = (self.multiplied(a, values[1]), self.dimension(values[2]));
                same(product, c, "fma", &[arguments[0].clone(), arguments[2].clone()])?;
                Ok(self.fused(a, values[1], values[2]))
            }
            _ => {
                self.pure(a, name, place)?;
                self.elementary(name, a, place)
            }
        }
    }

    /// Functions of pure numbers.
    fn elementary(&mut self, name: &str, a: Id, place: Place) -> Lowered {
        let range = self.at(a).range;
        let (operation, range) = match name {
            "exp" => (Operation::Exponential(a), range.saturating(f64::exp, 0.0, f64::INFINITY)),
            "ln" => {
                self.above_zero(a, "ln", place)?;
                (Operation::Logarithm(a), range.through(f64::ln))
            }
            "tanh" => (Operation::Tangent(a), range.saturating(f64::tanh, -1.0, 1.0)),
            "sin" => (Operation::Sine(a), Range::closed(-1.0, 1.0)),
            _ => (Operation::Cosine(a), Range::closed(-1.0, 1.0)),
        };
        Ok(self.make(operation, Some(Dimension::NONE), range))
    }

    /// `a` if the condition holds, else `b`.
    fn choose(&mut self, condition: &Expression, a: Id, b: Id, scope: &Scope) -> Lowered {
        match &condition.kind {
            Kind::Pair("and", sides) => {
                let inner = self.choose(&sides[1], a, b, scope)?;
                self.choose(&sides[0], inner, b, scope)
            }
            Kind::Pair("or", sides) => {
                let inner = self.choose(&sides[1], a, b, scope)?;
                self.choose(&sides[0], a, inner, scope)
            }
            Kind::Not(of) => self.choose(of, b, a, scope),
            Kind::Pair(sign @ ("<" | ">" | "<=" | ">="), sides) => {
                let [x, y] = self.both(sides, scope)?;
                self.alike(x, y, sign, sides)?;
                Ok(match *sign {
                    "<" => self.select(x, y, a, b),
                    ">" => self.select(y, x, a, b),
                    "<=" => self.select(y, x, b, a),
                    _ => self.select(x, y, b, a),
                })
            }
            _ => {
                let remedy = "Compare two values with <, <=, > or >=; join with and, or, not.";
                Err(Problem::new("this is not a condition", condition.place, remedy))
            }
        }
    }

    // --- operations ---------------------------------------------------------------------------

    fn make(&mut self, operation: Operation, dimension: Option<Dimension>, range: Range) -> Id {
        let arguments = operation.arguments();
        let constant = arguments.iter().all(|id| self.at(*id).constant);
        if arguments.iter().all(|id| self.number(*id).is_some()) {
            let value =
                operation.value(|id| self.number(id).expect("a number"), |_| unreachable!("no input"));
            if value.is_finite() {
                return self.constant(value);
            }
        }
        self.node(Node { operation, dimension, range, constant })
    }

    /// A number. Zero has every dimension, and other numbers are pure.
    fn constant(&mut self, value: f64) -> Id {
        let value = value + 0.0; // no minus nought
        let dimension = (value != 0.0).then_some(Dimension::NONE);
        let operation = Operation::Number(value.to_bits());
        self.node(Node { operation, dimension, range: Range::of(value), constant: true })
    }

    fn negative(&mut self, a: Id) -> Id {
        self.make(Operation::Negative(a), self.dimension(a), self.at(a).range.negative())
    }

    fn add(&mut self, a: Id, b: Id) -> Id {
        let dimension = self.dimension(a).or(self.dimension(b));
        self.make(Operation::Add(a, b), dimension, self.at(a).range.plus(self.at(b).range))
    }

    fn subtract(&mut self, a: Id, b: Id) -> Id {
        let dimension = self.dimension(a).or(self.dimension(b));
        let range = if a == b { Range::of(0.0) } else { self.at(a).range.plus(self.at(b).range.negative()) };
        self.make(Operation::Subtract(a, b), dimension, range)
    }

    fn multiplied(&self, a: Id, b: Id) -> Option<Dimension> {
        Some(self.dimension(a)?.times(self.dimension(b)?))
    }

    fn multiply(&mut self, a: Id, b: Id) -> Id {
        self.make(Operation::Multiply(a, b), self.multiplied(a, b), self.product_range(a, b))
    }

    fn product_range(&self, a: Id, b: Id) -> Range {
        if a == b { self.at(a).range.squared() } else { self.at(a).range.times(self.at(b).range) }
    }

    fn fused(&mut self, a: Id, b: Id, c: Id) -> Id {
        let range = self.product_range(a, b).plus(self.at(c).range);
        let range = self.blend(a, b, c).unwrap_or(range);
        self.make(Operation::Fused(a, b, c), self.multiplied(a, b).or(self.dimension(c)), range)
    }

    /// c + (x - c) w and x w + c (1 - w), with 0 <= w <= 1, are between c and x. An example is the level of a Stribeck
    /// curve. Interval arithmetic does not find this, because it treats the two c as independent.
    fn blend(&self, a: Id, b: Id, c: Id) -> Option<Range> {
        let weight = |w: Id| self.at(w).range.within(0.0, 1.0);
        let one_less = |id: Id, w: Id| match self.at(id).operation {
            Operation::Subtract(one, own) => own == w && self.number(one) == Some(1.0),
            _ => false,
        };
        let complement = |id: Id, w: Id| one_less(id, w) || one_less(w, id);
        [(a, b), (b, a)].into_iter().filter(|(_, w)| weight(*w)).find_map(|(x, w)| {
            let between = |x: Id, y: Id| self.at(x).range.or(self.at(y).range);
            match (self.at(x).operation, self.at(c).operation) {
                (Operation::Subtract(far, near), _) if near == c => Some(between(far, c)),
                (_, Operation::Multiply(y, rest)) if complement(rest, w) => Some(between(x, y)),
                (_, Operation::Multiply(rest, y)) if complement(rest, w) => Some(between(x, y)),
                _ => None,
            }
        })
    }

    fn divide(&mut self, a: Id, b: Id, divisor: Place) -> Lowered {
        self.not_zero(b, divisor)?;
        let inverse = self.at(b).range.inverse();
        let dimension = self.dimension(b).map(|own| own.to_power(-1.0));
        if self.at(b).constant && !self.at(a).constant {
            let one = self.constant(1.0);
            let inverse = self.make(Operation::Divide(one, b), dimension, inverse);
            return Ok(self.multiply(a, inverse));
        }
        let dimension = self.dimension(a).and_then(|own| Some(own.times(dimension?)));
        let range = if a == b { Range::of(1.0) } else { self.at(a).range.times(inverse) };
        Ok(self.make(Operation::Divide(a, b), dimension, range))
    }

    fn root(&mut self, a: Id, place: Place) -> Lowered {
        self.above_zero(a, "sqrt", place)?;
        let dimension = self.dimension(a).map(|own| own.to_power(0.5));
        Ok(self.make(Operation::Root(a), dimension, self.at(a).range.through(f64::sqrt)))
    }

    fn power(&mut self, base: Id, exponent: Id, places: [Place; 2]) -> Lowered {
        self.pure(exponent, "an exponent", places[1])?;
        match self.number(exponent) {
            Some(0.5) => return self.root(base, places[0]),
            Some(n) if n.fract() == 0.0 && n.abs() <= MOST_FACTORS => {
                return self.whole_power(base, n, places[0]);
            }
            _ => {}
        }
        let dimension = match (self.dimension(base), self.number(exponent)) {
            (Some(own), Some(n)) => own.to_power(n),
            (Some(own), None) if own != Dimension::NONE => {
                let what = format!("a power that is not a number needs a pure number as its base, not {own}");
                return Err(Problem::new(what, places[0], "Divide by a parameter of the same unit first."));
            }
            _ => Dimension::NONE,
        };
        self.above_zero(base, "a power that is not a whole number", places[0])?;
        let logarithm = self.at(base).range.through(f64::ln);
        let range = logarithm.times(self.at(exponent).range).saturating(f64::exp, 0.0, f64::INFINITY);
        Ok(self.make(Operation::Power(base, exponent), Some(dimension), range))
    }

    /// x^n as products: x x, (x x) x, (x x)(x x), ..
    fn whole_power(&mut self, base: Id, n: f64, place: Place) -> Lowered {
        let mut out: Option<Id> = None;
        let mut square = base;
        let mut left = n.abs() as u32;
        while left > 0 {
            if left & 1 == 1 {
                out = Some(match out {
                    Some(out) => self.multiply(square, out),
                    None => square,
                });
            }
            left >>= 1;
            if left > 0 {
                square = self.multiply(square, square);
            }
        }
        let Some(out) = out else { return Ok(self.constant(1.0)) };
        if n > 0.0 {
            return Ok(out);
        }
        let one = self.constant(1.0);
        self.divide(one, out, place)
    }

    fn select(&mut self, a: Id, b: Id, then: Id, otherwise: Id) -> Id {
        let dimension = self.dimension(then).or(self.dimension(otherwise));
        let range = self.at(then).range.or(self.at(otherwise).range);
        self.make(Operation::Select(a, b, then, otherwise), dimension, range)
    }

    // --- rules --------------------------------------------------------------------------------

    fn alike(&self, a: Id, b: Id, sign: &str, sides: &[Expression; 2]) -> Result<(), Problem> {
        same(self.dimension(a), self.dimension(b), sign, sides)
    }

    fn pure(&self, a: Id, what: &str, place: Place) -> Result<(), Problem> {
        match self.dimension(a) {
            Some(found) if found != Dimension::NONE => Err(Problem::new(
                format!("{what} needs a pure number, not {found}"),
                place,
                "Divide by a parameter of the same unit first.",
            )),
            _ => Ok(()),
        }
    }

    fn not_zero(&self, a: Id, place: Place) -> Result<(), Problem> {
        let range = self.at(a).range;
        if !range.contains(0.0) {
            return Ok(());
        }
        let what = format!("this divisor can be zero: its known range is {}", range.shown());
        let remedy = "Give the parameters in it bounds (above = 0), or keep it away from zero: max(x, 0.01*coulomb), \
                      x^2 + v0^2. Both sides of an if are always computed.";
        Err(Problem::new(what, place, remedy))
    }

    fn above_zero(&self, a: Id, what: &str, place: Place) -> Result<(), Problem> {
        let range = self.at(a).range;
        if range.positive() {
            return Ok(());
        }
        let what = format!("{what} needs a value above zero: its known range is {}", range.shown());
        let remedy = "Give the parameters in it bounds (above = 0), or keep it above zero: max(x, 1e-12), \
                      sqrt(v^2 + v0^2).";
        Err(Problem::new(what, place, remedy))
    }
}

fn named(name: &str, scope: &Scope, place: Place) -> Lowered {
    if let Some(id) = scope.get(name) {
        return Ok(*id);
    }
    if FUNCTIONS.iter().any(|(known, _)| *known == name) {
        return Err(Problem::new(format!("'{name}' is a function"), place, format!("Write {name}(...).")));
    }
    let remedy = nearest(name, scope.keys().map(String::as_str));
    Err(Problem::new(format!("the name '{name}' is unknown"), place, remedy))
}

fn same(
    a: Option<Dimension>,
    b: Option<Dimension>,
    sign: &str,
    sides: &[Expression; 2],
) -> Result<(), Problem> {
    match (a, b) {
        (Some(a), Some(b)) if a != b => {
            let place = sides[0].place.to(sides[1].place);
            Err(Problem::new(format!("{sign} needs the same unit on both sides, not {a} and {b}"), place, ""))
        }
        _ => Ok(()),
    }
}
