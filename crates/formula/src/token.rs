use crate::problem::{Place, Problem};

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    Number(f64),
    Name(String),
    /// One of + - * / ^ ( ) , < > <= >=
    Sign(&'static str),
}

const SIGNS: [&str; 13] = ["<=", ">=", "**", "+", "-", "*", "/", "^", "(", ")", ",", "<", ">"];

/// Returns the tokens of a formula with their places.
pub(crate) fn tokens(formula: &str) -> Result<Vec<(Token, Place)>, Problem> {
    let text: Vec<char> = formula.chars().collect();
    let mut out = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let c = text[at];
        if c.is_whitespace() {
            at += 1;
            continue;
        }
        let start = at;
        let token = if c.is_ascii_digit() || (c == '.' && text.get(at + 1).is_some_and(char::is_ascii_digit))
        {
            at = number_end(&text, at);
            number(&text[start..at], Place { start, end: at })?
        } else if c.is_ascii_alphabetic() || c == '_' {
            while at < text.len() && (text[at].is_ascii_alphanumeric() || text[at] == '_') {
                at += 1;
            }
            Token::Name(text[start..at].iter().collect())
        } else {
            let sign =
                SIGNS.into_iter().find(|sign| sign.chars().eq(text[at..].iter().copied().take(sign.len())));
            at += sign.map_or(1, str::len);
            let place = Place { start, end: at };
            match sign {
                Some("**") => return Err(Problem::new("a power is written ^", place, "Write x^2.")),
                Some(sign) => Token::Sign(sign),
                None => return Err(foreign(c, place)),
            }
        };
        out.push((token, Place { start, end: at }));
    }
    Ok(out)
}

fn foreign(c: char, place: Place) -> Problem {
    let remedy = match c {
        '=' | '!' => "Conditions are written with <, <=, >, >= inside if(condition, a, b).",
        '&' | '|' => "Conditions are joined by `and`, `or`, `not`.",
        '[' | ']' | '{' | '}' => "Write ( and ).",
        ';' => "Separate the arguments of a function by commas.",
        '²' | '³' => "A power is written ^2 or ^3.",
        '·' | '×' => "A product is written *.",
        '−' | '–' => "A minus is written - (the plain one).",
        _ => "Names are letters, digits and _; signs are + - * / ^ ( ) , < <= > >=.",
    };
    Problem::new(format!("the character '{c}' has no meaning here"), place, remedy)
}

/// Returns the end of a number that begins at `at`. A letter after the number counts as part of it.
fn number_end(text: &[char], mut at: usize) -> usize {
    while at < text.len() {
        let exponent_sign = matches!(text[at], '+' | '-') && matches!(text[at - 1], 'e' | 'E');
        if !(text[at].is_ascii_alphanumeric() || matches!(text[at], '.' | '_') || exponent_sign) {
            break;
        }
        at += 1;
    }
    at
}

fn number(text: &[char], place: Place) -> Result<Token, Problem> {
    let text: String = text.iter().collect();
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Token::Number(value)),
        Ok(_) => Err(Problem::new(format!("{text} is too large for a number"), place, "")),
        Err(_) => Err(Problem::new(
            format!("\"{text}\" is neither a number nor a name"),
            place,
            "A product needs its sign: 2*v. A number carries no unit: a quantity with a unit is a parameter.",
        )),
    }
}
