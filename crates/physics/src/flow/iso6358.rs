use crate::constants::{P_0, RHO_0, T_0};
use crate::gas::IdealGas;
use math::{Over, Real, power};

/// Pressure ratio above which the flow is linear, unless a drive specifies it (assumed).
pub const LINEAR_ABOVE: f64 = 0.999;

/// Largest critical ratio of a check valve relative to its closing ratio, and least closing ratio (assumed). Both
/// matter only if the upstream pressure is hardly above the cracking pressure.
const MOST_OF_CRACKED: f64 = 0.9;
const LEAST_CRACKED: f64 = 1e-3;

/// The gas at one end of a flow path.
#[derive(Clone, Copy, Debug)]
pub struct End<S> {
    /// Pressure, Pa.
    pub p: S,
    /// 1/p, 1/Pa.
    pub inverse_p: S,
    /// p/sqrt(T), to which choked flow out of it is proportional, Pa/K^0.5.
    pub choked: S,
}

impl<S: Real> End<S> {
    /// Creates the end at a pressure, Pa, with 1/sqrt(T), 1/K^0.5.
    #[inline(always)]
    pub fn at(p: S, inverse_sqrt_t: S) -> Self {
        End { p, inverse_p: S::one() / p, choked: p * inverse_sqrt_t }
    }
}

crate::parameters! {
    /// Mass flow through a pneumatic component, with r = p2/p1 and p1 the upstream pressure:
    ///
    ///   `m_dot = C p1 rho0 sqrt(T0/T1) phi(r)                                   [kg/s]`
    ///   `phi = 1                                    r <= b          (choked)`
    ///   `phi = [1 - ((r - b)/(1 - b))^2]^m          b < r <= beta   (subsonic)`
    ///   `phi = phi(beta) (1 - r)/(1 - beta)         beta < r <= 1   (linear)`
    ///
    /// * `C`: sonic conductance, m3/(s Pa).
    /// * `b`: critical pressure ratio.
    /// * `m`: subsonic index.
    /// * `T1`: upstream temperature, K.
    /// * `beta`: ratio above which the flow is linear, because the standard's law has an infinite slope at r = 1.
    ///
    /// The ratio beta is a modelling parameter. The position of the reference drive moves by about 20 um between 0.999 and 0.9999.
    ///
    /// The flow is odd in the ends. C is measured with air. Another gas flows with C_air sqrt(R/R_air) psi(k)/psi(k_air)
    /// and rho0 = 100 kPa/(R T0), see `for_gas`. Source: [iso6358-2013].
    pub struct Iso6358 {
        /// Sonic conductance C, for air
        conductance: "m3/(s Pa)", crate::above(0.0);
        /// Critical pressure ratio b
        critical_pressure_ratio: "-", crate::between(0.0, 1.0);
        /// Subsonic index m
        subsonic_index: "-", crate::above(0.0), default 0.5;
        /// Pressure ratio above which the flow is linear in 1 - r
        linear_above: "-", crate::between(0.0, 1.0), default LINEAR_ABOVE;
        /// Derived: C rho0 sqrt(T0) of the flowing gas
        gain: "kg K^0.5/(s Pa)", crate::above(0.0);
        /// Derived: 1/(1 - b)
        inverse_span: "-", crate::above(0.0);
        /// Derived: bracket of the subsonic law at `linear_above`
        bracket_at_linear: "-", crate::above(0.0);
        /// Derived: slope of the linear part
        linear_slope: "-", crate::above(0.0);
    } with {
        /// Whether the index is 0.5: a square root instead of a power
        elliptic: bool,
    }
}

math::mapped!(Iso6358 {
    conductance, critical_pressure_ratio, subsonic_index, linear_above, gain, inverse_span, bracket_at_linear, linear_slope
} parts {} same { elliptic });

/// Returns psi(k) of choked flow of an ideal gas, (2/(k+1))^((k+1)/(2(k-1))) sqrt(k). Conductances of two gases in the
/// same orifice are proportional to sqrt(R) psi. Source: [iso6358-2013].
pub fn choked_factor<P: Real>(k: P) -> P {
    let (one, two) = (P::one(), P::c(2.0));
    k.sqrt() * (two / (k + one)).pow((k + one) / (two * (k - one)))
}

/// Returns 1/(1 - b), the bracket of the subsonic law at `linear_above`, and the slope of the linear part.
#[inline(always)]
fn shape<S: Real>(b: S, m: S, linear_above: S, elliptic: bool) -> [S; 3] {
    let inverse_span = S::one() / (S::one() - b);
    let q = (linear_above - b) * inverse_span;
    let bracket_at_linear = S::one() - q * q;
    let phi = if elliptic { bracket_at_linear.sqrt() } else { bracket_at_linear.pow(m) };
    [inverse_span, bracket_at_linear, phi / (S::one() - linear_above)]
}

