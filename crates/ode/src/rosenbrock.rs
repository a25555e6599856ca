//! Coefficients of Rosenbrock methods: a method is its coefficients.

mod rodas5p;
pub use rodas5p::RODAS5P;

/// A stiffly accurate Rosenbrock-Wanner method with `S` stages, in the transformed form that needs
/// no product with the Jacobian (Hairer & Wanner, section IV.7):
///
///   (I/(h gamma) - J) U_i = f(t + alpha_i h, y + sum_j a_ij U_j) + sum_j (c_ij/h) U_j + h gamma_i f_t
///   y1 = y + sum_i m_i U_i,     error = U_S
///
/// `a` of the last stage with `m_S = 1` is `y1`: stiff accuracy, so `m` is not stored.
/// Dense output of order `dense_order`, with s = 1 - theta and K_l = sum_j h_lj U_j:
///
///   y(t + theta h) = s y0 + theta (y1 + s (K_1 + theta (K_2 + theta K_3)))
///
/// Source: [hairer1996].
#[derive(Debug)]
pub struct Rosenbrock<const S: usize> {
    pub name: &'static str,
    pub order: u32,
    pub error_order: u32,
    pub dense_order: u32,
    pub gamma: f64,
    pub a: [[f64; S]; S],
    pub c: [[f64; S]; S],
    pub alpha: [f64; S],
    pub gamma_t: [f64; S],
    pub dense: [[f64; S]; 3],
    pub source: &'static str,
}
