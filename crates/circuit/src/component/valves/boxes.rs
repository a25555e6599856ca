//! Parts of valve symbols: boxes of 4 modules, flows within a box around its middle, actuators.

use crate::component::Stroke;

pub(in crate::component) const TWO_BOXES: Stroke = Stroke::at(
    &[
        Stroke::Line(&[[-4.0, 0.0], [-4.0, 4.0], [4.0, 4.0], [4.0, 0.0], [-4.0, 0.0]]),
        Stroke::Line(&[[0.0, 0.0], [0.0, 4.0]]),
    ],
    0.0,
);
pub(in crate::component) const THREE_BOXES: Stroke = Stroke::at(
    &[
        Stroke::Line(&[[-6.0, 0.0], [-6.0, 4.0], [6.0, 4.0], [6.0, 0.0], [-6.0, 0.0]]),
        Stroke::Line(&[[-2.0, 0.0], [-2.0, 4.0]]),
        Stroke::Line(&[[2.0, 0.0], [2.0, 4.0]]),
    ],
    0.0,
);

/// Lines that mark a valve that can take any position between these boxes.
pub(in crate::component) const ENDLESS: Stroke =
    Stroke::at(&[Stroke::Line(&[[-6.0, 4.4], [6.0, 4.4]]), Stroke::Line(&[[-6.0, -0.4], [6.0, -0.4]])], 0.0);

/// Lines of a port below the boxes, and of a port above.
pub(in crate::component) const BELOW: &[Stroke] = &[Stroke::Line(&[[0.0, 0.0], [0.0, -1.0]])];
pub(in crate::component) const ABOVE: &[Stroke] = &[Stroke::Line(&[[0.0, 4.0], [0.0, 5.0]])];
/// A closed port below, and one above.
pub(in crate::component) const SHUT: &[Stroke] =
    &[Stroke::Line(&[[0.0, 0.0], [0.0, 0.7]]), Stroke::Line(&[[-0.3, 0.7], [0.3, 0.7]])];
pub(in crate::component) const SHUT_ABOVE: &[Stroke] =
    &[Stroke::Line(&[[0.0, 4.0], [0.0, 3.3]]), Stroke::Line(&[[-0.3, 3.3], [0.3, 3.3]])];

pub(in crate::component) const UP: &[Stroke] =
    &[Stroke::Line(&[[0.0, 0.0], [0.0, 4.0]]), Stroke::Head([[0.0, 4.0], [-0.35, 3.15], [0.35, 3.15]])];
/// Flows of three ports: 1 to 2 with 3 shut, and 2 to 3 with 1 shut.
pub(in crate::component) const FEEDS: &[Stroke] = &[Stroke::at(UP, -1.0), Stroke::at(SHUT, 1.0)];
pub(in crate::component) const VENTS: &[Stroke] = &[
    Stroke::Line(&[[-1.0, 4.0], [1.0, 0.0]]),
    Stroke::Head([[1.0, 0.0], [0.93, 0.92], [0.31, 0.6]]),
    Stroke::at(SHUT, -1.0),
];
/// Flows of five ports: 1 to 2 on the right, from above, and both with 3 shut.
const SLANTS: &[Stroke] =
    &[Stroke::Line(&[[0.0, 0.0], [1.0, 4.0]]), Stroke::Head([[1.0, 4.0], [0.45, 3.26], [1.13, 3.09]])];
const DOWN: &[Stroke] =
    &[Stroke::Line(&[[0.0, 4.0], [0.0, 0.0]]), Stroke::Head([[0.0, 0.0], [-0.35, 0.85], [0.35, 0.85]])];
const CROSSES: &[Stroke] = &[Stroke::at(SLANTS, 0.0), Stroke::at(DOWN, -1.0), Stroke::at(SHUT, 1.0)];

