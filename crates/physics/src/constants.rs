//! Physical and standard constants, each defined once in Rust. `pneudrive/constants.py` has those for Python, and a
//! test checks that the two agree.

/// Standard acceleration of gravity, m/s2 (exact by definition). Source: [bipm2019].
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Density of the standard reference atmosphere of ISO 8778 (20 degC, 100 kPa, 65 % relative
/// humidity), kg/m3, to which a sonic conductance refers. Source: [iso6358-2013].
pub const RHO_0: f64 = 1.185;
/// Temperature of the standard reference atmosphere, K. Source: [iso6358-2013].
pub const T_0: f64 = 293.15;
/// Pressure of the standard reference atmosphere, Pa. Source: [iso6358-2013].
pub const P_0: f64 = 1e5;

/// Dry air: ratio of specific heats, -. Conductances of components are measured with it. Source: [assumed], the usual value.
pub const AIR_HEAT_CAPACITY_RATIO: f64 = 1.4;
/// Dry air: specific gas constant, J/(kg K). Source: [assumed], the usual value.
pub const AIR_GAS_CONSTANT: f64 = 287.05;
