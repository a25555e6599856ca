//! Symbols of cylinders.

use crate::component::{Stroke, Symbol};

/// Draws the barrel with an opening for the rod on the right.
pub(super) const BARREL: Stroke =
    Stroke::Line(&[[12.0, 2.3], [12.0, 4.0], [0.0, 4.0], [0.0, 0.0], [12.0, 0.0], [12.0, 1.7]]);
pub(super) const PISTON: Stroke = Stroke::Line(&[[3.0, 0.0], [3.0, 4.0], [3.8, 4.0], [3.8, 0.0]]);
pub(super) const PORT_A: Stroke = Stroke::Line(&[[1.0, 0.0], [1.0, -1.0]]);
pub(super) const PORT_B: Stroke = Stroke::Line(&[[11.0, 0.0], [11.0, -1.0]]);
pub(super) const ROD: Stroke = Stroke::Line(&[[3.8, 2.3], [15.0, 2.3], [15.0, 1.7], [3.8, 1.7]]);
/// Draws cushions at the piston, with an arrow if they are adjustable.
pub(super) const CUSHIONS: &[(&str, &[Stroke])] = &[
    (
        "cushion_a_length",
        &[
            Stroke::Line(&[[2.2, 1.4], [2.2, 2.6], [3.0, 2.6], [3.0, 1.4], [2.2, 1.4]]),
            Stroke::Line(&[[2.0, 0.6], [4.9, 3.5]]),
            Stroke::Head([[5.2, 3.8], [4.65, 3.55], [4.95, 3.25]]),
        ],
    ),
    (
        "cushion_b_length",
        &[
            Stroke::Line(&[[3.8, 1.4], [4.6, 1.4], [4.6, 2.6], [3.8, 2.6]]),
            Stroke::Line(&[[2.0, 0.6], [4.9, 3.5]]),
            Stroke::Head([[5.2, 3.8], [4.65, 3.55], [4.95, 3.25]]),
        ],
    ),
];

pub(super) const SINGLE_ROD: Symbol = Symbol {
    strokes: &[BARREL, PISTON, PORT_A, PORT_B, ROD],
    when: CUSHIONS,
    ports: &[[1.0, -1.0], [11.0, -1.0], [15.0, 2.0]],
};
pub(super) const THROUGH_ROD: Symbol = Symbol {
    strokes: &[
        Stroke::Line(&[[0.0, 2.3], [0.0, 4.0], [12.0, 4.0], [12.0, 2.3]]),
        Stroke::Line(&[[0.0, 1.7], [0.0, 0.0], [12.0, 0.0], [12.0, 1.7]]),
        PISTON,
        PORT_A,
        PORT_B,
        ROD,
        Stroke::Line(&[[3.0, 2.3], [-3.0, 2.3], [-3.0, 1.7], [3.0, 1.7]]),
    ],
    ..SINGLE_ROD
};
pub(super) const RODLESS: Symbol = Symbol {
    strokes: &[
        Stroke::Line(&[[0.0, 0.0], [0.0, 4.0], [12.0, 4.0], [12.0, 0.0], [0.0, 0.0]]),
        PISTON,
        PORT_A,
        PORT_B,
        // Draws the carriage.
        Stroke::Line(&[[1.0, 4.5], [1.0, 6.0], [5.0, 6.0], [5.0, 4.5], [1.0, 4.5]]),
        Stroke::Line(&[[3.4, 4.0], [3.4, 4.5]]),
    ],
    ports: &[[1.0, -1.0], [11.0, -1.0], [3.0, 6.0]],
    ..SINGLE_ROD
};

pub(super) const TANDEM: Symbol = Symbol {
    strokes: &[
        Stroke::Line(&[[16.0, 2.3], [16.0, 4.0], [0.0, 4.0], [0.0, 0.0], [16.0, 0.0], [16.0, 1.7]]),
        Stroke::Line(&[[8.0, 0.0], [8.0, 1.7]]),
        Stroke::Line(&[[8.0, 2.3], [8.0, 4.0]]),
        Stroke::Line(&[[2.4, 0.0], [2.4, 4.0], [3.2, 4.0], [3.2, 0.0]]),
        Stroke::Line(&[[10.4, 0.0], [10.4, 4.0], [11.2, 4.0], [11.2, 0.0]]),
        Stroke::Line(&[[3.2, 2.3], [10.4, 2.3]]),
        Stroke::Line(&[[3.2, 1.7], [10.4, 1.7]]),
        Stroke::Line(&[[11.2, 2.3], [19.0, 2.3], [19.0, 1.7], [11.2, 1.7]]),
        Stroke::Line(&[[1.0, 0.0], [1.0, -1.0]]),
        Stroke::Line(&[[7.0, 0.0], [7.0, -1.0]]),
        Stroke::Line(&[[9.0, 0.0], [9.0, -1.0]]),
        Stroke::Line(&[[15.0, 0.0], [15.0, -1.0]]),
    ],
    when: &[],
    ports: &[[1.0, -1.0], [7.0, -1.0], [9.0, -1.0], [15.0, -1.0], [19.0, 2.0]],
};