impl<P: Real> Iso6358<P> {
    /// Returns the law of a component with sonic conductance `c`, measured with air, for the flow of `gas`.
    pub fn for_gas(
        c: P,
        b: P,
        m: P,
        linear_above: P,
        elliptic: bool,
        gas: &IdealGas<P>,
        is_air: bool,
    ) -> Self {
        let [inverse_span, bracket_at_linear, linear_slope] = shape(b, m, linear_above, elliptic);
        let (density, c_gas) = if is_air {
            (P::c(RHO_0), c)
        } else {
            let air = IdealGas::air();
            let ratio = (gas.gas_constant / P::c(air.gas_constant)).sqrt()
                * choked_factor(gas.heat_capacity_ratio)
                / choked_factor(P::c(air.heat_capacity_ratio));
            (P::c(P_0) / (gas.gas_constant * P::c(T_0)), c * ratio)
        };
        Iso6358 {
            conductance: c,
            critical_pressure_ratio: b,
            subsonic_index: m,
            linear_above,
            gain: c_gas * density * P::c(T_0).sqrt(),
            inverse_span,
            bracket_at_linear,
            linear_slope,
            elliptic,
        }
    }

    /// Returns the same law with another critical pressure ratio.
    #[inline(always)]
    pub fn with_ratio<S: Over<P>>(&self, b: S) -> Iso6358<S> {
        let own = self.map(S::from);
        let [inverse_span, bracket_at_linear, linear_slope] =
            shape(b, own.subsonic_index, own.linear_above, own.elliptic);
        Iso6358 { critical_pressure_ratio: b, inverse_span, bracket_at_linear, linear_slope, ..own }
    }

    /// Returns phi(r), 0 <= r <= 1.
    #[inline(always)]
    pub fn phi<S: Over<P>>(&self, r: S) -> S {
        let b = S::from(self.critical_pressure_ratio);
        let q = r.times_plus(self.inverse_span, S::from(-(self.critical_pressure_ratio * self.inverse_span)));
        let bracket = (-q).fma(q, S::one()).max(S::from(self.bracket_at_linear));
        let subsonic =
            if self.elliptic { bracket.sqrt() } else { power(bracket, S::from(self.subsonic_index)) };
        let linear = (S::one() - r).times(self.linear_slope);
        let above_critical = S::select(S::from(self.linear_above).lt(r), linear, subsonic);
        S::select(b.lt(r), above_critical, S::one())
    }

    /// Returns the mass flow from end 1 to end 2 only, kg/s, through a valve that opens against a spring. The ratio 1
    /// is replaced by r_c = 1 - p_c/p1, with the cracking pressure p_c, Pa. `w1` is 1/sqrt(T1):
    ///
    ///   `phi(r; r_c) = [1 - ((r - b)/(r_c - b))^2]^m                                     b < r <= r_c`
    ///
    /// This is the usual phi at b + (r - b)(1 - b)/(r_c - b), with its linear part, and zero above r_c. If p1 is near
    /// p_c and r_c near b, b is limited to [`MOST_OF_CRACKED`] of r_c. Source: [iso6358-2013].
    #[inline(always)]
    pub fn one_way<S: Over<P>>(&self, cracking: S, p1: S, w1: S, p2: S) -> S {
        let (one, b) = (S::one(), S::from(self.critical_pressure_ratio));
        let ends = (one - cracking / p1).max(S::c(LEAST_CRACKED));
        let critical = b.min(S::c(MOST_OF_CRACKED) * ends);
        let r = b + (p2 / p1 - critical) * (one - b) / (ends - critical);
        S::from(self.gain) * p1 * w1 * self.phi(r.min(one))
    }

    /// Returns the mass flow from end 1 to end 2, kg/s, through the fraction `opening` of the conductance, and the mask
    /// of flow from 2 to 1. `w` is 1/sqrt(T) at each end.
    #[inline(always)]
    pub fn mass_flow<S: Over<P>>(&self, opening: S, p1: S, w1: S, p2: S, w2: S) -> (S, S::Mask) {
        self.flow(opening, &End::at(p1, w1), &End::at(p2, w2))
    }

    /// Returns the same between two ends.
    #[inline(always)]
    pub fn flow<S: Over<P>>(&self, opening: S, one: &End<S>, two: &End<S>) -> (S, S::Mask) {
        let backward = one.p.lt(two.p);
        let choked = opening.times(self.gain) * self.choked(backward, one, two);
        (choked * self.share(backward, one, two), backward)
    }

    /// Returns the choked flow from end 1 to end 2 for a gain of one, in either direction, Pa/K^0.5.
    #[inline(always)]
    pub fn choked<S: Over<P>>(&self, backward: S::Mask, one: &End<S>, two: &End<S>) -> S {
        S::select(backward, -two.choked, one.choked)
    }

    /// Returns the passing fraction of the choked flow: phi of the pressure ratio.
    #[inline(always)]
    pub fn share<S: Over<P>>(&self, backward: S::Mask, one: &End<S>, two: &End<S>) -> S {
        self.phi(S::select(backward, one.p * two.inverse_p, two.p * one.inverse_p))
    }
}
