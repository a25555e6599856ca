//! Coefficients of Rosenbrock methods: a method is its coefficients.

mod rodas3;
mod rodas5p;
pub use rodas3::RODAS3;
pub use rodas5p::RODAS5P;

/// A stiffly accurate Rosenbrock-Wanner method with `S` stages, in the transformed form that needs
/// no product with the Jacobian (Hairer & Wanner, section IV.7):
///
///   `(I/(h gamma) - J) U_i = f(t + alpha_i h, y + sum_j a_ij U_j) + sum_j (c_ij/h) U_j + h gamma_i f_t`
///   `y1 = y + sum_i m_i U_i,     error = U_S`
///
/// `a` of the last stage with `m_S = 1` is `y1`: stiff accuracy, so `m` is not stored.
/// Dense output of order `dense_order`, with s = 1 - theta and K_l = sum_j h_lj U_j:
///
///   `y(t + theta h) = s y0 + theta (y1 + s (K_1 + theta (K_2 + theta K_3)))`
///
/// Source: [hairer1996].
#[derive(Debug)]
pub struct Rosenbrock<const S: usize> {
    /// Name as published.
    pub name: &'static str,
    /// Order of the solution.
    pub order: u32,
    /// Order of the embedded solution.
    pub error_order: u32,
    /// Order of the dense output.
    pub dense_order: u32,
    /// Diagonal coefficient.
    pub gamma: f64,
    /// Coefficients of earlier stages in the state of a stage.
    pub a: [[f64; S]; S],
    /// Coefficients of earlier stages in the right-hand side.
    pub c: [[f64; S]; S],
    /// Times of the stages, as fractions of the step.
    pub alpha: [f64; S],
    /// Coefficients of the derivative by time.
    pub gamma_t: [f64; S],
    /// Coefficients of the dense output.
    pub dense: [[f64; S]; 3],
    /// Key in references.bib.
    pub source: &'static str,
}