/// Actuators on the right of a box: a solenoid, a spring.
pub(in crate::component) const SOLENOID: &[Stroke] = &[
    Stroke::Line(&[[0.0, 1.0], [2.0, 1.0], [2.0, 3.0], [0.0, 3.0]]),
    Stroke::Line(&[[1.3, 3.0], [0.7, 1.0]]),
];
pub(in crate::component) const SPRING: &[Stroke] =
    &[Stroke::Line(&[[0.0, 2.0], [0.2, 2.6], [0.6, 1.4], [1.0, 2.6], [1.4, 1.4], [1.8, 2.6], [2.0, 2.0]])];
/// An arrow crosses a symbol with stepless adjustment.
pub(in crate::component) const ARROW: &[Stroke] =
    &[Stroke::Line(&[[0.0, 0.6], [1.4, 3.2]]), Stroke::Head([[1.7, 3.7], [1.15, 3.25], [1.6, 3.0]])];
/// A ball in its seat, held by a spring.
pub(in crate::component) const CHECK: Stroke = Stroke::at(
    &[
        Stroke::Line(&[[0.0, 0.0], [0.0, 1.2]]),
        Stroke::Line(&[[-0.9, 2.1], [0.0, 1.2], [0.9, 2.1]]),
        Stroke::Arc([0.0, 2.05], 0.6, [0.0, 360.0]),
        Stroke::Line(&[
            [0.0, 2.65],
            [0.35, 2.75],
            [-0.35, 2.95],
            [0.35, 3.15],
            [-0.35, 3.35],
            [0.0, 3.45],
            [0.0, 4.0],
        ]),
    ],
    0.0,
);

/// Symbol of a 5/2 valve with the right box at rest and a solenoid on the left. The second list has the places of its
/// ports 1, 2, 4, 3, 5.
pub(in crate::component) const FIVE_TWO: Stroke = Stroke::at(
    &[
        TWO_BOXES,
        Stroke::mirrored(SOLENOID, -4.0),
        Stroke::at(BELOW, 1.0),
        Stroke::at(BELOW, 2.0),
        Stroke::at(BELOW, 3.0),
        Stroke::at(ABOVE, 1.0),
        Stroke::at(ABOVE, 3.0),
        Stroke::at(CROSSES, 2.0),
        Stroke::mirrored(CROSSES, -2.0),
    ],
    0.0,
);
pub(in crate::component) const FIVE_TWO_PORTS: &[[f64; 2]] =
    &[[2.0, -1.0], [1.0, 5.0], [3.0, 5.0], [1.0, -1.0], [3.0, -1.0]];

/// Symbol of a 5/3 valve between two solenoids, the options of its centre, and the places of its ports.
pub(in crate::component) const FIVE_THREE: Stroke = Stroke::at(
    &[
        THREE_BOXES,
        Stroke::mirrored(SOLENOID, -6.0),
        Stroke::at(SOLENOID, 6.0),
        Stroke::at(BELOW, -1.0),
        Stroke::at(BELOW, 0.0),
        Stroke::at(BELOW, 1.0),
        Stroke::at(ABOVE, -1.0),
        Stroke::at(ABOVE, 1.0),
        Stroke::mirrored(CROSSES, -4.0),
        Stroke::at(CROSSES, 4.0),
    ],
    0.0,
);
pub(in crate::component) const CLOSED: &[Stroke] = &[
    Stroke::at(SHUT, -1.0),
    Stroke::at(SHUT, 0.0),
    Stroke::at(SHUT, 1.0),
    Stroke::at(SHUT_ABOVE, -1.0),
    Stroke::at(SHUT_ABOVE, 1.0),
];
pub(in crate::component) const EXHAUSTS: &[Stroke] =
    &[Stroke::at(DOWN, -1.0), Stroke::at(DOWN, 1.0), Stroke::at(SHUT, 0.0)];
pub(in crate::component) const PRESSURISES: &[Stroke] =
    &[Stroke::mirrored(SLANTS, 0.0), Stroke::at(SLANTS, 0.0), Stroke::at(SHUT, -1.0), Stroke::at(SHUT, 1.0)];
pub(in crate::component) const FIVE_THREE_PORTS: &[[f64; 2]] =
    &[[0.0, -1.0], [-1.0, 5.0], [1.0, 5.0], [-1.0, -1.0], [1.0, -1.0]];
