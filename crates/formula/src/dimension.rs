use std::fmt;

/// A dimension as powers of m, kg, s and K.
#[derive(Clone, Copy, Debug)]
pub struct Dimension([f64; 4]);

const BASE: [&str; 4] = ["m", "kg", "s", "K"];
/// Powers that differ by less are equal, because fractions such as thirds are not exact.
const SAME: f64 = 1e-9;

/// SI units without prefix.
const UNITS: [(&str, [f64; 4]); 11] = [
    ("m", [1.0, 0.0, 0.0, 0.0]),
    ("kg", [0.0, 1.0, 0.0, 0.0]),
    ("s", [0.0, 0.0, 1.0, 0.0]),
    ("K", [0.0, 0.0, 0.0, 1.0]),
    ("N", [1.0, 1.0, -2.0, 0.0]),
    ("Pa", [-1.0, 1.0, -2.0, 0.0]),
    ("J", [2.0, 1.0, -2.0, 0.0]),
    ("W", [2.0, 1.0, -3.0, 0.0]),
    ("Hz", [0.0, 0.0, -1.0, 0.0]),
    ("rad", [0.0; 4]),
    ("1", [0.0; 4]),
];

/// Units of friction as written in messages.
const SPOKEN: [&str; 27] = [
    "m", "kg", "s", "K", "N", "Pa", "J", "W", "m/s", "m/s2", "1/s", "1/m", "1/Pa", "1/K", "N/m", "N s/m",
    "N s2/m2", "N m", "N/s", "N/K", "Pa/s", "1/m2", "m2", "m3", "s/m", "1/N", "m/N",
];

impl Dimension {
    /// Returns the dimension of a pure number.
    pub const NONE: Self = Dimension([0.0; 4]);

    /// Reads an SI unit: `N s/m`, `1/Pa`, `W/(m2 K)`; `-` or nothing for a pure number.
    pub fn of_unit(unit: &str) -> Result<Self, String> {
        let clean = unit.replace(['^', '·', '*'], " ").replace('²', "2").replace('³', "3");
        // `^` may be written between symbol and power: "m^2" has become "m 2".
        let mut text = String::new();
        for c in clean.chars() {
            if (c.is_ascii_digit() || c == '-') && text.ends_with(' ') && unit.contains('^') {
                text.pop();
            }
            text.push(c);
        }
        if matches!(text.trim(), "" | "-") {
            return Ok(Self::NONE);
        }
        let mut parts = text.split('/');
        let mut total = product(parts.next().unwrap_or(""))?;
        for divisor in parts {
            total = total.over(product(divisor)?);
        }
        Ok(total)
    }

    /// Returns the dimension of a product.
    pub fn times(self, other: Self) -> Self {
        Dimension(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    /// Returns the dimension of a quotient.
    pub fn over(self, other: Self) -> Self {
        self.times(other.to_power(-1.0))
    }

    /// Returns the dimension of a power.
    pub fn to_power(self, power: f64) -> Self {
        Dimension(self.0.map(|own| own * power))
    }
}

impl PartialEq for Dimension {
    fn eq(&self, other: &Self) -> bool {
        self.0.iter().zip(other.0).all(|(a, b)| (a - b).abs() < SAME)
    }
}

/// Reads a product of symbols with powers, with or without parentheses.
fn product(text: &str) -> Result<Dimension, String> {
    let text = text.trim();
    let text = text.strip_prefix('(').and_then(|text| text.strip_suffix(')')).unwrap_or(text);
    if text.is_empty() {
        return Err("a unit is missing next to /".into());
    }
    let mut total = Dimension::NONE;
    for factor in text.split_whitespace() {
        let letters =
            if factor == "1" { 1 } else { factor.chars().take_while(|c| c.is_alphabetic()).count() };
        let split = factor.char_indices().nth(letters).map_or(factor.len(), |(at, _)| at);
        let (symbol, power) = factor.split_at(split);
        let Some((_, base)) = UNITS.iter().find(|(name, _)| *name == symbol) else {
            return Err(format!("\"{factor}\" is not an SI unit without prefix"));
        };
        let power = match power {
            "" => 1.0,
            power => power.parse::<i8>().map_err(|_| format!("\"{power}\" is not a power of a unit"))?.into(),
        };
        total = total.times(Dimension(*base).to_power(power));
    }
    Ok(total)
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE {
            return write!(f, "a pure number");
        }
        if let Some(name) = SPOKEN.iter().find(|name| Self::of_unit(name).as_ref() == Ok(self)) {
            return write!(f, "{name}");
        }
        let part =
            |sign: f64| -> Vec<String> {
                let powers = BASE.iter().zip(self.0).filter(|(_, p)| p * sign > SAME);
                powers
                    .map(|(name, p)| {
                        if (p.abs() - 1.0).abs() < SAME {
                            (*name).into()
                        } else {
                            format!("{name}{}", p.abs())
                        }
                    })
                    .collect()
            };
        let (above, below) = (part(1.0), part(-1.0));
        let above = if above.is_empty() { "1".to_string() } else { above.join(" ") };
        match below.len() {
            0 => write!(f, "{above}"),
            1 => write!(f, "{above}/{}", below[0]),
            _ => write!(f, "{above}/({})", below.join(" ")),
        }
    }
}
