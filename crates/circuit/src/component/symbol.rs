/// A stroke of a symbol. Lengths are in modules, with x to the right and y up.
#[derive(Clone, Copy, Debug)]
pub enum Stroke {
    /// Line from point to point.
    Line(&'static [[f64; 2]]),
    /// Dashed line from point to point: a pilot line.
    Dashed(&'static [[f64; 2]]),
    /// Arc: centre, radius, and the start and end angles, deg, counterclockwise.
    Arc([f64; 2], f64, [f64; 2]),
    /// Filled circle: centre and radius.
    Dot([f64; 2], f64),
    /// Empty triangle.
    Triangle([[f64; 2]; 3]),
    /// Filled triangle: the head of an arrow, with its base point first.
    Head([[f64; 2]; 3]),
    /// Text centred at this point.
    Text([f64; 2], &'static str),
    /// Strokes moved by this offset, optionally after mirroring left and right.
    Moved(&'static [Stroke], [f64; 2], bool),
}

/// Drawing of a component, after ISO 1219: supply below, consumers above.
#[derive(Clone, Copy, Debug)]
pub struct Symbol {
    /// Strokes that are always drawn.
    pub strokes: &'static [Stroke],
    /// Strokes that are drawn if a choice has this option, or if the number with this key is given.
    pub when: &'static [(&'static str, &'static [Stroke])],
    /// Places of the ports in their order, at whole modules on the edge of the symbol.
    pub ports: &'static [[f64; 2]],
}

impl Stroke {
    /// Returns the strokes moved to the right.
    pub const fn at(strokes: &'static [Stroke], right: f64) -> Stroke {
        Stroke::Moved(strokes, [right, 0.0], false)
    }

    /// Returns their mirror image, moved to the right.
    pub const fn mirrored(strokes: &'static [Stroke], right: f64) -> Stroke {
        Stroke::Moved(strokes, [right, 0.0], true)
    }
}

impl Symbol {
    /// No symbol: a box with the title of the kind is drawn.
    pub const BOX: Symbol = Symbol { strokes: &[], when: &[], ports: &[] };
}
