//! Friction of a smooth pipe. Source: [modelica-straight-pipe].

use math::Real;

/// Reynolds numbers below which the flow is laminar and above which it is turbulent.
pub const LAMINAR: f64 = 2000.0;
const TURBULENT: f64 = 4000.0;

/// Returns the share of turbulent flow: 0 below Re 2000, 1 above Re 4000, smooth between.
#[inline(always)]
pub fn turbulent_share<S: Real>(reynolds: S) -> S {
    let u = ((reynolds - S::c(LAMINAR)) * S::c(1.0 / (TURBULENT - LAMINAR))).max(S::zero()).min(S::one());
    u * u * (S::c(3.0) - S::c(2.0) * u)
}

/// Returns the friction factor of turbulent flow times the Reynolds number, f Re = 0.3164 Re^0.75.
#[inline(always)]
fn turbulent<S: Real>(reynolds: S) -> S {
    let root = reynolds.sqrt();
    S::c(0.3164) * root * root.sqrt()
}

/// Returns the friction factor of turbulent flow.
#[inline(always)]
pub fn smooth_friction<S: Real>(reynolds: S) -> S {
    turbulent(reynolds) / reynolds
}

/// Returns the friction factor of a smooth pipe times the Reynolds number.
#[inline(always)]
pub fn friction<S: Real>(reynolds: S) -> S {
    let share = turbulent_share(reynolds);
    // The argument is never zero, so that its roots have a slope.
    let blasius = turbulent(reynolds.max(S::c(LAMINAR)));
    S::c(64.0).fma(S::one() - share, blasius * share)
}
