use math::Real;

/// Opening of a valve edge by a position: the fraction clip(offset + slope x, 0, 1) of its conductance.
#[inline(always)]
pub fn opened<S: Real>(offset: S, slope: S, x: S) -> S {
    slope.fma(x, offset).max(S::zero()).min(S::one())
}

/// Returns the leaking fraction of the conductance of an edge with the spool at x: l exp(-|x|/x_l), with l at the
/// centre (assumed shape).
#[inline(always)]
pub fn leaking<S: Real>(leak: S, width: S, x: S) -> S {
    leak * (-x.abs() / width).exp()
}
