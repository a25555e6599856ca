use std::fmt;

/// A piece of a formula, in characters from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// First byte.
    pub start: usize,
    /// Index after the last character.
    pub end: usize,
}

impl Place {
    pub(crate) fn to(self, end: Place) -> Place {
        Place { start: self.start, end: end.end }
    }
}

/// Reason for the rejection of a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The error.
    pub what: String,
    /// Its place in the formula.
    pub place: Option<Place>,
    /// The remedy.
    pub remedy: String,
}

impl Problem {
    /// Returns an error at a place, and its remedy.
    pub fn new(what: impl Into<String>, place: Place, remedy: impl Into<String>) -> Self {
        Problem { what: what.into(), place: Some(place), remedy: remedy.into() }
    }

    /// Returns an error that concerns the whole formula.
    pub fn of_all(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Problem { what: what.into(), place: None, remedy: remedy.into() }
    }

    /// Returns the line of the formula (from 1), the column (from 1), the text of that line, and a caret under the
    /// place.
    pub fn shown(&self, formula: &str) -> Option<(usize, usize, String, String)> {
        let place = self.place?;
        let before: Vec<char> = formula.chars().take(place.start).collect();
        let line = before.iter().filter(|c| **c == '\n').count();
        let column = before.iter().rev().take_while(|c| **c != '\n').count();
        let text = formula.split('\n').nth(line).unwrap_or("").trim_end().to_string();
        let length = (place.end - place.start).clamp(1, text.chars().count().saturating_sub(column).max(1));
        Some((line + 1, column + 1, text, format!("{}{}", " ".repeat(column), "^".repeat(length))))
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)
    }
}

/// Returns the most similar name, and all known names.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let mut known: Vec<&str> = known.collect();
    known.sort_unstable();
    let close = known.iter().map(|other| (distance(name, other), *other)).min();
    let guess = match close {
        Some((d, other)) if d <= 1 + other.chars().count() / 4 => format!("Did you mean '{other}'? "),
        _ => String::new(),
    };
    format!("{guess}Known: {}.", known.join(", "))
}

/// Returns the number of letters to insert, omit or change.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let changed = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
