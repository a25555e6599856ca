use crate::problem::{Place, Problem};
use crate::token::{Token, tokens};

/// Largest length of a formula, in characters.
pub const MOST_CHARACTERS: usize = 4000;
/// Deepest nesting of parentheses, signs and powers.
const DEEPEST: usize = 60;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Number(f64),
    Name(String),
    Negative(Box<Expression>),
    /// Two operands with one of + - * / ^ < <= > >= and or.
    Pair(&'static str, Box<[Expression; 2]>),
    Not(Box<Expression>),
    Call(String, Vec<Expression>),
}

/// A parsed formula, with the place of each part in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    pub(crate) kind: Kind,
    pub(crate) place: Place,
}

/// Reads a formula.
pub fn parse(formula: &str) -> Result<Expression, Problem> {
    let length = formula.chars().count();
    if length > MOST_CHARACTERS {
        let what = format!("the formula has {length} characters, more than the limit {MOST_CHARACTERS}");
        return Err(Problem::of_all(what, "Split it by [let]."));
    }
    let tokens = tokens(formula)?;
    if tokens.is_empty() {
        return Err(Problem::of_all(
            "the formula is empty",
            "Write an expression, for example \"coulomb*tanh(v/v0)\".",
        ));
    }
    let mut parser = Parser { tokens, at: 0, depth: 0, end: Place { start: length, end: length } };
    let out = parser.level(0)?;
    match parser.tokens.get(parser.at) {
        None => Ok(out),
        Some((Token::Sign(")"), place)) => Err(Problem::new("this ) has no matching (", *place, "")),
        Some((_, place)) => Err(Problem::new(
            "a sign is missing before this",
            *place,
            "A product needs its sign: 2*v, not 2 v.",
        )),
    }
}

struct Parser {
    tokens: Vec<(Token, Place)>,
    at: usize,
    depth: usize,
    end: Place,
}

/// Binary operators in levels of precedence, the weakest first; each level associates to the left. `not` is placed
/// before level 2.
const LEVELS: [&[&str]; 5] = [&["or"], &["and"], &["<=", ">=", "<", ">"], &["+", "-"], &["*", "/"]];
const COMPARISON: usize = 2;

impl Parser {
    fn place(&self) -> Place {
        self.tokens.get(self.at).map_or(self.end, |(_, place)| *place)
    }

    /// Takes the next token if it is `sign`.
    fn takes(&mut self, sign: &'static str) -> bool {
        let is = match self.tokens.get(self.at) {
            Some((Token::Sign(found), _)) => *found == sign,
            Some((Token::Name(found), _)) => found == sign,
            _ => false,
        };
        self.at += usize::from(is);
        is
    }

    fn deeper(&mut self) -> Result<(), Problem> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let what = format!("the formula is nested deeper than {DEEPEST}");
            return Err(Problem::new(what, self.place(), "Give parts of it names in [let]."));
        }
        Ok(())
    }

    fn level(&mut self, level: usize) -> Result<Expression, Problem> {
        let Some(signs) = LEVELS.get(level) else { return self.signed() };
        let start = self.place();
        if level == COMPARISON && self.takes("not") {
            self.deeper()?;
            let of = self.level(COMPARISON)?;
            self.depth -= 1;
            return Ok(Expression { place: start.to(of.place), kind: Kind::Not(Box::new(of)) });
        }
        let mut left = self.level(level + 1)?;
        while let Some(sign) = signs.iter().find(|sign| self.takes(sign)) {
            if level == COMPARISON
                && matches!(&left.kind, Kind::Pair(other, _) if LEVELS[COMPARISON].contains(other))
            {
                let what = "comparisons are not chained";
                return Err(Problem::new(what, left.place, "Write a < b and b < c."));
            }
            let right = self.level(level + 1)?;
            let place = left.place.to(right.place);
            left = Expression { kind: Kind::Pair(sign, Box::new([left, right])), place };
        }
        Ok(left)
    }

    /// -x^2 is -(x^2); x^-2 is x^(-2).
    fn signed(&mut self) -> Result<Expression, Problem> {
        let start = self.place();
        self.deeper()?;
        let out = if self.takes("-") {
            let of = self.signed()?;
            Expression { place: start.to(of.place), kind: Kind::Negative(Box::new(of)) }
        } else if self.takes("+") {
            self.signed()?
        } else {
            self.power()?
        };
        self.depth -= 1;
        Ok(out)
    }

    fn power(&mut self) -> Result<Expression, Problem> {
        let base = self.atom()?;
        if !self.takes("^") {
            return Ok(base);
        }
        let exponent = self.signed()?;
        let place = base.place.to(exponent.place);
        Ok(Expression { kind: Kind::Pair("^", Box::new([base, exponent])), place })
    }

    fn atom(&mut self) -> Result<Expression, Problem> {
        let place = self.place();
        let Some((token, _)) = self.tokens.get(self.at).cloned() else {
            let what = if self.at == 0 { "the formula is empty" } else { "the formula ends too early" };
            return Err(Problem::new(what, place, "A value is missing here."));
        };
        self.at += 1;
        match token {
            Token::Number(value) => Ok(Expression { kind: Kind::Number(value), place }),
            Token::Name(name) if matches!(&*name, "and" | "or" | "not") => {
                Err(Problem::new(format!("a value is missing before `{name}`"), place, ""))
            }
            Token::Name(name) if self.takes("(") => {
                let (arguments, end) = self.arguments(place)?;
                Ok(Expression { kind: Kind::Call(name, arguments), place: place.to(end) })
            }
            Token::Name(name) => Ok(Expression { kind: Kind::Name(name), place }),
            Token::Sign("(") => {
                self.deeper()?;
                let mut inner = self.level(0)?;
                self.depth -= 1;
                let end = self.close(place)?;
                inner.place = place.to(end);
                Ok(inner)
            }
            Token::Sign(sign) => Err(Problem::new(format!("a value is missing before {sign}"), place, "")),
        }
    }

    fn close(&mut self, open: Place) -> Result<Place, Problem> {
        let place = self.place();
        if self.takes(")") {
            return Ok(place);
        }
        if self.at < self.tokens.len() {
            return Err(Problem::new(
                "a sign or ) is missing before this",
                place,
                "A product needs its sign: 2*v.",
            ));
        }
        Err(Problem::new("this ( is not closed", open, "Add a )."))
    }

    fn arguments(&mut self, name: Place) -> Result<(Vec<Expression>, Place), Problem> {
        let open = Place { start: name.end, end: name.end + 1 };
        let mut out = Vec::new();
        self.deeper()?;
        let place = self.place();
        if self.takes(")") {
            self.depth -= 1;
            return Ok((out, place));
        }
        loop {
            out.push(self.level(0)?);
            if !self.takes(",") {
                break;
            }
        }
        self.depth -= 1;
        let end = self.close(open)?;
        Ok((out, end))
    }
}
