/// A stroke of a symbol; lengths in modules, x to the right, y up.
#[derive(Clone, Copy, Debug)]
pub enum Stroke {
    /// From point to point.
    Line(&'static [[f64; 2]]),
    /// The same, dashed: a pilot line.
    Dashed(&'static [[f64; 2]]),
    /// Centre, radius, and the angles, deg, from which to which it goes counterclockwise.
    Arc([f64; 2], f64, [f64; 2]),
    /// Centre and radius, filled.
    Dot([f64; 2], f64),
    /// Three corners, empty.
    Triangle([[f64; 2]; 3]),
    /// Three corners, filled: the head of an arrow that begins at the first one.
    Head([[f64; 2]; 3]),
    /// About this point.
    Text([f64; 2], &'static str),
    /// Strokes moved by this much, after left and right have changed places where asked.
    Moved(&'static [Stroke], [f64; 2], bool),
}

/// Drawing of a component, after ISO 1219: supply below, consumers above.
#[derive(Clone, Copy, Debug)]
pub struct Symbol {
    /// Strokes that are always drawn.
    pub strokes: &'static [Stroke],
    /// Strokes that are drawn where a choice has this option, or where the number with this key is given.
    pub when: &'static [(&'static str, &'static [Stroke])],
    /// Places of the ports in their order, on whole modules at the rim of the symbol.
    pub ports: &'static [[f64; 2]],
}

impl Stroke {
    /// The same strokes, further to the right.
    pub const fn at(strokes: &'static [Stroke], right: f64) -> Stroke {
        Stroke::Moved(strokes, [right, 0.0], false)
    }

    /// Their mirror image, further to the right.
    pub const fn mirrored(strokes: &'static [Stroke], right: f64) -> Stroke {
        Stroke::Moved(strokes, [right, 0.0], true)
    }
}

impl Symbol {
    /// No symbol: a box with the title of the kind is drawn.
    pub const BOX: Symbol = Symbol { strokes: &[], when: &[], ports: &[] };
}
