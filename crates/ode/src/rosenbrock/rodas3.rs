use super::Rosenbrock;

/// Rodas3: order 3, embedded 2, L-stable, 4 stages, 3 right-hand sides and one Jacobian for each step. The
/// second stage is at the same point as the first. Dense output of order 2 is the quadratic with the rates of
/// the first two stages. Source: [sandu1997].
pub const RODAS3: Rosenbrock<4> = Rosenbrock {
    name: "Rodas3",
    order: 3,
    error_order: 2,
    dense_order: 2,
    gamma: 0.5,
    a: [[0.0; 4], [0.0; 4], [2.0, 0.0, 0.0, 0.0], [2.0, 0.0, 1.0, 0.0]],
    c: [[0.0; 4], [4.0, 0.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [1.0, -1.0, -8.0 / 3.0, 0.0]],
    alpha: [0.0, 0.0, 1.0, 1.0],
    gamma_t: [0.5, 1.5, 0.0, 0.0],
    dense: [[3.0, -1.0, 0.0, 0.0], [0.0; 4], [0.0; 4]],
    source: "sandu1997",
};
